"""What a camera that fails in the middle of a recording costs, and whether it is named: a recording with truth, with faults put into it.

    python docs/faulty_cameras.py data/r1 --out out/faulty --frames 60 --cameras cam_02
    python docs/faulty_cameras.py data/r1 --out out/faulty --frames 60 --cameras cam_02 cam_05 --pose=--no-exclude

Faults begin with frame `--begin` (by default in the middle) and last to the end:

| fault | what the camera shows from then on |
| --- | --- |
| lost | nothing: its images end |
| frozen | the last image before |
| dark | black with a little noise |
| late | what it saw `--late` frames earlier |
| late-all | the same, from the first frame on (the run begins with frame `--late`) |
| turned | what it would see if it were turned by `--turn` degrees to the side |

Images of faulty cameras are written without loss; those of the others are the recording's own. For each fault the poses of all frames are
made (`hmc pose --height auto --cues silhouettes`) and compared with the truth; what the run says of the cameras is printed below the table.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import cv2
import numpy as np

from hmc.io.recording import Recording, iterate_frames, open_recording

FAULTS = ("none", "lost", "frozen", "dark", "late", "late-all", "turned")


def turned(image: np.ndarray, matrix: np.ndarray, degrees: float) -> np.ndarray:
    """The image of a camera that stands where it stood and is turned to the side."""
    turn, _ = cv2.Rodrigues(np.array([0.0, np.radians(degrees), 0.0]))
    warp = matrix @ turn @ np.linalg.inv(matrix)
    return cv2.warpPerspective(image, warp, image.shape[1::-1], flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def faulty(fault: str, images: list[np.ndarray], begin: int, late: int, turn: tuple[np.ndarray, float]) -> list[np.ndarray]:
    """A camera's images with a fault."""
    noise = np.random.default_rng(0)
    before, after = images[:begin], images[begin:]
    if fault == "lost":
        return before
    if fault == "frozen":
        return before + [images[begin - 1]] * len(after)
    if fault == "dark":
        return before + [noise.integers(0, 4, image.shape, np.uint8) for image in after]
    if fault == "late":
        return before + [images[max(0, k - late)] for k in range(begin, len(images))]
    if fault == "late-all":
        return [images[max(0, k - late)] for k in range(len(images))]
    return before + [turned(image, *turn) for image in after]


def make(source: Recording, folder: Path, fault: str, cameras: list[str], given: argparse.Namespace) -> None:
    """The recording with the same fault in some of its cameras."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "videos").mkdir(parents=True)
    for item in source.path.iterdir():
        if item.name not in ("videos", "images", "keypoints"):
            (folder / item.name).symlink_to(item.resolve())
    images: dict[str, list[np.ndarray]] = {name: [] for name in source.rig.names}
    for frame in iterate_frames(source) if fault != "none" else ():
        for name, image in zip(source.rig.names, frame.images, strict=True):
            if name in cameras and image is not None:
                images[name].append(image)
    for camera in source.rig:
        own = next((source.path / "videos").glob(f"{camera.name}.*"))
        if fault == "none" or camera.name not in cameras:
            (folder / "videos" / own.name).symlink_to(own.resolve())
            continue
        (folder / "images" / camera.name).mkdir(parents=True)
        shown = faulty(fault, images[camera.name], given.begin, given.late, (camera.matrix, given.turn))
        for k, image in enumerate(shown):
            cv2.imwrite(str(folder / "images" / camera.name / f"{k:06d}.png"), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])


def hmc(*words: str) -> str:
    """What a command says."""
    done = subprocess.run([sys.executable, "-m", "hmc", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"hmc {' '.join(words)}:\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/faulty"))
    parser.add_argument("--cameras", nargs="+", required=True, metavar="NAME", help="those that fail, all in the same way")
    parser.add_argument("--faults", nargs="+", choices=FAULTS, default=FAULTS)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--begin", type=int, help="the first bad frame (default: the middle)")
    parser.add_argument("--late", type=int, default=10, metavar="FRAMES")
    parser.add_argument("--turn", type=float, default=2.0, metavar="DEGREES")
    parser.add_argument("--pose", action="append", default=[], metavar="OPTION", help="a further option of hmc pose")
    given = parser.parse_args()
    source = open_recording(given.recording, frames=given.late + given.frames)
    n = source.n_frames - given.late
    given.begin = given.late + n // 2 if given.begin is None else given.begin
    table, said, usual = [], [], float("nan")
    for fault in given.faults:
        name = "-".join([fault, *given.cameras]) if fault != "none" else fault
        folder, result = given.out / name, given.out / ("_".join([name, "poses", *given.pose]))
        make(source, folder, fault, given.cameras, given)
        shutil.rmtree(result, ignore_errors=True)
        options = ["--start", str(given.late), "--frames", str(n), "--height", "auto", "--cues", "silhouettes", "--quiet", *given.pose]
        told = hmc("pose", os.fspath(folder), "--out", os.fspath(result), *options)
        hmc("evaluate", os.fspath(result), os.fspath(folder))
        found = tomllib.loads((result / "metrics.toml").read_text())["pose"]
        mean, share = found.get("mean_mm", float("nan")), found["person_frames_estimated"] / found["person_frames"]
        usual = mean if fault == "none" else usual
        table.append(f"| {fault} | {mean:.1f} | {mean - usual:+.1f} | {share:.0%} |")
        said += [f"{fault}: {line}" for line in told.splitlines() if line.startswith("note: ")]
        print(table[-1], *said[-4:], sep="\n", flush=True)
    print(
        f"\n{given.recording.name}, frames {given.late} to {source.n_frames - 1}, {', '.join(given.cameras)} from frame {given.begin} on\n"
    )
    print("| fault | mean error, mm | against none | frames with a pose |\n| --- | --- | --- | --- |", *table, "", *said, sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
