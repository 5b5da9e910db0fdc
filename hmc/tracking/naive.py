"""The naive tracker: each person is at the centroid of the voxels in the region of influence around where they should be.

Source: Canton (2009), section 4.3.1, Eq. 4.4-4.7. Three things differ from the text. The region is placed at the position predicted
from the smoothed velocity instead of the last one. Voxels in the regions of several persons go to the nearest (Eq. 4.7 takes them
from all; ``exclusion="remove"`` does so). And once the region has told which component a person is, the whole component within
reach counts, not the part inside the ellipsoid only, so that stretched arms are in the centroid.
"""

from __future__ import annotations

from hmc.tracking.association import FollowingSettings
from hmc.tracking.blobs import Observation
from hmc.tracking.following import StepInfo, TrackerState, advance, finish, init

__all__ = ["finish", "init", "step"]


def step(
    state: TrackerState, frame: int, observation: Observation | None, settings: FollowingSettings | None = None
) -> tuple[TrackerState, StepInfo]:
    """One frame on.

    Parameters
    ----------
    state : TrackerState
    frame, observation
        As for `hmc.tracking.following.advance`.
    settings : FollowingSettings, optional
        The naive tracker has no parameters beyond those that every tracker has.

    Returns
    -------
    state : TrackerState
    info : StepInfo
    """
    return advance(state, frame, observation, FollowingSettings() if settings is None else settings)
