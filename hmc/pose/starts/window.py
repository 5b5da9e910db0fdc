"""How a person's tracking starts: the first seconds decide the heading, left and right, and the body's dimensions.

1. Candidate poses from several frames of the window (`hmc.pose.starts.templates`), with the versions that a hull confuses.
2. The best are followed for some frames; the mean cost decides, and walking backwards counts against a candidate.
3. The winner is followed through the window, the body's dimensions are fitted to some of its frames, and kept if the other
   frames agree; then the window is followed once more with that body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from hmc.body.exchange import swapped_poses
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import canton_body, default_body, stiff_body
from hmc.pose.method import Capture, FrameRng, StartPose, StepInfo, Subject, Tracked, begin_tracking
from hmc.pose.starts.candidates import StartSettings, candidates, search_all, walk_factor
from hmc.pose.starts.fit_body import of_a_start
from hmc.pose.starts.own_body import choose_frames, own_body
from hmc.pose.starts.stature import possible_heights, usable_frames
from hmc.pose.starts.walk import quick_step, walk
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.polish import fine_objective
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.refine import refine
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.person_view import PersonView
from hmc.processes import share_out

__all__ = ["WindowStart"]

#: Frames of a window and how a pose was followed through them.
_Path = dict[int, tuple[Tracked, StepInfo]]
#: The window's frames are thinned out to about so many a second before body and first pose are decided.
DECIDE_FPS = 30.0
#: Another stature than the likeliest is believed where its cost is below this share of the likeliest one's.
OTHER_GAIN = 0.75


@dataclass(frozen=True)
class WindowStart:
    """The house's start: candidates from several frames of a window, the best followed for a while, and the body fitted.

    Parameters
    ----------
    preset : PosePreset
        Body, candidates (`PosePreset.start`), likelihood and refinement by which they are followed and compared.
    settings : StartSettings
    """

    preset: PosePreset
    settings: StartSettings = field(default_factory=StartSettings)

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """The body and the first pose of a person.

        Parameters
        ----------
        frame_rng : callable
            Frame of the window to `numpy.random.Generator`.
        views : sequence of PersonView
            The window's frames, in order.
        capture : Capture
        height_m : float, optional
            Stature where it is known; else `estimate_height`.

        Returns
        -------
        StartPose or None
            None where no frame of the window has a hull to start from.
        """
        # Of a fast recording, every so many frames decide, as many as of a slow one; then all are followed.
        stride = max(1, round(capture.fps / DECIDE_FPS))
        if not usable_frames(views[::stride]):
            stride = 1
        usable = usable_frames(views[::stride])
        if not usable:
            return None
        window = _Window(lambda k: frame_rng(k * stride), views[::stride], usable, replace(capture, fps=capture.fps / stride))
        found = self._decide(window, height_m)
        return replace(found, subject=replace(found.subject, capture=capture), anchor=found.anchor * stride)

    def _decide(self, window: _Window, height_m: float | None) -> StartPose:
        """The subject with the person's body, a frame and the pose in it, and the candidates' costs."""
        preset, capture = self.preset, window.capture
        heights = (height_m,) if height_m else possible_heights([view.target for view in window.views], capture.floor_z)
        make = {"default": default_body, "stiff": stiff_body, "canton": canton_body}[preset.body]
        bodies = [make(height) for height in heights]
        subjects = [annealed_subject(body, capture, preset) for body in bodies]
        known: _Path = {}
        if preset.start == "neutral":
            started = StartPose(subjects[0], window.usable[0], _neutral_start(bodies[0], window))
        else:
            starts = [_best_hypothesis(one, window, preset, self.settings) for one in subjects]
            likeliest, cheapest = starts[0], min(starts, key=lambda start: start[0].costs[0])
            started, known = cheapest if cheapest[0].costs[0] < OTHER_GAIN * likeliest[0].costs[0] else likeliest
        if preset.fit_body is None:
            return started
        # What the body's dimensions are fitted to need not be the last word on the poses.
        begun = begin_tracking(started.subject, started.state)
        path = walk(window.frame_rng, quick_step(preset), begun, started.anchor, window.views, known, capture.workers)
        subject = _fit(started.subject, window, path, self, height_m is not None)
        return replace(started, subject=subject, state=path[started.anchor][0].state)


@dataclass(frozen=True)
class _Window:
    """Frames of a window with their random numbers, and which of them show enough of a person to start from."""

    frame_rng: FrameRng
    views: Sequence[PersonView]
    usable: list[int]
    capture: Capture

    @property
    def velocities(self) -> np.ndarray:
        """The person's velocities in the window, by the track, shape (n, 3), metres a second."""
        return np.array([view.velocity for view in self.views])

    def target(self, k: int) -> HullTarget:
        """Hulls of a frame that has some."""
        target = self.views[k].target
        if target is None:
            raise ValueError(f"frame {k} of the window has no hulls")
        return target


def _neutral_start(body: BodyModel, window: _Window) -> np.ndarray:
    """Canton (2009), section 6.3.3: root under the centroid, heading of the walk, all else neutral."""
    velocity = window.velocities[: max(2, int(0.5 * window.capture.fps))].mean(0)
    state = neutral_state("down", body.limits)
    legs = body.dimensions["thigh"] + body.dimensions["shank"] + body.dimensions["ankle_height"]
    state[:3] = (*window.target(window.usable[0]).surface.mean(0)[:2], window.capture.floor_z + legs)
    state[3] = np.arctan2(velocity[1], velocity[0])
    return state


def _best_hypothesis(subject: Subject, window: _Window, preset: PosePreset, settings: StartSettings) -> tuple[StartPose, _Path]:
    """The frame and pose to start from, the mean costs of all that were followed, and how the best went."""
    usable, velocities, body = window.usable, window.velocities, subject.body
    anchors = sorted({usable[round(q * (len(usable) - 1))] for q in np.linspace(0.1, 0.9, settings.anchors)})
    pool, workers = [], window.capture.workers
    found = share_out([partial(candidates, window.frame_rng(anchor), subject, window.views[anchor], preset) for anchor in anchors], workers)
    for anchor, (states, costs) in zip(anchors, found, strict=True):
        costs = costs * walk_factor(states[:, 3], velocities[anchor], settings)
        pool += [(cost, anchor, state) for cost, state in zip(costs, states, strict=True)]
    pool.sort(key=lambda entry: entry[0])
    # All candidates are compared in the frame that was easiest to fit.
    anchor = pool[0][1]
    objective = fine_objective(window.frame_rng(anchor), subject, window.views[anchor], preset.polish)
    here = [state for _, where, state in pool if where == anchor]
    trials = [*here, *swapped_poses(body, here[0]), *swapped_poses(body, here[min(1, len(here) - 1)])]
    refined = [refine(objective, trial, preset.polish.refine) for trial in trials]
    refined.sort(key=lambda pair: pair[1].cost_after * walk_factor(pair[0][3], velocities[anchor], settings))
    chosen: list[np.ndarray] = []
    for state, _ in refined:
        if all(np.abs(landmarks(body, state) - landmarks(body, other)).max() > 0.08 for other in chosen):
            chosen.append(state)
        if len(chosen) == settings.candidates:
            break
    if preset.search is not None:
        searches = [partial(search_all, window.frame_rng(anchor), objective, state, preset.polish) for state in chosen]
        chosen = [state for state, _ in share_out(searches, workers)]
    scores, paths = _followed(subject, window, preset, settings, anchor, chosen)
    order = np.argsort(scores)
    ended = np.sort(scores)
    return StartPose(subject, anchor, chosen[order[0]], costs=ended[~np.isinf(ended)]), paths[order[0]]


def _followed(subject, window, preset, settings, anchor, chosen) -> tuple[list[float], list[_Path]]:
    """Every candidate over the frames around that in which they were found: its mean cost, and its poses.

    First all for a short while, and then those that are not far behind by then and go their own way; the others cost infinitely much.
    """
    frame_rng, step, workers = window.frame_rng, quick_step(preset), window.capture.workers
    # Both ways begin with the step in the frame between them.
    firsts = [partial(step, frame_rng(anchor), begin_tracking(subject, state), window.views[anchor]) for state in chosen]
    paths: list[_Path] = [{anchor: first} for first in share_out(firsts, workers)]
    scores, left = np.zeros(len(chosen)), list(range(len(chosen)))
    for follow_s in (*settings.trials_s, settings.follow_s):
        reach = max(2, round(follow_s * window.capture.fps))
        first, last = max(0, anchor - reach), min(len(window.views), anchor + reach + 1)

        def follow(k: int, part: range) -> list[tuple[Tracked, StepInfo]]:
            begin, views = part[0], window.views[part[0] : part[-1] + 1]
            known = {frame - begin: one for frame, one in paths[k].items()}
            return walk(lambda frame: frame_rng(begin + frame), step, begin_tracking(subject, chosen[k]), anchor - begin, views, known)

        halves = range(first, anchor + 1), range(anchor, last)
        found = share_out([partial(follow, k, half) for k in left for half in halves], workers)
        scores[:] = np.inf
        for k, before, after in zip(left, found[::2], found[1::2], strict=True):
            path = [*before, *after[1:]]
            followed = np.array([info.cost for _, info in path])
            headings = np.array([one.state[3] for one, _ in path])
            scores[k] = np.nanmean(followed * walk_factor(headings, window.velocities[first:last], settings))
            paths[k] = dict(enumerate(path, first))
        left = _going_on(subject.body, scores, paths, settings)
    return scores.tolist(), paths


def _going_on(body: BodyModel, scores: np.ndarray, paths: Sequence[_Path], settings: StartSettings) -> list[int]:
    """Which candidates are not far behind, the cheapest alone of those that are on the same way."""
    near = np.flatnonzero(~(scores > settings.behind * scores.min()))
    going: list[int] = []
    ends: list[np.ndarray] = []
    for k in near[np.argsort(scores[near], kind="stable")].tolist():
        here = landmarks(body, np.stack([paths[k][frame][0].state for frame in (min(paths[k]), max(paths[k]))]))
        if all(np.linalg.norm(here - there, axis=-1).max() > settings.same_m for there in ends):
            going.append(k)
            ends.append(here)
    return sorted(going)


def _fit(subject: Subject, window: _Window, path: Sequence[tuple[Tracked, StepInfo]], start: WindowStart, height_known: bool) -> Subject:
    """The subject with a body fitted to some frames of the window, if the others agree."""
    preset, settings = start.preset, start.settings
    if preset.fit_body is None:
        return subject
    chosen = choose_frames(np.array([info.cost for _, info in path]), settings.body_frames)
    poses = {
        # By the hulls alone: a detector's hips and shoulders are not the body's, and would become its lengths.
        k: (fine_objective(window.frame_rng(k), subject, replace(window.views[k], keypoints=None), preset.polish), path[k][0].state)
        for part in chosen
        for k in part
    }
    fitted, _ = own_body(
        subject,
        poses,
        chosen,
        of_a_start(preset.fit_body, height_known),
        preset.polish.refine,
        preset.surface_samples,
        lambda body: annealed_subject(body, subject.capture, preset),
    )
    return fitted
