"""The four limbs in one table: the angles, segments, parts and landmarks of each."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hmc.body.joints import DOF_NAMES, SEGMENTS
from hmc.body.model import PART_OF_DOF, PARTS
from hmc.landmarks import landmark_index

__all__ = ["CHAIN_OF_DOF", "CHAIN_OF_PART", "LIMBS", "Limb"]


@dataclass(frozen=True)
class Limb:
    """A chain of two links that hangs on the trunk by a ball joint and bends at a hinge.

    Parameters
    ----------
    name : str
    dofs : ndarray of int, shape (4,)
        Places in a state: the ball joint's x, y and z, and the hinge's angle.
    end_dofs : ndarray of int, shape (0,) or (2,)
        Those of the joint at its end: a leg's ankle.
    segments, parts : ndarray of int, shape (2,)
        Upper and lower link in `hmc.body.joints.SEGMENTS` and in `hmc.body.model.PARTS`.
    landmarks : ndarray of int, shape (2,)
        Middle (the hinge) and end in `hmc.landmarks.LANDMARKS`.
    """

    name: str
    dofs: np.ndarray
    end_dofs: np.ndarray
    segments: np.ndarray
    parts: np.ndarray
    landmarks: np.ndarray

    @property
    def is_arm(self) -> bool:
        """Whether it is an arm."""
        return self.name.endswith("arm")

    @property
    def is_left(self) -> bool:
        """Whether it is on the left side."""
        return self.name.startswith("l_")


def _limb(side: str, kind: str, joints: tuple[str, str], links: tuple[str, str], landmarks: tuple[str, str]) -> Limb:
    ball, hinge = (f"{side}_{joint}" for joint in joints)
    names = [f"{side}_{link}" for link in links]
    segment_names = [segment.name for segment in SEGMENTS]
    return Limb(
        f"{side}_{kind}",
        np.array([k for k, name in enumerate(DOF_NAMES) if name.startswith((ball, hinge))]),
        np.array([k for k, name in enumerate(DOF_NAMES) if name.startswith(f"{side}_{landmarks[1]}")], int),
        np.array([segment_names.index(name) for name in names]),
        np.array([PARTS.index(name) for name in names]),
        np.array([landmark_index(f"{side}_{name}") for name in landmarks]),
    )


#: By name: right and left arm, right and left leg.
LIMBS: MappingProxyType[str, Limb] = MappingProxyType(
    {
        f"{side}_{kind}": _limb(side, kind, *members)
        for kind, *members in (
            ("arm", ("shoulder", "elbow"), ("upper_arm", "forearm"), ("elbow", "wrist")),
            ("leg", ("hip", "knee"), ("thigh", "shank"), ("knee", "ankle")),
        )
        for side in "rl"
    }
)


def _chain_of_part() -> np.ndarray:
    chain = np.zeros(len(PARTS), int)
    for number, limb in enumerate(LIMBS.values(), 1):
        chain[limb.parts] = number
    return chain


#: The kinematic chain of each part, shape (10,): 0 the trunk with the head, then the limbs in the table's order.
CHAIN_OF_PART = _chain_of_part()
#: The same of each degree of freedom, shape (37,).
CHAIN_OF_DOF = CHAIN_OF_PART[PART_OF_DOF]
