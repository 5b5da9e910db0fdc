"""The degrees of freedom of the body and how its rigid segments hang on one another.

The first 27 are those of Canton (2009), section 6.3.4 and Table 6.1: the root (pelvis) has three translations and three rotations; the
other 21 angles turn about axes of the parent's frame, in the order of the table. Ten more, of ours, come after them: the spine bends
between waist and chest, each shoulder girdle is raised and brought forward, and each foot is lowered and turned out. The papers' bodies
hold these at 0. Neutral pose: standing, arms stretched sideways along Y; X forward, Y to the person's left, Z up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = [
    "ADDED_JOINTS", "DOF_NAMES", "N_CANTON", "N_DOF", "SEGMENTS", "TRUNK_JOINTS", "JointLimits", "Segment", "canton_limits",
    "default_limits", "dof_index", "mirror_state", "stiff_limits",
]  # fmt: skip


@dataclass(frozen=True)
class Segment:
    """A rigid segment and the joint on which it hangs.

    Parameters
    ----------
    name : str
    parent : int
        Place of the parent in `SEGMENTS`; -1 for the root.
    joint : str
        Name of the joint; prefix of its angles' names.
    axes : str
        Axes of rotation, from the parent outwards: ``"xyz"`` means ``R = R_x R_y R_z``.
    """

    name: str
    parent: int
    joint: str
    axes: str

    @property
    def angles(self) -> tuple[str, ...]:
        """Names of its angles."""
        return tuple(f"{self.joint}_{axis if self.parent >= 0 else 'r' + axis}" for axis in self.axes)


#: Parents come before children. The root's rotation is yaw, pitch, roll: ``R = R_z R_y R_x``.
SEGMENTS: tuple[Segment, ...] = (
    Segment("pelvis", -1, "root", "zyx"),
    Segment("torso", 0, "torso", "xyz"),
    Segment("chest", 1, "spine", "xy"),
    Segment("head", 2, "neck", "xy"),
    Segment("r_clavicle", 2, "r_girdle", "xz"),
    Segment("r_upper_arm", 4, "r_shoulder", "xyz"),
    Segment("r_forearm", 5, "r_elbow", "z"),
    Segment("l_clavicle", 2, "l_girdle", "xz"),
    Segment("l_upper_arm", 7, "l_shoulder", "xyz"),
    Segment("l_forearm", 8, "l_elbow", "z"),
    Segment("r_thigh", 0, "r_hip", "xyz"),
    Segment("r_shank", 10, "r_knee", "y"),
    Segment("l_thigh", 0, "l_hip", "xyz"),
    Segment("l_shank", 12, "l_knee", "y"),
    Segment("r_foot", 11, "r_ankle", "yz"),
    Segment("l_foot", 13, "l_ankle", "yz"),
)

#: Joints of the trunk that Canton's body does not have ...
TRUNK_JOINTS: tuple[str, ...] = ("spine", "r_girdle", "l_girdle")
#: ... and all joints that it does not have; their angles come last in a state.
ADDED_JOINTS: tuple[str, ...] = (*TRUNK_JOINTS, "r_ankle", "l_ankle")

#: Names of the state's entries, in order: metres for the first three, radians for the others.
DOF_NAMES: tuple[str, ...] = (
    "root_tx", "root_ty", "root_tz",
    *(name for one in SEGMENTS if one.joint not in ADDED_JOINTS for name in one.angles),
    *(name for one in SEGMENTS if one.joint in ADDED_JOINTS for name in one.angles),
)  # fmt: skip

N_DOF = len(DOF_NAMES)
#: Of them, those of Canton's body, which are the first.
N_CANTON = sum(not name.startswith(ADDED_JOINTS) for name in DOF_NAMES)


def dof_index(*names: str) -> np.ndarray:
    """Places of named degrees of freedom in a state.

    Raises
    ------
    ValueError
        When a name is not one of `DOF_NAMES`.
    """
    missing = [name for name in names if name not in DOF_NAMES]
    if missing:
        raise ValueError(f"no degree of freedom named {missing[0]!r}; they are {', '.join(DOF_NAMES)}")
    return np.array([DOF_NAMES.index(name) for name in names])


@dataclass(frozen=True)
class JointLimits:
    """Smallest and largest value of every degree of freedom, each of shape (37,); infinite where there is none."""

    low: np.ndarray
    high: np.ndarray


# Table 6.1, degrees.
_CANTON_DEG: dict[str, tuple[float, float]] = {
    "neck_x": (-90, 90), "neck_y": (-90, 90),
    "r_shoulder_x": (-180, 180), "r_shoulder_y": (-135, 90), "r_shoulder_z": (-90, 180), "r_elbow_z": (0, 180),
    "l_shoulder_x": (-180, 180), "l_shoulder_y": (-90, 135), "l_shoulder_z": (-180, 90), "l_elbow_z": (-180, 0),
    "r_hip_x": (-90, 60), "r_hip_y": (-180, 90), "r_hip_z": (-45, 45), "r_knee_y": (0, 180),
    "l_hip_x": (-60, 90), "l_hip_y": (-180, 90), "l_hip_z": (-45, 45), "l_knee_y": (0, 180),
    "torso_x": (-45, 45), "torso_y": (-45, 90), "torso_z": (-22.5, 22.5),
}  # fmt: skip

# Where the table is too tight for joint centres, or so wide that a limb can fold into the body. An arm that is brought behind the back goes
# through all of the shoulders' range: turned in as it is there, its first and its third axis nearly fall together.
_DEFAULT_DEG: dict[str, tuple[float, float]] = _CANTON_DEG | {
    "neck_x": (-45, 45), "neck_y": (-50, 60),
    "r_shoulder_x": (-120, 170), "r_shoulder_y": (-110, 110), "r_shoulder_z": (-90, 135), "r_elbow_z": (-10, 155),
    "l_shoulder_x": (-170, 120), "l_shoulder_y": (-110, 110), "l_shoulder_z": (-135, 90), "l_elbow_z": (-155, 10),
    "r_hip_x": (-80, 40), "r_hip_y": (-140, 50), "r_knee_y": (-8, 155),
    "l_hip_x": (-40, 80), "l_hip_y": (-140, 50), "l_knee_y": (-8, 155),
    "torso_x": (-40, 40), "torso_y": (-35, 90), "torso_z": (-45, 45),
    "spine_x": (-25, 25), "spine_y": (-20, 45),
    "r_girdle_x": (-35, 12), "r_girdle_z": (-20, 35), "l_girdle_x": (-12, 35), "l_girdle_z": (-35, 20),
    "r_ankle_y": (-30, 50), "r_ankle_z": (-30, 20), "l_ankle_y": (-30, 50), "l_ankle_z": (-20, 30),
}  # fmt: skip


def _limits(degrees: dict[str, tuple[float, float]]) -> JointLimits:
    free, held = (-np.inf, np.inf), (0, 0)
    bounds = np.array([degrees.get(name, held if name.startswith(ADDED_JOINTS) else free) for name in DOF_NAMES])
    return JointLimits(np.radians(bounds[:, 0]), np.radians(bounds[:, 1]))


def canton_limits() -> JointLimits:
    """Angular ranges of Canton (2009), Table 6.1; joints that it does not have are held at 0."""
    return _limits(_CANTON_DEG)


def default_limits(held: tuple[str, ...] = ()) -> JointLimits:
    """Angular ranges for joint centres: elbows and knees may stretch a little past straight, the waist may twist further.

    Parameters
    ----------
    held : tuple of str
        Of `ADDED_JOINTS`, those that are held at 0.
    """
    return _limits({name: bounds for name, bounds in _DEFAULT_DEG.items() if not name.startswith(held)})


def stiff_limits() -> JointLimits:
    """Those of `default_limits`, but for the trunk's own joints, which are held at 0."""
    return default_limits(held=TRUNK_JOINTS)


def mirror_state(states: np.ndarray) -> np.ndarray:
    """Swap the left and the right limbs' angles, so that each side takes the pose of the other; the root stays.

    Parameters
    ----------
    states : ndarray, shape (..., 37)

    Returns
    -------
    ndarray, shape (..., 37)
        Mirrored in the body's own XZ plane, save root and waist, which keep their angles.
    """
    states = np.asarray(states, float)
    out = states.copy()
    for index, name in enumerate(DOF_NAMES):
        if name[:2] in ("l_", "r_"):
            other = ("r_" if name[0] == "l" else "l_") + name[2:]
            # A reflection in the XZ plane keeps turns about Y and reverses those about X and Z.
            sign = 1.0 if name.endswith("_y") else -1.0
            out[..., index] = sign * states[..., DOF_NAMES.index(other)]
    return out
