"""Forward kinematics over arrays of states, and the twists of its joints. Canton (2009), Eq. 6.1 and appendix A.

A joint's transform is the product of the exponential maps of its axes, ordered from the root outwards; written in the
parent's frame that is a rotation about the joint's centre, which is what is computed here (a test holds it against
`hmc.body.twists.chain_map`, which is Eq. A.10 in general).

There is one form for many states, `_place`: states lie along the last axis, so that every step is arithmetic on whole rows, and
all segments of one depth in the tree are turned at once. The public functions differ in precision and in the order of axes alone. Of one
state, which a refinement asks for thousands of times, the same arithmetic takes half of the time number by number (`_place_one`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from hmc.body.joints import DOF_NAMES, N_DOF, SEGMENTS
from hmc.body.model import BodyModel
from hmc.body.proportions import landmark_segments

__all__ = [
    "SEGMENT_DOFS",
    "dof_masks",
    "joint_twists",
    "landmark_masks",
    "landmarks",
    "place_segments",
    "point_motions",
    "segment_transforms",
]

_LANDMARK_SEGMENTS = landmark_segments()
#: Places in the state of each segment's angles.
SEGMENT_DOFS: tuple[tuple[int, ...], ...] = tuple(tuple(DOF_NAMES.index(name) for name in one.angles) for one in SEGMENTS)
#: The segment at whose joint each angle turns, shape (34,).
_SEGMENT_OF_ANGLE = np.array([next(k for k, dofs in enumerate(SEGMENT_DOFS) if place in dofs) for place in range(3, N_DOF)])

#: Segments by their depth in the tree; within a depth, those that turn about one axis stand side by side.
_DEPTHS = (
    ("pelvis",),
    ("torso", "r_thigh", "l_thigh"),
    ("chest", "r_shank", "l_shank"),
    ("head", "r_clavicle", "l_clavicle"),
    ("r_upper_arm", "l_upper_arm", "r_foot", "l_foot"),
    ("r_forearm", "l_forearm"),
)
_UNIT = np.eye(3)
#: Columns of a frame that change when it is turned about one of its own axes, and the same exchanged.
_TURNED = {"x": (slice(1, 3), slice(2, 0, -1)), "y": (slice(2, None, -2), slice(0, 3, 2)), "z": (slice(0, 2), slice(1, None, -1))}


@dataclass(frozen=True)
class _Turn:
    """Turns of some segments of one depth about one of their axes: places in the order of `_DEPTHS`, and in that of the turns."""

    segments: slice
    angles: slice
    axis: int
    columns: slice
    exchanged: slice


@dataclass(frozen=True)
class _Depth:
    """Segments of one depth: places of themselves and of their parents in the order of `_DEPTHS`; the root has no parent."""

    segments: slice
    parents: np.ndarray
    turns: tuple[_Turn, ...]


def _plan() -> tuple[tuple[_Depth, ...], np.ndarray, np.ndarray]:
    """The tree by depth, the segments in that order, and the degrees of freedom in the order of the turns."""
    names = [segment.name for segment in SEGMENTS]
    order = [names.index(name) for depth in _DEPTHS for name in depth]
    depths: list[_Depth] = []
    dofs: list[int] = []
    start = 0
    for members in _DEPTHS:
        own = order[start : start + len(members)]
        turns = []
        for axis in "zyx" if start == 0 else "xyz":
            which = [k for k, index in enumerate(own) if axis in SEGMENTS[index].axes]
            if not which:
                continue
            moved = [SEGMENT_DOFS[index][SEGMENTS[index].axes.index(axis)] for index in own[which[0] : which[-1] + 1]]
            turns.append(
                _Turn(
                    slice(start + which[0], start + which[-1] + 1),
                    slice(len(dofs), len(dofs) + len(moved)),
                    "xyz".index(axis),
                    *_TURNED[axis],
                )
            )
            dofs += moved
        parents = np.array([order.index(SEGMENTS[index].parent) for index in own if SEGMENTS[index].parent >= 0], int)
        depths.append(_Depth(slice(start, start + len(members)), parents, tuple(turns)))
        start += len(members)
    return tuple(depths), np.array(order), np.array(dofs)


_TREE, _ORDER, _TURN_DOFS = _plan()
_SEGMENT_PLACES, _TURN_PLACES = np.argsort(_ORDER), np.argsort(_TURN_DOFS)


def _place(body: BodyModel, states: np.ndarray, origin: np.ndarray | float, dtype: DTypeLike) -> np.ndarray:
    """Frames of all segments, shape (16, 3, 4, n): rotation (world from segment) and position, from `origin`, side by side.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 37)
    origin : ndarray, shape (3,), or 0
    dtype : data type
    """
    angles = states.T.take(_TURN_DOFS, axis=0).astype(dtype, copy=False)
    cos, sin = np.cos(angles)[:, None, None], np.empty((len(angles), 1, 2, len(states)), dtype)
    np.sin(angles, out=sin[:, 0, 0])
    np.negative(sin[:, 0, 0], out=sin[:, 0, 1])
    offsets = body.offsets.take(_ORDER, axis=0).astype(dtype, copy=False)[:, None, :, None]
    placed = np.empty((len(SEGMENTS), 3, 4, len(states)), dtype)
    placed[0, :, :3] = _UNIT[:, :, None]
    placed[0, :, 3] = (states[:, :3] - origin).T
    for depth in _TREE:
        frames = placed[depth.segments]
        if len(depth.parents):
            placed[: depth.segments.start].take(depth.parents, axis=0, out=frames, mode="clip")
            position, shift = frames[:, :, 3], frames[:, :, :3] * offsets[depth.segments]
            for axis in range(3):
                position += shift[:, :, axis]
        for turn in depth.turns:
            # The first column becomes cos * first + sin * second, the second cos * second - sin * first.
            changed = placed[turn.segments, :, turn.exchanged] * sin[turn.angles]
            changed += placed[turn.segments, :, turn.columns] * cos[turn.angles]
            placed[turn.segments, :, turn.columns] = changed
    return placed.take(_SEGMENT_PLACES, axis=0)


@dataclass(frozen=True)
class _Own:
    """A segment in the order of `_DEPTHS`: its parent there, and of each turn its place, its axis, and the two columns that it changes."""

    parent: int
    turns: tuple[tuple[int, int, int, int], ...]


def _segment_plan() -> tuple[_Own, ...]:
    """`_TREE` segment by segment."""
    parents = [-1]
    turns: list[list[tuple[int, int, int, int]]] = [[] for _ in SEGMENTS]
    for depth in _TREE:
        parents += depth.parents.tolist()
        for turn in depth.turns:
            first, second = range(3)[turn.columns]
            for segment, angle in zip(range(len(SEGMENTS))[turn.segments], range(N_DOF)[turn.angles], strict=True):
                turns[segment].append((angle, turn.axis, first, second))
    return tuple(_Own(parent, tuple(own)) for parent, own in zip(parents, turns, strict=True))


_SEGMENTS = _segment_plan()


def _place_one(body: BodyModel, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`_place` of one state from the world's origin in double precision, the same to the last digit: shapes (16, 3, 4) and (34, 3)."""
    angles = state.take(_TURN_DOFS)
    cos, sin, offsets = np.cos(angles).tolist(), np.sin(angles).tolist(), body.offsets.take(_ORDER, axis=0).tolist()
    x, y, z = state[:3].tolist()
    frames: list[list[list[float]]] = []
    axes: list[list[float]] = [[]] * len(angles)
    for own, (a, b, c) in zip(_SEGMENTS, offsets, strict=True):
        if own.parent < 0:
            rows = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]]
        else:
            rows = [[u, v, w, p + u * a + v * b + w * c] for u, v, w, p in frames[own.parent]]
        for angle, axis, i, j in own.turns:
            axes[angle] = [row[axis] for row in rows]
            turned, across = cos[angle], sin[angle]
            for row in rows:
                first, second = row[i], row[j]
                row[i], row[j] = first * turned + second * across, second * turned - first * across
        frames.append(rows)
    return np.array(frames).take(_SEGMENT_PLACES, axis=0), np.array(axes)


def place_segments(body: BodyModel, states: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Where every rigid segment is in every particle, particles last and in single precision.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 37)
        Metres and radians.
    origin : ndarray, shape (3,)
        Somewhere near, world, metres: positions are counted from here, as single precision is coarse far from its zero.

    Returns
    -------
    ndarray of float32, shape (16, 3, 4, n)
        Rotation (world from segment) and position side by side.
    """
    return _place(body, np.asarray(states, float), origin, np.float32)


def segment_transforms(body: BodyModel, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where every rigid segment is.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (..., 37)
        Metres and radians, in the order of `hmc.body.joints.DOF_NAMES`.

    Returns
    -------
    rotations : ndarray, shape (..., 16, 3, 3)
        World from segment.
    positions : ndarray, shape (..., 16, 3)
        The segments' joints in the world, metres.
    """
    states = np.asarray(states, float)
    placed = np.moveaxis(_place(body, states.reshape(-1, N_DOF), 0.0, float), -1, 0).reshape(*states.shape[:-1], len(SEGMENTS), 3, 4)
    return np.ascontiguousarray(placed[..., :3]), np.ascontiguousarray(placed[..., 3])


def landmarks(body: BodyModel, states: np.ndarray) -> np.ndarray:
    """The fifteen landmarks of every state.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (..., 37)

    Returns
    -------
    ndarray, shape (..., 15, 3)
        World, metres, in the order of `hmc.landmarks.LANDMARKS`.
    """
    rotations, positions = segment_transforms(body, states)
    tips = (rotations[..., _LANDMARK_SEGMENTS, :, :] @ body.tips[..., None])[..., 0]
    return positions[..., _LANDMARK_SEGMENTS, :] + tips


def joint_twists(body: BodyModel, state: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Axis and centre of every degree of freedom in the world: a point p of a moved segment has ``dp/dtheta = axis x (p - centre)``.

    Source: Canton (2009), Eq. A.1.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)

    Returns
    -------
    axes : ndarray, shape (37, 3)
        Unit axes; for the three translations the direction of motion.
    centres : ndarray, shape (37, 3)
        A point of each axis, metres.
    rotations, positions : ndarray
        As from `segment_transforms`, for this one state.
    """
    state = np.asarray(state, float)
    placed, directions = _place_one(body, state)
    rotations, positions = placed[:, :, :3].copy(), placed[:, :, 3].copy()
    axes, centres = np.empty((2, N_DOF, 3))
    axes[:3], centres[:3] = _UNIT, 0
    directions.take(_TURN_PLACES, axis=0, out=axes[3:], mode="clip")
    positions.take(_SEGMENT_OF_ANGLE, axis=0, out=centres[3:], mode="clip")
    return axes, centres, rotations, positions


def point_motions(axes: np.ndarray, centres: np.ndarray, places: np.ndarray, masks: np.ndarray) -> np.ndarray:
    """How points of segments move with the degrees of freedom, shape (k, 3, 37): axis x (p - centre). Canton (2009), Eq. A.1.

    Parameters
    ----------
    axes, centres : ndarray, shape (37, 3)
        As from `joint_twists`.
    places : ndarray, shape (k, 3)
        Of the points, world, metres.
    masks : ndarray of float, shape (k, 37)
        Which degrees of freedom move each, 1 or 0.
    """
    # Coordinate by coordinate: `numpy.cross` takes several times as long.
    (x, y, z), (u, v, w) = axes.T, (places[:, None] - centres).transpose(2, 0, 1)
    motions = np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)
    motions[:, :, :3] = _UNIT
    motions *= masks[:, None]
    return motions


def dof_masks() -> np.ndarray:
    """Which degrees of freedom move which segments, shape (16, 37), bool."""
    masks = np.zeros((len(SEGMENTS), N_DOF), bool)
    masks[:, :3] = True
    for index, segment in enumerate(SEGMENTS):
        if segment.parent >= 0:
            masks[index] = masks[segment.parent]
        masks[index, list(SEGMENT_DOFS[index])] = True
    return masks


def landmark_masks(body: BodyModel) -> np.ndarray:
    """Which degrees of freedom move which landmarks, shape (15, 37), bool: a knee is not moved by its own angle."""
    masks, at_joint = dof_masks(), np.linalg.norm(body.tips, axis=1) < 1e-9
    carriers = [
        SEGMENTS[k].parent if still and SEGMENTS[k].parent >= 0 else k for k, still in zip(_LANDMARK_SEGMENTS, at_joint, strict=True)
    ]
    return masks[carriers]
