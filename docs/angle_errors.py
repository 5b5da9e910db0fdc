"""How far the angles of results are from those of the truth: `hmc angles` of both, where the truth shows them.

    python docs/angle_errors.py RESULT RECORDING [RESULT RECORDING ...]

RESULT is what `hmc pose` wrote, RECORDING a rendered recording with `truth/joints.csv`, and `truth/feet.csv` for the ankles. Of both sides
together, over all frames and recordings that are given: the mean absolute error, its middle value and that below which 95 % are, the
mean error (found minus true), and the mean absolute error that is left where each recording's own mean error is taken off. Degrees. The
true ankle is at 90 degrees minus the angle from the sole (heel to toe) to the shank (ankle to knee).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from hmc.io.results import PoseTable, read_joints
from hmc.landmarks import FOOT_POINTS, LANDMARKS
from hmc.motion.clinical import clinical_angles, state_angles
from hmc.motion.trajectory import read_trajectories

#: Angles of both sides, and of the trunk.
PAIRED = ("hip_flexion", "hip_adduction", "knee_flexion", "ankle_dorsiflexion", "shoulder_elevation", "elbow_flexion")
SINGLE = ("trunk_flexion", "trunk_lateral_flexion", "trunk_rotation", "pelvis_rotation", "pelvis_obliquity")


def true_angles(recording: Path, person: int, frames: np.ndarray) -> dict[str, np.ndarray]:
    """Of one person, degrees by name; NaN where the truth has none."""
    joints = at_frames(read_joints(recording / "truth" / "joints.csv").of(person), frames)
    angles = clinical_angles(joints)
    if (recording / "truth" / "feet.csv").is_file():
        feet = at_frames(read_joints(recording / "truth" / "feet.csv", FOOT_POINTS).of(person), frames)
        for k, side in enumerate("lr"):
            sole = feet[:, 2 * k + 1] - feet[:, 2 * k]
            shank = joints[:, LANDMARKS.index(f"{side}_knee")] - joints[:, LANDMARKS.index(f"{side}_ankle")]
            cosine = (sole * shank).sum(axis=-1) / np.linalg.norm(sole, axis=-1) / np.linalg.norm(shank, axis=-1)
            angles[f"{side}_ankle_dorsiflexion_deg"] = 90 - np.degrees(np.arccos(cosine))
    return angles


def at_frames(table: PoseTable, frames: np.ndarray) -> np.ndarray:
    """Positions at these frames, (n, k, 3); NaN where there are none."""
    found = np.full((len(frames), *table.positions.shape[1:]), np.nan)
    _, mine, theirs = np.intersect1d(frames, table.frames, return_indices=True)
    found[mine] = table.positions[theirs]
    return found


def nearest_person(recording: Path, frames: np.ndarray, positions: np.ndarray) -> int:
    """Whose truth a person's pose is nearest to."""
    truth = read_joints(recording / "truth" / "joints.csv")
    apart = {
        int(person): np.nanmean(np.linalg.norm(at_frames(truth.of(int(person)), frames) - positions, axis=-1))
        for person in np.unique(truth.persons)
    }
    return min(apart, key=apart.__getitem__)


def errors(result: Path, recording: Path) -> dict[str, np.ndarray]:
    """Found minus true, degrees, by angle; both sides one after the other."""
    found: dict[str, list[np.ndarray]] = {name: [] for name in (*PAIRED, *SINGLE)}
    for one in read_trajectories(result):
        own = clinical_angles(one.positions) | state_angles(one)
        true = true_angles(recording, nearest_person(recording, one.frames, one.positions), one.frames)
        for name in found:
            for column in [f"{side}_{name}_deg" for side in "lr"] if name in PAIRED else [f"{name}_deg"]:
                if column in true:
                    found[name].append((own[column] - true[column] + 180) % 360 - 180)
    return {name: np.concatenate(parts) if parts else np.zeros(0) for name, parts in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="RESULT RECORDING")
    given = parser.parse_args().folders
    if len(given) % 2:
        parser.error("give pairs: a result and its recording")
    measured = [errors(result, recording) for result, recording in zip(given[::2], given[1::2], strict=True)]
    print("| angle | mean error | half are below | 95 % are below | found minus true | without each recording's own offset | values |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in (*PAIRED, *SINGLE):
        parts = [own for one in measured if len(own := one[name][np.isfinite(one[name])])]
        if parts:
            every, left = np.concatenate(parts), np.concatenate([np.abs(own - own.mean()) for own in parts])
            low, high = np.percentile(np.abs(every), [50, 95])
            cells = [np.abs(every).mean(), low, high, every.mean(), left.mean()]
            print(f"| `{name}` | " + " | ".join(f"{cell:.1f}" for cell in cells) + f" | {len(every)} |")


if __name__ == "__main__":
    main()
