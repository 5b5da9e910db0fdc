# ruff: noqa: E501
"""Commands that are killed at random moments, go on, and must leave the bytes of a run that nothing disturbed.

``python tests/kills.py --count 500`` takes the miniature of `tests/miniature.py`, and of each command in turn the files that it leaves when
nothing disturbs it. Then it runs the command, ends it at a moment that is drawn over the time that it took, by SIGKILL, SIGINT or SIGTERM, in every
third trial twice, and starts it again until it is done. Counted are kills that met a run at work, and trials that ended

- same: all files as without a kill but for the times that were measured (`TIMES`, `TIMED`), and no others
- other: some file differs, is missing or is left over
- bad: a traceback, or the run that was started again did not end with exit code 0
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from miniature import COARSE, FULL, QUICK, VOXELS, build
from mutations import _child, warm

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
#: Lines of tables and cells that say how long something took.
TIMES = re.compile(rb'(?m)^ *"?(seconds|\w+_s|\w*real_time_factor)"?( =|:) [0-9.e-]+,?$')
TWO = ("--workers", "2")
#: Files of `hmc run` that say so in between.
TIMED = ("report.html", "trial.toml")
#: Commands, and what of the folder they leave results in.
COMMANDS = {
    "track": (("track", "rec", "--out", "new", "--voxel", "0.1", *QUICK), "new"),
    "track, two workers": (("track", "rec", "--out", "new", "--voxel", "0.1", "--quiet", *TWO), "new"),
    "apf, default": (("pose", "rec", "--out", "new", *FULL), "new"),
    "apf, two passes": (("pose", "rec", "--out", "new", "--voxel", "0.1", "--track-voxel", "0.1", "--settings", "cheap.toml", "--quiet", *TWO), "new"),
    "apf, canton2009": (("pose", "rec", "--out", "new", *COARSE), "new"),
    "shbm-apf": (("pose", "rec", "--out", "new", "--method", "shbm-apf", *COARSE), "new"),
    "ddm-apf": (("pose", "rec", "--out", "new", "--method", "ddm-apf", *COARSE), "new"),
    "smd": (("pose", "rec", "--out", "new", "--method", "smd", *VOXELS, *QUICK), "new"),
    "pso, hsiao2008": (("pose", "rec", "--out", "new", "--method", "pso", "--preset", "hsiao2008", *VOXELS, *QUICK), "new"),
    "experiments run": (("experiments", "run", "fig-3.3", "--quick", "--quiet", "--workers", "1", "--out", "new"), "new"),
    "run": (("run", "session.toml", "--out", "new", "--quiet", "--workers", "1"), "new"),
    "export": (("export", "result", "--to", "c3d", "--out", "new/a.c3d"), "new"),
    "view, page": (("view", "result", "rec", "--out", "new/a.html", "--quiet"), "new"),
    "view, video": (("view", "result", "rec", "--out", "new/a.mp4", "--no-voxels", "--quiet"), "new"),
}  # fmt: skip


@dataclass(frozen=True)
class Whole:
    """What a command leaves when nothing disturbs it: bytes by name, and how long it takes, seconds; names of files that differ from run to run."""

    files: dict[str, bytes]
    seconds: float
    unsteady: frozenset[str]


def started(folder: Path, words: tuple[str, ...]) -> int:
    """The process of a command."""
    pid = os.fork()
    if pid == 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # before the command is at work, an interrupt is not its to tell
        _child(folder, words, folder.parent / "log", signal.default_int_handler)
    return pid


def ended(pid: int, after_s: float, by: int) -> bool:
    """End a process after a time, if it has not ended before; whether it was still at work."""
    time.sleep(after_s)
    if os.waitpid(pid, os.WNOHANG)[0]:
        return False
    os.kill(pid, by)
    os.waitpid(pid, 0)
    return True


def files_in(folder: Path) -> dict[str, bytes]:
    """All files' bytes, by their names, without `TIMES`."""
    files = [one for one in sorted(folder.rglob("*")) if one.is_file() and one.name not in TIMED] if folder.is_dir() else []
    return {
        str(one.relative_to(folder)): TIMES.sub(b"", one.read_bytes()) if one.suffix in (".toml", ".json") else one.read_bytes()
        for one in files
    }


def undisturbed(folder: Path, words: tuple[str, ...], out: str) -> Whole:
    """Run a command twice, each time from nothing."""
    found, seconds = [], 0.0
    for _ in range(2):
        shutil.rmtree(folder / out, ignore_errors=True)
        begun = time.monotonic()
        status = os.waitpid(started(folder, words), 0)[1]
        seconds = time.monotonic() - begun
        if status:
            raise SystemExit(f"{' '.join(words)}:\n{(folder.parent / 'log').read_text()}")
        found.append(files_in(folder / out))
    one, other = found
    return Whole(one, seconds, frozenset(name for name in one.keys() | other.keys() if one.get(name) != other.get(name)))


def trial(folder: Path, words: tuple[str, ...], out: str, whole: Whole, rng: np.random.Generator) -> tuple[str, int, str]:
    """Kill, go on, compare: how it ended, how many kills met a run at work, and what differs."""
    shutil.rmtree(folder / out, ignore_errors=True)
    log = folder.parent / "log"
    log.write_text("")
    kills = 0
    for _ in range(1 + int(rng.integers(3) == 0)):
        kills += ended(started(folder, words), float(rng.uniform(0, whole.seconds)), int(rng.choice(SIGNALS)))
    status = os.waitpid(started(folder, words), 0)[1]
    text = log.read_text(errors="replace")
    if status or "Traceback" in text:
        return "bad", kills, text[-3000:]
    left = files_in(folder / out)
    others = [
        name for name in sorted(left.keys() | whole.files.keys()) if left.get(name) != whole.files.get(name) and name not in whole.unsteady
    ]
    return ("other" if others else "same"), kills, ", ".join(others)


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=500, help="kills of runs at work")
    parser.add_argument("--minutes", type=float, default=np.inf, help="begin no further trial after so long")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--base", type=Path, help="where the miniature is made, and found again")
    parser.add_argument("--commands", nargs="+", choices=list(COMMANDS), default=list(COMMANDS))
    args = parser.parse_args()
    rng, begun = np.random.default_rng(args.seed), time.monotonic()
    with tempfile.TemporaryDirectory(prefix="kills-") as name:
        base, folder = build((args.base or Path(name) / "miniature").resolve()), Path(name) / "work" / "in"
        shutil.copytree(base, folder)
        warm()
        counts: dict[str, Counter[str]] = defaultdict(Counter)
        wholes: dict[str, Whole] = {}
        kills = 0
        with suppress(KeyboardInterrupt):
            while kills < args.count and time.monotonic() - begun < 60 * args.minutes:
                for key in args.commands:
                    words, out = COMMANDS[key]
                    if key not in wholes:
                        wholes[key] = undisturbed(folder, words, out)
                        print(
                            f"{key}: {wholes[key].seconds:.1f} s, {len(wholes[key].files)} files, differ from run to run: {sorted(wholes[key].unsteady)}",
                            flush=True,
                        )
                    kind, met, text = trial(folder, words, out, wholes[key], rng)
                    kills += met
                    counts[key].update({kind: 1, "kills": met})
                    if kind != "same":
                        print(f"--- {kind}: {key}\n{text}", flush=True)
        for key, own in counts.items():
            print(f"{key}: {dict(own)}")
        print(f"{kills} kills in {time.monotonic() - begun:.0f} s: {dict(sum(counts.values(), Counter()))}")


if __name__ == "__main__":
    main()
