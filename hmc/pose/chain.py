"""From tracks to finished poses: forward in time, backward, smooth, and how far each landmark is borne out."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hmc.io.keypoints import KeypointSource
from hmc.io.recording import Recording
from hmc.io.results import TrackTable
from hmc.pose.backward import backward
from hmc.pose.follow import FollowOptions, PosedPeople, follow
from hmc.pose.keypoint_views import with_keypoint_views
from hmc.pose.method import PoseMethod
from hmc.pose.trust import with_trust
from hmc.pose.turned_back import TurnedBack, turned_back
from hmc.pose.views.recent import RecentViews
from hmc.voxels.run_options import RunOptions

__all__ = ["ChainRuns", "finished_poses"]


@dataclass(frozen=True)
class ChainRuns:
    """How the three stages are kept and told of; their silhouettes are the same, their journals are not.

    Parameters
    ----------
    forward, backward, views : RunOptions
    """

    forward: RunOptions
    backward: RunOptions
    views: RunOptions


def finished_poses(
    recording: Recording,
    tracks: TrackTable | None,
    method: PoseMethod,
    options: FollowOptions,
    runs: ChainRuns,
    keypoints: KeypointSource | None = None,
    smooth_s: float | None = None,
) -> PosedPeople:
    """The poses of all tracked people after all that the method does, with their views, and trust where silhouettes bear them out.

    Cameras that have turned since they were calibrated are turned back (`hmc.pose.turned_back`); silhouettes and tracks are those of the
    cameras as they are.

    Parameters
    ----------
    recording : Recording
    tracks : TrackTable or None
        None for a method that needs none.
    method : PoseMethod
    options : FollowOptions
        Its `keypoints` and `recent` are set here.
    runs : ChainRuns
    keypoints : KeypointSource, optional
        What a detector of 2-D keypoints saw, for a method that uses some.
    smooth_s : float, optional
        Poses are smoothed over so many seconds at last; a method that smooths by itself is to be asked not to (`hmc.pose.method.as_found`).

    Raises
    ------
    InputError
        When the voxels are too many for the memory, or what the method needs is not given.
    """
    mended = (
        TurnedBack(recording) if tracks is None else turned_back(recording, tracks, runs.forward, keypoints if method.keypoints else None)
    )
    recording, cues = mended.recording, mended.cues
    options = replace(options, keypoints=cues, recent=RecentViews())
    people = follow(recording, tracks, method, options, runs.forward)
    people = replace(people, notes=(*mended.notes, *people.notes), turned=mended.turns)
    if tracks is not None:
        people = backward(recording, tracks, method, people, options, runs.backward)
    if smooth_s:
        from hmc.motion.smoothing import window_too_short

        people = people.smoothed("polynomial", window_s=smooth_s, limits=method.limits)
        if short := window_too_short(recording.fps, smooth_s):
            people = replace(people, notes=(*people.notes, f"nothing was smoothed: {short}"))
    if method.needs_hulls:
        return with_trust(people, recording, runs.views)
    return people if cues is None or tracks is None else with_keypoint_views(people, recording, tracks, cues)
