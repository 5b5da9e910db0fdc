"""``python -m hmc.experiments list | run ID... | status | merge FOLDER... | report | humaneva FOLDER``."""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from pathlib import Path

from hmc.errors import InputError, as_interrupts
from hmc.experiments.engine.experiment import Cell, Experiment, Plan
from hmc.experiments.engine.library import EXPERIMENTS, find_experiment
from hmc.experiments.engine.selection import changed_plan, grid_of, read_settings
from hmc.experiments.engine.sweep import plan_for, plan_of, run_experiment, stored_cells
from hmc.experiments.engine.writing import write_report
from hmc.plugins import add_plugins

#: What wrong input, a failed cell and an interrupt leave as exit code.
EXIT_INPUT, EXIT_FAILED, EXIT_INTERRUPTED = 2, 1, 130


def main(argv: list[str] | None = None, prog: str = "python -m hmc.experiments") -> int:
    """Run the command line, which is called `prog`; returns the exit code."""
    args = make_parser(prog).parse_args(argv)
    try:
        with as_interrupts():
            add_plugins(getattr(args, "plugin", ()))
            return args.act(args)
    except InputError as error:
        _tell(f"hmc.experiments: {error}", sys.stderr)
        return EXIT_INPUT
    except KeyboardInterrupt:
        _tell("hmc.experiments: interrupted; what is computed stays, the same command goes on", sys.stderr)
        return EXIT_INTERRUPTED


def make_parser(prog: str = "python -m hmc.experiments") -> argparse.ArgumentParser:
    """The parser of `hmc experiments`."""
    parser = argparse.ArgumentParser(prog=prog, description="The papers' tables and figures, computed again.")
    actions = parser.add_subparsers(required=True, metavar="{list,run,status,merge,report,humaneva}")
    listing = actions.add_parser("list", help="all experiments")
    listing.set_defaults(act=_list)
    run = actions.add_parser("run", help="compute experiments and write their tables and figures")
    run.add_argument("ids", nargs="+", metavar="ID", help="experiments, 'all', or a Python file that holds one")
    run.add_argument("--workers", type=_count, default=os.cpu_count() or 1, metavar="N", help="processes (default: one a core)")
    run.add_argument(
        "--backend",
        choices=("joblib", "dask"),
        default="joblib",
        help="joblib: processes here (default); dask: those of a scheduler",
    )
    run.add_argument("--scheduler", metavar="ADDRESS", help="of the Dask scheduler, as tcp://10.0.0.1:8786; with --backend dask")
    run.add_argument("--again", action="store_true", help="compute stored cells anew")
    run.add_argument("--quiet", action="store_true", help="no progress bar")
    run.set_defaults(act=_run)
    status = actions.add_parser("status", help="how much of each experiment is computed")
    status.add_argument("ids", nargs="*", metavar="ID", help="experiments (default: all)")
    status.set_defaults(act=_status)
    merge = actions.add_parser("merge", help="bring the cells that several machines computed together")
    merge.add_argument("others", type=Path, nargs="+", metavar="FOLDER", help="folders of runs, as their --out")
    merge.set_defaults(act=_merge)
    report = actions.add_parser("report", help="one page of all that is computed, and how it compares with the papers")
    report.set_defaults(act=_report)
    for action in (run, status, merge, report):
        action.add_argument("--out", type=Path, default=Path("experiments"), metavar="DIR", help="folder of cells, inputs and reports")
    for action in (run, status, report):
        action.add_argument(
            "--plugin",
            type=Path,
            action="append",
            default=[],
            metavar="FILE.py",
            help="a file that registers methods or trackers",
        )
    for action in (run, status):
        action.add_argument("--quick", action="store_true", help="a small grid that shows the shape, in minutes")
        action.add_argument(
            "--recordings",
            type=Path,
            nargs="+",
            default=[],
            metavar="FOLDER",
            help="your recordings, or recipes by name, in place of the rendered ones",
        )
        action.add_argument("--seeds", type=_count, metavar="N", help="so many seeds of every cell that draws at random")
        action.add_argument("--frames", type=_count, metavar="N", help="the first N frames of every recording")
        action.add_argument("--cameras", type=_count, metavar="N", help="N cameras of every recording, evenly spread")
        action.add_argument("--actions", nargs="+", default=[], metavar="NAME", help="rendered recordings of these actions, as walk box")
        action.add_argument(
            "--set", action="append", default=[], metavar="KEY=VALUE", help="a parameter that all cells are to have, as layers=6"
        )
        action.add_argument(
            "--keep", action="append", default=[], metavar="KEY=VALUE", help="of the grid the cells with this value, or one of [A, B]"
        )
    dataset = actions.add_parser("humaneva", help="make recordings of a copy of HumanEva-I")
    dataset.add_argument("root", type=Path, metavar="FOLDER", help="the dataset, with S1, S2 and so on in it, or one of these")
    dataset.add_argument("--out", type=Path, default=Path("recordings"), metavar="DIR", help="where the recordings go")
    dataset.add_argument("--only", nargs="+", default=[], metavar="NAME", help="these alone, as S1_Walking_1")
    dataset.add_argument("--frames", type=_count, metavar="N", help="at most so many frames of each")
    dataset.set_defaults(act=_humaneva)
    return parser


def _list(args: argparse.Namespace) -> int:
    for name in EXPERIMENTS:
        experiment = find_experiment(name)
        full, quick = (experiment.grid(Plan(quick)) for quick in (False, True))
        names = dict.fromkeys(cell["recording"].rpartition("@")[0] for cell in full if "recording" in cell)
        what = f"on {', '.join(names)}" if names else "on no recording"
        _tell(f"{name:14} {experiment.title} ({experiment.source}): {len(full)} cells, quick {len(quick)}, {what}")
    return 0


def _run(args: argparse.Namespace) -> int:
    if (args.backend == "dask") != (args.scheduler is not None):
        raise InputError("--backend dask and --scheduler ADDRESS go together: the address is what `dask scheduler` prints")
    asked = _plan(args)
    out = _folder(args.out)
    names = _names(args.ids)
    experiments = {name: find_experiment(name) for name in names}  # wrong ids are told before anything is computed
    failed = []
    for name, experiment in experiments.items():
        try:
            done = _run_one(name, experiment, out, asked, args)
        except Exception as error:
            if len(names) == 1:
                raise
            # One experiment that cannot be computed must not cost the rest of a night's run.
            _tell(f"{experiment.id}: {error if isinstance(error, InputError) else traceback.format_exc()}", sys.stderr)
            done = False
        failed += [] if done else [experiment.id]
    if failed and len(names) > 1:
        _tell(f"hmc.experiments: {len(failed)} of {len(names)} experiments failed: {', '.join(failed)}", sys.stderr)
    return EXIT_FAILED if failed else 0


def _run_one(name: str, experiment: Experiment, out: Path, asked: Plan, args: argparse.Namespace) -> bool:
    """Compute an experiment, write its report and tell of it; False where cells failed."""
    from tqdm import tqdm

    from hmc.experiments.engine.style import house_style

    plan = plan_for(experiment, asked)
    if plan is not asked:
        _tell(f"{experiment.id}: is computed on no recording, so --recordings changes nothing", sys.stderr)
    with house_style(), tqdm(desc=experiment.id, unit="cell", dynamic_ncols=True, disable=args.quiet, file=sys.stderr) as bar:

        def show(done: int, total: int) -> None:
            if bar.total is None:
                bar.reset(total)
                bar.initial = bar.n = done  # found cells say nothing of the speed
            bar.update(done - bar.n)

        outcome = run_experiment(name, out, plan, args.workers, args.again, show, args.scheduler)
        folder = write_report(out, experiment, plan, outcome.report) if outcome.report else None
    _tell(f"{experiment.id}: {outcome.computed} cells computed, {outcome.found} found")
    for failure in outcome.failures:
        _tell(failure, sys.stderr)
    if outcome.report is None:
        _tell(f"{experiment.id}: {len(outcome.failures)} cells failed; the same command tries them again", sys.stderr)
        return False
    for claim in outcome.report.claims:
        _tell(f"  {claim.verdict:9} {claim.text}{': ' if claim.detail else ''}{claim.detail}")
    _tell(f"  wrote {folder}")
    return True


def _status(args: argparse.Namespace) -> int:
    asked = _plan(args)
    for name in _names(args.ids or ["all"]):
        experiment = find_experiment(name)
        plan = plan_for(experiment, asked)
        cells = stored_cells(experiment, args.out, grid_of(experiment, plan))
        done = [cell for cell in cells if cell is not None]
        _tell(f"{experiment.id:14} {len(done):5} of {len(cells):5} cells{_left(done, len(cells))}")
    return 0


def _merge(args: argparse.Namespace) -> int:
    from hmc.experiments.engine.merging import merge_stores

    merged = merge_stores(_folder(args.out), args.others)
    _tell(f"{args.out}: {_cells(merged.copied)} copied, {merged.same + len(merged.different)} were here")
    for paths, what in (
        (merged.damaged, "damaged and left"),
        (merged.old, "of an earlier version, or altered, and left"),
        (merged.different, "here with other results, which stay; measured times differ, anything else means that the code did"),
    ):
        if paths:
            _tell(
                f"{_cells(len(paths))} {'is' if len(paths) == 1 else 'are'} {what}: {paths[0]}{' and more' * (len(paths) > 1)}", sys.stderr
            )
    return EXIT_FAILED if merged.damaged else 0


def _report(args: argparse.Namespace) -> int:
    from hmc.experiments.engine.markdown import to_markdown
    from hmc.experiments.engine.page import to_html, verdict_counts
    from hmc.experiments.engine.summary import summarise
    from hmc.io.files import atomic_write

    rows = summarise(args.out)
    page, text = (_folder(args.out) / f"report.{kind}" for kind in ("html", "md"))
    for path, content in ((page, to_html(rows)), (text, to_markdown(rows, "."))):
        with atomic_write(path) as file:
            file.write(content)
    _tell(verdict_counts(rows))
    _tell(f"wrote {page} and {text}")
    return 0


def _humaneva(args: argparse.Namespace) -> int:
    from hmc.experiments.humaneva import convert_take, find_takes

    takes = {take.title: take for take in find_takes(args.root)}
    unknown = [name for name in args.only if name not in takes]
    if unknown:
        raise InputError(f"--only {unknown[0]}: {args.root} has {', '.join(takes)}")
    for name in args.only or takes:
        folder = convert_take(takes[name], _folder(args.out), args.frames, lambda line: _tell(f"note: {line}", sys.stderr))
        _tell(f"wrote {folder}")
    return 0


def _left(done: list[Cell], total: int) -> str:
    """How long the rest takes with one worker, by the cells that are there; empty where there are none, or all."""
    seconds = [float(cell.made["seconds"]) for cell in done if "seconds" in cell.made]
    if not seconds or len(done) == total:
        return ""
    return f", about {(total - len(done)) * sum(seconds) / len(seconds) / 60:.0f} min of one worker left"


def _plan(args: argparse.Namespace) -> Plan:
    """The plan that the options ask for."""
    frames, cameras = (None if value is None else (name, value) for name, value in (("frames", args.frames), ("cameras", args.cameras)))
    plan = plan_of(args.quick, args.recordings)
    return changed_plan(plan, args.seeds, args.actions, (frames, cameras, *read_settings(args.set)), read_settings(args.keep))


def _cells(n: int) -> str:
    return f"{n} cell{'s' * (n != 1)}"


def _names(ids: list[str]) -> list[str]:
    return list(dict.fromkeys(name for item in ids for name in (EXPERIMENTS if item == "all" else [item])))


def _folder(path: Path) -> Path:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--out {path}: cannot be made ({error.strerror}); give a folder") from error
    return path


def _count(text: str) -> int:
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number, 1 or more; got {text!r}")
    return int(text)


def _tell(text: str, file=None) -> None:
    """A line; where the reader of a pipe went away (`| head`), the work goes on without."""
    stream = file or sys.stdout
    try:
        stream.write(text + "\n")
        stream.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


if __name__ == "__main__":
    sys.exit(main())
