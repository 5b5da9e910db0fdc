"""How fast a tracker is: frames a second and the real-time factor. Source: Canton (2009), section 4.4.3, Eq. 4.25-4.27."""

from __future__ import annotations

import numpy as np

from hmc.errors import InputError

__all__ = ["frames_per_second", "real_time_factor"]


def frames_per_second(frames, seconds) -> float:
    """Frames of all sequences over the time of all sequences (Eq. 4.26; Eq. 4.25 for one sequence).

    Parameters
    ----------
    frames, seconds : float or array_like
        Number of frames and elapsed time, one a sequence.

    Raises
    ------
    InputError
        When no time has passed, or a number is negative.
    """
    n, elapsed = np.atleast_1d(np.asarray(frames, float)), np.atleast_1d(np.asarray(seconds, float))
    if n.shape != elapsed.shape or (n < 0).any() or (elapsed < 0).any() or not elapsed.sum() > 0:
        raise InputError("`frames` and `seconds` need one number a sequence, none negative, and a total time above 0")
    return float(n.sum() / elapsed.sum())


def real_time_factor(frames, seconds, fps: float = 25.0) -> float:
    """Frames a second over the rate at which the cameras deliver them (Eq. 4.27); 1 or more keeps up.

    Parameters
    ----------
    frames, seconds : float or array_like
        As for `frames_per_second`.
    fps : float
        The cameras' frame rate; the thesis's is 25.
    """
    if not fps > 0:
        raise InputError(f"`fps` must be above 0; got {fps}")
    return frames_per_second(frames, seconds) / fps
