"""Double occupancy: how much of each body part lies inside other parts (Canton 2009, Eq. 6.12 and 6.14).

`exact_overlap` rasterises every particle's flesh and counts the voxels that more than one part takes. `quick_overlap` tests
some points of each piece of the body against the truncated cones of the others: the volume that two pieces share is the same
seen from either, so each pair is tested once, with the points of the smaller, and only in the particles in which capsules
around the two come near each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.body.flesh import FleshTable, place_points
from hmc.pose.body.model import PARTS, BodyModel, Cones

__all__ = ["OverlapTable", "exact_overlap", "make_overlap_table", "particles_last", "quick_overlap"]

#: Points tested a piece: with 32 the estimate correlates .98 with the exact count over a first layer's particles.
TEST_POINTS = 32
#: Above this share of near particles all are tested, which is cheaper than to pick them.
DENSE_SHARE = 0.6


@dataclass(frozen=True)
class OverlapTable:
    """What `quick_overlap` needs of a body, by pieces: runs of cones in one line, such as a shank without its foot.

    Parameters
    ----------
    part, segment : ndarray of int, shape (k,)
        The part to which a piece belongs, and the segment that carries it.
    cones : tuple of ndarray of int
        The cones of each piece.
    points : ndarray of float32, shape (k, m, 4)
        Test points, homogeneous, metres, segment's frame.
    axes : ndarray of float32, shape (k, 2, 4)
        Ends of the capsule around each piece, likewise.
    radius : ndarray of float32, shape (k,)
        Of the capsule, metres.
    volume : ndarray, shape (k,)
        Of the piece, cubic metres.
    first, second : ndarray of int, shape (n_pairs,)
        Pairs of pieces of different parts, the smaller first.
    to_cone : ndarray of float32, shape (n_cones, 3, 4)
        Homogeneous points of the segment to cone coordinates, two across and one along from the middle of the axis, in units
        of the flesh's spacing, with elliptic cones stretched to round ones.
    shape : ndarray of float32, shape (n_cones, 3)
        In these coordinates: radius in the middle, its change along the axis, half of the axis.
    part_volume : ndarray, shape (n_parts,)
        Cubic metres.
    """

    part: np.ndarray
    segment: np.ndarray
    cones: tuple[np.ndarray, ...]
    points: np.ndarray
    axes: np.ndarray
    radius: np.ndarray
    volume: np.ndarray
    first: np.ndarray
    second: np.ndarray
    to_cone: np.ndarray
    shape: np.ndarray
    part_volume: np.ndarray


def make_overlap_table(body: BodyModel, flesh: FleshTable, test_points: int = TEST_POINTS) -> OverlapTable:
    """Divide the body into pieces and choose their test points; once a body.

    Parameters
    ----------
    body : BodyModel
    flesh : FleshTable
        For the volumes of the parts, and for its spacing: a point counts in full from half a voxel inside a cone.
    test_points : int
        How many points a piece.
    """
    cones = body.cones
    pieces = _pieces(cones)
    part, segment = (np.array([values[piece[0]] for piece in pieces]) for values in (cones.part, cones.segment))
    axes, radius = np.ones((len(pieces), 2, 4)), np.empty(len(pieces))
    for index, piece in enumerate(pieces):
        start, end = cones.start[piece[0]], cones.end[piece[-1]]
        axes[index, :, :3] = start, end
        knots = np.concatenate([cones.start[piece], cones.end[piece]])
        along = np.clip((knots - start) @ (end - start) / np.sum((end - start) ** 2), 0, 1)[:, None]
        off_axis = np.linalg.norm(knots - start - along * (end - start), axis=1)
        radius[index] = np.max(off_axis + cones.radii[piece].max(2).T.ravel()) + flesh.spacing_m / 2

    part_volume = np.bincount(flesh.part, minlength=len(PARTS)) * flesh.spacing_m**3
    cone_volume = np.pi * cones.lengths * cones.radii.mean(1).prod(1)
    volume = np.array([cone_volume[piece].sum() for piece in pieces])
    # Cones of a part overlap a little; the pieces are to make up the part.
    volume *= (part_volume / np.bincount(part, volume, len(PARTS)))[part]
    by_volume = np.argsort(volume, kind="stable")
    pairs = np.array([(a, b) for place, a in enumerate(by_volume) for b in by_volume[place + 1 :] if part[a] != part[b]])

    scale = 1 / flesh.spacing_m
    mean_radii = cones.radii.mean(axis=1) * scale
    to_cone = np.empty((len(cones.part), 3, 4))
    to_cone[:, :, :3] = cones.bases * scale
    to_cone[:, :2, :3] *= (np.sqrt(mean_radii.prod(axis=1, keepdims=True)) / mean_radii)[:, :, None]
    to_cone[:, :, 3] = -np.einsum("cij,cj->ci", to_cone[:, :, :3], (cones.start + cones.end) / 2)
    ends = np.sqrt(cones.radii.prod(axis=2)) * scale
    length = cones.lengths * scale
    return OverlapTable(
        part,
        segment,
        tuple(pieces),
        np.stack([_test_points(cones, piece, test_points) for piece in pieces]),
        axes.astype(np.float32),
        radius.astype(np.float32),
        volume,
        pairs[:, 0],
        pairs[:, 1],
        to_cone.astype(np.float32),
        np.stack([ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / length, length / 2], axis=1).astype(np.float32),
        part_volume,
    )


def _pieces(cones: Cones) -> list[np.ndarray]:
    """Runs of cones of one part and one segment that point the same way."""
    axes = (cones.end - cones.start) / cones.lengths[:, None]
    follows = (np.diff(cones.part) == 0) & (np.diff(cones.segment) == 0) & (np.abs(np.sum(axes[1:] * axes[:-1], axis=1)) > 0.8)
    return np.split(np.arange(len(cones.part)), np.flatnonzero(~follows) + 1)


def _test_points(cones: Cones, piece: np.ndarray, n: int) -> np.ndarray:
    """Evenly spread points of some cones, shape (n, 4).

    Voxel centres would do harm here: whole layers of them lie on the plane in which two parts meet. The points are even
    along the piece, where it matters most, and follow a low-discrepancy sequence across it.
    """
    knots = np.linspace(0, 1, 65)
    radii = cones.radii[piece, 0, :, None] + (cones.radii[piece, 1] - cones.radii[piece, 0])[:, :, None] * knots
    volume = np.cumsum(radii.prod(axis=1) * cones.lengths[piece, None])
    i = np.arange(n)
    place = np.interp((i + 0.5) / n, volume / volume[-1], np.arange(volume.size))
    cone = piece[(place // len(knots)).astype(int)]
    along = np.clip(place % len(knots) / (len(knots) - 1), 0, 1)[:, None]
    lateral, angle = np.sqrt((0.5 + i * 0.7548776662) % 1), 2 * np.pi * ((i * 0.5698402910) % 1)
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1) * lateral[:, None]
    across *= (1 - along) * cones.radii[cone, 0] + along * cones.radii[cone, 1]
    points = (1 - along) * cones.start[cone] + along * cones.end[cone]
    points += np.einsum("nk,nki->ni", across, cones.bases[cone, :2])
    return np.c_[points, np.ones(n)].astype(np.float32)


def particles_last(rotations: np.ndarray, positions: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Transforms with the particles along the last axis, so that all that follows is arithmetic on whole rows.

    Parameters
    ----------
    rotations, positions : ndarray, shape (n, 11, 3, 3) and (n, 11, 3)
        As from `hmc.pose.body.kinematics.segment_transforms`.
    origin : ndarray, shape (3,)
        Somewhere near, world, metres: positions are taken from here, as single precision is coarse far from its zero.

    Returns
    -------
    ndarray of float32, shape (11, 3, 4, n)
        Rotation and position side by side.
    """
    placed = np.empty((rotations.shape[1], 3, 4, len(rotations)), np.float32)
    placed[:, :, :3] = rotations.transpose(1, 2, 3, 0)
    placed[:, :, 3] = (positions - origin).transpose(1, 2, 0)
    return placed


def quick_overlap(table: OverlapTable, placed: np.ndarray) -> np.ndarray:
    """Estimate of the fraction of each part inside other parts.

    Parameters
    ----------
    table : OverlapTable
    placed : ndarray of float32, shape (11, 3, 4, n)
        From `particles_last`.

    Returns
    -------
    ndarray, shape (n, n_parts)
    """
    n = placed.shape[-1]
    near = _near(table, placed)
    shared = np.zeros((len(PARTS), n))
    for pair in np.flatnonzero(near.any(axis=1)):
        i, j = table.first[pair], table.second[pair]
        which = np.flatnonzero(near[pair])
        if which.size > DENSE_SHARE * n:
            volume = _shared(table, i, j, placed[table.segment[i]], placed[table.segment[j]])
            shared[table.part[i]] += volume
            shared[table.part[j]] += volume
        else:
            volume = _shared(table, i, j, placed[table.segment[i]][..., which], placed[table.segment[j]][..., which])
            shared[table.part[i], which] += volume
            shared[table.part[j], which] += volume
    return np.minimum(shared / table.part_volume[:, None], 1).T


def _near(table: OverlapTable, placed: np.ndarray) -> np.ndarray:
    """Which pairs of capsules touch in which particles, shape (n_pairs, n).

    The distance of two line segments, by Ericson (2005), Real-Time Collision Detection, section 5.1.9.
    """
    ends = table.axes[:, None] @ placed[table.segment]
    start, axis = np.moveaxis(ends[:, :, 0], 1, 0), np.moveaxis(ends[:, :, 1] - ends[:, :, 0], 1, 0)
    i, j = table.first, table.second
    apart, axis_i, axis_j = start[:, i] - start[:, j], axis[:, i], axis[:, j]
    squared = np.sum((table.axes[:, 1] - table.axes[:, 0]) ** 2, axis=1)[:, None]
    a, e = squared[i], squared[j]
    b, c, f = _dot(axis_i, axis_j), _dot(axis_i, apart), _dot(axis_j, apart)
    s = np.clip((b * f - c * e) / np.maximum(a * e - b * b, np.float32(1e-9)), 0, 1)
    t = np.clip((b * s + f) / e, 0, 1)
    s = np.clip((b * t - c) / a, 0, 1)
    apart += axis_i * s - axis_j * t
    return _dot(apart, apart) < ((table.radius[i] + table.radius[j]) ** 2)[:, None]


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Dot products of vectors along the first axis, of length 3."""
    total = first[0] * second[0]
    total += first[1] * second[1]
    total += first[2] * second[2]
    return total


def _shared(table: OverlapTable, i: int, j: int, placed: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Volume that two pieces share in every particle, cubic metres, shape (n,)."""
    cones, points = table.cones[j], table.points[i]
    moved = placed.copy()
    moved[:, 3] -= other[:, 3]
    relative = np.add.reduce(other[:, :3, None] * moved[:, None], axis=0)
    columns = (table.to_cone[cones, :, :3].reshape(-1, 3) @ relative.reshape(3, -1)).reshape(len(cones), 3, 4, -1)
    columns[:, :, 3] += table.to_cone[cones, :, 3:]

    # Cones past which the whole capsule lies, at one end or the other, need no test.
    along = table.axes[i] @ columns[:, 2]
    span = table.shape[cones, 2] + table.radius[i] * np.linalg.norm(table.to_cone[cones, 2, :3], axis=1)
    meets = (along.min((1, 2)) < span) & (along.max((1, 2)) > -span)
    inside = np.zeros((len(points), placed.shape[-1]), np.float32)
    for cone in np.flatnonzero(meets):
        np.maximum(inside, _inside(points @ columns[cone], *table.shape[cones[cone]]), out=inside)
    return inside.sum(axis=0) * (table.volume[i] / len(points))


def _inside(coordinates: np.ndarray, radius: np.float32, slope: np.float32, half_length: np.float32) -> np.ndarray:
    """How much each point counts as inside a cone, shape (m, n): from 0 half a voxel outside to 1 half a voxel inside."""
    first, second, along = coordinates
    first *= first
    second *= second
    first += second
    np.sqrt(first, out=first)
    np.multiply(along, slope, out=second)
    second += radius + np.float32(0.5)
    second -= first
    np.abs(along, out=along)
    np.subtract(half_length + np.float32(0.5), along, out=along)
    depth = np.minimum(second, along, out=second)
    return np.clip(depth, 0, 1, out=depth)


def exact_overlap(flesh: FleshTable, rotations: np.ndarray, positions: np.ndarray, origin: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Fraction of each part's voxels in voxels that another part takes too (Eq. 6.14).

    Parameters
    ----------
    flesh : FleshTable
    rotations, positions : ndarray, shape (n, 11, 3, 3) and (n, 11, 3)
    origin : ndarray, shape (3,)
        A corner of the voxels' lattice, world, metres.
    voxel_size_m : float

    Returns
    -------
    ndarray, shape (n, n_parts)
    """
    bits = (1 << np.arange(len(PARTS))).astype(np.uint16)
    members = [np.flatnonzero(flesh.part == part) for part in range(len(PARTS))]
    counts = np.array([member.size for member in members])
    out = np.empty((len(rotations), len(PARTS)))
    for particle, (rotation, position) in enumerate(zip(rotations, positions, strict=True)):
        voxels = np.floor((place_points(rotation, position, flesh.points, flesh.segment) - origin) / voxel_size_m).astype(np.int64)
        voxels -= voxels.min(0)
        shape = voxels.max(0) + 1
        flat = np.ravel_multi_index(tuple(voxels.T), tuple(shape))
        takers = np.zeros(np.prod(shape), np.uint16)
        for part, member in enumerate(members):
            takers[flat[member]] |= bits[part]
        double = (takers[flat] & ~bits[flesh.part]) != 0
        out[particle] = np.bincount(flesh.part, double, len(PARTS)) / counts
    return out
