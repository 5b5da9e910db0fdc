"""A recording whose cameras are out of time, made of one that is in time: does `hmc sync` find by how much?

    python docs/out_of_time.py RECORDING --out out/out_of_time --shift cam_02=7 cam_04=-12 --drop cam_05=50

A camera with a shift of 7 began 7 frames before the others, one with -12 as many after them; one that drops lacks every so manieth frame.
`--stranger cam_03=OTHER_RECORDING` takes that camera's images from another recording. Images are written without loss. Runs `hmc check`,
`hmc sync` and `hmc sync` again, and prints what was found beside what is true: of each camera the share of the frames of the mended
recording at which its image is of the same moment as the others'.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

from hmc.io.recording import Recording, iterate_frames, open_recording


def pairs(words: list[str]) -> dict[str, str]:
    """`cam_02=7` and the like."""
    return dict(word.split("=", 1) for word in words)


def frames_of(n: int, shifts: dict[str, int], drops: dict[str, int], names: tuple[str, ...]) -> dict[str, list[int]]:
    """The frames of the proper recording that each camera has, in its order."""
    earliest = max([0, *shifts.values()])
    frames = {}
    for name in names:
        begin = earliest - shifts.get(name, 0)
        frames[name] = [frame for frame in range(begin, n) if not (name in drops and (frame - begin + 1) % drops[name] == 0)]
    return frames


def make(source: Recording, folder: Path, frames: dict[str, list[int]], strangers: dict[str, Recording]) -> None:
    """The recording out of time."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for item in source.path.iterdir():
        if item.name == "background" or (item.name.startswith("calibration") and item.suffix in (".toml", ".yml", ".json", ".qca.txt")):
            (folder / item.name).symlink_to(item.resolve())
    room = [[round(float(value), 4) for value in corner] for corner in source.room]
    (folder / "recording.toml").write_text(f'name = "{source.name} out of time"  # made\nfps = {source.fps:g}\nroom = {room}\n')
    places = {name: {frame: k for k, frame in enumerate(own)} for name, own in frames.items()}
    for name in places:
        (folder / "images" / name).mkdir(parents=True)
    for recording in (source, *strangers.values()):
        for frame in iterate_frames(recording):
            for name, image in zip(recording.rig.names, frame.images, strict=True):
                if image is not None and strangers.get(name, source) is recording and frame.index in places.get(name, {}):
                    file = folder / "images" / name / f"{places[name][frame.index]:06d}.png"
                    cv2.imwrite(str(file), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    keypoints = source.path / "keypoints"
    for name in places if keypoints.is_dir() else ():
        files = sorted((keypoints / name).glob("*.json"))
        (folder / "keypoints" / name).mkdir(parents=True)
        for frame, place in places[name].items():
            if frame < len(files) and name not in strangers:
                (folder / "keypoints" / name / f"{name}_{place:012d}_keypoints.json").symlink_to(files[frame].resolve())


def hmc(*words: str) -> subprocess.CompletedProcess[str]:
    """A command, with what it says."""
    print("$ hmc", *words, flush=True)
    done = subprocess.run([sys.executable, "-m", "hmc", *words], capture_output=True, text=True, check=False)
    print(done.stdout + done.stderr, end="")
    return done


def shares_in_time(folder: Path, frames: dict[str, list[int]]) -> dict[str, tuple[float, int]]:
    """Of each camera the share of the recording's frames at which it shows the moment that most show, and how many it lacks."""
    recording = open_recording(folder)
    n = recording.n_frames
    moments = np.full((len(recording.rig), n), -1)
    for row, name, view in zip(moments, recording.rig.names, recording._own_views, strict=True):
        for k in range(min(n, view.n_frames)):
            place = view.in_file(k)
            if place is not None and place < len(frames[name]):
                row[k] = frames[name][place]
    usual = [int(np.median(column[column >= 0])) if (column >= 0).any() else -1 for column in moments.T]
    return {
        name: (float((row == usual)[row >= 0].mean()), int((row < 0).sum())) for name, row in zip(recording.rig.names, moments, strict=True)
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/out_of_time"))
    parser.add_argument("--shift", nargs="*", default=[], metavar="CAMERA=N")
    parser.add_argument("--drop", nargs="*", default=[], metavar="CAMERA=N")
    parser.add_argument("--stranger", nargs="*", default=[], metavar="CAMERA=RECORDING")
    given = parser.parse_args()
    source = open_recording(given.recording)
    shifts = {name: int(n) for name, n in pairs(given.shift).items()}
    drops = {name: int(n) for name, n in pairs(given.drop).items()}
    strangers = {name: open_recording(Path(path)) for name, path in pairs(given.stranger).items()}
    frames = frames_of(source.n_frames, shifts, drops, source.rig.names)
    make(source, given.out, frames, strangers)
    picture = str(given.out.with_name(given.out.name + "_{}.png"))
    before = shares_in_time(given.out, frames)
    hmc("check", str(given.out), "--out", picture.format("check"))
    hmc("sync", str(given.out), "--out", picture.format("sync"))
    after = shares_in_time(given.out, frames)
    hmc("sync", str(given.out), "--out", picture.format("sync_again"))
    print("camera    shift  dropped  in time before  after  frames it lacks")
    for name in source.rig.names:
        true = f"{shifts.get(name, 0):+5d}  {('every ' + str(drops[name])) if name in drops else '-':>8}"
        what = "  stranger" if name in strangers else ""
        print(f"{name:8}  {true}  {before[name][0]:13.0%}  {after[name][0]:5.0%}  {after[name][1]:5d}{what}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
