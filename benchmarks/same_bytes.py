"""Whether a change of the code leaves results as they were: the digests of what every pose method writes of four short clips.

    python benchmarks/same_bytes.py --out out/before             # at the old commit: writes out/before/digests.txt
    python benchmarks/same_bytes.py --out out/after --against out/before/digests.txt

Runs are seeded, so a step that only moves code must give equal bytes of `joints.csv`, `tracks.csv` and `pose.npz`. The clips: one person
before seven cameras, one before four, three people, and one who wears markers. `--workers` runs go side by side; their results do not
depend on it. Exit status 1 where a digest differs.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import subprocess
import sys
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

FILES = ("joints.csv", "tracks.csv", "pose.npz")
#: Recording (a recipe, or a folder), and the options that select a part of it.
CLIPS = {
    "one": ("data/synthetic/tiny", ()),
    "four_cameras": ("box", ("--cameras", "cam_00,cam_02,cam_03,cam_05", "--start", "20", "--frames", "50")),
    "three_people": ("crossing", ("--start", "30", "--frames", "30")),
    "markers": ("data/synthetic/tiny", ("--markers", "joints", "--detections")),
}
METHODS = {
    "apf": (),
    "apf_canton2009": ("--preset", "canton2009"),
    "apf_spectral": ("--init", "spectral", "--smooth"),
    "shbm-apf": (),
    "ddm-apf": (),
    "shbm-ddm-apf": (),
    "smd": (),
    "smd_kehl2006": ("--preset", "kehl2006"),
    "pso": (),
    "pso_hsiao2008": ("--preset", "hsiao2008"),
}


def main() -> int:
    """Run everything, write the digests, compare."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--against", type=Path, help="digests.txt of another commit")
    parser.add_argument("--clips", type=Path, help="folder of rendered clips; by default inside of --out")
    parser.add_argument("--only", help="methods, by comma")
    parser.add_argument("--on", help="clips, by comma")
    parser.add_argument("--workers", type=int, default=1)
    args = parser.parse_args()
    rendered = args.clips or args.out / "clips"
    for recording, _ in CLIPS.values():
        if not Path(recording).is_dir() and not (rendered / recording).is_dir():
            _hmc("synth", recording, "--out", rendered / recording)
    names = args.only.split(",") if args.only else [*METHODS, "marker-apf"]
    clips = args.on.split(",") if args.on else list(CLIPS)
    jobs = [(clip, name) for clip in clips for name in names if (clip == "markers") == (name == "marker-apf")]
    with ThreadPoolExecutor(args.workers) as pool:
        lines = list(pool.map(lambda job: _digests(args.out, rendered, *job), jobs))
    text = "".join(line for some in lines for line in some)
    (args.out / "digests.txt").write_text(text, encoding="utf-8")
    if args.against is None:
        return 0
    before = args.against.read_text(encoding="utf-8").splitlines()
    missing = [line for line in text.splitlines() if line not in before]
    for line in missing:
        print("differs:", line.split()[1])
    print(f"{len(text.splitlines()) - len(missing)} of {len(text.splitlines())} files are as they were")
    return int(bool(missing))


def _digests(out: Path, rendered: Path, clip: str, name: str) -> list[str]:
    recording, selection = CLIPS[clip]
    source = recording if Path(recording).is_dir() else rendered / recording
    folder = out / clip / name
    if clip == "markers":
        selection = (*selection, write_detections(out / "detections.csv", Path(recording)))
    _hmc("pose", source, "--out", folder, "--method", name.split("_")[0], "--height", "auto", "--quiet", *selection, *METHODS.get(name, ()))
    return [f"{hashlib.sha256((folder / file).read_bytes()).hexdigest()}  {clip}/{name}/{file}\n" for file in FILES]


def write_detections(path: Path, recording: Path) -> Path:
    """What a detector might see of the true joints: nine of ten, off by a pixel, and three false ones a view. By OpenCV alone."""
    rng = np.random.default_rng(0)
    cameras = tomllib.loads((recording / "calibration.toml").read_text(encoding="utf-8"))
    with open(recording / "truth" / "joints.csv", encoding="utf-8") as file:
        truth = [(int(row["frame"]), [float(row[axis]) for axis in "xyz"]) for row in csv.DictReader(file)]
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", encoding="utf-8") as file:
        file.write("frame,camera,u,v\n")
        for frame in sorted({frame for frame, _ in truth}):
            points = np.array([point for at, point in truth if at == frame])
            for camera in cameras.values():
                if "matrix" not in camera:
                    continue
                lens = (np.array(camera[name], float) for name in ("rotation", "translation", "matrix", "distortions"))
                uv = cv2.projectPoints(points, *lens)[0][:, 0][rng.random(len(points)) < 0.9]
                seen = np.concatenate([uv + rng.normal(size=uv.shape), rng.uniform((0, 0), camera["size"], (3, 2))])
                file.writelines(f"{frame},{camera['name']},{u:.3f},{v:.3f}\n" for u, v in seen)
    return path


def _hmc(*arguments: object) -> None:
    subprocess.run([sys.executable, "-m", "hmc", *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    sys.exit(main())
