"""Which point of a detector's list is which: five common layouts, and the names that tables use.

Sources: BODY_25 and COCO-18 are the lists of OpenPose's page on its output format; COCO-17 is the keypoint list of the COCO data set;
Halpe-26 is the list of the Halpe-FullBody data set, which AlphaPose and RTMPose follow; MediaPipe's 33 are the landmarks of its pose
landmarker (BlazePose). Left and right are the person's in all of them.
"""

from __future__ import annotations

import re

import numpy as np

__all__ = ["KEYPOINTS", "LAYOUTS", "keypoint_named", "places"]

#: All points that are told apart, in the order of every array of keypoints.
KEYPOINTS: tuple[str, ...] = (
    "nose", "l_eye", "r_eye", "l_ear", "r_ear", "head_top", "neck", "pelvis",
    "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist",
    "l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle",
    "l_heel", "r_heel", "l_big_toe", "r_big_toe", "l_small_toe", "r_small_toe",
)  # fmt: skip

COCO_17 = (
    "nose", "l_eye", "r_eye", "l_ear", "r_ear", "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist",
    "l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle",
)  # fmt: skip
COCO_18 = (
    "nose", "neck", "r_shoulder", "r_elbow", "r_wrist", "l_shoulder", "l_elbow", "l_wrist",
    "r_hip", "r_knee", "r_ankle", "l_hip", "l_knee", "l_ankle", "r_eye", "l_eye", "r_ear", "l_ear",
)  # fmt: skip
BODY_25 = (
    "nose", "neck", "r_shoulder", "r_elbow", "r_wrist", "l_shoulder", "l_elbow", "l_wrist", "pelvis",
    "r_hip", "r_knee", "r_ankle", "l_hip", "l_knee", "l_ankle", "r_eye", "l_eye", "r_ear", "l_ear",
    "l_big_toe", "l_small_toe", "l_heel", "r_big_toe", "r_small_toe", "r_heel",
)  # fmt: skip
HALPE_26 = (
    *COCO_17, "head_top", "neck", "pelvis",
    "l_big_toe", "r_big_toe", "l_small_toe", "r_small_toe", "l_heel", "r_heel",
)  # fmt: skip
# None: corners of the eyes, mouth and fingers, which no body of ours has.
MEDIAPIPE_33 = (
    "nose", None, "l_eye", None, None, "r_eye", None, "l_ear", "r_ear", None, None,
    "l_shoulder", "r_shoulder", "l_elbow", "r_elbow", "l_wrist", "r_wrist", *(None,) * 6,
    "l_hip", "r_hip", "l_knee", "r_knee", "l_ankle", "r_ankle", "l_heel", "r_heel", "l_big_toe", "r_big_toe",
)  # fmt: skip

#: Name of every point of a layout (None: a point that is not used), by the layout's number of points.
LAYOUTS: dict[int, tuple[str | None, ...]] = {len(names): names for names in (COCO_17, COCO_18, BODY_25, HALPE_26, MEDIAPIPE_33)}
LAYOUT_NAMES = {17: "COCO", 18: "OpenPose's COCO", 25: "BODY_25", 26: "Halpe", 33: "MediaPipe"}

#: What other programs call them, without side, spaces and capitals.
_ALIASES = {
    "head": "head_top", "headtop": "head_top", "tophead": "head_top", "midhip": "pelvis", "hipmid": "pelvis", "hipcenter": "pelvis",
    "root": "pelvis", "hip": "pelvis", "bigtoe": "big_toe", "footindex": "big_toe", "smalltoe": "small_toe", "littletoe": "small_toe",
}  # fmt: skip
_SIDES = {"l": "l_", "left": "l_", "r": "r_", "right": "r_"}


def places(n_points: int) -> np.ndarray:
    """Where each point of a layout stands in `KEYPOINTS`, shape (n_points,); -1 for a point that is not used.

    Raises
    ------
    ValueError
        When no layout has so many points; it says which there are.
    """
    if n_points not in LAYOUTS:
        known = ", ".join(f"{n} ({LAYOUT_NAMES[n]})" for n in sorted(LAYOUTS))
        raise ValueError(f"{n_points} points a person; known are lists of {known}")
    return np.array([-1 if name is None else KEYPOINTS.index(name) for name in LAYOUTS[n_points]])


def keypoint_named(name: str) -> int:
    """Place in `KEYPOINTS` of what some program calls `LShoulder`, `left_shoulder` or `SHOULDER LEFT`; -1: none of ours."""
    # Words part at case (MidHip, LShoulder), at spaces and at signs.
    words = re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", name)
    words = [word.lower() for word in words]
    side = ""
    for place in (0, -1):
        if len(words) > 1 and words[place] in _SIDES:
            side = _SIDES[words.pop(place)]
            break
    core = "".join(words)
    for whole, short in (("left", "l_"), ("right", "r_")):
        if not side and core.startswith(whole):
            side, core = short, core.removeprefix(whole)
    # A hip without a side is the middle of both.
    full = side + (core if side and core == "hip" else _ALIASES.get(core, core))
    return KEYPOINTS.index(full) if full in KEYPOINTS else -1
