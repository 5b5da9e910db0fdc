"""Whose a camera's detections are: by where the people are tracked, and by where other cameras' lines of sight pass.

Each detection has one person at most. First, in every camera, whose tracked trunk is nearest in the image. Of people who stand one behind
the other that says little: so where a detection may be of several people, or a person's several detections, how far its lines of sight
pass those that other cameras have of each person counts as well, camera after camera, until nothing changes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.body.keypoint_places import BODY_KEYPOINTS, MIRRORED
from hmc.camera.model import Camera, Rig, project
from hmc.pose.views.line_meeting import between_lines

__all__ = ["LEAST_CONFIDENCE", "whose"]

#: Detections of a keypoint that are less sure are left out.
LEAST_CONFIDENCE = 0.1
#: A detection's trunk farther than this from where a person is tracked is another's, metres.
GATE_M = 0.6
#: How far tracks are off the trunks commonly, where people are many, and how far lines of one person's keypoint pass one another, metres.
TRACK_M, LINES_M = 0.2, 0.05
#: A keypoint counts as this at most, squared deviations: one that a camera guessed does not part a person.
MOST = 9.0
#: Rounds after which detections are whose they are.
ROUNDS = 3
_TRUNK = [BODY_KEYPOINTS.index(name) for name in ("l_shoulder", "r_shoulder", "l_hip", "r_hip")]
#: Costs of what cannot be: more than all others together.
_FAR = 1e4


def whose(
    rig: Rig, detections: Sequence[np.ndarray], directions: Sequence[np.ndarray], people: Mapping[int, np.ndarray]
) -> dict[int, list[int | None]]:
    """Which of each camera's detections is whose.

    Parameters
    ----------
    rig : Rig
    detections : sequence of ndarray, shape (n_people, 15, 3)
        One array a camera: column, row and confidence of each of `BODY_KEYPOINTS`; NaN where it was not given.
    directions : sequence of ndarray, shape (n_people, 15, 3)
        The same as unit vectors along lines of sight, world.
    people : mapping of int to ndarray of shape (3,)
        Where each person's trunk is tracked, world, metres.

    Returns
    -------
    dict of int to list of int or None
        Of each person, one a camera; None where none is theirs.
    """
    apart = [_trunks_apart(camera, given, people) for camera, given in zip(rig, detections, strict=True)]
    found = [_matched(one) for one in apart]
    near = [one < GATE_M for one in apart]
    doubtful = [
        c for c, one in enumerate(near) if len(rig) > 1 and (one.sum(axis=0).max(initial=0) > 1 or one.sum(axis=1).max(initial=0) > 1)
    ]
    for _ in range(ROUNDS):
        before = [dict(one) for one in found]
        for c in doubtful:
            cost = (apart[c] / TRACK_M) ** 2 + _lines_apart(rig, directions, found, c, len(people))
            found[c] = _matched(np.where(near[c], cost, _FAR))
        if found == before:
            break
    return {person: [one.get(k) for one in found] for k, person in enumerate(people)}


def _matched(cost: np.ndarray) -> dict[int, int]:
    """The detection of each person, by the least sum of costs (n_detections, n_people)."""
    rows, columns = linear_sum_assignment(cost)
    return {int(j): int(i) for i, j in zip(rows, columns, strict=True) if cost[i, j] < _FAR}


def _trunks_apart(camera: Camera, given: np.ndarray, people: Mapping[int, np.ndarray]) -> np.ndarray:
    """How far detected trunks are from where people should be, (n_detections, n_people), metres; `_FAR` beyond the gate."""
    if not len(given) or not people:
        return np.zeros((len(given), len(people)))
    places = np.array(list(people.values()))
    expected, valid = project(camera, places)
    depth = places @ camera.rotation[2] + camera.translation[2]
    with np.errstate(all="ignore"):
        trunk = np.array([_middle(one) for one in given])
        apart = np.linalg.norm(trunk[:, None] - expected[None], axis=-1) * depth / camera.matrix[0, 0]
    return np.where(np.isfinite(apart) & valid & (apart < GATE_M), apart, _FAR)


def _lines_apart(rig: Rig, directions: Sequence[np.ndarray], found: Sequence[Mapping[int, int]], camera: int, people: int) -> np.ndarray:
    """How far the lines of a camera's detections pass those of each person in other cameras, (n_detections, n_people), squared deviations.

    The mean over keypoints that both have and over cameras, with left and right as they are or exchanged, whichever is less; 1, which is
    what a right match has commonly, where no other camera has the person or a keypoint with this one: who is seen by none shall not be
    nearer than who is.
    """
    own = directions[camera]
    out = np.ones((len(own), people))
    for person in range(people):
        others = [c for c, one in enumerate(found) if c != camera and person in one]
        if not others:
            continue
        lines = np.array([directions[c][found[c][person]] for c in others])
        both_ways = []
        for order in (slice(None), MIRRORED):
            _, gap = between_lines(rig.centres[camera], own[:, None, order], rig.centres[others][:, None], lines)
            known = np.isfinite(gap)
            squared = np.where(known, np.minimum((gap / LINES_M) ** 2, MOST), 0.0).sum(axis=-1)
            said = known.sum(axis=-1)
            both_ways.append(np.where(said > 0, squared / np.maximum(said, 1), 1.0).mean(axis=1))
        out[:, person] = np.minimum(*both_ways)
    return out


def _middle(one: np.ndarray) -> np.ndarray:
    """The middle of a detected trunk, or of all that was detected where there is none, pixels."""
    sure = one[:, 2] >= LEAST_CONFIDENCE
    trunk = np.zeros(len(one), bool)
    trunk[_TRUNK] = True
    told = sure & trunk if (sure & trunk).sum() >= 2 else sure
    return one[told, :2].mean(axis=0) if told.any() else np.full(2, np.nan)
