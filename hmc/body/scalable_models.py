"""Scalable body models as data: models of rising detail, or parts that unite to a body (Canton 2009, section 7.2).

A model is a list of named angles and of fleshed parts. In an inclusive hierarchy each model holds all that the one before it has, and more
(Eq. 7.2, 7.4 to 7.7); in a unitive one the upper models are unions of lower ones (Eq. 7.3).
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from hmc.body.joints import DOF_NAMES, dof_index
from hmc.body.model import PARTS
from hmc.errors import InputError

__all__ = ["MODEL_1", "MODEL_2", "PRINTED_1", "PRINTED_2", "UNITIVE", "UNITIVE_PIECES", "Inclusive", "Model", "Union", "Unitive"]


@dataclass(frozen=True)
class Model:
    """One body model: what moves, and what is compared with the data.

    Parameters
    ----------
    name : str
    angles : tuple of str
        Of `hmc.body.joints.DOF_NAMES`; the root's translations are among them.
    parts : tuple of str
        Of `hmc.body.model.PARTS`.

    Raises
    ------
    InputError
        When an angle or part is unknown or repeated, or there is none.
    """

    name: str
    angles: tuple[str, ...]
    parts: tuple[str, ...]

    def __post_init__(self) -> None:
        for what, given, known in (("angle", self.angles, DOF_NAMES), ("part", self.parts, PARTS)):
            if not given:
                raise InputError(f"model '{self.name}': has no {what}s")
            for name in given:
                if name not in known:
                    near = difflib.get_close_matches(str(name), known, 1)
                    hint = f"did you mean '{near[0]}'?" if near else f"they are {', '.join(known)}"
                    raise InputError(f"model '{self.name}': no {what} named '{name}'; {hint}")
                if given.count(name) > 1:
                    raise InputError(f"model '{self.name}': {what} '{name}' stands there twice")

    @cached_property
    def dofs(self) -> np.ndarray:
        """Places of the angles in a state, shape (k,), rising."""
        return np.sort(dof_index(*self.angles))

    @cached_property
    def placing(self) -> np.ndarray:
        """Of `dofs`, those that say where the links are: ankles turn what a shank carries and not the shank."""
        return np.sort(dof_index(*(name for name in self.angles if "ankle" not in name)))


@dataclass(frozen=True)
class Inclusive:
    """Models of rising detail.

    Parameters
    ----------
    name : str
    models : tuple of Model
        Each has all angles and parts of the one before it, and at least one angle more.
    held : {"last", "rest"}
        Where the angles are that a part needs and its model does not have: where the most detailed model last saw them, or at rest
        (a straight limb).
    thinning : int
        All models but the last are compared with the data at every so many-th point of their flesh.

    Raises
    ------
    InputError
        When there is no model, or one does not hold the one before it; the angle or part is named.
    """

    name: str
    models: tuple[Model, ...]
    held: Literal["last", "rest"] = "last"
    thinning: int = 1

    def __post_init__(self) -> None:
        if not self.models:
            raise InputError(f"hierarchy '{self.name}': has no models")
        if self.held not in ("last", "rest"):
            raise InputError(f"hierarchy '{self.name}': `held` must be 'last' or 'rest'; got {self.held!r}")
        if isinstance(self.thinning, bool) or not isinstance(self.thinning, int) or self.thinning < 1:
            raise InputError(f"hierarchy '{self.name}': `thinning` must be a whole number of at least 1; got {self.thinning!r}")
        for lower, upper in zip(self.models[:-1], self.models[1:], strict=True):
            for what, inner, outer in (("angle", lower.angles, upper.angles), ("part", lower.parts, upper.parts)):
                lost = [name for name in inner if name not in outer]
                if lost:
                    raise InputError(
                        f"hierarchy '{self.name}': model '{upper.name}' lacks the {what} '{lost[0]}' of '{lower.name}' before it, "
                        "so it does not include it"
                    )
            if len(upper.angles) == len(lower.angles):
                raise InputError(f"hierarchy '{self.name}': model '{upper.name}' adds no angle to '{lower.name}'")

    @cached_property
    def group(self) -> np.ndarray:
        """The first model (from 0) that has each degree of freedom, shape (37,); the number of models where none has it."""
        group = np.full(len(DOF_NAMES), len(self.models))
        for level in range(len(self.models) - 1, -1, -1):
            group[self.models[level].dofs] = level
        return group

    @property
    def added(self) -> np.ndarray:
        """Dimensions that each model adds (Eq. 7.8), shape (n_models,)."""
        return np.bincount(self.group, minlength=len(self.models) + 1)[: len(self.models)]


@dataclass(frozen=True)
class Union:
    """An upper model as the union of lower ones.

    Parameters
    ----------
    model : Model
    of : tuple of str
        Names of the lower models, two or more.
    """

    model: Model
    of: tuple[str, ...]


@dataclass(frozen=True)
class Unitive:
    """Models that unite to a body: leaves, and unions of leaves and of other unions.

    Parameters
    ----------
    name : str
    leaves : tuple of Model
        The first is always there: the trunk. No two have an angle or a part in common. Each of the others is a limb or a piece of one,
        which may be missing.
    unions : tuple of Union
        Lower ones first. The last is the whole body.
    needs : tuple of (str, str)
        Leaves that are there only together with another: a shank with its thigh.

    Raises
    ------
    InputError
        When a union is not that of its members, leaves overlap, or a name is unknown; the angle or part is named.
    """

    name: str
    leaves: tuple[Model, ...]
    unions: tuple[Union, ...]
    needs: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        where = f"hierarchy '{self.name}'"
        known: dict[str, Model] = {}
        for leaf in self.leaves:
            for other in known.values():
                shared = [*(set(leaf.angles) & set(other.angles)), *(set(leaf.parts) & set(other.parts))]
                if shared:
                    raise InputError(f"{where}: the leaves '{other.name}' and '{leaf.name}' both have '{sorted(shared)[0]}'")
            if leaf.name in known:
                raise InputError(f"{where}: two models are named '{leaf.name}'")
            known[leaf.name] = leaf
        for union in self.unions:
            self._check_union(union, known)
            known[union.model.name] = union.model
        if len(self.leaves) < 2:
            raise InputError(f"{where}: needs a trunk and at least one limb")
        top = self.unions[-1].model if self.unions else None
        absent = [leaf.name for leaf in self.leaves if top is None or not set(leaf.angles) <= set(top.angles)]
        if absent:
            raise InputError(f"{where}: the last union must be the whole body; it lacks '{absent[0]}'")
        names = [leaf.name for leaf in self.leaves]
        for pair in self.needs:
            for name in pair:
                if name not in names[1:]:
                    raise InputError(f"{where}: `needs` names '{name}', which is no leaf that may be missing ({', '.join(names[1:])})")
            if names.index(pair[0]) <= names.index(pair[1]):
                raise InputError(f"{where}: '{pair[0]}' needs '{pair[1]}', which must stand before it")

    def _check_union(self, union: Union, known: dict[str, Model]) -> None:
        where, model = f"hierarchy '{self.name}'", union.model
        if model.name in known:
            raise InputError(f"{where}: two models are named '{model.name}'")
        if len(set(union.of)) < 2:
            raise InputError(f"{where}: '{model.name}' must be the union of two models or more")
        for name in union.of:
            if name not in known:
                raise InputError(f"{where}: '{model.name}' is a union of '{name}', which is no model that stands before it")
        members = [known[name] for name in union.of]
        for what, own, theirs in (
            ("angle", model.angles, [name for one in members for name in one.angles]),
            ("part", model.parts, [name for one in members for name in one.parts]),
        ):
            wrong = sorted(set(own) ^ set(theirs))
            if wrong:
                how = f"has the {what} '{wrong[0]}' of none of them" if wrong[0] in own else f"lacks the {what} '{wrong[0]}'"
                raise InputError(f"{where}: '{model.name}' is not the union of {', '.join(union.of)}: it {how}")

    @property
    def limbs(self) -> tuple[Model, ...]:
        """The leaves that may be missing."""
        return self.leaves[1:]

    @cached_property
    def parent(self) -> tuple[int, ...]:
        """The limb without which each limb cannot be there, as a place in `limbs`; -1 for none."""
        names, needs = [limb.name for limb in self.limbs], dict(self.needs)
        return tuple(names.index(needs[name]) if name in needs else -1 for name in names)

    def possible(self, active: np.ndarray) -> np.ndarray:
        """The largest model among these limbs that is allowed: without those whose needed limb is missing.

        Parameters
        ----------
        active : ndarray of bool, shape (n_limbs,)
        """
        active = np.array(active, bool)
        for limb, parent in enumerate(self.parent):  # a needed limb stands before those that need it
            if parent >= 0:
                active[limb] &= active[parent]
        return active

    def model(self, active: np.ndarray) -> Model:
        """The body of the trunk and the active limbs.

        Parameters
        ----------
        active : ndarray of bool, shape (n_limbs,)
        """
        members = [self.leaves[0], *(limb for limb, there in zip(self.limbs, active, strict=True) if there)]
        return _united("+".join(one.name for one in members), members)


def _united(name: str, members: Sequence[Model]) -> Model:
    return Model(name, tuple(a for one in members for a in one.angles), tuple(p for one in members for p in one.parts))


_ROOT = ("root_tx", "root_ty", "root_tz", "root_rz", "root_ry", "root_rx")
_WAIST = ("torso_x", "torso_y", "torso_z", "spine_x", "spine_y")
_GIRDLES = tuple(name for name in DOF_NAMES if "girdle" in name)
_ADDED = (*_WAIST, *_GIRDLES, *(name for name in DOF_NAMES if "ankle" in name))
_SECOND = (
    "neck_x", "neck_y", "r_shoulder_x", "r_shoulder_z", "l_shoulder_x", "l_shoulder_z", "r_hip_x", "r_hip_y", "l_hip_x", "l_hip_y",
)  # fmt: skip
_THIRD = ("r_shoulder_y", "r_elbow_z", "l_shoulder_y", "l_elbow_z", "r_hip_z", "r_knee_y", "l_hip_z", "l_knee_y")
_UPPER = ("torso", "head", "r_upper_arm", "l_upper_arm", "r_thigh", "l_thigh")


def _shbm(name: str, first_parts: tuple[str, ...]) -> Inclusive:
    """Figure 7.7 with the dimensions of Eq. 7.18, the last one the whole body: 6, 16 and 27.

    The trunk carries along the limbs that the next model moves, as they were last seen: alone it slides about in the hull (measured:
    docs/scalable.md). Half of the flesh is enough to find the trunk and the limbs' directions.
    """
    return Inclusive(
        name,
        (
            Model("trunk", _ROOT, first_parts),
            Model("limbs", (*_ROOT, *_SECOND), first_parts),
            Model("body", (*_ROOT, *_SECOND, *_THIRD, *_ADDED), PARTS),
        ),
        thinning=2,
    )


def _printed(name: str, second_parts: tuple[str, ...]) -> Inclusive:
    """Figure 7.7 as it is drawn and told (section 7.3.2.1): the torso alone, then the limbs' directions, then all.

    What the second model cannot bend is straight. Eq. 7.17 repeats an angle and lacks the waist: here the last model has the whole body's.
    """
    return Inclusive(
        name,
        (
            Model("torso", _ROOT, ("torso",)),
            Model("limbs", (*_ROOT, *_SECOND), second_parts),
            Model("body", (*_ROOT, *_SECOND, *_THIRD, *_ADDED), PARTS),
        ),
        held="rest",
    )


#: The thesis's models: in the first whole limbs, held straight, are oriented and then bent; in the second upper arms and thighs come first.
PRINTED_1, PRINTED_2 = _printed("1, as printed", PARTS), _printed("2, as printed", _UPPER)
#: Model 1, ours: whole limbs are oriented first, then bent.
MODEL_1 = _shbm("1", PARTS)
#: Model 2: upper arms and thighs first, then forearms and shanks.
MODEL_2 = _shbm("2", _UPPER)


def _angles(side: str, joint: str) -> tuple[str, ...]:
    return tuple(name for name in DOF_NAMES if name.startswith(f"{side}_{joint}"))


def _unitive(name: str, with_forearms: bool) -> Unitive:
    # A shoulder girdle shows by its arm: where arms are of pieces, it is missing and found with the upper one.
    trunk = Model("trunk", (*_ROOT, *_WAIST, "neck_x", "neck_y", *(() if with_forearms else _GIRDLES)), ("torso", "head"))
    leaves, unions, needs = [trunk], [], []

    def limb(side: str, name: str, upper: tuple[str, str], lower: tuple[str, str], pieces: bool) -> str:
        members = [Model(f"{side}_{part}", _angles(side, joint), (f"{side}_{part}",)) for part, joint in (upper, lower)]
        if pieces and name == "arm":
            members[0] = replace(members[0], angles=(*members[0].angles, *_angles(side, "girdle")))
        if name == "leg":
            members[1] = replace(members[1], angles=(*members[1].angles, *_angles(side, "ankle")))
        whole = _united(f"{side}_{name}", members)
        if not pieces:
            leaves.append(whole)
            return whole.name
        leaves.extend(members)
        unions.append(Union(whole, (members[0].name, members[1].name)))
        needs.append((members[1].name, members[0].name))
        return whole.name

    arms = [limb(side, "arm", ("upper_arm", "shoulder"), ("forearm", "elbow"), with_forearms) for side in "rl"]
    legs = [limb(side, "leg", ("thigh", "hip"), ("shank", "knee"), True) for side in "rl"]
    known = {one.name: one for one in (*leaves, *(union.model for union in unions))}
    upper = _united("upper body", [trunk, *(known[arm] for arm in arms)])
    unions.append(Union(upper, ("trunk", *arms)))
    unions.append(Union(_united("body", [upper, *(known[leg] for leg in legs)]), ("upper body", *legs)))
    return Unitive(name, tuple(leaves), tuple(unions), tuple(needs))


#: The unitive tree of Figure 7.11: trunk, arms, thighs and shanks. An arm without its forearm is not considered, nor a shank without its
#: thigh.
UNITIVE = _unitive("figure 7.11", with_forearms=False)
#: The same with forearms that may be missing while the upper arm is seen: hands that reach behind a table.
UNITIVE_PIECES = _unitive("pieces", with_forearms=True)
