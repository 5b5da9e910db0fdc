"""What looks like a person: the verdict on sets of voxels, by a trained tree (Canton 2009, Table 4.1, Figure 4.4) or by limits alone."""

from __future__ import annotations

import numpy as np

from hmc.tracking.blobs import Blobs
from hmc.tracking.features import feature_matrix
from hmc.tracking.person_tree import predict_person
from hmc.tracking.settings import LifecycleSettings
from hmc.tracking.state import Track

__all__ = ["horizontal_distance", "is_established", "looks_like_object", "looks_like_person"]


def looks_like_person(blobs: Blobs, settings: LifecycleSettings) -> np.ndarray:
    """Which sets of voxels may be a person who appears; shape (n,) bool.

    Of people who stand, bend, kneel or sit, all must be within the settings' limits, and the tree, where there is one, decides what of
    that is people: groups of fragments and noise are unlike anything that it has seen. People who lie have limits of their own.
    """
    longer = blobs.sides_m[:, 0]
    top, bottom = blobs.top_m, blobs.lowest[:, 2]
    possible = (
        (top >= settings.least_top_m)
        & (top <= settings.most_top_m)
        & (blobs.height_m >= settings.least_height_m)
        & (bottom <= settings.most_bottom_m)
        & (blobs.volume_m3 >= settings.least_volume_m3)
        & (blobs.volume_m3 <= settings.most_volume_m3)
        & (longer >= settings.least_side_m)
        & (longer <= settings.most_side_m)
    )
    if settings.tree is not None:
        possible &= predict_person(settings.tree, feature_matrix(blobs))
    return possible | _lies(blobs, settings)


def _lies(blobs: Blobs, settings: LifecycleSettings) -> np.ndarray:
    """Which sets of voxels may be a person who lies, on the floor or on a table, or is on the hands; shape (n,) bool."""
    longer = blobs.sides_m[:, 0]
    return (
        (longer >= settings.lying_m[0])
        & (longer <= settings.lying_m[1])
        & (blobs.top_m <= settings.most_lying_top_m)
        & (blobs.height_m >= settings.lying_height_m[0])
        & (blobs.height_m <= settings.lying_height_m[1])
        & (blobs.lowest[:, 2] <= settings.most_bottom_m)
        & (blobs.volume_m3 >= settings.lying_m3[0])
        & (blobs.volume_m3 <= settings.lying_m3[1])
    )


def looks_like_object(blobs: Blobs, settings: LifecycleSettings) -> np.ndarray:
    """Which sets of voxels may be a chair or the like that was left behind; shape (n,) bool.

    They do not look like a person and are lower than one who appears; people who sit on the floor or crouch may be so too, but they
    move, and a person who lies is longer.
    """
    return ~looks_like_person(blobs, settings) & (blobs.top_m < settings.least_top_m + 0.1) & (blobs.sides_m[:, 0] < settings.least_lying_m)


def is_established(track: Track, fps: float, settings: LifecycleSettings) -> bool:
    """Whether a track has looked like a person for so long that it is one."""
    return track.liked >= settings.established_s * fps


def horizontal_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Distance of two points seen from above, metres."""
    return float(np.hypot(*(a - b)[:2]))
