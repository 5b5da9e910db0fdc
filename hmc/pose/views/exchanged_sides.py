"""In which cameras a detector took a person's left for the right, by where their lines of sight of one frame meet.

A pattern says of every camera whether its left and right are turned. Of all patterns the one is best whose lines meet most closely. A
pattern and its complement meet alike, in points that are one another's mirrored: which of both it is one frame does not tell
(`hmc.pose.keypoint_sides` decides it over time). Neither do the lines of two cameras that stand level tell much, whose turned lines meet
in other corners of the same quadrangle; so the points that two lines tell are held against the lines of all the other cameras.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hmc.body.keypoint_places import MIRRORED
from hmc.pose.views.line_meeting import MEET, between_lines, meeting_points, passing

__all__ = ["TURN_SHARE", "FrameSides", "pattern_scores", "patterns_of", "possible_sides", "sides_of_frame", "with_turned"]

#: A camera's left and right are told where one way round lowers its distances from the others' points to this share of the other way's.
TURN_SHARE = 0.5
#: Fewer keypoints that have a side do not tell.
LEAST_TOLD = 4
#: What turning a camera has to lower the score by, squared deviations: as much as five lines that meet for five that do not. Of two cameras
#: that have guessed what they do not see, wrong patterns have been better by 43.
TURN_COST = 5 * MEET**2
#: With more cameras, not all patterns are looked at, but those that pairs of cameras suggest.
ALL_PATTERNS = 10
#: Patterns that meet less closely than the best one by more than this are not possible, squared deviations; and so many at most are.
DOUBTED, MOST_PATTERNS = 60.0, 4
_SIDED = np.flatnonzero(MIRRORED != np.arange(len(MIRRORED)))


@dataclass(frozen=True)
class FrameSides:
    """What one frame tells of which cameras' left and right are exchanged.

    Parameters
    ----------
    turned : ndarray of bool, shape (n_cameras,)
        Cameras to turn: the pattern with fewer of them.
    told : ndarray of bool, shape (n_cameras,)
        Cameras of which the frame tells; the complement is ``told & ~turned``.
    points : ndarray, shape (15, 3)
        Where lines meet so, world, metres; of the complement they are these, mirrored.
    excess : float
        By how much lines of another pattern meet more closely, squared deviations.
    """

    turned: np.ndarray
    told: np.ndarray
    points: np.ndarray
    excess: float = 0.0

    def is_like(self, other: FrameSides) -> bool:
        """Whether both turn the same cameras against the others."""
        same, mirrored = self.turned == other.turned, (self.told & ~self.turned) == other.turned
        return bool((self.told == other.told).all() and (same.all() or mirrored.all()))


def with_turned(values: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Values of keypoints (n_cameras, 15, ...) with left and right exchanged in some cameras (n_cameras,)."""
    out = values.copy()
    out[turned] = values[turned][:, MIRRORED]
    return out


def sides_of_frame(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray) -> FrameSides:
    """Which cameras' left and right are exchanged, as far as one frame tells it.

    Parameters
    ----------
    centres : ndarray, shape (n_cameras, 3)
    directions : ndarray, shape (n_cameras, 15, 3)
        NaN where a camera has none.
    deviation : ndarray, shape (n_cameras, 15)
        Metres.

    Returns
    -------
    FrameSides
        A camera that agrees with nobody, or is as near either way round, is not told of and not turned.
    """
    return possible_sides(centres, directions, deviation)[0]


def possible_sides(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray) -> tuple[FrameSides, ...]:
    """The same, and other patterns that one frame does not tell from it for sure, as of two cameras that stand level.

    Parameters
    ----------
    centres, directions, deviation
        As of `sides_of_frame`.

    Returns
    -------
    tuple of FrameSides
        What `sides_of_frame` says first; no two alike.
    """
    patterns, scores = np.zeros((1, len(centres)), bool), np.zeros(1)
    there = np.flatnonzero(np.isfinite(directions).all(axis=-1).any(axis=1))
    if len(there) > 1:
        distances = _distances(centres[there], directions[there], deviation[there])
        some = patterns_of(len(there)) if len(there) <= ALL_PATTERNS else _suggested(distances)
        scores = _scores(distances, some)
        turns = np.minimum(some.sum(axis=1), (~some).sum(axis=1))
        order = np.argsort(scores + TURN_COST * turns, kind="stable")
        order = order[(scores[order] < scores[order[0]] + DOUBTED) | (order == order[0])][:MOST_PATTERNS]
        patterns, scores = np.zeros((len(order), len(centres)), bool), scores[order]
        patterns[:, there] = some[order]
    out: list[FrameSides] = []
    for pattern, score in zip(patterns, scores.tolist(), strict=True):
        sides = _sides(centres, directions, deviation, pattern, score - float(scores.min()))
        if not any(sides.is_like(other) for other in out):
            out.append(sides)
    return tuple(out)


def _sides(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray, pattern: np.ndarray, excess: float) -> FrameSides:
    """A pattern without the cameras that do not tell of it; turned are the fewer cameras."""
    points = _points(centres, directions, deviation, pattern)
    told = _told(centres, directions, deviation, points, pattern)
    if (pattern & ~told).any():
        points = _points(centres, directions, deviation, pattern & told)
    turned = pattern & told
    if 2 * turned.sum() > told.sum():
        return FrameSides(told & ~turned, told, points[MIRRORED], excess)
    return FrameSides(turned, told, points, excess)


def patterns_of(cameras: int) -> np.ndarray:
    """All patterns in which the first of so many cameras is not turned, bool, (2**(cameras - 1), cameras); that without turns first."""
    return (np.arange(2 ** (cameras - 1))[:, None] >> np.arange(cameras - 1, -1, -1) & 1).astype(bool)


def pattern_scores(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray, patterns: np.ndarray) -> np.ndarray:
    """How closely lines meet in patterns of turned cameras.

    Of every keypoint it is the sum over cameras of squared distances in deviations, of `MEET` at most, from the point that lies best of
    all that two of the lines tell.

    Parameters
    ----------
    centres, directions, deviation
        As of `sides_of_frame`.
    patterns : ndarray of bool, shape (n, n_cameras)

    Returns
    -------
    ndarray, shape (n,)
    """
    return _scores(_distances(centres, directions, deviation), patterns)


def _pairs(cameras: int) -> np.ndarray:
    return np.array(list(combinations(range(cameras), 2)))


def _distances(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Squared distances in deviations, capped, of every camera's lines as they are and turned from what every pair of lines tells, either
    of both as it is or turned: (2, 2, pairs, 14, n_cameras, 2); the cap where a line or a point is missing."""
    ways = np.stack([directions, directions[:, MIRRORED]])[:, :, _SIDED]
    scale = np.stack([deviation, deviation[:, MIRRORED]])[:, :, _SIDED]
    i, j = _pairs(len(centres)).T
    places, _ = between_lines(centres[i][:, None], ways[:, None, i], centres[j][:, None], ways[None, :, j])
    with np.errstate(invalid="ignore"):
        off = np.stack([passing(places, centres, ways[side]) / scale[side] for side in (0, 1)], axis=-1)
    off = np.where(np.isfinite(off), np.minimum(off, MEET), MEET)
    return np.moveaxis(off**2, -3, -2)


def _scores(distances: np.ndarray, patterns: np.ndarray) -> np.ndarray:
    cameras = patterns.shape[1]
    i, j = _pairs(cameras).T
    # The sum over cameras, of each the side that the pattern says, is a product of matrices.
    sums = np.tensordot(patterns.astype(float), distances[..., 1] - distances[..., 0], (1, -1)) + distances[..., 0].sum(axis=-1)
    rows = np.arange(len(patterns))[:, None]
    side = patterns.astype(int)
    return sums[rows, side[:, i], side[:, j], np.arange(len(i))].min(axis=1).sum(axis=-1)


def _suggested(distances: np.ndarray) -> np.ndarray:
    """Patterns in which every camera is as it is nearer to what one pair tells, and that without turns first."""
    cameras = distances.shape[-2]
    # Of a pair that is turned as a whole the pattern is the complement.
    patterns = (distances[0].sum(axis=-3)).argmin(axis=-1).astype(bool).reshape(-1, cameras)
    patterns = np.unique(patterns ^ patterns[:, :1], axis=0)
    return np.concatenate([np.zeros((1, cameras), bool), patterns[patterns.any(axis=1)]])


def _points(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray, turned: np.ndarray) -> np.ndarray:
    return meeting_points(centres, with_turned(directions, turned), with_turned(deviation, turned))


def _told(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray, points: np.ndarray, turned: np.ndarray) -> np.ndarray:
    """Cameras that are much nearer to the points turned as they are than the other way round, shape (n_cameras,)."""
    with np.errstate(invalid="ignore"):
        near, far = (
            np.minimum(passing(points, centres, with_turned(directions, way)) / with_turned(deviation, way), 2 * MEET)
            for way in (turned, ~turned)
        )
    both = np.isfinite(near) & np.isfinite(far) & (MIRRORED != np.arange(len(MIRRORED)))
    chosen, other = (np.where(both, off**2, 0.0).sum(axis=1) for off in (near, far))
    return (both.sum(axis=1) >= LEAST_TOLD) & (chosen < TURN_SHARE * other)
