"""Where people stand who hardly move: upright bodies whose places stir in all views, and what surrounds them does not.

A place on the floor is tried with a body of revolution of several heights. Seen from any camera that is a flat figure which faces the
camera. A standing person's outline sways, so the images stir within the figure (`hmc.camera.stirring`) and not beside it, in every view;
what stirs in one view alone, or is wider or taller than a person, does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.model import Camera, Rig, project

__all__ = ["PROFILE", "Standing", "find_standing", "half_width"]

#: Half width of a standing person over the height above the floor, both in statures.
PROFILE = np.array([[0.0, 0.08], [0.25, 0.07], [0.45, 0.09], [0.55, 0.10], [0.80, 0.115], [0.84, 0.07], [1.0, 0.055]])
#: Statures that are tried, places, and heights and breadths at which a figure is looked at, metres.
STATURES_M = (1.25, 1.4, 1.55, 1.7, 1.85)
STEP_M, ROW_M, COLUMN_M = 0.1, 0.08, 0.05
#: What lies beside a figure: so far from its outline, metres.
BESIDE_M = (0.10, 0.24)
#: Share of a figure, and of what lies beside it, that a view must show to count; views that must count.
SHOWN = 0.3
FEWEST_VIEWS = 3
#: Figures stir by so much more than what is beside them: in the view in which they do so least, and on the mean of that and all views.
LEAST_VIEW, LEAST = 0.1, 0.4
#: Two people are not nearer to each other, metres.
APART_M = 0.4


@dataclass(frozen=True)
class Standing:
    """A place at which a person may stand.

    Attributes
    ----------
    x, y : float
        World, metres.
    stature_m : float
    score : float
        How much more the images stir within the figure than beside it, 0 to 1; 0 of a place that something else tells.
    """

    x: float
    y: float
    stature_m: float
    score: float


def half_width(height: np.ndarray, stature_m: float) -> np.ndarray:
    """Half width of a standing person at heights above the floor, all in metres; 0 above the head."""
    share = np.asarray(height) / stature_m
    return np.where(share <= 1, np.interp(share, *PROFILE.T) * stature_m, 0.0)


def find_standing(rig: Rig, room: np.ndarray, amounts: Sequence[np.ndarray], known: Sequence[np.ndarray], most: int = 8) -> list[Standing]:
    """Places at which a person may stand, best first.

    Parameters
    ----------
    rig : Rig
    room : ndarray, shape (2, 3)
        Two corners, metres.
    amounts, known : sequences of ndarray, shape (height, width)
        What stirs in each view, and where that is known (`hmc.camera.stirring`).
    most : int
        No more places than this.

    Returns
    -------
    list of Standing
    """
    (x0, y0), (x1, y1) = np.asarray(room)[:, :2]
    places = np.stack(np.meshgrid(np.arange(x0, x1, STEP_M), np.arange(y0, y1, STEP_M), indexing="ij"), axis=-1).reshape(-1, 2)
    contrasts = np.stack([_contrasts(camera, places, *view) for camera, *view in zip(rig, amounts, known, strict=True)])
    shown = np.isfinite(contrasts)
    least = np.where(shown, contrasts, np.inf).min(axis=0)
    mean = np.where(shown, contrasts, 0).sum(axis=0) / np.maximum(shown.sum(axis=0), 1)
    score = np.where((shown.sum(axis=0) >= FEWEST_VIEWS) & (least >= LEAST_VIEW), (least + mean) / 2, 0)
    found: list[Standing] = []
    for i, j in np.column_stack(np.unravel_index(np.argsort(-score, axis=None), score.shape)):
        if score[i, j] < LEAST or len(found) == most:
            break
        x, y = map(float, places[i])
        if all(np.hypot(x - one.x, y - one.y) > APART_M for one in found):
            found.append(Standing(x, y, STATURES_M[j], float(score[i, j])))
    return found


def _contrasts(camera: Camera, places: np.ndarray, amount: np.ndarray, known: np.ndarray) -> np.ndarray:
    """How much more figures at places (n, 2) stir than what is beside them in one view, (n, statures); NaN where too little is shown."""
    across = places - camera.centre[:2]
    across = np.column_stack([-across[:, 1], across[:, 0]]) / np.maximum(np.hypot(*across.T), 1e-6)[:, None]
    rows = np.arange(ROW_M / 2, max(STATURES_M) + BESIDE_M[1], ROW_M)
    widest = PROFILE[:, 1].max() * max(STATURES_M) + BESIDE_M[1]
    columns = np.arange(-widest, widest + COLUMN_M, COLUMN_M)
    inside, beside = np.stack([_figure(rows, columns, stature) for stature in STATURES_M], axis=1).reshape(2, len(STATURES_M), -1)
    result = np.full((len(places), len(STATURES_M)), np.nan)
    for first in range(0, len(places), 500):
        part = np.s_[first : first + 500]
        flat = places[part, None] + columns[:, None] * across[part, None]
        points = np.empty((len(flat), len(rows), len(columns), 3))
        points[..., :2], points[..., 2] = flat[:, None], rows[:, None]
        value, told = _sample(camera, points.reshape(-1, 3), amount, known)
        value, told = value.reshape(len(flat), -1), told.reshape(len(flat), -1)
        sums = [(value @ weights.T, told @ weights.T, weights.sum(axis=1)) for weights in (inside, beside)]
        means = [total / np.maximum(count, 1) for total, count, _ in sums]
        shown = np.logical_and.reduce([count >= SHOWN * whole for _, count, whole in sums])
        result[part] = np.where(shown, means[0] - means[1], np.nan)
    return result


def _figure(rows: np.ndarray, columns: np.ndarray, stature_m: float) -> np.ndarray:
    """Which of the points of a flat grid lie within a figure, and which beside it, (2, rows, columns)."""
    half = half_width(rows, stature_m)[:, None]
    near, far = BESIDE_M
    above = rows[:, None] - stature_m
    off = np.where(above <= 0, np.abs(columns) - half, np.hypot(np.maximum(np.abs(columns) - PROFILE[-1, 1] * stature_m, 0), above))
    return np.stack([off <= 0, (off >= near) & (off <= far)]).astype(np.float32)


def _sample(camera: Camera, points: np.ndarray, amount: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of the pixels at points (n, 3), 0 where they are not known, and whether they are, 0 or 1."""
    uv, valid = project(camera, points)
    pixel = np.round(np.where(valid[:, None] & (np.abs(uv) < 1e6), uv, -1)).astype(int)
    seen = np.all((pixel >= 0) & (pixel < camera.size), axis=1)
    u, v = np.where(seen[:, None], pixel, 0).T
    told = np.asarray(seen & known[v, u], np.float32)
    return amount[v, u] * told, told
