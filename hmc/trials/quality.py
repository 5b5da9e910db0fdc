"""What a trial's result is worth, in a few numbers and lines, from its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from hmc.body.proportions import stature
from hmc.io.result_files import RESULT
from hmc.io.results import PoseStates, PoseTable, TrackTable, read_joints, read_pose, read_run, read_tracks
from hmc.landmarks import LANDMARKS

__all__ = ["TrialResult", "person_lines", "read_trial_result", "trust_line", "trust_summary"]

#: Landmarks that are named as doubtful, at most.
MOST_NAMED = 3
#: Of persons who are told by their numbers alone.
NOBODY: Mapping[int, str] = MappingProxyType({})


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
    def sound_share(self) -> float:
        """Share of the landmarks that are not doubtful (`PoseTable.doubtful`), 0 to 1; NaN where it is not known."""
        summary = trust_summary(self.poses)
        return 1 - float(summary["doubtful"]) / float(summary["landmarks"]) if summary else float("nan")

    def lines(self, names: Mapping[int, str] = NOBODY) -> list[str]:
        """What `hmc pose` says of the persons, who may have names."""
        return person_lines(self.poses, self.states, self.n_frames, names)


def read_trial_result(folder: str | Path) -> TrialResult | None:
    """The result in a folder; None where there is none that is finished.

    Raises
    ------
    InputError
        When a file of it is damaged.
    """
    joints, tracks, states, run = (Path(folder) / name for name in RESULT)
    if not all(path.exists() for path in (joints, tracks, states, run)):
        return None
    return TrialResult(read_joints(joints), read_tracks(tracks), read_pose(states), read_run(run))


def person_lines(poses: PoseTable, states: PoseStates, n_frames: int, names: Mapping[int, str] = NOBODY) -> list[str]:
    """A line for every person, some of whom may have a name: frames and stature; or that there is none."""
    lines = []
    for person in np.unique(poses.persons):
        rows = poses.persons == person
        frames, body = poses.frames[rows], states.bodies.get(int(person))
        tall = "no pose" if body is None else f"stature about {stature({name: float(value) for name, value in body.items()}):.2f} m"
        who = f"{names[int(person)]} (person {person})" if int(person) in names else f"person {person}"
        lines.append(f"{who}: {rows.sum()} frames, from {frames.min()} to {frames.max()}, {tall}")
    return lines or [f"no person in {n_frames} frames"]


def trust_summary(poses: PoseTable) -> dict[str, Any]:
    """How many landmarks there are and are doubtful, and of each person which, for ``run.toml``; empty where it is not known of any."""
    doubtful, there = poses.doubtful, np.isfinite(poses.positions).all(axis=2)
    if doubtful is None or not there.any():
        return {}
    counts = {str(person): doubtful[poses.persons == person].sum(axis=0) for person in np.unique(poses.persons)}
    by_person = {person: {LANDMARKS[k]: int(own[k]) for k in np.flatnonzero(own)} for person, own in counts.items() if own.any()}
    return {"landmarks": int(there.sum()), "doubtful": int(doubtful.sum()), "persons": by_person}


def trust_line(poses: PoseTable, names: Mapping[int, str] = NOBODY) -> list[str]:
    """A line on how many landmarks are doubtful, and which most of all; none where it is not known of any."""
    summary = trust_summary(poses)
    if not summary:
        return []
    sums = {(person, name): n for person, own in summary["persons"].items() for name, n in own.items()}
    worst = sorted(sums, key=lambda one: -sums[one])[:MOST_NAMED]
    share = summary["doubtful"] / summary["landmarks"]
    named = ", ".join(f"{name} of {names.get(int(person), f'person {person}')} in {sums[person, name]} frames" for person, name in worst)
    return [f"of {summary['landmarks']} landmarks {summary['doubtful']} are doubtful ({share:.1%}){': ' if named else ''}{named}"]
