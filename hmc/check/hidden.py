"""Whether people reach further down in some images than their hulls do: what hides legs from other cameras makes hulls end too high.

Where three cameras or more see the legs, hulls of these alone reach the floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.camera.model import Camera, Rig, project
from hmc.check.moments import Masks
from hmc.check.upright import ELONGATED, STANDING_DEG, Figure, Ground, find_figures, ground_below

__all__ = ["find_legs", "hidden_below", "shown_below"]

#: Silhouettes that reach below the hull by this share of it, in so many cameras, show what others do not.
LEAST_BELOW, LEAST_CAMERAS = 0.15, 2
#: Share of points and pixels beyond what counts as an end.
ENDS = 0.01


def shown_below(rig: Rig, figures: Sequence[Figure], moments: Sequence[Masks], up: np.ndarray) -> np.ndarray:
    """By how much of a hull's length a camera's silhouettes reach below it.

    Parameters
    ----------
    rig : Rig
    figures : sequence of Figure
        As from `hmc.check.upright.find_figures` with these moments.
    moments : sequence (moments) of sequence (cameras) of ndarray of bool, shape (h, w), or None
    up : ndarray, shape (3,)
        In the calibration's coordinates.

    Returns
    -------
    ndarray, shape (n_cameras,)
        The median over who stands and is alone in a moment; NaN where there is none.
    """
    alone = [one for one in figures if sum(other.moment == one.moment for other in figures) == 1]
    standing = [one for one in alone if one.elongation >= ELONGATED and abs(one.axis @ up) > np.cos(np.deg2rad(STANDING_DEG))]
    below = np.full((len(rig), max(1, len(standing))), np.nan)
    for k, one in enumerate(standing):
        for c, (camera, mask) in enumerate(zip(rig, moments[one.moment], strict=True)):
            if mask is not None and mask.any():
                below[c, k] = _below(camera, one.points, mask, up)
    known = np.isfinite(below).any(axis=1)
    result = np.full(len(rig), np.nan)
    result[known] = np.nanmedian(below[known], axis=1)
    return result


def _below(camera: Camera, points: np.ndarray, mask: np.ndarray, up: np.ndarray) -> float:
    middle = points.mean(axis=0)
    length = np.ptp(points @ up)
    (head, feet), valid = project(camera, np.stack([middle + 0.3 * length * up, middle - 0.3 * length * up]))
    uv, seen = project(camera, points[:: max(1, len(points) // 2000)])
    width, height = camera.size
    inside = seen & (uv >= 0).all(axis=1) & (uv < (width, height)).all(axis=1)
    if not valid.all() or np.linalg.norm(feet - head) < 1 or inside.mean() < 1 - ENDS:
        return float("nan")
    down = (feet - head) / np.linalg.norm(feet - head)
    across = np.array([-down[1], down[0]])
    low, high = np.quantile(uv @ across, (ENDS, 1 - ENDS))
    top, bottom = np.quantile(uv @ down, (ENDS, 1 - ENDS))
    pixels = np.argwhere(mask)[:, ::-1]
    own = pixels[(pixels @ across >= low) & (pixels @ across <= high)]
    return float((np.quantile(own @ down, 1 - ENDS) - bottom) / max(bottom - top, 1)) if len(own) else float("nan")


def hidden_below(rig: Rig, figures: Sequence[Figure], moments: Sequence[Masks], up: np.ndarray) -> tuple[str, ...]:
    """The cameras that show people further down than their hulls reach; none where fewer than two do. Parameters as `shown_below`."""
    below = shown_below(rig, figures, moments, up)
    names = tuple(camera.name for camera, share in zip(rig, below, strict=True) if share >= LEAST_BELOW)
    return names if len(names) >= LEAST_CAMERAS else ()


def find_legs(
    rig: Rig, figures: Sequence[Figure], moments: Sequence[Masks], ground: Ground | None
) -> tuple[Sequence[Figure], Ground | None, tuple[str, ...]]:
    """Floor and stature by the cameras that see the legs, where furniture hides them from others.

    Parameters
    ----------
    rig : Rig
    figures : sequence of Figure
    moments : sequence (moments) of sequence (cameras) of ndarray of bool, shape (h, w), or None
    ground : Ground or None
        By all cameras; None where nobody stands.

    Returns
    -------
    figures : sequence of Figure
    ground : Ground or None
        By fewer cameras, or as they were given.
    hidden : tuple of str
        Cameras that still show people further down than hulls reach: then floor and stature are those of what is seen of people.
    """
    by = () if ground is None else hidden_below(rig, figures, moments, ground.up)
    if ground is None or not by:
        return figures, ground, ()
    fewer = [[mask if camera.name in by else None for camera, mask in zip(rig, frame, strict=True)] for frame in moments]
    lower = find_figures(rig, fewer)  # none of fewer than three cameras
    found = ground_below(lower, ground, by)
    if found is None or hidden_below(rig, lower, moments, ground.up):
        return figures, ground, by
    return lower, found, ()
