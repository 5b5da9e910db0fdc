"""Cameras that have turned since they were calibrated are turned back, for poses to be found by all cameras.

Silhouettes tell first, as every recording has them; what keypoints tell, they tell with the cameras that silhouettes have turned back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hmc.camera.turned_cameras import TurnedCamera, turn_back
from hmc.io.keypoints import KeypointSource
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.keypoint_cues import KeypointCues, learn_scatter
from hmc.pose.turned_by_keypoints import turned_by_keypoints
from hmc.pose.turned_by_silhouettes import turned_by_silhouettes
from hmc.voxels.run_options import RunOptions

__all__ = ["turned_back"]


def turned_back(
    recording: Recording, tracks: TrackTable, run: RunOptions, keypoints: KeypointSource | None = None
) -> tuple[Recording, KeypointCues | None, list[str]]:
    """The recording with cameras turned back that have turned, what its keypoints tell then, and a line on each such camera.

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
    mended, lines = recording if keep else _turned(recording, found), [_line(one, keep) for one in found]
    if keypoints is None:
        return mended, None, lines
    cues = learn_scatter(mended.rig, tracks, keypoints, mended.fps, run.workers)
    if keep and found:  # they would tell the same
        return mended, cues, lines
    found = turned_by_keypoints(mended.rig, tracks, cues, run.workers)
    if found and not keep:
        mended = _turned(mended, found)
        cues = learn_scatter(mended.rig, tracks, keypoints, mended.fps, run.workers)
    return mended, cues, lines + [_line(one, keep) for one in found]


def _turned(recording: Recording, found: Sequence[TurnedCamera]) -> Recording:
    return replace(recording, rig=turn_back(recording.rig, found)) if found else recording


def _line(one: TurnedCamera, keep: bool) -> str:
    return f"{one}; it is kept as it is" if keep else f"{one}; poses are found with it turned back, calibrate it anew"
