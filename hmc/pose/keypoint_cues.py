"""A detector's keypoints beside the hulls: read frame by frame, given to the people who are tracked, and what the recording tells of them.

In which cameras left and right are exchanged is decided over all frames before anything is followed (`hmc.pose.keypoint_sides`). Two
things of a detector are learnt, not assumed. How far it scatters: by how far cameras agree, before anything is followed too
(`learn_scatter`). And what it takes for a hip, say, against what the body's hip is: in the second pass, from the first one's poses
(`learn_beside`). A detector's landmark is not a joint's centre, but it is so in the same way all through a recording.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.body.keypoint_places import BODY_KEYPOINTS, KEYPOINT_SEGMENTS, keypoint_places
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.camera.model import Rig
from hmc.io.keypoints.source import KeypointSource
from hmc.io.recording import spread_frames
from hmc.io.results import TrackTable
from hmc.pose.keypoint_sides import Turned, exchanged_sides
from hmc.pose.objectives.keypoints import BESIDE_M, Beside
from hmc.pose.views.keypoints import SCATTER_M, SeenKeypoints, body_detections, see_keypoints
from hmc.pose.views.person_view import PersonView
from hmc.processes import each_ahead

__all__ = ["KeypointCues", "beside_body", "learn_beside", "learn_scatter", "with_keypoints"]

#: Frames from which scatter is learnt, at most, well spread.
LEARNING_FRAMES = 120
#: Of a normal distribution, the median of squared distances in a plane over the variance along one axis.
MEDIAN_IN_PLANE = 2 * np.log(2)
#: Scatter that was learnt is within these, metres; fewer detections of a keypoint in a camera teach nothing.
SCATTER_RANGE_M, LEAST_DETECTIONS = (0.008, 0.08), 10
#: An offset that was learnt is no better known than this, metres: what of it turns and bends with the body is not constant.
LEARNT_M = 0.008
#: Keypoints weigh as much as in the first pass where hulls cost this much, half of it where they cost as little as of good silhouettes
#: (1e-4, on rendered people), and so on, as far as these factors.
HULL_COST_M2, WORTH_RANGE = 2e-4, (0.25, 4.0)
#: Frames one after the other that tell as much as one.
ALIKE = 3


@dataclass(frozen=True)
class KeypointCues:
    """Keypoints of a recording as a likelihood reads them.

    Parameters
    ----------
    source : KeypointSource
    scatter_m : ndarray, shape (n_cameras, 15)
        Standard deviation of a sure detection across its line of sight, metres.
    turned : mapping of int to mapping of int to ndarray of bool, shape (n_cameras,)
        By frame and person, cameras that have exchanged left and right; those without any are left out.
    """

    source: KeypointSource
    scatter_m: np.ndarray
    turned: Turned = field(default_factory=dict)


def with_keypoints(
    views: Mapping[int, PersonView],
    rig: Rig,
    tracks: TrackTable,
    cues: KeypointCues | None,
    masks: Sequence[np.ndarray | None] | None = None,
) -> dict[int, PersonView]:
    """The views of one frame, with the keypoints of each person.

    Parameters
    ----------
    views : mapping of int to PersonView
    rig : Rig
    tracks : TrackTable
    cues : KeypointCues or None
        The views as they are where there are none.
    masks : sequence of ndarray of bool, shape (height, width), or None, optional
        The frame's silhouettes, one a camera: detections beside all of them are left out (`hmc.pose.views.off_people`).
    """
    if cues is None or not views:
        return dict(views)
    frame = next(iter(views.values())).frame
    seen = _seen(rig, tracks, cues, frame, masks)
    return {person: replace(view, keypoints=seen.get(person)) for person, view in views.items()}


def _seen(
    rig: Rig, tracks: TrackTable, cues: KeypointCues, frame: int, masks: Sequence[np.ndarray | None] | None = None
) -> dict[int, SeenKeypoints]:
    detections = body_detections(cues.source, frame)
    return see_keypoints(rig, detections, tracks.at(frame), cues.scatter_m, cues.turned.get(frame, {}), masks)


def learn_scatter(rig: Rig, tracks: TrackTable, source: KeypointSource, fps: float, workers: int = 1) -> KeypointCues:
    """Which cameras exchange left and right, and how far each one's detections of each keypoint are from where the others' lines meet.

    Parameters
    ----------
    rig : Rig
    tracks : TrackTable
    source : KeypointSource
    fps : float
        Frames a second.
    workers : int
        Processes that read frames and look at each by itself.

    Returns
    -------
    KeypointCues
    """
    scatter = np.full((len(rig), len(BODY_KEYPOINTS)), SCATTER_M)
    cues = KeypointCues(source, scatter, exchanged_sides(rig, tracks, source, fps, workers))
    missed: list[list[list[float]]] = [[[] for _ in BODY_KEYPOINTS] for _ in rig]

    def squares(frames: Sequence[int]) -> Iterator[list[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        for frame in frames:
            of_people = []
            for seen in _seen(rig, tracks, cues, frame).values():
                off = seen.missed(seen.points)
                cameras = np.bincount(seen.keypoint, minlength=len(BODY_KEYPOINTS))[seen.keypoint]
                # The point was fitted to the line too: it is as much nearer as one of so many lines pulls it.
                squared = (off**2).sum(axis=1) / np.maximum(1 - 1.5 / np.maximum(cameras, 2), 0.25)
                of_people.append((seen.camera, seen.keypoint, squared))
            yield of_people

    for of_people in each_ahead(squares, spread_frames(np.unique(tracks.frames), LEARNING_FRAMES), workers):
        for camera, keypoint, squared in of_people:
            for c, k, value in zip(camera.tolist(), keypoint.tolist(), squared.tolist(), strict=True):
                if np.isfinite(value):
                    missed[c][k].append(value)
    scatter = cues.scatter_m.copy()
    for c, of_camera in enumerate(missed):
        for k, values in enumerate(of_camera):
            if len(values) >= LEAST_DETECTIONS:
                scatter[c, k] = np.clip(np.sqrt(np.median(values) / MEDIAN_IN_PLANE), *SCATTER_RANGE_M)
    return replace(cues, scatter_m=scatter)


def beside_body(body: BodyModel, state: np.ndarray, seen: SeenKeypoints) -> np.ndarray:
    """Where lines of sight meet beside the body's places of the keypoints, on their segments, shape (15, 3), metres; NaN where none do.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    seen : SeenKeypoints
    """
    rotations, positions = segment_transforms(body, state)
    way = seen.points - positions[KEYPOINT_SEGMENTS]
    return np.einsum("kji,kj->ki", rotations[KEYPOINT_SEGMENTS], way) - keypoint_places(body)


def learn_beside(found: Sequence[np.ndarray], hull_costs: Sequence[float]) -> Beside:
    """Where a detector's keypoints lie beside the body's, by poses that they had no part in.

    The median over frames and people; little is believed of what was seldom seen.

    Parameters
    ----------
    found : sequence of ndarray, shape (15, 3)
        As from `beside_body`.
    hull_costs : sequence of float
        Of the same poses, the hulls' part, square metres: two kinds of data weigh as their own errors say.
    """
    if not len(found):
        return Beside()
    worth = float(np.clip(np.median(hull_costs) / HULL_COST_M2, *WORTH_RANGE))
    off = np.array(found)
    told = np.isfinite(off).all(axis=-1).sum(axis=0)
    off = np.where(told[:, None] > 0, off, 0.0)
    middle = np.nanmedian(off, axis=0)
    scatter = 1.5 * np.nanmedian(np.abs(off - middle), axis=0).mean(axis=-1)
    # The error of a median of frames that are alike for a while, against what such offsets commonly are.
    error = np.maximum(scatter, 0.01) / np.sqrt(np.maximum(told / ALIKE, 1))
    believed = np.where(told > 0, BESIDE_M**2 / (BESIDE_M**2 + error**2), 0.0)
    deviation = np.sqrt(believed * error**2 + (1 - believed) * BESIDE_M**2)
    deviation = np.minimum(np.hypot(deviation, np.maximum(scatter, LEARNT_M)), 2 * BESIDE_M)
    return Beside(believed[:, None] * middle, np.where(told > 0, deviation, BESIDE_M), worth)
