# ruff: noqa: E501
"""Files broken at random, given to whole commands: counts of how they end.

``python tests/mutations.py --count 10000 --jobs 2`` makes a miniature of everything that commands read, breaks a file of a copy of it, runs
a command on it in a process of its own with 2 GB and 60 s, and counts:

- ok: exit code 0; the file did not matter, or what was lost is told
- silent: exit code 0, other tracks or poses than without the fault, and no word that is not said without it too
- told: exit code 2 (1, of experiments with a failed cell), with words and no traceback
- bad: a traceback, a signal, another exit code, no end within the time, more memory than there is, or a file beside the folders given

A process is forked of one that has everything imported. Trial after trial goes through all families in an order that is drawn anew each time,
and likewise through all commands, each as often in a round as its number says; a trial with the same seed and number is the same trial.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import math
import multiprocessing
import os
import re
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from families import FAMILIES
from miniature import COMMANDS, Given, build, call

MEMORY_BYTES = 2 * 2**30
#: Of the processor; and of the clock, as a busy machine needs more of it.
TIME_S, CLOCK_S = 60, 240
#: All commands, each as often as it says.
ROUND = [k for k, given in enumerate(COMMANDS) for _ in range(given.often)]
#: What `track` and `pose` write, whatever else was put beside it.
TABLES = ("tracks.csv", "joints.csv")
#: Trials between two looks at the clock.
BLOCK = 50
NUMBER = re.compile(r"[\d.]+")


@dataclass(frozen=True)
class Ending:
    """How a trial ended: `ok`, `silent`, `told` or `bad`, why, and what it was; and what it left: tables' bytes by their places, and its words."""

    kind: str
    why: str
    number: int
    family: str
    file: str
    words: str
    text: str
    tables: dict[str, bytes]
    said: frozenset[str]


def drawn(seed: int, number: int) -> tuple[str, Given]:
    """The family and the command of a trial: each round of either is another permutation."""
    family = np.random.default_rng((seed, 0, number // len(FAMILIES))).permutation(list(FAMILIES))[number % len(FAMILIES)]
    command = np.random.default_rng((seed, 1, number // len(ROUND))).permutation(ROUND)[number % len(ROUND)]
    return str(family), COMMANDS[command]


def trial(base: Path, seed: int, whole: dict[tuple[str, ...], Ending], number: int) -> Ending:
    """Break a file and run a command; compared with how it ends on files that are whole."""
    rng = np.random.default_rng((seed, 2, number))
    family, given = drawn(seed, number)
    with tempfile.TemporaryDirectory(prefix="broken-") as name:
        folder = _copied(base, given, Path(name))
        there = [pattern for pattern in given.broken if any(file.is_file() for file in folder.glob(pattern))]
        files = sorted(file for file in folder.glob(there[int(rng.integers(len(there)))]) if file.is_file())
        file = files[int(rng.integers(len(files)))]
        where = str(file.relative_to(folder))
        FAMILIES[family](rng, file)
        ending = judged(folder, given.words, number, family, where)
    without = whole[given.words]
    if ending.kind == "ok" and ending.tables != without.tables and ending.said <= without.said:
        return replace(ending, kind="silent", why="another result")
    return ending


def whole_endings(base: Path, jobs: int) -> dict[tuple[str, ...], Ending]:
    """How each command ends when nothing is broken."""
    return dict(_spread(_whole, [(base, given) for given in COMMANDS], jobs))


def _whole(task: tuple[Path, Given]) -> tuple[tuple[str, ...], Ending]:
    base, given = task
    with tempfile.TemporaryDirectory(prefix="whole-") as name:
        return given.words, judged(_copied(base, given, Path(name)), given.words, -1, "", "")


def _copied(base: Path, given: Given, where: Path) -> Path:
    folder = where / "in"
    folder.mkdir()
    for part in given.folders:
        source, target = base / part, folder / part
        target.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copy2)(source, target)
    return folder


def judged(
    folder: Path, words: tuple[str, ...], number: int, family: str, file: str, before: Sequence[Callable[[Path], None]] = ()
) -> Ending:
    """Run a command in a folder, with what is done to its process before, and say how it ended."""
    log = folder.parent / "log"
    pid = os.fork()
    if pid == 0:
        _child(folder, words, log, before=before)
    status, late = _wait(pid)
    text = log.read_text(errors="replace")
    strangers = sorted(one.name for one in folder.parent.iterdir() if one.name not in ("in", "log"))
    line = (text.strip().splitlines() or [""])[-1][:300]
    code = os.waitstatus_to_exitcode(status)
    if late:
        kind, why = "bad", "no end"
    elif "MemoryError" in text or "bad_alloc" in text or "Insufficient memory" in text or "Unable to allocate" in text:
        kind, why = "bad", "memory"
    elif "Traceback" in text:
        kind, why = "bad", "traceback"
    elif code == -signal.SIGXCPU:
        kind, why = "bad", "no end"
    elif code < 0:
        kind, why = "bad", f"signal {-code}"
    elif strangers:
        kind, why = "bad", f"wrote {strangers}"
    elif code == 0:
        kind, why = "ok", "code 0"
    elif (code == 2 or (words[0] in ("experiments", "run") and code == 1) or (words[0] == "check" and code == 1)) and line:
        kind, why = "told", f"code {code}"
    else:
        kind, why = "bad", f"code {code}"
    tables = {}
    if kind == "ok" and words[0] in ("track", "pose"):
        made = folder / words[words.index("--out") + 1]
        tables = {one.name: one.read_bytes() for one in sorted(made.glob("*.csv")) if one.name in TABLES}
    said = frozenset(NUMBER.sub("#", one) for one in text.splitlines())
    return Ending(kind, why, number, family, file, " ".join(words), text[-3000:] if kind == "bad" else line, tables, said)


def _child(
    folder: Path,
    words: tuple[str, ...],
    log: Path,
    interrupts: signal.Handlers | Callable | None = None,
    before: Sequence[Callable[[Path], None]] = (),
) -> None:
    code = 99
    try:
        out = os.open(log, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o644)
        os.dup2(out, 1)
        os.dup2(out, 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        # Whoever runs this may have put something else in their place.
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)
        os.chdir(folder)
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_BYTES, used + MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (TIME_S, TIME_S + 5))
        os.setsid()
        if interrupts is not None:
            signal.signal(signal.SIGINT, interrupts)
        for change in before:
            change(folder)
        code = call(words)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        traceback.print_exc()
        code = 98
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(AttributeError, OSError, ValueError):  # there is none, or no room
                stream.flush()
        os._exit(code)


def _wait(pid: int) -> tuple[int, bool]:
    """Its status, and whether it had to be ended."""
    handle = os.pidfd_open(pid)
    try:
        late = not select.select([handle], [], [], CLOCK_S)[0]
        if late:
            os.killpg(pid, signal.SIGKILL)
        return os.waitpid(pid, 0)[1], late
    finally:
        os.close(handle)


def warm() -> None:
    """Import what commands import, so that a forked process need not."""
    import importlib

    for name in (
        "hmc.cli.check hmc.cli.world hmc.cli.sync hmc.cli.track hmc.cli.pose hmc.cli.evaluate "
        "hmc.cli.evaluate_input hmc.cli.evaluate_scores hmc.cli.view hmc.cli.run hmc.cli.synth hmc.pose.backward "
        "hmc.pose.follow hmc.pose.clear_views hmc.pose.registry hmc.tracking.trackers hmc.tracking.resumable hmc.check hmc.view.write hmc.view.mosaic hmc.view.plots "
        "hmc.synthetic.render hmc.synthetic.recipe hmc.metrics.landmarks hmc.trials.page hmc.experiments.__main__ hmc.experiments.fig_3_3 sklearn.tree pandas "
        "scipy.stats scipy.signal tqdm hmc.experiments.engine.page matplotlib.pyplot"
    ).split():
        importlib.import_module(name)
    gc.collect()
    gc.freeze()  # what a child's collector does not touch need not be copied for it


def trials(base: Path, seed: int, numbers: range, jobs: int, whole: dict[tuple[str, ...], Ending]) -> Iterator[Ending]:
    """All of them, as they end."""
    return _spread(partial(trial, base, seed, whole), numbers, jobs)


def _spread(work: Callable, tasks: Iterable, jobs: int) -> Iterator:
    if jobs == 1:
        yield from map(work, tasks)
        return
    with get_context("fork").Pool(jobs, initializer=_no_daemon, initargs=(work,)) as pool:
        yield from pool.imap_unordered(_work, tasks)


def _no_daemon(work: Callable) -> None:
    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # what is broken may start processes
    globals()["_worker"] = work  # inherited, not sent


def _work(task):
    return globals()["_worker"](task)


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=math.inf, help="begin no further block of trials after so long")
    parser.add_argument("--base", type=Path, help="where the miniature is made, and found again")
    parser.add_argument("--show", nargs="*", choices=("ok", "silent", "told", "bad"), default=("silent", "bad"), help="endings to print")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        base = build((args.base or Path(name) / "miniature").resolve())
        warm()
        whole = whole_endings(base, args.jobs)
        counts, begun = Counter[str](), time.monotonic()
        families, commands = (defaultdict[str, Counter[str]](Counter) for _ in range(2))
        last = args.first + args.count
        blocks = (range(first, min(first + BLOCK, last)) for first in range(args.first, last, BLOCK))
        in_time = itertools.takewhile(lambda _: time.monotonic() - begun < 60 * args.minutes, blocks)
        for one in itertools.chain.from_iterable(trials(base, args.seed, block, args.jobs, whole) for block in in_time):
            counts[f"{one.kind}: {one.why}" if one.kind == "bad" else one.kind] += 1
            families[one.family][one.kind] += 1
            commands[one.words.split()[0]][one.kind] += 1
            if one.kind in args.show:
                print(f"--- {one.kind} {one.why}: {one.number}, {one.family}, {one.file}: {one.words}\n{one.text.strip()}", flush=True)
        for name, own in sorted(families.items()) + sorted(commands.items()):
            print(f"{name}: {dict(own)}")
        print(f"{sum(counts.values())} trials in {time.monotonic() - begun:.0f} s: {dict(counts)}")


if __name__ == "__main__":
    main()
