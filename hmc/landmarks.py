"""The fifteen landmarks in which poses are given and compared, in one fixed order, and the points of the feet beside them."""

from __future__ import annotations

__all__ = ["BONES", "ENOUGH_VIEWS", "FOOT_POINTS", "LANDMARKS", "TRUSTED", "landmark_index"]

#: Joint centres (centres of rotation); `pelvis` is the middle of the hip centres, `neck` the base of the neck, `head_top` the crown.
LANDMARKS: tuple[str, ...] = (
    "pelvis", "neck", "head_top",
    "l_shoulder", "l_elbow", "l_wrist", "r_shoulder", "r_elbow", "r_wrist",
    "l_hip", "l_knee", "l_ankle", "r_hip", "r_knee", "r_ankle",
)  # fmt: skip

#: Ends of the soles: the rearmost point of the heel and the foremost of the toes, shoes included.
FOOT_POINTS: tuple[str, ...] = ("l_heel", "l_toe", "r_heel", "r_toe")

#: Pairs of landmarks between which a stick figure draws a line.
BONES: tuple[tuple[str, str], ...] = (
    ("pelvis", "neck"), ("neck", "head_top"),
    ("neck", "l_shoulder"), ("l_shoulder", "l_elbow"), ("l_elbow", "l_wrist"),
    ("neck", "r_shoulder"), ("r_shoulder", "r_elbow"), ("r_elbow", "r_wrist"),
    ("pelvis", "l_hip"), ("l_hip", "l_knee"), ("l_knee", "l_ankle"),
    ("pelvis", "r_hip"), ("r_hip", "r_knee"), ("r_knee", "r_ankle"),
)  # fmt: skip

#: A landmark that fewer cameras show clear of all else is a guess: one camera does not tell how far away it is.
ENOUGH_VIEWS = 2
#: A landmark that is trusted less (`hmc.pose.trust`) is doubtful: of the others 99 % are within 60 mm in the recordings of the fit.
TRUSTED = 0.9


def landmark_index(name: str) -> int:
    """Place of a landmark in `LANDMARKS`.

    Raises
    ------
    ValueError
        When there is no such landmark.
    """
    if name not in LANDMARKS:
        raise ValueError(f"no landmark named {name!r}; they are {', '.join(LANDMARKS)}")
    return LANDMARKS.index(name)
