"""A pose followed from one frame of a window to both ends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from hmc.pose.method import FrameRng, PoseStep, StepInfo, Tracked
from hmc.pose.steps.annealed import annealed
from hmc.pose.steps.polish import polished
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.proposal import as_proposed
from hmc.pose.views.person_view import PersonView
from hmc.processes import share_out
from hmc.search.filters import AnnealedSettings

__all__ = ["quick_step", "walk"]

#: With which candidates are followed.
QUICK = AnnealedSettings(layers=2, particles=60, survival_rate=0.1, spread=0.5)


def walk(
    frame_rng: FrameRng,
    step: PoseStep,
    start: Tracked,
    anchor: int,
    views: Sequence[PersonView],
    known: Mapping[int, tuple[Tracked, StepInfo]] | None = None,
    workers: int = 1,
) -> list[tuple[Tracked, StepInfo]]:
    """A pose tracked from one frame backwards to the first and forwards to the last.

    Parameters
    ----------
    frame_rng : callable
    step : callable
        `PoseStep`.
    start : Tracked
        Pose in the frame `anchor`.
    anchor : int
    views : sequence of PersonView
    known : mapping of int to (Tracked, StepInfo), optional
        Frames around the anchor that were followed before, from the same pose with the same step and random numbers.
    workers : int
        With two or more, forwards and backwards at once.

    Returns
    -------
    list of (Tracked, StepInfo)
        One a frame.
    """
    n, known = len(views), known or {}
    first = known[anchor] if anchor in known else step(frame_rng(anchor), start, views[anchor])

    def onwards(order: Iterable[int]) -> list[tuple[Tracked, StepInfo]]:
        found, current = [], replace(first[0], velocity=np.zeros_like(start.state))
        for k in order:
            found.append(known[k] if k in known else step(frame_rng(k), current, views[k]))
            current = found[-1][0]
        return found

    # Backwards, the velocity is that of time reversed; only the last frame's is used again, and that one is forward.
    after, before = share_out([partial(onwards, order) for order in (range(anchor + 1, n), range(anchor - 1, -1, -1))], workers)
    return [*before[::-1], first, *after]


def quick_step(preset: PosePreset) -> PoseStep:
    """The plain annealed step of a preset with a fraction of the work a frame, and without search."""
    quick = replace(preset, annealed=QUICK, search=None)
    return as_proposed(annealed(quick)) if quick.refine is None else polished(annealed(quick), quick.polish)
