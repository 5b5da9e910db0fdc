"""Following a skeleton from frame to frame: a swarm near the last pose, and a new start where that is not good enough.

Source: Hsiao (2008), section 3.2.2.5 and Figure 3-22.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.spin_skeleton import SkeletonModel
from hmc.pose.objectives.curves import SampledCurves, curves_near, curves_of, observe_curves
from hmc.pose.spectral.reading import BodyReading
from hmc.pose.steps.swarm.fit import (
    FitSettings,
    Prior,
    SkeletonFit,
    bounds_around,
    fine_tune,
    fit_around,
    fit_cost,
    fit_hierarchical,
    rest_state,
)
from hmc.pose.steps.swarm.heading import facing_evidence, heading_of, spin_towards

__all__ = ["RestartSettings", "SwarmInfo", "SwarmSettings", "SwarmState", "fit_near", "is_upright", "missed", "start_fits", "swarm_step"]

FAR = "the nearest pose is too far from the curves"


@dataclass(frozen=True)
class RestartSettings:
    """When a new start takes the place of the pose that was followed, and when a frame has no fit (Figure 3-22).

    Parameters
    ----------
    always : bool
        Try a start in every frame, as the thesis does.
    alone : bool
        A start is of one frame's curves alone, as in the thesis; else the last pose and the heading, by feet and walk, count too.
    doubt_m, doubt_ratio : float
        Else one is tried when the cost is larger than the first, metres, and than the second times the cost that was usual.
    margin_m : float
        The start is taken when its cost is smaller by this, metres.
    backwards : float
        A skeleton is turned about when the evidence for its heading falls below this; two feet that point backwards are -2 a frame.
    last_weight : float
        How much the last pose counts in a new start (`Prior`).
    lost_m : float
        A frame whose cost is larger has no fit, metres.
    """

    always: bool = False
    alone: bool = False
    doubt_m: float = 0.055
    doubt_ratio: float = 1.4
    margin_m: float = 0.012
    backwards: float = -2.5
    last_weight: float = 0.02
    lost_m: float = 0.15


@dataclass(frozen=True)
class SwarmSettings:
    """How a person is followed.

    Parameters
    ----------
    fit : FitSettings
        Of a start.
    nodes : int
        Nodes of a curve that count.
    reach_m_s, reach_rad_s : float
        Temporal constraint: fastest change of positions and angles.
    least_reach_m, least_reach_rad : float
        The constraint is not tighter than this in any frame.
    particles, iterations : int
        Of the temporal swarm.
    facing_m : float
        By how much facing straight backwards raises the error of a start, metres.
    farthest_m : float
        A curve that is farther than this from every part of the last pose is not taken for one, metres.
    named : bool
        Whether a curve's shape says whether it is a head, an arm or a leg, and the nearest part of the last pose once there is one. Else
        Eq. 3-27's one-to-one assignment alone does, as in the thesis, of curves and parts from end to end, feet with the legs.
    rest_weight : float
        How much the pose at rest counts in a start (`Prior`).
    last_weight, spin_weight : float
        How much the last pose counts in the temporal swarm (`Prior`), and a change of the spin from one frame to the next, metres a radian.
    restart : RestartSettings or None
        None: every frame has the fit near the last pose; for methods that recover in another way.
    voxels : bool
        Whether the voxels count beside their curves; the thesis fits curves alone, and has no fit where they are not those of a body.
    """

    fit: FitSettings = field(default_factory=FitSettings)
    nodes: int = 8
    reach_m_s: float = 2.5
    reach_rad_s: float = 14.0
    least_reach_m: float = 0.05
    least_reach_rad: float = 0.35
    particles: int = 36
    iterations: int = 15
    facing_m: float = 0.02
    farthest_m: float = 0.25
    named: bool = True
    rest_weight: float = 0.004
    last_weight: float = 0.004
    spin_weight: float = 0.01
    restart: RestartSettings | None = None
    voxels: bool = True


@dataclass(frozen=True)
class SwarmState:
    """A followed skeleton.

    Parameters
    ----------
    state, velocity : ndarray, shape (23,)
        The last fit, and its change a frame.
    usual_m : float
        Running mean of the cost, metres.
    facing : float
        Sum of the evidence for the heading since the last start; negative: probably back to front.
    missed : int
        Frames without a fit since the last one.
    """

    state: np.ndarray
    velocity: np.ndarray
    usual_m: float
    facing: float = 0.0
    missed: int = 0


@dataclass(frozen=True)
class SwarmInfo:
    """What happened in one frame.

    Parameters
    ----------
    status : str
        ``"fitted"``, or ``"no fit: "`` and why.
    error_m : float
        Mean distance of corresponding nodes, metres; NaN without a fit.
    started : bool
        Whether the pose is a new start and not the followed one.
    turned : bool
        Whether the skeleton was turned about, because it had faced backwards.
    evaluations : int
        Of all fits in this frame, those that were not taken among them.
    doubts : tuple of str
        What the segmentation says is missing, touches or is left out.
    cost_m : float
        What the swarms minimised, metres; NaN where they did not run.
    """

    status: str
    error_m: float
    started: bool
    turned: bool
    evaluations: int
    doubts: tuple[str, ...]
    cost_m: float = np.nan


def start_fits(
    rng: np.random.Generator,
    model: SkeletonModel,
    reading: BodyReading,
    heading: np.ndarray | None,
    settings: SwarmSettings,
    last: np.ndarray | None = None,
) -> list[SkeletonFit]:
    """Poses from one frame alone, the likeliest first: either way round, weighed by the heading and the last pose where there are any.

    Parameters
    ----------
    rng : numpy.random.Generator
    model : SkeletonModel
    reading : BodyReading
    heading : ndarray, shape (2,), or None
        As from `hmc.pose.steps.swarm.heading.heading_of`.
    settings : SwarmSettings
    last : ndarray, shape (23,), optional
        The last pose: it is what is likely where curves are missing, as much as `settings.restart` says.
    """
    observed = _observed(model, reading, settings)
    trunk = reading.curves["trunk"]
    rest = rest_state(model, trunk.mean(0), trunk[-1] - trunk[0])
    weight = settings.rest_weight
    if settings.restart is not None and settings.restart.alone:
        return [fit_hierarchical(rng, model, observed, rest, settings.fit, np.pi, weight)]
    if last is not None:
        rest[6:], weight = last[6:], (settings.restart or RestartSettings()).last_weight
        spins = [last[6], last[6] + np.pi]
    elif heading is not None:
        towards = spin_towards(rest, heading)
        spins = [towards, towards + np.pi]
    else:
        spins = [0.0, np.pi / 2, np.pi, 3 * np.pi / 2]
    fits = []
    for spin in spins:
        start = rest.copy()
        start[6] = spin
        found = fit_hierarchical(rng, model, observed, start, settings.fit, 1.0, weight)
        wrong = 0.0
        if heading is not None:
            wrong += 0.5 * (1 - facing_evidence(found.state, heading / np.linalg.norm(heading)))
        if last is not None:
            wrong += 0.5 * (1 - np.cos(found.state[6] - last[6]))
        fits.append((found.cost_m + settings.facing_m * wrong, found))
    fits.sort(key=lambda pair: pair[0])
    return [found for _, found in fits]


def swarm_step(
    rng: np.random.Generator,
    model: SkeletonModel,
    state: SwarmState | None,
    reading: BodyReading,
    fps: float,
    velocity: np.ndarray | None = None,
    settings: SwarmSettings | None = None,
) -> tuple[SwarmState | None, SwarmInfo]:
    """The person's state after one more frame.

    Parameters
    ----------
    rng : numpy.random.Generator
    model : SkeletonModel
    state : SwarmState or None
        None: nothing is known yet.
    reading : BodyReading
    fps : float
    velocity : ndarray, shape (3,), optional
        Of the person's track, metres a second.
    settings : SwarmSettings, optional
        By default with a restart where the fit is doubtful.

    Returns
    -------
    state : SwarmState or None
    info : SwarmInfo
    """
    settings = settings or SwarmSettings(restart=RestartSettings())
    restart = settings.restart
    segmentation = reading.segmentation
    doubts = (*segmentation.doubts, *(f"{one} touch" for one in segmentation.touching), *reading.left_out)
    volume = reading.volume if settings.voxels else None
    if reading.status != "read" and (state is None or volume is None):
        return missed(state), SwarmInfo(f"no fit: {reading.status}", np.nan, False, False, 0, doubts)
    heading = heading_of(reading.feet, velocity)
    if state is None:
        trials = start_fits(rng, model, reading, heading, settings)
        first = next((one for one in trials if (restart is not None and restart.alone) or is_upright(one.state)), None)
        if first is None:
            return None, SwarmInfo("no fit: no person is upright in the curves", np.nan, False, False, _spent(trials), doubts)
        facing = facing_evidence(first.state, heading)
        return SwarmState(first.state, np.zeros_like(first.state), first.cost_m, facing), _info(first, True, False, _spent(trials), doubts)
    frames = 1 + state.missed
    found = fit_near(rng, model, state, reading, fps, settings)
    facing = state.facing + facing_evidence(found.state, heading)
    started = turned = False
    spent = found.evaluations
    backwards = restart is not None and facing < restart.backwards and facing_evidence(found.state, heading) < 0
    whole = segmentation.whole and reading.status == "read"
    # Parts that were left out because they are far away count here, where the frame shows everything.
    cost_m = found.cost_m
    if whole:
        cost_m = float(fit_cost(model, found.state[None], _observed(model, reading, settings))[0])
    doubtful = restart is not None and cost_m > max(restart.doubt_m, restart.doubt_ratio * state.usual_m)
    if restart is not None and reading.status == "read" and (((doubtful or backwards) and whole) or restart.always):
        trials = start_fits(rng, model, reading, heading, settings, None if backwards else state.state)
        trial = trials[0]
        spent += _spent(trials)
        margin = -settings.facing_m if backwards and facing_evidence(trial.state, heading) > 0 else restart.margin_m
        if trial.cost_m < cost_m - margin:
            found, started, turned = trial, True, backwards
            facing = facing_evidence(trial.state, heading)
        elif backwards:
            facing = 0.0
    if restart is not None and found.cost_m > restart.lost_m:
        read = reading.status == "read"
        why = FAR if read else reading.status
        error_m = found.error_m if read else np.nan
        return missed(state), SwarmInfo(f"no fit: {why}", error_m, False, False, spent, doubts, found.cost_m)
    change = np.zeros_like(found.state) if started else (found.state - state.state) / frames
    # Sums of evidence fade, so that a wrong start can be seen after a while.
    now = SwarmState(found.state, change, 0.9 * state.usual_m + 0.1 * found.cost_m, 0.97 * facing)
    return now, _info(found, started, turned, spent, doubts)


def fit_near(
    rng: np.random.Generator, model: SkeletonModel, state: SwarmState, reading: BodyReading, fps: float, settings: SwarmSettings
) -> SkeletonFit:
    """The pose near the last one that fits a frame best: a swarm within the temporal constraint, then every part tuned.

    Parameters
    ----------
    rng : numpy.random.Generator
    model : SkeletonModel
    state : SwarmState
    reading : BodyReading
    fps : float
    settings : SwarmSettings
    """
    frames = 1 + state.missed
    metres = max(settings.reach_m_s * frames / fps, settings.least_reach_m)
    radians = max(settings.reach_rad_s * frames / fps, settings.least_reach_rad)
    prior = Prior(state.state, settings.last_weight, settings.spin_weight / frames)
    box = bounds_around(model, state.state, metres, min(radians, np.pi))
    swarm = replace(settings.fit.swarm, particles=settings.particles, iterations=settings.iterations)
    starts = np.stack([state.state, state.state + state.velocity])
    near = curves_near(model, state.state, reading, settings.farthest_m) if settings.named else None
    observed = _observed(model, reading, settings, near)
    found = fit_around(rng, model, observed, starts, box, swarm, prior)
    tuned = fine_tune(rng, model, observed, found.state, settings.fit, prior)
    return replace(tuned, evaluations=found.evaluations + tuned.evaluations)


def _observed(
    model: SkeletonModel, reading: BodyReading, settings: SwarmSettings, curves: dict[str, np.ndarray] | None = None
) -> SampledCurves:
    """The curves of a reading, or those given, and where they count its voxels, as a fit wants them."""
    named = settings.named
    curves = curves_of(reading, named, feet=not named) if curves is None else curves
    return observe_curves(model, curves, settings.nodes, named, named, reading.volume if settings.voxels else None)


def is_upright(state: np.ndarray) -> bool:
    """Whether the neck of a state (23,) is above its pelvis: people begin a recording upright, bent or sitting, never on their heads."""
    return bool(state[5] > state[2])


def missed(state: SwarmState | None) -> SwarmState | None:
    """The state after a frame without a fit: it stays where it was."""
    return None if state is None else replace(state, velocity=np.zeros_like(state.velocity), missed=state.missed + 1)


def _spent(fits: Sequence[SkeletonFit]) -> int:
    """Evaluations of all fits that were tried, not of the one alone that is taken."""
    return sum(one.evaluations for one in fits)


def _info(found: SkeletonFit, started: bool, turned: bool, spent: int, doubts: tuple[str, ...]) -> SwarmInfo:
    return SwarmInfo("fitted", found.error_m, started, turned, spent, doubts, found.cost_m)
