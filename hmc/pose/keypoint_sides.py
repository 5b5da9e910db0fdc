"""In which cameras, and when, a detector took a person's left for the right: decided over all frames, before anything is followed.

One frame tells which cameras are the other way round than the rest (`hmc.pose.views.exchanged_sides`), not which of both is right. Over
time two things tell it: a person's left and right do not exchange places from one frame to the next, and few detections are exchanged.
Nor does one frame always tell which cameras are the other way round: lines of two cameras that stand level meet in the wrong corners as
well. Of all sequences of possible patterns and their complements the cheapest is taken (`hmc.search.paths`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hmc.body.keypoint_places import BODY_KEYPOINTS, MIRRORED
from hmc.camera.model import Rig
from hmc.io.keypoints.source import KeypointSource
from hmc.io.results import TrackTable
from hmc.pose.views.exchanged_sides import FrameSides, possible_sides
from hmc.pose.views.keypoints import body_detections, lines_of_people
from hmc.processes import each_ahead
from hmc.search.paths import cheapest_path

__all__ = ["Turned", "exchanged_sides", "kept"]

#: By frame and person, cameras that have exchanged left and right, bool (n_cameras,).
Turned = Mapping[int, Mapping[int, np.ndarray]]

#: What a camera that is turned costs, a second. Three of four cameras for two seconds, then, are still less than two breaks of continuity.
TURNED_COST = 15.0
#: What a squared deviation costs, a second, by which lines of a pattern meet less closely than of another. A detector errs alike for as
#: long: what it guessed has met more closely exchanged for whole seconds.
EXCESS_COST = 1.0
#: How well the way from right to left is known, metres, and how fast it changes: arms and legs against one another, metres a second.
WAY_M, WAY_M_S = 0.08, 3.0
#: One way costs this at most, squared deviations; one that is not known, as where lines do not meet, half of it.
MOST = 9.0
_LEFT = np.array([k for k, name in enumerate(BODY_KEYPOINTS) if name.startswith("l_")])


@dataclass
class _Chain:
    """One person's frames of which left and right can be told, for as long as they are read; ways from right to left of the last alone.

    Choices of a frame are cameras to turn (m, n_cameras), what each costs by itself (m,), and to come to it from those before (m', m).
    """

    frames: list[int] = field(default_factory=list)
    turned: list[np.ndarray] = field(default_factory=list)
    own: list[np.ndarray] = field(default_factory=list)
    breaks: list[np.ndarray] = field(default_factory=list)
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

    def told(some: Sequence[int]) -> Iterator[dict[int, list[FrameSides]]]:
        for frame in some:
            people = lines_of_people(rig, body_detections(source, frame), tracks.at(frame))
            sides = {person: possible_sides(rig.centres, own.directions, own.deviation_m) for person, own in people.items()}
            yield {person: [one for one in several if one.told.any()] for person, several in sides.items() if several[0].told.any()}

    for frame, of_people in zip(frames, each_ahead(told, frames, workers), strict=True):
        for person, sides in of_people.items():
            _append(chains.setdefault(person, _Chain()), frame, sides, fps)
    found: dict[int, dict[int, np.ndarray]] = {}
    for person, chain in chains.items():
        for k, choice in enumerate(cheapest_path(chain.own, chain.breaks.__getitem__).tolist()):
            turned = chain.turned[k][choice]
            if turned.any():
                found.setdefault(chain.frames[k], {})[person] = turned
    return found


def _append(chain: _Chain, frame: int, sides: Sequence[FrameSides], fps: float) -> None:
    turned = np.array([one for side in sides for one in (side.turned, side.told & ~side.turned)])
    ways = np.array([sign * (side.points[_LEFT] - side.points[MIRRORED[_LEFT]]) for side in sides for sign in (1, -1)])
    excess = np.repeat([side.excess for side in sides], 2)
    chain.own.append((turned.sum(axis=1) * TURNED_COST + excess * EXCESS_COST) / fps)
    if chain.ways is None:
        chain.breaks.append(np.zeros((1, len(turned))))
    else:
        chain.breaks.append(kept(chain.ways[:, None], ways, (frame - chain.frames[-1]) / fps))
    chain.frames.append(frame)
    chain.turned.append(turned)
    chain.ways = ways


def kept(before: np.ndarray, after: np.ndarray, seconds: float) -> np.ndarray:
    """What it costs that left and right were in these places in one frame, and are in those in another.

    Compared are ways from right to left, by which somebody's walking about is left out.

    Parameters
    ----------
    before, after : ndarray, shape (..., n, 3)
        From the right to the left one of each pair of keypoints, metres; NaN where it is not known.
    seconds : float
        Between the frames.

    Returns
    -------
    ndarray, shape (...)
        Sums of squared deviations, capped; with more time between them all cost alike.
    """
    squared = ((after - before) ** 2).sum(axis=-1) / np.hypot(WAY_M, WAY_M_S * seconds) ** 2
    return np.where(np.isnan(squared), MOST / 2, np.minimum(squared, MOST)).sum(axis=-1)
