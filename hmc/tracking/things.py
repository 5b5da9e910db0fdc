"""Things that were taken for people: where such a track ended, none begins as long as the thing stands there.

Beyond Canton (2009), whose tracker deletes such a track (section 4.2.3) and may begin it again in the next frame. And where somebody gets
up from a thing, the number goes with the one who gets up.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.tracking.lifecycle import LifecycleSettings, Row, Track, is_established

__all__ = ["came_out", "left_behind", "not_things"]

#: Somebody who stands where a thing was taken for a person has the head so much higher, metres.
STANDS_HIGHER_M = 0.2
#: Who gets up from a thing is first seen apart from it within this distance, metres.
CAME_OUT_M = 1.5
#: And until the track begins comes no nearer to it than by this, metres: somebody else who walks up does.
NEARER_M = 0.15
#: The centroid of what is left when somebody gets up is no higher than this, metres.
LOW_M = 0.5


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


def came_out(
    followed: tuple[Track, ...],
    fresh: tuple[Track, ...],
    earlier: list[Row],
    fps: float,
    room: np.ndarray,
    settings: LifecycleSettings,
) -> tuple[dict[int, Track], list[Row]]:
    """Who got up from a thing that the track stayed with: a person who begins beside a track that does not look like one, or is low,
    and does not walk up to it.

    Only established tracks are given on, and nobody who comes in at the edge of the room is taken for one of them.

    Parameters
    ----------
    followed, fresh : tuple of Track
        The tracks of this frame, and those that begin in it.
    earlier : list of Row
        Rows of those that begin.
    fps : float
    room : ndarray, shape (2, 3)
        Lowest and highest corner of the grid, metres.
    settings : LifecycleSettings

    Returns
    -------
    goes_on : dict of int to Track
        By the number of the track that began, how the older track goes on.
    rows : list of Row
        `earlier`, with the numbers of the older tracks.
    """
    goes_on: dict[int, Track] = {}
    rows = list(earlier)
    for new in fresh:
        first = next(row.position for row in earlier if row.person == new.person)
        inside = np.all((first > room[0] + settings.edge_m)[:2] & (first < room[1] - settings.edge_m)[:2])
        gaps = {
            track.person: (float(np.hypot(*(first - track.position)[:2])), track)
            for track in followed
            if (track.unlike > 0 or track.position[2] <= LOW_M)
            and is_established(track, fps, settings)
            and track.person not in {old.person for old in goes_on.values()}
            and np.hypot(*(new.position - track.position)[:2]) >= np.hypot(*(first - track.position)[:2]) - NEARER_M
        }
        if not inside or not gaps:
            continue
        gap, old = min(gaps.values(), key=lambda pair: pair[0])
        if gap <= CAME_OUT_M:
            goes_on[new.person] = replace(new, person=old.person, first_frame=old.first_frame, liked=old.liked)
            withheld = {row.frame for row in old.doubtful}
            before = [row for row in old.doubtful if row.frame < new.first_frame]
            moved = [replace(row, person=old.person) for row in rows if row.person == new.person and row.frame in withheld]
            rows = [row for row in rows if row.person != new.person] + before + moved
    return goes_on, rows
