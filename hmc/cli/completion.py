"""``hmc completion SHELL``: a script by which a shell completes the words of hmc's command lines, made from the parsers."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from hmc.cli.shells import SHELLS, CompletedCommand, CompletedOption

__all__ = ["add_parser", "completed_commands", "run"]

#: Where no sentence ends before, a description is cut here.
MOST_LETTERS = 70


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "completion",
        help="a script that completes these commands in your shell",
        description='Print a script for a shell, made from the options of this version. bash: eval "$(hmc completion bash)" in ~/.bashrc; '
        "zsh: hmc completion zsh > _hmc in a folder of $fpath; fish: hmc completion fish > ~/.config/fish/completions/hmc.fish",
    )
    parser.add_argument("shell", choices=tuple(SHELLS), help="which shell")
    return parser


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from hmc.cli import make_parser
    from hmc.experiments.__main__ import make_parser as make_experiments_parser

    commands = [
        *completed_commands(make_parser()),
        *(
            CompletedCommand(("experiments", *one.path), one.help, one.options, one.words, one.files)
            for one in completed_commands(make_experiments_parser())
            if one.path
        ),
    ]
    print(SHELLS[args.shell](commands), end="")
    return 0


def completed_commands(parser: argparse.ArgumentParser, path: tuple[str, ...] = (), help: str = "") -> list[CompletedCommand]:
    """What may be completed of a parser and of the commands in it, the parser itself first.

    Parameters
    ----------
    parser : ArgumentParser
    path : tuple of str
        The words that lead to it.
    help : str
        What it does.
    """
    options, words, files, below = [], list[str](), False, list[CompletedCommand]()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {one.dest: one.help or "" for one in action._choices_actions}
            for name, child in action.choices.items():
                below += completed_commands(child, (*path, name), helps.get(name, ""))
        elif action.option_strings:
            takes = action.nargs != 0 and not isinstance(action, argparse.BooleanOptionalAction)
            options.append(
                CompletedOption(tuple(action.option_strings), _line(parser, action), takes, tuple(_values(action)), action.type is Path)
            )
        else:
            words += _values(action, path)
            files |= action.type is Path or action.dest in ("recipe", "what")
    return [CompletedCommand(path, help, tuple(options), tuple(words), files), *below]


def _values(action: argparse.Action, path: Sequence[str] = ()) -> Iterator[str]:
    """Words that an option or an argument may be; those of the registries where it names what is in them."""
    if action.choices is not None:
        yield from map(str, action.choices)
    elif action.dest in ("method", "tracker", "preset", "track_preset"):
        from hmc.pose.registry import METHODS
        from hmc.tracking.trackers import TRACKERS

        of_methods = (preset for entry in METHODS.values() for preset in entry.presets)
        of_trackers = (preset for entry in TRACKERS.values() for preset in entry.presets)
        named: dict[str, Iterable[str]] = {"method": METHODS, "tracker": TRACKERS, "preset": of_methods, "track_preset": of_trackers}
        yield from dict.fromkeys(named[action.dest])
    elif action.dest == "recipe":
        from hmc.synthetic.recipe import shipped_recipes

        yield from shipped_recipes()
    elif action.dest == "what" and "cite" in path:
        from hmc.citations import known_names

        yield from known_names()
    elif action.dest == "ids":
        from hmc.experiments.engine.library import EXPERIMENTS

        yield from EXPERIMENTS


def _line(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """What an option's help says, up to the first pause."""
    text = parser._get_formatter()._expand_help(action) if action.help else ""
    text = re.split(r"; | \(default|, such|: (?=[a-z-]+: )", " ".join(text.split()))[0]
    return text if len(text) <= MOST_LETTERS else text[:MOST_LETTERS].rsplit(" ", 1)[0] + " ..."
