"""Cameras that have turned since they were calibrated, as a detector's keypoints tell: by how far their lines of sight pass the others'.

The other cameras' lines of sight of a keypoint meet without a camera that has turned, and its own pass these points by, all to the same
side. A detector's own errors are not mended by any turn.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.camera.model import Rig
from hmc.camera.turned_cameras import TurnedCamera, farthest_off_first, fitted_turn, with_turns
from hmc.io.recording import spread_frames
from hmc.io.results import TrackTable
from hmc.pose.keypoint_cues import KeypointCues
from hmc.pose.views.exchanged_sides import with_turned
from hmc.pose.views.keypoints import PersonLines, body_detections, lines_of_people
from hmc.pose.views.line_meeting import meeting_points
from hmc.processes import each_ahead

__all__ = ["turned_by_keypoints"]

#: Frames that are asked, at most, well spread; and so many sure detections of a camera tell.
FRAMES, LEAST_DETECTIONS, SURE = 60, 60, 0.5
#: A camera has turned that passes what the others see by more than this, metres, in the median, and by no more than the second when it is
#: turned back. Of seven well calibrated cameras it was 18 to 33 mm, of four up to 41. A miss of more than the third counts ever less.
OFF_M, LEFT_M, WIDE_M = 0.035, 0.05, 0.025


def turned_by_keypoints(rig: Rig, tracks: TrackTable, cues: KeypointCues, workers: int = 1) -> list[TurnedCamera]:
    """Which cameras have turned since they were calibrated, and how, as a detector's keypoints tell.

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
        The one that is farthest off first; empty where too few cameras see enough.
    """
    seen = _all_lines(rig, tracks, cues, workers)
    if not seen:
        return []
    directions, deviation, confidence = (np.array(values) for values in zip(*seen, strict=True))
    sure = np.isfinite(directions).all(axis=-1) & (confidence > SURE)
    seeing = np.flatnonzero(sure.sum(axis=(0, 2)) >= LEAST_DETECTIONS).tolist()

    def tried(c: int, turns: dict[int, np.ndarray]) -> TurnedCamera | None:
        others = [other for other in seeing if other != c]
        ways = with_turns(directions, turns)[:, others]
        points = np.array([meeting_points(rig.centres[others], *one) for one in zip(ways, deviation[:, others], strict=True)])
        told = np.isfinite(points).all(axis=-1) & sure[:, c]
        if told.sum() < LEAST_DETECTIONS:
            return None
        lines, places = directions[:, c][told], points[told] - rig[c].centre
        return fitted_turn(lambda turn: np.cross(Rotation.from_rotvec(turn).apply(lines), places), WIDE_M, rig[c].name, "keypoints pass")

    return farthest_off_first(seeing, OFF_M, LEFT_M, tried)


def _all_lines(rig: Rig, tracks: TrackTable, cues: KeypointCues, workers: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Directions, deviations and confidences of everybody's lines, (n_cameras, 15, ...) each, left and right as decided."""

    def told(frames: Sequence[int]) -> Iterator[list[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        for frame in frames:
            people = lines_of_people(rig, body_detections(cues.source, frame), tracks.at(frame), cues.scatter_m)
            sides = cues.turned.get(frame, {})
            yield [_in_order(own, sides.get(person, np.zeros(len(rig), bool))) for person, own in people.items()]

    return [one for of_people in each_ahead(told, spread_frames(np.unique(tracks.frames), FRAMES), workers) for one in of_people]


def _in_order(own: PersonLines, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return with_turned(own.directions, sides), with_turned(own.deviation_m, sides), with_turned(own.confidence, sides)
