"""The annealed particle filter on markers: a step takes a state and a frame's detections and returns a state (Canton 2009, 6.4)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from hmc.body.marker_places import place_tips
from hmc.body.model import BodyModel
from hmc.errors import InputError
from hmc.pose.legs import LegChoice
from hmc.pose.objectives.epipolar import MarkerLikelihood, SeenMarkers, marker_cost
from hmc.pose.steps.annealed import PoseState
from hmc.pose.steps.marker_limbs import explain_all, refine_to_points
from hmc.pose.steps.preset import drift
from hmc.search.filters import AnnealedInfo, AnnealedSettings, annealed_step, particle_init

__all__ = ["MARKER_PRESETS", "MarkerFilter", "MarkerInfo", "MarkerPreset", "make_marker_filter", "marker_preset", "marker_step"]

#: With fewer markers than this seen from two sides a frame has no pose.
LEAST_MARKERS = 5


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
        Factor on `hmc.pose.steps.preset.drift`.
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


def marker_preset(name: str) -> MarkerPreset:
    """A preset by its name.

    Raises
    ------
    InputError
        When there is none of that name.
    """
    if name not in MARKER_PRESETS:
        raise InputError(f"no preset of markers named {name!r}; there are {', '.join(sorted(MARKER_PRESETS))}")
    return MARKER_PRESETS[name]


@dataclass(frozen=True)
class MarkerFilter:
    """What stays the same from frame to frame.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    preset : MarkerPreset
    drift : ndarray, shape (27,)
        P0, metres and radians.
    """

    body: BodyModel
    preset: MarkerPreset
    drift: np.ndarray


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
    choice : LegChoice or None
        The pose and others with exchanged limbs; None where none are looked for.
    """

    cost: float
    matched: np.ndarray
    points: np.ndarray
    annealed: AnnealedInfo | None
    status: str
    choice: LegChoice | None = None


def make_marker_filter(body: BodyModel, preset: MarkerPreset, fps: float) -> MarkerFilter:
    """Prepare the filter.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips (`hmc.body.marker_places.with_skin_markers`).
    preset : MarkerPreset
    fps : float
        Frames a second.
    """
    return MarkerFilter(body, preset, preset.drift_scale * drift(fps))


def marker_step(rng: np.random.Generator, filt: MarkerFilter, state: PoseState, seen: SeenMarkers) -> tuple[PoseState, MarkerInfo]:
    """One frame: annealed layers and, where the preset has it, refinement.

    Parameters
    ----------
    rng : numpy.random.Generator
    filt : MarkerFilter
    state : PoseState
    seen : SeenMarkers
        From `hmc.pose.objectives.epipolar.observe_markers`, with the preset's gate.

    Returns
    -------
    state : PoseState
    info : MarkerInfo
    """
    body, preset = filt.body, filt.preset
    low, high = body.limits.low, body.limits.high
    missing = np.full((len(body.tips), 3), np.nan)
    if sum(len(points) > 0 for points in seen.detections) < 2:
        info = MarkerInfo(np.nan, np.zeros(len(missing), int), missing, None, "markers in fewer than two views")
        return replace(state, velocity=np.zeros_like(state.velocity)), info

    def log_likelihood(states: np.ndarray) -> np.ndarray:
        cost, _ = marker_cost(seen, place_tips(body, states), preset.likelihood)
        return -(cost**2) / (2 * preset.likelihood.sigma**2)

    starts = state.particles
    if preset.refine:
        starts = particle_init(np.stack([state.state, np.clip(state.state + state.velocity, low, high)]))
    particles, annealed = annealed_step(rng, starts, log_likelihood, filt.drift, low, high, preset.annealed)
    estimate, points, choice = annealed.estimate, missing, None
    if preset.refine:
        estimate, points = refine_to_points(body, seen, annealed.best, preset.likelihood.gate_px)
    if preset.search:
        estimate, points, choice = explain_all(rng, body, seen, estimate, points, preset.likelihood.gate_px)
    cost, matched = _cost(body, seen, estimate, preset.likelihood)
    status = "fitted" if (matched >= 2).sum() >= LEAST_MARKERS else "too few markers where the body should have them"
    info = MarkerInfo(cost, matched, points, annealed, status, choice)
    return PoseState(estimate, estimate - state.state, particles), info


def _cost(body: BodyModel, seen: SeenMarkers, state: np.ndarray, settings: MarkerLikelihood) -> tuple[float, np.ndarray]:
    """The cost of one state, and in how many views its markers have detections, (15,)."""
    cost, matched = marker_cost(seen, place_tips(body, state[None]), settings)
    return float(cost[0]), matched[:, 0]
