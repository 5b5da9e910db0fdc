"""Which process of a whole `hmc pose` is busy when: by the clock and in processor time, phase by phase.

    python benchmarks/timeline_whole.py RECORDING --workers 2 --cues silhouettes

Of each phase: seconds by the clock, processor time of the process that was started and of all that it forked, and how many seconds the
phase would take at least on so many processors by these times alone: second by second, the larger of their sum over the processors and
of the busiest process's. Where other work takes the processors, the clock says little and this says more. Processes are looked at when
they send something, so that what one does after its last word is not told.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections import defaultdict
from itertools import pairwise
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from profile_whole import Clock, watch

#: Module and function of each phase; what is in none is the first line.
PHASES = {
    "opening the recording": (("hmc.cli.common", "open_selected"),),
    "tracking": (("hmc.tracking.resumable", "track_recording"),),
    "learning of keypoints": (("hmc.pose.keypoint_cues", "learn_scatter"),),
    "following": (("hmc.pose.follow", "follow"),),
    "first pose: candidates": (("hmc.pose.starts.window", "_best_hypothesis"),),
    "first pose: body": (("hmc.pose.starts.window", "_fit"),),
    "first pose: the rest": (("hmc.pose.person", "_start"),),
    "what furniture hides": (("hmc.pose.occluders", "learn_hidden_places"),),
    "bodies of the whole run": (("hmc.pose.backward", "_bodies"), ("hmc.pose.backward", "_with_beside")),
    "second pass": (("hmc.pose.backward", "_sweep"),),
    "limbs by their colors": (("hmc.pose.backward", "limbs_by_color"),),
    "trust": (("hmc.pose.trust", "with_trust"),),
}
REST = "all else, with imports"
#: Within so many seconds a phase's processes could have been busy at once, whichever of them the clock let run.
PART_S = 1.0


class Turns(Clock):
    """When which phase was on: rows of seconds, this process's processor time, and the phase until then."""

    def __init__(self) -> None:
        super().__init__(PHASES)
        self.rows: list[tuple[float, float, str]] = []

    def _turn(self) -> None:
        super()._turn()
        self.rows.append((time.time(), time.process_time(), self._running[-1] if self._running else REST))


def watch_helpers(log: Path, turns: Turns) -> None:
    """Let every process that is forked tell its processor time with each message, and this one look at its own before it takes one."""
    import hmc.processes

    file, this = os.open(log, os.O_CREAT | os.O_WRONLY | os.O_APPEND), os.getpid()
    forked, received = hmc.processes._forked, hmc.processes._received

    def taken(*args: Any) -> Any:
        turns._turn()
        try:
            return received(*args)
        finally:
            turns._turn()

    def tell(pid: int, seconds: float) -> None:
        os.write(file, f"{json.dumps([pid, time.time(), seconds])}\n".encode())

    class Telling(Connection):
        def send_bytes(self, *message: Any) -> None:
            if os.getpid() != this:
                tell(os.getpid(), time.process_time())
            super().send_bytes(*message)

    def telling(run):
        def told(there: Connection) -> None:
            tell(os.getpid(), time.process_time())
            run(Telling(os.dup(there.fileno())))

        return forked(told)

    hmc.processes._forked, hmc.processes._received = telling, taken


def table(rows: list[tuple[float, float, str]], log: Path, processors: int) -> dict[str, list[float]]:
    """By phase: seconds by the clock, processor time of this process, of the others, and the least."""
    import numpy as np  # not before the command is there, which says how many threads linear algebra has

    helpers = defaultdict(list)
    for line in log.read_text().splitlines() if log.is_file() else ():
        pid, at, seconds = json.loads(line)
        helpers[pid].append((at, seconds))
    found: dict[str, list[float]] = {name: [0.0] * 4 for name in (REST, *PHASES)}
    ends = {row for row, then in pairwise(rows) if row[2] != then[2]} | {rows[-1]}
    parts = rows[:1]
    for row in rows[1:]:
        if row in ends or row[0] - parts[-1][0] >= PART_S:
            parts.append(row)
    for (begin, before, _), (end, after, phase) in pairwise(parts):
        others = [float(np.diff(np.interp([begin, end], *zip(*told, strict=True)))[0]) for told in helpers.values()]
        own = after - before
        least = max((own + sum(others)) / processors, own, *others)
        found[phase] = [a + b for a, b in zip(found[phase], (end - begin, own, sum(others), least), strict=True)]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--workers", type=int, default=2)
    given, more = parser.parse_known_args()
    turns = Turns()
    watch(turns, PHASES)
    from hmc.cli import main as hmc

    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        watch_helpers(log, turns)
        turns._turn()
        words = ["pose", str(given.recording), "--out", f"{folder}/out", "--height", "auto", "--workers", str(given.workers), "--quiet"]
        if hmc([*words, *more]):
            raise SystemExit(f"hmc {' '.join(words)} failed")
        turns._turn()
        found = table(turns.rows, log, given.workers)
    print(f"{'clock':>9} {'this one':>9} {'others':>9} {'least':>9}   seconds")
    for name, values in found.items():
        print(*(f"{value:9.2f}" for value in values), f"  {name}")
    print(*(f"{sum(values):9.2f}" for values in zip(*found.values(), strict=True)), "  in all")
    return 0


if __name__ == "__main__":
    sys.exit(main())
