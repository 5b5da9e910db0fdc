"""A session of six trials, run at one go, and run again with a kill every few seconds: are results and report the same bytes?

    python docs/lab_session.py --out out/session

Renders six trials of one rig and room, with two persons, writes their ``session.toml``, and runs `hmc run` on it twice: once undisturbed,
once killed by SIGKILL at moments drawn at random and started again until it is through. All files but the times in them are compared,
and the poses with the truth.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from hmc.io.results import read_joints

ROOT = Path(__file__).resolve().parents[1]
RECIPE = ROOT / "data" / "synthetic" / "tiny.toml"
#: Of each trial what differs from the recipe: stature, motion, speed or none, place and heading.
TRIALS = {
    "ana_walk_1": (1.62, "walk", "speed_m_s = 1.1", (-1.1, 0.1), 5),
    "ana_walk_2": (1.62, "walk", "speed_m_s = 1.3", (1.0, -0.8), 150),
    "ana_box": (1.62, "box", "", (0.2, 0.1), 60),
    "ben_walk_1": (1.84, "walk", "speed_m_s = 1.2", (0.4, -1.0), 100),
    "ben_jog": (1.84, "jog", "speed_m_s = 1.6", (-1.2, -0.5), 20),
    "ben_gesture": (1.84, "gesture", "", (0.0, 0.3), 200),
}
SESSION = """# Six trials of two persons, made by docs/lab_session.py
name = "Two persons, six trials"
calibration = "calibration.toml"
background = "background"
trials = "trials/*"
videos = "raw/{trial}_{camera}.mp4"

[recording]
fps = 15
room = [[-2.8, -2.6, 0.0], [2.8, 2.6, 3.0]]

[pose]
method = "apf"

[[person]]
name = "Ana"
height_m = 1.62

[[person]]
name = "Ben"
height_m = 1.84
"""
#: Times, which differ from run to run, and the report's links to logs, which trials that run side by side have.
TIMES = re.compile(rb"<time>.*?</time>|^(check|pose|view) = [0-9.]+$| &middot; <a href=.[^\"]*/log\.txt.>log\.txt</a>", re.MULTILINE)


def make_session(folder: Path) -> Path:
    """Render the trials, three of them as folders, three as videos with names by a pattern; the session's file."""
    text, tables = SESSION, []
    for k, (name, (height, motion, speed, start, heading)) in enumerate(TRIALS.items()):
        recipe = folder / "recipes" / f"{name}.toml"
        recipe.parent.mkdir(parents=True, exist_ok=True)
        changed = RECIPE.read_text()
        for key, value in (("height_m", height), ("motion", f'"{motion}"'), ("start_m", list(start)), ("heading_deg", heading)):
            changed = re.sub(rf"^{key} = [^#\n]*", f"{key} = {value} ", changed, flags=re.MULTILINE)
        recipe.write_text(re.sub(r"^speed_m_s = [^#\n]*", speed, changed, flags=re.MULTILINE))
        made = folder / "made" / name
        if not (made / "truth").is_dir():
            subprocess.run([sys.executable, "-m", "hmc", "synth", str(recipe), "--out", str(made)], check=True, stderr=subprocess.DEVNULL)
        if not (folder / "calibration.toml").exists():
            shutil.copy(made / "calibration.toml", folder)
            shutil.copytree(made / "background", folder / "background")
        person = name.split("_")[0].capitalize()
        tables.append(f'\n[[trial]]\nname = "{name}"\npersons = ["{person}"]\n')
        for video in sorted((made / "videos").iterdir()):
            to = folder / "trials" / name / "videos" / video.name if k < 3 else folder / "raw" / f"{name}_{video.name}"
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(video, to)
    (folder / "session.toml").write_text(text + "".join(tables))
    return folder / "session.toml"


def run(session: Path, out: Path, killed_after_s: float | None = None, *more: str) -> int:
    """Run the session; the exit code, -9 where it was killed."""
    command = [sys.executable, "-m", "hmc", "run", str(session), "--out", str(out), "--quiet", *more]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": str(ROOT)})
    try:
        return process.wait(killed_after_s)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        return process.wait()


def files(out: Path) -> dict[str, bytes]:
    """All files of a run, without the times in them, hidden ones and logs left out."""
    found = (path for path in sorted(out.rglob("*")) if path.is_file() and path.name != "log.txt" and path.name[0] != ".")
    return {str(path.relative_to(out)): TIMES.sub(b"", path.read_bytes()) for path in found}


def error_mm(result: Path, made: Path) -> float:
    """Mean distance of the first person's landmarks from the truth, millimetres."""
    found, truth = read_joints(result / "joints.csv"), read_joints(made / "truth" / "joints.csv")
    found = found.of(int(np.unique(found.persons)[0]))
    rows = {int(frame): k for k, frame in enumerate(truth.frames)}
    places = np.array([truth.positions[rows[int(frame)]] for frame in found.frames])
    return float(1000 * np.nanmean(np.linalg.norm(found.positions - places, axis=-1)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/session"))
    parser.add_argument("--parallel", default="1")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    session = make_session(given.out / "lab")
    whole, broken, rng = given.out / "whole", given.out / "broken", np.random.default_rng(given.seed)
    for old in (whole, broken):
        shutil.rmtree(old, ignore_errors=True)
    begun = time.perf_counter()
    code = run(session, whole)
    print(f"at one go: exit code {code}, {time.perf_counter() - begun:.0f} s", flush=True)
    kills, begun = 0, time.perf_counter()
    while (code := run(session, broken, float(rng.uniform(5, 25)), "--parallel", given.parallel)) == -signal.SIGKILL:
        kills += 1
    print(f"killed {kills} times: exit code {code}, {time.perf_counter() - begun:.0f} s", flush=True)
    one, other = files(whole), files(broken)
    different = sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))
    print(f"{len(one)} files, {len(different)} different{': ' if different else ''}{', '.join(different)}")
    for name in TRIALS:
        print(f"{name}: {error_mm(whole / name, given.out / 'lab' / 'made' / name):.1f} mm")
    return 1 if different else 0


if __name__ == "__main__":
    raise SystemExit(main())
