"""The last frames' views of a pass forward in time, for the pass backward, which begins with these frames.

A view depends on nothing but its frame, its tracks and what was read of the detector, so one that is kept is to the bit the one that would
be made again. How many are kept is bounded by memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hmc.pose.views.person_view import PersonView

__all__ = ["RECENT_BYTES", "RecentViews", "bytes_of"]

#: What the views of the last frames may take, bytes: some hundred frames of a person at 3 cm.
RECENT_BYTES = 200 << 20


@dataclass
class RecentViews:
    """Views of the last frames, oldest first; those that no longer fit are dropped.

    Parameters
    ----------
    limit : int
        Bytes.
    views : mapping of int to mapping of int to PersonView
        By frame and person, without what only methods on colored voxels need.
    """

    limit: int = RECENT_BYTES
    views: dict[int, Mapping[int, PersonView]] = field(default_factory=dict)
    _bytes: int = 0

    def add(self, frame: int, views: Mapping[int, PersonView]) -> None:
        """Keep a later frame's views."""
        kept = {person: PersonView(view.frame, view.target, keypoints=view.keypoints) for person, view in views.items()}
        self.views[frame] = kept
        self._bytes += sum(map(bytes_of, kept.values()))
        while self._bytes > self.limit:
            oldest = next(iter(self.views))
            self._bytes -= sum(map(bytes_of, self.views.pop(oldest).values()))


def bytes_of(view: PersonView) -> int:
    """How large a view's arrays are, without those that methods on colored voxels need."""
    arrays = [value for part in (view.target, view.keypoints) if part is not None for value in vars(part).values()]
    return sum(value.nbytes for value in arrays if isinstance(value, np.ndarray))
