"""What a trial's result is worth, in a few numbers and lines, from its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.proportions import stature
from hmc.io.results import PoseStates, PoseTable, TrackTable, read_joints, read_pose, read_run, read_tracks
from hmc.landmarks import ENOUGH_VIEWS

__all__ = ["TrialResult", "person_lines", "read_trial_result"]

#: What `hmc pose` leaves; the last is written last.
FILES = ("joints.csv", "tracks.csv", "pose.npz", "run.toml")


@dataclass(frozen=True, eq=False)
class TrialResult:
    """The result of one trial.

    Parameters
    ----------
    poses : PoseTable
    tracks : TrackTable
    states : PoseStates
    run : mapping
        `run.toml`.
    """

    poses: PoseTable
    tracks: TrackTable
    states: PoseStates
    run: Mapping[str, Any]

    @property
    def n_frames(self) -> int:
        """Frames that were looked at."""
        return int(self.run["parameters"]["frames"])

    @property
    def fps(self) -> float:
        """Frames a second."""
        return float(self.run["parameters"]["fps"])

    @property
    def n_persons(self) -> int:
        """How many persons were found."""
        return len(np.unique(self.poses.persons))

    @property
    def problems(self) -> list[str]:
        """What was survived, a line each."""
        return list(self.run.get("problems", ()))

    @property
    def mean_cost(self) -> float:
        """Mean over persons and frames of what the method minimised; NaN where it tells none."""
        costs = np.zeros(0) if self.states.costs is None else self.states.costs[np.isfinite(self.states.costs)]
        return float(costs.mean()) if len(costs) else float("nan")

    @property
    def clear_share(self) -> float:
        """Share of the landmarks that two cameras or more show clear, 0 to 1; NaN where it is not known."""
        views = np.zeros(0) if self.poses.views is None else self.poses.views[np.isfinite(self.poses.views)]
        return float((views >= ENOUGH_VIEWS).mean()) if views.size else float("nan")

    @property
    def lines(self) -> list[str]:
        """What `hmc pose` says of the persons."""
        return person_lines(self.poses, self.states, self.n_frames)


def read_trial_result(folder: str | Path) -> TrialResult | None:
    """The result in a folder; None where there is none that is finished.

    Raises
    ------
    InputError
        When a file of it is damaged.
    """
    joints, tracks, states, run = (Path(folder) / name for name in FILES)
    if not all(path.exists() for path in (joints, tracks, states, run)):
        return None
    return TrialResult(read_joints(joints), read_tracks(tracks), read_pose(states), read_run(run))


def person_lines(poses: PoseTable, states: PoseStates, n_frames: int) -> list[str]:
    """A line for every person: frames and stature; or that there is none."""
    lines = []
    for person in np.unique(poses.persons):
        rows = poses.persons == person
        frames, body = poses.frames[rows], states.bodies.get(int(person))
        tall = "no pose" if body is None else f"stature about {stature({name: float(value) for name, value in body.items()}):.2f} m"
        lines.append(f"person {person}: {rows.sum()} frames, from {frames.min()} to {frames.max()}, {tall}")
    return lines or [f"no person in {n_frames} frames"]
