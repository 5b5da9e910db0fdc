"""How far fitted bodies' lengths are off the true bones, and how well each fit says that it knows them.

    hmc pose r1 --out out-r1 --height auto --cues silhouettes --frames 90
    python docs/known_lengths.py out-r1=r1 out-box=box

One person a recording. Deviations of an account that is right are as large as what lengths are off, and the last column is near 1. What
every body has wrong the same way, as joints that another renderer places elsewhere, is in it.
"""

from __future__ import annotations

import argparse
import tomllib
from pathlib import Path

import numpy as np

from hmc.body.proportions import DEFAULT_LENGTHS
from hmc.io.results import read_joints
from hmc.landmarks import landmark_index

#: Dimensions, and the landmarks between which their bones lie.
SIDED = {"upper_arm": ("shoulder", "elbow"), "forearm": ("elbow", "wrist"), "thigh": ("hip", "knee"), "shank": ("knee", "ankle")}
ACROSS = {"shoulder_half_width": "shoulder", "hip_half_width": "hip"}
ASYMMETRIC = {"arms_longer_left": ("upper_arm", "forearm"), "legs_longer_left": ("thigh", "shank")}


def true_lengths(positions: np.ndarray) -> dict[str, float]:
    """Of a body's dimensions, metres and shares, from landmarks of shape (n, 15, 3)."""

    def apart(one: np.ndarray, other: np.ndarray) -> float:
        return float(np.nanmedian(np.linalg.norm(one - other, axis=1)))

    joints = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    at = {name: {side: positions[:, landmark_index(f"{side}_{name}")] for side in "lr"} for name in joints}
    sides = {name: [apart(at[one][side], at[other][side]) for side in "lr"] for name, (one, other) in SIDED.items()}
    true = {name: float(np.mean(both)) for name, both in sides.items()}
    true |= {name: apart(at[joint]["l"], at[joint]["r"]) / 2 for name, joint in ACROSS.items()}
    hips = (at["hip"]["l"] + at["hip"]["r"]) / 2
    neck, crown = (positions[:, landmark_index(name)] for name in ("neck", "head_top"))
    # The crown is before the line of neck and head, along which the head is measured.
    slant = np.hypot(1, DEFAULT_LENGTHS["head_forward"] / DEFAULT_LENGTHS["head"])
    true |= {"trunk": apart(neck, hips), "head": apart(crown, neck) / float(slant)}
    for name, bones in ASYMMETRIC.items():
        left, right = (sum(sides[bone][k] for bone in bones) for k in (0, 1))
        true[name] = 2 * (left - right) / (left + right)
    return true


def main() -> None:
    """Print a row for each dimension."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("results", nargs="+", metavar="RESULT=RECORDING")
    args = parser.parse_args()
    off: dict[str, list[tuple[float, float]]] = {}
    for pair in args.results:
        result, recording = (Path(part) for part in pair.split("="))
        person, known = next(iter(tomllib.loads((result / "run.toml").read_text())["bodies"]["known_to_percent"].items()))
        with np.load(result / "pose.npz") as stored:
            own = {name: float(stored[f"body/{person}/{name}"]) for name in known}
        for name, value in true_lengths(read_joints(recording / "truth" / "joints.csv").positions).items():
            error = own[name] - value if name in ASYMMETRIC else np.log(own[name] / value)
            off.setdefault(name, []).append((100 * error, known[name]))
    print("| dimension | off, %, root mean square | mean | known to, % | off over known |\n| --- | --- | --- | --- | --- |")
    for name, rows in off.items():
        error, deviation = np.array(rows).T
        said = np.sqrt(np.mean(error**2)), error.mean(), deviation.mean(), np.sqrt(np.mean((error / deviation) ** 2))
        print(f"| {name} | {said[0]:.1f} | {said[1]:+.1f} | {said[2]:.1f} | {said[3]:.2f} |")


if __name__ == "__main__":
    main()
