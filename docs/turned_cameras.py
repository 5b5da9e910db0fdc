"""What a camera costs that has turned since it was calibrated, as it is and turned back: recordings with truth and a wrong calibration.

    python docs/turned_cameras.py data/r1 --turned cam_02 --frames 90
    python docs/turned_cameras.py data/r1 --turned cam_02 --frames 90 --cameras cam_00 cam_02 cam_04 cam_06

The images stay as they are; in the calibration the camera is turned about its centre. Poses are made by silhouettes alone and compared with
the truth, once as `hmc pose` makes them, and once with `--no-exclude`, which keeps the camera as it is.
"""

from __future__ import annotations

import argparse
import shutil
import tomllib
from pathlib import Path

import numpy as np
from faulty_cameras import hmc

from hmc.camera.turned_cameras import turn_back
from hmc.io.calibration.toml import write_calibration
from hmc.io.recording import open_recording

#: About which axis of the world the camera is turned: to the side, up and about its own line of sight at once.
AXIS = np.array([0.6, -0.48, 0.64])


def make(source: Path, folder: Path, camera: str, degrees: float) -> None:
    """The recording with a calibration of before the camera was turned."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for item in source.iterdir():
        if item.name not in ("calibration.toml", "keypoints"):
            (folder / item.name).symlink_to(item.resolve())
    write_calibration(folder / "calibration.toml", turn_back(open_recording(source).rig, {camera: np.radians(degrees) * AXIS}))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/turned"))
    parser.add_argument("--turned", required=True, metavar="CAMERA")
    parser.add_argument("--degrees", type=float, nargs="+", default=(0.0, 0.5, 1.0, 2.0))
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--cameras", nargs="+", metavar="CAMERA", help="of the recording, these alone")
    given = parser.parse_args()
    print("| turned by, degrees | as it is, mm | turned back, mm | said |\n| --- | --- | --- | --- |")
    for degrees in given.degrees:
        folder, means, said = given.out / f"{given.turned}-{degrees:g}", [], ""
        make(given.recording, folder, given.turned, degrees)
        for options in (("--no-exclude",), ()):
            result = folder.with_name("_".join([folder.name, "poses", *(given.cameras or ()), *options]))
            shutil.rmtree(result, ignore_errors=True)
            some = ("--cameras", ",".join(given.cameras)) if given.cameras else ()
            frames = ("--frames", str(given.frames), "--height", "auto", "--cues", "silhouettes", "--quiet")
            told = hmc("pose", str(folder), "--out", str(result), *frames, *some, *options)
            hmc("evaluate", str(result), str(folder))
            means.append(tomllib.loads((result / "metrics.toml").read_text())["pose"]["mean_mm"])
            said = "; ".join(line.removeprefix("note: ").split(";")[0] for line in told.splitlines() if "has turned by" in line)
        print(f"| {degrees:g} | {means[0]:.1f} | {means[1]:.1f} | {said} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
