"""What a search comes to in one frame, before anything is refined: annealed layers, a descent or a swarm propose, other steps go on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from hmc.pose.method import PoseStep, StepInfo, Tracked, unseen
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.person_view import PersonView
from hmc.search.filters import AnnealedInfo
from hmc.search.structural import StructuralInfo

__all__ = ["LEAST_SURFACE", "Proposal", "Propose", "as_proposed", "shows_enough"]

#: Fewer surface voxels than this are noise, not a person.
LEAST_SURFACE = 20


@dataclass(frozen=True)
class Proposal:
    """A pose that a search proposes.

    Parameters
    ----------
    estimate : ndarray, shape (37,)
        The search's own answer.
    best : ndarray, shape (37,)
        From where a refinement starts.
    cost : float
        Of the estimate, in the search's own terms; NaN where it has none.
    evaluations : int
    memory : mapping of str to ndarray
        What the search wants to find again in the next frame.
    status : str
        ``"fitted"``, or why there is no pose.
    annealed : AnnealedInfo or None
    structural : StructuralInfo or None
    levels : ndarray, shape (n_models, 37), or None
    details : mapping
        As in `StepInfo`.
    """

    estimate: np.ndarray
    best: np.ndarray
    cost: float = np.nan
    evaluations: int = 0
    memory: Mapping[str, np.ndarray] = field(default_factory=dict)
    status: str = "fitted"
    annealed: AnnealedInfo | None = None
    structural: StructuralInfo | None = None
    levels: np.ndarray | None = None
    details: Mapping[str, Any] = field(default_factory=dict)


#: ``propose(rng, tracked, view) -> Proposal``.
Propose = Callable[[np.random.Generator, Tracked, PersonView], Proposal]


def shows_enough(target: HullTarget | None) -> bool:
    """Whether a frame's hulls show enough of the person to say anything of the pose."""
    return target is not None and len(target.surface) >= LEAST_SURFACE


def as_proposed(propose: Propose) -> PoseStep:
    """The step that takes a search's own answer."""

    def step(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        if not shows_enough(view.target):
            return unseen(tracked)
        found = propose(rng, tracked, view)
        info = StepInfo(
            found.status,
            found.cost,
            found.evaluations,
            annealed=found.annealed,
            structural=found.structural,
            levels=found.levels,
            details=found.details,
        )
        if found.status != "fitted":
            return Tracked(tracked.subject, tracked.state, np.zeros_like(tracked.velocity), found.memory), info
        return Tracked(tracked.subject, found.estimate, found.estimate - tracked.state, found.memory), info

    return step
