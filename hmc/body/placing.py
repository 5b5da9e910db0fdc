"""Forward kinematics for many particles at once, with the particles along the last axis and in single precision.

`hmc.body.kinematics.segment_transforms` is the reference and the one to use elsewhere; this form is several times
quicker, as every step is arithmetic on whole rows, and what it gives is what the scores multiply points with.
"""

from __future__ import annotations

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.body.kinematics import SEGMENT_DOFS
from hmc.body.model import BodyModel

__all__ = ["place_segments"]

#: The two columns of a frame that change when it is turned about one of its own axes.
_TURNED = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}


def _alike() -> list[tuple[np.ndarray, np.ndarray, str]]:
    """Segments that go through the same steps, such as both shanks: their places, those of their parents, and their axes.

    Parents come before children; the root is left out.
    """
    depth = [0] * len(SEGMENTS)
    for index, segment in enumerate(SEGMENTS):
        depth[index] = 0 if segment.parent < 0 else depth[segment.parent] + 1
    keys = sorted({(depth[index], segment.axes) for index, segment in enumerate(SEGMENTS) if segment.parent >= 0})
    groups = [[index for index, segment in enumerate(SEGMENTS) if (depth[index], segment.axes) == key] for key in keys]
    return [
        (np.array(group), np.array([SEGMENTS[index].parent for index in group]), axes)
        for group, (_, axes) in zip(groups, keys, strict=True)
    ]


_ALIKE = _alike()


def place_segments(body: BodyModel, states: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Where every rigid segment is in every particle.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 27)
        Metres and radians.
    origin : ndarray, shape (3,)
        Somewhere near, world, metres: positions are counted from here, as single precision is coarse far from its zero.

    Returns
    -------
    ndarray of float32, shape (11, 3, 4, n)
        Rotation (world from segment) and position side by side.
    """
    states = np.asarray(states, float)
    angles = states[:, 3:].T.astype(np.float32)
    cos, sin = np.cos(angles), np.sin(angles)
    placed = np.empty((len(SEGMENTS), 3, 4, len(states)), np.float32)
    root = placed[:1]
    root[0, :, :3] = np.eye(3)[:, :, None]
    root[0, :, 3] = (states[:, :3] - origin).T
    _turn(root, np.array([0]), SEGMENTS[0].axes, cos, sin)
    for group, parents, axes in _ALIKE:
        frames = placed[parents]
        offsets = body.offsets[group].astype(np.float32)
        for axis in np.flatnonzero(offsets.any(axis=0)):
            frames[:, :, 3] += frames[:, :, axis] * offsets[:, axis, None, None]
        _turn(frames, group, axes, cos, sin)
        placed[group] = frames
    return placed


def _turn(frames: np.ndarray, group: np.ndarray, axes: str, cos: np.ndarray, sin: np.ndarray) -> None:
    """Turn the frames of some segments, shape (g, 3, 4, n), about their own axes in turn, in place."""
    for place, name in enumerate(axes):
        dofs = [SEGMENT_DOFS[index][place] - 3 for index in group]
        c, s = cos[dofs, None], sin[dofs, None]
        first, second = (frames[:, :, column] for column in _TURNED[name])
        ahead = c * first
        ahead += s * second
        second *= c
        second -= s * first
        first[...] = ahead
