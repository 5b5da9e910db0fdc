"""What it costs when a recording's images are not as its empty scene's: light, tinge, noise, compression; of a recording with truth.

    python docs/other_light.py data/r1 --out out/light --frames 60
    python docs/other_light.py data/r1 --out out/light --frames 60 --changes none tinged flicker

| change | images | empty scene |
| --- | --- | --- |
| none | as they are | as it is |
| darker | 4 % darker | as it is |
| brighter | 8 % brighter | as it is |
| tinged | blue 3 % less, red 3 % more | as it is |
| flicker | brighter and darker by 3 %, another factor in each frame and camera | the same |
| exposure | 10 % darker by and by over 20 frames | as it is |
| contrast | raised to the power of 1.12 | as it is |
| side | 8 % darker on the left to 8 % brighter on the right | as it is |
| moved | one to two pixels aside | as it is |
| noisy | noise of 8 grey levels | the same |
| compressed | JPEG of quality 25 | the same |

Of each change the poses of all frames are made (`hmc pose --height auto --cues silhouettes`) and compared with the truth.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from hmc.io.recording import background_frames, iterate_frames, open_recording

#: ``change(image, frame, camera, rng) -> image``, in floats.
Change = Callable[[np.ndarray, int, int, np.random.Generator], np.ndarray]


def _as_it_is(image: np.ndarray, frame: int, camera: int, rng: np.random.Generator) -> np.ndarray:
    return image


def _flicker(image: np.ndarray, frame: int, camera: int, rng: np.random.Generator) -> np.ndarray:
    return image * (1 + 0.03 * np.sin(1.9 * frame + camera))


def _noisy(image: np.ndarray, frame: int, camera: int, rng: np.random.Generator) -> np.ndarray:
    return image + rng.normal(0, 8, image.shape)


def _moved(image: np.ndarray, frame: int, camera: int, rng: np.random.Generator) -> np.ndarray:
    shift = np.array([[1, 0, 1.6 if camera % 2 else -1.2], [0, 1, 1.0]])
    return cv2.warpAffine(image, shift, image.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)


def _compressed(image: np.ndarray, frame: int, camera: int, rng: np.random.Generator) -> np.ndarray:
    packed = cv2.imencode(".jpg", image.astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 25])[1]
    return cv2.imdecode(packed, cv2.IMREAD_COLOR).astype(float)


CHANGES: dict[str, tuple[Change, Change]] = {
    "none": (_as_it_is, _as_it_is),
    "darker": (lambda image, *_: 0.96 * image, _as_it_is),
    "brighter": (lambda image, *_: 1.08 * image, _as_it_is),
    "tinged": (lambda image, *_: image * [0.97, 1.0, 1.03], _as_it_is),
    "flicker": (_flicker, _flicker),
    "exposure": (lambda image, frame, *_: image * (1 - 0.1 * min(1.0, frame / 20)), _as_it_is),
    "contrast": (lambda image, *_: 255 * (image / 255) ** 1.12, _as_it_is),
    "side": (lambda image, *_: image * np.linspace(0.92, 1.08, image.shape[1])[:, None], _as_it_is),
    "moved": (_moved, _as_it_is),
    "noisy": (_noisy, _noisy),
    "compressed": (_compressed, _compressed),
}


def make(source: Path, folder: Path, frames: int, change: str) -> None:
    """A copy of a recording with its images changed, written without loss."""
    recording = open_recording(source, frames=frames)
    rng = np.random.default_rng(0)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for item in source.iterdir():
        if item.name not in ("videos", "images", "background", "keypoints"):
            (folder / item.name).symlink_to(item.resolve())
    of_images, of_empty = CHANGES[change]
    for c, camera in enumerate(recording.rig):
        empty = folder / "background" / camera.name
        empty.mkdir(parents=True)
        (folder / "images" / camera.name).mkdir(parents=True)
        for k, image in enumerate(background_frames(recording, c)):
            write(empty / f"{k:06d}.png", of_empty(image.astype(float), k, c, rng))
    for frame in iterate_frames(recording):
        for c, (camera, image) in enumerate(zip(recording.rig, frame.images, strict=True)):
            if image is not None:
                file = folder / "images" / camera.name / f"{frame.index:06d}.png"
                write(file, of_images(image.astype(float), frame.index, c, rng))


def write(file: Path, image: np.ndarray) -> None:
    """An image of floats as PNG."""
    cv2.imwrite(str(file), np.clip(np.rint(image), 0, 255).astype(np.uint8))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--changes", nargs="+", default=list(CHANGES), choices=CHANGES)
    given = parser.parse_args()
    print("| change | mean, mm | within 100 mm | within 50 mm |\n| --- | --- | --- | --- |", flush=True)
    for change in given.changes:
        made, result = given.out / change / "recording", given.out / change / "result"
        make(given.recording, made, given.frames, change)
        hmc = [sys.executable, "-m", "hmc"]
        options = ["--height", "auto", "--cues", "silhouettes", "--frames", str(given.frames), "--no-silhouettes", "--quiet"]
        shutil.rmtree(result, ignore_errors=True)
        subprocess.run([*hmc, "pose", str(made), "--out", str(result), *options], check=True, capture_output=True)
        subprocess.run([*hmc, "evaluate", str(result), str(made)], check=True, capture_output=True)
        shutil.rmtree(made)
        of = tomllib.loads((result / "metrics.toml").read_text())["pose"]
        print(f"| {change} | {of['mean_mm']:.1f} | {of['mmta_at_100mm']:.3f} | {of['mmta_at_50mm']:.3f} |", flush=True)


if __name__ == "__main__":
    main()
