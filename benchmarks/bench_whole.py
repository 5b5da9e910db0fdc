"""The whole command as a user starts it: from videos to written tables, with everything that `hmc track` and `hmc pose` do by default.

    python benchmarks/bench_whole.py                 # renders a clip first, into out/bench, once; takes a while
    python benchmarks/bench_whole.py --recording DIR --cameras cam_00,cam_02

Times are by the clock on the wall, and hold on an idle machine. In the same run stand what bounds them: decoding of the same videos, and
OpenCV's mixture of Gaussians over the same images and nothing else, both on one core. What a run costs whatever its length is told by a
run of a part of the frames. With `--mediapipe PYTHON`, an environment in which MediaPipe is installed, its Pose runs over the same videos
(`peer_mediapipe.py`). What sixteen processors would do is told by Amdahl's law from one worker and all: an estimate, no measurement.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
from _timing import report

from hmc.io.files import to_toml
from hmc.io.recording import Recording, iterate_frames, open_recording
from hmc.processes import available_processors

ROOT = Path(__file__).resolve().parents[1]
RECIPE, SECONDS = ROOT / "data" / "synthetic" / "jog.toml", 10.0
#: The short run has so many times fewer frames.
PART = 3


def rendered() -> Path:
    """The clip, rendered once."""
    folder = ROOT / "out" / "bench" / "jog"
    if not (folder / "calibration.toml").is_file():
        recipe = folder.parent / "jog.toml"
        recipe.parent.mkdir(parents=True, exist_ok=True)
        recipe.write_text(to_toml(tomllib.loads(RECIPE.read_text()) | {"seconds": SECONDS}))
        subprocess.run([sys.executable, "-m", "hmc", "synth", str(recipe), "--out", str(folder)], check=True)
    return folder


def seconds(work: Callable[[], object]) -> float:
    """How long something takes, by the clock."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def decode(recording: Recording) -> int:
    """Read all frames of all cameras; how many there were."""
    return sum(len(frame.images) for frame in iterate_frames(recording))


def mixtures(recording: Recording) -> None:
    """OpenCV's mixture of Gaussians over all images, as it comes, without its reading of them: each frame is read before."""
    models = [cv2.createBackgroundSubtractorMOG2() for _ in recording.rig]
    for frame in iterate_frames(recording):
        for model, image in zip(models, frame.images, strict=True):
            if image is not None:
                model.apply(image)


def command(*words: str) -> float:
    """A whole command, from its start to its end, seconds; with the processors that it is given."""
    with tempfile.TemporaryDirectory() as folder:
        line = [sys.executable, "-m", "hmc", *words, "--quiet", "--out", folder]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        return seconds(lambda: subprocess.run(line, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment))


def mediapipe(python: str, recording: Recording) -> float:
    """MediaPipe Pose over the recording's videos, without its imports; seconds. It takes the processors that it wants."""
    videos = [str(next((recording.path / "videos").glob(f"{name}.*"))) for name in recording.rig.names]
    words = [python, str(Path(__file__).with_name("peer_mediapipe.py")), str(recording.n_frames), *videos]
    count, taken = subprocess.run(words, check=True, capture_output=True, text=True).stdout.split()[-2:]
    print(f"     MediaPipe Pose {float(taken):.1f} s, {1000 * float(taken) / int(count):.0f} ms an image")
    return float(taken)


def amdahl(one: float, several: float, workers: int, processors: int) -> float:
    """Seconds on so many processors, of what takes `one` with one worker and `several` with so many workers."""
    shared = max(0.0, (one - several) / (1 - 1 / workers))
    return one - shared + shared / processors


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recording", type=Path, help="a recording of your own")
    parser.add_argument("--cameras", help="some of its cameras, by name")
    parser.add_argument("--least", type=float, default=12.0, help="frames a second that `hmc pose` should reach at least (default: 12)")
    parser.add_argument("--mediapipe", metavar="PYTHON", help="an interpreter that has MediaPipe")
    given = parser.parse_args(argv)
    path = given.recording or rendered()
    chosen = ["--cameras", given.cameras] if given.cameras else []
    recording = open_recording(path, given.cameras.split(",") if given.cameras else None)
    n, workers = recording.n_frames, available_processors()
    cv2.setNumThreads(1)
    decoding = seconds(lambda: decode(recording))
    mixture = seconds(lambda: mixtures(recording)) - decoding
    print(f"{recording.name}: {n} frames, {len(recording.rig)} cameras, {workers} processors")
    print(f"     decoding alone {decoding:.1f} s ({n / decoding:.0f} frames a second), mixtures alone {mixture:.1f} s ({n / mixture:.0f})")
    tracking = command("track", str(path), *chosen)
    whole = {count: command("pose", str(path), *chosen, "--height", "auto", "--workers", str(count)) for count in {1, workers}}
    some = max(1, n // PART)
    part = command("pose", str(path), *chosen, "--height", "auto", "--frames", str(some))
    fixed = part - some * (whole[workers] - part) / (n - some)
    print(f"     hmc track {tracking:.1f} s ({n / tracking:.1f} frames a second)")
    print(f"     hmc pose {whole[workers]:.1f} s, with one worker {whole[1]:.1f} s, of {some} frames {part:.1f} s")
    good = report("14a", "hmc pose, frames a second", n / whole[workers], given.least, at_least=True)
    good &= report("14b", "fixed cost of hmc pose, seconds", fixed, 6.0)
    good &= report("14c", "hmc pose / (decoding and mixtures alone)", whole[workers] / (decoding + mixture), 1.2)
    if given.mediapipe:
        good &= report("14e", "hmc pose / MediaPipe Pose over the same videos", whole[workers] / mediapipe(given.mediapipe, recording), 1.0)
    if workers > 1:
        print(f"     sixteen processors, by Amdahl's law: {amdahl(whole[1], whole[workers], workers, 16):.1f} s")
        good &= report("14d", f"one worker / {workers} workers", whole[1] / whole[workers], 1.8, at_least=True)
    return 0 if good else 1


if __name__ == "__main__":
    raise SystemExit(main())
