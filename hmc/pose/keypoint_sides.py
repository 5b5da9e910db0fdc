"""In which cameras, and when, a detector took a person's left for the right: decided over all frames, before anything is followed.

One frame tells which cameras are the other way round than the rest (`hmc.pose.views.exchanged_sides`), not which of both is right. Over
time two things tell it: a person's left and right do not exchange places from one frame to the next, and few detections are exchanged.
Of all sequences of a frame's pattern or its complement the cheapest is taken (`hmc.search.paths`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from hmc.body.keypoint_places import BODY_KEYPOINTS, MIRRORED
from hmc.camera.model import Rig
from hmc.io.keypoints.source import KeypointSource
from hmc.io.results import TrackTable
from hmc.pose.views.exchanged_sides import FrameSides, sides_of_frame
from hmc.pose.views.keypoints import body_detections, lines_of_people
from hmc.processes import each_ahead
from hmc.search.paths import cheapest_path

__all__ = ["Turned", "exchanged_sides", "kept_or_exchanged"]

#: By frame and person, cameras that have exchanged left and right, bool (n_cameras,).
Turned = Mapping[int, Mapping[int, np.ndarray]]

#: What a camera that is turned costs, a second. Three of four cameras for two seconds, then, are still less than two breaks of continuity.
TURNED_COST = 15.0
#: How well the way from right to left is known, metres, and how fast it changes: arms and legs against one another, metres a second.
WAY_M, WAY_M_S = 0.08, 3.0
#: One way costs this at most, squared deviations.
MOST = 9.0
_LEFT = np.array([k for k, name in enumerate(BODY_KEYPOINTS) if name.startswith("l_")])


@dataclass
class _Chain:
    """One person's frames of which left and right can be told, for as long as they are read; ways from right to left of the last alone."""

    frames: list[int] = field(default_factory=list)
    turned: list[np.ndarray] = field(default_factory=list)
    other: list[np.ndarray] = field(default_factory=list)
    breaks: list[tuple[float, float]] = field(default_factory=list)
    ways: np.ndarray | None = None


def exchanged_sides(rig: Rig, tracks: TrackTable, source: KeypointSource, fps: float, workers: int = 1) -> dict[int, dict[int, np.ndarray]]:
    """Which cameras have exchanged left and right, of every person in every frame.

    Parameters
    ----------
    rig : Rig
    tracks : TrackTable
        Whose detections they are is told by where people are tracked.
    source : KeypointSource
    fps : float
        Frames a second.
    workers : int
        Processes that read frames and look at each by itself.

    Returns
    -------
    dict of int to dict of int to ndarray of bool, shape (n_cameras,)
        By frame and person; frames and persons without any such camera are left out.
    """
    chains: dict[int, _Chain] = {}
    frames = np.unique(tracks.frames).tolist() if len(rig) > 1 else []

    def told(some: Sequence[int]) -> Iterator[dict[int, FrameSides]]:
        for frame in some:
            people = lines_of_people(rig, body_detections(source, frame), tracks.at(frame))
            sides = {person: sides_of_frame(rig.centres, own.directions, own.deviation_m) for person, own in people.items()}
            yield {person: one for person, one in sides.items() if one.told.any()}

    for frame, of_people in zip(frames, each_ahead(told, frames, workers), strict=True):
        for person, sides in of_people.items():
            _append(chains.setdefault(person, _Chain()), frame, sides, fps)
    found: dict[int, dict[int, np.ndarray]] = {}
    for person, chain in chains.items():
        both = np.array([chain.turned, chain.other])
        states = cheapest_path(both.sum(axis=-1).T * TURNED_COST / fps, partial(_breaks, chain))
        for k in np.flatnonzero(both[states, np.arange(len(states))].any(axis=-1)).tolist():
            found.setdefault(chain.frames[k], {})[person] = both[states[k], k]
    return found


def _breaks(chain: _Chain, k: int) -> np.ndarray:
    """What it costs to be in the same state as in the frame before, and in the other, shape (2, 2)."""
    same, other = chain.breaks[k]
    return np.array([[same, other], [other, same]])


def _append(chain: _Chain, frame: int, sides: FrameSides, fps: float) -> None:
    ways = sides.points[_LEFT] - sides.points[MIRRORED[_LEFT]]
    chain.breaks.append((0.0, 0.0) if chain.ways is None else kept_or_exchanged(chain.ways, ways, (frame - chain.frames[-1]) / fps))
    chain.frames.append(frame)
    chain.turned.append(sides.turned)
    chain.other.append(sides.told & ~sides.turned)
    chain.ways = ways


def kept_or_exchanged(before: np.ndarray, after: np.ndarray, seconds: float) -> tuple[float, float]:
    """What it costs that left and right have kept their places from one frame to another, and that they have exchanged them.

    Compared are ways from right to left, by which somebody's walking about is left out.

    Parameters
    ----------
    before, after : ndarray, shape (n, 3)
        From the right to the left one of each pair of keypoints, metres; NaN where it is not known.
    seconds : float
        Between the frames.

    Returns
    -------
    kept, exchanged : float
        Sums of squared deviations, capped; more time makes both alike.
    """
    deviation = np.hypot(WAY_M, WAY_M_S * seconds)
    kept, exchanged = (float(np.nansum(np.minimum(((after - sign * before) ** 2).sum(axis=-1) / deviation**2, MOST))) for sign in (1, -1))
    return kept, exchanged
