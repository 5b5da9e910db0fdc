"""The body as pieces for the quick estimate of double occupancy: runs of cones in one line, such as a shank without its foot.

A piece is taken as a solid of revolution: a radius along an axis, with elliptic sections stretched to round ones. Points of
one piece are tested against another, so each has both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.flesh import FleshTable
from hmc.body.joints import SEGMENTS
from hmc.body.model import PARTS, BodyModel, Cones

__all__ = ["Pieces", "basis", "make_pieces", "place_pieces", "shared_volume", "spread_points"]

#: Nodes of a piece's radius along its axis.
NODES = 64


@dataclass(frozen=True)
class Pieces:
    """Runs of cones of one part in one line, ``k`` of them.

    A piece's own frame has its origin in the middle of its axis and the axis as third direction. Its shape is stored in units
    that `scale` brings its coordinates to: the flesh's spacing across, nodes along.

    Parameters
    ----------
    cones : tuple of ndarray of int
        The cones of each piece.
    part, segment : ndarray of int, shape (k,)
        The part to which a piece belongs, and the segment that carries it.
    hangs_on : ndarray of int, shape (k,)
        The piece of another part to which its joint belongs; -1 where there is none.
    frame : ndarray of float32, shape (k, 4, 4)
        Rows: the three directions and the origin of the piece's frame, homogeneous, metres, segment's frame.
    half_length : ndarray of float32, shape (k,)
        Half of the axis, metres.
    ends : ndarray of float32, shape (k, 2)
        Radii, metres, at the ends of a tapered capsule that holds the piece.
    points : ndarray of float32, shape (k, m, 4)
        Test points, homogeneous, metres, piece's frame.
    volume : ndarray, shape (k,)
        Cubic metres; the pieces of a part make up its flesh.
    part_volume : ndarray, shape (n_parts,)
    scale : ndarray of float32, shape (3, k)
    radius : ndarray of float32, shape (k, NODES)
        Farthest from the axis at which a point counts (half a spacing outside the flesh).
    along : ndarray of float32, shape (k, NODES)
        How much a point counts at most: less than 1 near the flat ends.
    spacing_m : float
        The flesh's.
    """

    cones: tuple[np.ndarray, ...]
    part: np.ndarray
    segment: np.ndarray
    hangs_on: np.ndarray
    frame: np.ndarray
    half_length: np.ndarray
    ends: np.ndarray
    points: np.ndarray
    volume: np.ndarray
    part_volume: np.ndarray
    scale: np.ndarray
    radius: np.ndarray
    along: np.ndarray
    spacing_m: float


def make_pieces(body: BodyModel, flesh: FleshTable, test_points: int) -> Pieces:
    """Divide a body into pieces.

    Parameters
    ----------
    body : BodyModel
    flesh : FleshTable
        For the volumes of the parts, and for its spacing: a point counts in full from half a voxel inside a piece.
    test_points : int
        How many points a piece.
    """
    cones, spacing = body.cones, flesh.spacing_m
    runs = _runs(cones)
    part, segment = (np.array([values[run[0]] for run in runs]) for values in (cones.part, cones.segment))
    frame, half_length = np.zeros((len(runs), 4, 4)), np.empty(len(runs))
    scale, ends = np.empty((3, len(runs))), np.empty((len(runs), 2))
    radius, along = np.empty((len(runs), NODES)), np.empty((len(runs), NODES))
    for index, run in enumerate(runs):
        start, end = cones.start[run[0]], cones.end[run[-1]]
        half_length[index] = np.linalg.norm(end - start) / 2
        frame[index, :3, :3] = basis((end - start)[None], cones.across[run[0]])[0]
        frame[index, 3] = *(start + end) / 2, 1
        ends[index] = _capsule(cones, run, frame[index], half_length[index])
        mean_radii = np.average(cones.radii[run].mean(axis=1), axis=0, weights=cones.lengths[run])
        stretch = np.sqrt(mean_radii.prod()) / mean_radii
        nodes_a_metre = NODES / 2 / (half_length[index] + spacing)
        scale[:, index] = *stretch / spacing, nodes_a_metre
        place = (np.arange(NODES) + 0.5 - NODES / 2) / nodes_a_metre
        radius[index] = _radius_at(cones, run, frame[index], place) / spacing + 0.5
        along[index] = np.clip((half_length[index] - np.abs(place)) / spacing + 0.5, 0, 1)

    part_volume = np.bincount(flesh.part, minlength=len(PARTS)) * spacing**3
    cone_volume = np.pi * cones.lengths * cones.radii.mean(1).prod(1)
    volume = np.array([cone_volume[run].sum() for run in runs])
    # Cones of a part overlap a little; the pieces are to make up the part.
    volume *= (part_volume / np.bincount(part, volume, len(PARTS)))[part]
    return Pieces(
        cones=tuple(runs),
        part=part,
        segment=segment,
        hangs_on=_hangs_on(part, segment),
        frame=frame.astype(np.float32),
        half_length=half_length.astype(np.float32),
        ends=ends.astype(np.float32),
        points=np.stack([spread_points(cones, run, frame[index], test_points) for index, run in enumerate(runs)]),
        volume=volume,
        part_volume=part_volume,
        scale=scale.astype(np.float32),
        radius=radius.astype(np.float32),
        along=along.astype(np.float32),
        spacing_m=spacing,
    )


def basis(axes: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Directions in rows, the third along each axis and the first as near to `across` as can be, shape (k, 3, 3)."""
    third = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    aside = np.where(np.abs(third @ across)[:, None] > 0.999, np.roll(across, 1), across)
    first = aside - np.sum(aside * third, axis=1, keepdims=True) * third
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(third, first), third], axis=1)


def _runs(cones: Cones) -> list[np.ndarray]:
    """Runs of cones of one part and one segment that point the same way."""
    axes = (cones.end - cones.start) / cones.lengths[:, None]
    follows = (np.diff(cones.part) == 0) & (np.diff(cones.segment) == 0) & (np.abs(np.sum(axes[1:] * axes[:-1], axis=1)) > 0.8)
    return np.split(np.arange(len(cones.part)), np.flatnonzero(~follows) + 1)


def _carrier(segment: int, with_flesh: np.ndarray) -> int:
    """The first segment from this one to the root that has flesh; -1 for none."""
    while segment >= 0 and segment not in with_flesh:
        segment = SEGMENTS[segment].parent
    return segment


def _hangs_on(part: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """For the first piece of each segment, the piece of another part that the parent segment carries; else -1."""
    out = np.full(len(part), -1)
    for piece in range(len(part)):
        holders = np.flatnonzero((segment == _carrier(SEGMENTS[segment[piece]].parent, segment)) & (part != part[piece]))
        if holders.size and (piece == 0 or segment[piece] != segment[piece - 1]):
            out[piece] = holders[0]
    return out


def _capsule(cones: Cones, run: np.ndarray, frame: np.ndarray, half_length: float) -> np.ndarray:
    """Radii at the ends, shape (2,), of the tapered capsule around a run's axis that holds it."""
    knots, widths = np.concatenate([cones.start[run], cones.end[run]]) - frame[3, :3], cones.radii[run].max(2).T.ravel()
    along = np.clip(knots @ frame[2, :3], -half_length, half_length)
    off_axis = np.linalg.norm(knots - along[:, None] * frame[2, :3], axis=1)
    share = (along / half_length + 1) / 2
    tapered = (1 - share) * widths[0] + share * widths[-1]
    # The surface of a taper is not nearest right beside the axis; for a body's slopes that is a hundredth.
    return 1.01 * (widths[[0, -1]] + np.max(off_axis + widths - tapered))


def _radius_at(cones: Cones, run: np.ndarray, frame: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Radius of a run's flesh at points along its axis: that of a circle as large as the widest cone's section there."""
    at = [(knots[run] - frame[3, :3]) @ frame[2, :3] for knots in (cones.start, cones.end)]
    radii = np.sqrt(cones.radii[run].prod(axis=2))
    # Beyond its ends a cone counts as little as can be, but where no other reaches.
    sections = [
        np.interp(place, [start, end], ends) - 10 * np.maximum(np.maximum(start - place, place - end), 0)
        for start, end, ends in zip(*at, radii, strict=True)
    ]
    return np.maximum(np.max(sections, axis=0), radii.min())


def spread_points(cones: Cones, run: np.ndarray, frame: np.ndarray, n: int) -> np.ndarray:
    """Evenly spread points of some cones, homogeneous, in the frame whose directions and origin are given, float32, shape (n, 4).

    Voxel centres would do harm here: whole layers of them lie on the plane in which two parts meet. The points are even
    along the run, where it matters most, and follow a low-discrepancy sequence across it.
    """
    knots = np.linspace(0, 1, 65)
    radii = cones.radii[run, 0, :, None] + (cones.radii[run, 1] - cones.radii[run, 0])[:, :, None] * knots
    volume = np.cumsum(radii.prod(axis=1) * cones.lengths[run, None])
    i = np.arange(n)
    place = np.interp((i + 0.5) / n, volume / volume[-1], np.arange(volume.size))
    cone = run[(place // len(knots)).astype(int)]
    along = np.clip(place % len(knots) / (len(knots) - 1), 0, 1)[:, None]
    lateral, angle = np.sqrt((0.5 + i * 0.7548776662) % 1), 2 * np.pi * ((i * 0.5698402910) % 1)
    across = np.stack([np.cos(angle), np.sin(angle)], axis=1) * lateral[:, None]
    across *= (1 - along) * cones.radii[cone, 0] + along * cones.radii[cone, 1]
    points = (1 - along) * cones.start[cone] + along * cones.end[cone]
    points += np.einsum("nk,nki->ni", across, cones.bases[cone, :2])
    return np.c_[(points - frame[3, :3]) @ frame[:3, :3].T, np.ones(n)].astype(np.float32)


def place_pieces(pieces: Pieces, placed: np.ndarray) -> np.ndarray:
    """Where every piece is in every particle.

    Parameters
    ----------
    pieces : Pieces
    placed : ndarray of float32, shape (16, 3, 4, n)
        From `hmc.body.kinematics.place_segments`.

    Returns
    -------
    ndarray of float32, shape (k, 3, 4, n)
        World coordinates (second axis) of the directions and the origin of the pieces' frames (third axis).
    """
    return pieces.frame[:, None] @ placed[pieces.segment]


def shared_volume(
    pieces: Pieces, points: np.ndarray, first: np.ndarray, second: np.ndarray, one: np.ndarray, other: np.ndarray
) -> np.ndarray:
    """Volume that pairs of pieces share, by the points of the first that lie in the second.

    Parameters
    ----------
    pieces : Pieces
    points : ndarray of float32, shape (k, m, 4)
        As `Pieces.points`.
    first, second : ndarray of int, shape (t,)
        Pairs; `first` in order.
    one, other : ndarray of float32, shape (3, 4, t)
        Their frames, as from `place_pieces`; `one` is written over.

    Returns
    -------
    ndarray of float32, shape (t,)
        Cubic metres.
    """
    one[:, 3] -= other[:, 3]
    relative = other[0, :3, None] * one[0]
    for axis in (1, 2):
        relative += other[axis, :3, None] * one[axis]
    relative *= pieces.scale.take(second, axis=1)[:, None]
    coordinates = np.empty((3, points.shape[1], len(first)), np.float32)
    runs = np.searchsorted(first, np.arange(len(points) + 1))
    for piece in np.flatnonzero(np.diff(runs)):
        members = slice(runs[piece], runs[piece + 1])
        np.matmul(points[piece], relative[:, :, members], out=coordinates[:, :, members])

    # How much each point counts: from 0 half a voxel outside the piece to 1 half a voxel inside.
    across, lateral, along = coordinates
    across *= across
    lateral *= lateral
    lateral += across
    np.sqrt(lateral, out=lateral)
    along += NODES / 2
    np.clip(along, 0, NODES - 1, out=along)
    node = along.astype(np.int32).astype(np.int64)
    node += second * NODES
    counts = pieces.radius.ravel().take(node)
    counts -= lateral
    np.maximum(counts, 0, out=counts)
    np.minimum(counts, pieces.along.ravel().take(node), out=counts)
    return counts.sum(axis=0) * (pieces.volume / points.shape[1]).astype(np.float32)[first]
