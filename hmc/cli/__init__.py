"""The command line: ``python -m hmc COMMAND ...``.

Every command is a module of this package with ``add_parser(subparsers)`` and ``run(args) -> exit code``; a command's heavy imports
belong inside its ``run``, so that ``--help`` is quick.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence
from contextlib import suppress

from hmc import __version__
from hmc.errors import InputError, as_interrupts, is_utf8, system_words

__all__ = ["command_parser", "main", "make_parser", "repeated"]

COMMANDS = (
    "check", "world", "sync", "synth", "track", "pose", "evaluate", "view", "export", "angles", "run", "experiments", "cite", "completion",
)  # fmt: skip

EXIT_WORKER = 1
EXIT_INPUT = 2
EXIT_INTERRUPTED = 130


def make_parser(command: str | None = None) -> argparse.ArgumentParser:
    """The argument parser; with ``command``, only that command's module is imported."""
    parser = argparse.ArgumentParser(
        prog="hmc",
        description="Where people are and what pose they take, from calibrated videos and without markers.",
        epilog="Each command explains itself: hmc COMMAND --help",
    )
    parser.add_argument("--version", action="version", version=f"hmc {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND")
    for name in COMMANDS if command not in COMMANDS else (command,):
        if importlib.util.find_spec(f"hmc.cli.{name}") is not None:
            module = importlib.import_module(f"hmc.cli.{name}")
            module.add_parser(subparsers)
            subparsers.choices[name].set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments; by default those of the process.

    Returns
    -------
    int
        Exit code: 0 done, 1 a process that shared the work ended by itself, 2 the input was wrong (one line on stderr says what), 130
        interrupted.
    """
    # FFmpeg's own complaints about a damaged video would bury the one line that says which; OpenCV reads these on its first use.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    # Matrices are small here: threads of linear algebra would wait for one another, and results would depend on how many there are.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    _open_what_is_closed()
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, OSError, ValueError):  # of another kind, or closed
            # A name may hold signs that the terminal's encoding has not.
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    argv = list(sys.argv[1:] if argv is None else argv)
    for word in (*argv, _here()):
        if not is_utf8(word):
            print(f"hmc: {word!r} is no text in UTF-8; rename that file or folder", file=sys.stderr)
            return EXIT_INPUT
    asked = f"hmc {argv[0]}" if argv and argv[0] in COMMANDS else "hmc"
    try:
        if argv[:1] == ["experiments"]:
            from hmc.cli.experiments import hand_over

            return hand_over(argv[1:])
        parser = make_parser(argv[0] if argv else None)  # imports the command's module, which may take a second
        args = parser.parse_args(argv)
        if args.command is None:
            parser.print_help()
            return 0
        with as_interrupts():
            if getattr(args, "like", None) is not None:
                args = repeated(parser, args, argv)
            code = args.run(args)
            sys.stdout.flush()
            return code or 0
    except InputError as error:
        print(f"{asked}: {error}", file=sys.stderr)
        return EXIT_INPUT
    except BrokenPipeError:
        # The reader of a pipe went away (`| head`); point stdout elsewhere, or the interpreter complains when it closes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except ChildProcessError as error:
        print(f"{asked}: {error} Try --workers 1; what is done is kept.", file=sys.stderr)
        return EXIT_WORKER
    except OSError as error:
        if error.errno is None:
            raise
        print(f"{asked}: {system_words(error)}", file=sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt:
        print(f"{asked}: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def _open_what_is_closed() -> None:
    """Standard streams that a process was begun without (`>&-`, some schedulers) lead nowhere. Else the next file that is opened would bear
    their number, and what decoders and other processes say would get into it."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))


def _here() -> str:
    try:
        return os.getcwd()
    except OSError:
        return ""  # it was removed, which is told by what looks for a file in it


def repeated(parser: argparse.ArgumentParser, args: argparse.Namespace, argv: Sequence[str]) -> argparse.Namespace:
    """The arguments with those of the run of ``--like`` where nothing is said."""
    from hmc.cli.option_tables import like_words

    return parser.parse_args([argv[0], *like_words(command_parser(parser, args.command), args), *argv[1:]])


def command_parser(parser: argparse.ArgumentParser, command: str) -> argparse.ArgumentParser:
    """The parser of one command."""
    (subparsers,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return subparsers.choices[command]
