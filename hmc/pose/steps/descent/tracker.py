"""Following one person: all parameters at once, then the five chains by themselves, frame after frame. Kehl (2006), section 6.4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hmc.body.contours import make_strips
from hmc.body.joints import N_DOF
from hmc.body.model import BodyModel
from hmc.body.solid_samples import SampledBody, surface_grid
from hmc.body.solids import CHAINS, FREE, GROUPS, solid_body
from hmc.pose.objectives.color_cue import ColorModel, color_fits, learn_colors, update_colors
from hmc.pose.objectives.cue_rows import Matches, PosedBody, evaluate, gauss_newton_product, jacobian, pose_body
from hmc.pose.objectives.edge_cue import EdgeMaps, best_views, edge_maps, shown_contours
from hmc.pose.objectives.multicue import CueSettings, Draw, draw_cues, draw_of_groups, match_cues
from hmc.pose.objectives.surface_cue import VoxelCloud, place, voxel_cloud
from hmc.pose.steps.descent.levenberg import LmSettings, lm_run
from hmc.pose.steps.descent.rescue import RescueSettings, propose_limb, uncovered
from hmc.pose.views.skin import Skin
from hmc.search.meta_descent import Evaluation, SmdSettings, smd_run

__all__ = [
    "CueFrame", "SmdPreset", "SmdTracker", "TrackInfo", "TrackState", "evaluation", "make_cue_frame", "make_tracker", "optimise",
    "track_init", "track_step",
]  # fmt: skip

#: Fewer surface voxels than these say nothing of a pose.
LEAST_VOXELS = 60
#: In which step sizes are learnt: a centimetre, and a degree.
_UNITS = np.where(FREE < 3, 0.01, np.radians(1.0))


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
    rescue : RescueSettings or None
        None: a limb that is lost stays so, as in the paper.
    """

    cues: CueSettings = field(default_factory=CueSettings)
    descent: SmdSettings = field(default_factory=SmdSettings)
    levenberg: LmSettings = field(default_factory=LmSettings)
    optimiser: str = "smd"
    times: int = 1
    tolerance_m: float = 0.02
    tolerance_deg: float = 2.0
    refine_share: float = 0.5
    predict: float = 0.5
    rescue: RescueSettings | None = field(default_factory=RescueSettings)


@dataclass(frozen=True)
class SmdTracker(SampledBody):
    """A person's body and how it is followed."""

    preset: SmdPreset


@dataclass(frozen=True)
class TrackState:
    """Between two frames.

    Parameters
    ----------
    state, velocity : ndarray, shape (37,)
        Pose and its last change.
    colors : ColorModel or None
        None before the first frame, and where colors do not count.
    """

    state: np.ndarray
    velocity: np.ndarray
    colors: ColorModel | None = None


@dataclass(frozen=True)
class TrackInfo:
    """How a frame went.

    Parameters
    ----------
    status : str
        "fitted", or why not.
    value : float
        The objective at the last iteration's parameters and samples.
    iterations : ndarray of int, shape (6,)
        Of the full pose and of each chain.
    views : ndarray of int
        In which edges were looked for.
    """

    status: str
    value: float
    iterations: np.ndarray
    views: np.ndarray = field(default_factory=lambda: np.zeros(0, int))


def make_tracker(skeleton: BodyModel, preset: SmdPreset) -> SmdTracker:
    """Flesh out a skeleton and lay samples on it."""
    body = solid_body(skeleton)
    return SmdTracker(body, surface_grid(body), make_strips(body), preset)


def track_init(state: np.ndarray) -> TrackState:
    """A person in this pose (37,), at rest."""
    return TrackState(np.asarray(state, float), np.zeros(len(state)))


def track_step(rng: np.random.Generator, tracker: SmdTracker, before: TrackState, observed: Skin | None) -> tuple[TrackState, TrackInfo]:
    """The person's state after one more frame.

    Parameters
    ----------
    rng : numpy.random.Generator
    tracker : SmdTracker
    before : TrackState
    observed : Skin or None
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
    start = np.clip((before.state + preset.predict * before.velocity)[FREE], low, high)
    frame = make_cue_frame(tracker, observed, start, before.colors, before.state)
    parameters, first, _ = optimise(rng, frame, start, [np.arange(len(FREE))])
    parameters, second, value = optimise(rng, frame, parameters, CHAINS, preset.refine_share)
    parameters = _rescued(rng, frame, parameters)
    state = before.state.copy()
    state[FREE] = parameters
    info = TrackInfo("fitted", value, np.concatenate([first, second]), frame.chosen)
    return TrackState(state, state - before.state, _new_colors(frame, observed, parameters, before.colors)), info


def _rescued(rng: np.random.Generator, frame: CueFrame, parameters: np.ndarray) -> np.ndarray:
    """The parameters with a lost limb where it covers more."""
    tracker, settings = frame.tracker, frame.tracker.preset.rescue
    if settings is None:
        return parameters

    def lost_at(at: np.ndarray) -> np.ndarray:
        grid = tracker.grid
        points = place(_posed(tracker, at, frame.base), grid.points[::3], grid.segment[::3])
        return uncovered(points, frame.cloud, settings.far_m)

    lost = lost_at(parameters)
    if len(lost) < settings.share * len(frame.cloud.points):
        return parameters
    found = propose_limb(rng, tracker.body, tracker.grid, frame.cloud, parameters, lost, settings)
    if found is None:
        return parameters
    chain, trial = found
    trial, _, _ = optimise(rng, frame, trial, [CHAINS[chain]], tracker.preset.refine_share)
    return trial if len(lost_at(trial)) <= settings.gain * len(lost) else parameters


@dataclass(frozen=True)
class CueFrame:
    """A tracker and a frame made ready.

    Parameters
    ----------
    tracker : SmdTracker
    cloud : VoxelCloud
    maps : EdgeMaps or None
        None: no edges.
    chosen : ndarray of int
        Views that edges are looked for in.
    base : ndarray, shape (37,)
        A pose with the waist as it is held.
    """

    tracker: SmdTracker
    cloud: VoxelCloud
    maps: EdgeMaps | None
    chosen: np.ndarray
    base: np.ndarray = field(default_factory=lambda: np.zeros(N_DOF))

    def draw(self, rng: np.random.Generator, trunk: bool) -> Draw:
        """Samples for the whole body, or for the chains."""
        tracker = self.tracker
        n_views = 0 if self.maps is None or (trunk and not tracker.preset.cues.full_edges) else len(self.maps.views)
        return draw_cues(rng, tracker, self.cloud, n_views, tracker.preset.cues, tracker.preset.times, trunk)

    def match(self, parameters: np.ndarray, drawn: Draw) -> tuple[Matches, np.ndarray]:
        """Matches of drawn samples at some parameters (24,), and their Jacobian."""
        tracker = self.tracker
        posed = _posed(tracker, parameters, self.base)
        matches = match_cues(tracker, posed, self.cloud, self.maps, drawn, tracker.preset.cues)
        return matches, jacobian(posed, matches)


def make_cue_frame(
    tracker: SmdTracker, observed: Skin, parameters: np.ndarray, colors: ColorModel | None = None, base: np.ndarray | None = None
) -> CueFrame:
    """Sort out the voxels' colors, choose the views and find their edges.

    Parameters
    ----------
    tracker : SmdTracker
    observed : Skin
    parameters : ndarray, shape (24,)
        Where the body is expected.
    colors : ColorModel, optional
    base : ndarray, shape (37,), optional
        A pose with the waist as it is to be held; straight by default, as in the paper.
    """
    cues, base = tracker.preset.cues, np.zeros(N_DOF) if base is None else base
    fits = None
    if cues.colors is not None and observed.colors is not None and colors is not None:
        fits = color_fits(colors, observed.colors, cues.colors)
    cloud = voxel_cloud(observed.points, fits)
    usable = np.array([crop is not None for crop in observed.crops], bool)
    if cues.edge_weight == 0 or observed.views is None or not usable.any():
        return CueFrame(tracker, cloud, None, np.zeros(0, int), base)
    shown = shown_contours(tracker, _posed(tracker, parameters, base), observed.views)
    chosen = best_views(shown, usable, cues.views)
    crops = [crop for k in chosen if (crop := observed.crops[k]) is not None]
    return CueFrame(tracker, cloud, edge_maps(observed.views.select(chosen), crops, shown[chosen], cues.edges), chosen, base)


def optimise(
    rng: np.random.Generator, frame: CueFrame, parameters: np.ndarray, groups: Sequence[np.ndarray], tolerance_share: float = 1.0
) -> tuple[np.ndarray, np.ndarray, float]:
    """Descend in some groups of parameters with the preset's optimiser.

    Parameters
    ----------
    rng : numpy.random.Generator
    frame : CueFrame
    parameters : ndarray, shape (24,)
    groups : sequence of ndarray of int
        All parameters, or the chains.
    tolerance_share : float
        On the preset's tolerances.

    Returns
    -------
    parameters : ndarray, shape (24,)
    iterations : ndarray of int, one a group
    value : float
        Of the objective at the last iteration's parameters and samples.
    """
    preset, limits = frame.tracker.preset, frame.tracker.body.skeleton.limits
    low, high = limits.low[FREE], limits.high[FREE]
    trunk = any((group < 6).any() for group in groups)  # the chains leave it where it is
    moved = np.array([_moved_groups(group) for group in groups])
    first = frame.draw(rng, trunk)

    def matched(at: np.ndarray, going: np.ndarray, drawn: Draw) -> tuple[Matches, np.ndarray]:
        """What has come to rest needs no samples."""
        still = moved[going].any(axis=0)
        return frame.match(at, drawn if still.all() else draw_of_groups(drawn, frame.tracker, still))

    if preset.optimiser == "lm":
        alone = np.eye(len(groups), dtype=bool)
        by_group = [partial(matched, going=row, drawn=first) for row in alone]
        return lm_run(by_group, parameters, low, high, groups, preset.cues.width, preset.levenberg)

    def objective(at: np.ndarray, going: np.ndarray) -> Evaluation:
        return evaluation(*matched(at, going, frame.draw(rng, trunk) if preset.optimiser == "smd" else first), preset.cues.width)

    tolerance = tolerance_share * np.where(FREE < 3, preset.tolerance_m, np.radians(preset.tolerance_deg))
    found, info = smd_run(objective, parameters, (low, high), tolerance, preset.descent, groups, _UNITS)
    return found, info.iterations, float(info.values[-1])


def _moved_groups(dofs: np.ndarray) -> np.ndarray:
    """Which of `GROUPS` some of the 24 degrees of freedom move, shape (6,)."""
    if (dofs < 6).any():
        return np.ones(len(GROUPS), bool)
    return np.array([False, *(np.isin(chain, dofs).any() for chain in CHAINS)])


def evaluation(matches: Matches, rows: np.ndarray, width: float) -> Evaluation:
    """The objective in the form the descent takes. Its curvature is that of matches without error, the most there is."""
    value, gradient, slopes = evaluate(matches, rows, width)

    def curvature() -> np.ndarray:
        flat = rows.reshape(-1, rows.shape[-1])
        return (flat * np.repeat(matches.weight / width, 3)[:, None]).T @ flat

    return Evaluation(value, gradient, lambda vector: gauss_newton_product(rows, slopes, vector), curvature)


def _new_colors(frame: CueFrame, observed: Skin, parameters: np.ndarray, colors: ColorModel | None) -> ColorModel | None:
    """Colors of the patches after a frame."""
    settings, tracker = frame.tracker.preset.cues.colors, frame.tracker
    if settings is None or observed.colors is None:
        return colors
    posed = _posed(tracker, parameters, frame.base)
    if colors is None:
        return learn_colors(tracker.grid, posed, frame.cloud, observed.colors, settings)
    return update_colors(colors, tracker.grid, posed, frame.cloud, observed.colors, settings)


def _posed(tracker: SmdTracker, parameters: np.ndarray, base: np.ndarray) -> PosedBody:
    state = base.copy()
    state[FREE] = parameters
    return pose_body(tracker.body, state)
