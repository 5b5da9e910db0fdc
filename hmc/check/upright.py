"""People in space whatever the calibration's units and axes: which way is up, where the floor is, how tall people come out.

Hulls are bound to no room here. A body is long and thin, mostly upright, and somewhere near the ground; cameras hang above its middle and
are mostly mounted upright. That is enough to find the floor of a calibration of which nothing is known, and to notice that one is not what
its recording says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.optimize import least_squares

from hmc.camera.coverage import point_looked_at
from hmc.camera.model import Rig
from hmc.camera.world import World, in_world
from hmc.check.hull import coarse_grid, fine_hull
from hmc.check.moments import Masks

__all__ = ["Figure", "Ground", "find_figures", "find_ground", "ground_below", "level_share"]

#: Cameras are put so far from the point they look at, on the median; people are looked for so far around it. Of no unit.
DISTANCE, REACH = 3.0, 2.5
#: Parts of a hull are apart from so many of these cells on; a part counts from this share of the largest one's points on, and from so many.
CELL, LEAST_SHARE, LEAST_POINTS = 0.06, 0.25, 300
#: A body is so many times as long as thick, at least, in deviations: 3 to 5 of who stands, below 2 of who sits.
ELONGATED = 2.2
#: Who stands is turned from up by this at most, degrees.
STANDING_DEG = 20.0
#: A stature for weights, metres.
STATURE_M = 1.7
#: Of who stands, lengths and tops count by this quantile: a walker's is below the stature, but an arm may be raised. Shorter ones than this
#: share of it are parts of somebody.
TALL, LEAST_LENGTH = 0.75, 0.75
#: How far feet are from a plane, metres; the mean long axis of standing bodies from upright (a walker leans 2 or 3 degrees), and a camera
#: on a stand from level, radians: others are not level at all, and do not count.
FEET_M, LEAN, MOUNTED = 0.03, np.deg2rad(2.5), np.deg2rad(3.0)
#: Feet that are in one square of so many metres count once: there the same cameras see them, or do not, and hulls err alike.
PLACE_M = 0.3
#: How near a figure or a camera's edge has to be to a direction to vote for it, radians.
VOTE = np.deg2rad(12.0)
#: Share of a hull's points that lie beyond what counts as its lower and upper end.
ENDS = 0.003


@dataclass(frozen=True, eq=False)
class Figure:
    """One person's hull in one moment.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Voxels' centres, in the calibration's coordinates and units.
    axis : ndarray, shape (3,)
        The long axis, of length 1 and either direction.
    elongation : float
        How many times as long as thick it is.
    moment : int
        Which of the moments it is of.
    """

    points: np.ndarray
    axis: np.ndarray
    elongation: float
    moment: int = 0


@dataclass(frozen=True, eq=False)
class Ground:
    """What people say of the world, in the calibration's coordinates and units.

    Parameters
    ----------
    up : ndarray, shape (3,)
        Of length 1.
    up_deg : float
        How far it may be off, degrees (one deviation).
    floor : float
        ``up @ x`` of points on the floor.
    stature : float
        From floor to top, on the median of those who stand.
    middle : ndarray, shape (3,)
        Where people were, on the floor.
    standing : int
        Figures that stand.
    figures : int
        All figures.
    by : tuple of str
        The cameras whose hulls tell floor and stature, where it is not all of them.
    """

    up: np.ndarray
    up_deg: float
    floor: float
    stature: float
    middle: np.ndarray
    standing: int
    figures: int
    by: tuple[str, ...] = ()


def find_figures(rig: Rig, moments: Sequence[Masks]) -> list[Figure]:
    """People's hulls in some moments, whatever the units.

    Parameters
    ----------
    rig : Rig
        Of any units and axes.
    moments : sequence of sequence of ndarray of bool, shape (height, width), or None
        Silhouettes, one a camera.

    Returns
    -------
    list of Figure
        Largest first in each moment; nothing of moments in which silhouettes do not meet.
    """
    target = point_looked_at(rig)
    usual = float(np.median(np.linalg.norm(rig.centres - target, axis=1)))
    free = World(origin=target, scale=DISTANCE / max(usual, 1e-9))
    free_rig = in_world(rig, free)
    grid = coarse_grid(free_rig, np.array([[-REACH] * 3, [REACH] * 3]))
    figures: list[Figure] = []
    for moment, masks in enumerate(moments):
        if sum(mask is not None and mask.any() for mask in masks) >= 3:
            figures += [_figure(free.old_points(part), moment) for part in _parts(fine_hull(free_rig, masks, grid).strict)]
    return figures


def _parts(points: np.ndarray) -> list[np.ndarray]:
    """Points (n, 3) that hang together, the largest part first."""
    if len(points) < LEAST_POINTS:
        return []
    cells = np.floor(points / CELL).astype(int)
    cells -= cells.min(axis=0)
    there = np.zeros(cells.max(axis=0) + 1, bool)
    there[tuple(cells.T)] = True
    labels = ndimage.label(there, np.ones((3, 3, 3)))[0][tuple(cells.T)]
    counts = np.bincount(labels)
    order = np.argsort(-counts, kind="stable")
    return [points[labels == k] for k in order if counts[k] >= max(LEAST_POINTS, LEAST_SHARE * counts.max())]


def _figure(points: np.ndarray, moment: int) -> Figure:
    values, vectors = np.linalg.eigh(np.cov(points.T))
    return Figure(points, vectors[:, 2], float(np.sqrt(values[2] / max(values[1], 1e-12))), moment)


def find_ground(rig: Rig, figures: Sequence[Figure]) -> Ground | None:
    """Up, the floor and a stature, as people's hulls and the cameras' mounting have them.

    Up is first the direction that most long figures and most level cameras share, and then the normal of the plane in which feet are, with
    which the long axis of who stands and level cameras agree. Where people stay in one place, or walk on a line, feet tell nothing of the
    tilt across it and the others decide.

    Parameters
    ----------
    rig : Rig
        Of any units and axes.
    figures : sequence of Figure

    Returns
    -------
    Ground or None
        None where nobody stands.
    """
    up = _first_up(rig, figures)
    standing = _standing(figures, up)
    if not standing:
        return None
    if _looks_down(rig, standing, up):
        up = -up
    up, tilt = _plane(rig, standing, up)
    return _ground(standing, up, float(np.rad2deg(tilt)), len(figures))


def ground_below(figures: Sequence[Figure], ground: Ground, by: tuple[str, ...]) -> Ground | None:
    """Floor and stature by other hulls, with the same up.

    Parameters
    ----------
    figures : sequence of Figure
    ground : Ground
    by : tuple of str
        The cameras that these hulls are of.

    Returns
    -------
    Ground or None
        None where none of these stands.
    """
    standing = _standing(figures, ground.up)
    return replace(_ground(standing, ground.up, ground.up_deg, len(figures)), by=by) if standing else None


def _standing(figures: Sequence[Figure], up: np.ndarray) -> list[Figure]:
    """Who stands along `up`, either way, and is as long as others who do: what is far shorter is a part of somebody."""
    close = np.cos(np.deg2rad(STANDING_DEG))
    standing = [one for one in figures if one.elongation >= ELONGATED and abs(one.axis @ up) > close]
    lengths = [np.ptp(one.points @ up) for one in standing]
    return [one for one, length in zip(standing, lengths, strict=True) if length > LEAST_LENGTH * np.quantile(lengths, TALL)]


def _ground(standing: Sequence[Figure], up: np.ndarray, up_deg: float, n_figures: int) -> Ground:
    metre = float(np.median([np.ptp(one.points @ up) for one in standing])) / STATURE_M
    floors = [_feet(one.points @ up, metre) for one in standing]
    floor = float(np.median(floors))
    tops = [np.quantile(one.points @ up, 1 - ENDS) for one in standing]
    middle = np.median([one.points.mean(axis=0) for one in standing], axis=0)
    middle = middle + (floor - middle @ up) * up
    return Ground(up, up_deg, floor, float(np.quantile(tops, TALL)) - floor, middle, len(standing), n_figures)


def _first_up(rig: Rig, figures: Sequence[Figure]) -> np.ndarray:
    """The direction, either way, that most long figures point to and across which most cameras have an edge of their image."""
    directions = _half_sphere()
    votes = np.zeros(len(directions))
    for one in figures:
        off = np.arccos(np.clip(np.abs(directions @ one.axis), 0, 1))
        votes += np.exp(-((off / VOTE) ** 2)) * max(0.0, one.elongation - 1) / max(1, len(figures))
    votes += level_share(rig, directions)
    return directions[int(votes.argmax())]


def level_share(rig: Rig, up: np.ndarray) -> np.ndarray:
    """How many of the cameras are level if `up` is up: have an edge of their image across it; directions (..., 3) to shares (...)."""
    edges = np.array([camera.rotation[:2] for camera in rig])
    off = np.arcsin(np.clip(np.abs(np.einsum("...i,cei->...ce", up, edges)), 0, 1)).min(axis=-1)
    return np.exp(-((off / VOTE) ** 2)).mean(axis=-1)


def _half_sphere(n: int = 4000) -> np.ndarray:
    """Directions that are evenly spread, either way, (n, 3): a spiral (Fibonacci's)."""
    k = np.arange(n) + 0.5
    z, angle = 1 - k / n, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z**2)
    return np.column_stack([across * np.cos(angle), across * np.sin(angle), z])


def _looks_down(rig: Rig, standing: Sequence[Figure], up: np.ndarray) -> bool:
    """Whether `up` is down: cameras hang above people's middle, and most are mounted upright."""
    middle = np.mean([one.points.mean(axis=0) for one in standing], axis=0)
    length = np.median([np.ptp(one.points @ up) for one in standing])
    above = np.tanh((rig.centres - middle) @ up / (0.3 * length)).mean()
    upright = -np.array([camera.rotation[1] for camera in rig]) @ up
    return bool(2 * above + upright.mean() < 0)


def _plane(rig: Rig, standing: Sequence[Figure], up: np.ndarray) -> tuple[np.ndarray, float]:
    """Up as the normal of the floor, and by how much it may be off, radians."""
    across = np.linalg.svd(up[None])[2][1:]
    axes = np.array([one.axis * np.sign(one.axis @ up) for one in standing])
    mean = axes.mean(axis=0)
    lean = across @ mean / (up @ mean)
    metre = float(np.median([np.ptp(one.points @ up) for one in standing])) / STATURE_M
    feet = []
    for one in standing:
        height = one.points @ up
        low = _feet(height, metre)
        feet.append([*(across @ one.points[height < low + 0.05 * metre].mean(axis=0)), low])
    x = np.array(feet)
    x = _by_place((x - x.mean(axis=0)) / metre)
    edges = np.array([min(camera.rotation[:2], key=lambda edge: abs(edge @ up)) for camera in rig])
    level, turn = edges @ up, edges @ across.T

    def residuals(plane: np.ndarray) -> np.ndarray:
        tilt = plane[:2]  # up is `up + tilt @ across`
        return np.concatenate([(x[:, 2] + x[:, :2] @ tilt - plane[2]) / FEET_M, (tilt - lean) / LEAN, (level + turn @ tilt) / MOUNTED])

    fit = least_squares(residuals, np.zeros(3), loss="cauchy", f_scale=1.5)
    normal = up + fit.x[:2] @ across
    doubt = np.linalg.inv(fit.jac.T @ fit.jac)[:2, :2]
    return normal / np.linalg.norm(normal), float(np.sqrt(np.linalg.eigvalsh(doubt)[-1]))


def _by_place(feet: np.ndarray) -> np.ndarray:
    """The median of feet, (n, 3), of each square of `PLACE_M` in the first two axes."""
    squares, place = np.unique(np.floor(feet[:, :2] / PLACE_M), axis=0, return_inverse=True)
    return np.array([np.median(feet[place.ravel() == k], axis=0) for k in range(len(squares))])


def _feet(height: np.ndarray, metre: float) -> float:
    """How high feet stand, of a figure's points' heights: where its cross-section, from below, is half of the largest one of the feet.

    A hull reaches below the floor, where it narrows quickly (`hmc.check.hull.floor_height`).
    """
    edges = np.quantile(height, ENDS) + metre * np.arange(-0.05, 0.3, 0.01)
    area = np.convolve(np.histogram(height, edges)[0], np.full(5, 0.2), "same")
    return float(edges[np.argmax(area >= area.max() / 2)])
