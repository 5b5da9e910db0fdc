"""Skeleton curves: a one-dimensional eigenmap of each part gives site values, and a smoothing spline through the part's voxels the curve.

Source: Hsiao (2008), section 3.1.5 and Eq. 3-16. Sundaresan's curves, from the site values of the branches, are the baseline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from hmc.pose.spectral.eigenmap import eigenmap
from hmc.pose.spectral.growing import Branch
from hmc.pose.spectral.parts import PART_NAMES
from hmc.pose.spectral.segmentation import Segmentation

__all__ = ["SkeletonSettings", "baseline_skeletons", "curve_through", "equally_spaced", "extract_skeletons", "site_values"]


#: Of the eigenvectors that site values come from: these only say where to draw a smooth curve.
SITE_TOLERANCE = 1e-4


@dataclass(frozen=True)
class SkeletonSettings:
    """How curves are drawn.

    Parameters
    ----------
    nodes : int
        Of each curve, equally spaced.
    knots : int
        Inner knots of the spline.
    trunk_trim : float
        Share of the trunk's site values left out at either end, where they run off into a shoulder or a hip.
    trunk_along_axis : bool
        Whether the trunk's site values are of the eigenvector that goes from the legs to the head; else of the first, as in the thesis.
    least_voxels : int
        Smaller parts have no curve.
    """

    nodes: int = 16
    knots: int = 3
    trunk_trim: float = 0.12
    trunk_along_axis: bool = True
    least_voxels: int = 12


def site_values(edges: np.ndarray, n: int, along: np.ndarray | None = None) -> np.ndarray:
    """Where along its part each voxel is, from 0 at one end to 1 at the other.

    The first eigenvector of a chain is a half wave of a cosine, so its arc cosine goes evenly along the chain (exactly so for a path).

    Parameters
    ----------
    edges : ndarray of int, shape (m, 2)
        Of the part's graph.
    n : int
        Voxels of the part.
    along : ndarray, shape (n,), optional
        About how far along the part each voxel is. Of the first three eigenvectors, the one that goes with it is taken: of a stout part
        with bits of others at it, the first one may run across.

    Returns
    -------
    ndarray, shape (n,)
        NaN for voxels that are not joined to the largest piece.
    """
    a, b = edges.T
    graph = csr_array((np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n))
    pieces = connected_components(graph, directed=False)[1]
    body = np.flatnonzero(pieces == np.bincount(pieces).argmax())
    sites = np.full(n, np.nan)
    if len(body) < 3:
        return sites
    waves = eigenmap(csr_array(graph[body][:, body]), 1 if along is None else 3, SITE_TOLERANCE).vectors
    wave = waves[:, 0]
    if along is not None:
        rising = (along[body] - along[body].mean()) @ (waves - waves.mean(0)) / np.maximum(waves.std(0), 1e-300)
        wave = waves[:, int(np.abs(rising).argmax())]
    ends = np.where(wave > 0, wave / max(wave.max(), 1e-300), wave / max(-wave.min(), 1e-300))
    sites[body] = np.arccos(np.clip(ends, -1, 1)) / np.pi
    return sites


def curve_through(points: np.ndarray, sites: np.ndarray, settings: SkeletonSettings | None = None) -> np.ndarray:
    """The cubic spline h that minimises the sum of squared distances from points to h(site) (Eq. 3-16), as equally spaced nodes.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Metres.
    sites : ndarray, shape (n,)
    settings : SkeletonSettings, optional

    Returns
    -------
    ndarray, shape (nodes, 3)
        In the order of rising site values.
    """
    from scipy.interpolate import BSpline

    settings = settings or SkeletonSettings()
    order = np.argsort(sites, kind="stable")
    s, x = sites[order], points[order]
    low, high = s[0], max(s[-1], s[0] + 1e-9)
    # Knots at quantiles, fewer where there are few different sites: each piece of the spline must have data.
    distinct = len(np.unique(s))
    knots = int(np.clip(distinct // 4 - 1, 0, settings.knots))
    if distinct < 5:
        curve = np.linspace(0, 1, 32)[:, None] * (x[-1] - x[0]) + x[0]
    else:
        inner = np.quantile(s, np.linspace(0, 1, knots + 2)[1:-1])
        inner = np.unique(inner[(inner > low) & (inner < high)])
        corners = np.concatenate([[low] * 4, inner, [high] * 4])
        rows = BSpline.design_matrix(s, corners, 3).toarray()
        coefficients = np.linalg.lstsq(rows, x, rcond=None)[0]
        curve = BSpline(corners, coefficients, 3)(np.linspace(low, high, 64))
    return equally_spaced(curve, settings.nodes)


def equally_spaced(curve: np.ndarray, n: int, first: float = 0.0, last: float | None = None) -> np.ndarray:
    """Equally spaced points on a polyline.

    Parameters
    ----------
    curve : ndarray, shape (m, 3)
    n : int
    first, last : float
        Where the points begin and end along the polyline, metres; by default at its ends.

    Returns
    -------
    ndarray, shape (n, 3)
    """
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    at = np.linspace(first, way[-1] if last is None else last, n)
    return np.stack([np.interp(at, way, curve[:, axis]) for axis in range(3)], axis=1)


def extract_skeletons(segmentation: Segmentation, points: np.ndarray, settings: SkeletonSettings | None = None) -> dict[str, np.ndarray]:
    """The curve of every part that was found.

    Parameters
    ----------
    segmentation : Segmentation
    points : ndarray, shape (n, 3)
        Centres of the voxels, metres.
    settings : SkeletonSettings, optional

    Returns
    -------
    dict of str to ndarray, shape (nodes, 3)
        By part; what is no part by its shape and place is ``other_1`` and so on. Of limbs and head, the end at the trunk comes first; of
        the trunk, the lower end.
    """
    settings = settings or SkeletonSettings()
    curves: dict[str, np.ndarray] = {}
    share = settings.trunk_trim / max(1 - 2 * settings.trunk_trim, 1e-9)
    straight = replace(settings, knots=0)
    axis = _trunk_axis(segmentation) if settings.trunk_along_axis else None
    trunk = segmentation.voxels_of("trunk")
    middle = points[trunk].mean(0) if len(trunk) else points.mean(0)
    parts = {part: np.flatnonzero(segmentation.labels == label) for label, part in enumerate(PART_NAMES)}
    parts |= {f"other_{k + 1}": rows for k, rows in enumerate(segmentation.others)}
    for part, rows in parts.items():
        if len(rows) < settings.least_voxels:
            continue
        own = np.zeros(len(points), bool)
        own[rows] = True
        rows, number = np.flatnonzero(own), np.cumsum(own) - 1
        inner = number[segmentation.edges[own[segmentation.edges].all(1)]]
        sites = site_values(inner, len(rows), points[rows] @ axis if part == "trunk" and axis is not None else None)
        known = np.isfinite(sites)
        if part == "trunk":
            known &= (sites > settings.trunk_trim) & (sites < 1 - settings.trunk_trim)
        if np.count_nonzero(known) >= settings.least_voxels:
            curves[part] = curve_through(points[rows[known]], sites[known], straight if part in ("trunk", "head") else settings)
    if "trunk" in curves:
        # The ends that were left out go straight on.
        trunk_curve = curves["trunk"]
        reach = share * np.linalg.norm(np.diff(trunk_curve, axis=0), axis=1).sum()
        ends = [a + reach * (a - b) / max(float(np.linalg.norm(a - b)), 1e-9) for a, b in (trunk_curve[[0, 3]], trunk_curve[[-1, -4]])]
        curves["trunk"] = equally_spaced(np.vstack([ends[0], trunk_curve, ends[1]]), settings.nodes)
    for part, curve in curves.items():
        start = _lower_end(curve, segmentation) if part == "trunk" else middle
        if np.linalg.norm(curve[0] - start) > np.linalg.norm(curve[-1] - start):
            curves[part] = curve[::-1]
    return curves


def _trunk_axis(segmentation: Segmentation) -> np.ndarray | None:
    """From between the legs to the head, unit length; None where one of them is missing."""
    legs = [segmentation.shapes[part].base for part in ("leg_1", "leg_2") if part in segmentation.shapes]
    if len(legs) < 2 or "head" not in segmentation.shapes:
        return None
    axis = segmentation.shapes["head"].base - np.mean(legs, axis=0)
    return axis / max(float(np.linalg.norm(axis)), 1e-9)


def _lower_end(trunk: np.ndarray, segmentation: Segmentation) -> np.ndarray:
    """About where the trunk's lower end is: at the legs, or away from the head, or down."""
    ends = trunk[[0, -1]]
    legs = [segmentation.shapes[part].base for part in ("leg_1", "leg_2") if part in segmentation.shapes]
    if legs:
        return np.mean(legs, axis=0)
    if "head" in segmentation.shapes:
        return ends[np.argmax(np.linalg.norm(ends - segmentation.shapes["head"].base, axis=1))]
    return ends[np.argmin(ends[:, 2])]


def baseline_skeletons(
    branches: Mapping[str, Branch], points: np.ndarray, settings: SkeletonSettings | None = None
) -> dict[str, np.ndarray]:
    """Sundaresan's curves, by the site values of the branches in the six-dimensional eigenspace (section 3.1.5.1)."""
    return {part: curve_through(points[b.nodes], b.sites, settings)[::-1] for part, b in branches.items()}
