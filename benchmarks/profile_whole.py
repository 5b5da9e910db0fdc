"""Where the processor time of a whole `hmc pose` goes, stage by stage, milliseconds a frame; as a table and as a picture.

    python benchmarks/profile_whole.py RECORDING --save after.json
    python benchmarks/profile_whole.py RECORDING --beside before.json --picture benchmarks/images/profile.png

One worker, so that all work is this process's; the time of its threads counts. A stage that runs within another (the views that a body is
fitted to) is counted for itself. `--beside` takes what `--save` left for another version of the code, which runs by PYTHONPATH.
"""

from __future__ import annotations

import argparse
import functools
import importlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

#: Module and function of each stage, in the order of the picture; what is in none is the last line.
STAGES = {
    "opening the recording": (("hmc.io.recording", "open_recording"),),
    "learning the empty scene": (
        ("hmc.camera.segmentation", "train_background"),
        ("hmc.voxels.background_initialisation", "learn_from_people"),
    ),
    "silhouettes, each camera alone": (("hmc.voxels.looks", "look_once"), ("hmc.camera.segmentation", "segment_views")),
    "silhouettes, cameras together": (("hmc.voxels.hulls", "settle"),),
    "hulls": (("hmc.voxels.hulls", "carve_step"),),
    "tracker": (("hmc.tracking.resumable", "observe_step"), ("hmc.tracking.method", "step_tracker"), ("hmc.tracking.sparse", "step")),
    "views": (("hmc.pose.views.person_view", "views_of"),),
    "first pose and body": (("hmc.pose.person", "_start"),),
    "following": (("hmc.pose.person", "person_step"),),
    "what furniture hides": (("hmc.pose.occluders", "learn_hidden_places"),),
    "bodies of the whole run": (("hmc.pose.backward", "_bodies"),),
    "second pass": (("hmc.pose.backward", "_own"), ("hmc.pose.backward", "_back")),
    "trust": (("hmc.pose.trust", "with_trust"),),
}
REST = "all else, with imports"


class Clock:
    """Processor time of each stage; one that runs within another stops the other's."""

    def __init__(self, stages: Iterable[str]) -> None:
        self.seconds = dict.fromkeys(stages, 0.0)
        self._running: list[str] = []
        self._since = time.process_time()

    def _turn(self) -> None:
        now = time.process_time()
        if self._running:
            self.seconds[self._running[-1]] += now - self._since
        self._since = now

    def timed(self, stage: str, work: Callable) -> Callable:
        """The function, counted for a stage."""

        @functools.wraps(work)
        def counted(*args, **kwargs):
            self._turn()
            self._running.append(stage)
            try:
                return work(*args, **kwargs)
            finally:
                self._turn()
                self._running.pop()

        return counted


def watch(clock: Clock, stages: Mapping[str, Iterable[tuple[str, str]]]) -> None:
    """Put the stages' functions, by module and name, on the clock, wherever they have been imported."""
    importlib.import_module("hmc.cli.pose")
    for names in stages.values():
        for module, _ in names:
            importlib.import_module(module)
    for module in ("hmc.pose.follow", "hmc.pose.backward", "hmc.pose.trust", "hmc.tracking.resumable", "hmc.pose.registry"):
        importlib.import_module(module)
    for stage, names in stages.items():
        for module, name in names:
            plain = getattr(sys.modules[module], name, None)
            if plain is None:
                continue
            counted = clock.timed(stage, plain)
            for other in [one for key, one in sys.modules.items() if key.startswith("hmc")]:
                for attribute, value in list(vars(other).items()):
                    if value is plain:
                        setattr(other, attribute, counted)


def profile(recording: Path, n_frames: int | None) -> dict:
    """Milliseconds a frame of each stage, and the number of frames."""
    clock = Clock(STAGES)
    watch(clock, STAGES)
    from hmc.cli import main
    from hmc.io.recording import open_recording

    frames = open_recording(recording, frames=n_frames).n_frames
    clock.seconds = dict.fromkeys(STAGES, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        words = ["pose", str(recording), "--out", folder, "--height", "auto", "--cues", "silhouettes", "--workers", "1", "--quiet"]
        begun = time.process_time()
        if main([*words, "--frames", str(frames)]):
            raise SystemExit(f"hmc {' '.join(words)} failed")
        whole = time.process_time() - begun
    stages = clock.seconds | {REST: whole - sum(clock.seconds.values())}
    return {"recording": recording.name, "frames": frames, "stages": {name: 1000 * s / frames for name, s in stages.items()}}


def draw(path: Path, runs: dict[str, dict]) -> None:
    """Stages as bars, run beside run."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    names = [*STAGES, REST]
    figure, ax = plt.subplots(figsize=(9, 5.5), layout="constrained")
    height = 0.8 / len(runs)
    for k, (label, run) in enumerate(runs.items()):
        values = [run["stages"].get(name, 0.0) for name in names]
        places = [i + k * height for i in range(len(names))]
        bars = ax.barh(places, values, height, label=f"{label}: {sum(values):.0f} ms", color=("#b9c2cf", "#1f5fbf")[-len(runs) + k])
        ax.bar_label(bars, [f"{value:.1f}" for value in values], padding=2, fontsize=7)
    ax.set_yticks([i + 0.4 - height / 2 for i in range(len(names))], names)
    ax.invert_yaxis()
    first = next(iter(runs.values()))
    ax.set_xlabel(f"processor time, ms a frame ({first['recording']}, {first['frames']} frames, one worker)")
    ax.legend(loc="lower right")
    ax.spines[["top", "right"]].set_visible(False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--save", type=Path, help="keep the numbers (JSON)")
    parser.add_argument("--beside", type=Path, help="numbers of another version, drawn as before")
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--frames", type=int, default=None, help="so many (default: all)")
    given = parser.parse_args()
    run = profile(given.recording, given.frames)
    for name, ms in run["stages"].items():
        print(f"{ms:8.1f} ms  {name}")
    print(f"{sum(run['stages'].values()):8.1f} ms  in all")
    if given.save:
        given.save.write_text(json.dumps(run, indent=1))
    if given.picture:
        before = {"before": json.loads(given.beside.read_text())} if given.beside else {}
        draw(given.picture, before | {"now": run})
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
