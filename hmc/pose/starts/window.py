"""How a person's tracking starts: the first seconds decide the heading, left and right, and the body's dimensions.

1. Candidate poses from several frames of the window (`hmc.pose.starts.templates`), with the versions that a hull confuses.
2. The most promising are followed for some frames; the mean cost decides, and walking backwards counts against a candidate.
3. The winner is followed through the window, the body's dimensions are fitted to some of its frames, and kept if the other
   frames agree; then the window is followed once more with that body.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.body.exchange import swapped_poses
from hmc.body.flesh import surface_coordinates
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import canton_body, default_body
from hmc.pose.objectives.residuals import residual_values
from hmc.pose.starts.fit_body import FitBodyInfo, fit_body
from hmc.pose.starts.spectral import spectral_poses
from hmc.pose.starts.templates import first_poses
from hmc.pose.steps.annealed import PoseFilter, PoseInfo, PoseState, make_filter, pose_init, pose_step
from hmc.pose.steps.limb_search import LIMBS, search_limbs
from hmc.pose.steps.preset import PosePreset
from hmc.pose.steps.refine import refine
from hmc.pose.steps.scalable import step_of
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_explain
from hmc.search.filters import AnnealedSettings

__all__ = ["StartSettings", "Started", "estimate_height", "follow", "possible_heights", "start_person", "walk_factor"]

#: Fewer frames say too little of a body: what they cannot tell apart, such as fat silhouettes from a tall person, would be fitted.
LEAST_BODY_FRAMES = 6
#: Fewer surface voxels are too little of a person to start from.
LEAST_START_SURFACE = 50
#: The window's frames are thinned out to about so many a second before body and first pose are decided.
DECIDE_FPS = 30.0
#: A hull that ends lower than this is no adult who stands, metres; below the second, it is no child either.
ADULT_M, CHILD_M = 1.45, 0.9
#: An adult's mean stature, metres.
ADULT_MEAN_M = 1.7
#: A child is believed where its cost is below this share of an adult's who sits, kneels or bends.
CHILD_GAIN = 0.9
#: Random generator of a frame: the same whatever the order in which frames are visited.
FrameRng = Callable[[int], np.random.Generator]


@dataclass(frozen=True)
class StartSettings:
    """How the first pose is found.

    Parameters
    ----------
    anchors : int
        Frames of the window from which candidates are taken.
    candidates : int
        Candidates followed.
    follow_s : float
        How long each is followed, seconds.
    walk_speed_m_s : float
        Above this speed of the track, a body is taken to face where it goes.
    walk_penalty : float
        Share by which facing straight backwards raises the cost.
    body_frames : int
        Frames to which the body's dimensions are fitted.
    """

    anchors: int = 3
    candidates: int = 5
    follow_s: float = 0.4
    walk_speed_m_s: float = 0.5
    walk_penalty: float = 2.0
    body_frames: int = 12


@dataclass(frozen=True)
class Started:
    """A person's first seconds.

    Parameters
    ----------
    filter : PoseFilter
        With the fitted body.
    states : list of PoseState
        One a frame of the window.
    infos : list of PoseInfo
    candidates : ndarray, shape (n,)
        Mean cost of each candidate that was followed, the winner first; square metres.
    fit : FitBodyInfo or None
    """

    filter: PoseFilter
    states: list[PoseState]
    infos: list[PoseInfo]
    candidates: np.ndarray
    fit: FitBodyInfo | None


def estimate_height(targets: Sequence[HullTarget | None], floor_z: float = 0.0) -> float:
    """Stature from the tracked volume: how high the top of the hull commonly comes, if that is as high as an adult who stands.

    The first of `possible_heights`.

    Parameters
    ----------
    targets : sequence of HullTarget or None
        A person's hulls in some frames.
    floor_z : float
        Height of the floor, metres.

    Returns
    -------
    float
        Metres; an adult's mean stature where the person never stood up.
    """
    return possible_heights(targets, floor_z)[0]


def possible_heights(targets: Sequence[HullTarget | None], floor_z: float = 0.0) -> tuple[float, ...]:
    """Statures that the tracked volume allows: an adult's, and where its top is low, also that of a child who stands.

    Parameters
    ----------
    targets, floor_z
        As for `estimate_height`.

    Returns
    -------
    tuple of float
        One or two, metres, the likelier first.
    """
    tops = [np.quantile(t.surface[:, 2], 0.995) - floor_z for t in targets if t is not None and len(t.surface) >= LEAST_START_SURFACE]
    # Arms held up, hats and stray voxels reach above the crown: the median of the frames resists all that does not last.
    top = float(np.median(tops)) if tops else 0.0
    if top > ADULT_M:
        return (min(top, 2.0),)
    return (ADULT_MEAN_M, top) if top > CHILD_M else (ADULT_MEAN_M,)


def start_person(
    frame_rng: FrameRng,
    preset: PosePreset,
    fps: float,
    targets: Sequence[HullTarget | None],
    height_m: float | None = None,
    velocities: np.ndarray | None = None,
    room: np.ndarray | None = None,
    settings: StartSettings | None = None,
) -> Started | None:
    """Find a person's body and poses in the first seconds.

    Parameters
    ----------
    frame_rng : callable
        Frame of the window to `numpy.random.Generator`.
    preset : PosePreset
    fps : float
    targets : sequence of HullTarget or None
        The window's frames, in order.
    height_m : float, optional
        Stature where it is known; else `estimate_height`.
    velocities : ndarray, shape (n, 3), optional
        Of the track, metres a second.
    room : ndarray, shape (2, 3), optional
        Limits of the room, metres; its lowest z is the floor, 0 where left out.
    settings : StartSettings, optional

    Returns
    -------
    Started or None
        None where no frame of the window has a hull to start from.
    """
    settings = settings or StartSettings()
    velocities = np.zeros((len(targets), 3)) if velocities is None else velocities
    # Of a fast recording, every so many frames decide, as many as of a slow one; then all are followed.
    stride = max(1, round(fps / DECIDE_FPS))
    if not _usable(targets[::stride]):
        stride = 1
    found = _decide(
        lambda k: frame_rng(k * stride), preset, fps / stride, targets[::stride], height_m, velocities[::stride], room, settings
    )
    if found is None:
        return None
    filt, anchor, state, costs, fit = found
    if stride > 1:
        filt = replace(filt, drift=make_filter(filt.body, preset, fps).drift)
    states, infos = follow(frame_rng, filt, state, anchor * stride, targets, step_of(preset))
    return Started(filt, states, infos, costs, fit)


def _usable(targets: Sequence[HullTarget | None]) -> list[int]:
    """Frames with enough of a person to start from."""
    return [k for k, target in enumerate(targets) if target is not None and len(target.surface) >= LEAST_START_SURFACE]


def _decide(frame_rng, preset, fps, targets, height_m, velocities, room, settings):
    """The filter with the person's body, a frame and the pose in it, the candidates' costs and the fit; None without any hull."""
    usable = _usable(targets)
    if not usable:
        return None
    floor_z = 0.0 if room is None else float(room[0, 2])
    heights = (height_m,) if height_m else possible_heights(targets, floor_z)
    bodies = [canton_body(height) if preset.body == "canton" else default_body(height) for height in heights]
    earliest = targets[usable[0]]
    filters = [make_filter(body, preset, fps, earliest.voxel_size_m, room) for body in bodies]
    if preset.start == "neutral":
        filt, anchor, costs = filters[0], usable[0], np.array([np.nan])
        state = _neutral_start(bodies[0], earliest, velocities[: max(2, int(0.5 * fps))].mean(0), floor_z)
    else:
        starts = [_best_hypothesis(frame_rng, one, fps, targets, usable, velocities, floor_z, settings) for one in filters]
        child = int(len(starts) > 1 and starts[1][2][0] < CHILD_GAIN * starts[0][2][0])
        filt, (anchor, state, costs) = filters[child], starts[child]
    fit = None
    if preset.fit_body is not None:
        # What the body's dimensions are fitted to need not be the last word on the poses.
        states, infos = follow(frame_rng, _quick(filt), state, anchor, targets)
        filt, fit = _fit(frame_rng, filt, fps, targets, states, infos, settings, height_m is not None)
        state = states[anchor].state
    return filt, anchor, state, costs, fit


def follow(
    frame_rng: FrameRng, filt: PoseFilter, state: np.ndarray, anchor: int, targets: Sequence[HullTarget | None], step=pose_step
) -> tuple[list[PoseState], list[PoseInfo]]:
    """Track from one frame backwards to the first and forwards to the last.

    Parameters
    ----------
    frame_rng, filt, targets
        As for `start_person`.
    state : ndarray, shape (27,)
        Pose in the frame `anchor`.
    anchor : int
    step : callable
        As `hmc.pose.steps.annealed.pose_step`.

    Returns
    -------
    states, infos : list
        One a frame.
    """
    n = len(targets)
    found: dict[int, tuple[PoseState, PoseInfo]] = {}
    found[anchor] = step(frame_rng(anchor), filt, pose_init(state), targets[anchor])
    for order in (range(anchor + 1, n), range(anchor - 1, -1, -1)):
        current = replace(found[anchor][0], velocity=np.zeros_like(state))
        for k in order:
            found[k] = step(frame_rng(k), filt, current, targets[k])
            current = found[k][0]
    # Backwards, the velocity is that of time reversed; only the last frame's is used again, and that one is forward.
    return [found[k][0] for k in range(n)], [found[k][1] for k in range(n)]


def _neutral_start(body: BodyModel, target: HullTarget, velocity: np.ndarray, floor_z: float) -> np.ndarray:
    """Canton (2009), section 6.3.3: root under the centroid, heading of the walk, all else neutral."""
    state = neutral_state("down", body.limits)
    legs = body.dimensions["thigh"] + body.dimensions["shank"] + body.dimensions["ankle_height"]
    state[:3] = (*target.surface.mean(0)[:2], floor_z + legs)
    state[3] = np.arctan2(velocity[1], velocity[0])
    return state


def _best_hypothesis(frame_rng, filt, fps, targets, usable, velocities, floor_z, settings):
    """The frame and pose to start from, and the mean costs of all that were followed."""
    preset, body, samples = filt.preset, filt.body, filt.samples
    anchors = sorted({usable[round(q * (len(usable) - 1))] for q in np.linspace(0.1, 0.9, settings.anchors)})
    pool = []
    for anchor in anchors:
        rng = frame_rng(anchor)
        find = spectral_poses if preset.start == "spectral" else first_poses
        states, costs = find(rng, body, samples, targets[anchor], preset.symmetric, floor_z)
        costs = costs * walk_factor(states[:, 3], velocities[anchor], settings)
        pool += [(cost, anchor, state) for cost, state in zip(costs, states, strict=True)]
    pool.sort(key=lambda entry: entry[0])
    # All candidates are compared in the frame that was easiest to explain.
    anchor = pool[0][1]
    points = points_to_explain(frame_rng(anchor), targets[anchor], preset.fine_hull_points, preset.symmetric.ray_share)
    here = [state for _, where, state in pool if where == anchor]
    trials = [*here, *swapped_poses(body, here[0]), *swapped_poses(body, here[min(1, len(here) - 1)])]
    refined = [refine(body, samples, trial, targets[anchor], points, preset.symmetric, preset.refine) for trial in trials]
    refined.sort(key=lambda pair: pair[1].cost_after * walk_factor(pair[0][3], velocities[anchor], settings))
    chosen: list[np.ndarray] = []
    for state, _ in refined:
        if all(np.abs(landmarks(body, state) - landmarks(body, other)).max() > 0.08 for other in chosen):
            chosen.append(state)
        if len(chosen) == settings.candidates:
            break
    if preset.search is not None:
        chosen = [_search_all(frame_rng(anchor), filt, state, targets[anchor], points) for state in chosen]
    reach = max(2, round(settings.follow_s * fps))
    first, last = max(0, anchor - reach), min(len(targets), anchor + reach + 1)
    scores = []
    for state in chosen:
        path, infos = follow(lambda k: frame_rng(first + k), _quick(filt), state, anchor - first, targets[first:last])
        followed = np.array([info.cost for info in infos])
        headings = np.array([one.state[3] for one in path])
        scores.append(np.nanmean(followed * walk_factor(headings, velocities[first:last], settings)))
    order = np.argsort(scores)
    return anchor, chosen[order[0]], np.array(scores)[order]


def _quick(filt: PoseFilter) -> PoseFilter:
    """The same filter with a fraction of the work a frame."""
    annealed = AnnealedSettings(layers=2, particles=60, survival_rate=0.1, spread=0.5)
    return replace(filt, preset=replace(filt.preset, annealed=annealed, search=None))


def _search_all(rng, filt, state, target, points):
    """A candidate with each limb where it explains the hulls best."""
    preset = filt.preset
    values = residual_values(filt.body, filt.samples, state, target, points, preset.symmetric)
    cost = float(values @ values)
    return search_limbs(
        rng, filt.body, filt.samples, state, cost, list(LIMBS), target, points, preset.symmetric, preset.refine, preset.search
    )[0]


def walk_factor(headings: np.ndarray, velocities: np.ndarray, settings: StartSettings) -> np.ndarray:
    """By how much walking backwards raises a cost.

    Parameters
    ----------
    headings : ndarray, shape (n,)
        Radians about Z.
    velocities : ndarray, shape (n, 3) or (3,)
        Of the track, metres a second.
    settings : StartSettings

    Returns
    -------
    ndarray, shape (n,)
        1 for forwards or hardly moving, 1 + walk_penalty for straight back.
    """
    speed = np.hypot(velocities[..., 0], velocities[..., 1])
    forwards = (np.cos(headings) * velocities[..., 0] + np.sin(headings) * velocities[..., 1]) / np.maximum(speed, 1e-9)
    return np.where(speed > settings.walk_speed_m_s, 1 + settings.walk_penalty * (1 - forwards) / 2, 1.0)


def _fit(frame_rng, filt, fps, targets, states, infos, settings, height_known):
    """The body fitted to some frames of the window, if the others agree."""
    preset = filt.preset
    good = [k for k, info in enumerate(infos) if np.isfinite(info.cost)]
    if len(good) < LEAST_BODY_FRAMES:
        return filt, None
    # Frames in which the pose is in doubt teach nothing of the body: leave the worst third out.
    limit = np.quantile([infos[k].cost for k in good], 0.67)
    good = [k for k in good if infos[k].cost <= limit]
    held_out, rest = good[1::3], [k for k in good if k not in good[1::3]]
    picks = sorted({rest[round(q * (len(rest) - 1))] for q in np.linspace(0, 1, settings.body_frames)})
    held_out = held_out[:: max(1, len(held_out) // 8)]
    points = {
        k: points_to_explain(frame_rng(k), targets[k], preset.fine_hull_points, preset.symmetric.ray_share) for k in {*picks, *held_out}
    }
    fit_settings = replace(preset.fit_body, scale_deviation=0.015) if height_known else preset.fit_body
    body, _, info = fit_body(
        filt.body,
        surface_coordinates(filt.body, preset.surface_samples),
        np.array([states[k].state for k in picks]),
        [targets[k] for k in picks],
        [points[k] for k in picks],
        preset.symmetric,
        fit_settings,
    )
    fitted = make_filter(body, preset, fps, targets[picks[0]].voxel_size_m, filt.room)
    costs = [
        [refine(f.body, f.samples, states[k].state, targets[k], points[k], preset.symmetric, preset.refine)[1].cost_after for k in held_out]
        for f in (filt, fitted)
    ]
    accepted = np.mean(costs[1]) < 0.97 * np.mean(costs[0])
    return (fitted if accepted else filt), replace(info, accepted=bool(accepted))
