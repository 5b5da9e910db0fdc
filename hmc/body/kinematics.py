"""Forward kinematics over arrays of states, and the twists of its joints. Canton (2009), Eq. 6.1 and appendix A.

A joint's transform is the product of the exponential maps of its axes, ordered from the root outwards; written in the
parent's frame that is a rotation about the joint's centre, which is what is computed here (the test holds it against
``scipy.linalg.expm`` of the twists).
"""

from __future__ import annotations

import numpy as np

from hmc.body.joints import N_DOF, SEGMENTS
from hmc.body.model import BodyModel
from hmc.body.proportions import landmark_segments

__all__ = ["SEGMENT_DOFS", "dof_masks", "joint_twists", "landmark_masks", "landmarks", "segment_transforms"]

_LANDMARK_SEGMENTS = landmark_segments()


def _segment_dofs() -> tuple[tuple[int, ...], ...]:
    out, place = [], 3
    for segment in SEGMENTS:
        out.append(tuple(range(place, place + len(segment.axes))))
        place += len(segment.axes)
    return tuple(out)


#: Places in the state of each segment's angles.
SEGMENT_DOFS = _segment_dofs()

_AXIS = np.array(["xyz".index(axis) for segment in SEGMENTS for axis in segment.axes])


def segment_transforms(body: BodyModel, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where every rigid segment is.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (..., 27)
        Metres and radians, in the order of `hmc.body.joints.DOF_NAMES`.

    Returns
    -------
    rotations : ndarray, shape (..., 11, 3, 3)
        World from segment.
    positions : ndarray, shape (..., 11, 3)
        The segments' joints in the world, metres.
    """
    states = np.asarray(states, float)
    cos, sin = np.cos(states[..., 3:]), np.sin(states[..., 3:])
    rotations = np.empty((*states.shape[:-1], len(SEGMENTS), 3, 3))
    positions = np.empty((*states.shape[:-1], len(SEGMENTS), 3))
    for index, segment in enumerate(SEGMENTS):
        local = None
        for axis, dof in zip(segment.axes, SEGMENT_DOFS[index], strict=True):
            local = _turn(local, axis, cos[..., dof - 3], sin[..., dof - 3])
        if segment.parent < 0:
            rotations[..., index, :, :] = local
            positions[..., index, :] = states[..., :3]
        else:
            parent = rotations[..., segment.parent, :, :]
            rotations[..., index, :, :] = parent @ local
            positions[..., index, :] = positions[..., segment.parent, :] + parent @ body.offsets[index]
    return rotations, positions


def landmarks(body: BodyModel, states: np.ndarray) -> np.ndarray:
    """The fifteen landmarks of every state.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (..., 27)

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
    state : ndarray, shape (27,)

    Returns
    -------
    axes : ndarray, shape (27, 3)
        Unit axes; for the three translations the direction of motion.
    centres : ndarray, shape (27, 3)
        A point of each axis, metres.
    rotations, positions : ndarray
        As from `segment_transforms`, for this one state.
    """
    state = np.asarray(state, float)
    turns = _elementary_turns(state[3:])
    axes, centres = np.zeros((N_DOF, 3)), np.zeros((N_DOF, 3))
    rotations, positions = np.empty((len(SEGMENTS), 3, 3)), np.empty((len(SEGMENTS), 3))
    axes[:3] = np.eye(3)
    for index, segment in enumerate(SEGMENTS):
        if segment.parent < 0:
            frame, positions[index] = np.eye(3), state[:3]
        else:
            frame = rotations[segment.parent]
            positions[index] = positions[segment.parent] + frame @ body.offsets[index]
        for dof in SEGMENT_DOFS[index]:
            axes[dof] = frame[:, _AXIS[dof - 3]]
            centres[dof] = positions[index]
            frame = frame @ turns[dof - 3]
        rotations[index] = frame
    return axes, centres, rotations, positions


def _elementary_turns(angles: np.ndarray) -> np.ndarray:
    """Rotation matrix of every angle about its own axis, (24,) to (24, 3, 3)."""
    k = np.arange(len(angles))
    first, second = (_AXIS + 1) % 3, (_AXIS + 2) % 3
    cos, sin = np.cos(angles), np.sin(angles)
    out = np.zeros((len(angles), 3, 3))
    out[k, _AXIS, _AXIS] = 1.0
    out[k, first, first] = out[k, second, second] = cos
    out[k, first, second], out[k, second, first] = -sin, sin
    return out


def dof_masks() -> np.ndarray:
    """Which degrees of freedom move which segments, shape (11, 27), bool."""
    masks = np.zeros((len(SEGMENTS), N_DOF), bool)
    masks[:, :3] = True
    for index, segment in enumerate(SEGMENTS):
        if segment.parent >= 0:
            masks[index] = masks[segment.parent]
        masks[index, list(SEGMENT_DOFS[index])] = True
    return masks


def landmark_masks(body: BodyModel) -> np.ndarray:
    """Which degrees of freedom move which landmarks, shape (15, 27), bool: a knee is not moved by its own angle."""
    masks, at_joint = dof_masks(), np.linalg.norm(body.tips, axis=1) < 1e-9
    carriers = [
        SEGMENTS[k].parent if still and SEGMENTS[k].parent >= 0 else k for k, still in zip(_LANDMARK_SEGMENTS, at_joint, strict=True)
    ]
    return masks[carriers]


def _turn(frame: np.ndarray | None, axis: str, cos: np.ndarray, sin: np.ndarray) -> np.ndarray:
    """``frame`` times the rotation about one of its own axes; only two columns change."""
    first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    if frame is None:
        frame = np.broadcast_to(np.eye(3), (*np.shape(cos), 3, 3))
    out = np.array(frame)
    a, b = frame[..., :, first], frame[..., :, second]
    cos, sin = np.asarray(cos)[..., None], np.asarray(sin)[..., None]
    out[..., :, first] = cos * a + sin * b
    out[..., :, second] = cos * b - sin * a
    return out
