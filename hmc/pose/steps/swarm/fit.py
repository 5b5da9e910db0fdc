"""Fitting the skeleton model to one frame's curves: hierarchical swarms, then fine tuning part by part.

Source: Hsiao (2008), section 3.2.2.2, Table 3-3 and section 3.2.2.4.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.rest import SWARM_DEG
from hmc.body.spin_skeleton import ANGLE_INDEX, ANGLES, N_PARAMETERS, SkeletonModel, part_chains, segment_ends
from hmc.pose.objectives.curves import KINDS, SampledCurves, error_of_chains, skeleton_error
from hmc.pose.objectives.volume import volume_error
from hmc.search.swarm import PsoSettings, pso_run

__all__ = [
    "PARTS",
    "FitSettings",
    "Prior",
    "SkeletonFit",
    "bounds_around",
    "fine_tune",
    "fit_around",
    "fit_cost",
    "fit_flat",
    "fit_hierarchical",
    "rest_state",
    "torso_moves",
]  # fmt: skip

#: Lowest and highest value of every parameter, shape (23,) each.
Box = tuple[np.ndarray, np.ndarray]

_TORSO = tuple(range(7))


def _of(*prefixes: str) -> tuple[int, ...]:
    return tuple(index for name, index in ANGLE_INDEX.items() if name.startswith(prefixes))


_ARMS, _LEGS = _of("l_shoulder", "r_shoulder", "l_elbow", "r_elbow"), _of("l_hip", "r_hip", "l_knee", "r_knee")
#: Stages of Table 3-3: parameters that are free, and curves that count.
STAGES: tuple[tuple[tuple[int, ...], tuple[str, ...]], ...] = (
    ((0, 1, 2), ("trunk", "torso")),
    (_TORSO, ("trunk", "torso")),
    ((*_TORSO, *_of("neck")), ("trunk", "torso", "head")),
    ((*_TORSO, *_of("neck"), *_ARMS), ("trunk", "torso", "head", "arm_1", "arm_2", "l_arm", "r_arm")),
    (tuple(range(N_PARAMETERS)), tuple(KINDS)),
)
#: Parameters that are tuned one after the other.
PARTS: tuple[tuple[int, ...], ...] = (
    _TORSO, _of("neck"), _of("l_shoulder", "l_elbow"), _of("r_shoulder", "r_elbow"), _of("l_hip", "l_knee"), _of("r_hip", "r_knee"),
)  # fmt: skip
#: Beside voxels, no curve's error counts as more than this, metres; and how much the voxels' counts.
BOUND_M, VOLUME_WEIGHT = 0.08, 1.5
#: Of the inverse kinematics below, metres a radian.
LIMB_DAMPING_M = 0.05


@dataclass(frozen=True)
class Prior:
    """What a pose is like where the curves do not say: near a known one.

    Parameters
    ----------
    state : ndarray, shape (23,)
    weight : float
        Metres of error a radian of mean absolute difference over the angles.
    spin_weight : float
        Metres of error a radian of difference of the spin.
    """

    state: np.ndarray
    weight: float = 0.004
    spin_weight: float = 0.0


@dataclass(frozen=True)
class FitSettings:
    """How a frame is fitted.

    Parameters
    ----------
    stages : tuple of (int, int)
        Particles and iterations of the five stages.
    swarm : PsoSettings
        What else says how the swarms move.
    tune_particles, tune_iterations : int
        Of each part's fine tuning.
    tune_m, tune_rad : float
        How far the first round of fine tuning looks for positions and angles; each further one half as far.
    tune_rounds : int
    limbs_stay : bool
        Whether limbs stay where they are while the torso is tuned (`torso_moves`); the thesis does not say.
    """

    stages: tuple[tuple[int, int], ...] = ((12, 12), (24, 20), (24, 12), (40, 40), (50, 50))
    swarm: PsoSettings = field(default_factory=lambda: PsoSettings(topology="global"))
    tune_particles: int = 20
    tune_iterations: int = 7
    tune_m: float = 0.05
    tune_rad: float = 0.6
    tune_rounds: int = 2
    limbs_stay: bool = True


@dataclass(frozen=True)
class SkeletonFit:
    """A fitted frame.

    Parameters
    ----------
    state : ndarray, shape (23,)
    error_m : float
        Mean distance of corresponding nodes (Eq. 3-27), metres.
    cost_m : float
        What was minimised, without the prior (`fit_cost`), metres.
    parts : dict of str to str
        Which part of the model each curve is.
    evaluations : int
        Of the error.
    """

    state: np.ndarray
    error_m: float
    cost_m: float
    parts: dict[str, str]
    evaluations: int


def rest_state(model: SkeletonModel, centre: np.ndarray, up: np.ndarray, spin: float = 0.0) -> np.ndarray:
    """A body with hanging arms, its torso's centre here and its axis along `up`, shape (23,)."""
    state = np.zeros(N_PARAMETERS)
    state[:3] = centre
    state[3:6] = centre + 0.5 * model.torso * up / max(float(np.linalg.norm(up)), 1e-9)
    state[6] = spin
    for name, degrees in SWARM_DEG.items():
        state[ANGLE_INDEX[name]] = np.radians(degrees)
    state[7:] = np.clip(state[7:], model.low, model.high)
    return state


def bounds_around(model: SkeletonModel, state: np.ndarray, metres: float, radians: float) -> Box:
    """A box about a state, its angles within the limits of the joints (motion constraints, section 3.2.2.3)."""
    reach = np.concatenate([np.full(6, metres), np.full(1 + len(ANGLES), radians)])
    low, high = state - reach, state + reach
    low[7:], high[7:] = np.clip(low[7:], model.low, model.high), np.clip(high[7:], model.low, model.high)
    return low, high


def fit_cost(model: SkeletonModel, states: np.ndarray, observed: SampledCurves, prior: Prior | None = None) -> np.ndarray:
    """What swarms minimise: Eq. 3-27, and with voxels beside the curves also how the skeleton lies in them.

    Parameters
    ----------
    model : SkeletonModel
    states : ndarray, shape (n, 23)
    observed : SampledCurves
    prior : Prior, optional

    Returns
    -------
    ndarray, shape (n,)
        Metres.
    """
    starts, ends = segment_ends(model, states)
    # Where voxels count too, they tell which curves are none of the body's.
    costs = error_of_chains(part_chains(starts, ends), observed, None if observed.volume is None else BOUND_M)[0]
    if observed.volume is not None:
        costs = costs + VOLUME_WEIGHT * volume_error(model, starts, ends, observed.volume)
    if prior is not None:
        differ = np.abs(states[:, 6:] - prior.state[6:])
        costs = costs + prior.weight * differ[:, 1:].mean(1) + prior.spin_weight * differ[:, 0]
    return costs


def fit_hierarchical(
    rng: np.random.Generator,
    model: SkeletonModel,
    observed: SampledCurves,
    start: np.ndarray,
    settings: FitSettings | None = None,
    spin_range: float = np.pi,
    weight: float = 0.004,
) -> SkeletonFit:
    """Fit a frame of which nothing is known but the rough place: stage by stage, each with more parameters, then fine tuning.

    Parameters
    ----------
    rng : numpy.random.Generator
    model : SkeletonModel
    observed : SampledCurves
    start : ndarray, shape (23,)
        About where the torso is; the other angles are what is likely where curves are missing.
    settings : FitSettings, optional
    spin_range : float
        How far from its start the spin is looked for, radians.
    weight : float
        How much the start counts (`Prior`).

    Returns
    -------
    SkeletonFit
    """
    settings = settings or FitSettings()
    state, evaluations = start.copy(), 0
    prior = Prior(start, weight)
    for stage, ((free, names), (particles, iterations)) in enumerate(zip(STAGES, settings.stages, strict=True)):
        seen = observed.only(names)
        if not seen.names:
            continue
        low, high = bounds_around(model, state, 0.25 if stage == 0 else 0.12, 4 * np.pi)
        # What earlier stages found is looked for nearby, what is new everywhere.
        known = set(STAGES[stage - 1][0]) if stage else set()
        near = bounds_around(model, state, 0.12, 0.6)
        for index in known - {6}:
            low[index], high[index] = near[0][index], near[1][index]
        low[6], high[6] = start[6] - spin_range, start[6] + spin_range
        swarm = replace(settings.swarm, particles=particles, iterations=iterations)
        state, more = _optimise(rng, _Goal(model, seen, prior), state[None], np.array(free), (low, high), swarm)
        evaluations += more
    tuned = fine_tune(rng, model, observed, state, settings, prior)
    return replace(tuned, evaluations=evaluations + tuned.evaluations)


def fit_around(
    rng: np.random.Generator,
    model: SkeletonModel,
    observed: SampledCurves,
    starts: np.ndarray,
    box: Box,
    swarm: PsoSettings,
    prior: Prior | None = None,
) -> SkeletonFit:
    """All parameters within a box: temporal PSO (section 3.2.2.5).

    Parameters
    ----------
    rng, model, observed
        As for `fit_hierarchical`.
    starts : ndarray, shape (k, 23)
        Where the swarm begins, and at the first with one part moved, unless it begins anywhere.
    box : tuple of ndarray, shape (23,)
        Lowest and highest values, as of `bounds_around`.
    swarm : PsoSettings
    prior : Prior, optional
    """
    if not swarm.anywhere:
        starts = np.concatenate([starts, _one_part_moved(rng, starts[0], box, swarm.particles - len(starts))])
    state, evaluations = _optimise(rng, _Goal(model, observed, prior), starts, np.arange(N_PARAMETERS), box, swarm)
    return _fitted(model, observed, state, evaluations)


def _one_part_moved(rng: np.random.Generator, state: np.ndarray, box: Box, n: int) -> np.ndarray:
    """States (n, 23) that differ from a known one in one part each: of places anywhere in a box of 23 dimensions, hardly any is a pose."""
    states = np.repeat(state[None], max(n, 0), axis=0)
    moved = rng.uniform(*box, states.shape)
    far = rng.random((len(states), 1))
    for k, free in enumerate(PARTS):
        rows = np.arange(k, len(states), len(PARTS))[:, None]
        states[rows, free] += far[rows[:, 0]] * (moved[rows, free] - states[rows, free])
    return states


def fit_flat(
    rng: np.random.Generator,
    model: SkeletonModel,
    observed: SampledCurves,
    start: np.ndarray,
    swarm: PsoSettings,
    spin_range: float = np.pi,
    weight: float = 0.004,
) -> SkeletonFit:
    """All 23 parameters at once, for comparison; arguments as for `fit_hierarchical`."""
    low, high = bounds_around(model, start, 0.25, 4 * np.pi)
    low[6], high[6] = start[6] - spin_range, start[6] + spin_range
    state, evaluations = _optimise(
        rng, _Goal(model, observed, Prior(start, weight)), start[None], np.arange(N_PARAMETERS), (low, high), swarm
    )
    return _fitted(model, observed, state, evaluations)


def fine_tune(
    rng: np.random.Generator,
    model: SkeletonModel,
    observed: SampledCurves,
    state: np.ndarray,
    settings: FitSettings,
    prior: Prior | None = None,
) -> SkeletonFit:
    """Section 3.2.2.4: torso, head, arms and legs one after the other, near where they are."""
    evaluations, goal = 0, _Goal(model, observed, prior)
    # The thesis's "initial guess" is among the particles.
    swarm = replace(settings.swarm, particles=settings.tune_particles, iterations=settings.tune_iterations, anywhere=False)
    for number in range(settings.tune_rounds):
        share = 0.5**number
        for free in PARTS:
            box = bounds_around(model, state, share * settings.tune_m, share * settings.tune_rad)
            moves = torso_moves(model, state) if free == _TORSO and settings.limbs_stay else None
            state, more = _optimise(rng, goal, state[None], np.array(free), box, swarm, moves)
            evaluations += more
    return _fitted(model, observed, state, evaluations)


@dataclass(frozen=True)
class _Goal:
    """What a swarm seeks: states (n, 23) of a model that cost least for some curves (`fit_cost`, metres)."""

    model: SkeletonModel
    observed: SampledCurves
    prior: Prior | None

    def cost(self, states: np.ndarray) -> np.ndarray:
        return fit_cost(self.model, states, self.observed, self.prior)


def _optimise(
    rng: np.random.Generator,
    goal: _Goal,
    starts: np.ndarray,
    free: np.ndarray,
    box: Box,
    swarm: PsoSettings,
    moves: np.ndarray | None = None,
) -> tuple[np.ndarray, int]:
    """The first of the starts (n, 23) with some parameters optimised, and the number of evaluations.

    `moves` (k, 23) says what each free parameter moves, by default itself.
    """
    model, state, (low, high) = goal.model, starts[0], box
    moves = np.eye(N_PARAMETERS)[free] if moves is None else moves

    def moved(values: np.ndarray) -> np.ndarray:
        states = state + (values - state[free]) @ moves
        states[:, 7:] = np.clip(states[:, 7:], model.low, model.high)
        return states

    def cost(values: np.ndarray) -> np.ndarray:
        return goal.cost(moved(values))

    found = pso_run(rng, cost, low[free], high[free], swarm, starts[:, free])
    out = moved(found.leader[None])[0]
    # Only the direction of the neck counts: keep it on the torso.
    axis = out[3:6] - out[:3]
    out[3:6] = out[:3] + 0.5 * model.torso * axis / max(float(np.linalg.norm(axis)), 1e-9)
    return out, found.evaluations


def torso_moves(model: SkeletonModel, state: np.ndarray) -> np.ndarray:
    """What turns and shifts of the torso do when head and limbs stay where they are: their angles give way.

    Of a torso that takes its limbs along, any small move costs more than it gains, and a spin that is wrong stays so.

    Parameters
    ----------
    model : SkeletonModel
    state : ndarray, shape (23,)

    Returns
    -------
    ndarray, shape (7, 23)
        Change of the state with each of the torso's parameters, to first order.
    """
    step = 1e-4
    starts, ends = segment_ends(model, np.concatenate([state[None], state + step * np.eye(N_PARAMETERS)]))
    # The head's top, elbows, finger tips, knees and soles.
    tips = np.concatenate([ends[:, 1:2], starts[:, 3::2], ends[:, 3::2]], axis=1).reshape(N_PARAMETERS + 1, -1)
    slopes = (tips[1:] - tips[0]) / step
    # Damped, so that a stretched limb does not swing round for what it cannot reach.
    angles = slopes[7:]
    give = -np.linalg.solve(angles @ angles.T + LIMB_DAMPING_M**2 * np.eye(len(angles)), angles @ slopes[:7].T)
    return np.concatenate([np.eye(7), give.T], axis=1)


def _fitted(model: SkeletonModel, observed: SampledCurves, state: np.ndarray, evaluations: int) -> SkeletonFit:
    errors, choice = skeleton_error(model, state[None], observed)
    cost = float(fit_cost(model, state[None], observed)[0])
    return SkeletonFit(state, float(errors[0]), cost, observed.parts_of(int(choice[0])), evaluations)
