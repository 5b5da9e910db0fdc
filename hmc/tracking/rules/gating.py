"""Gating and data association: each voxel goes to the nearest person in whose region of influence its component lies.

Canton (2009), section 4.3.1. Shown by all tests of the trackers; the shares themselves by `test_owners_match_a_loop_over_voxels`.
"""

from __future__ import annotations

from dataclasses import replace

from hmc.tracking.association import assign_voxels
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import FrameUpdate

__all__ = ["associate_voxels"]


def associate_voxels(update: FrameUpdate, settings: FollowingSettings) -> FrameUpdate:
    """The update with the owner of each voxel."""
    owners, shared = assign_voxels(update.observation, update.estimate.positions, settings)
    return replace(update, owners=owners, shared=shared)
