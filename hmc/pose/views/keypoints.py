"""What 2-D keypoint detectors saw of one person in one frame: lines of sight, whose they are, and where they meet.

A detection is a line of sight with a width: the detector's own scatter there, in metres. Detections of several people are assigned to the
people who are tracked, camera by camera, by where these should be; those that fit nobody are nobody's. A camera in which left and right
are the wrong way round is turned, where the others say so. Where enough lines of a keypoint meet is a point (`SeenKeypoints.points`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.body.keypoint_places import BODY_KEYPOINTS, MIRRORED
from hmc.camera.epipolar import undistorted_pixels
from hmc.camera.model import Camera, Rig, project
from hmc.io.keypoints.layouts import KEYPOINTS
from hmc.io.keypoints.source import KeypointSource

__all__ = ["MEET", "SCATTER_M", "SeenKeypoints", "body_detections", "lines_of", "meeting_points", "see_keypoints", "sight_lines"]

N_KEYPOINTS = len(BODY_KEYPOINTS)
#: Standard deviation of a detection across its line of sight before anything was learnt, metres.
SCATTER_M = 0.03
#: Detections that are less sure are left out.
LEAST_CONFIDENCE = 0.1
#: A detection's trunk farther than this from where a person is tracked is another's, metres.
GATE_M = 0.6
#: Lines that pass a point by more than so many deviations do not meet in it.
MEET = 3.0
#: A camera is turned, left for right, where that lowers its distances from the others' points to this share.
TURN_SHARE = 0.5
_TRUNK = [BODY_KEYPOINTS.index(name) for name in ("l_shoulder", "r_shoulder", "l_hip", "r_hip")]
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


def body_detections(source: KeypointSource, frame: int) -> list[np.ndarray]:
    """A frame's detections of what a body can say the place of, one array a camera, shape (n_people, 15, 3)."""
    return [given[:, _OF_BODY] for given in source.frame(frame)]


def sight_lines(camera: Camera, uv: np.ndarray) -> np.ndarray:
    """Unit directions of the lines of sight through pixels of the image as it is, (n, 2) to (n, 3), world."""
    pixels = np.column_stack([undistorted_pixels(camera, uv), np.ones(len(uv))])
    rays = pixels @ np.linalg.inv(camera.matrix).T @ camera.rotation
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def see_keypoints(
    rig: Rig, detections: Sequence[np.ndarray], people: Mapping[int, np.ndarray], scatter_m: np.ndarray | None = None
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

    Returns
    -------
    dict of int to SeenKeypoints
        Of those of whom anything was seen.
    """
    own: dict[int, list[np.ndarray | None]] = {person: [None] * len(rig) for person in people}
    for c, (camera, given) in enumerate(zip(rig, detections, strict=True)):
        for person, k in _assigned(camera, given, people).items():
            own[person][c] = given[k]
    scatter = np.full((len(rig), N_KEYPOINTS), SCATTER_M) if scatter_m is None else scatter_m
    seen = {person: _seen(rig, given, scatter) for person, given in own.items()}
    return {person: one for person, one in seen.items() if one is not None}


def _assigned(camera: Camera, given: np.ndarray, people: Mapping[int, np.ndarray]) -> dict[int, int]:
    """Which detected person is whom, by how far their trunk is from where each should be."""
    if not len(given) or not people:
        return {}
    places = np.array(list(people.values()))
    expected, valid = project(camera, places)
    depth = places @ camera.rotation[2] + camera.translation[2]
    with np.errstate(all="ignore"):
        trunk = np.array([_middle(one) for one in given])
        apart = np.linalg.norm(trunk[:, None] - expected[None], axis=-1) * depth / camera.matrix[0, 0]
    apart = np.where(np.isfinite(apart) & valid, apart, 10 * GATE_M)
    rows, columns = linear_sum_assignment(np.minimum(apart, 10 * GATE_M))
    persons = list(people)
    return {persons[j]: i for i, j in zip(rows.tolist(), columns.tolist(), strict=True) if apart[i, j] < GATE_M}


def _middle(one: np.ndarray) -> np.ndarray:
    """The middle of a detected trunk, or of all that was detected where there is none, pixels."""
    sure = one[:, 2] >= LEAST_CONFIDENCE
    trunk = np.zeros(len(one), bool)
    trunk[_TRUNK] = True
    told = sure & trunk if (sure & trunk).sum() >= 2 else sure
    return one[told, :2].mean(axis=0) if told.any() else np.full(2, np.nan)


def _seen(rig: Rig, given: Sequence[np.ndarray | None], scatter: np.ndarray) -> SeenKeypoints | None:
    """One person's detections as lines of sight, turned where left and right are exchanged."""
    lines = [lines_of(camera, one) for camera, one in zip(rig, given, strict=True)]
    directions = np.array([line[0] for line in lines])
    confidence = np.array([line[1] for line in lines])
    if not (confidence > 0).any():
        return None
    centres = rig.centres
    deviation = scatter / np.sqrt(np.maximum(confidence, LEAST_CONFIDENCE))
    points = meeting_points(centres, directions, deviation)
    turned = _to_turn(centres, directions, deviation, points)
    if turned.any():
        directions[turned], confidence[turned] = directions[turned][:, MIRRORED], confidence[turned][:, MIRRORED]
        deviation[turned] = deviation[turned][:, MIRRORED]
        points = meeting_points(centres, directions, deviation)
    camera, keypoint = np.nonzero(confidence > 0)
    return SeenKeypoints(keypoint, camera, centres[camera], _across(directions[camera, keypoint]), deviation[camera, keypoint], points)


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


def _passing(points: np.ndarray, centres: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How far lines pass points by, metres: points (..., k, 3), one line a camera and keypoint (c, k, 3), to (..., c, k)."""
    towards = points[..., None, :, :] - centres[:, None]
    along = np.einsum("...cki,cki->...ck", towards, directions)
    return np.linalg.norm(towards - along[..., None] * directions, axis=-1)


def meeting_points(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """Where lines of sight meet, as most of them say.

    Of every two cameras' lines the place between them; the one that most lines pass, then the least squares of these.

    Parameters
    ----------
    centres : ndarray, shape (n_cameras, 3)
    directions : ndarray, shape (n_cameras, 15, 3)
        NaN where a camera has none.
    deviation : ndarray, shape (n_cameras, 15)
        Metres.

    Returns
    -------
    ndarray, shape (15, 3)
        World, metres; NaN where no two lines meet.
    """
    pairs = list(combinations(range(len(centres)), 2))
    if not pairs:
        return np.full((directions.shape[1], 3), np.nan)
    weight = np.where(np.isfinite(directions).all(axis=-1), deviation**-2.0, 0.0)
    lines = np.nan_to_num(directions)
    trials = np.array([_nearest(centres, lines, weight, np.isin(np.arange(len(centres)), pair)) for pair in pairs])
    off = np.where(weight > 0, _passing(trials, centres, lines) / deviation, MEET)
    score = (np.minimum(off, MEET) ** 2).sum(axis=1)  # pairs, keypoints
    score = np.where(np.isfinite(trials).all(axis=-1), score, np.inf)
    best = score.argmin(axis=0)
    points = trials[best, np.arange(trials.shape[1])]
    for _ in range(2):
        off = np.where(weight > 0, _passing(points, centres, lines) / deviation, np.inf)
        points = _nearest(centres, lines, np.where(off < MEET, weight, 0.0))
    return points


def _nearest(centres: np.ndarray, lines: np.ndarray, weight: np.ndarray, chosen: np.ndarray | None = None) -> np.ndarray:
    """The point of least weighed squared distance from lines, shape (k, 3); NaN with fewer than two."""
    weight = weight if chosen is None else weight * chosen[:, None]
    flat = np.eye(3) - lines[..., :, None] * lines[..., None, :]
    matrix = np.einsum("ck,ckij->kij", weight, flat)
    vector = np.einsum("ck,ckij,cj->ki", weight, flat, centres)
    enough = (weight > 0).sum(axis=0) >= 2
    matrix = np.where(enough[:, None, None], matrix, np.eye(3))
    with np.errstate(all="ignore"):
        scale = np.trace(matrix, axis1=1, axis2=2)
        enough &= np.linalg.det(matrix / scale[:, None, None]) > 1e-6  # lines that are hardly apart meet anywhere
    matrix = np.where(enough[:, None, None], matrix, np.eye(3))
    points = np.linalg.solve(matrix, vector[..., None])[..., 0]
    return np.where(enough[:, None], points, np.nan)


def _to_turn(centres: np.ndarray, directions: np.ndarray, deviation: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Cameras whose left and right are exchanged, by the points that the others agree on, shape (n_cameras,)."""
    with np.errstate(invalid="ignore"):
        here = np.minimum(_passing(points, centres, directions) / deviation, 2 * MEET)
        there = np.minimum(_passing(points, centres, directions[:, MIRRORED]) / deviation[:, MIRRORED], 2 * MEET)
    told = np.isfinite(here) & np.isfinite(there) & (MIRRORED != np.arange(N_KEYPOINTS))
    as_it_is, turned = (np.where(told, one**2, 0.0).sum(axis=1) for one in (here, there))
    return (told.sum(axis=1) >= 4) & (turned < TURN_SHARE * as_it_is)
