"""Following one person: all parameters at once, then the five chains by themselves, frame after frame. Kehl (2006), section 6.4."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmc.pose.smd.body import CHAINS, FREE, SolidBody
from hmc.pose.smd.cues import CueSettings, Draw, Observed, draw_cues, match_cues
from hmc.pose.smd.descent import Evaluation, SmdSettings, smd_run
from hmc.pose.smd.levenberg import LmSettings, lm_run
from hmc.pose.smd.rows import Matches, evaluate, gauss_newton_product, jacobian, pose_body
from hmc.pose.smd.samples import SurfaceGrid
from hmc.pose.smd.surface_cue import VoxelCloud, voxel_cloud

__all__ = ["OPTIMISERS", "SmdPreset", "SmdTracker", "TrackInfo", "TrackState", "track_init", "track_step"]

OPTIMISERS = ("smd", "deterministic", "lm")
#: Fewer surface voxels than these say nothing of a pose.
LEAST_VOXELS = 60


@dataclass(frozen=True)
class SmdPreset:
    """Parameters of the tracker.

    Parameters
    ----------
    cues : CueSettings
    descent : SmdSettings
    levenberg : LmSettings
    optimiser : {"smd", "deterministic", "lm"}
        Stochastic Meta Descent; the same on samples that stay for the frame; Levenberg-Marquardt on such samples.
    times : int
        So many times as many samples as `cues` says.
    tolerance_m, tolerance_deg : float
        epsilon_1 of Eq. 20: of the trunk's place and of the angles.
    refine_share : float
        epsilon_2 over epsilon_1, for the chains.
    predict : float
        Share of the last frame's change that is expected again.
    """

    cues: CueSettings = field(default_factory=CueSettings)
    descent: SmdSettings = field(default_factory=SmdSettings)
    levenberg: LmSettings = field(default_factory=LmSettings)
    optimiser: str = "smd"
    times: int = 1
    tolerance_m: float = 0.004
    tolerance_deg: float = 0.4
    refine_share: float = 0.5
    predict: float = 0.0


@dataclass(frozen=True)
class SmdTracker:
    """A person's body and how it is followed."""

    body: SolidBody
    grid: SurfaceGrid
    preset: SmdPreset


@dataclass(frozen=True)
class TrackState:
    """Between two frames.

    Parameters
    ----------
    state, velocity : ndarray, shape (27,)
        Pose and its last change.
    """

    state: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True)
class TrackInfo:
    """How a frame went.

    Parameters
    ----------
    status : str
        "fitted", or why not.
    value : float
        The objective at the end, on the last samples.
    iterations : ndarray of int, shape (6,)
        Of the full pose and of each chain.
    """

    status: str
    value: float
    iterations: np.ndarray


def track_init(state: np.ndarray) -> TrackState:
    """A person in this pose (27,), at rest."""
    return TrackState(np.asarray(state, float), np.zeros(len(state)))


def track_step(
    rng: np.random.Generator, tracker: SmdTracker, before: TrackState, observed: Observed | None
) -> tuple[TrackState, TrackInfo]:
    """One frame.

    Parameters
    ----------
    rng : numpy.random.Generator
    tracker : SmdTracker
    before : TrackState
    observed : Observed or None
        None where nothing is seen of the person: the pose stays.

    Returns
    -------
    after : TrackState
    info : TrackInfo
    """
    if observed is None or len(observed.points) < LEAST_VOXELS:
        return replace(before, velocity=0 * before.velocity), TrackInfo("too little of the hull", np.nan, np.zeros(6, int))
    preset, limits = tracker.preset, tracker.body.skeleton.limits
    low, high = limits.low[FREE], limits.high[FREE]
    cloud = voxel_cloud(observed.points)
    start = (before.state + preset.predict * before.velocity)[FREE]
    start = np.clip(start, low, high)
    tolerance = np.where(FREE < 3, preset.tolerance_m, np.radians(preset.tolerance_deg))
    whole = [np.arange(len(FREE))]
    parameters, counts, value = start, [], np.nan
    for groups, share in ((whole, 1.0), (list(CHAINS), preset.refine_share)):
        parameters, iterations, value = _optimise(rng, tracker, cloud, parameters, low, high, share * tolerance, groups)
        counts.append(iterations)
    state = before.state.copy()
    state[FREE] = parameters
    return TrackState(state, state - before.state), TrackInfo("fitted", value, np.concatenate(counts))


def _optimise(rng, tracker, cloud, parameters, low, high, tolerance, groups) -> tuple[np.ndarray, np.ndarray, float]:
    """Descend in some groups of parameters with the preset's optimiser."""
    preset = tracker.preset

    def draw() -> Draw:
        return draw_cues(rng, tracker.grid, cloud, preset.cues, preset.times)

    first = draw()
    if preset.optimiser == "lm":
        return lm_run(lambda at: match_at(tracker, cloud, at, first), parameters, low, high, groups, preset.cues.width, preset.levenberg)

    def objective(at: np.ndarray, going: np.ndarray) -> Evaluation:
        drawn = draw() if preset.optimiser == "smd" else first
        return evaluation(*match_at(tracker, cloud, at, drawn), preset.cues.width)

    found, info = smd_run(objective, parameters, low, high, tolerance, preset.descent, groups)
    return found, info.iterations, float(info.values[-1])


def match_at(tracker: SmdTracker, cloud: VoxelCloud, parameters: np.ndarray, drawn: Draw) -> tuple[Matches, np.ndarray]:
    """Matches of drawn samples at some parameters (24,), and their Jacobian."""
    state = np.zeros(27)
    state[FREE] = parameters
    posed = pose_body(tracker.body, state)
    matches = match_cues(tracker.body, tracker.grid, posed, cloud, drawn, tracker.preset.cues)
    return matches, jacobian(posed, matches)


def evaluation(matches: Matches, rows: np.ndarray, width: float) -> Evaluation:
    """The objective in the form the descent takes. Its curvature is that of matches without error, the most there is."""
    value, gradient, slopes = evaluate(matches, rows, width)
    curvature = np.repeat(matches.weight / width, 3) @ rows.reshape(-1, rows.shape[-1]) ** 2
    return Evaluation(value, gradient, lambda vector: gauss_newton_product(rows, slopes, vector), curvature)
