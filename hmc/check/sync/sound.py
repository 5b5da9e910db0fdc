"""When each camera began, by the sound tracks of the videos: every two of them compared, and one time for each that agrees with all."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from hmc.check.sync.courses import LEAST_DRIFT, Course
from hmc.check.sync.find import CameraTime, Synchrony
from hmc.check.sync.hearing import Heard, heard_later, onsets
from hmc.io.ffmpeg import ffmpeg_path
from hmc.io.footage import Footage
from hmc.io.recording import Recording
from hmc.io.sound import SAMPLE_RATE, read_sound, video_begins

__all__ = ["Sound", "listen", "settled", "with_sound"]

#: Metres a second.
SPEED_OF_SOUND = 343.0
#: What pairs of cameras say of one of them differs by no more than this, seconds, and the sound's way; and its clock by so much a second.
AGREE_S, SAME_CLOCK = 0.02, 0.0003
#: A camera's own sound is as early or late to its images as this, seconds: no more is known.
OWN_LAG_S = 0.03


@dataclass(frozen=True, eq=False)
class Sound:
    """What was heard.

    Parameters
    ----------
    shifts : ndarray, shape (n_cameras,)
        Frames of the recording by which each camera's frames, as they count now, are ahead: frame t + shift belongs to moment t. Their
        median is 0; NaN where nothing was heard that tells.
    slopes : ndarray, shape (n_cameras,)
        By how much that grows, frames a frame; 0 where clocks are alike or that cannot be told.
    doubts : ndarray, shape (n_cameras,)
        By how much the way of the sound, and a camera's own delay, may make it wrong, frames.
    why_not : str
        Where nothing is known of any camera, why; else empty.
    """

    shifts: np.ndarray
    slopes: np.ndarray
    doubts: np.ndarray
    why_not: str = ""

    @property
    def known(self) -> bool:
        """Whether it tells of two cameras at least."""
        return bool(np.isfinite(self.shifts).sum() >= 2)


def listen(recording: Recording, search_s: float) -> Sound:
    """Compare the sound of the cameras' videos.

    Parameters
    ----------
    recording : Recording
        The part that is looked at.
    search_s : float
        Cameras are apart by this at most, seconds.

    Returns
    -------
    Sound
    """
    n = len(recording.rig)
    nothing = np.full(n, np.nan)
    views = recording._footage
    if not any(_is_video(view) for view in views):
        return Sound(nothing, np.zeros(n), nothing, "")
    if ffmpeg_path() is None:
        return Sound(nothing, np.zeros(n), nothing, "sound: not used; there is no ffmpeg to read it (pip install imageio-ffmpeg)")
    tracks, begins = [], np.zeros(n)
    for c, view in enumerate(views):
        if view is None or not _is_video(view):
            tracks.append(np.zeros((0, 1)))
            continue
        begins[c] = _begins(recording, c, view)
        last_s = (recording.start + recording.n_frames) / recording.fps + begins[c] + search_s
        tracks.append(onsets(read_sound(view.path, last_s), SAMPLE_RATE))
    if sum(len(track) > 0 for track in tracks) < 2:
        return Sound(nothing, np.zeros(n), nothing, "sound: fewer than two of the videos have any")
    pairs: dict[tuple[int, int], Heard] = {}
    for i, j in itertools.combinations(range(n), 2):
        apart = begins[j] - begins[i]
        if len(tracks[i]) and len(tracks[j]) and (heard := heard_later(tracks[i], tracks[j], search_s + abs(apart))) is not None:
            pairs[i, j] = heard._replace(begin_s=heard.begin_s - apart + heard.slope * begins[i])
    ways = np.linalg.norm(recording.rig.centres[:, None] - recording.rig.centres, axis=-1) / SPEED_OF_SOUND
    seconds, slopes = settled(n, pairs, ways)
    known = np.isfinite(seconds)
    if known.sum() < 2:
        return Sound(nothing, np.zeros(n), nothing, "sound: the tracks have nothing in common that stands out")
    doubts = np.where(known, OWN_LAG_S + np.median(ways[:, known], axis=1), np.nan)
    middle = np.median(seconds[known])
    usual = float(np.median(slopes[known]))
    return Sound((seconds - middle) * recording.fps, np.where(known, slopes - usual, 0.0), doubts * recording.fps)


def settled(n: int, pairs: dict[tuple[int, int], Heard], ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One time and one clock a camera, from what pairs say; pairs that contradict the others are left out.

    Parameters
    ----------
    n : int
        Cameras.
    pairs : dict from (int, int) to Heard
        How much later j has what i has.
    ways : ndarray, shape (n, n)
        By how much the way of the sound may differ, seconds.

    Returns
    -------
    seconds, slopes : ndarray, shape (n,)
        NaN and 0 of cameras that no pair ties to the largest group of cameras.
    """
    pairs = dict(pairs)
    seconds, slopes = np.full(n, np.nan), np.zeros(n)
    while pairs:
        group = _largest_group(n, list(pairs))
        tied = {pair: heard for pair, heard in pairs.items() if pair[0] in group}
        rows = np.zeros((len(tied) + 1, n))
        for row, (i, j) in zip(rows, tied, strict=False):
            row[j], row[i] = 1, -1
        rows[-1, group[0]] = 1
        begin = [heard.begin_s for heard in tied.values()]
        slope = [heard.slope for heard in tied.values()]
        found = np.linalg.lstsq(rows[:, group], np.column_stack([[*begin, 0.0], [*slope, 0.0]]), rcond=None)[0]
        seconds[:], slopes[:] = np.nan, 0
        seconds[group], slopes[group] = found.T
        allowed = np.array([AGREE_S + ways[pair] for pair in tied])
        off = np.abs(rows[:-1] @ np.nan_to_num(seconds) - begin) / allowed
        off = np.maximum(off, np.abs(rows[:-1] @ slopes - slope) / SAME_CLOCK)
        if off.max() <= 1:
            return seconds, slopes
        del pairs[list(tied)[int(off.argmax())]]
    return seconds, slopes


def with_sound(found: Synchrony, sound: Sound, n_moments: int) -> Synchrony:
    """What images tell, and of cameras of which they tell nothing for sure, what sound tells.

    Images count where they are sure, as they are what must be in time: sound is late by its way to the camera, and by each camera's own
    delay.

    Parameters
    ----------
    found : Synchrony
        By images.
    sound : Sound
    n_moments : int

    Returns
    -------
    Synchrony
        Each camera with what was heard, counted as its course is; cameras with the status "sound" have their course by it.
    """
    if not sound.known:
        return replace(found, note=sound.why_not)
    both = [
        sound.shifts[c] - one.course.shift - np.nan_to_num(one.fraction)
        for c, one in enumerate(found.cameras)
        if one.status == "sure" and one.course.is_plain and np.isfinite(sound.shifts[c])
    ]
    if found.known and not both:
        return replace(found, note="sound: nothing ties what it tells to the cameras of which images are sure; not used")
    apart = float(np.median(both)) if both else 0.0
    cameras = [_heard(one, float(sound.shifts[c]) - apart, sound, c, n_moments) for c, one in enumerate(found.cameras)]
    return replace(found, cameras=tuple(cameras))


def _heard(one: CameraTime, shift: float, sound: Sound, c: int, n_moments: int) -> CameraTime:
    if np.isnan(shift):
        return one
    one = replace(one, heard=shift, heard_doubt=float(sound.doubts[c]))
    if one.status == "sure":
        return one
    slope = float(sound.slopes[c])
    whole = round(shift)
    if abs(slope) * n_moments >= LEAST_DRIFT:
        course, part = Course(whole, (), shift - whole, slope), float("nan")
    elif abs(shift) >= one.heard_doubt:
        course, part = Course(whole), shift - whole
    else:
        course, part = Course(), shift
    return replace(one, course=course, fraction=part, doubt=one.heard_doubt, status="sound", fits=one.status != "misfit")


def _largest_group(n: int, pairs: list[tuple[int, int]]) -> list[int]:
    groups = [{c} for c in range(n)]
    for i, j in pairs:
        one, other = (next(group for group in groups if c in group) for c in (i, j))
        if one is not other:
            one |= other
            groups.remove(other)
    return sorted(groups[int(np.argmax([len(group) for group in groups]))])


def _is_video(view: Footage | None) -> bool:
    return view is not None and view.images is None and view.arrays is None


def _begins(recording: Recording, c: int, view: Footage) -> float:
    """At which second of a camera's sound the recording's frame 0 is, as its frames count now."""
    times = recording._times.get(recording.rig.names[c])
    first = video_begins(view.path)
    fps = view.fps or recording.fps
    if times is None:
        return first + view.skipped / fps
    k = int(np.flatnonzero(np.isfinite(times))[0])
    return first + k / fps - float(times[k]) / recording.fps
