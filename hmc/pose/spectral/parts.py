"""What each branch of a body is: head, arm or leg, by length, girth and place. Hsiao (2008), section 3.1.4.2, names them by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.pose.spectral.growing import Branch

__all__ = ["PART_NAMES", "BranchShape", "branch_shape", "name_branches"]

#: Parts of a body; sides are told later. What is none of these has the label -1.
PART_NAMES: tuple[str, ...] = ("trunk", "head", "arm_1", "arm_2", "leg_1", "leg_2")

#: A head is at most so long, and at most so many times longer than wide.
HEAD_LENGTH_M, HEAD_ELONGATION = 0.52, 4.3
#: A head's cross-section is at least this, square metres: fingers and hair are no heads.
HEAD_AREA_M2 = 0.0115
#: Shorter branches are no limbs, metres.
LEAST_LIMB_M = 0.15
#: A leg has at least this share of the largest limb's volume.
LEG_SHARE = 0.4
#: A single leg with a larger cross-section is two, square metres.
TWO_LEGS_M2 = 0.024


@dataclass(frozen=True)
class BranchShape:
    """A branch in the room.

    Parameters
    ----------
    tip, base : ndarray, shape (3,)
        Middle of the outermost and of the innermost voxels, world, metres.
    length_m : float
        Along the branch.
    area_m2 : float
        Mean cross-section.
    """

    tip: np.ndarray
    base: np.ndarray
    length_m: float
    area_m2: float

    @property
    def elongation(self) -> float:
        """Length over width."""
        return self.length_m / max(np.sqrt(self.area_m2), 1e-9)


def branch_shape(branch: Branch, points: np.ndarray, voxel_size_m: float) -> BranchShape:
    """Length and girth of a branch.

    Parameters
    ----------
    branch : Branch
    points : ndarray, shape (n, 3)
        Centres of all voxels, metres.
    voxel_size_m : float
    """
    order = branch.nodes[np.argsort(branch.sites, kind="stable")]
    # Means of equal numbers of voxels along the branch: a polyline down its middle.
    runs = np.array_split(points[order], int(np.clip(len(order) // 8, 2, 12)))
    line = np.array([run.mean(0) for run in runs])
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    # The first and the last mean lie half a run inside.
    length = steps.sum() + 0.5 * (steps[0] + steps[-1]) if len(steps) else 0.0
    volume = len(order) * voxel_size_m**3
    return BranchShape(line[0], line[-1], float(length), volume / max(float(length), voxel_size_m))


def name_branches(shapes: Sequence[BranchShape], trunk: np.ndarray, up: np.ndarray | None = None) -> tuple[list[str], tuple[str, ...]]:
    """Name the branches of a body.

    The head is the branch that is hardly longer than wide and, of several, the one that is farthest from the longest ones; of the others,
    those whose bases are on the head's side of the trunk are arms, the rest legs. Without a head, upwards takes its place.

    Parameters
    ----------
    shapes : sequence of BranchShape
    trunk : ndarray, shape (3,)
        Middle of what no branch has, metres.
    up : ndarray, shape (3,), optional
        Upwards, by default Z.

    Returns
    -------
    names : list of str
        One a branch: a name of `PART_NAMES`, or "" for a branch that is none.
    doubts : tuple of str
        What is missing or too many, in words.
    """
    names, doubts = [""] * len(shapes), []
    up = np.array([0.0, 0.0, 1.0]) if up is None else up
    heads = [k for k, s in enumerate(shapes) if s.length_m < HEAD_LENGTH_M and s.elongation < HEAD_ELONGATION and s.area_m2 > HEAD_AREA_M2]
    if not heads and len(shapes) > 4:
        # With a shoulder or a hand at it, a head is longer; of five branches it is still the shortest for its width, and no leg. Volume
        # would not tell it from an arm.
        smaller = sorted(range(len(shapes)), key=lambda k: -shapes[k].length_m * shapes[k].area_m2)[2:]
        heads = sorted((k for k in smaller if shapes[k].area_m2 > HEAD_AREA_M2 * 0.8), key=lambda k: shapes[k].elongation)[:1]
    axis = up
    if heads:
        # Shanks of touching knees are as stout: people are upright more often than not.
        head = max(heads, key=lambda k: float(shapes[k].tip @ up))
        names[head] = "head"
        axis = shapes[head].tip - trunk
        axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
    else:
        doubts.append("no head found")
    limbs = [k for k, s in enumerate(shapes) if not names[k] and s.length_m >= LEAST_LIMB_M]
    # How far up the trunk a limb begins, and how large it is, decide together: a hanging forearm begins at the hip, but is no leg.
    height = {k: float((shapes[k].base - trunk) @ axis) for k in limbs}
    volume = {k: shapes[k].area_m2 * shapes[k].length_m for k in limbs}
    largest = max(volume.values(), default=0.0)
    low = sorted((k for k in limbs if height[k] <= 0 and volume[k] > LEG_SHARE * largest), key=lambda k: -volume[k])
    legs = low[:2]
    arms = sorted((k for k in limbs if k not in low), key=lambda k: -volume[k])
    doubled = [k for k in legs if shapes[k].area_m2 > TWO_LEGS_M2 and len(legs) < 2]
    for k in doubled:
        legs.remove(k)
        doubts.append("the legs are together")
    for found, kind in ((arms, "arm"), (legs, "leg")):
        for number, k in enumerate(found[:2]):
            names[k] = f"{kind}_{number + 1}"
        if len(found) < 2:
            doubts.append(f"{2 - len(found)} {kind}{'s' if len(found) == 0 else ''} not found")
        elif len(found) > 2:
            doubts.append(f"{len(found) - 2} more than two {kind}s")
    if len(low) > 2:
        doubts.append(f"{len(low) - 2} more than two legs")
    return names, tuple(doubts)
