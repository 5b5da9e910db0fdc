"""Cameras that have turned since they were calibrated are turned back, for poses to be found by all cameras.

Silhouettes tell first, as every recording has them; what keypoints tell, they tell with the cameras that silhouettes have turned back.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from hmc.camera.turned_cameras import TurnedCamera
from hmc.io.camera_turns import as_posed
from hmc.io.keypoints import KeypointSource
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.keypoint_cues import KeypointCues, learn_scatter
from hmc.pose.turned_by_keypoints import turned_by_keypoints
from hmc.pose.turned_by_silhouettes import turned_by_silhouettes
from hmc.voxels.run_options import RunOptions

__all__ = ["TurnedBack", "turned_back"]


@dataclass(frozen=True)
class TurnedBack:
    """A recording whose cameras look where they did when its videos were made.

    Parameters
    ----------
    recording : Recording
    cues : KeypointCues or None
        What its keypoints tell by these cameras.
    turns : mapping of str to ndarray, shape (3,)
        Rotation vectors, world, radians, by which cameras were turned back about their centres.
    notes : tuple of str
        A line on each camera that has turned.
    """

    recording: Recording
    cues: KeypointCues | None = None
    turns: Mapping[str, np.ndarray] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def turned_back(recording: Recording, tracks: TrackTable, run: RunOptions, keypoints: KeypointSource | None = None) -> TurnedBack:
    """Turn cameras back that have turned since they were calibrated.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable
    run : RunOptions
        With the silhouettes that were kept. A run that excludes no camera keeps them all as they are; the lines say so.
    keypoints : KeypointSource, optional
        What a detector of 2-D keypoints saw.
    """
    keep = run.frontend is not None and not run.frontend.exclude
    found = turned_by_silhouettes(recording, tracks, run)
    turns = {} if keep else _added({}, found)
    notes, cues = [_line(one, keep) for one in found], None
    if keypoints is not None:
        rig = as_posed(recording, turns).rig
        cues = learn_scatter(rig, tracks, keypoints, recording.fps, run.workers)
        # Of cameras that are kept as they are, keypoints tell the same again.
        more = [] if keep and found else turned_by_keypoints(rig, tracks, cues, run.workers)
        notes += [_line(one, keep) for one in more]
        if more and not keep:
            turns = _added(turns, more)
            cues = learn_scatter(as_posed(recording, turns).rig, tracks, keypoints, recording.fps, run.workers)
    return TurnedBack(as_posed(recording, turns), cues, turns, tuple(notes))


def _added(turns: Mapping[str, np.ndarray], found: Sequence[TurnedCamera]) -> dict[str, np.ndarray]:
    """Turns with those that were found after them."""
    all_turns = dict(turns)
    for one in found:
        before = Rotation.from_rotvec(all_turns.get(one.name, np.zeros(3)))
        all_turns[one.name] = (Rotation.from_rotvec(one.turn) * before).as_rotvec()
    return all_turns


def _line(one: TurnedCamera, keep: bool) -> str:
    return f"{one}; it is kept as it is" if keep else f"{one}; poses are found with it turned back, calibrate it anew"
