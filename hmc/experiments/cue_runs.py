"""Poses from silhouettes, from a detector's keypoints, and from both: one cell, one recording, some of its cameras, one way.

Silhouettes alone and both are the whole chain as ``hmc pose`` runs it (`hmc.experiments.chain_runs`), without and with keypoints.
Keypoints alone are what they are commonly used for: lines of sight of each keypoint met robustly, frame by frame, and low-passed. People
are where the tracks of the silhouettes have them in all three, so that whom a method follows is no part of the comparison.

Rendered recordings have no detector: detections are pretended (`hmc.synthetic.keypoints`), which is no measure of any detector.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfiltfilt

from hmc.errors import InputError
from hmc.experiments.chain_runs import PARTS as CHAIN_PARTS
from hmc.experiments.chain_runs import WHOLE, FollowedPeople, as_read, chain_options, followed, method_without, scored_poses, truth_in
from hmc.experiments.engine.experiment import Parameters, Results
from hmc.experiments.engine.inputs import Inputs, once, recipe_of
from hmc.experiments.engine.store import digest
from hmc.experiments.keypoint_faults import NO_FAULT, fault_frames, with_fault
from hmc.experiments.markerless_runs import opened
from hmc.io.keypoints import KeypointSource, open_keypoints
from hmc.io.recording import Recording, open_recording
from hmc.io.results import PoseTable, TrackTable
from hmc.landmarks import LANDMARKS
from hmc.pose.backward import backward
from hmc.pose.follow import follow
from hmc.pose.keypoint_cues import KeypointCues, with_keypoints
from hmc.pose.turned_back import turned_back
from hmc.pose.views.keypoint_pose import landmarks_seen
from hmc.pose.views.person_view import PersonView
from hmc.synthetic.keypoints import write_keypoints
from hmc.synthetic.recipe import Recipe
from hmc.synthetic.room import furnish

__all__ = ["BOTH", "FAMILY", "KEYPOINTS", "SILHOUETTES", "VERSION", "WAYS", "Footage", "cell", "low_passed", "triangulated"]

FAMILY, VERSION = "cues", 1
SILHOUETTES, KEYPOINTS, BOTH = "silhouettes", "keypoints", "both"
#: Of the low-pass filter: where it begins, and its order (each way); what users of triangulated keypoints commonly take.
CUTOFF_HZ, ORDER = 6.0, 4
#: Longer gaps are left open, seconds.
GAP_S = 0.5


@dataclass(frozen=True)
class Footage:
    """What a way is computed from.

    Parameters
    ----------
    recording : Recording
        With the cell's cameras and frames.
    people : FollowedPeople
    cues : KeypointCues or None
        The detector's keypoints, where the way uses them.
    """

    recording: Recording
    people: FollowedPeople
    cues: KeypointCues | None


def _by_the_chain(parameters: Parameters, seen: Footage) -> PoseTable:
    """Poses of both passes of the default method, with keypoints where there are some."""
    method = method_without(CHAIN_PARTS[WHOLE])
    options = replace(chain_options(parameters), keypoints=seen.cues)
    first = follow(seen.recording, seen.people.tracks, method, options, seen.people.run)
    return backward(seen.recording, seen.people.tracks, method, first, options, seen.people.run).poses


def _by_triangulation(parameters: Parameters, seen: Footage) -> PoseTable:
    return triangulated(seen.recording, seen.people.tracks, seen.cues)


def triangulated(recording: Recording, tracks: TrackTable, cues: KeypointCues | None) -> PoseTable:
    """Where each person's lines of sight meet, low-passed (`low_passed`): joints of the limbs alone, and no body at all.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
        Whose detections they are is told by where people are tracked.
    cues : KeypointCues or None
        As from `hmc.pose.keypoint_cues.learn_scatter`; without, nothing is found.

    Returns
    -------
    PoseTable
        The rows of `tracks`; NaN for what no two lines tell, and for pelvis, neck and head.
    """
    points = np.full((len(tracks.frames), len(LANDMARKS), 3), np.nan)
    row_of = {pair: row for row, pair in enumerate(zip(tracks.frames.tolist(), tracks.persons.tolist(), strict=True))}
    for frame in np.unique(tracks.frames).tolist():
        views = {int(person): PersonView(frame) for person in tracks.persons[tracks.frames == frame]}
        for person, view in with_keypoints(views, recording.rig, tracks, cues).items():
            if view.keypoints is not None:
                points[row_of[frame, person]] = landmarks_seen(view.keypoints)
    for person in np.unique(tracks.persons):
        rows = np.flatnonzero(tracks.persons == person)
        rows = rows[np.argsort(tracks.frames[rows])]
        points[rows] = low_passed(points[rows], tracks.frames[rows], recording.fps)
    return PoseTable(tracks.frames, tracks.persons, points)


#: How poses are made, and whether keypoints are read for it. Another way, as a body fitted to keypoints without hulls, has its place here.
WAYS: dict[str, tuple[Callable[[Parameters, Footage], PoseTable], bool]] = {
    SILHOUETTES: (_by_the_chain, False),
    KEYPOINTS: (_by_triangulation, True),
    BOTH: (_by_the_chain, True),
}


def low_passed(points: np.ndarray, frames: np.ndarray, fps: float) -> np.ndarray:
    """Points over time without what is faster than `CUTOFF_HZ`, by a Butterworth filter that is run forward and back (no phase).

    Gaps of up to `GAP_S` are bridged by straight lines first; longer ones, and what is before the first point and after the last, stay
    open.

    Parameters
    ----------
    points : ndarray, shape (n, k, 3)
        Metres; NaN where missing.
    frames : ndarray of int, shape (n,)
        Ascending; numbers that are left out are gaps too.
    fps : float

    Returns
    -------
    ndarray, shape (n, k, 3)
        As they are where the recording is too slow for such a filter, or a piece is too short.
    """
    if not len(frames):
        return points
    n = int(frames[-1] - frames[0]) + 1
    every = np.full((n, *points.shape[1:]), np.nan)
    every[frames - frames[0]] = points
    sections = butter(ORDER, CUTOFF_HZ, fs=fps, output="sos") if fps > 2 * CUTOFF_HZ else None
    for one in range(points.shape[1]):
        known = np.flatnonzero(np.isfinite(every[:, one]).all(axis=-1))
        # Pieces without a gap that is too long.
        for piece in np.split(known, np.flatnonzero(np.diff(known) > GAP_S * fps + 1) + 1):
            if len(piece) > 1:
                span = np.arange(piece[0], piece[-1] + 1)
                filled = np.column_stack([np.interp(span, piece, every[piece, one, axis]) for axis in range(3)])
                if sections is not None:
                    filled = sosfiltfilt(sections, filled, axis=0, padlen=min(len(span) - 1, 6 * ORDER))
                every[span, one] = filled
    return every[frames - frames[0]]


def cell(parameters: Parameters, inputs: Inputs, rng: np.random.Generator) -> Results:
    """Landmarks of every true person, and what was found for it by one way.

    Parameters
    ----------
    parameters : mapping
        ``recording``, ``cameras`` (0: all), ``cues`` (a key of `WAYS`), ``fault`` (of `hmc.experiments.keypoint_faults.FAULTS`; empty:
        none), ``frames`` (0: all), ``repeat``, which is the seed.
    inputs : Inputs
    rng : numpy.random.Generator
        Not used: the chain and the faults draw by their seed.

    Returns
    -------
    dict
        As of `hmc.experiments.chain_runs.cell` without tracks; landmarks that a way does not have are NaN. ``faulty``: first frame of the
        fault and the one after its last; empty without one.

    Raises
    ------
    InputError
        When the recording has no truth or, where the way uses them, no keypoints.
    """
    way, needs_keypoints = WAYS[parameters["cues"]]
    some = opened(inputs, parameters["recording"], parameters["cameras"])
    recorded = open_recording(some.path, some.rig.names, frames=parameters["frames"] or None)
    recording = as_read(recorded)
    truth, fault, seed = truth_in(recording), parameters["fault"], parameters["repeat"]
    people, source = followed(parameters, inputs, recording), None
    if needs_keypoints:
        source = with_fault(_keypoints(inputs, parameters["recording"], recorded), recorded, truth, fault, seed).reduced(recording.factors)
    mended = turned_back(recording, people.tracks, people.run, source)
    recording, cues = mended.recording, mended.cues
    poses = way(parameters, Footage(recording, people, cues))
    return scored_poses(recording, poses, truth) | {"faulty": [] if fault == NO_FAULT else list(fault_frames(recording, fault, seed))}


def _keypoints(inputs: Inputs, label: str, recording: Recording) -> KeypointSource:
    """A detector's keypoints of the user's recording, or pretended ones of a rendered one, with the cameras of `recording`."""
    if label in inputs.recordings:
        found = open_keypoints(recording)
    else:
        folder = once(inputs.folder / label / "with-keypoints", lambda part: _pretend(inputs.recording_folder(label), label, part))
        found = open_keypoints(open_recording(folder, recording.rig.names))
    if found is None:
        raise InputError(f"{recording.path}: has no keypoints of these cameras; put a detector's into keypoints/CAMERA/")
    return found


def _pretend(recording: Path, label: str, part: Path) -> None:
    """A copy of a rendered recording with pretended detections, the same whenever they are made."""
    shutil.copytree(recording, part, ignore=shutil.ignore_patterns("silhouettes"))
    write_keypoints(part, np.random.default_rng(int(digest([label], 8), 16)), furniture=_furniture(recipe_of(label.rpartition("@")[0])))


def _furniture(recipe: Recipe) -> np.ndarray:
    """Boxes around a recipe's furniture where it stands at first, lower and upper corners, (n, 2, 3), metres."""
    boxes = [box for one in recipe.furniture for box in furnish(one.kind, one.at_m, one.heading_deg, one.size_m)]
    reach = [np.abs(box.axes).T @ box.half for box in boxes]
    return np.array([[box.centre - half, box.centre + half] for box, half in zip(boxes, reach, strict=True)]).reshape(-1, 2, 3)
