"""What every likelihood of a pose is: an objective, "how well does this pose fit this view".

An objective is a value made of a body and a view. What filters ask of it is a cost for many states at once; what refines or descends asks
for residuals and how they change; structural annealing asks which part of the body costs what. Objectives add up (`Sum`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from hmc.body.model import BodyModel

__all__ = ["Linearisation", "Misfit", "Objective", "Sum", "cost_at"]


@dataclass(frozen=True)
class Misfit:
    """Where body and data contradict each other in one pose.

    Parameters
    ----------
    outside : ndarray, shape (n,)
        How far points of the body's surface are from where the data allows them, metres.
    part : ndarray of int, shape (n,)
        Of these points, the place in `hmc.body.model.PARTS`.
    places : ndarray, shape (m, 3)
        What the data shows, world, metres.
    distance : ndarray, shape (m,)
        How far each of these is from the body, metres; infinite beyond what is looked at.
    """

    outside: np.ndarray
    part: np.ndarray
    places: np.ndarray
    distance: np.ndarray


class Linearisation(Protocol):
    """An objective at one state.

    Attributes
    ----------
    residuals : ndarray, shape (n,)
        Metres; their squares sum to the cost.
    near : object
        What speeds up the next call of `Objective.linearise` for a state near this one.
    misfit : Misfit or None
        Where body and data contradict each other, if the objective can tell.
    """

    @property
    def residuals(self) -> np.ndarray: ...
    @property
    def near(self) -> Any: ...
    @property
    def misfit(self) -> Misfit | None: ...
    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        """Which residuals change with the state, (m,), and how, (m, 37)."""


class Objective(Protocol):
    """How well poses fit a view; costs are square metres."""

    @property
    def body(self) -> BodyModel: ...
    def cost(self, states: np.ndarray) -> np.ndarray:
        """The cost of states (n, 37), shape (n,)."""

    def by_part(self, states: np.ndarray) -> np.ndarray | None:
        """The share of each of `hmc.body.model.PARTS` in the cost, shape (n, n_parts); None where it cannot be told."""

    def linearise(self, state: np.ndarray, near: Any = None) -> Linearisation:
        """Residuals at a state (37,), with what it takes to tell how they change."""

    def coarser(self, rng: np.random.Generator, n: int) -> Objective:
        """The objective on about `n` of the data's points."""

    def of_body(self, body: BodyModel, points: Any) -> Objective:
        """The same of another body, with the points of its surface (`hmc.pose.objectives.symmetric.BodyPoints`)."""


@dataclass(frozen=True)
class _SummedAt:
    """Several objectives at one state."""

    parts: tuple[Linearisation, ...]

    @property
    def residuals(self) -> np.ndarray:
        return np.concatenate([one.residuals for one in self.parts])

    @property
    def near(self) -> tuple[Any, ...]:
        return tuple(one.near for one in self.parts)

    @property
    def misfit(self) -> Misfit | None:
        known = [one.misfit for one in self.parts if one.misfit is not None]
        if not known:
            return None
        return Misfit(*(np.concatenate([getattr(one, name) for one in known]) for name in ("outside", "part", "places", "distance")))

    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        rows, jacobians, first = [], [], 0
        for one in self.parts:
            row, jacobian = one.pulls()
            rows.append(first + row)
            jacobians.append(jacobian)
            first += len(one.residuals)
        return np.concatenate(rows), np.concatenate(jacobians)


@dataclass(frozen=True)
class Sum:
    """Objectives of one body, added up.

    Parameters
    ----------
    parts : sequence of Objective
        One at least; the caller sees to it that each weighs what it should.
    """

    parts: Sequence[Objective]

    @property
    def body(self) -> BodyModel:
        """The body of all of them."""
        return self.parts[0].body

    def cost(self, states: np.ndarray) -> np.ndarray:
        """The sum, shape (n,)."""
        return np.sum([one.cost(states) for one in self.parts], axis=0)

    def by_part(self, states: np.ndarray) -> np.ndarray | None:
        """The sum, shape (n, n_parts); None where one of them cannot tell."""
        shares = [one.by_part(states) for one in self.parts]
        told = [share for share in shares if share is not None]
        return np.sum(told, axis=0) if len(told) == len(shares) else None

    def linearise(self, state: np.ndarray, near: Any = None) -> Linearisation:
        """The residuals of all, one after the other."""
        before = near or (None,) * len(self.parts)
        return _SummedAt(tuple(one.linearise(state, other) for one, other in zip(self.parts, before, strict=True)))

    def coarser(self, rng: np.random.Generator, n: int) -> Sum:
        """Each on about `n` points."""
        return Sum([one.coarser(rng, n) for one in self.parts])

    def of_body(self, body: BodyModel, points: Any) -> Sum:
        """Each of another body."""
        return Sum([one.of_body(body, points) for one in self.parts])


def cost_at(objective: Objective, state: np.ndarray) -> float:
    """The cost of one state (37,), by its residuals: what a refinement compares, square metres."""
    residuals = objective.linearise(state).residuals
    return float(residuals @ residuals)
