"""One person's poses from a table of marker detections, frame by frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import landmarks
from hmc.body.marker_places import fit_tips, with_skin_markers
from hmc.body.model import BodyModel
from hmc.body.proportions import canton_body, default_body
from hmc.camera.epipolar import undistorted_pixels
from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.io.detections import DetectionTable
from hmc.io.results import PoseStates, PoseTable
from hmc.pose.legs import LegChoice, LegSettings, choose_legs
from hmc.pose.objectives.epipolar import SeenMarkers, marker_views, observe_markers
from hmc.pose.objectives.marker_points import find_points
from hmc.pose.sequence import PosedPeople
from hmc.pose.steps.annealed import PoseState, pose_init
from hmc.pose.steps.marker_filter import MarkerFilter, MarkerInfo, MarkerPreset, make_marker_filter, marker_step
from hmc.pose.steps.marker_limbs import LIMBS
from hmc.pose.steps.marker_search import LEAST_POINTS, left_over, start_poses

__all__ = ["pose_from_markers", "seen_in_frame"]

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
#: So many points that several views agree on, away from the person, are somebody else's.
SOMEBODY_ELSE = 8
#: Where markers are worn is learnt from at most this many frames.
LEARN_FRAMES = 60
#: Every way counts as what it costs: in which one a frame's filter ended says nothing.
TELLING_APART = LegSettings(doubt=0.0, jump_weight=5e-5)


def seen_in_frame(rig: Rig, views, detections: Sequence[np.ndarray], gate_px: float) -> SeenMarkers:
    """One frame's detections, pixels as the images have them, ready for the likelihood.

    Parameters
    ----------
    rig : Rig
    views : MarkerViews
        From `hmc.pose.objectives.epipolar.marker_views`.
    detections : sequence of ndarray, shape (n, 2)
        One array a camera.
    gate_px : float
    """
    return observe_markers(views, [undistorted_pixels(camera, uv) for camera, uv in zip(rig, detections, strict=True)], gate_px)


def pose_from_markers(
    rig: Rig,
    table: DetectionTable,
    frames: Sequence[int],
    fps: float,
    preset: MarkerPreset,
    seed: int = 0,
    *,
    height_m: float | None = None,
    skin: bool = True,
    room: np.ndarray | None = None,
    progress: Callable[[Iterable[Any], int], Iterable[Any]] | None = None,
) -> PosedPeople:
    """Estimate the poses of one person who wears markers.

    Parameters
    ----------
    rig : Rig
    table : DetectionTable
    frames : sequence of int
        Absolute frame numbers, rising.
    fps : float
    preset : MarkerPreset
    seed : int
        The same seed gives the same result.
    height_m : float, optional
        Stature; the best of several where left out.
    skin : bool
        Markers are worn on the skin, and where exactly is learnt from the first frames if the preset refines; otherwise they are the
        joint centres themselves.
    room : ndarray, shape (2, 3), optional
        Where the person may be, metres.
    progress : callable, optional
        ``progress(frames, total)`` passes the frames on and may show how far they are.

    Returns
    -------
    PosedPeople
        Person 0, with the costs of Eq. 6.9; NaN in frames without a pose.

    Raises
    ------
    InputError
        When there is nowhere in these frames a pose to begin with, or more than one person wears markers.
    """
    views = marker_views(rig)
    by_frame = {frame: table.in_frame(frame, rig.names) for frame in frames}

    def seen(frame: int) -> SeenMarkers:
        return seen_in_frame(rig, views, by_frame[frame], preset.likelihood.gate_px)

    anchor, body, markers, state = _begin(seed, seen, frames, fps, preset, height_m, skin, room)
    if skin and preset.refine:
        states, points = [], []
        pose, filt = pose_init(state), make_marker_filter(markers, preset, fps)
        for frame in frames[anchor : anchor + LEARN_FRAMES]:
            pose, info = marker_step(_rng(seed, frame, 0), filt, pose, seen(frame))
            states.append(pose.state)
            points.append(info.points)
        markers = fit_tips(body, markers, np.array(states), np.array(points))

    filt = make_marker_filter(markers, preset, fps)
    order = [*range(anchor, len(frames)), *range(anchor - 1, -1, -1)]
    found: dict[int, tuple[PoseState, MarkerInfo]] = {}
    pose, lost = pose_init(state), 0
    for k in progress(order, len(order)) if progress else order:
        if k == anchor - 1:
            pose, lost = pose_init(found[anchor][0].state), 0
        one = seen(frames[k])
        pose, lost = _begun_anew(_rng(seed, frames[k], 3), filt, pose, lost, one, room)
        pose, info = marker_step(_rng(seed, frames[k], 1), filt, pose, one)
        lost = 0 if info.status == "fitted" else lost + 1
        found[k] = pose, info
    return _people(frames, body, _limbs_told_apart(frames, fps, markers, found))


def _rng(seed: int, frame: int, stage: int) -> np.random.Generator:
    return np.random.default_rng([seed, int(frame), stage])


def _body(preset: MarkerPreset, height_m: float) -> BodyModel:
    return canton_body(height_m) if preset.body == "canton" else default_body(height_m)


def _begin(seed, seen, frames, fps, preset, height_m, skin, room) -> tuple[int, BodyModel, BodyModel, np.ndarray]:
    """The frame in which the first pose fits best, the body without and with markers, and the pose."""
    heights = HEIGHTS_M if height_m is None else (height_m,)
    best, least, others, tried, spacing = None, np.inf, 0, 0, max(1, round(START_S * fps / START_FRAMES))
    k = 0
    while k < len(frames) and tried < START_FRAMES:
        points, agreeing = find_points(seen(frames[k]), room)
        if len(points) < LEAST_POINTS:
            k += 1
            continue
        for height in heights:
            body = _body(preset, height)
            markers = with_skin_markers(body) if skin else body
            starts = start_poses(_rng(seed, frames[k], 3), markers, points, agreeing)
            if starts and starts[0][1] < least:
                least = starts[0][1]
                worth_trying = [state for state, cost in starts[:TRIALS] if cost <= RIVAL_COST * least]
                best = k, body, markers, worth_trying
                others = left_over(markers, starts[0][0], points, agreeing)
        tried += 1
        k += spacing
    if best is None:
        raise InputError(
            f"in no frame do {LEAST_POINTS} markers or more appear in enough views at places that agree; "
            "check the detections and the calibration"
        )
    if others >= SOMEBODY_ELSE:
        raise InputError(
            f"more than one person seems to wear markers: in frame {frames[best[0]]}, {others} points that several views agree on are away "
            "from the person that was found; this method follows one: give the detections of one person"
        )
    k, body, markers, states = best
    return k, body, markers, _proved(seen, frames[k : k + TRIAL_FRAMES], make_marker_filter(markers, preset, fps), states)


def _proved(seen, frames: Sequence[int], filt: MarkerFilter, states: list[np.ndarray]) -> np.ndarray:
    """Of several first poses the one that the next frames bear out: a body the wrong way round fits one frame, but not a motion."""
    if len(states) == 1:
        return states[0]
    costs = []
    for state in states:
        pose, total = pose_init(state), []
        for frame in frames:
            pose, info = marker_step(_rng(0, frame, 2), filt, pose, seen(frame))
            total.append(1.0 if np.isnan(info.cost) else info.cost)
        costs.append(np.mean(total))
    return states[int(np.argmin(costs))]


def _begun_anew(rng, filt: MarkerFilter, pose: PoseState, lost: int, seen: SeenMarkers, room) -> tuple[PoseState, int]:
    if lost < LOST_FRAMES:
        return pose, lost
    starts = start_poses(rng, filt.body, *find_points(seen, room))
    return (pose_init(starts[0][0]), 0) if starts else (pose, lost)


def _limbs_told_apart(
    frames: Sequence[int], fps: float, body: BodyModel, found: dict[int, tuple[PoseState, MarkerInfo]]
) -> dict[int, tuple[PoseState, MarkerInfo]]:
    """The same poses with limbs as the whole motion has them, where every frame offers several ways."""
    choices = [found[k][1].choice for k in range(len(frames))]
    ways = max((len(one.costs) for one in choices if one is not None), default=1)
    # A frame that tells nothing has the same pose in all ways.
    same = [LegChoice(np.repeat(found[k][0].state[None], ways, axis=0), np.zeros(ways)) for k in range(len(frames))]
    known = [other if one is None or len(one.costs) < ways else one for one, other in zip(choices, same, strict=True)]
    points = np.array([landmarks(body, one.states)[:, LIMBS] for one in known])
    picks = choose_legs(np.array(frames), np.array([one.costs for one in known]), points, fps, TELLING_APART)
    return {k: (replace(found[k][0], state=known[k].states[pick]), found[k][1]) for k, pick in enumerate(picks)}


def _people(frames: Sequence[int], body: BodyModel, found: dict[int, tuple[PoseState, MarkerInfo]]) -> PosedPeople:
    states = np.array([found[k][0].state for k in range(len(frames))])
    status = [found[k][1].status for k in range(len(frames))]
    fitted = np.array([one == "fitted" for one in status])
    positions = np.where(fitted[:, None, None], landmarks(body, states), np.nan)
    numbers, persons = np.array(frames, int), np.zeros(len(frames), int)
    notes = [
        f"{n} frame{'s' if n > 1 else ''} without a pose: {why}"
        for why, n in sorted(Counter(one for one in status if one != "fitted").items())
    ]
    return PosedPeople(
        PoseTable(numbers, persons, positions),
        PoseStates(numbers, persons, states, DOF_NAMES, {0: body.dimensions}),
        np.where(fitted, [found[k][1].cost for k in range(len(frames))], np.nan),
        tuple(notes),
    )
