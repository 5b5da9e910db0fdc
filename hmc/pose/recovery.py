"""A person's pose that got lost as a whole: noticed, and found anew.

A filter that follows from frame to frame stays lost where it once is: two seconds went missing while the person walked on, or the body
faces backwards. Two signs tell, and neither alone changes anything:

- The cost has stayed far above what is usual for this person. A fresh start from the frame's hulls is then refined beside the pose as
  it is, and taken if it is far better.
- Every so often the body turned about is refined beside the pose as it is (`hmc.pose.turned`). A hull hardly tells the two apart in one
  frame; the logarithm of the ratio of their costs is summed up (CUSUM; Page, 1954), until it is beyond doubt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass, field, replace

import numpy as np

from hmc.pose.method import StepInfo, StepResult, Tracked, other_rng
from hmc.pose.objectives.objective import cost_at
from hmc.pose.starts.candidates import StartSettings, candidates
from hmc.pose.steps.polish import fine_objective
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.refine import refine
from hmc.pose.turned import turn_about
from hmc.pose.views.person_view import PersonView

__all__ = ["LossSettings", "LossState", "Recovery", "loss_init", "recalled"]

#: Of the random numbers (`hmc.pose.method.other_rng`).
PURPOSE = 1
#: Of the entry in a pose's memory.
_NAME = "loss"


@dataclass(frozen=True)
class LossSettings:
    """When a pose counts as lost.

    Parameters
    ----------
    ratio : float
        A cost is bad above so many times the usual one.
    patience_s : float
        Bad for so long, and a fresh start is tried, seconds; after one in vain, twice as long, and so on.
    gain : float
        A fresh start is taken where its cost is below this share of the pose's as it is.
    memory_s : float
        Time over which the usual cost is a mean, seconds.
    turn_every_s, suspicion_s : float
        How often the body turned about is tried, and how often once it was better, seconds.
    turn_limit : float
        The sum of evidence (`TurnedAbout`) at which the body is turned about.
    """

    ratio: float = 3.0
    patience_s: float = 0.3
    gain: float = 0.6
    memory_s: float = 3.0
    turn_every_s: float = 1.0
    suspicion_s: float = 0.2
    turn_limit: float = 0.8


@dataclass(frozen=True)
class LossState:
    """What is known of a pose's reliability between two frames.

    Parameters
    ----------
    usual : float
        Mean of the logarithm of good frames' costs; NaN before the first.
    bad_s : float
        For how long the cost has been bad, seconds.
    wait_s : float
        For how long it has to be before a fresh start is tried.
    since_turn_s : float
        Since the body turned about was last tried, seconds.
    turned : float
        Evidence for the body turned about.
    """

    usual: float = np.nan
    bad_s: float = 0.0
    wait_s: float = 0.0
    since_turn_s: float = 0.0
    turned: float = 0.0


def loss_init(costs: np.ndarray, settings: LossSettings) -> LossState:
    """The state after a person's first frames.

    Parameters
    ----------
    costs : ndarray, shape (n,)
        Square metres; NaN where there is none.
    settings : LossSettings
    """
    costs = costs[np.isfinite(costs) & (costs > 0)]
    return LossState(float(np.log(np.median(costs))) if len(costs) else np.nan, wait_s=settings.patience_s)


def _entry(state: LossState) -> dict[str, np.ndarray]:
    """The state as an entry of a pose's memory."""
    return {_NAME: np.array(astuple(state))}


def recalled(memory: Mapping[str, np.ndarray]) -> LossState:
    """The state from a pose's memory (`hmc.pose.method.Tracked`); a fresh one where there is none."""
    return LossState(*memory[_NAME].tolist()) if _NAME in memory else LossState()


@dataclass(frozen=True)
class Recovery:
    """Recovery from a lost pose, for any method whose frames have hulls: a `hmc.pose.method.Recover`.

    Parameters
    ----------
    preset : PosePreset
        Candidates and refinement of fresh starts.
    settings : LossSettings
    start : StartSettings
        What walking backwards costs.
    """

    preset: PosePreset
    settings: LossSettings = field(default_factory=LossSettings)
    start: StartSettings = field(default_factory=StartSettings)

    def first(self, costs: np.ndarray) -> dict[str, np.ndarray]:
        """Entries of the memory after a person's first frames, of these costs, shape (n,); NaN where there is none."""
        return _entry(loss_init(costs, self.settings))

    def __call__(self, rng: np.random.Generator, before: Tracked, stepped: StepResult, view: PersonView) -> StepResult:
        """The step's pose, or a fresh one where it was lost; what is known of that goes on in its memory.

        Parameters
        ----------
        rng : numpy.random.Generator
            Of the step; other numbers of the same frame are drawn, so that a pose that is never lost is the same with and without.
        before : Tracked
            Before the step.
        stepped : (Tracked, StepInfo)
            After it.
        view : PersonView
        """
        tracked, info, state = self._judged(other_rng(rng, PURPOSE), *stepped, view, recalled(before.memory))
        return replace(tracked, memory={**tracked.memory, **_entry(state)}), info

    def _judged(self, rng, tracked: Tracked, info: StepInfo, view: PersonView, state: LossState) -> tuple[Tracked, StepInfo, LossState]:
        settings = self.settings
        if view.target is None or info.status != "fitted" or not info.cost > 0:
            return tracked, info, state
        dt, level = 1 / tracked.subject.capture.fps, float(np.log(info.cost))
        if state.wait_s == 0:
            state = replace(state, wait_s=settings.patience_s)
        if np.isnan(state.usual):
            state = replace(state, usual=level)
        state = replace(state, since_turn_s=state.since_turn_s + dt)
        if level > state.usual + np.log(settings.ratio):
            state = replace(state, bad_s=state.bad_s + dt)
            if state.bad_s < state.wait_s - dt / 2:
                return tracked, info, state
            found = self._fresh_start(rng, tracked, view)
            if found is None:
                return tracked, info, replace(state, bad_s=0.0, wait_s=2 * state.wait_s)
            return (*_placed(tracked, info, *found), replace(state, bad_s=0.0, wait_s=settings.patience_s, turned=0.0))
        usual = state.usual + (level - state.usual) * min(1.0, dt / settings.memory_s)
        state = replace(state, usual=usual, bad_s=0.0, wait_s=settings.patience_s)
        if state.since_turn_s < (settings.suspicion_s if state.turned else settings.turn_every_s) - dt / 2:
            return tracked, info, state
        about = turn_about(rng, tracked.subject, tracked.state, view, self.preset.polish, self.start)
        state = replace(state, since_turn_s=0.0, turned=max(0.0, state.turned + about.evidence))
        if state.turned < settings.turn_limit:
            return tracked, info, state
        return (*_placed(tracked, info, about.state, about.cost), replace(state, turned=0.0))

    def _fresh_start(self, rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[np.ndarray, float] | None:
        """The best pose that a start from this frame's hulls finds, and its cost, if that is far below the present one's."""
        polish = self.preset.polish
        states, _ = candidates(rng, tracked.subject, view, self.preset)
        objective = fine_objective(rng, tracked.subject, view, polish)
        trials = [refine(objective, one, polish.refine) for one in states]
        best, cost = min(((one, info.cost_after) for one, info in trials), key=lambda pair: pair[1])
        return (best, cost) if cost < self.settings.gain * cost_at(objective, tracked.state) else None


def _placed(tracked: Tracked, info: StepInfo, state: np.ndarray, cost: float) -> StepResult:
    """A person put into another pose, at rest."""
    return replace(tracked, state=state, velocity=np.zeros_like(state)), replace(info, cost=cost)
