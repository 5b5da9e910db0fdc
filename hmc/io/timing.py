"""Which frame of a camera's files belongs to which frame of the recording, by the times at which they were taken.

Times are needed where cameras differ in rate, drop frames or have a clock of their own; else frames are counted. They are in
``times/CAMERA.csv``, or, of videos that differ in rate or whose rate varies, in the video itself.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.door import MAX_FRAME_NUMBER, check_folder, read_text_file
from hmc.io.files import atomic_write
from hmc.io.footage import Footage, stamps

__all__ = ["NO_FRAME", "go_by_time", "nearest_frames", "rates_differ", "read_times", "times_file", "times_text", "write_times"]

#: In place of a frame's number: the camera has none.
NO_FRAME = -1
#: Videos whose rates differ by less than this share are taken frame by frame.
SAME_RATE = 0.01
#: Frames are this near to where an even rate has them, in frames, or else the rate varies.
UNEVEN = 0.5
#: Rates that cameras are set to, a second; one that is another, or a 1000/1001 of these, may be the mean of one that varies.
USUAL_RATES = np.array([10, 12, 12.5, 15, 20, 24, 25, 30, 48, 50, 60, 75, 90, 100, 120, 150, 180, 200, 240, 250, 300, 500, 1000], float)
HEAD = "frame,time_s"
#: Frames that are so many times further apart than the recording's, or nearer, are timed in no seconds.
OTHER_UNIT = 100.0


def nearest_frames(times: np.ndarray) -> np.ndarray:
    """The frame of a camera for each frame of the recording: the nearest in time, or none where none is within half an interval.

    Parameters
    ----------
    times : ndarray, shape (n,)
        When each of the camera's frames was taken, rising, in frames of the recording (time in seconds times its rate); NaN where unknown.

    Returns
    -------
    ndarray of int, shape (m,)
        For frames 0 to m - 1 of the recording, m - 1 being the last that the camera has; `NO_FRAME` where it has none. No frame
        comes twice.
    """
    times = np.asarray(times, float)
    index = np.flatnonzero(np.isfinite(times))
    places = np.floor(times[index] + 0.5).astype(int)
    index, places = index[places >= 0], places[places >= 0]
    found = np.full(int(places.max(initial=-1)) + 1, NO_FRAME)
    far = np.abs(times[index] - places)
    # The nearest is written last, of equally near ones the first.
    order = np.lexsort((-index, -far))
    found[places[order]] = index[order]
    return found


def times_file(path: Path, name: str) -> Path:
    """Where the times of a camera's frames are, in a recording's folder."""
    return path / "times" / f"{name}.csv"


def read_times(file: Path) -> np.ndarray | None:
    """When each frame of a camera's files was taken.

    Parameters
    ----------
    file : Path
        ``frame,time_s``: a frame's number in the camera's files (of images, their own numbers or counted from 0: `go_by_time` tells), and
        seconds on a clock that all cameras share.

    Returns
    -------
    ndarray, shape (n,), or None
        Seconds, by the file's numbers; NaN of frames that are not in it. None where there is no such file.

    Raises
    ------
    InputError
        When it is not of that form, or time does not rise.
    """
    check_folder(file.parent)
    if not os.path.lexists(file):
        return None
    lines = [line.strip() for line in read_text_file(file).splitlines() if line.strip()]
    if not lines or lines[0].replace(" ", "") != HEAD:
        raise InputError(f"{file}: its first line must be `{HEAD}`: a frame of the camera's files and its time in seconds, a line each")
    rows: dict[int, float] = {}
    for number, line in enumerate(lines[1:], 2):
        try:
            frame, time = line.split(",")
            index, seconds = int(frame), float(time)
        except ValueError:
            raise InputError(f"{file}: line {number} is no frame and time in seconds, as in 12,0.4: {line[:40]!r}") from None
        if index in rows:
            raise InputError(f"{file}: line {number} has frame {index} once more; leave one line of each frame")
        rows[index] = seconds
    if not rows or min(rows) < 0 or max(rows) > MAX_FRAME_NUMBER or not np.isfinite(list(rows.values())).all():
        raise InputError(f"{file}: must hold the times of frames from 0 on, in seconds; mend or remove it")
    frames = sorted(rows)
    found = np.array([rows[frame] for frame in frames])
    if (np.diff(found) <= 0).any():
        late = frames[int(np.argmax(np.diff(found) <= 0)) + 1]
        raise InputError(f"{file}: time must rise from frame to frame; that of frame {late} does not")
    times = np.full(frames[-1] + 1, np.nan)
    times[frames] = found
    return times


def write_times(file: Path, times: np.ndarray) -> None:
    """Write the times, (n,) seconds, as `read_times` reads them."""
    with atomic_write(file) as target:
        target.write(times_text(times))


def times_text(times: np.ndarray) -> str:
    """What `write_times` writes of times, shape (n,), seconds; NaN are left out."""
    return HEAD + "\n" + "".join(f"{frame},{time:.6f}\n" for frame, time in enumerate(times) if np.isfinite(time))


def go_by_time(path: Path, views: Mapping[str, Footage], fps: float, by_stamps: bool, starts: Mapping[str, int]) -> dict[str, np.ndarray]:
    """When each frame of a camera's files was taken, of the cameras that go by time.

    Parameters
    ----------
    path : Path
        Folder of the recording.
    views : mapping of str to Footage
        Each camera's files, from their first frame on.
    fps : float
        Of the recording.
    by_stamps : bool
        Videos without a file of times go by their own time stamps, or else only where these are uneven.
    starts : mapping of str to int
        `first_frame` of recording.toml.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        In frames of the recording; cameras that are not in it count frames.

    Raises
    ------
    InputError
        When a file of times is wrong, has frames that the camera's files have not, or contradicts `first_frame`.
    """
    found = {}
    for name, view in views.items():
        file = times_file(path, name)
        times = read_times(file)
        if times is not None:
            if name in starts:
                raise InputError(
                    f"{file}: tells when frames were taken, and so does `first_frame` of recording.toml for '{name}'; leave one"
                )
            times = _from_first_frame(file, times, view)
            _refuse_far(file, times, fps)
            _refuse_other_unit(file, times, fps)
            in_frames = times * fps
            if not (nearest_frames(in_frames) >= 0).any():
                low, high = np.nanmin(times), np.nanmax(times)
                raise InputError(
                    f"{file}: no frame was taken from 0 s on, when the recording begins (its times are {low:g} to {high:g} s); "
                    "give seconds from the recording's first frame on"
                )
            found[name] = in_frames
        elif view.images is None and (by_stamps or _is_odd(view.fps)):
            seconds = stamps(view)
            even = np.arange(len(seconds)) / (view.fps or fps)
            if len(seconds) and (by_stamps or np.abs(seconds - even).max() * (view.fps or fps) > UNEVEN):
                first = min(starts.get(name, 0), len(seconds) - 1)
                _refuse_far(view.path, seconds - seconds[first], fps)
                found[name] = (seconds - seconds[first]) * fps
    return found


def _from_first_frame(file: Path, times: np.ndarray, view: Footage) -> np.ndarray:
    """Times by frames counted from 0, of those by the numbers of a table: these count from 0 too or, of numbered images, as they do.

    Where either may be meant, that counts which more images bear; a frame that is not there would silently move all others. A log that
    begins with the first frame's own number may go on after the last that was written.
    """
    rows, first, n = np.flatnonzero(np.isfinite(times)), view.first_number, view.n_frames
    fitting = [shift for shift in sorted({0, first}) if rows[0] >= shift and (rows[-1] < shift + n or rows[0] == shift == first)]
    if not fitting:
        own = f"0 to {n - 1}" + (f", or {first} to {first + n - 1} as its images are numbered" if first else "")
        raise InputError(
            f"{file}: has times of frames {rows[0]} to {rows[-1]}, but the frames of {view.path} are {own}; count them so, and leave out "
            "what is not there"
        )
    if len(fitting) > 1 and view.images is not None:
        borne = [sum(row - shift in view.images for row in rows.tolist()) for shift in fitting]
        if borne[0] == borne[1]:
            raise InputError(
                f"{file}: has times of frames {rows[0]} to {rows[-1]}, which may count from 0 or as the images are numbered, from {first}; "
                "give the times of the first frame and of the last too"
            )
        fitting = [fitting[int(np.argmax(borne))]]
    return times[fitting[0] :][:n]


def _refuse_far(file: Path, times: np.ndarray, fps: float) -> None:
    """Times at which no recording is still at work: each frame up to the last takes memory."""
    last = float(np.max(times, initial=0.0, where=~np.isnan(times)))
    if last > MAX_FRAME_NUMBER / fps:
        raise InputError(
            f"{file}: has a frame at {last:.6g} s, frames go to {MAX_FRAME_NUMBER}, {fps:g} a second; give seconds from the recording's "
            "first frame on"
        )


def _refuse_other_unit(file: Path, times: np.ndarray, fps: float) -> None:
    """Times of another unit than seconds: of a thousand frames in milliseconds one would be used, without a gap that is told."""
    steps = np.diff(times[np.isfinite(times)])
    step = float(np.median(steps)) if len(steps) else 1 / fps
    if not 1 / OTHER_UNIT < step * fps < OTHER_UNIT:
        raise InputError(
            f"{file}: its frames are {step:.3g} s apart, the recording's {1 / fps:.3g} s ({fps:g} a second); give seconds, or correct "
            "`fps` in recording.toml"
        )


def rates_differ(rates: Sequence[float | None]) -> bool:
    """Whether some of these rates are another than others, so that frames must be matched by time."""
    known = [rate for rate in rates if rate]
    return bool(known) and max(known) > (1 + SAME_RATE) * min(known)


def _is_odd(fps: float | None) -> bool:
    """Whether a video's header states a rate that no camera is set to: the mean of one that varies, perhaps."""
    if not fps:
        return False
    usual = np.concatenate([USUAL_RATES, USUAL_RATES / 1.001])
    return bool((np.abs(fps - usual) > 1e-4 * usual).all())
