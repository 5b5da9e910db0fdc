"""How tall a person may be, and where enough of one is seen to start from: by the tops of hulls."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.person_view import PersonView

__all__ = ["estimate_height", "possible_heights", "usable_frames"]

#: Fewer surface voxels are too little of a person to start from.
LEAST_START_SURFACE = 50
#: A hull that ends lower than this is no adult who stands, metres; below the second, it is no child either.
ADULT_M, CHILD_M = 1.45, 0.9
#: Stray voxels are above the top of a hull: it is at this quantile of its surface.
TOP_QUANTILE = 0.995
#: Who sits down or bends was before as tall as this quantile of the frames' tops.
STOOD_QUANTILE = 0.9
#: The top of who sits, as a share of the stature: a trunk with head of half of it, on a seat of somewhat more than a quarter.
SITTING_SHARE = 0.78
#: Statures nearer than this share are one to start from: the body's dimensions are fitted.
ALIKE = 0.06
#: An adult's mean stature, metres.
ADULT_MEAN_M = 1.7


def estimate_height(targets: Sequence[HullTarget | None], floor_z: float = 0.0) -> float:
    """Stature from the tracked volume: how high the top of the hull commonly comes, if that is as high as an adult who stands.

    The first of `possible_heights`.

    Parameters
    ----------
    targets : sequence of HullTarget or None
        A person's hulls in some frames.
    floor_z : float
        Height of the floor, metres.

    Returns
    -------
    float
        Metres; an adult's mean stature where the person never stood up.
    """
    return possible_heights(targets, floor_z)[0]


def possible_heights(targets: Sequence[HullTarget | None], floor_z: float = 0.0) -> tuple[float, ...]:
    """Statures that the tracked volume allows: by how high its top commonly comes, and how high it came for a while.

    Parameters
    ----------
    targets, floor_z
        As for `estimate_height`.

    Returns
    -------
    tuple of float
        One to four, metres, the likeliest first: where the top is commonly low, that is an adult who sits and not a child who stands.
    """
    tops = [
        np.quantile(t.surface[:, 2], TOP_QUANTILE) - floor_z for t in targets if t is not None and len(t.surface) >= LEAST_START_SURFACE
    ]
    # Arms held up, hats and stray voxels reach above the crown: the median of the frames resists all that does not last.
    common, stood = np.minimum(np.quantile(tops or [0.0], (0.5, STOOD_QUANTILE)), 2.0).tolist()
    heights = [common if common > ADULT_M else ADULT_MEAN_M]
    for height in (common, common / SITTING_SHARE, stood) if common <= ADULT_M else (stood,):
        if height > CHILD_M and all(abs(height / other - 1) > ALIKE for other in heights):
            heights.append(height)
    return tuple(heights)


def usable_frames(views: Sequence[PersonView]) -> list[int]:
    """Places in the sequence of the frames with enough of a person to start from."""
    return [k for k, view in enumerate(views) if view.target is not None and len(view.target.surface) >= LEAST_START_SURFACE]
