"""The body of superellipsoids on the skeleton of `hmc.body`: 24 degrees of freedom, a rigid trunk. Kehl (2006), section 5.1.

States are those of `hmc.body.joints` with the waist held, so that what is found can be stored, drawn and measured as any other pose:
6 for the trunk, 3 for each shoulder and hip, 1 for each elbow and knee, 2 for the neck.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hmc.body.joints import ADDED_JOINTS, DOF_NAMES, SEGMENTS, dof_index
from hmc.body.limbs import CHAIN_OF_PART, LIMBS
from hmc.body.model import PART_OF_SEGMENT, BodyModel
from hmc.body.proportions import flesh_ahead, side_factor
from hmc.body.superellipsoids import Superellipsoids

__all__ = ["CHAINS", "FREE", "FREE_NAMES", "GROUPS", "SolidBody", "solid_body", "to_world"]

#: The 24 degrees of freedom, as places in a state.
FREE: np.ndarray = np.array([k for k, name in enumerate(DOF_NAMES) if not name.startswith(("torso", *ADDED_JOINTS))])
FREE_NAMES: tuple[str, ...] = tuple(DOF_NAMES[k] for k in FREE)
#: What samples are shared out among: the trunk and the five chains that hang on it.
GROUPS: tuple[str, ...] = ("trunk", "head", *LIMBS)
#: Degrees of freedom of each chain, as places among the 24, in the order of `GROUPS` without the trunk.
CHAINS: tuple[np.ndarray, ...] = tuple(
    np.searchsorted(FREE, dofs) for dofs in (dof_index("neck_x", "neck_y"), *(limb.dofs for limb in LIMBS.values()))
)
_SEGMENT = {segment.name: k for k, segment in enumerate(SEGMENTS)}
_CHAIN = CHAIN_OF_PART[PART_OF_SEGMENT]
_GROUP_OF_SEGMENT = np.where(_CHAIN > 0, _CHAIN + 1, PART_OF_SEGMENT)  # of the trunk's chain, torso and head are the first two parts


@dataclass(frozen=True)
class SolidBody:
    """A person's body of superellipsoids.

    Parameters
    ----------
    skeleton : BodyModel
        Joints, limits and landmarks.
    solids : Superellipsoids
    names : tuple of str
        Of the solids.
    segment : ndarray of int, shape (n,)
        Segment that carries each solid.
    group : ndarray of int, shape (n,)
        Place in `GROUPS`.
    has_edges : ndarray of bool, shape (n,)
        Solids whose contours are looked for in images: the limbs' (section 7).
    origin : ndarray, shape (n, 3)
        Middle of the equator in the segment's frame, metres.
    axes : ndarray, shape (n, 3, 3)
        Columns: the solid's x, y, z in the segment's frame.
    """

    skeleton: BodyModel
    solids: Superellipsoids
    names: tuple[str, ...]
    segment: np.ndarray
    group: np.ndarray
    has_edges: np.ndarray
    origin: np.ndarray
    axes: np.ndarray

    @cached_property
    def diameter(self) -> np.ndarray:
        """Each solid's thickness, metres, in which distances are measured, shape (n,)."""
        return 2 * self.solids.across.min(axis=1)


def to_world(body: SolidBody, rotations: np.ndarray, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the solids are.

    Parameters
    ----------
    body : SolidBody
    rotations, positions : ndarray, shapes (16, 3, 3) and (16, 3)
        Of the segments, from `hmc.body.kinematics.joint_twists`.

    Returns
    -------
    turns : ndarray, shape (n, 3, 3)
        World from solid.
    centres : ndarray, shape (n, 3)
        World, metres.
    """
    carried = rotations[body.segment]
    return carried @ body.axes, (carried @ body.origin[..., None])[..., 0] + positions[body.segment]


# Of a limb's solid: its half-axis over its length, so that it has the given share of its thickness at the end.
def _reach(share: float, eps1: float) -> float:
    return (1 - share ** (2 / eps1)) ** (-eps1 / 2)


def solid_body(skeleton: BodyModel) -> SolidBody:
    """The solids around a skeleton, as thick as its girths say.

    A limb is a truncated superellipsoid that tapers from its joint to the next, with a spherical cap at its joint. Hands are part of the
    forearms. Trunk and head are two superellipsoids of different length each. The paper leaves feet out; here they are solids, for the
    hull has them.

    Parameters
    ----------
    skeleton : BodyModel
        As from `hmc.body.proportions.make_body`.
    """
    d, h = skeleton.dimensions, skeleton.dimensions["height"]
    wide, deep = d["girth_torso"], d["girth_torso"] * d["girth_depth"]
    trunk, chest, head = d["trunk"], d["chest_forward"], d["head"]
    skull = 0.01 * h + 0.6 * (d["head_forward"] - d["head_flesh_back"])
    x, y, z = np.eye(3)
    rows: list[tuple] = []

    def solid(name: str, segment: str, frame, across: tuple[float, float], along: tuple[float, float], eps1, eps2: float = 1.0) -> None:
        index, (origin, axes) = _SEGMENT[segment], frame
        has_edges = _GROUP_OF_SEGMENT[index] >= GROUPS.index("r_arm") and not name.endswith("foot")
        rows.append((name, index, _GROUP_OF_SEGMENT[index], has_edges, origin, np.stack(axes, axis=1), across, along, eps1, eps2))

    upright = (x, y, z)
    hips, ribs = (0.063 * h * deep, 0.092 * h * wide), (0.059 * h * deep, 0.097 * h * wide)
    belly, breast = 0.3 * chest + flesh_ahead(d, 0.05), chest + flesh_ahead(d, 0.60)
    solid("pelvis", "pelvis", ((belly, 0, 0.05 * trunk), upright), hips, (0.062 * h, 0.42 * trunk), (0.7, 0.6), 0.8)
    solid("chest", "torso", ((breast, 0, 0.60 * trunk), upright), ribs, (0.42 * trunk, 0.40 * trunk), (0.7, 0.7), 0.8)
    wide_head = 0.046 * h * d["girth_head"]
    solid("head", "head", ((skull, 0, 0.56 * head), upright), (1.25 * wide_head, wide_head), (0.62 * head, 0.45 * head), (1.0, 0.9))
    for side, sign in (("r", -1.0), ("l", 1.0)):
        outwards, down, ahead = (-x, sign * z, sign * y), (x, -y, -z), (-z, y, x)
        arm, thigh, calf = 0.035 * h * d["girth_arms"], 0.050 * h * d["girth_thighs"], 0.033 * h * d["girth_shanks"]
        fore = 0.027 * h * d["girth_arms"]
        longer_arm, longer_leg = side_factor(d, "arms", side), side_factor(d, "legs", side)
        shank = longer_leg * d["shank"] + 0.3 * d["ankle_height"]
        joint, hip = (0, 0, 0), (flesh_ahead(d, 0), 0, 0)
        for name, frame, radius, length, eps1 in (
            ("upper_arm", (joint, outwards), arm, longer_arm * d["upper_arm"] * _reach(0.75, 0.5), (1.0, 0.5)),
            ("forearm", (joint, outwards), fore, longer_arm * d["forearm"] + d["hand"], (1.0, 0.8)),
            ("thigh", (hip, down), thigh, longer_leg * d["thigh"] * _reach(0.68, 0.6), (1.0, 0.6)),
            ("shank", ((-0.003 * h, 0, 0), down), calf, shank * _reach(0.6, 0.7), (1.0, 0.7)),
        ):
            solid(f"{side}_{name}", f"{side}_{name}", frame, (radius, radius), (radius, length), eps1)
        if d["foot"] > 0:
            sole = (0, 0, -d["ankle_height"] + 0.022 * h)
            solid(f"{side}_foot", f"{side}_foot", (sole, ahead), (0.021 * h, 0.027 * h), (0.032 * h, 1.05 * d["foot"]), (0.9, 0.7))
    names, segment, group, edges, origin, axes, across, along, eps1, eps2 = zip(*rows, strict=True)
    solids = Superellipsoids(np.array(across, float), np.array(along, float), np.array(eps1, float), np.array(eps2, float))
    return SolidBody(
        skeleton, solids, tuple(names), np.array(segment), np.array(group), np.array(edges), np.array(origin, float), np.array(axes, float)
    )
