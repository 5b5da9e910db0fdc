"""``hmc run``: all trials of a session, and their report."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from hmc.cli.common import add_workers_option, camera_names, output_path, whole_number
from hmc.cli.one_trial import TrialOptions, pose_arguments, run_trial
from hmc.errors import InputError, system_words
from hmc.io.files import real_path

__all__ = ["add_parser", "run"]

#: Of the environment: the process with which this one is to end.
PARENT = "HMC_PARENT"
EXIT_FAULT, EXIT_INPUT, EXIT_INTERRUPTED = 1, 2, 130


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Add the command to the parser."""
    parser = subparsers.add_parser(
        "run",
        help="all trials of a session, and a report",
        description="Check, track, pose and draw every trial of a session, each into a folder of its name, and write report.html. A run "
        "that was stopped goes on where it was when it is started again; trials that are finished are not repeated unless a recording or a "
        "setting changed. A trial that fails does not stop the others: it is told at the end, by the exit code too (2: input was wrong).",
    )
    parser.add_argument("session", type=Path, metavar="SESSION", help="session.toml, or its folder")
    parser.add_argument("--out", type=output_path, required=True, metavar="DIR", help="folder of the results")
    parser.add_argument(
        "--trials",
        type=camera_names,
        default=None,
        metavar="A,B,...",
        help="these trials only; * and ? stand for any letters (default: all)",
    )
    add_workers_option(parser)
    parser.add_argument(
        "--parallel", type=whole_number, default=1, metavar="N", help="so many trials at once, which share the workers (default: 1)"
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask scheduler, as tcp://10.0.0.1:8786, whose workers run a trial each; files must lie at the same place everywhere",
    )
    parser.add_argument("--video", action="store_true", help="write a video of the overlays too")
    parser.add_argument("--quiet", action="store_true", help="no progress bars")
    parser.add_argument("--no-report", action="store_true", help="leave report.html as it is")
    return parser


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from hmc.processes import available_processors, end_with
    from hmc.trials.session_file import chosen_trials, read_session

    if os.environ.get(PARENT):
        end_with(int(os.environ.pop(PARENT)))
    if args.out.is_file():
        raise InputError(f"--out {args.out}: is a file; give a folder")
    if args.scheduler is not None and args.parallel > 1:
        raise InputError("--parallel and --scheduler: leave one of both out; a scheduler runs as many trials at once as it has workers")
    session = read_session(args.session)
    trials = chosen_trials(session, args.trials)
    options = TrialOptions(args.out, args.workers, args.video, args.quiet)
    for trial in trials:
        pose_arguments(session, trial, options)  # what the session says of all trials is refused before any work is done
    names, parallel = [trial.name for trial in trials], max(1, min(args.parallel, len(trials)))
    if args.scheduler is not None:
        codes = dict(_by_scheduler(session.path, options, names, args.scheduler))
    elif parallel > 1:
        share = max(1, (args.workers or available_processors()) // parallel)
        codes = dict(_side_by_side(session.path, replace(options, workers=share), names, parallel))
    else:
        codes = dict(_in_turn(session, trials, options))
    _tell(session, trials, args.out)
    if not args.no_report:
        _report(session, args.out)
    return EXIT_INPUT if EXIT_INPUT in codes.values() else EXIT_FAULT if any(codes.values()) else 0


def _in_turn(session, trials: Sequence, options: TrialOptions) -> Iterator[tuple[str, int]]:
    """Trials one after the other in this process: each name with its exit code."""
    for k, trial in enumerate(trials, 1):
        print(f"== {trial.name} ({k} of {len(trials)})", flush=True)
        try:
            run_trial(session, trial, options)
            yield trial.name, 0
        except InputError as error:
            print(f"hmc run: {trial.name}: {error}", file=sys.stderr)
            yield trial.name, EXIT_INPUT
        except OSError as error:
            if error.errno is None:
                traceback.print_exc()
            else:
                print(f"hmc run: {trial.name}: {system_words(error)}", file=sys.stderr)
            yield trial.name, EXIT_FAULT if error.errno is None else EXIT_INPUT
        except Exception:  # one trial must not cost the others of a night's run
            traceback.print_exc()
            yield trial.name, EXIT_FAULT


def _side_by_side(session: Path, options: TrialOptions, names: Sequence[str], parallel: int) -> Iterator[tuple[str, int]]:
    """Trials in processes of their own, so many at once."""
    from concurrent.futures import ThreadPoolExecutor, as_completed

    pool = ThreadPoolExecutor(parallel)
    begun = {pool.submit(run_apart, session, options, {"trial": name}): name for name in names}
    try:
        for future in as_completed(begun):
            name, code = begun[future], future.result()
            print(f"== {name}: {'done' if code == 0 else 'failed'}", flush=True)
            yield name, code
    finally:
        pool.shutdown(cancel_futures=True)


def _by_scheduler(session: Path, options: TrialOptions, names: Sequence[str], scheduler: str) -> Iterator[tuple[str, int]]:
    """Trials by the workers of a Dask scheduler."""
    from hmc.experiments.engine.cluster import spread

    there = replace(options, out=real_path(options.out))
    failed = list(filter(None, spread(partial(_remote, real_path(session), there), [{"trial": name} for name in names], scheduler)))
    for name in names:
        words = next((one for one in failed if one.startswith(f"{name}\n") or f"'{name}'" in one), None)
        code = 0 if words is None else int(words.rpartition("\n")[2]) if words.startswith(f"{name}\n") else EXIT_FAULT
        yield name, code


def _remote(session: Path, options: TrialOptions, parameters: Mapping[str, Any]) -> tuple[Path, str, str]:
    """A trial on a worker: nothing to be stored, and its exit code where it failed."""
    code = run_apart(session, options, parameters)
    return Path(), "", f"{parameters['trial']}\n{code}" if code else ""


def run_apart(session: Path, options: TrialOptions, parameters: Mapping[str, Any]) -> int:
    """Run a trial in a process of its own, which ends with this one; what it says goes to the trial's log. The exit code."""
    from hmc.trials.state import FAILED, only_one, read_state, write_state

    name = parameters["trial"]
    folder = options.out / name
    folder.mkdir(parents=True, exist_ok=True)
    words = ["--workers", str(options.workers), "--quiet", "--no-report", *["--video"] * options.video]
    with open(folder / "log.txt", "a", encoding="utf-8") as log:
        call = [sys.executable, "-m", "hmc", "run", str(session), "--out", str(options.out), "--trials", name, *words]
        code = subprocess.run(call, stdout=log, stderr=log, check=False, env={**os.environ, PARENT: str(os.getpid())}).returncode
    if code not in (0, EXIT_FAULT, EXIT_INPUT, EXIT_INTERRUPTED):
        with only_one(folder):
            state = read_state(folder)
            write_state(
                folder, replace(state, status=FAILED, fault=f"its process ended by itself (exit code {code}); is the memory exhausted?")
            )
        return EXIT_FAULT
    return code


def _tell(session, trials: Sequence, out: Path) -> None:
    """A line for every trial of this call, and how many of the session failed."""
    from hmc.trials.page import problems_of
    from hmc.trials.quality import read_trial_result
    from hmc.trials.state import DONE, FAILED, read_state

    failed, done = [], 0
    for trial in trials:
        state = read_state(out / trial.name)
        failed += [trial.name] if state.status == FAILED else []
        done += state.status == DONE
        result = None if state.status == FAILED else read_trial_result(out / trial.name)
        if result is None:
            print(f"{trial.name}: {state.status}{': ' * bool(state.fault)}{state.fault}")
            continue
        people, problems = result.n_persons, len(problems_of(state, result))
        print(
            f"{trial.name}: {state.status}, {result.n_frames} frames, {people} person{'s' * (people != 1)}, "
            f"{problems} problem{'s' * (problems != 1)}, {sum(state.seconds.values()):.0f} s"
        )
    print(f"{done} of {len(trials)} trials done" + f"; failed: {', '.join(failed)}" * bool(failed))


def _report(session, out: Path) -> None:
    from hmc.io.files import atomic_write
    from hmc.trials.page import session_page

    page = out / "report.html"
    with atomic_write(page) as file:
        file.write(session_page(session, out))
    print(f"wrote {page}")
