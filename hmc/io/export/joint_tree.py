"""A body as other programs describe one: joints in a tree, each with turns about named axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

__all__ = ["Joint", "JointTree", "local_rotations"]


@dataclass(frozen=True)
class Joint:
    """A joint and the rigid segment that it moves.

    Parameters
    ----------
    name : str
        Of the segment.
    parent : int
        Place in the tree; -1 of the root, which moves along x, y and z too, by the first three entries of a state.
    offset : ndarray, shape (3,)
        In the parent's frame, metres.
    axes : str
        Axes of rotation, from the parent outwards: ``"xyz"`` means ``R = R_x R_y R_z``.
    dofs : tuple of int
        Places in a state of the angles about these axes, radians.
    """

    name: str
    parent: int
    offset: np.ndarray
    axes: str
    dofs: tuple[int, ...]


@dataclass(frozen=True)
class JointTree:
    """A body of rigid segments.

    Parameters
    ----------
    joints : tuple of Joint
        Parents before children, the root first.
    dof_names : tuple of str
        Of all entries of a state: three translations of the root, then angles.
    low, high : ndarray, shape (n_dof,)
        Bounds of a state; infinite where there is none.
    points : dict
        Named points that segments carry: the segment's place, and where in its frame, metres.
    height_m : float
        Stature.
    """

    joints: tuple[Joint, ...]
    dof_names: tuple[str, ...]
    low: np.ndarray
    high: np.ndarray
    points: dict[str, tuple[int, np.ndarray]]
    height_m: float

    def tips(self) -> dict[str, tuple[int, np.ndarray]]:
        """The points that lie away from the joint of their segment, such as wrists: where limbs end."""
        return {name: (place, offset) for name, (place, offset) in self.points.items() if np.linalg.norm(offset) > 1e-9}

    def joint_names(self) -> list[str]:
        """A name of each joint: that of the point in it (``l_knee``), else that of its segment (``l_clavicle``)."""
        at = {place: name for name, (place, offset) in self.points.items() if np.linalg.norm(offset) <= 1e-9}
        return [at.get(place, joint.name) for place, joint in enumerate(self.joints)]


def local_rotations(joint: Joint, states: np.ndarray) -> Rotation:
    """Turns of a segment against its parent, one a state.

    Parameters
    ----------
    joint : Joint
    states : ndarray, shape (n, n_dof)
    """
    return Rotation.from_euler(joint.axes.upper(), states[:, list(joint.dofs)])
