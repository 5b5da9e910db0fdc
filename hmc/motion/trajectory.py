"""A finished result as one trajectory a person, without a missing row: from their first frame to their last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hmc.body.feet import foot_places, foot_points
from hmc.body.joints import DOF_NAMES, N_DOF, JointLimits, default_limits, dof_index
from hmc.body.model import BodyModel
from hmc.body.proportions import make_bodies
from hmc.errors import InputError
from hmc.io.results import PoseStates, PoseTable, read_joints, read_pose, read_run
from hmc.landmarks import ENOUGH_VIEWS, FOOT_POINTS, LANDMARKS, landmark_index

__all__ = ["Trajectory", "above_zero", "chosen", "read_trajectories", "trajectories"]

#: No person is away for so many frames for each of a pose.
MOST_GAPS = 10_000


@dataclass(frozen=True)
class Trajectory:
    """A person over time.

    Parameters
    ----------
    person : int
    fps : float
        Frames a second.
    frames : ndarray of int, shape (n,)
        Consecutive frame numbers of the recording, in which frame 0 is at 0 s.
    positions : ndarray, shape (n, 15, 3)
        Landmarks, world, metres; NaN in gaps.
    views : ndarray, shape (n, 15), optional
        Cameras that show each landmark clear; NaN where not known.
    states : ndarray, shape (n, 37), optional
        Metres and radians, in the order of `hmc.body.joints.DOF_NAMES`; NaN in gaps.
    body : BodyModel, optional
        Whose states they are.
    trust : ndarray, shape (n, 15), optional
        How likely each landmark is within 60 mm of the truth; NaN where not known.
    """

    person: int
    fps: float
    frames: np.ndarray
    positions: np.ndarray
    views: np.ndarray | None = None
    states: np.ndarray | None = None
    body: BodyModel | None = None
    trust: np.ndarray | None = None

    @property
    def times_s(self) -> np.ndarray:
        """When each frame was taken, shape (n,)."""
        return self.frames / self.fps

    @property
    def feet(self) -> np.ndarray | None:
        """Heels and toes (`hmc.landmarks.FOOT_POINTS`), shape (n, 4, 3), metres; None for a body without feet, or whose feet are held.

        NaN in gaps, and where fewer than two cameras show the ankle clear: there a foot is where posture puts it.
        """
        if self.states is None or self.body is None or foot_places(self.body) is None:
            return None
        turns = self.states[:, [dof_index(f"{side}_ankle_{axis}")[0] for side in "lr" for axis in "yz"]]
        if not np.nan_to_num(turns).any():
            return None
        points = np.full((len(self.frames), len(FOOT_POINTS), 3), np.nan)
        known = np.isfinite(self.states).all(axis=1)
        points[known] = foot_points(self.body, self.states[known])
        if self.views is not None:
            hidden = self.views[:, [landmark_index(f"{name[0]}_ankle") for name in FOOT_POINTS]] < ENOUGH_VIEWS
            points[hidden] = np.nan
        return points

    @property
    def points(self) -> tuple[tuple[str, ...], np.ndarray]:
        """Names of all points that are known of this person, k of them, and where they are, shape (n, k, 3): landmarks, then feet."""
        feet = self.feet
        if feet is None:
            return LANDMARKS, self.positions
        return (*LANDMARKS, *FOOT_POINTS), np.concatenate([self.positions, feet], axis=1)


def trajectories(poses: PoseTable, states: PoseStates | None, fps: float) -> list[Trajectory]:
    """The trajectories of all persons who were ever fitted, by number.

    Parameters
    ----------
    poses : PoseTable
    states : PoseStates or None
        None: of a result without angles.
    fps : float
        Frames a second.

    Raises
    ------
    InputError
        When a frame is so far from the others that what lies between would take the memory.
    """
    found = []
    for person in np.unique(poses.persons).tolist():
        own = poses.of(person)
        fitted = np.isfinite(own.positions).any(axis=(1, 2))
        if not fitted.any():
            continue
        first, last = int(own.frames[fitted].min()), int(own.frames[fitted].max())
        own = own.where(fitted)
        if last - first > MOST_GAPS * len(own.frames):
            raise InputError(
                f"joints.csv: person {person} has a pose in {len(own.frames)} of the frames {first} to {last}; remove the line of "
                "the one that is far from the others"
            )
        frames, rows = np.arange(first, last + 1), own.frames - first
        positions = _spread(own.positions, rows, len(frames))
        views, trust = (None if values is None else _spread(values, rows, len(frames)) for values in (own.views, own.trust))
        one = Trajectory(person, fps, frames, positions, views, trust=trust)
        if states is not None and person in states.bodies:
            of_person = np.flatnonzero(states.persons == person)
            kept = of_person[np.isin(states.frames[of_person], own.frames)]
            whole = _spread(_known_dofs(states)[kept], states.frames[kept] - first, len(frames))
            body = make_bodies({person: states.bodies[person]}, _wide_limits(whole))[person]
            one = replace(one, states=whole, body=body)
        found.append(one)
    return found


def read_trajectories(folder: str | Path, fps: float | None = None, person: int | None = None) -> list[Trajectory]:
    """The trajectories of a result's folder.

    Parameters
    ----------
    folder : path
        With ``joints.csv``; ``pose.npz`` where the method has angles; ``run.toml``.
    fps : float, optional
        Frames a second; by default those of ``run.toml``, or of ``pose.npz`` where poses were saved without one.
    person : int, optional
        This one alone.

    Raises
    ------
    InputError
        When there is no such result, nobody in it, or its frames a second are not known or no number above 0.
    """
    folder, given = Path(folder), None if fps is None else above_zero("fps", fps)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; a result is the folder that `hmc pose` wrote")
    if not (folder / "joints.csv").is_file():
        raise InputError(f"{folder}: no joints.csv; make poses first (hmc pose)")
    states = read_pose(folder / "pose.npz") if (folder / "pose.npz").is_file() else None
    poses, rate = read_joints(folder / "joints.csv"), given or _fps_of(folder, states)
    try:
        found = trajectories(poses, states, rate)
    except InputError as error:
        raise InputError(f"{folder / 'pose.npz'}: {error}") from None
    return chosen(found, person, str(folder))


def above_zero(name: str, value: float) -> float:
    """A number that an argument gives.

    Parameters
    ----------
    name : str
        Of the argument, for the message.
    value : float

    Raises
    ------
    InputError
        When it is no finite number above 0.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not 0 < number < np.inf:
        raise InputError(f"`{name}` must be a number above 0; got {value}")
    return number


def chosen(found: list[Trajectory], person: int | None, source: str) -> list[Trajectory]:
    """All of the trajectories, or one person's.

    Raises
    ------
    InputError
        When there is nobody.
    """
    if not found:
        raise InputError(f"{source}: nobody has a pose in it")
    if person is None:
        return found
    if all(one.person != person for one in found):
        raise InputError(f"{source}: no person {person}; there are {', '.join(str(one.person) for one in found)}")
    return [one for one in found if one.person == person]


def _fps_of(folder: Path, states: PoseStates | None) -> float:
    run: Mapping[str, Any] = read_run(folder / "run.toml") if (folder / "run.toml").is_file() else {}
    fps = run.get("parameters", {}).get("fps", None if states is None else states.fps)
    if not isinstance(fps, int | float) or not fps > 0:
        raise InputError(f"{folder}: neither run.toml nor pose.npz says how many frames a second; give --fps")
    return float(fps)


def _spread(values: np.ndarray, rows: np.ndarray, n: int) -> np.ndarray:
    out = np.full((n, *values.shape[1:]), np.nan)
    out[rows] = values
    return out


def _known_dofs(states: PoseStates) -> np.ndarray:
    """States in the order of today's degrees of freedom; those that an older result lacks are 0, as they were held."""
    places = {name: place for place, name in enumerate(states.dof_names)}
    out = np.zeros((len(states.states), N_DOF))
    for k, name in enumerate(DOF_NAMES):
        if name in places:
            out[:, k] = states.states[:, places[name]]
    return out


def _wide_limits(states: np.ndarray) -> JointLimits:
    """Those of the default body, and wider where a pose was: a paper's body may turn where ours does not."""
    usual = default_limits()
    low, high = (np.where(np.isfinite(states), states, bound) for bound in (np.inf, -np.inf))
    return JointLimits(np.minimum(usual.low, low.min(axis=0)), np.maximum(usual.high, high.max(axis=0)))
