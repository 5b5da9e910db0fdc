"""Double occupancy: how much of each body part lies inside other parts (Canton 2009, Eq. 6.12 and 6.14).

`exact_overlap` rasterises every particle's flesh and counts the voxels that more than one part takes. `quick_overlap` tests
some points of each piece of the body against the truncated cones of the others: the volume that two pieces share is the same
seen from either, so each pair is tested once, with the points of the smaller, and only in the particles in which capsules
around the two come near each other. Where one piece hangs on the other, the volume depends on its direction alone (limbs are
round), so it is looked up in a table over the sphere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.pose.body.flesh import FleshTable, place_points
from hmc.pose.body.joints import SEGMENTS
from hmc.pose.body.model import PARTS, BodyModel, Cones

__all__ = ["OverlapTable", "exact_overlap", "make_overlap_table", "quick_overlap"]

#: Points tested a piece: more hardly raise the correlation with the exact count, .99 over a first layer's particles.
TEST_POINTS = 16
#: Points tested for the tables of joints, and nodes along each side of such a table: some 6 degrees apart.
JOINT_POINTS = 256
JOINT_NODES = 33


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
    radius : ndarray of float32, shape (k, 2)
        Of the capsule at its ends, metres.
    volume : ndarray, shape (k,)
        Of the piece, cubic metres.
    cone_axes, cone_radius, cone_segment : ndarray
        Likewise of each cone.
    first, second : ndarray of int, shape (n_pairs,)
        Pairs of a piece and a cone of a larger piece of another part that do not share a joint.
    joints : ndarray of int, shape (n_joints, 2)
        Pairs of pieces that do: the one that hangs, and the one on which it hangs.
    joint_axes : ndarray of float32, shape (n_joints, 3)
        Direction of the first, its segment's frame.
    joint_volumes : ndarray of float32, shape (n_joints, g, g)
        Volume that they share, cubic metres, over the octahedral map of that direction in the second's frame.
    cone_part : ndarray of int, shape (n_cones,)
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
    cone_axes: np.ndarray
    cone_radius: np.ndarray
    cone_segment: np.ndarray
    first: np.ndarray
    second: np.ndarray
    joints: np.ndarray
    joint_axes: np.ndarray
    joint_volumes: np.ndarray
    cone_part: np.ndarray
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
    cone_axes, cone_radius = _capsules(cones, [np.array([cone]) for cone in range(len(cones.part))], flesh.spacing_m / 2)
    axes, radius = _capsules(cones, pieces, 0.0)

    part_volume = np.bincount(flesh.part, minlength=len(PARTS)) * flesh.spacing_m**3
    cone_volume = np.pi * cones.lengths * cones.radii.mean(1).prod(1)
    volume = np.array([cone_volume[piece].sum() for piece in pieces])
    # Cones of a part overlap a little; the pieces are to make up the part.
    volume *= (part_volume / np.bincount(part, volume, len(PARTS)))[part]
    hangs = [SEGMENTS[segment[a]].parent if a == 0 or segment[a] != segment[a - 1] else -1 for a in range(len(pieces))]
    joints = np.array([(a, b) for a in range(len(pieces)) for b in range(len(pieces)) if hangs[a] == segment[b] and part[a] != part[b]])
    by_volume = np.argsort(volume, kind="stable")
    apart = [
        (a, b)
        for place, a in enumerate(by_volume)
        for b in by_volume[place + 1 :]
        if part[a] != part[b] and not np.any(np.all(np.sort(joints) == np.sort([a, b]), axis=1))
    ]
    pairs = np.array([(a, cone) for a, b in apart for cone in pieces[b]])

    scale = 1 / flesh.spacing_m
    mean_radii = cones.radii.mean(axis=1) * scale
    to_cone = np.empty((len(cones.part), 3, 4))
    to_cone[:, :, :3] = cones.bases * scale
    to_cone[:, :2, :3] *= (np.sqrt(mean_radii.prod(axis=1, keepdims=True)) / mean_radii)[:, :, None]
    to_cone[:, :, 3] = -np.einsum("cij,cj->ci", to_cone[:, :, :3], (cones.start + cones.end) / 2)
    ends = np.sqrt(cones.radii.prod(axis=2)) * scale
    length = cones.lengths * scale
    joint_axes = axes[joints[:, 0], 1, :3] - axes[joints[:, 0], 0, :3]
    joint_axes /= np.linalg.norm(joint_axes, axis=1, keepdims=True)
    table = OverlapTable(
        part=part,
        segment=segment,
        cones=tuple(pieces),
        points=np.stack([_test_points(cones, piece, test_points) for piece in pieces]),
        axes=axes,
        radius=radius,
        volume=volume,
        cone_axes=cone_axes,
        cone_radius=cone_radius,
        cone_segment=cones.segment,
        first=pairs[:, 0],
        second=pairs[:, 1],
        joints=joints,
        joint_axes=joint_axes.astype(np.float32),
        joint_volumes=np.zeros((len(joints), JOINT_NODES, JOINT_NODES), np.float32),
        cone_part=cones.part,
        to_cone=to_cone.astype(np.float32),
        shape=np.stack([ends.mean(axis=1), (ends[:, 1] - ends[:, 0]) / length, length / 2], axis=1).astype(np.float32),
        part_volume=part_volume,
    )
    dense = np.stack([_test_points(cones, piece, JOINT_POINTS) for piece in pieces])
    volumes = [
        _joint_volumes(table, dense, i, pieces[j], axis, cones.across[pieces[i][0]], body.offsets[segment[i]])
        for (i, j), axis in zip(joints, joint_axes, strict=True)
    ]
    return replace(table, joint_volumes=np.array(volumes, np.float32))


def _joint_volumes(
    table: OverlapTable, points: np.ndarray, i: int, cones: np.ndarray, axis: np.ndarray, across: np.ndarray, offset: np.ndarray
) -> np.ndarray:
    """Volume that a piece shares with the cones on which it hangs, over its direction, shape (g, g)."""
    nodes = np.linspace(-1, 1, JOINT_NODES)
    x, y = np.meshgrid(nodes, nodes, indexing="ij")
    z = 1 - np.abs(x) - np.abs(y)
    fold_x, fold_y = (1 - np.abs(y)) * np.copysign(1, x), (1 - np.abs(x)) * np.copysign(1, y)
    directions = np.stack([np.where(z < 0, fold_x, x), np.where(z < 0, fold_y, y), z], axis=-1).reshape(-1, 3)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    placed = np.empty((3, 4, len(directions)), np.float32)
    placed[:, :3] = (_frames(directions, across) @ _frames(axis[None], across)[0].T).transpose(1, 2, 0)
    placed[:, 3] = offset[:, None]
    still = np.zeros_like(placed)
    still[:, :3] = np.eye(3)[:, :, None]
    each = [_shared(table, points, np.array([i]), np.array([cone]), [len(directions)], placed.copy(), still) for cone in cones]
    return np.sum(each, axis=0).reshape(x.shape)


def _frames(directions: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Rotations whose third axis is each direction and whose first is as near to `across` as can be, shape (k, 3, 3)."""
    aside = np.where(np.abs(directions @ across)[:, None] > 0.999, np.roll(across, 1), across)
    first = aside - np.sum(aside * directions, axis=1, keepdims=True) * directions
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directions, first), directions], axis=-1)


def _pieces(cones: Cones) -> list[np.ndarray]:
    """Runs of cones of one part and one segment that point the same way."""
    axes = (cones.end - cones.start) / cones.lengths[:, None]
    follows = (np.diff(cones.part) == 0) & (np.diff(cones.segment) == 0) & (np.abs(np.sum(axes[1:] * axes[:-1], axis=1)) > 0.8)
    return np.split(np.arange(len(cones.part)), np.flatnonzero(~follows) + 1)


def _capsules(cones: Cones, pieces: list[np.ndarray], margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Axes, shape (k, 2, 4), and radii at their ends, shape (k, 2), of tapered capsules that hold runs of cones and a margin."""
    axes, radii = np.ones((len(pieces), 2, 4), np.float32), np.empty((len(pieces), 2), np.float32)
    for index, piece in enumerate(pieces):
        start, end = cones.start[piece[0]], cones.end[piece[-1]]
        axes[index, :, :3] = start, end
        knots, widths = np.concatenate([cones.start[piece], cones.end[piece]]), cones.radii[piece].max(2).T.ravel()
        along = np.clip((knots - start) @ (end - start) / np.sum((end - start) ** 2), 0, 1)
        off_axis = np.linalg.norm(knots - start - along[:, None] * (end - start), axis=1)
        tapered = (1 - along) * widths[0] + along * widths[-1]
        radii[index] = widths[[0, -1]] + np.max(off_axis + widths - tapered) + margin
    # The surface of a taper is not nearest right beside the axis; for a body's slopes that is a hundredth.
    return axes, radii * np.float32(1.01)


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


def quick_overlap(table: OverlapTable, placed: np.ndarray) -> np.ndarray:
    """Estimate of the fraction of each part inside other parts.

    Parameters
    ----------
    table : OverlapTable
    placed : ndarray of float32, shape (11, 3, 4, n)
        From `hmc.pose.annealed.placing.place_segments`.

    Returns
    -------
    ndarray, shape (n, n_parts)
    """
    n = placed.shape[-1]
    shared = np.zeros((len(PARTS), n))
    for (i, j), volume in zip(table.joints, _at_joints(table, placed), strict=True):
        shared[table.part[i]] += volume
        shared[table.part[j]] += volume
    pairs, near = _near(table, placed)
    segments = table.cone_segment[table.second[pairs]]
    for segment in np.unique(segments):
        # All that is tested against cones of one segment goes side by side: fewer and longer rows.
        members = np.flatnonzero(segments == segment)
        which = [np.flatnonzero(here) for here in near[members]]
        pieces, cones = table.first[pairs[members]], table.second[pairs[members]]
        one = np.concatenate([placed[table.segment[i]][:, :, w] for i, w in zip(pieces, which, strict=True)], axis=2)
        other = np.take(placed[segment], np.concatenate(which), axis=2)
        volume = _shared(table, table.points, pieces, cones, [w.size for w in which], one, other)
        stop = 0
        for i, cone, w in zip(pieces, cones, which, strict=True):
            start, stop = stop, stop + w.size
            shared[table.part[i], w] += volume[start:stop]
            shared[table.cone_part[cone], w] += volume[start:stop]
    return np.minimum(shared / table.part_volume[:, None], 1).T


def _at_joints(table: OverlapTable, placed: np.ndarray) -> np.ndarray:
    """Volume shared across each joint, shape (n_joints, n), between the table's nodes by bilinear interpolation."""
    hanging, holding = table.segment[table.joints].T
    world = (table.joint_axes[:, None, None] @ placed[hanging][:, :, :3])[:, :, 0]
    x, y, z = np.moveaxis(np.add.reduce(placed[holding][:, :, :3] * world[:, :, None], axis=1), 1, 0)
    size = np.abs(x) + np.abs(y) + np.abs(z)
    x /= size
    y /= size
    back = z < 0
    x, y = (
        np.where(back, np.copysign(1 - np.abs(y), x), x),
        np.where(back, np.copysign(1 - np.abs(x), y), y),
    )
    cells = table.joint_volumes.shape[-1] - 1
    x, y = (x + 1) * np.float32(cells / 2), (y + 1) * np.float32(cells / 2)
    i, j = (np.clip(v.astype(np.int64), 0, cells - 1) for v in (x, y))
    x -= i
    y -= j
    corner = i * (cells + 1) + j + np.arange(len(table.joints))[:, None] * (cells + 1) ** 2
    values = table.joint_volumes.ravel()
    near_side = values.take(corner) * (1 - y) + values.take(corner + 1) * y
    far_side = values.take(corner + cells + 1) * (1 - y) + values.take(corner + cells + 2) * y
    return near_side * (1 - x) + far_side * x


def _near(table: OverlapTable, placed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs whose capsules touch in some particle, shape (m,), and in which they do, shape (m, n).

    The distance of two line segments, by Ericson (2005), Real-Time Collision Detection, section 5.1.9, for the pairs whose
    boxes around all particles touch, and then their spheres.
    """
    axes, radius = np.concatenate([table.axes, table.cone_axes]), np.concatenate([table.radius, table.cone_radius])
    segments = np.concatenate([table.segment, table.cone_segment])
    ends = np.empty((3, len(axes), 2, placed.shape[-1]), np.float32)
    for segment in range(len(placed)):
        here = np.flatnonzero(segments == segment)
        ends[:, here] = (axes[here].reshape(-1, 4) @ placed[segment]).reshape(3, len(here), 2, -1)
    first, second = table.first, table.second + len(table.axes)
    start, axis = ends[:, :, 0], ends[:, :, 1] - ends[:, :, 0]
    squared = np.sum((axes[:, 1] - axes[:, 0]) ** 2, axis=1)
    widest = radius.max(axis=1)
    centre, sphere = start + axis * np.float32(0.5), np.sqrt(squared) / 2 + widest
    low, high = centre.min(2) - sphere, centre.max(2) + sphere
    pairs = np.flatnonzero(np.all((low[:, first] < high[:, second]) & (high[:, first] > low[:, second]), axis=0))
    between = centre[:, first[pairs]]
    between -= centre[:, second[pairs]]
    touching = _dot(between, between) < ((sphere[first] + sphere[second]) ** 2)[pairs, None]
    pairs = pairs[np.any(touching, axis=1)]

    i, j = first[pairs], second[pairs]
    apart, axis_i, axis_j = start[:, i] - start[:, j], axis[:, i], axis[:, j]
    a, e = squared[i, None], squared[j, None]
    b, c, f = _dot(axis_i, axis_j), _dot(axis_i, apart), _dot(axis_j, apart)
    s = np.clip((b * f - c * e) / np.maximum(a * e - b * b, np.float32(1e-9)), 0, 1)
    t = np.clip((b * s + f) / e, 0, 1)
    s = np.clip((b * t - c) / a, 0, 1)
    apart += axis_i * s
    apart -= axis_j * t
    reach = s * (radius[i, 1] - radius[i, 0])[:, None] + t * (radius[j, 1] - radius[j, 0])[:, None]
    reach += (radius[i, 0] + radius[j, 0])[:, None]
    touch = _dot(apart, apart) < reach * reach
    some = np.any(touch, axis=1)
    return pairs[some], touch[some]


def _dot(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Dot products of vectors along the first axis, of length 3."""
    total = first[0] * second[0]
    total += first[1] * second[1]
    total += first[2] * second[2]
    return total


def _shared(
    table: OverlapTable,
    points: np.ndarray,
    pieces: np.ndarray,
    cones: np.ndarray,
    sizes: list[int],
    one: np.ndarray,
    other: np.ndarray,
) -> np.ndarray:
    """Volume that pieces share with cones of one segment, cubic metres, shape (n,).

    The columns of `one`, shape (3, 4, n), are the pieces' transforms, `sizes` of them for each pair of a piece and a cone in
    turn; `other` are the transforms of the segment.
    """
    one[:, 3] -= other[:, 3]
    relative = other[0, :3, None] * one[0]
    for axis in (1, 2):
        relative += other[axis, :3, None] * one[axis]
    coordinates = np.empty((3, points.shape[1], one.shape[-1]), np.float32)
    stop = 0
    for i, cone, size in zip(pieces, cones, sizes, strict=True):
        start, stop = stop, stop + size
        columns = table.to_cone[cone, :, :3] @ relative[:, :, start:stop].swapaxes(0, 1)
        columns[3] += table.to_cone[cone, :, 3:]
        np.matmul(points[i], columns.swapaxes(0, 1), out=coordinates[:, :, start:stop])

    # How much each point counts: from 0 half a voxel outside the cone to 1 half a voxel inside.
    radius, slope, half_length = np.repeat(table.shape[cones], sizes, axis=0).T
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
    np.clip(depth, 0, 1, out=depth)
    return depth.sum(axis=0) * np.repeat(table.volume[pieces] / points.shape[1], sizes)


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
