"""Double occupancy: how much of each body part lies inside other parts (Canton 2009, Eq. 6.12 and 6.14).

`exact_overlap` rasterises every particle's flesh and counts the voxels that more than one part takes. `quick_overlap` tests
some points of each part against the truncated cones of the others: the volume that two parts share is the same seen from
either, so each pair is tested once, with the points of the smaller, and only in the particles in which capsules around the
two come near each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.pose.body.flesh import FleshTable, place_points
from hmc.pose.body.model import PARTS, BodyModel, Cones

__all__ = ["OverlapTable", "exact_overlap", "make_overlap_table", "quick_overlap"]

#: Points tested a part: with 32 the total correlates .98 with the exact count over a first layer's particles.
TEST_POINTS = 32
#: Above this share of near particles all are tested, which is cheaper than to pick them.
DENSE_SHARE = 0.6


@dataclass(frozen=True)
class OverlapTable:
    """What `quick_overlap` needs of a body.

    Lengths in cone coordinates are in units of the flesh's spacing, and elliptic cones are stretched to round ones.

    Parameters
    ----------
    cones : Cones
    to_cone : ndarray of float32, shape (n_cones, 3, 4)
        Homogeneous points of the segment to cone coordinates: two across, one along from the middle of the axis.
    shape : ndarray of float32, shape (n_cones, 3)
        Radius in the middle, its change along the axis, half of the axis.
    points : ndarray of float32, shape (n_parts, m, 4)
        Test points, homogeneous, metres, in the frame of the part's first segment.
    segments : ndarray of int, shape (n_parts,)
        The segment that carries each part's test points.
    volumes : ndarray, shape (n_parts,)
        Cubic metres.
    capsules : Capsules
    pairs : tuple of (part, other, first, last)
        Pairs of parts, the smaller first, and their run in the pairs of capsules.
    cones_of : tuple of tuple of (segment, cones)
        The cones of each part by segment.
    """

    cones: Cones
    to_cone: np.ndarray
    shape: np.ndarray
    points: np.ndarray
    segments: np.ndarray
    volumes: np.ndarray
    capsules: Capsules
    pairs: tuple[tuple[int, int, int, int], ...]
    cones_of: tuple[tuple[tuple[int, np.ndarray], ...], ...]


@dataclass(frozen=True)
class Capsules:
    """Capsules around the cones of each part (two for a bent part, such as a shank with its foot), and their pairs.

    Parameters
    ----------
    part, segment : ndarray of int, shape (k,)
    axes : ndarray of float32, shape (k, 2, 4)
        Start and end of the axis, homogeneous, metres, segment's frame.
    radius : ndarray of float32, shape (k,)
    first, second : ndarray of int, shape (n_pairs,)
        Capsules of a pair.
    """

    part: np.ndarray
    segment: np.ndarray
    axes: np.ndarray
    radius: np.ndarray
    first: np.ndarray
    second: np.ndarray


def make_overlap_table(body: BodyModel, flesh: FleshTable, test_points: int = TEST_POINTS) -> OverlapTable:
    """Choose the test points of each part; once a body.

    Parameters
    ----------
    body : BodyModel
    flesh : FleshTable
        For the volumes of the parts, and for its spacing: a point counts in full from half a voxel inside a cone.
    test_points : int
        How many points a part.
    """
    cones = body.cones
    scale = 1 / flesh.spacing_m
    mean_radii = cones.radii.mean(axis=1) * scale
    round_radius = np.sqrt(mean_radii.prod(axis=1))
    half_length = cones.lengths / 2 * scale
    to_cone = np.empty((len(cones.part), 3, 4))
    to_cone[:, :, :3] = cones.bases * scale
    to_cone[:, :2, :3] *= (round_radius[:, None] / mean_radii)[:, :, None]
    to_cone[:, :, 3] = -np.einsum("cij,cj->ci", to_cone[:, :, :3], (cones.start + cones.end) / 2)
    ends = np.sqrt(cones.radii.prod(axis=2)) * scale
    segments = np.array([cones.segment[cones.part == part][0] for part in range(len(PARTS))])
    volumes = np.bincount(flesh.part, minlength=len(PARTS)) * flesh.spacing_m**3
    capsules, pairs = _capsules(cones, np.argsort(volumes, kind="stable"), flesh.spacing_m / 2)
    return OverlapTable(
        cones,
        to_cone.astype(np.float32),
        np.stack([ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / (2 * half_length), half_length], axis=1).astype(np.float32),
        np.stack([_test_points(cones, part, segments[part], test_points) for part in range(len(PARTS))]),
        segments,
        volumes,
        capsules,
        pairs,
        tuple(
            tuple(
                (int(s), np.flatnonzero((cones.part == part) & (cones.segment == s))) for s in np.unique(cones.segment[cones.part == part])
            )
            for part in range(len(PARTS))
        ),
    )


def _capsules(cones: Cones, order: np.ndarray, margin: float) -> tuple[Capsules, tuple[tuple[int, int, int, int], ...]]:
    """Bound the cones by capsules and pair them, parts in the given order."""
    axes = (cones.end - cones.start) / cones.lengths[:, None]
    groups: list[list[int]] = []
    for cone in range(len(cones.part)):
        last = groups[-1][-1] if groups else cone
        same = cones.part[cone] == cones.part[last] and cones.segment[cone] == cones.segment[last]
        if groups and same and abs(axes[cone] @ axes[last]) > 0.8:
            groups[-1].append(cone)
        else:
            groups.append([cone])
    ends = np.ones((len(groups), 2, 4))
    radius = np.empty(len(groups))
    for index, group in enumerate(groups):
        start, end = cones.start[group[0]], cones.end[group[-1]]
        ends[index, :, :3] = start, end
        knots = np.concatenate([cones.start[group], cones.end[group]])
        t = np.clip((knots - start) @ (end - start) / np.sum((end - start) ** 2), 0, 1)
        radius[index] = (
            np.max(np.linalg.norm(knots - start - t[:, None] * (end - start), axis=1) + cones.radii[group].max(2).T.ravel()) + margin
        )
    part = np.array([cones.part[group[0]] for group in groups])
    pairs, first, second = [], [], []
    for place, a in enumerate(order):
        for b in order[place + 1 :]:
            begin = len(first)
            for i in np.flatnonzero(part == a):
                for j in np.flatnonzero(part == b):
                    first.append(i)
                    second.append(j)
            pairs.append((int(a), int(b), begin, len(first)))
    segment = np.array([cones.segment[group[0]] for group in groups])
    capsules = Capsules(part, segment, ends.astype(np.float32), radius.astype(np.float32), np.array(first), np.array(second))
    return capsules, tuple(pairs)


def _test_points(cones: Cones, part: int, segment: int, n: int) -> np.ndarray:
    """Evenly spread points of a part's cones on one segment, shape (n, 4).

    Voxel centres would do harm here: whole layers of them lie on the plane in which two parts meet. The points are even
    along the part, where it matters most, and follow a low-discrepancy sequence across it.
    """
    members = np.flatnonzero((cones.part == part) & (cones.segment == segment))
    knots = np.linspace(0, 1, 65)
    radii = cones.radii[members, 0, :, None] + (cones.radii[members, 1] - cones.radii[members, 0])[:, :, None] * knots
    volume = np.cumsum(radii.prod(axis=1) * cones.lengths[members, None])
    i = np.arange(n)
    place = np.interp((i + 0.5) / n, volume / volume[-1], np.arange(volume.size))
    member = members[(place // len(knots)).astype(int)]
    along = np.clip(place % len(knots) / (len(knots) - 1), 0, 1)[:, None]
    lateral, angle = np.sqrt((0.5 + i * 0.7548776662) % 1), 2 * np.pi * ((i * 0.5698402910) % 1)
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1) * lateral[:, None]
    across *= (1 - along) * cones.radii[member, 0] + along * cones.radii[member, 1]
    points = (1 - along) * cones.start[member] + along * cones.end[member]
    points += np.einsum("nk,nki->ni", across, cones.bases[member, :2])
    return np.c_[points, np.ones(n)].astype(np.float32)


def quick_overlap(table: OverlapTable, rotations: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Estimate of the fraction of each part inside other parts.

    Parameters
    ----------
    table : OverlapTable
    rotations, positions : ndarray, shape (n, 11, 3, 3) and (n, 11, 3)
        As from `hmc.pose.body.kinematics.segment_transforms`.

    Returns
    -------
    ndarray, shape (n, n_parts)
    """
    n = len(rotations)
    # Particles run along the last axis, so that all that follows is arithmetic on whole rows; the pelvis is the origin.
    placed = np.empty((rotations.shape[1], 3, 4, n), np.float32)
    placed[:, :, :3] = rotations.transpose(1, 2, 3, 0)
    placed[:, :, 3] = (positions - positions[:, :1]).transpose(1, 2, 0)
    near = _near(table.capsules, placed)
    shared = np.zeros((len(PARTS), n))
    for part, other, begin, end in table.pairs:
        which = np.flatnonzero(near[begin] if end - begin == 1 else near[begin:end].any(axis=0))
        if which.size > DENSE_SHARE * n:
            volume = _shared(table, part, other, placed)
            shared[part] += volume
            shared[other] += volume
        elif which.size:
            volume = _shared(table, part, other, placed, which)
            shared[part, which] += volume
            shared[other, which] += volume
    return np.minimum(shared / table.volumes[:, None], 1).T


def _near(capsules: Capsules, placed: np.ndarray) -> np.ndarray:
    """Which pairs of capsules touch in which particles, shape (n_pairs, n).

    The distance of two line segments, by Ericson (2005), Real-Time Collision Detection, section 5.1.9.
    """
    ends = capsules.axes[:, None] @ placed[capsules.segment]  # (k, 3, 2, n)
    start, axis = ends[:, :, 0], ends[:, :, 1] - ends[:, :, 0]
    i, j = capsules.first, capsules.second
    squared = np.sum((capsules.axes[:, 1] - capsules.axes[:, 0]) ** 2, axis=1)[:, None]
    apart, axis_i, axis_j = start[i] - start[j], axis[i], axis[j]
    a, e = squared[i], squared[j]
    b, c, f = (np.einsum("pkn,pkn->pn", u, v) for u, v in ((axis_i, axis_j), (axis_i, apart), (axis_j, apart)))
    s = np.clip((b * f - c * e) / np.maximum(a * e - b * b, np.float32(1e-9)), 0, 1)
    t = np.clip((b * s + f) / e, 0, 1)
    s = np.clip((b * t - c) / a, 0, 1)
    apart += axis_i * s[:, None] - axis_j * t[:, None]
    return np.einsum("pkn,pkn->pn", apart, apart) < ((capsules.radius[i] + capsules.radius[j]) ** 2)[:, None]


def _shared(table: OverlapTable, part: int, other: int, placed: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
    """Volume that two parts share in the particles asked for, cubic metres, shape (n,)."""
    own = placed[table.segments[part]]
    own = own if which is None else own[..., which]
    points = table.points[part]
    inside = None
    for segment, cones in table.cones_of[other]:
        there = placed[segment] if which is None else placed[segment][..., which]
        moved = own.copy()
        moved[:, 3] -= there[:, 3]
        relative = np.add.reduce(there[:, :3, None] * moved[:, None], axis=0)
        columns = (table.to_cone[cones, :, :3].reshape(-1, 3) @ relative.reshape(3, -1)).reshape(len(cones), 3, *own.shape[1:])
        columns[:, :, 3] += table.to_cone[cones, :, 3:]
        for cone, column in zip(cones, columns, strict=True):
            depth = _inside(points @ column, *table.shape[cone])
            inside = depth if inside is None else np.maximum(inside, depth, out=inside)
    return inside.sum(axis=0) * (table.volumes[part] / len(points))


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
