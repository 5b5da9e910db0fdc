"""The four scores of a pose against a voxel reconstruction and the likelihoods made of them (Canton 2009, section 6.5).

Every particle's flesh, the look-up table of Eq. 6.11, is carried into the room and compared with the occupied voxels (Empty),
with the smoothed surface (Surf), with the room's limits (Out) and with the body's other parts (double occupancy, DO, in
`hmc.pose.objectives.overlap`). Scores are fractions: 0 is a perfect match.

The work is a gather of some five million voxels a layer, so the flesh is laid out for it: points in rows and particles in
columns, the surface's points first within a part, so that one array of indices serves both maps, in chunks that stay in
cache.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from hmc.body.flesh import FleshTable
from hmc.body.joints import SEGMENTS
from hmc.body.kinematics import place_segments, segment_transforms
from hmc.body.model import PARTS, BodyModel
from hmc.pose.objectives.overlap import OverlapTable, make_overlap_table, quick_overlap
from hmc.pose.objectives.overlap_exact import exact_overlap
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = [
    "SCORES",
    "ScoreMaps",
    "ScoreTable",
    "ScoreVariances",
    "log_likelihood_by_part",
    "log_likelihood_factorised",
    "log_likelihood_global",
    "make_score_table",
    "map_scores",
    "observe",
    "scores",
]

#: Columns of every score array.
SCORES = ("out", "double_occupancy", "empty", "surface")
#: Elements of a chunk: its coordinates and indices stay in a core's second-level cache, and calls are few.
CHUNK_ELEMENTS = 60_000
#: Room left around the occupied voxels in the maps, metres. Flesh farther out is clamped to the empty border.
MARGIN_M = 0.3


@dataclass(frozen=True)
class ScoreMaps:
    """What particles are compared with: a crop of the room around the occupied voxels, with an empty border.

    Parameters
    ----------
    occupancy : ndarray of uint8, shape (nx, ny, nz)
        1 where a voxel is occupied.
    both : ndarray of uint8, shape (nx, ny, nz, 2)
        Closeness to the surface (Eq. 6.16), 0 to 1 as 0 to 255, and again the occupancy: side by side, so that one look-up of
        16 bits finds both.
    origin : ndarray, shape (3,)
        Lowest corner of the crop, world, metres.
    voxel_size_m : float
    room : ndarray, shape (2, 3)
        Lowest and highest corner, world, metres.
    """

    occupancy: np.ndarray
    both: np.ndarray
    origin: np.ndarray
    voxel_size_m: float
    room: np.ndarray

    @property
    def surface(self) -> np.ndarray:
        """Closeness to the surface, shape (nx, ny, nz)."""
        return self.both[..., 0]


@dataclass(frozen=True)
class ScoreTable:
    """A body's flesh, laid out for `scores`.

    Parameters
    ----------
    body : BodyModel
    points : ndarray of float32, shape (n, 4)
        Homogeneous, metres, segment's frame; sorted by part, within a part the surface first.
    blocks : tuple of (part, segment, is_surface, start, stop)
        Runs of rows of `points`.
    corners : ndarray of float32, shape (16, 8, 4)
        Homogeneous corners of the box around each segment's points, metres, segment's frame.
    counts : ndarray of int, shape (n_parts, 4)
        Points behind each score: the surface's for ``surface``, all for the others.
    overlap : OverlapTable
    flesh : FleshTable
    """

    body: BodyModel
    points: np.ndarray
    blocks: tuple[tuple[int, int, bool, int, int], ...]
    corners: np.ndarray
    counts: np.ndarray
    overlap: OverlapTable
    flesh: FleshTable


@dataclass(frozen=True)
class ScoreVariances:
    """Variances of the scores as printed below Eq. 6.22 and Table 6.2, preset ``canton2009``.

    Small ones for Out and double occupancy act as a cut-off; those of Empty and Surf shape the likelihood.

    Parameters
    ----------
    out, double_occupancy, empty, surface : float
        For the whole body, and for the parts of which the table says nothing else.
    """

    out: float = 0.01
    double_occupancy: float = 0.01
    empty: float = 0.1
    surface: float = 0.1

    def whole_body(self) -> np.ndarray:
        """Variances of the global likelihood, shape (4,)."""
        return np.array([self.out, self.double_occupancy, self.empty, self.surface])

    def by_part(self) -> np.ndarray:
        """Variances of the factorised likelihood, shape (n_parts, 4).

        Table 6.2, whose row names repeat, is read so: Empty and Surf are halved for the parts at a limb's end (forearms and
        shanks) and for the torso, whose double occupancy is doubled as every limb may touch it.
        """
        factors = np.ones((len(PARTS), 4))
        for row, part in enumerate(PARTS):
            if part == "torso":
                factors[row] = (1, 2, 0.5, 0.5)
            elif part.endswith(("forearm", "shank")):
                factors[row] = (1, 1, 0.5, 0.5)
        return factors * self.whole_body()


def observe(occupied: np.ndarray, grid: VoxelGrid, room: np.ndarray | None = None, sigma_vox: float = 1.0) -> ScoreMaps:
    """Turn a reconstruction into the maps that poses are scored on.

    Parameters
    ----------
    occupied : ndarray of bool, shape (nx, ny, nz)
        May be empty: then every pose scores 1 for Empty and Surf.
    grid : VoxelGrid
    room : array_like, shape (2, 3), optional
        Where a body may be (score Out); the grid's bounds by default.
    sigma_vox : float
        Standard deviation of the Gaussian that smooths the surface, voxels.

    Returns
    -------
    ScoreMaps

    Raises
    ------
    ValueError
        When `occupied` has not the grid's shape.
    """
    if occupied.shape != grid.shape:
        raise ValueError(f"`occupied` must have the grid's shape {grid.shape}; got {occupied.shape}")
    room = grid.bounds if room is None else np.asarray(room, float)
    size = grid.voxel_size_m
    low, high = _bounds(occupied)
    margin = int(np.ceil(MARGIN_M / size)) + 1
    occupancy = np.zeros(high - low + 2 * margin, np.uint8)
    occupancy[margin:-margin, margin:-margin, margin:-margin] = occupied[tuple(map(slice, low, high))]

    # The blur reaches four standard deviations, but never the outermost layer, which stays empty.
    blur = min(int(np.ceil(4 * sigma_vox)), margin - 1)
    near = (slice(margin - blur, -(margin - blur)),) * 3
    smooth = np.zeros(tuple(n - 2 * (margin - blur) for n in occupancy.shape), np.float32)
    shell = surface(occupancy[near].astype(bool))
    smooth[tuple(shell.T)] = 1
    smooth = ndimage.gaussian_filter(smooth, sigma_vox, truncate=4, mode="constant")
    both = np.zeros((*occupancy.shape, 2), np.uint8)
    both[..., 1] = occupancy
    if len(shell):
        both[(*near, 0)] = np.rint(smooth * (255 / smooth.max()))
    return ScoreMaps(occupancy, both, grid.origin + size * (low - margin), size, room)


def _bounds(occupied: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and one past the highest occupied index; one voxel where none is occupied."""
    bounds = np.zeros((2, 3), int)
    bounds[1] = 1
    over_z = np.any(occupied, axis=2)
    for axis, line in enumerate((np.any(over_z, axis=1), np.any(over_z, axis=0), np.any(occupied, axis=(0, 1)))):
        where = np.flatnonzero(line)
        if where.size:
            bounds[:, axis] = where[0], where[-1] + 1
    return bounds[0], bounds[1]


def make_score_table(body: BodyModel, flesh: FleshTable) -> ScoreTable:
    """Lay out a body's flesh for `scores`; once a body.

    Parameters
    ----------
    body : BodyModel
    flesh : FleshTable
        Its spacing over the maps' voxel size is the density factor of Eq. 6.26.
    """
    order = np.lexsort((flesh.segment, ~flesh.is_surface, flesh.part))
    keys = np.stack([flesh.part, flesh.segment, flesh.is_surface], axis=1)[order]
    starts = np.flatnonzero(np.any(np.diff(keys, axis=0, prepend=-1), axis=1))
    stops = np.append(starts[1:], len(order))
    blocks = tuple((int(p), int(s), bool(f), int(a), int(b)) for (p, s, f), a, b in zip(keys[starts], starts, stops, strict=True))
    points = np.ones((len(order), 4), np.float32)
    points[:, :3] = flesh.points[order]
    corners = np.ones((len(SEGMENTS), 8, 4), np.float32)
    sides = np.array(list(itertools.product((False, True), repeat=3)))
    for segment in np.unique(flesh.segment):
        members = flesh.points[flesh.segment == segment]
        corners[segment, :, :3] = np.where(sides, members.max(0), members.min(0))
    counts = np.repeat(np.bincount(flesh.part, minlength=len(PARTS))[:, None], 4, axis=1)
    counts[:, 3] = np.bincount(flesh.part[flesh.is_surface], minlength=len(PARTS))
    return ScoreTable(body, points, blocks, corners, counts, make_overlap_table(body, flesh), flesh)


def scores(table: ScoreTable, states: np.ndarray, maps: ScoreMaps, exact: bool = False) -> np.ndarray:
    """The four scores of every part of every particle (Eq. 6.13-6.16; Empty is 1 - Occ).

    Parameters
    ----------
    table : ScoreTable
    states : ndarray, shape (n, 37)
    maps : ScoreMaps
    exact : bool
        Count double occupancy voxel by voxel instead of by the quick estimate; some ten times slower.

    Returns
    -------
    ndarray, shape (n, n_parts, 4)
        Columns as in `SCORES`, each from 0 (good) to 1. Out is the fraction of the part's voxels outside the room.
    """
    out = np.empty((len(states), len(PARTS), 4))
    if len(out) == 0:
        return out
    placed = place_segments(table.body, states, maps.origin)
    out[..., 0], out[..., 2], out[..., 3] = map_scores(table, placed, maps)
    if exact:
        out[..., 1] = exact_overlap(table.flesh, *segment_transforms(table.body, states), maps.origin, maps.voxel_size_m)
    else:
        out[..., 1] = quick_overlap(table.overlap, placed)
    return out


def map_scores(table: ScoreTable, placed: np.ndarray, maps: ScoreMaps) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The scores that need the maps: Out, Empty and Surf.

    Parameters
    ----------
    table : ScoreTable
    placed : ndarray of float32, shape (16, 3, 4, n)
        From `place_segments`, counted from the maps' origin.
    maps : ScoreMaps

    Returns
    -------
    out, empty, surface : ndarray, shape (n, n_parts)
    """
    n = placed.shape[-1]
    size = maps.voxel_size_m
    occupancy, both = maps.occupancy.ravel(), maps.both.view(np.uint16).ravel()
    columns = placed * np.float32(1 / size)  # points @ columns[segment, axis] is a coordinate in voxels
    # A segment whose box leaves the crop (the room) in some particle has its points clamped (tested).
    at = table.corners[:, None] @ columns
    low, high = at.min((2, 3)) - 0.01, at.max((2, 3)) + 0.01
    clamped = np.any((low < 0) | (high > maps.occupancy.shape), axis=1)
    room = (maps.room - maps.origin) / size
    crossed = np.stack([low < room[0], high > room[1]], axis=2)  # (segment, axis, side)

    totals = np.zeros((3, len(PARTS), n), np.int32)
    rows = max(8, CHUNK_ELEMENTS // n)
    axis_buffer, flat_buffer = np.empty((rows, n), np.float32), np.empty((rows, n), np.int32)
    index_buffer, found_buffer, pair_buffer = (np.empty((rows, n), kind) for kind in (np.int64, np.uint8, np.uint16))
    # Memory in use at a time decides the speed: whole coordinates live where the indices will be written last.
    voxel_buffer = index_buffer.view(np.int32).reshape(-1)[: rows * n].reshape(rows, n)
    for part, segment, is_surface, start, stop in table.blocks:
        for first in range(start, stop, rows):
            points = table.points[first : min(first + rows, stop)]
            m = len(points)
            along, flat, voxel, index, found = (
                buffer[:m] for buffer in (axis_buffer, flat_buffer, voxel_buffer, index_buffer, found_buffer)
            )
            # Each coordinate is cut to a whole number before they are joined: the other way round is wrong at rounding.
            for axis, extent in enumerate(maps.occupancy.shape):
                np.matmul(points, columns[segment, axis], out=along)
                if clamped[segment]:
                    np.clip(along, 0.5, extent - 0.5, out=along)
                if axis == 0:
                    np.copyto(flat, along, casting="unsafe")
                else:
                    flat *= extent
                    np.copyto(voxel, along, casting="unsafe")
                    flat += voxel
            np.copyto(index, flat)
            if is_surface:
                pairs = pair_buffer[:m]
                both.take(index, out=pairs, mode="wrap")
                sums = _sum_rows(pairs.view(np.uint8))
                totals[1, part] += sums[1::2]
                totals[2, part] += sums[::2]
            else:
                found = found_buffer[:m]
                occupancy.take(index, out=found, mode="wrap")
                totals[1, part] += _sum_rows(found)
            if crossed[segment].any():
                totals[0, part] += _sum_rows(_outside(points, columns[segment], room, crossed[segment]).view(np.uint8))
    out, occupied, close = totals / table.counts.T[[0, 2, 3], :, None]
    return out.T, 1 - occupied.T, 1 - close.T / 255


def _outside(points: np.ndarray, columns: np.ndarray, room: np.ndarray, crossed: np.ndarray) -> np.ndarray:
    """Which points lie beyond the sides of the room that are in question; bool, shape (m, n)."""
    outside = np.zeros((len(points), columns.shape[-1]), bool)
    for axis in np.flatnonzero(crossed.any(axis=1)):
        along = points @ columns[axis]
        if crossed[axis, 0]:
            outside |= along < np.float32(room[0, axis])
        if crossed[axis, 1]:
            outside |= along > np.float32(room[1, axis])
    return outside


def _sum_rows(values: np.ndarray) -> np.ndarray:
    """Sum of uint8 rows, shape (n,); OpenCV does it several times quicker than NumPy."""
    return cv2.reduce(values, 0, cv2.REDUCE_SUM, dtype=cv2.CV_32S)[0]


def log_likelihood_by_part(values: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """The factors of `log_likelihood_factorised`, each part's own: shape (n, n_parts); the arguments are the same."""
    return -0.5 * np.einsum("nps,ps->np", values**2, 1 / np.asarray(variances))


def log_likelihood_factorised(values: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """Logarithm of the product of the parts' likelihoods, up to a constant (Eq. 6.23-6.25).

    Parameters
    ----------
    values : ndarray, shape (n, n_parts, 4)
        From `scores`.
    variances : ndarray, shape (n_parts, 4)
        As `ScoreVariances.by_part` gives them: the diagonal of H in Eq. 3.15 (`hmc.search.log_joint_fitness`).

    Returns
    -------
    ndarray, shape (n,)
    """
    return -0.5 * np.einsum("nps,ps->n", values**2, 1 / np.asarray(variances))


def log_likelihood_global(values: np.ndarray, counts: np.ndarray, variances: np.ndarray) -> np.ndarray:
    """Logarithm of the likelihood of the whole body's scores, up to a constant (Eq. 6.17-6.22).

    Parameters
    ----------
    values : ndarray, shape (n, n_parts, 4)
        From `scores`.
    counts : ndarray, shape (n_parts, 4)
        Voxels behind each score (`ScoreTable.counts`).
    variances : ndarray, shape (4,)
        As `ScoreVariances.whole_body` gives them.

    Returns
    -------
    ndarray, shape (n,)
    """
    whole = np.einsum("nps,ps->ns", values, counts / counts.sum(0))
    return -0.5 * (whole**2 @ (1 / np.asarray(variances)))
