"""Things that were taken for people: where such a track ended, none begins as long as the thing stands there.

Beyond Canton (2009), whose tracker deletes such a track (section 4.2.3) and may begin it again in the next frame.
"""

from __future__ import annotations

import numpy as np

from hmc.tracking.lifecycle import LifecycleSettings, Row, Track

__all__ = ["left_behind", "not_things"]

#: Somebody who stands where a thing was taken for a person has the head so much higher, metres.
STANDS_HIGHER_M = 0.2


def left_behind(
    before: tuple[Row, ...],
    followed: tuple[Track, ...],
    staying: tuple[Track, ...],
    free: np.ndarray,
    fps: float,
    settings: LifecycleSettings,
) -> tuple[Row, ...]:
    """Things that were taken for people: the last rows of tracks that ended because they did not look like one, while something is there.

    Parameters
    ----------
    before : tuple of Row
        Those of the last frame.
    followed, staying : tuple of Track
        Before and after `delete`.
    free : ndarray, shape (n, 3)
        Centres of voxels that nobody owns, world, metres.
    fps : float
    settings : LifecycleSettings

    Returns
    -------
    tuple of Row
    """
    alive = {track.person for track in staying}
    ended = (track for track in followed if track.person not in alive and track.unlike >= settings.unlike_s * fps - 1)
    near = settings.least_distance_m
    there = (one for one in before if np.any(np.hypot(*(free - one.position)[:, :2].T) < near))
    return (*there, *(track.doubtful[-1] for track in ended if track.doubtful))


def not_things(rows: list[Row], things: tuple[Row, ...], settings: LifecycleSettings) -> list[Row]:
    """The rows that are not one of the things that were taken for people; somebody who stands there is higher."""

    def is_thing(row: Row, one: Row) -> bool:
        near = float(np.hypot(*(row.position - one.position)[:2])) <= settings.least_distance_m
        return bool(near and row.head[2] <= one.head[2] + STANDS_HIGHER_M)

    return [row for row in rows if not any(is_thing(row, one) for one in things)]
