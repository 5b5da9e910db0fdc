"""How far trunks are turned about the vertical against a reference: a result's, and those that a detector's keypoints show by themselves.

    hmc pose balancing --out out --height auto --cues silhouettes --frames 90
    python docs/trunk_turn.py balancing out --truth balancing/reference/joints.csv

Where joints are another system's result, a turn of all of a trunk may be that system's own. The headings of the lines from right to left
hip and shoulder are compared, frame by frame; keypoints are lines of sight met robustly and low-passed (`hmc.experiments.cue_runs`).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from hmc.experiments.cue_runs import triangulated
from hmc.io.keypoints import open_keypoints
from hmc.io.recording import open_recording
from hmc.io.results import PoseTable, read_joints, read_tracks
from hmc.landmarks import landmark_index
from hmc.pose.keypoint_cues import learn_scatter


def headings(poses: PoseTable, part: str, person: int) -> dict[int, float]:
    """By frame, radians about Z, of the line from a person's right hip or shoulder to the left one."""
    rows = np.flatnonzero(poses.persons == person)
    line = poses.positions[rows, landmark_index(f"l_{part}")] - poses.positions[rows, landmark_index(f"r_{part}")]
    return dict(zip(poses.frames[rows].tolist(), np.arctan2(line[:, 1], line[:, 0]).tolist(), strict=True))


def main() -> None:
    """Print a row for each part and estimate."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("result", type=Path)
    parser.add_argument("--truth", type=Path, required=True)
    parser.add_argument("--person", type=int, default=0, help="of the result and of the reference")
    args = parser.parse_args()
    recording, reference, tracks = open_recording(args.recording), read_joints(args.truth), read_tracks(args.result / "tracks.csv")
    estimates = {"result": read_joints(args.result / "joints.csv")}
    source = open_keypoints(recording)
    if source is not None:
        cues = learn_scatter(recording.rig, tracks, source, recording.fps)
        estimates["keypoints alone"] = triangulated(recording, tracks, cues)
    print("| line | estimate | frames | turned, median, degrees | middle half |\n| --- | --- | --- | --- | --- |")
    for part in ("hip", "shoulder"):
        true = headings(reference, part, args.person)
        for name, poses in estimates.items():
            own = headings(poses, part, args.person)
            turns = np.array([np.angle(np.exp(1j * (own[frame] - true[frame]))) for frame in own if frame in true])
            low, middle, high = np.nanpercentile(np.degrees(turns), [25, 50, 75])
            print(f"| {part}s | {name} | {np.isfinite(turns).sum()} | {middle:+.0f} | {low:+.0f} to {high:+.0f} |")


if __name__ == "__main__":
    main()
