# ruff: noqa: E501
"""Files broken at random, given to whole commands: counts of how they end.

``python tests/house/mutations.py --count 10000 --jobs 2`` makes a miniature of everything that commands read, breaks a file of a copy of it
by a family that is drawn, runs a command on it in a process of its own with 2 GB and 60 s, and counts:

- ok: exit code 0; the file did not matter, or what was lost is told
- told: exit code 2 (1, of experiments with a failed cell), with words and no traceback
- bad: a traceback, a signal, another exit code, no end within the time, more memory than there is, or a file beside the folders given

A process is forked of one that has everything imported; a trial with the same seed and number is the same trial.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from families import break_file
from miniature import COMMANDS, build, call

MEMORY_BYTES = 2 * 2**30
#: Of the processor; and of the clock, as a busy machine needs more of it.
TIME_S, CLOCK_S = 60, 240


@dataclass(frozen=True)
class Ending:
    """How a trial ended: `ok`, `told` or `bad`, why, and what it was."""

    kind: str
    why: str
    number: int
    family: str
    file: str
    words: str
    text: str = ""


def trial(base: Path, seed: int, number: int) -> Ending:
    """Break a file and run a command."""
    rng = np.random.default_rng((seed, number))
    weights = np.array([one.weight for one in COMMANDS])
    given = COMMANDS[int(rng.choice(len(COMMANDS), p=weights / weights.sum()))]
    with tempfile.TemporaryDirectory(prefix="broken-") as name:
        folder = Path(name) / "in"
        folder.mkdir()
        for part in given.folders:
            source, target = base / part, folder / part
            target.parent.mkdir(parents=True, exist_ok=True)
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, target)
        pattern = given.broken[int(rng.integers(len(given.broken)))]
        files = sorted(file for file in folder.glob(pattern) if file.is_file())
        if not files:
            return Ending("ok", "nothing to break", number, "", pattern, " ".join(given.words))
        file = files[int(rng.integers(len(files)))]
        where = str(file.relative_to(folder))
        family = break_file((seed, number, 1), file)
        return judged(folder, given.words, number, family, where)


def judged(folder: Path, words: tuple[str, ...], number: int, family: str, file: str) -> Ending:
    """Run a command in a folder and say how it ended."""
    log = folder.parent / "log"
    begun = time.monotonic()
    pid = os.fork()
    if pid == 0:
        _child(folder, words, log)
    status, late = _wait(pid, begun + CLOCK_S)
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
    return Ending(kind, why, number, family, file, " ".join(words), text[-3000:] if kind == "bad" else line)


def _child(folder: Path, words: tuple[str, ...], log: Path) -> None:
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
        code = call(words)
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        traceback.print_exc()
        code = 98
    finally:
        try:
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(code)


def _wait(pid: int, deadline: float) -> tuple[int, bool]:
    pause = 0.002
    while time.monotonic() < deadline:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return status, False
        time.sleep(pause)
        pause = min(pause * 1.3, 0.1)
    os.killpg(pid, signal.SIGKILL)
    return os.waitpid(pid, 0)[1], True


def warm() -> None:
    """Import what commands import, so that a forked process need not."""
    import importlib

    for name in (
        "hmc.cli.check hmc.cli.world hmc.cli.sync hmc.cli.track hmc.cli.pose hmc.cli.evaluate hmc.cli.view hmc.cli.run hmc.cli.synth hmc.pose.backward "
        "hmc.pose.follow hmc.pose.clear_views hmc.pose.registry hmc.tracking.trackers hmc.tracking.resumable hmc.check hmc.view.write hmc.view.mosaic hmc.view.plots "
        "hmc.synthetic.render hmc.synthetic.recipe hmc.metrics.landmarks hmc.trials.page hmc.experiments.__main__ hmc.experiments.fig_3_3 sklearn.tree pandas "
        "scipy.stats scipy.signal tqdm hmc.experiments.engine.page matplotlib.pyplot"
    ).split():
        importlib.import_module(name)


def trials(base: Path, seed: int, numbers: range, jobs: int) -> Iterator[Ending]:
    """All of them, as they end."""
    if jobs == 1:
        yield from (trial(base, seed, number) for number in numbers)
        return
    from multiprocessing import get_context

    with get_context("fork").Pool(jobs, initializer=_no_daemon) as pool:
        yield from pool.imap_unordered(_one, ((base, seed, number) for number in numbers), chunksize=4)


def _no_daemon() -> None:
    import multiprocessing

    multiprocessing.current_process()._config["daemon"] = False  # type: ignore[attr-defined]  # what is broken may start processes


def _one(given: tuple[Path, int, int]) -> Ending:
    return trial(*given)


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--base", type=Path, help="where the miniature is made, and found again")
    parser.add_argument("--show", action="store_true", help="print every ending")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        base = build((args.base or Path(name) / "miniature").resolve())
        warm()
        counts, begun = Counter[str](), time.monotonic()
        families: dict[str, Counter[str]] = {}
        for one in trials(base, args.seed, range(args.first, args.first + args.count), args.jobs):
            counts[f"{one.kind}: {one.why}" if one.kind == "bad" else one.kind] += 1
            families.setdefault(one.family or "-", Counter())[one.kind] += 1
            if one.kind == "bad" or args.show:
                print(f"--- {one.kind} {one.why}: {one.number}, {one.family}, {one.file}: {one.words}\n{one.text.strip()}", flush=True)
        for name, own in sorted(families.items()):
            print(f"{name}: {dict(own)}")
        print(f"{sum(counts.values())} trials in {time.monotonic() - begun:.0f} s: {dict(counts)}")


if __name__ == "__main__":
    main()
