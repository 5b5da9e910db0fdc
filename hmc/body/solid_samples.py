"""Points of the body's surface for the surface match: spread evenly over its area, drawn anew whenever asked. Kehl (2006), section 5.2."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.contours import Strips
from hmc.body.kinematics import segment_transforms
from hmc.body.model import neutral_state
from hmc.body.solids import GROUPS, SolidBody, to_world
from hmc.body.superellipsoids import inside_outside, points_at

__all__ = ["BANDS", "SECTORS", "SampledBody", "SurfaceGrid", "draw_samples", "surface_grid"]

#: A patch, which has one color, is one of so many bands of a solid by so many sectors around it.
BANDS, SECTORS = 3, 4
#: Cells of the lattice by which areas are measured.
_ETAS, _OMEGAS = 48, 48
#: Points nearer to another solid than this (inside-outside function) are hard to track, as in the armpits.
_NEAR = 1.35


@dataclass(frozen=True)
class SurfaceGrid:
    """Candidates for samples.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Segment's frame, metres.
    solid, segment, group, patch : ndarray of int, shape (n,)
        Sorted by group.
    starts : ndarray of int, shape (7,)
        Where each group's points begin.
    n_patches : int
    """

    points: np.ndarray
    solid: np.ndarray
    segment: np.ndarray
    group: np.ndarray
    patch: np.ndarray
    starts: np.ndarray
    n_patches: int


@dataclass(frozen=True)
class SampledBody:
    """A solid body and what is laid on it once, for samples to be drawn from.

    Parameters
    ----------
    body : SolidBody
    grid : SurfaceGrid
        Points of its surface.
    strips : Strips
        Around its limbs, where contours are looked for.
    """

    body: SolidBody
    grid: SurfaceGrid
    strips: Strips


def surface_grid(body: SolidBody, per_group: int = 400) -> SurfaceGrid:
    """Spread candidates over every group of solids, the same number on every bit of its area.

    Those within or close to another solid, in the neutral pose, are left out.

    Parameters
    ----------
    body : SolidBody
    per_group : int
        About how many a group.

    Returns
    -------
    SurfaceGrid
    """
    n = len(body.solids)
    edges_eta, edges_omega = np.linspace(-np.pi / 2, np.pi / 2, _ETAS + 1), np.linspace(-np.pi, np.pi, _OMEGAS + 1)
    index = np.arange(n)[:, None, None]
    corners = points_at(body.solids, *np.broadcast_arrays(index, edges_eta[:, None], edges_omega))
    area = np.zeros((n, _ETAS, _OMEGAS))
    for first, second in (((0, 1), (1, 0)), ((1, 0), (0, 1))):
        a, b = (corners[:, i : _ETAS + i, j : _OMEGAS + j] for i, j in (first, second))
        apex = corners[:, :-1, :-1] if first == (0, 1) else corners[:, 1:, 1:]
        area += 0.5 * np.linalg.norm(np.cross(a - apex, b - apex), axis=-1)
    group_area = np.bincount(body.group, area.sum((1, 2)), len(GROUPS))
    counts = np.round(per_group * area.sum((1, 2)) / group_area[body.group]).astype(int)
    solid, eta, omega = [], [], []
    for k in range(n):
        # Along the strips of latitude, one point to every equal share of the area.
        summed = np.cumsum(area[k].ravel())
        place = np.searchsorted(summed, (np.arange(counts[k]) + 0.5) / counts[k] * summed[-1])
        row, column = np.unravel_index(place, (_ETAS, _OMEGAS))
        fraction = (np.arange(counts[k]) * (np.sqrt(5) - 1) / 2) % 1
        solid.append(np.full(counts[k], k))
        eta.append(edges_eta[row] + fraction * (edges_eta[1] - edges_eta[0]))
        omega.append(edges_omega[column] + 0.5 * (edges_omega[1] - edges_omega[0]))
    which, latitude, longitude = np.concatenate(solid), np.concatenate(eta), np.concatenate(omega)
    local = points_at(body.solids, which, latitude, longitude)
    points = (body.axes[which] @ local[..., None])[..., 0] + body.origin[which]
    keep = ~_crowded(body, which, points)
    along = (local[:, 2] + body.solids.along[which, 0]) / body.solids.along[which].sum(axis=1)
    band = np.minimum((along * BANDS).astype(int), BANDS - 1)
    sector = ((longitude + np.pi) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
    patch = (which * BANDS + band) * SECTORS + sector
    which, points, patch = which[keep], points[keep], patch[keep]
    order = np.argsort(body.group[which], kind="stable")
    which, points, patch = which[order], points[order], patch[order]
    starts = np.searchsorted(body.group[which], np.arange(len(GROUPS) + 1))
    return SurfaceGrid(points, which, body.segment[which], body.group[which], patch, starts, n * BANDS * SECTORS)


def draw_samples(rng: np.random.Generator, grid: SurfaceGrid, counts: tuple[int, ...]) -> np.ndarray:
    """Random candidates, so many of each group, none twice.

    Parameters
    ----------
    rng : numpy.random.Generator
    grid : SurfaceGrid
    counts : tuple of int, one a group

    Returns
    -------
    ndarray of int
        Rows of the grid, sorted by group; all of a group where there are no more.
    """
    chosen = []
    for first, last, count in zip(grid.starts[:-1], grid.starts[1:], counts, strict=True):
        chosen.append(first + rng.permutation(last - first)[:count])
    return np.concatenate(chosen)


def _crowded(body: SolidBody, which: np.ndarray, points: np.ndarray) -> np.ndarray:
    rotations, positions = segment_transforms(body.skeleton, neutral_state("sideways", body.skeleton.limits))
    turns, centres = to_world(body, rotations, positions)
    world = (rotations[body.segment[which]] @ points[..., None])[..., 0] + positions[body.segment[which]]
    crowded = np.zeros(len(which), bool)
    for other in range(len(body.solids)):
        local = (world - centres[other]) @ turns[other]
        # Solids of one trunk, or of one chain, meet by design: there only what lies inside is left out.
        bound = np.where(body.group[which] == body.group[other], 1.0, _NEAR)
        crowded |= (which != other) & (inside_outside(body.solids, np.full(len(which), other), local) < bound)
    return crowded
