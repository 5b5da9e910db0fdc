"""A command's options as a table: kept in ``run.toml``, repeated by ``--like``, and given in a session's file."""

from __future__ import annotations

import argparse
import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hmc.errors import InputError
from hmc.io.files import real_path

__all__ = ["add_like_option", "arguments_of", "known_options", "like_words", "repeated_preset", "told_options"]

#: What is of one call, and not of the result.
OF_A_CALL = frozenset({"command", "run", "recording", "out", "quiet", "workers", "like", "session", "settings"})
#: What decides which preset a method has.
OF_A_PRESET = ("method", "preset", "model", "init")


def add_like_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--like``."""
    parser.add_argument(
        "--like",
        type=Path,
        metavar="run.toml",
        help="repeat a run: what is not said here is as that run had it, frames and cameras too",
    )


def told_options(args: argparse.Namespace) -> dict[str, Any]:
    """The options of a call, for ``run.toml``: those that decide its result, with where files lie in full."""
    plain = {name: _told(value) for name, value in vars(args).items() if name not in OF_A_CALL}
    return {"command": args.command, **{name: value for name, value in plain.items() if value is not None}}


def _told(value: Any) -> Any:
    if isinstance(value, list):
        return [_told(one) for one in value]
    return str(real_path(value)) if isinstance(value, Path) else value


def like_words(parser: argparse.ArgumentParser, args: argparse.Namespace) -> list[str]:
    """The options of the run of ``--like`` as words of a command line, to stand before those that are said.

    Parameters
    ----------
    parser : ArgumentParser
        The command's.
    args : Namespace
        What is said.

    Raises
    ------
    InputError
        When that is no file of a run, or of another command, or what it holds are no options.
    """
    options = dict(_run(args.like).get("options", {}))
    command = options.pop("command", None)
    if command is None:
        raise InputError(f"--like {args.like}: does not say with which options it was made; give the run.toml of a run of this version")
    if command != args.command:
        raise InputError(f"--like {args.like}: was made by `hmc {command}`, not by `hmc {args.command}`")
    # Options that add up take the place of the run's, where any are given.
    adding = {name for name, action in known_options(parser).items() if isinstance(action, argparse._AppendAction)}
    kept = {name: value for name, value in options.items() if not (name in adding and getattr(args, name))}
    return arguments_of(parser, kept, f"--like {args.like}: [options]", args.like.parent)


def repeated_preset(args: argparse.Namespace) -> tuple[str, Mapping[str, Any]] | None:
    """The values of the preset of ``--like``, with the file's name; None where there is none, or another method or preset is said."""
    if args.like is None:
        return None
    run = _run(args.like)
    options, now = run["options"], told_options(args)
    if any(options.get(name) != now.get(name) for name in OF_A_PRESET):
        return None
    preset = run.get("parameters", {}).get("preset")
    return None if preset is None else (str(args.like), preset)


def _run(path: Path) -> dict[str, Any]:
    from hmc.io.results import read_run

    try:
        return read_run(path)
    except InputError as error:
        raise InputError(f"--like {error}") from None


def known_options(parser: argparse.ArgumentParser) -> dict[str, argparse.Action]:
    """The options that a table may have, by their names."""
    named = {option[2:].replace("-", "_"): action for action in parser._actions for option in action.option_strings if option[:2] == "--"}
    return {
        name: action for name, action in named.items() if name not in (OF_A_CALL | {"help"}) - {"like", "settings"} and name[:3] != "no_"
    }


def arguments_of(parser: argparse.ArgumentParser, table: Mapping[str, Any], where: str, folder: Path) -> list[str]:
    """A table of options as the words of a command line.

    Parameters
    ----------
    parser : ArgumentParser
        The command's.
    table : mapping
        By the options' names without dashes in front; those within may be written as _ too.
    where : str
        For messages.
    folder : Path
        From which paths are.

    Raises
    ------
    InputError
        When a name or a value is wrong: one line that has all faults.
    """
    known, words, faults = known_options(parser), list[str](), list[str]()
    for key, value in table.items():
        name = key.replace("-", "_")
        if name not in known:
            near = difflib.get_close_matches(name, known, 1, 0.0)[0]
            faults.append(f"unknown option `{key}`; did you mean `{near}`?")
            continue
        try:
            words += _words(known[name], name, value, folder)
        except (ValueError, argparse.ArgumentTypeError) as error:
            faults.append(f"`{key}`: {error}")
    if faults:
        raise InputError(f"{where}: {'; '.join(faults)}")
    return words


def _words(action: argparse.Action, name: str, value: Any, folder: Path) -> list[str]:
    option = "--" + name.replace("_", "-")
    if action.nargs == 0 or isinstance(action, argparse.BooleanOptionalAction):
        if not isinstance(value, bool):
            raise ValueError(f"must be true or false; got {value!r}")
        return [option] if value else ["--no-" + option[2:]] if isinstance(action, argparse.BooleanOptionalAction) else []
    if isinstance(value, bool) and action.const is not None and action.nargs == "?":
        return [option] if value else []
    if isinstance(action, argparse._AppendAction):
        return [word for one in (value if isinstance(value, list) else [value]) for word in (option, _word(action, one, folder))]
    return [option, _word(action, ",".join(map(str, value)) if isinstance(value, list) else value, folder)]


def _word(action: argparse.Action, value: Any, folder: Path) -> str:
    if not isinstance(value, str | int | float) or isinstance(value, bool):
        raise ValueError(f"must be a text or a number; got {value!r}")
    if action.type is Path:
        return str(real_path(folder / str(value)))
    word = str(value)
    made = action.type(word) if callable(action.type) else word
    if action.choices is not None and made not in action.choices:
        raise ValueError(f"must be one of {', '.join(map(str, action.choices))}; got {value!r}")
    return word
