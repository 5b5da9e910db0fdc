"""Which cameras' silhouettes of one frame do not fit the others': those without which all others see the same bodies.

Every voxel of a coarse hull is missed by some cameras. Counted by which ones, the voxels tell what each hull without some cameras would
hold, and how much of it each camera misses, without carving anew: a camera that is out of place takes away nearly all that the others
agree on, and misses that alone. One before which furniture hides people misses much too, but what it does show the others see as well; so
a camera does not fit only where much of its own silhouette lies beside the others' hull besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from hmc.camera.model import Rig
from hmc.voxels.agreement import hull_view
from hmc.voxels.carving import CarvingTables, carve_levels, make_tables, pixels_at
from hmc.voxels.grid import VoxelGrid, voxels_of

__all__ = ["LEAST_LEFT", "Fit", "fit_of_cameras", "fitting_tables", "missed_share"]

#: Side of a voxel, metres, and the most of them: in a hall they are larger.
VOXEL_M, MOST_VOXELS = 0.08, 3e5
#: Cameras that must be left for others to be judged by them, and how many may be left out at once.
LEAST_LEFT, MOST_OUT = 4, 2
#: Cameras that must show a person at a voxel.
LEAST_HITS = 3
#: People are there from this volume on, cubic metres.
LEAST_M3 = 0.02
#: A camera is judged by the hull of the others where it sees at least this share of it. It fits where it misses no more than this much, or
#: than so many times as much as is usual among those that fit ...
SEEN, MISSED, USUAL = 0.5, 0.25, 3.0
#: ... or where no more of its silhouette lies beside that hull. Of seven cameras around one person a good one misses .02 to .12, of five
#: around three people up to .38 while all miss .16; one that is late by ten frames .65 to .84, with .36 to .7 of its silhouette beside
#: (measured).
BESIDE = 0.2
#: Cameras that do not fit but agree with each other leave a hull of which they miss little, but which is this many times smaller than
#: without them.
GROWTH = 2.5
#: Bits of a whole number that tell who shows a voxel and who misses it.
CODE_BITS = 62


@dataclass(frozen=True)
class Fit:
    """How the cameras fit each other in one frame.

    Attributes
    ----------
    missed, beside : ndarray, shape (n_cameras,)
        The share of the fitting cameras' hull that each does not show, and of its own silhouette what lies beside that hull; NaN where that
        cannot be told (`beside` is told of those that miss much alone).
    misfit : ndarray of bool, shape (n_cameras,)
        Those that do not fit.
    """

    missed: np.ndarray
    beside: np.ndarray
    misfit: np.ndarray


def fitting_tables(room: np.ndarray, rig: Rig) -> CarvingTables:
    """Coarse voxels of a room, (2, 3) metres, and where they fall in the images."""
    voxel_m = max(VOXEL_M, float(np.prod(room[1] - room[0]) / MOST_VOXELS) ** (1 / 3))
    return make_tables(VoxelGrid.from_room(room, voxel_m, len(rig)), rig)


def fit_of_cameras(tables: CarvingTables, masks: Sequence[np.ndarray | None]) -> Fit | None:
    """How the cameras of one frame fit each other.

    Parameters
    ----------
    tables : CarvingTables
        As from `fitting_tables`.
    masks : sequence of ndarray of bool, shape (h, w), or None; one a camera

    Returns
    -------
    Fit or None
        None where nothing can be told: too few cameras, nobody there, or no few cameras without which all others agree.
    """
    there = [c for c, mask in enumerate(masks) if mask is not None]
    most = min(MOST_OUT, len(there) - LEAST_LEFT)
    if most < 1:
        return None
    voxels = voxels_of(carve_levels(tables, masks, (most,))[0])
    if not len(voxels):
        return None
    votes = _votes(masks, pixels_at(tables, voxels))
    patterns = _counted(votes)
    least = LEAST_M3 / tables.grid.voxel_size_m**3
    volumes = [{out: _volume(patterns, [c for c in there if c not in out]) for out in combinations(there, k)} for k in range(most + 1)]
    largest = [max(one.values()) for one in volumes]
    for k, one in enumerate(volumes):
        out = max(one, key=one.__getitem__)
        kept = [c for c in there if c not in out]
        shares = np.array([_missed(patterns, kept, c, least) for c in kept])
        known = ~np.isnan(shares)
        grown = max(largest[k:])
        if known.sum() >= LEAST_LEFT and (shares[known] <= _most(shares[known])).all() and grown <= GROWTH * largest[k]:
            return _fit(tables, masks, (voxels, votes), patterns, kept, least)
    return None


def missed_share(tables: CarvingTables, masks: Sequence[np.ndarray | None], camera: int, others: Sequence[int]) -> float:
    """The share of the others' hull that a camera does not show, of what it sees of it; NaN where there is too little.

    Parameters
    ----------
    tables : CarvingTables
    masks : sequence of ndarray of bool, shape (h, w), or None; one a camera
    camera : int
    others : sequence of int
        The cameras to judge it by.
    """
    chosen = [mask if c in others else None for c, mask in enumerate(masks)]
    voxels = voxels_of(carve_levels(tables, chosen, (0,), min_views=LEAST_HITS)[0])
    if masks[camera] is None or not len(voxels):
        return float("nan")
    patterns = _counted(_votes(masks, pixels_at(tables, voxels)))
    return _missed(patterns, others, camera, LEAST_M3 / tables.grid.voxel_size_m**3)


_Votes = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class _Patterns:
    """Who shows a person at a voxel and who sees none there, shape (n_cameras, n), and how many voxels there are of each such pattern."""

    shown: np.ndarray
    missed: np.ndarray
    counts: np.ndarray


def _votes(masks: Sequence[np.ndarray | None], pixels: np.ndarray) -> _Votes:
    """Which cameras show a person at voxels that fall on these pixels, and which see none there; bool, (n_cameras, n) each."""
    shown, missed = np.zeros((2, *pixels.shape), bool)
    for c, mask in enumerate(masks):
        if mask is not None:
            seen = pixels[c] < mask.size
            shown[c] = mask.ravel().take(pixels[c], mode="clip") & seen
            missed[c] = ~shown[c] & seen
    return shown, missed


def _counted(votes: _Votes) -> _Patterns:
    shown, missed = votes
    n = len(shown)
    if 2 * n > CODE_BITS:  # each voxel for itself
        return _Patterns(shown, missed, np.ones(shown.shape[1], int))
    codes, counts = np.unique((1 << np.arange(2 * n)) @ np.concatenate(votes), return_counts=True)
    both = (codes >> np.arange(2 * n)[:, None] & 1).astype(bool)
    return _Patterns(both[:n], both[n:], counts)


def _volume(patterns: _Patterns, kept: Sequence[int]) -> int:
    """Voxels of the hull of the kept cameras."""
    inside = ~patterns.missed[kept].any(axis=0) & (patterns.shown[kept].sum(axis=0) >= LEAST_HITS)
    return int(patterns.counts[inside].sum())


def _missed(patterns: _Patterns, kept: Sequence[int], c: int, least: float) -> float:
    """The share of the hull of the kept cameras but one that this one misses, of what it sees of it; NaN where there is too little."""
    others = [one for one in kept if one != c]
    inside = ~patterns.missed[others].any(axis=0) & (patterns.shown[others].sum(axis=0) >= LEAST_HITS)
    counts = patterns.counts * inside
    n = int(counts[patterns.shown[c] | patterns.missed[c]].sum())
    return float(counts[patterns.missed[c]].sum() / n) if n >= max(least, SEEN * counts.sum()) else float("nan")


def _most(shares: np.ndarray) -> float:
    """What a camera may miss, by what cameras that fit miss, (n,)."""
    return max(MISSED, USUAL * float(np.median(shares)))


def _fit(
    tables: CarvingTables,
    masks: Sequence[np.ndarray | None],
    voted: tuple[np.ndarray, _Votes],
    patterns: _Patterns,
    kept: Sequence[int],
    least: float,
) -> Fit:
    """How all cameras fit those that fit each other."""
    voxels, (shown, missed) = voted
    n = len(masks)
    shares, beside, misfit = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, bool)
    points = None
    for c in (c for c, mask in enumerate(masks) if mask is not None):
        shares[c] = _missed(patterns, kept, c, least)
    most = _most(shares[kept][~np.isnan(shares[kept])])
    for c, mask in enumerate(masks):
        if mask is not None and shares[c] > most and mask.any():
            if points is None:
                points = tables.grid.centres(voxels[~missed[kept].any(axis=0) & (shown[kept].sum(axis=0) >= LEAST_HITS)])
            covered = hull_view(tables.rig[c], points, tables.grid.voxel_size_m)
            beside[c] = np.count_nonzero(mask & ~covered) / np.count_nonzero(mask)
            misfit[c] = beside[c] > BESIDE
    return Fit(shares, beside, misfit)
