"""From a first pose to a person who is followed: the pose settles, and the body takes the person's own dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.body.flesh import surface_coordinates
from hmc.body.model import BodyModel
from hmc.pose.method import Capture, make_subject
from hmc.pose.starts.fit_body import WORTH_IT, fit_body, of_a_start
from hmc.pose.steps.descent.tracker import SmdPreset, SmdTracker, TrackState, make_tracker, track_init, track_step
from hmc.pose.steps.polish import fine_objective
from hmc.pose.steps.presets import PRESETS
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.person_view import PersonView
from hmc.pose.views.skin import Skin

__all__ = ["FirstPose", "begin", "fitted_body"]

#: The first pose is settled by so many passes over its frame.
SETTLE = 4
#: The body is fitted to at most so many frames, and needs at least so many.
FIT_FRAMES, LEAST_FRAMES = 6, 3


@dataclass(frozen=True)
class FirstPose:
    """Body and pose (37,) of one of the frames that were watched, by its place among them.

    Parameters
    ----------
    place : int
    body : BodyModel
    state : ndarray, shape (37,)
    """

    place: int
    body: BodyModel
    state: np.ndarray


def begin(
    rng: np.random.Generator,
    preset: SmdPreset,
    first: FirstPose,
    observed: Sequence[Skin | None],
    targets: Sequence[HullTarget | None],
    height_known: bool = False,
) -> tuple[SmdTracker, TrackState]:
    """Settle in the first pose; follow from there, fit the body to some of the frames, and settle once more.

    Parameters
    ----------
    rng : numpy.random.Generator
    preset : SmdPreset
    first : FirstPose
    observed, targets : sequence
        What was seen in the frames that were watched.
    height_known : bool
        The stature was given, so the fit is to change it little.

    Returns
    -------
    tracker : SmdTracker
    state : TrackState
        In the first pose's frame, at rest.
    """
    tracker = make_tracker(first.body, preset)
    state = _settled(rng, tracker, first.state, observed[first.place])
    states, hulls, now = [], [], state
    for one, target in zip(observed[first.place :], targets[first.place :], strict=True):
        now, info = track_step(rng, tracker, now, one)
        if info.status == "fitted" and target is not None:
            states.append(now.state)
            hulls.append(target)
    body = fitted_body(rng, first.body, states, hulls, height_known)
    if body is None:
        return tracker, state
    tracker = make_tracker(body, preset)
    return tracker, _settled(rng, tracker, state.state, observed[first.place])


def fitted_body(
    rng: np.random.Generator, body: BodyModel, states: Sequence[np.ndarray], targets: Sequence[HullTarget], height_known: bool
) -> BodyModel | None:
    """A body with the person's own lengths and girths (`hmc.pose.starts.fit_body`), or None where that fits the hulls no better.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : BodyModel
    states : sequence of ndarray, shape (37,)
    targets : sequence of HullTarget
        Of the same frames.
    height_known : bool
    """
    if len(states) < LEAST_FRAMES:
        return None
    preset, subject = PRESETS["default"], make_subject(body, Capture())
    if preset.fit_body is None:
        return None
    picks = np.unique(np.linspace(0, len(states) - 1, FIT_FRAMES).round().astype(int))
    objectives = [fine_objective(rng, subject, PersonView(target=targets[k]), preset.polish) for k in picks]
    settings = of_a_start(preset.fit_body, height_known)
    coordinates = surface_coordinates(body, preset.surface_samples)
    found, _, info = fit_body(objectives, np.array([states[k] for k in picks]), coordinates, settings)
    return found if info.cost_after < WORTH_IT * info.cost_before else None


def _settled(rng: np.random.Generator, tracker: SmdTracker, state: np.ndarray, observed: Skin | None) -> TrackState:
    now = track_init(state)
    for _ in range(SETTLE):
        now, _ = track_step(rng, tracker, now, observed)
        now = replace(now, velocity=0 * now.velocity)
    return now
