"""Memory and time a frame of `hmc track` over many frames: a short recording that is repeated, drawn as a curve.

    python docs/long_run.py --out out/long_run --frames 20000

The clip that comes with the package is played there and back without end, with silhouettes of 80 x 60 pixels of five cameras, so that a
frame costs little: what grows with the number of frames grows as it would with large images. Memory is that of the process
(`VmRSS` of /proc/self/status, Linux), looked at every 100 frames; the journal is kept, as `hmc track` keeps it.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from time import process_time

import cv2
import numpy as np

import hmc
from hmc.camera.model import Rig
from hmc.camera.reduction import reduce_mask, reduced_camera
from hmc.io.memory import recording_of
from hmc.tracking.resumable import track_recording
from hmc.voxels.run_options import RunOptions

CAMERAS, FACTOR, EVERY = 5, 4, 100


class Repeated(Sequence):
    """Silhouettes of one camera, played there and back, as many as are asked for."""

    def __init__(self, masks: list[np.ndarray], n: int) -> None:
        self.masks, self.n = masks, n

    def __len__(self) -> int:
        return self.n

    def __getitem__(self, k):
        place = k % (2 * len(self.masks) - 2)
        return self.masks[min(place, 2 * len(self.masks) - 2 - place)]


def resident_mb() -> float:
    """Memory of this process, megabytes."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/long_run"))
    parser.add_argument("--frames", type=int, default=20000)
    parser.add_argument("--picture", type=Path, default=None)
    given = parser.parse_args()
    clip = hmc.open_recording("data/synthetic/tiny")
    masks: list[list[np.ndarray]] = [[] for _ in range(CAMERAS)]
    for step in hmc.silhouettes(clip):
        for c in range(CAMERAS):
            if step.masks[c] is not None:
                masks[c].append(reduce_mask(np.asarray(step.masks[c]), FACTOR))
    rig = Rig(tuple(reduced_camera(camera, FACTOR) for camera in clip.rig[:CAMERAS]))
    looped = recording_of(rig, silhouettes=[Repeated(own, given.frames) for own in masks], fps=clip.fps, room=clip.room, persons=1)
    given.out.mkdir(parents=True, exist_ok=True)
    rows: list[tuple[int, float, float]] = []

    def looked_at(steps: Iterable, total: int) -> Iterator:
        begun = process_time()
        with open(given.out / "long_run.csv", "w", newline="") as file:
            table = csv.writer(file)
            table.writerow(["frame", "resident_mb", "ms_a_frame"])
            for k, step in enumerate(steps, start=1):
                yield step
                if k % EVERY == 0:
                    now = process_time()
                    rows.append((k, resident_mb(), 1000 * (now - begun) / EVERY))
                    table.writerow(rows[-1])
                    file.flush()
                    begun = now

    cv2.setNumThreads(1)
    journal = given.out / "journal"
    journal.unlink(missing_ok=True)
    found = track_recording(looped, 0.1, run=RunOptions(journal=journal, key="long run", progress=looked_at))
    frames, memory, cost = np.array(rows).T
    people, kept_mb = len(np.unique(found.persons)), journal.stat().st_size / 1e6
    print(f"{given.frames} frames, {len(found.frames)} rows of {people} people, journal {kept_mb:.1f} MB")
    for k in sorted({len(rows) // 20, len(rows) // 2, len(rows) - 1}):
        print(f"frame {frames[k]:.0f}: {memory[k]:.0f} MB, {cost[max(0, k - 9) : k + 1].mean():.1f} ms of processor time a frame")
    draw(given.picture or given.out / "long_run.png", frames, memory, cost)
    return 0


def draw(path: Path, frames: np.ndarray, memory: np.ndarray, cost: np.ndarray) -> None:
    """Both curves over the frames."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (upper, lower) = pyplot.subplots(2, 1, sharex=True, figsize=(7, 4.2), layout="constrained")
    upper.plot(frames, memory, lw=1.5)
    upper.set(ylabel="memory, MB", ylim=(0, 1.3 * memory.max()))
    lower.plot(frames, cost, lw=0.8)
    lower.set(xlabel="frame", ylabel="processor time\na frame, ms", ylim=(0, 1.3 * np.quantile(cost, 0.99)))
    for axes in (upper, lower):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    raise SystemExit(main())
