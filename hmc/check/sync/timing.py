"""From courses to what a recording says of its cameras' times: first frames and time stamps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.check.sync.courses import Course
from hmc.io.recording import Recording
from hmc.io.timing import times_file

__all__ = ["new_timing"]


def new_timing(recording: Recording, courses: Sequence[Course]) -> tuple[dict[str, int], dict[str, np.ndarray]]:
    """What is to be written for these courses.

    Parameters
    ----------
    recording : Recording
        Whole, as it was when the courses were found.
    courses : sequence of Course
        One a camera, over its frames as they count now.

    Returns
    -------
    first_frames : dict of str to int
        Of the cameras that count frames; the recording begins when the last camera does, so the smallest is 0 where all count.
    times : dict of str to ndarray, shape (n,)
        Of the others: when each frame of their files was taken, seconds.
    """
    places = {}
    for name, view in zip(recording.rig.names, recording._own_views, strict=True):
        own = recording._times.get(name)
        if own is None and view is not None:
            own = np.arange(view.n_frames + view.skipped, dtype=float) - view.skipped
        if own is not None:
            places[name] = own
    moments = {name: course.moments(places[name]) for name, course in zip(recording.rig.names, courses, strict=True) if name in places}
    begin = max(float(np.nanmin(own)) for own in moments.values())
    begin = round(begin)
    first_frames, times = {}, {}
    for name, course in zip(recording.rig.names, courses, strict=True):
        if name not in moments:
            continue
        if course.is_plain and not times_file(recording.path, name).is_file():
            first_frames[name] = int(np.nanargmin(np.abs(moments[name] - begin)))
        else:
            times[name] = (moments[name] - begin) / recording.fps
    return first_frames, times
