"""Where the points that 2-D keypoint detectors find are on a body: joint centres, nose and ears, as places on its segments.

A detector's "hip" is no hip centre, and each detector's is another: what is constant in the difference is learnt from the recording
(`hmc.pose.keypoint_cues`). Feet are left out: a body without ankles cannot say where toes are.
"""

from __future__ import annotations

import numpy as np

from hmc.body.joints import SEGMENTS
from hmc.body.model import PART_OF_SEGMENT, BodyModel
from hmc.body.proportions import landmark_segments
from hmc.landmarks import LANDMARKS

__all__ = ["BODY_KEYPOINTS", "KEYPOINT_PART", "KEYPOINT_SEGMENTS", "MIRRORED", "keypoint_places", "place_keypoints"]

_JOINTS = tuple(f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle"))
#: On the head's segment, over stature: forward, to the left, and up from the base of the neck. A nose is about 13 cm below the crown and
#: 10 cm before the middle of the skull, the tragus of an ear as low and 7 cm to the side (adults' medians, NASA-STD-3000, section 3).
_FACE: dict[str, tuple[float, float, float]] = {
    "nose": (0.075, 0.0, 0.070), "l_ear": (0.018, 0.042, 0.072), "r_ear": (0.018, -0.042, 0.072),
}  # fmt: skip
#: What a body can say the place of, by the names of `hmc.io.keypoints`.
BODY_KEYPOINTS: tuple[str, ...] = (*_JOINTS, *_FACE)
_HEAD = next(k for k, segment in enumerate(SEGMENTS) if segment.name == "head")
_ENDS = np.array([LANDMARKS.index(name) for name in _JOINTS])
#: Joints at which a segment begins go with the segment before it, on which a detector's idea of them does not turn.
_BEGINS = np.array([not name.endswith(("wrist", "ankle")) for name in _JOINTS])
_AFTER = landmark_segments()[_ENDS]
_CARRIERS = np.where(_BEGINS, [SEGMENTS[k].parent for k in _AFTER], _AFTER)
#: The segment that carries each, shape (15,).
KEYPOINT_SEGMENTS = np.r_[_CARRIERS, np.full(len(_FACE), _HEAD)]
#: Its part, a place in `hmc.body.model.PARTS`.
KEYPOINT_PART = PART_OF_SEGMENT[KEYPOINT_SEGMENTS]


def _mirrored(name: str) -> str:
    return {"l": "r", "r": "l"}[name[0]] + name[1:] if name[1] == "_" else name


#: The same point of the other side.
MIRRORED = np.array([BODY_KEYPOINTS.index(_mirrored(name)) for name in BODY_KEYPOINTS])


def keypoint_places(body: BodyModel) -> np.ndarray:
    """Where each of `BODY_KEYPOINTS` is on its segment, shape (15, 3), metres."""
    face = np.array(list(_FACE.values())) * body.height_m
    return np.concatenate([np.where(_BEGINS[:, None], body.offsets[_AFTER], body.tips[_ENDS]), face])


def place_keypoints(rotations: np.ndarray, positions: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Keypoints in the world, shape (..., 15, 3), metres.

    Parameters
    ----------
    rotations, positions : ndarray, shape (..., 16, 3, 3) and (..., 16, 3)
        As from `hmc.body.kinematics.segment_transforms`.
    local : ndarray, shape (15, 3)
        On their segments: `keypoint_places`, or what lies beside them.
    """
    return positions[..., KEYPOINT_SEGMENTS, :] + (rotations[..., KEYPOINT_SEGMENTS, :, :] @ local[..., None])[..., 0]
