"""A recording whose calibration is of any world, by the commands that the messages propose: how far are its poses from the proper rig's?

    python docs/any_rig.py RECORDING --out out/any_rig --frames 90

Makes four recordings of one with truth, which differ in their calibration's world alone (the first camera's; squares of a board; Y up
in millimetres; Z down), and runs `hmc check`, which must refuse each, `hmc world` and `hmc pose` on them, and `hmc pose` on the recording
as it is, and on its rig without room and number of people, of which the four are told nothing. Poses are brought back into the
recording's world by the cameras' places, and compared with the truth.

    python docs/any_rig.py RECORDING... --up

tells of each recording how far up is off in the first camera's world, and what `hmc world` says of that.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.camera.model import Rig
from hmc.camera.world import World, in_world
from hmc.io.calibration import read_calibration, write_calibration
from hmc.io.recording import open_recording
from hmc.io.results import read_joints

SQUARE_M = 0.05


def worlds(rig: Rig) -> dict[str, tuple[World, list[str]]]:
    """The worlds, and what a user has to say beside."""
    first = World(rig[0].rotation, rig[0].centre, 1.0)
    return {
        "first_camera": (first, []),
        "board_squares": (World(first.rotation, first.origin, 1 / SQUARE_M), ["--unit", str(SQUARE_M)]),
        "y_up_mm": (World(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]), np.zeros(3), 1000.0), []),
        "z_down": (World(np.diag([1.0, -1, -1]), np.zeros(3), 1.0), []),
    }


def make(source: Path, folder: Path, rig: Rig, fps: float) -> None:
    """The recording with another calibration; images are not copied."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("videos", "images", "background", "silhouettes"):
        if (source / name).is_dir() and not (folder / name).exists():
            (folder / name).symlink_to((source / name).resolve())
    for old in (*folder.glob("calibration*.toml"), *folder.glob("recording*.toml")):
        old.unlink()
    write_calibration(folder / "calibration.toml", rig)
    (folder / "recording.toml").write_text(f"fps = {fps:g}\n")


def hmc(*words: str) -> subprocess.CompletedProcess[str]:
    """A command, with what it says."""
    print("$ hmc", *words, flush=True)
    return subprocess.run([sys.executable, "-m", "hmc", *words], capture_output=True, text=True, check=False)


def back(found: Rig, proper: Rig) -> World:
    """From the found world to the proper one, by the cameras' places (Umeyama 1991)."""
    a, b = found.centres - found.centres.mean(axis=0), proper.centres - proper.centres.mean(axis=0)
    rotation = Rotation.align_vectors(b, a)[0].as_matrix()
    scale = float(np.sqrt((b**2).sum() / (a**2).sum()))
    return World(rotation, found.centres.mean(axis=0) - rotation.T @ proper.centres.mean(axis=0) / scale, scale)


def error_mm(result: Path, source: Path, world: World) -> float:
    """Mean distance from the truth of the first person, brought back; millimetres."""
    found, truth = read_joints(result / "joints.csv"), read_joints(source / "truth" / "joints.csv")
    first = found.persons == np.unique(found.persons)[0]
    rows = {int(frame): k for k, frame in enumerate(truth.frames)}
    places = np.array([truth.positions[rows[int(frame)]] for frame in found.frames[first]])
    return float(1000 * np.nanmean(np.linalg.norm(world.points(found.positions[first]) - places, axis=-1)))


def tilt_deg(world: World) -> float:
    """How far z is from the proper rig's, degrees."""
    return float(np.rad2deg(np.arccos(np.clip(world.rotation[2, 2], -1, 1))))


def compare_up(sources: list[Path], out: Path) -> int:
    """How many of the recordings are as near as `hmc world` says; the exit code."""
    near, told = 0, 0
    for source in sources:
        proper, folder = open_recording(source), out / f"{source.resolve().name}-up"
        make(source, folder, in_world(proper.rig, worlds(proper.rig)["first_camera"][0]), proper.fps)
        said = hmc("world", str(folder), "--unit", "1", "--out", f"{folder}.png")
        within = re.search(r"to within (\S+) deg", said.stdout)
        if within is None:
            print(f"{source.name}: {said.stderr.strip() or 'nothing is told'}")
            continue
        off = tilt_deg(back(read_calibration(folder), proper.rig))
        told, near = told + 1, near + (off <= float(within[1]))
        print(f"{source.name}: up is {off:.1f} deg off, {within[0]}", flush=True)
    print(f"{near} of {told} as near as is said")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", type=Path, nargs="+", metavar="RECORDING", help="one, or with --up several")
    parser.add_argument("--up", action="store_true", help="look at the direction of up alone")
    parser.add_argument("--out", type=Path, default=Path("out/any_rig"))
    parser.add_argument("--frames", default="90")
    given = parser.parse_args()
    if given.up:
        return compare_up(given.recordings, given.out)
    (source,) = given.recordings
    proper = open_recording(source)
    options = ["--height", "auto", "--cues", "silhouettes", "--frames", given.frames, "--quiet"]
    hmc("pose", str(source), "--out", str(given.out / "proper"), *options)
    # The others are told neither room nor number of people; how much that alone changes shows the proper rig without them.
    make(source, given.out / "untold", proper.rig, proper.fps)
    hmc("pose", str(given.out / "untold"), "--out", str(given.out / "untold-pose"), *options)
    lines = [
        f"proper: {error_mm(given.out / 'proper', source, World()):.1f} mm",
        f"proper, told no more than the others: {error_mm(given.out / 'untold-pose', source, World()):.1f} mm",
    ]
    for name, (world, words) in worlds(proper.rig).items():
        folder, result = given.out / name, given.out / f"{name}-pose"
        make(source, folder, in_world(proper.rig, world), proper.fps)
        checked = hmc("check", str(folder), "--out", str(given.out / f"{name}_check.png"))
        print(*(line for line in checked.stdout.splitlines() if line.startswith("error")), sep="\n")
        print(hmc("world", str(folder), *words, "--out", str(given.out / f"{name}_world.png")).stdout, end="")
        again = hmc("check", str(folder), "--out", str(given.out / f"{name}_check_after.png"))
        hmc("pose", str(folder), "--out", str(result), *options)
        brought = back(read_calibration(folder), proper.rig)
        lines.append(
            f"{name}: check {checked.returncode}, after world {again.returncode}; {error_mm(result, source, brought):.1f} mm; up "
            f"{tilt_deg(brought):.1f} deg and the floor {-100 * brought.points(np.zeros(3))[2]:.1f} cm off, scale {1 / brought.scale:.3f}"
        )
    print(*lines, sep="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
