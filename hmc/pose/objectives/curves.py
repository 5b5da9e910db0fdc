"""How far a skeleton model is from skeleton curves. Hsiao (2008), section 3.2.2.1 and Eq. 3-27."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.body.spin_skeleton import SkeletonModel, joint_shares, part_chains, part_lengths, segment_ends
from hmc.pose.spectral.parts import PART_NAMES
from hmc.pose.spectral.reading import BodyReading, cut_foot
from hmc.pose.spectral.skeleton import equally_spaced
from hmc.pose.spectral.volume import BodyVolume

__all__ = [
    "MODEL_PARTS",
    "SampledCurves",
    "best_assignments",
    "curves_near",
    "curves_of",
    "error_of_chains",
    "observe_curves",
    "pair_errors",
    "skeleton_error",
]

#: Parts of the model.
MODEL_PARTS: tuple[str, ...] = ("torso", "head", "l_arm", "r_arm", "l_leg", "r_leg")
#: What each part of a segmentation may be.
KINDS: dict[str, tuple[int, ...]] = {"trunk": (0,), "head": (1,), "arm_1": (2, 3), "arm_2": (2, 3), "leg_1": (4, 5), "leg_2": (4, 5)}
KINDS |= {part: (k,) for k, part in enumerate(MODEL_PARTS)}
#: A curve covers at least this share of its part, however short it is.
LEAST_SHARE = 0.3


@dataclass(frozen=True)
class SampledCurves:
    """Curves to which a model is fitted.

    Parameters
    ----------
    names : tuple of str
        Parts that were found.
    nodes : ndarray, shape (m, n, 3)
        n equally spaced nodes of each curve, metres.
    pairs : ndarray of int, shape (q, 2)
        Curve and part of the model that may belong together.
    blends : ndarray, shape (q, n, 3)
        The model's node that corresponds to each of the curve's, as shares of the start, the joint and the end of the part.
    choices : ndarray of int, shape (k, r)
        Every one-to-one assignment of as many curves and parts as go together: its pairs.
    volume : BodyVolume or None
        The voxels, where they count beside the curves.
    """

    names: tuple[str, ...]
    nodes: np.ndarray
    pairs: np.ndarray
    blends: np.ndarray
    choices: np.ndarray
    volume: BodyVolume | None = None

    def only(self, names: tuple[str, ...]) -> SampledCurves:
        """What may be the parts of some names, without the voxels: those are of the whole body."""
        kept = np.flatnonzero(np.isin(self.pairs[:, 1], [part for name in names for part in KINDS[name]]))
        rows, number = np.unique(self.pairs[kept, 0], return_inverse=True)
        pairs = np.stack([number, self.pairs[kept, 1]], axis=1)
        return SampledCurves(tuple(self.names[k] for k in rows), self.nodes[rows], pairs, self.blends[kept], best_assignments(pairs))

    def parts_of(self, choice: int) -> dict[str, str]:
        """The part of the model that each curve is in an assignment."""
        return {self.names[curve]: MODEL_PARTS[part] for curve, part in self.pairs[self.choices[choice]].tolist()}


def observe_curves(
    model: SkeletonModel,
    curves: Mapping[str, np.ndarray],
    n: int = 6,
    named: bool = True,
    from_tip: bool = True,
    volume: BodyVolume | None = None,
) -> SampledCurves:
    """Sample the curves, and say which nodes of the model theirs correspond to.

    Parameters
    ----------
    model : SkeletonModel
    curves : mapping of str to ndarray, shape (any, 3)
        By part, as from `hmc.pose.spectral.skeleton.extract_skeletons`; nodes equally spaced, the end at the trunk first.
    n : int
        Nodes of each that count.
    named : bool
        Whether a curve's name says what it may be: arms stay arms. Else, as in the thesis, the trunk's is the torso's (it is what no branch
        has), and of the others every one-to-one assignment to head, arms and legs is allowed; of more than five, the longest count.
    from_tip : bool
        Whether the curve of a limb is that of its outer end and as much of the rest as it is long: a limb's curve begins where it leaves
        the trunk. Else curve and part correspond from end to end, as in the thesis.
    volume : BodyVolume, optional
        The voxels, to count beside the curves.
    """
    if not named:
        longest = sorted((name for name in curves if name != "trunk"), key=lambda name: -_length(curves[name]))[: len(MODEL_PARTS) - 1]
        curves = {name: curve for name, curve in curves.items() if name in ("trunk", *longest)}
    names = tuple(curves)
    allowed = tuple(KINDS[name] if named or name == "trunk" else tuple(range(1, 6)) for name in names)
    pairs = np.array([(k, part) for k, parts in enumerate(allowed) for part in parts], int).reshape(-1, 2)
    lengths, joints = part_lengths(model), joint_shares(model)
    nodes, blends = np.zeros((len(names), n, 3)), np.zeros((len(pairs), n, 3))
    for k, curve in enumerate(curves.values()):
        length = _length(curve)
        limb = from_tip and named and allowed[k][0] >= 2
        # What a curve has beyond the length of the limb is inside the trunk.
        nodes[k] = equally_spaced(curve, n, max(length - lengths[allowed[k][0]], 0.0) if limb else 0.0)
        share = np.clip(length / lengths[allowed[k][0]], LEAST_SHARE, 1.0) if limb else 1.0
        at = np.linspace(1 - share, 1, n)
        for q in np.flatnonzero(pairs[:, 0] == k):
            joint = joints[pairs[q, 1]]
            lower, upper = np.clip((at - joint) / (1 - joint), 0, 1), np.clip(at / joint, 0, 1)
            blends[q] = np.stack([1 - upper, upper - lower, lower], axis=1)
    return SampledCurves(names, nodes, pairs, blends, best_assignments(pairs), volume)


def _length(curve: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def curves_of(reading: BodyReading, named: bool = True, feet: bool = False) -> dict[str, np.ndarray]:
    """The curves of a reading.

    Parameters
    ----------
    reading : BodyReading
    named : bool
        Those alone that have a name.
    feet : bool
        Legs with the foot, as in the thesis; else up to the ankle.
    """
    return {
        part: cut_foot(curve, reading.foot_m)[0] if part[:3] == "leg" and not feet else curve
        for part, curve in reading.curves.items()
        if part in KINDS or not named
    }


def curves_near(model: SkeletonModel, state: np.ndarray, reading: BodyReading, farthest_m: float) -> dict[str, np.ndarray]:
    """The curves of a reading, named anew by the parts of a known pose that they are nearest to.

    Parameters
    ----------
    model : SkeletonModel
    state : ndarray, shape (23,)
        The pose.
    reading : BodyReading
    farthest_m : float
        A curve that is farther than this from every part keeps the name that its shape has, or is left out, metres.

    Returns
    -------
    dict of str to ndarray
        By the names of `PART_NAMES`, legs up to the ankle. Which arm or leg is the left one is for the fit to say.
    """
    free = {part: curve for part, curve in reading.curves.items() if part != "trunk"}
    costs = np.full((len(free), len(MODEL_PARTS)), farthest_m)
    chains = part_chains(*segment_ends(model, state[None]))
    for k, curve in enumerate(free.values()):
        for kind in ("head", "arm_1", "leg_1"):
            cut = cut_foot(curve, reading.foot_m)[0] if kind == "leg_1" else curve
            one = observe_curves(model, {kind: cut})
            costs[k, one.pairs[:, 1]] = pair_errors(chains, one)[0]
    taken = {part: k for k, part in np.transpose(linear_sum_assignment(costs)).tolist() if costs[k, part] < farthest_m}
    # What is far from all of the pose is what its shape says, where that part has no curve: a limb that was lost comes back.
    for k, name in enumerate(free):
        if k not in taken.values():
            free_parts = [part for part in KINDS.get(name, ()) if part > 1 and part not in taken]
            taken |= dict.fromkeys(free_parts[:1], k)
    found = {"trunk": reading.curves["trunk"]} if "trunk" in reading.curves else {}
    for part, k in sorted(taken.items()):
        curve = list(free.values())[k]
        found[PART_NAMES[part]] = cut_foot(curve, reading.foot_m)[0] if part >= 4 else curve
    return found


def best_assignments(pairs: np.ndarray) -> np.ndarray:
    """Every one-to-one assignment of as many curves and parts as possible, as rows of `pairs` (q, 2): (k, r)."""
    found: list[list[int]] = [[]]
    for curve in range(int(pairs[:, 0].max(initial=-1)) + 1):
        own = np.flatnonzero(pairs[:, 0] == curve).tolist()
        taken = [{int(pairs[q, 1]) for q in one} for one in found]
        found = found + [[*one, q] for one, parts in zip(found, taken, strict=True) for q in own if int(pairs[q, 1]) not in parts]
    most = max(map(len, found))
    return np.array([one for one in found if len(one) == most], int).reshape(-1, most)


def pair_errors(chains: np.ndarray, observed: SampledCurves) -> np.ndarray:
    """Eq. 3-27 for every pair, divided by the number of nodes: mean distance of corresponding nodes, metres, shape (n, q).

    A curve's nodes correspond in the order in which the sum is smaller; those of limbs are known to begin at the trunk.

    Parameters
    ----------
    chains : ndarray, shape (n, 6, 3, 3)
        As from `hmc.body.spin_skeleton.part_chains`.
    observed : SampledCurves
    """
    points = observed.blends @ chains[:, observed.pairs[:, 1]]
    nodes = observed.nodes[observed.pairs[:, 0]]
    same = np.sqrt(((points - nodes) ** 2).sum(-1)).mean(-1)
    turned = np.sqrt(((points - nodes[:, ::-1]) ** 2).sum(-1)).mean(-1)
    return np.minimum(same, turned)


def skeleton_error(model: SkeletonModel, states: np.ndarray, observed: SampledCurves) -> tuple[np.ndarray, np.ndarray]:
    """Error of states under the best one-to-one assignment.

    Parameters
    ----------
    model : SkeletonModel
    states : ndarray, shape (n, 23)
    observed : SampledCurves

    Returns
    -------
    errors : ndarray, shape (n,)
        Mean over the curves, metres; 0 where there are none.
    choice : ndarray of int, shape (n,)
        Row of ``observed.choices``.
    """
    return error_of_chains(part_chains(*segment_ends(model, states)), observed)


def error_of_chains(chains: np.ndarray, observed: SampledCurves, bound_m: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """`skeleton_error` of chains (n, 6, 3, 3), and where given no curve's error counts as more than a bound, metres.

    So a curve that is of no part draws nothing far.
    """
    n = len(chains)
    if not observed.names:
        return np.zeros(n), np.zeros(n, int)
    errors = pair_errors(chains, observed)
    if bound_m is not None:
        errors = bound_m * (1 - np.exp(-errors / bound_m))
    means = errors[:, observed.choices].mean(-1)
    best = means.argmin(1)
    return means[np.arange(n), best], best
