"""What 2-D keypoint detectors saw of one person in one frame: lines of sight, whose they are, and where they meet.

A detection is a line of sight with a width: the detector's own scatter there, in metres. Detections of several people are assigned to the
people who are tracked (`hmc.pose.views.whose`); those that fit nobody are nobody's. A camera in which left and right are the wrong way
round is turned, where the others say so. Where enough lines of a keypoint meet is a point (`SeenKeypoints.points`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.body.keypoint_places import BODY_KEYPOINTS
from hmc.camera.epipolar import undistorted_pixels
from hmc.camera.model import Camera, Rig
from hmc.io.keypoints.layouts import KEYPOINTS
from hmc.io.keypoints.source import KeypointSource
from hmc.pose.views.exchanged_sides import sides_of_frame, with_turned
from hmc.pose.views.line_meeting import meeting_points
from hmc.pose.views.off_people import off_people
from hmc.pose.views.whose import LEAST_CONFIDENCE, whose

__all__ = [
    "SCATTER_M", "PersonLines", "SeenKeypoints", "body_detections", "lines_of", "lines_of_people", "see_keypoints", "sight_lines",
]  # fmt: skip

N_KEYPOINTS = len(BODY_KEYPOINTS)
#: Standard deviation of a detection across its line of sight before anything was learnt, metres.
SCATTER_M = 0.03
_OF_BODY = [KEYPOINTS.index(name) for name in BODY_KEYPOINTS]


@dataclass(frozen=True)
class SeenKeypoints:
    """Detections of one person's keypoints in one frame.

    Parameters
    ----------
    keypoint, camera : ndarray of int, shape (n,)
        Place in `hmc.body.keypoint_places.BODY_KEYPOINTS`, and of the camera in the rig.
    centre : ndarray, shape (n, 3)
        A point on the line of sight: the camera's centre, world, metres.
    across : ndarray, shape (n, 2, 3)
        Two unit vectors across it.
    deviation_m : ndarray, shape (n,)
        The detector's scatter across the line where the person is.
    points : ndarray, shape (15, 3)
        Where lines of a keypoint meet, world, metres; NaN where no two do.
    """

    keypoint: np.ndarray
    camera: np.ndarray
    centre: np.ndarray
    across: np.ndarray
    deviation_m: np.ndarray
    points: np.ndarray

    def missed(self, places: np.ndarray) -> np.ndarray:
        """How far each line passes its keypoint by, in the two directions across it, metres: (..., 15, 3) to (..., n, 2)."""
        return np.einsum("kij,...kj->...ki", self.across, places[..., self.keypoint, :] - self.centre)

    def of(self, chosen: np.ndarray) -> SeenKeypoints:
        """Some of the lines, by a bool array of shape (n,)."""
        return replace(
            self,
            keypoint=self.keypoint[chosen],
            camera=self.camera[chosen],
            centre=self.centre[chosen],
            across=self.across[chosen],
            deviation_m=self.deviation_m[chosen],
        )


@dataclass(frozen=True)
class PersonLines:
    """Lines of sight of one person's keypoints in one frame, as they were detected.

    Parameters
    ----------
    directions : ndarray, shape (n_cameras, 15, 3)
        Unit vectors; NaN where nothing was given.
    confidence : ndarray, shape (n_cameras, 15)
        0 there.
    deviation_m : ndarray, shape (n_cameras, 15)
        Scatter across the line where the person is.
    pixels : ndarray, shape (n_cameras, 15, 2)
        Column and row; NaN where nothing was given.
    """

    directions: np.ndarray
    confidence: np.ndarray
    deviation_m: np.ndarray
    pixels: np.ndarray

    def with_sides(self, turned: np.ndarray) -> PersonLines:
        """The same with left and right exchanged in some cameras (n_cameras,)."""
        return PersonLines(*(with_turned(one, turned) for one in (self.directions, self.confidence, self.deviation_m, self.pixels)))

    def without(self, cameras: np.ndarray) -> PersonLines:
        """The same without what some cameras (n_cameras,) gave."""
        gone = cameras[:, None, None]
        return PersonLines(
            np.where(gone, np.nan, self.directions),
            np.where(gone[..., 0], 0.0, self.confidence),
            self.deviation_m,
            np.where(gone, np.nan, self.pixels),
        )


def body_detections(source: KeypointSource, frame: int) -> list[np.ndarray]:
    """A frame's detections of what a body can say the place of, one array a camera, shape (n_people, 15, 3)."""
    return [given[:, _OF_BODY] for given in source.frame(frame)]


def sight_lines(camera: Camera, uv: np.ndarray) -> np.ndarray:
    """Unit directions of the lines of sight through pixels of the image as it is, (n, 2) to (n, 3), world."""
    pixels = np.column_stack([undistorted_pixels(camera, uv), np.ones(len(uv))])
    rays = pixels @ np.linalg.inv(camera.matrix).T @ camera.rotation
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def see_keypoints(
    rig: Rig,
    detections: Sequence[np.ndarray],
    people: Mapping[int, np.ndarray],
    scatter_m: np.ndarray | None = None,
    turned: Mapping[int, np.ndarray] | None = None,
    masks: Sequence[np.ndarray | None] | None = None,
) -> dict[int, SeenKeypoints]:
    """Whose the detections of a frame are, and what they say of each person.

    Parameters
    ----------
    rig : Rig
    detections : sequence of ndarray, shape (n_people, 15, 3)
        One array a camera: column, row and confidence of each of `BODY_KEYPOINTS`; NaN where it was not given.
    people : mapping of int to ndarray of shape (3,)
        Where each person's trunk is tracked, world, metres.
    scatter_m : ndarray, shape (n_cameras, 15), optional
        Standard deviation of a sure detection, metres; `SCATTER_M` by default.
    turned : mapping of int to ndarray of bool of shape (n_cameras,), optional
        Cameras that have exchanged each person's left and right; none of who is not in it. By default what this frame tells
        (`hmc.pose.views.exchanged_sides`), the fewer cameras.
    masks : sequence of ndarray of bool, shape (height, width), or None, optional
        Silhouettes, one a camera: detections beside all of them are left out (`hmc.pose.views.off_people`).

    Returns
    -------
    dict of int to SeenKeypoints
        Of those of whom anything was seen.
    """
    out = {}
    for person, own in lines_of_people(rig, detections, people, scatter_m).items():
        if turned is None:
            sides = sides_of_frame(rig.centres, own.directions, own.deviation_m).turned
        else:
            sides = turned.get(person, np.zeros(len(rig), bool))
        own = own.with_sides(sides)
        points = meeting_points(rig.centres, own.directions, own.deviation_m)
        if masks is not None:
            off = off_people(rig, own, points, people[person], masks)
            if off.any():
                own = own.without(off)
                points = meeting_points(rig.centres, own.directions, own.deviation_m)
        camera, keypoint = np.nonzero(own.confidence > 0)
        if len(camera):
            across, deviation = _across(own.directions[camera, keypoint]), own.deviation_m[camera, keypoint]
            out[person] = SeenKeypoints(keypoint, camera, rig.centres[camera], across, deviation, points)
    return out


def lines_of_people(
    rig: Rig, detections: Sequence[np.ndarray], people: Mapping[int, np.ndarray], scatter_m: np.ndarray | None = None
) -> dict[int, PersonLines]:
    """Whose the detections of a frame are, as lines of sight with left and right as they were detected.

    Parameters
    ----------
    rig, detections, people, scatter_m
        As of `see_keypoints`.

    Returns
    -------
    dict of int to PersonLines
        Of those of whom anything was seen.
    """
    lines = [[lines_of(camera, one) for one in detected] for camera, detected in zip(rig, detections, strict=True)]
    nothing = lines_of(rig[0], None)
    directions = [np.array([one for one, _ in of_camera]).reshape(-1, N_KEYPOINTS, 3) for of_camera in lines]
    scatter = np.full((len(rig), N_KEYPOINTS), SCATTER_M) if scatter_m is None else scatter_m
    out = {}
    for person, own in whose(rig, detections, directions, people).items():
        seen = [nothing if k is None else of_camera[k] for of_camera, k in zip(lines, own, strict=True)]
        along, confidence = np.array([one for one, _ in seen]), np.array([sure for _, sure in seen])
        if (confidence > 0).any():
            unseen = np.full((N_KEYPOINTS, 2), np.nan)
            pixels = np.array([unseen if k is None else detected[k, :, :2] for detected, k in zip(detections, own, strict=True)])
            deviation = scatter / np.sqrt(np.maximum(confidence, LEAST_CONFIDENCE))
            out[person] = PersonLines(along, confidence, deviation, pixels)
    return out


def lines_of(camera: Camera, one: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Directions (15, 3), NaN where nothing was given, and confidences (15,), 0 there."""
    directions, confidence = np.full((N_KEYPOINTS, 3), np.nan), np.zeros(N_KEYPOINTS)
    if one is not None:
        told = np.isfinite(one).all(axis=1) & (one[:, 2] >= LEAST_CONFIDENCE)
        if told.any():
            directions[told], confidence[told] = sight_lines(camera, one[told, :2]), one[told, 2]
    return directions, confidence


def _across(directions: np.ndarray) -> np.ndarray:
    """Two unit vectors across each direction, (n, 3) to (n, 2, 3)."""
    least = np.eye(3)[np.abs(directions).argmin(axis=1)]
    one = np.cross(directions, least)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.stack([one, np.cross(directions, one)], axis=1)
