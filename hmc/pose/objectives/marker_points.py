"""Points of the world from detections in several views."""

from __future__ import annotations

import numpy as np

from hmc.camera.epipolar import symmetric_epipolar_distance
from hmc.camera.triangulation import triangulate
from hmc.pose.views.markers import SeenMarkers

__all__ = ["find_points", "least_views", "matched_points"]

#: How far a detection may lie from the image of a point that it supports, pixels.
SUPPORT_PX = 6.0


def least_views(seen: SeenMarkers) -> int:
    """How many views must agree on a point: three, as two agree by chance; two, where no more have detections."""
    return min(3, max(2, sum(len(one) > 0 for one in seen.detections)))


def matched_points(seen: SeenMarkers, points: np.ndarray, gate_px: float) -> np.ndarray:
    """Where markers were seen that should be at given points: the nearest detections, without those that disagree with the rest.

    Parameters
    ----------
    seen : SeenMarkers
    points : ndarray, shape (m, 3)
        World, metres.
    gate_px : float
        Farther than this a detection is not the marker's.

    Returns
    -------
    ndarray, shape (m, 3)
        World, metres; NaN where fewer than `least_views` agree.
    """
    projections = seen.views.projections
    least = least_views(seen)
    uv = np.full((len(points), len(projections), 2), np.nan)
    image = np.einsum("vij,mj->mvi", projections, np.column_stack([points, np.ones(len(points))]))
    expected = image[..., :2] / np.where(image[..., 2:] > 0.05, image[..., 2:], np.nan)
    for view, detections in enumerate(seen.detections):
        if not len(detections):
            continue
        apart = np.linalg.norm(expected[:, view, None] - detections, axis=-1)
        apart = np.where(np.isnan(apart), np.inf, apart)
        nearest = apart.argmin(axis=1)
        near = apart[np.arange(len(points)), nearest] <= gate_px
        uv[near, view] = detections[nearest[near]]
    # The view that disagrees most with the point of all is left out, as long as one does.
    while True:
        uv[np.isfinite(uv).all(axis=-1).sum(axis=1) < least] = np.nan
        places = triangulate(projections, uv)
        off = _image_errors(projections, places, uv)
        wrong = off.max(axis=1) > SUPPORT_PX
        if not wrong.any():
            return places
        uv[wrong, off.argmax(axis=1)[wrong]] = np.nan


def _image_errors(projections: np.ndarray, points: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Distances of the images of points from where they were seen, (m, n_views), pixels; 0 where they were not."""
    image = np.einsum("vij,mj->mvi", projections, np.column_stack([points, np.ones(len(points))]))
    off = np.linalg.norm(image[..., :2] / image[..., 2:] - uv, axis=-1)
    return np.where(np.isnan(off), 0.0, off)


def find_points(seen: SeenMarkers, room: np.ndarray | None = None, most: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Points that several views agree on, without knowing what they are.

    Every two detections that lie on each other's epipolar lines make a point; the one with the most detections near its images is taken,
    its detections are used up, and so on.

    Parameters
    ----------
    seen : SeenMarkers
    room : ndarray, shape (2, 3), optional
        Points outside are left out, metres.
    most : int
        No more than this many.

    Returns
    -------
    points : ndarray, shape (n, 3)
        World, metres; `least_views` agree on each.
    views : ndarray of int, shape (n,)
        How many agree: among many false detections, few do so by chance.
    """
    projections, detections = seen.views.projections, seen.detections
    rows = []
    for i in range(len(detections)):
        for j in range(i + 1, len(detections)):
            apart = symmetric_epipolar_distance(seen.views.fundamentals[i, j], detections[i][:, None], detections[j][None])
            first, second = np.nonzero(apart <= 2 * SUPPORT_PX)
            uv = np.full((len(first), len(detections), 2), np.nan)
            uv[:, i], uv[:, j] = detections[i][first], detections[j][second]
            rows.append(triangulate(projections, uv))
    points = np.concatenate([np.zeros((0, 3)), *rows])
    if room is not None:
        points = points[((points >= room[0]) & (points <= room[1])).all(axis=1)]
    if not len(points):
        return points, np.zeros(0, int)
    image = np.einsum("vij,mj->mvi", projections, np.column_stack([points, np.ones(len(points))]))
    expected = image[..., :2] / np.where(image[..., 2:] > 0.05, image[..., 2:], np.nan)
    distance = [np.linalg.norm(expected[:, v, None] - detections[v], axis=-1) for v in range(len(detections))]
    free = [np.ones(len(one), bool) for one in detections]
    found: list[np.ndarray] = []
    views: list[int] = []
    while len(found) < most:
        least = np.stack([np.where(free[v], distance[v], np.inf).min(axis=1, initial=np.inf) for v in range(len(detections))], axis=1)
        least = np.where(np.isnan(least), np.inf, least)
        support = least <= SUPPORT_PX
        # More views first; of equally many, the better agreement.
        worth = support.sum(axis=1) - np.where(support, least, 0).sum(axis=1) / (SUPPORT_PX * len(detections) + 1)
        best = int(worth.argmax())
        if support[best].sum() < least_views(seen):
            break
        uv = np.full((len(detections), 2), np.nan)
        for v in np.flatnonzero(support[best]):
            k = int(np.where(free[v], distance[v][best], np.inf).argmin())
            uv[v], free[v][k] = detections[v][k], False
        found.append(triangulate(projections, uv))
        views.append(int(support[best].sum()))
    return np.array(found).reshape(-1, 3), np.array(views, int)
