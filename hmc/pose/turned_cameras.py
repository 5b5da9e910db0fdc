"""Cameras that have turned since they were calibrated, as a detector's keypoints tell: turned back, for poses to be found by all cameras.

A camera that was touched by a degree is out by 6 cm where people are. The other cameras' lines of sight of a keypoint meet without it, and
its own pass these points by, all to the same side: one rotation about its centre brings them there. A detector's own errors are not mended
by any. Of two cameras that differ, the others tell which it is; so there are four of them at least, and one camera is turned at a time.
Ours; what is minimised is the angle's part of bundle adjustment.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from hmc.camera.model import Camera, Rig
from hmc.io.recording import Recording, spread_frames
from hmc.io.results import TrackTable
from hmc.pose.keypoint_cues import KeypointCues, learn_scatter
from hmc.pose.keypoint_sides import people_at
from hmc.pose.views.exchanged_sides import with_turned
from hmc.pose.views.keypoints import PersonLines, body_detections, lines_of_people
from hmc.pose.views.line_meeting import meeting_points
from hmc.processes import each_ahead

__all__ = ["TurnedCamera", "turn_back", "turned_back", "turned_cameras"]

#: Frames that are asked, at most, well spread; and so many sure detections of a camera tell.
FRAMES, LEAST_DETECTIONS, SURE = 60, 60, 0.5
#: A camera is turned that passes what the others see by more than this, metres, in the median, and by no more than this share of it when
#: it is turned back. Of seven well calibrated cameras it was 18 to 33 mm, and 90 % of that at least.
OFF_M, MENDED_SHARE = 0.035, 0.65
#: A turn lasts: in each of so many parts of the run this share of a miss is left at most. A detector is wrong for a while.
PARTS, LASTING_SHARE = 5, 0.8
#: Cameras that are needed: three that agree tell of a fourth.
LEAST_CAMERAS = 4
#: A miss of more than this counts ever less, metres (Cauchy); and so far may a camera have turned, radians.
WIDE_M, MOST_TURN = 0.025, np.radians(8)


@dataclass(frozen=True)
class TurnedCamera:
    """A camera that has turned since it was calibrated.

    Parameters
    ----------
    name : str
    turn : ndarray, shape (3,)
        Rotation vector about the camera's centre, world, radians, that brings its lines of sight to where the others' meet.
    before_m, after_m : float
        Median distance at which its lines pass these points, as it is calibrated and turned back.
    """

    name: str
    turn: np.ndarray
    before_m: float
    after_m: float

    def __str__(self) -> str:
        degrees = np.degrees(np.linalg.norm(self.turn))
        return (
            f"camera '{self.name}' has turned by {degrees:.1f} deg since it was calibrated: its keypoints pass the other cameras' by "
            f"{1000 * self.before_m:.0f} mm, turned back by {1000 * self.after_m:.0f}"
        )


def turned_back(
    recording: Recording, tracks: TrackTable, cues: KeypointCues, workers: int = 1, keep: bool = False
) -> tuple[Recording, KeypointCues, list[str]]:
    """The recording with cameras turned back that keypoints show turned, what its keypoints tell then, and a line on each.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
    cues : KeypointCues
        As of `learn_scatter` with the cameras as they are.
    workers : int
    keep : bool
        The cameras stay as they are; the lines say so.
    """
    found = turned_cameras(recording.rig, tracks, cues, workers)
    if not found or keep:
        return recording, cues, [f"{one}; it is kept as it is" for one in found]
    recording = replace(recording, rig=turn_back(recording.rig, found))
    lines = [f"{one}; poses are found with it turned back, calibrate it anew" for one in found]
    return recording, learn_scatter(recording.rig, tracks, cues.source, recording.fps, workers), lines


def turn_back(rig: Rig, found: Sequence[TurnedCamera]) -> Rig:
    """The rig with these cameras turned back about their centres.

    Parameters
    ----------
    rig : Rig
    found : sequence of TurnedCamera
    """
    turns = {one.name: Rotation.from_rotvec(one.turn).as_matrix() for one in found}
    return Rig(tuple(_rotated(camera, turns[camera.name]) if camera.name in turns else camera for camera in rig))


def _rotated(camera: Camera, turn: np.ndarray) -> Camera:
    """A camera with its lines of sight turned by a matrix about its centre."""
    rotation = camera.rotation @ turn.T
    return replace(camera, rotation=rotation, translation=-rotation @ camera.centre)


def turned_cameras(rig: Rig, tracks: TrackTable, cues: KeypointCues, workers: int = 1) -> list[TurnedCamera]:
    """Which cameras have turned since they were calibrated, and how; the one that is farthest off first.

    Parameters
    ----------
    rig : Rig
    tracks : TrackTable
        Whose detections they are is told by where people are tracked.
    cues : KeypointCues
    workers : int
        Processes that read frames.

    Returns
    -------
    list of TurnedCamera
        Empty where fewer than `LEAST_CAMERAS` see enough; no more than leave three as they are.
    """
    seen = _all_lines(rig, tracks, cues, workers)
    if not seen:
        return []
    directions, deviation, confidence = (np.array(values) for values in zip(*seen, strict=True))
    sure = np.isfinite(directions).all(axis=-1) & (confidence > SURE)
    seeing = np.flatnonzero(sure.sum(axis=(0, 2)) >= LEAST_DETECTIONS).tolist()
    found: list[TurnedCamera] = []
    while len(seeing) - len(found) >= LEAST_CAMERAS:
        left = [c for c in seeing if rig[c].name not in {one.name for one in found}]
        tried = [_turn(rig, c, [other for other in seeing if other != c], directions, deviation, sure) for c in left]
        mended = [
            (c, one) for c, one in zip(left, tried, strict=True) if one.before_m > OFF_M and one.after_m < MENDED_SHARE * one.before_m
        ]
        if not mended:
            break
        c, worst = max(mended, key=lambda pair: pair[1].before_m)
        found.append(worst)
        directions[:, c] = directions[:, c] @ Rotation.from_rotvec(worst.turn).as_matrix().T
    return found


def _all_lines(rig: Rig, tracks: TrackTable, cues: KeypointCues, workers: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Directions, deviations and confidences of everybody's lines, (n_cameras, 15, ...) each, left and right as decided."""

    def told(frames: Sequence[int]) -> Iterator[list[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        for frame in frames:
            people = lines_of_people(rig, body_detections(cues.source, frame), people_at(tracks, frame), cues.scatter_m)
            sides = cues.turned.get(frame, {})
            yield [_in_order(own, sides.get(person, np.zeros(len(rig), bool))) for person, own in people.items()]

    return [one for of_people in each_ahead(told, spread_frames(np.unique(tracks.frames), FRAMES), workers) for one in of_people]


def _in_order(own: PersonLines, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return with_turned(own.directions, sides), with_turned(own.deviation_m, sides), with_turned(own.confidence, sides)


def _turn(rig: Rig, c: int, others: Sequence[int], directions: np.ndarray, deviation: np.ndarray, sure: np.ndarray) -> TurnedCamera:
    """The rotation about a camera's centre that brings its lines nearest to where the others' meet."""
    points = np.array(
        [meeting_points(rig.centres[others], ways[others], widths[others]) for ways, widths in zip(directions, deviation, strict=True)]
    )
    told = np.isfinite(points).all(axis=-1) & sure[:, c]
    if told.sum() < LEAST_DETECTIONS:
        return TurnedCamera(rig[c].name, np.zeros(3), 0.0, 0.0)
    lines, places = directions[:, c][told], points[told] - rig[c].centre

    def missed(turn: np.ndarray) -> np.ndarray:
        return np.cross(Rotation.from_rotvec(turn).apply(lines), places)

    fit = least_squares(lambda turn: missed(turn).ravel(), np.zeros(3), loss="cauchy", f_scale=WIDE_M, bounds=(-MOST_TURN, MOST_TURN))
    before, after = (np.linalg.norm(missed(turn), axis=1) for turn in (np.zeros(3), fit.x))
    parts = zip(np.array_split(before, PARTS), np.array_split(after, PARTS), strict=True)
    if any(np.median(turned) > LASTING_SHARE * np.median(was) for was, turned in parts):
        return TurnedCamera(rig[c].name, np.zeros(3), float(np.median(before)), float(np.median(before)))
    return TurnedCamera(rig[c].name, fit.x, float(np.median(before)), float(np.median(after)))
