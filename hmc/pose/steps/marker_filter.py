"""The annealed particle filter on markers: a step takes a state and a frame's detections and returns a state (Canton 2009, 6.4)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from hmc.body.marker_places import place_tips
from hmc.body.model import BodyModel
from hmc.pose.method import Alternatives, PoseStep, StepInfo, Tracked, particles_of, unseen, with_particles
from hmc.pose.objectives.epipolar import MarkerLikelihood, marker_cost
from hmc.pose.steps.marker_limbs import fit_all_points, refine_to_points
from hmc.pose.steps.presets import drift_of
from hmc.pose.views.markers import SeenMarkers
from hmc.pose.views.person_view import PersonView
from hmc.search.filters import AnnealedInfo, AnnealedSettings, annealed_step, particle_init
from hmc.search.fitness import log_fitness

__all__ = ["MARKER_PRESETS", "TIPS", "MarkerInfo", "MarkerPreset", "marker_frame", "on_markers", "with_tips"]

#: With fewer markers than this seen from two sides a frame has no pose.
LEAST_MARKERS = 5
#: Where the markers are worn, under this name in a memory: ndarray, shape (15, 3), each in the frame of its segment, metres.
TIPS = "tips"


@dataclass(frozen=True)
class MarkerPreset:
    """Everything that decides how poses are estimated from markers.

    Parameters
    ----------
    name : str
    source : str
        Where the numbers come from.
    body : {"default", "canton"}
        Proportions and joint limits (`hmc.body.proportions`).
    likelihood : MarkerLikelihood
    annealed : AnnealedSettings
    drift_scale : float
        Factor on `hmc.pose.steps.presets.drift`.
    refine : bool
        Move the estimate to where the detections say that its markers are, and begin the next frame there.
    search : bool
        Look for limbs among all points that the detections make, and tell the legs apart (`hmc.pose.steps.marker_limbs`); needs `refine`.
    """

    name: str
    source: str
    body: Literal["default", "canton"] = "default"
    likelihood: MarkerLikelihood = field(default_factory=MarkerLikelihood)
    annealed: AnnealedSettings = field(default_factory=lambda: AnnealedSettings(layers=3, particles=700))
    drift_scale: float = 1.0
    refine: bool = False
    search: bool = False


MARKER_PRESETS: dict[str, MarkerPreset] = {
    "canton2009": MarkerPreset(
        name="canton2009",
        source="Canton (2009), 6.4 and 6.6: epipolar likelihood, sigma 1, 3 layers of 700 particles, survival rate .5",
        body="canton",
        likelihood=MarkerLikelihood(reprojection=0.0),
    ),
    "default": MarkerPreset(
        name="default",
        likelihood=MarkerLikelihood(gate_px=20.0),
        source="found on rendered motions: reprojection beside the epipolar score, strong selection, refinement",
        annealed=AnnealedSettings(layers=3, particles=700, survival_rate=0.1, spread=0.5),
        drift_scale=0.4,
        refine=True,
        search=True,
    ),
}


@dataclass(frozen=True)
class MarkerInfo:
    """What happened in one step.

    Parameters
    ----------
    cost : float
        Of the estimate (Eq. 6.9), in [0, 1]; NaN without a fit.
    matched : ndarray of int, shape (15,)
        In how many views each marker has a detection within the gate.
    points : ndarray, shape (15, 3)
        Where each marker was seen, by at least two views that agree, metres; NaN without, and where nothing is refined.
    annealed : AnnealedInfo or None
    status : str
        ``"fitted"``, or why not.
    choice : Alternatives or None
        The pose and others with exchanged limbs; None where none are looked for.
    """

    cost: float
    matched: np.ndarray
    points: np.ndarray
    annealed: AnnealedInfo | None
    status: str
    choice: Alternatives | None = None


def with_tips(tracked: Tracked) -> BodyModel:
    """A person's body with its markers as tips: where its memory has them, else at its landmarks."""
    body = tracked.subject.body
    return replace(body, tips=tracked.memory[TIPS]) if TIPS in tracked.memory else body


def marker_frame(rng: np.random.Generator, tracked: Tracked, seen: SeenMarkers, preset: MarkerPreset) -> tuple[Tracked, MarkerInfo]:
    """One frame: annealed layers and, where the preset has it, refinement.

    Parameters
    ----------
    rng : numpy.random.Generator
    tracked : Tracked
    seen : SeenMarkers
        With the preset's gate.
    preset : MarkerPreset

    Returns
    -------
    tracked : Tracked
    info : MarkerInfo
    """
    body, limits = with_tips(tracked), tracked.subject.body.limits
    missing = np.full((len(body.tips), 3), np.nan)
    if sum(len(points) > 0 for points in seen.detections) < 2:
        info = MarkerInfo(np.nan, np.zeros(len(missing), int), missing, None, "markers in fewer than two views")
        return replace(tracked, velocity=np.zeros_like(tracked.velocity)), info

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        cost, _ = marker_cost(seen, place_tips(body, states), preset.likelihood)
        return log_fitness(cost, preset.likelihood.sigma)

    starts = particles_of(tracked)
    if preset.refine:
        starts = particle_init(np.stack([tracked.state, np.clip(tracked.state + tracked.velocity, limits.low, limits.high)]))
    sd = preset.drift_scale * drift_of(tracked.subject.capture)
    particles, annealed = annealed_step(rng, starts, log_likelihood, sd, limits.low, limits.high, preset.annealed)
    estimate, points, choice = annealed.estimate, missing, None
    if preset.refine:
        estimate, points = refine_to_points(body, seen, annealed.best, preset.likelihood.gate_px)
    if preset.search:
        estimate, points, choice = fit_all_points(rng, body, seen, estimate, points, preset.likelihood.gate_px)
    cost, matched = _cost(body, seen, estimate, preset.likelihood)
    status = "fitted" if (matched >= 2).sum() >= LEAST_MARKERS else "too few markers where the body should have them"
    kept = {name: values for name, values in tracked.memory.items() if name == TIPS}
    after = Tracked(tracked.subject, estimate, estimate - tracked.state, {**kept, **with_particles(particles)})
    return after, MarkerInfo(cost, matched, points, annealed, status, choice)


def on_markers(preset: MarkerPreset) -> PoseStep:
    """The step on a frame's detections.

    Parameters
    ----------
    preset : MarkerPreset
    """

    def step(rng: np.random.Generator, tracked: Tracked, view: PersonView) -> tuple[Tracked, StepInfo]:
        if view.markers is None:
            return unseen(tracked, "no detections in this frame")
        after, info = marker_frame(rng, tracked, view.markers, preset)
        evaluations = 0 if info.annealed is None else info.annealed.evaluations
        cost = info.cost if info.status == "fitted" else np.nan
        return after, StepInfo(info.status, cost, evaluations, alternatives=info.choice, annealed=info.annealed)

    return step


def _cost(body: BodyModel, seen: SeenMarkers, state: np.ndarray, settings: MarkerLikelihood) -> tuple[float, np.ndarray]:
    """The cost of one state, and in how many views its markers have detections, (15,)."""
    cost, matched = marker_cost(seen, place_tips(body, state[None]), settings)
    return float(cost[0]), matched[:, 0]
