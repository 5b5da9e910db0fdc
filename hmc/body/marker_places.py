"""Where markers sit on a body: at its landmarks, or on the skin beside them.

A marker is a landmark of the body that lies elsewhere: a body with markers is the same body with other `tips`, so that forward
kinematics (`hmc.body.kinematics.landmarks`) gives the markers and inverse kinematics takes them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.body.kinematics import place_segments, segment_transforms
from hmc.body.model import BodyModel
from hmc.body.proportions import landmark_segments
from hmc.landmarks import LANDMARKS

__all__ = ["SKIN_OFFSETS", "fit_tips", "place_tips", "with_skin_markers"]

_SEGMENTS = landmark_segments()

#: From landmark to marker in the frame of the segment that carries it, over stature; of the left side, mirrored for the right one. Belt
#: buckle, last vertebra of the neck, crown, on top of the shoulder, outside of the elbow, back of the wrist, outside of the hip, front of
#: the knee, outside of the ankle.
SKIN_OFFSETS: dict[str, tuple[float, float, float]] = {
    "pelvis": (0.068, 0.0, 0.0), "neck": (-0.034, 0.0, 0.0), "head_top": (0.0, 0.0, 0.006),
    "shoulder": (0.0, 0.0, 0.036), "elbow": (0.0, 0.0, 0.030), "wrist": (0.0, 0.0, 0.022),
    "hip": (0.0, 0.045, 0.0), "knee": (0.036, 0.0, 0.0), "ankle": (0.0, 0.024, 0.0),
}  # fmt: skip
#: A marker is never farther from the landmark of its name than this, over stature.
FARTHEST_TIP = 0.09


def with_skin_markers(body: BodyModel) -> BodyModel:
    """The body with its landmarks moved to the skin, where markers are worn (`SKIN_OFFSETS`)."""
    offsets = []
    for name in LANDMARKS:
        x, y, z = SKIN_OFFSETS[name.removeprefix("l_").removeprefix("r_")]
        offsets.append((x, -y if name.startswith("r_") else y, z))
    return replace(body, tips=body.tips + body.height_m * np.array(offsets))


def place_tips(body: BodyModel, states: np.ndarray) -> np.ndarray:
    """The markers of many particles, particles last and in single precision.

    Parameters
    ----------
    body : BodyModel
    states : ndarray, shape (n, 37)

    Returns
    -------
    ndarray of float32, shape (3, 15, n)
        World, metres.
    """
    origin = states[0, :3]
    placed = place_segments(body, states, origin)
    out = placed[_SEGMENTS, :, 3].transpose(1, 0, 2).copy()
    for axis in range(3):
        moved = np.flatnonzero(body.tips[:, axis])
        out[:, moved] += placed[_SEGMENTS[moved], :, axis].transpose(1, 0, 2) * body.tips[moved, axis, None].astype(np.float32)
    out += origin.astype(np.float32)[:, None, None]
    return out


def fit_tips(body: BodyModel, markers: BodyModel, states: np.ndarray, points: np.ndarray) -> BodyModel:
    """Move the markers to where they are worn: each to its median place in its segment's frame over some frames.

    Parameters
    ----------
    body : BodyModel
        With its landmarks as tips.
    markers : BodyModel
        The same body with markers.
    states : ndarray, shape (n, 37)
    points : ndarray, shape (n, 15, 3)
        Where the markers were seen, world, metres; NaN where not.

    Returns
    -------
    BodyModel
        `markers` with other tips; one that was seen in less than a third of the frames stays, and none leaves its joint (`FARTHEST_TIP`).
    """
    rotations, positions = segment_transforms(body, states)
    local = np.einsum("nsji,nsj->nsi", rotations[:, _SEGMENTS], points - positions[:, _SEGMENTS])
    tips = markers.tips.copy()
    for k in range(len(LANDMARKS)):
        known = np.isfinite(local[:, k]).all(axis=1)
        if 3 * known.sum() < len(states):
            continue
        offset = np.median(local[known, k], axis=0) - body.tips[k]
        tips[k] = body.tips[k] + offset * min(1.0, FARTHEST_TIP * body.height_m / max(float(np.linalg.norm(offset)), 1e-9))
    return replace(markers, tips=tips)
