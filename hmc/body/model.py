"""The body: where its joints lie and the truncated cones that flesh it out. Canton (2009), sections 6.3.4 and 6.5.1.1."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hmc.body.joints import DOF_NAMES, N_DOF, SEGMENTS, JointLimits, default_limits, dof_index
from hmc.body.rest import HANGING_DEG

__all__ = ["PARTS", "PART_OF_DOF", "PART_OF_SEGMENT", "BodyModel", "Cones", "neutral_state"]

#: Fleshed parts (Canton's torso and the links of its five limbs), in the order of every per-part result.
PARTS: tuple[str, ...] = (
    "torso", "head",
    "r_upper_arm", "r_forearm", "l_upper_arm", "l_forearm",
    "r_thigh", "r_shank", "l_thigh", "l_shank",
)  # fmt: skip
#: The part that each segment carries, shape (n_segments,): feet are of the shanks, pelvis, chest and clavicles of the torso.
PART_OF_SEGMENT = np.array([PARTS.index(name) if name in PARTS else 0 for name in (one.name.replace("foot", "shank") for one in SEGMENTS)])
#: The part that each degree of freedom moves first, shape (37,).
PART_OF_DOF = np.array([PART_OF_SEGMENT[[name.startswith(one.joint) for one in SEGMENTS].index(True)] for name in DOF_NAMES])


@dataclass(frozen=True)
class Cones:
    """Truncated cones with elliptic cross-sections, in the frames of the segments that carry them.

    Parameters
    ----------
    segment : ndarray of int, shape (n_cones,)
        Place in `hmc.body.joints.SEGMENTS`.
    part : ndarray of int, shape (n_cones,)
        Place in `PARTS`.
    start, end : ndarray, shape (n_cones, 3)
        Ends of the axis, metres, segment's frame.
    radii : ndarray, shape (n_cones, 2, 2)
        Metres: [start or end, along `across` or along the third axis].
    across : ndarray, shape (n_cones, 3)
        Unit vector perpendicular to the axis: the first semi-axis of the ellipse.
    """

    segment: np.ndarray
    part: np.ndarray
    start: np.ndarray
    end: np.ndarray
    radii: np.ndarray
    across: np.ndarray

    @cached_property
    def lengths(self) -> np.ndarray:
        """Axis lengths, shape (n_cones,), metres."""
        return np.linalg.norm(self.end - self.start, axis=1)

    @cached_property
    def shapes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lengths, shape (n_cones,), metres, radii at the start, shape (n_cones, 2), metres, and their change a metre, (n_cones, 2)."""
        radii = np.maximum(self.radii, 1e-6)  # a point has no outside
        return self.lengths, radii[:, 0], (radii[:, 1] - radii[:, 0]) / self.lengths[:, None]

    @cached_property
    def bases(self) -> np.ndarray:
        """Rows across, third and axis of every cone, shape (n_cones, 3, 3): segment's frame to the cone's own."""
        axis = (self.end - self.start) / self.lengths[:, None]
        return np.stack([self.across, np.cross(axis, self.across), axis], axis=1)


@dataclass(frozen=True)
class BodyModel:
    """A person's body: dimensions, flesh and joint limits; immutable, all in metres.

    Parameters
    ----------
    height_m : float
        Stature.
    offsets : ndarray, shape (16, 3)
        Each segment's joint in its parent's frame (row 0, the root, is zero).
    tips : ndarray, shape (15, 3)
        Each landmark in the frame of `landmark_segments`.
    cones : Cones
    limits : JointLimits
    dimensions : dict
        The numbers from which the body was made (`hmc.body.proportions`), so that it can be stored and changed.
    """

    height_m: float
    offsets: np.ndarray
    tips: np.ndarray
    cones: Cones
    limits: JointLimits
    dimensions: dict[str, float]


def neutral_state(arms: str = "down", limits: JointLimits | None = None) -> np.ndarray:
    """A standing pose at the origin, facing X.

    Parameters
    ----------
    arms : {"sideways", "down"}
        ``sideways`` is the model's neutral pose, all angles zero; ``down`` lets the arms hang (`hmc.body.rest`).
    limits : JointLimits, optional
        Clip to these.

    Returns
    -------
    ndarray, shape (37,)
    """
    if arms not in ("sideways", "down"):
        raise ValueError(f"`arms` must be 'sideways' or 'down'; got {arms!r}")
    state = np.zeros(N_DOF)
    if arms == "down":
        state[dof_index(*HANGING_DEG)] = np.radians(list(HANGING_DEG.values()))
    limits = limits or default_limits()
    return np.clip(state, limits.low, limits.high)
