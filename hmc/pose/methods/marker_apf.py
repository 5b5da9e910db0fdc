"""The annealed particle filter on markers: detections in all views, of one person. Canton (2009), sections 6.4 and 6.6."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.body.joints import canton_limits, default_limits
from hmc.body.marker_places import fit_tips, with_skin_markers
from hmc.body.model import BodyModel
from hmc.body.proportions import canton_body, default_body
from hmc.errors import InputError
from hmc.pose.legs import LegSettings
from hmc.pose.method import Capture, FrameRng, PoseMethod, StartPose, StepResult, Tracked, begin_tracking, make_subject, other_rng
from hmc.pose.objectives.marker_points import find_points
from hmc.pose.steps.marker_filter import TIPS, MarkerPreset, marker_frame, on_markers, with_tips
from hmc.pose.steps.marker_search import LEAST_POINTS, left_over, start_poses
from hmc.pose.views.markers import SeenMarkers
from hmc.pose.views.person_view import PersonView

__all__ = ["MarkerRecovery", "MarkerStart", "marker_method"]

#: The pose is begun in the best of this many frames, evenly spread over this time from the first in which enough points were found.
START_FRAMES, START_S = 4, 0.5
#: So many first poses are tried on so many frames.
TRIALS, TRIAL_FRAMES = 5, 12
#: A first pose is tried only if its cost is at most so many times the least one.
RIVAL_COST = 2.0
#: Statures that are tried where none is given, metres.
HEIGHTS_M = (1.55, 1.65, 1.75, 1.85, 1.95)
#: After this many frames without a pose it is begun anew.
LOST_FRAMES = 10
#: So many points that several views agree on, away from the person, are another person's.
ANOTHER_PERSON = 8
#: Where markers are worn is learnt from at most this many frames.
LEARN_FRAMES = 60
#: How long the person is watched first, seconds.
WINDOW_S = 2.0
#: Of the random numbers: of a first pose, of the frames that prove it, and of those from which the markers' positions are learnt.
STARTING, PROVING, LEARNING = 3, 2, 4
#: Every way counts as what it costs: in which one a frame's filter ended says nothing.
TELLING_APART = LegSettings(doubt=0.0, jump_weight=5e-5, arms_too=True)
_LOST = "lost"


@dataclass(frozen=True)
class MarkerStart:
    """The first pose from markers alone, and where they are worn.

    Parameters
    ----------
    preset : MarkerPreset
    skin : bool
        Markers are worn on the skin, and where exactly is learnt from the first frames if the preset refines; otherwise they are the
        joint centres themselves.
    """

    preset: MarkerPreset
    skin: bool = True

    def __call__(
        self, frame_rng: FrameRng, views: Sequence[PersonView], capture: Capture, height_m: float | None = None
    ) -> StartPose | None:
        """The body, the pose and the positions of the markers; None where no frame has enough points that views agree on.

        Raises
        ------
        InputError
            When more than one person wears markers.
        """
        seen = [view.markers for view in views]
        begun = self._begin(frame_rng, seen, capture, height_m)
        if begun is None:
            return None
        anchor, tracked = begun
        if self.skin and self.preset.refine:
            tracked = self._learnt(frame_rng, seen, anchor, tracked)
        return StartPose(tracked.subject, anchor, tracked.state, tracked.memory)

    def _begin(self, frame_rng, seen: Sequence[SeenMarkers | None], capture: Capture, height_m: float | None) -> tuple[int, Tracked] | None:
        """The frame in which the first pose fits best, and the pose."""
        heights = HEIGHTS_M if height_m is None else (height_m,)
        best, least, others, tried, spacing = None, np.inf, 0, 0, max(1, round(START_S * capture.fps / START_FRAMES))
        k = 0
        while k < len(seen) and tried < START_FRAMES:
            points, agreeing = _points(seen[k], capture)
            if len(points) < LEAST_POINTS:
                k += 1
                continue
            for height in heights:
                body = self._body(height)
                markers = with_skin_markers(body) if self.skin else body
                starts = start_poses(other_rng(frame_rng(k), STARTING), markers, points, agreeing)
                if starts and starts[0][1] < least:
                    least = starts[0][1]
                    best = k, body, markers, [state for state, cost in starts[:TRIALS] if cost <= RIVAL_COST * least]
                    others = left_over(markers, starts[0][0], points, agreeing)
            tried += 1
            k += spacing
        if best is None:
            return None
        if others >= ANOTHER_PERSON:
            raise InputError(
                f"more than one person seems to wear markers: {others} points that several views agree on are away "
                "from the person that was found; this method follows one: give the detections of one person"
            )
        k, body, markers, states = best
        subject = make_subject(body, capture)
        trials = [begin_tracking(subject, state, memory={TIPS: markers.tips}) for state in states]
        return k, self._proved(frame_rng, seen, k, trials)

    def _body(self, height_m: float) -> BodyModel:
        return canton_body(height_m) if self.preset.body == "canton" else default_body(height_m)

    def _proved(self, frame_rng, seen, first: int, trials: list[Tracked]) -> Tracked:
        """Of several first poses the one that the next frames bear out: a body the wrong way round fits one frame, but not a motion."""
        if len(trials) == 1:
            return trials[0]
        costs = []
        for trial in trials:
            now, total = trial, []
            for k in range(first, min(first + TRIAL_FRAMES, len(seen))):
                if seen[k] is not None:
                    now, info = marker_frame(other_rng(frame_rng(k), PROVING), now, seen[k], self.preset)
                    total.append(1.0 if np.isnan(info.cost) else info.cost)
            costs.append(np.mean(total))
        return trials[int(np.argmin(costs))]

    def _learnt(self, frame_rng, seen, anchor: int, tracked: Tracked) -> Tracked:
        """The same with the markers where the first frames show that they are worn."""
        states, points, now = [], [], tracked
        for k in range(anchor, min(anchor + LEARN_FRAMES, len(seen))):
            if seen[k] is not None:
                now, info = marker_frame(other_rng(frame_rng(k), LEARNING), now, seen[k], self.preset)
                states.append(now.state)
                points.append(info.points)
        markers = fit_tips(tracked.subject.body, with_tips(tracked), np.array(states), np.array(points))
        return replace(tracked, memory={**tracked.memory, TIPS: markers.tips})


def _points(seen: SeenMarkers | None, capture: Capture) -> tuple[np.ndarray, np.ndarray]:
    """Points that several views agree on, and how many do."""
    return (np.zeros((0, 3)), np.zeros(0, int)) if seen is None else find_points(seen, capture.room)


@dataclass(frozen=True)
class MarkerRecovery:
    """A pose that has been without markers for some frames is begun anew."""

    def first(self, costs: np.ndarray) -> dict[str, np.ndarray]:
        """Nothing is lost."""
        return {_LOST: np.zeros(1)}

    def __call__(self, rng: np.random.Generator, before: Tracked, stepped: StepResult, view: PersonView) -> StepResult:
        """The step's pose, or a first one of this frame, from which the next goes on."""
        tracked, info = stepped
        lost = 0.0 if info.status == "fitted" else float(before.memory.get(_LOST, np.zeros(1))[0]) + 1
        if lost >= LOST_FRAMES:
            tracked, lost = _begun_anew(rng, tracked, view, lost)
        return replace(tracked, memory={**tracked.memory, _LOST: np.array([lost])}), info


def _begun_anew(rng: np.random.Generator, tracked: Tracked, view: PersonView, lost: float) -> tuple[Tracked, float]:
    points, views = _points(view.markers, tracked.subject.capture)
    starts = start_poses(other_rng(rng, STARTING), with_tips(tracked), points, views)
    if not starts:
        return tracked, lost
    tips = {name: values for name, values in tracked.memory.items() if name == TIPS}
    return begin_tracking(tracked.subject, starts[0][0], memory=tips), 0.0


def marker_method(preset: MarkerPreset, skin: bool = True) -> PoseMethod:
    """The method of a preset.

    Parameters
    ----------
    preset : MarkerPreset
    skin : bool
        As for `MarkerStart`.
    """
    return PoseMethod(
        "marker-apf",
        preset.source,
        start=MarkerStart(preset, skin),
        step=on_markers(preset),
        needs=frozenset({"detections"}),
        recover=MarkerRecovery() if preset.search else None,
        legs=TELLING_APART if preset.search else None,
        limits=canton_limits() if preset.body == "canton" else default_limits(),
        window_s=WINDOW_S,
        gate_px=preset.likelihood.gate_px,
        settings=preset,
    )
