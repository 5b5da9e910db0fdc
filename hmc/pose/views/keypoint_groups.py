"""Who is in a frame by keypoints alone: detections of different cameras that are of one person, found without any track.

Two detections are of one person when the lines of sight of their keypoints pass one another closely. Of every such pair the places between
the lines are a hypothesis of a person, which the other cameras bear out or not; the one that most cameras bear out best is taken, its
detections are spent, and so on. What has no human trunk, or is not where people can be, is a ghost.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.body.keypoint_places import BODY_KEYPOINTS, MIRRORED
from hmc.camera.model import Rig
from hmc.pose.views.exchanged_sides import TURN_SHARE
from hmc.pose.views.keypoints import SCATTER_M, lines_of
from hmc.pose.views.line_meeting import between_lines, meeting_points

__all__ = ["FoundPeople", "find_people"]

#: A distance between lines counts as this at most, metres: a keypoint that one camera guessed does not part a person.
CAP_M = 0.3
#: Mean distance of lines up to which detections may be of one person, metres.
GATE_M = 0.15
#: Fewer shared keypoints do not tell whether detections are of one person.
LEAST_SHARED = 4
#: From the middle of the shoulders to that of the hips, metres, smallest and largest.
TRUNK_M = (0.3, 0.8)
#: People are within the room, and by so much beyond its walls, its floor and its ceiling, metres.
BEYOND_M = 0.5
#: Two people's trunks are not nearer to one another, metres: a detector may find a person twice.
SAME_M = 0.2
#: The crown over nose and ears, metres, and over the shoulders in lengths of the trunk (`hmc.body.proportions`).
CROWN_M, CROWN_OVER_TRUNK = 0.13, 0.8
_SHOULDERS, _HIPS, _FACE = (
    [k for k, name in enumerate(BODY_KEYPOINTS) if name.endswith(ends)] for ends in ("shoulder", "hip", ("nose", "ear"))
)


@dataclass(frozen=True)
class FoundPeople:
    """People in one frame, the best borne out first.

    Parameters
    ----------
    members : ndarray of int, shape (n, n_cameras)
        Which of each camera's detections is whom; -1 for none.
    positions : ndarray, shape (n, 3)
        The middle of each trunk, world, metres.
    heads : ndarray, shape (n, 3)
        About the top of each head.
    """

    members: np.ndarray
    positions: np.ndarray
    heads: np.ndarray


@dataclass(frozen=True)
class _Lines:
    """All detections of a frame: camera (n,), its centre (n, 3), and directions (n, 15, 3), NaN where nothing was given."""

    camera: np.ndarray
    centre: np.ndarray
    directions: np.ndarray


def find_people(rig: Rig, detections: Sequence[np.ndarray], room: np.ndarray | None = None, most: int | None = None) -> FoundPeople:
    """The people of one frame.

    Parameters
    ----------
    rig : Rig
    detections : sequence of ndarray, shape (n_people, 15, 3)
        One array a camera: column, row and confidence of each of `hmc.body.keypoint_places.BODY_KEYPOINTS`; NaN where it was not given.
    room : ndarray, shape (2, 3), optional
        Lower and upper corner, metres.
    most : int, optional
        People who are there at once at most.

    Returns
    -------
    FoundPeople
        Everybody whom two cameras or more see.
    """
    counts = [len(given) for given in detections]
    camera = np.repeat(np.arange(len(rig)), counts)
    directions = np.array([lines_of(rig[c], one)[0] for c, given in enumerate(detections) for one in given]).reshape(
        -1, len(BODY_KEYPOINTS), 3
    )
    lines = _Lines(camera, rig.centres[camera], directions)
    place = np.arange(len(camera)) - np.repeat(np.cumsum([0, *counts])[:-1], counts)
    pairs, misses, turned = _hypotheses(lines)
    free = np.ones(len(camera), bool)
    members: list[np.ndarray] = []
    middles: list[np.ndarray] = []
    heads: list[np.ndarray] = []
    while len(pairs) and (most is None or len(members) < most):
        cost, picks = _borne_out(lines, pairs, misses, free, len(rig))
        best = int(cost.argmin())
        if not np.isfinite(cost[best]):
            break
        chosen = picks[best]
        here = _meeting(rig, lines, chosen[chosen >= 0], turned[best])
        trunk = _trunk(here)
        if trunk is not None and _may_be((trunk[0] + trunk[1]) / 2, room, middles):
            middles.append((trunk[0] + trunk[1]) / 2)
            heads.append(_head(here, *trunk))
            members.append(np.where(chosen >= 0, place[chosen], -1))
            free[chosen[chosen >= 0]] = False
        misses[best] = np.inf  # neither a ghost nor a person who is known is looked at again
    return FoundPeople(np.array(members, int).reshape(-1, len(rig)), np.array(middles).reshape(-1, 3), np.array(heads).reshape(-1, 3))


def _hypotheses(lines: _Lines) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pairs of detections (m, 2) that may be of one person; how far all detections are from each of these, (m, n), metres; and which of
    them are nearer with left and right exchanged."""
    i, j = np.nonzero(lines.camera[:, None] < lines.camera)
    places, gap = _between(lines, i, j)
    shared = np.isfinite(gap).sum(axis=1)
    off = np.nansum(np.minimum(gap, CAP_M), axis=1) / np.maximum(shared, 1)
    kept = np.flatnonzero((shared >= LEAST_SHARED) & (off < GATE_M))
    pairs, places, own = np.stack([i, j], axis=1)[kept], places[kept], off[kept]
    if not len(pairs):
        return pairs, np.zeros((0, len(lines.camera))), np.zeros((0, len(lines.camera)), bool)
    as_it_is, turned = (_mean_miss(places, lines.centre, lines.directions[:, order]) for order in (np.arange(len(MIRRORED)), MIRRORED))
    is_turned = turned < TURN_SHARE * as_it_is
    misses = np.where(is_turned, turned, as_it_is)
    rows = np.arange(len(pairs))
    for k in (0, 1):
        misses[rows, pairs[:, k]], is_turned[rows, pairs[:, k]] = own, False
    return pairs, misses, is_turned


def _between(lines: _Lines, i: np.ndarray, j: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places between the lines of pairs of detections, (m, 15, 3), and how far the lines pass one another, (m, 15); NaN where they do not
    meet in front of both cameras."""
    return between_lines(lines.centre[i][:, None], lines.directions[i], lines.centre[j][:, None], lines.directions[j])


def _mean_miss(places: np.ndarray, centre: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Mean distance of detections' lines from places (m, 15, 3), shape (m, n), metres; infinite with too few that both have."""
    towards = places[:, None] - centre[:, None]
    along = np.einsum("mnki,nki->mnk", towards, directions)
    missed = np.sqrt(np.maximum((towards**2).sum(axis=-1) - along**2, 0.0))
    missed = np.where(along > 0, np.minimum(missed, CAP_M), np.where(np.isfinite(along), CAP_M, np.nan))
    shared = np.isfinite(missed).sum(axis=-1)
    return np.where(shared >= LEAST_SHARED, np.nansum(missed, axis=-1) / np.maximum(shared, 1), np.inf)


def _borne_out(lines: _Lines, pairs: np.ndarray, misses: np.ndarray, free: np.ndarray, cameras: int) -> tuple[np.ndarray, np.ndarray]:
    """What hypotheses cost, (m,), infinite where one of the pair is spent, and which detection of each camera is theirs, (m, cameras).

    In every camera it is the nearest that is left, or -1; a camera without one costs as much as a detection at the gate.
    """
    open_misses = np.where(free, misses, np.inf)
    cost, picks = np.zeros(len(pairs)), np.full((len(pairs), cameras), -1)
    rows = np.arange(len(pairs))
    for c in range(cameras):
        own = np.flatnonzero(lines.camera == c)
        if not len(own):
            continue
        nearest = own[open_misses[:, own].argmin(axis=1)]
        for side in (0, 1):
            nearest = np.where(lines.camera[pairs[:, side]] == c, pairs[:, side], nearest)
        least = open_misses[rows, nearest]
        picks[:, c] = np.where(least < GATE_M, nearest, -1)
        cost += np.minimum(least, GATE_M)
    gone = ~np.isfinite(open_misses[rows[:, None], pairs]).all(axis=1)
    return np.where(gone, np.inf, cost), picks


def _meeting(rig: Rig, lines: _Lines, chosen: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Where the lines of one person's detections meet, shape (15, 3)."""
    directions = np.full((len(rig), len(BODY_KEYPOINTS), 3), np.nan)
    for k in chosen.tolist():
        directions[lines.camera[k]] = lines.directions[k][MIRRORED] if turned[k] else lines.directions[k]
    return meeting_points(rig.centres, directions, np.full(directions.shape[:2], SCATTER_M))


def _middle_of(points: np.ndarray, which: Sequence[int]) -> np.ndarray | None:
    known = points[which][np.isfinite(points[which]).all(axis=1)]
    return known.mean(axis=0) if len(known) else None


def _trunk(points: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The middles of shoulders and of hips, or None where these are not a human trunk's."""
    shoulders, hips = (_middle_of(points, which) for which in (_SHOULDERS, _HIPS))
    if shoulders is None or hips is None or not TRUNK_M[0] <= np.linalg.norm(shoulders - hips) <= TRUNK_M[1]:
        return None
    return shoulders, hips


def _may_be(middle: np.ndarray, room: np.ndarray | None, known: Sequence[np.ndarray]) -> bool:
    """Whether a person whose trunk is there is where people can be, and is none of those who are known."""
    if room is not None and ((middle < room[0] - BEYOND_M) | (middle > room[1] + BEYOND_M)).any():
        return False
    return all(np.linalg.norm(middle - other) > SAME_M for other in known)


def _head(points: np.ndarray, shoulders: np.ndarray, hips: np.ndarray) -> np.ndarray:
    """About the top of the head: in the trunk's direction over the face, or over the shoulders."""
    up, face = shoulders - hips, _middle_of(points, _FACE)
    return shoulders + CROWN_OVER_TRUNK * up if face is None else face + CROWN_M * up / np.linalg.norm(up)
