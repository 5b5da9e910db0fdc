"""Cameras that have turned since they were calibrated: how they are told from others, and turned back.

A camera that was touched by a degree is out by 6 cm where people are. Whatever tells where cameras ought to look, one rotation about its
centre mends all that such a camera is off, all through the recording; errors of what tells it are mended by none. Of two cameras that
differ, the others tell which it is; so there are four of them at least, and one camera is turned at a time. Ours; what is minimised is the
angle's part of bundle adjustment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hmc.camera.model import Camera, Rig

__all__ = ["LEAST_CAMERAS", "TurnedCamera", "farthest_off_first", "fitted_turn", "turn_back", "with_turns"]

#: Cameras that are needed: three that agree tell of a fourth.
LEAST_CAMERAS = 4
#: By no more than this share of what it was a camera is off when it is turned back; of well calibrated ones it is 90 % at least.
MENDED_SHARE = 0.65
#: A turn lasts: in each of so many parts of the run this share of a miss is left at most. A detector is wrong for a while.
PARTS, LASTING_SHARE = 5, 0.8
#: So far may a camera have turned, radians. Of turns that mend as much the smallest is meant: each miss is more by so many metres a radian.
MOST_TURN, SMALL_M = np.radians(8), 0.15


@dataclass(frozen=True)
class TurnedCamera:
    """A camera that has turned since it was calibrated.

    Parameters
    ----------
    name : str
    turn : ndarray, shape (3,)
        Rotation vector about the camera's centre, world, radians, that brings its lines of sight to where they belong.
    before_m, after_m : float
        Median of what it is off, as it is calibrated and turned back.
    by : str
        What told of it, as it is said.
    """

    name: str
    turn: np.ndarray
    before_m: float
    after_m: float
    by: str

    def __str__(self) -> str:
        degrees = np.degrees(np.linalg.norm(self.turn))
        return (
            f"camera '{self.name}' has turned by {degrees:.1f} deg since it was calibrated: its {self.by} the other cameras' by "
            f"{1000 * self.before_m:.0f} mm, turned back by {1000 * self.after_m:.0f}"
        )


def fitted_turn(misses: Callable[[np.ndarray], np.ndarray], wide_m: float, name: str, by: str) -> TurnedCamera:
    """The rotation that brings a camera nearest to what the others tell; none where it does not last all through the run.

    Parameters
    ----------
    misses : callable
        A rotation vector (3,) to what the camera misses when it is turned by it, shape (n, k): n things in the order of time, metres.
    wide_m : float
        What is missed by more counts ever less, metres (Cauchy).
    name, by : str
        As of `TurnedCamera`.
    """
    start = np.zeros(3)
    small = SMALL_M * np.sqrt(len(misses(start)))
    fit = least_squares(
        lambda turn: np.append(misses(turn), small * turn), start, loss="cauchy", f_scale=wide_m, bounds=(-MOST_TURN, MOST_TURN)
    )
    before, after = (np.linalg.norm(misses(turn), axis=1) for turn in (start, fit.x))
    parts = zip(np.array_split(before, PARTS), np.array_split(after, PARTS), strict=True)
    if any(np.median(turned) > LASTING_SHARE * np.median(was) for was, turned in parts):
        return TurnedCamera(name, start, float(np.median(before)), float(np.median(before)), by)
    return TurnedCamera(name, fit.x, float(np.median(before)), float(np.median(after)), by)


def farthest_off_first(
    cameras: Sequence[int], off_m: float, left_m: float, tried: Callable[[int, dict[int, np.ndarray]], TurnedCamera | None]
) -> list[TurnedCamera]:
    """Cameras that have turned, the one that is farthest off first; no more than leave three as they are.

    Parameters
    ----------
    cameras : sequence of int
        Those that tell enough.
    off_m : float
        By more than this, metres, in the median, a camera is off that has turned.
    left_m : float
        By no more than this, metres, it is off when it is turned back.
    tried : callable
        A camera, and the turns of those that were found before it, to how it has turned; None where that cannot be told.
    """
    found: dict[int, TurnedCamera] = {}
    while len(cameras) - len(found) >= LEAST_CAMERAS:
        turns = {c: one.turn for c, one in found.items()}
        told = {c: tried(c, turns) for c in cameras if c not in found}
        off = {c: one for c, one in told.items() if one is not None and one.before_m > off_m}
        mended = {c: one for c, one in off.items() if one.after_m < min(left_m, MENDED_SHARE * one.before_m)}
        if not mended:
            break
        worst = max(mended, key=lambda c: mended[c].before_m)
        found[worst] = mended[worst]
    return list(found.values())


def with_turns(rays: np.ndarray, turns: Mapping[int, np.ndarray]) -> np.ndarray:
    """Directions, world, shape (n, n_cameras, k, 3), with those of some cameras turned by rotation vectors."""
    rays = rays.copy()
    for c, turn in turns.items():
        rays[:, c] = rays[:, c] @ Rotation.from_rotvec(turn).as_matrix().T
    return rays


def turn_back(rig: Rig, turns: Mapping[str, np.ndarray]) -> Rig:
    """The rig with cameras turned back about their centres.

    Parameters
    ----------
    rig : Rig
    turns : mapping of str to ndarray, shape (3,)
        Rotation vectors by the cameras' names, as of `TurnedCamera`.
    """
    return Rig(tuple(_rotated(camera, turns[camera.name]) if camera.name in turns else camera for camera in rig))


def _rotated(camera: Camera, turn: np.ndarray) -> Camera:
    """A camera with its lines of sight turned by a rotation vector about its centre."""
    rotation = camera.rotation @ Rotation.from_rotvec(turn).as_matrix().T
    return replace(camera, rotation=rotation, translation=-rotation @ camera.centre)
