"""Which feet stand, and on what: told of a whole run from how they move.

Shoes of the floor's color, and what a foot stands on, are the first that silhouettes lose, and a body that is fitted to what is left hangs
in the air, with shanks that are too short. But who walks, runs or stands has some foot that stays where it is for a moment, and such a foot
stands on the floor. Told from the ankles of a first pass, so that the second one can hold the soles there (`hmc.body.floor`). Of feet on
tiptoe, a dancer's or the back one of a lunge, nothing is said: silhouettes know better how high the heel is.

What somebody stands on is the floor, but for a mat, a beam or a treadmill, or where a calibration has the floor elsewhere: then feet at
rest are all too high by as much.

That a foot at rest is one that stands is how recorded motion is rid of skating feet (Kovar, Schreiner and Gleicher 2002); bounds are ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hmc.body.feet import foot_points
from hmc.body.floor import sole_places
from hmc.body.kinematics import landmarks, segment_transforms
from hmc.body.model import BodyModel
from hmc.io.results import PoseStates
from hmc.landmarks import LANDMARKS

__all__ = ["Footing", "ground_notes", "ground_under", "standing_feet", "standing_frames"]

#: The sole is flat on the floor where the ankle, over so many seconds, is slower than this, metres a second.
OVER_S, SLOW_M_S = 0.13, 0.3
#: The ball is where the ankle is slower than the first, or than this share of its fastest within so many seconds before and after: before a
#: foot leaves, its heel rises and the ankle rolls on.
ROLLING_M_S, ROLLING_SHARE, STRIDE_S = 0.45, 0.25, 1.0
#: No higher than so far above the lowest that it is within these seconds, metres ...
LIFTED_M = 0.08
#: ... and with its sole no farther than this from the ground, metres: what stands on a chair's rung or a step stands elsewhere.
FROM_GROUND_M = 0.12
#: Of soles at rest, the height that this share is lower than; silhouettes lose shoes, so that even these are commonly so much too high,
#: metres ...
LOW_SHARE, LOST_M = 0.25, 0.015
#: ... and on the floor itself no higher than this; so many feet at rest tell.
RAISED_M, LEAST_RESTS = 0.04, 5
#: Of two feet the lower one tells, or both where they are no farther apart than this, metres.
ALIKE_M = 0.03
#: A foot stands on tiptoe whose heel is so high above the ground, and so much higher than its ball, metres: of shoes that silhouettes
#: lose the heel may seem 9 cm high ...
HEEL_M, TIPTOE_M = 0.10, 0.05
#: ... unless its lower end is this far below the ground: what nothing shows points anywhere.
SUNK_M = 0.04
#: Who kneels or lies has feet at rest whose soles are anywhere: the knee is above the ankle by this share of the shank at least.
UPRIGHT = 0.5

_ANKLES, _KNEES = ([LANDMARKS.index(f"{side}_{joint}") for side in "lr"] for joint in ("ankle", "knee"))


@dataclass(frozen=True)
class Footing:
    """What one person stands on, and when.

    Parameters
    ----------
    ground_z : float
        Height of what is under the feet, metres.
    feet : mapping of int to tuple of bool
        By frame: whether heel and ball of the left foot, and those of the right one, are on it; neither, on tiptoe.
    """

    ground_z: float
    feet: Mapping[int, tuple[bool, ...]]


def standing_feet(states: PoseStates, bodies: Mapping[int, BodyModel], fps: float, floor_z: float) -> dict[int, Footing]:
    """Which feet of each person stand in each frame, and on what.

    Parameters
    ----------
    states : PoseStates
        Rows that are not finite were not fitted.
    bodies : mapping of int to BodyModel
        By person.
    fps : float
    floor_z : float
        Height of the floor, metres.

    Returns
    -------
    dict of int to Footing
        By person, of those who were fitted.
    """
    found = {}
    for person, body in bodies.items():
        rows = np.flatnonzero((states.persons == person) & np.isfinite(states.states).all(axis=1))
        rows = rows[np.argsort(states.frames[rows])]
        if not len(rows):
            continue
        own = states.states[rows]
        places = landmarks(body, own)
        ankles, shanks = places[:, _ANKLES], places[:, _KNEES] - places[:, _ANKLES]
        upright = shanks[..., 2] > UPRIGHT * np.linalg.norm(shanks, axis=-1)
        rest = standing_frames(states.frames[rows] / fps, ankles) & upright[..., None]
        soles = sole_places(body, *segment_transforms(body, own))[0][..., 2].reshape(len(rows), 2, 2)
        lowest = foot_points(body, own)[..., 2].reshape(len(rows), 2, 2).min(axis=2)
        flat = _standing(rest, soles - floor_z, lowest - floor_z)[..., 0] & (lowest < lowest.min(axis=1, keepdims=True) + ALIKE_M)
        ground_z = ground_under(soles[flat].mean(axis=-1), floor_z)
        stand = _standing(rest, soles - ground_z, lowest - ground_z)
        found[person] = Footing(
            ground_z, {int(frame): tuple(parts.ravel().tolist()) for frame, parts in zip(states.frames[rows], stand, strict=True)}
        )
    return found


def ground_under(soles: np.ndarray, floor_z: float) -> float:
    """Height of what somebody stands on, metres: the floor, or what is above it.

    Parameters
    ----------
    soles : ndarray, shape (n,)
        Heights of soles at rest, of one person and a whole run, metres.
    floor_z : float
        Height of the floor, metres.
    """
    if len(soles) < LEAST_RESTS:
        return floor_z
    low = float(np.quantile(soles, LOW_SHARE))
    return low - LOST_M if low > floor_z + RAISED_M else floor_z


def ground_notes(footing: Mapping[int, Footing], floor_z: float) -> list[str]:
    """A line on everybody who does not stand on the floor.

    Parameters
    ----------
    footing : mapping of int to Footing
        From `standing_feet`.
    floor_z : float
        Height of the floor, metres.
    """
    return [
        f"person {person} stands some {100 * (one.ground_z - floor_z):.0f} cm above the floor (z = {floor_z:g} m): on a mat, a step or a "
        "treadmill, or the floor is elsewhere; `room` in recording.toml says how low it is"
        for person, one in sorted(footing.items())
        if one.ground_z != floor_z
    ]


def _standing(rest: np.ndarray, soles: np.ndarray, lowest: np.ndarray) -> np.ndarray:
    """Which heels and balls at rest, (n, 2, 2), stand, by how high they and the lowest points of the feet (n, 2) are above the ground."""
    stand = rest & (np.abs(lowest) < FROM_GROUND_M)[..., None]
    heels, balls = np.moveaxis(soles, -1, 0)
    # Only where the whole sole would be held: before each step the heel rises too, and the ball stays.
    on_tiptoe = stand[..., 0] & (heels > HEEL_M) & (heels - balls > TIPTOE_M) & (lowest > -SUNK_M)
    return stand & ~on_tiptoe[..., None]


def standing_frames(times: np.ndarray, ankles: np.ndarray) -> np.ndarray:
    """When heel and ball of each foot are at rest, as low as the foot comes.

    Parameters
    ----------
    times : ndarray, shape (n,)
        Seconds, in order.
    ankles : ndarray, shape (n, k, 3)
        World, metres.

    Returns
    -------
    ndarray of bool, shape (n, k, 2)
    """
    speed = np.zeros(ankles.shape[:2])
    for row, (first, end) in enumerate(_windows(times, np.maximum(OVER_S / 2, _to_second_next(times)) + 1e-6)):
        t = times[first:end] - times[first:end].mean()
        if t.any():  # the slope of a straight line through them
            speed[row] = np.linalg.norm(np.tensordot(t, ankles[first:end], axes=(0, 0)) / (t @ t), axis=-1)
    rest = np.zeros((*ankles.shape[:2], 2), bool)
    for row, (first, end) in enumerate(_windows(times, np.full(len(times), STRIDE_S + 1e-6))):
        low = ankles[row, :, 2] < ankles[first:end, :, 2].min(axis=0) + LIFTED_M
        rolling = np.maximum(ROLLING_M_S, ROLLING_SHARE * speed[first:end].max(axis=0))
        rest[row] = np.stack([speed[row] < SLOW_M_S, speed[row] < rolling], axis=-1) & low[:, None]
    return rest


def _to_second_next(times: np.ndarray) -> np.ndarray:
    """How far the second nearest other time is from each, where there are so many."""
    padded = np.concatenate([[-np.inf] * 2, times, [np.inf] * 2])
    others = np.stack([padded[2 + k : 2 + k + len(times)] for k in (-2, -1, 1, 2)], axis=-1)
    away = np.sort(np.abs(others - times[:, None]), axis=-1)
    return away[:, min(2, len(times) - 1) - 1] if len(times) > 1 else np.zeros(len(times))


def _windows(times: np.ndarray, reach: np.ndarray) -> list[tuple[int, int]]:
    """First row and end of those no farther than `reach` from each of the times, ascending."""
    first, end = np.searchsorted(times, times - reach), np.searchsorted(times, times + reach, side="right")
    return list(zip(first.tolist(), end.tolist(), strict=True))
