"""The time between the cameras of a recording, looked into and told."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hmc.check.silhouettes import covered_shares
from hmc.check.sync.courses import Course
from hmc.check.sync.evidence import by_keypoints, by_silhouettes, combined
from hmc.check.sync.find import TOLD, CameraTime, Synchrony, find_synchrony, joined
from hmc.check.sync.silhouettes import masks_at, packed_silhouettes, small_recording
from hmc.check.sync.sound import listen, with_sound
from hmc.io.keypoints import open_keypoints
from hmc.io.recording import Recording

__all__ = ["inspect_synchrony", "sync_lines"]

#: Of a recording's frames, cameras are apart by this share at most: the rest must be seen by both.
MOST_APART = 0.7
#: Where a frame is missing is told with the frames at which it might be as well, where these are so many more.
WIDE = 3


def inspect_synchrony(recording: Recording, search_s: float, moments: int) -> tuple[Synchrony, np.ndarray]:
    """Find the cameras' times, and how much of the silhouettes the others' hulls explain before and after.

    Parameters
    ----------
    recording : Recording
        The part that is looked at.
    search_s : float
        Cameras are apart by this at most, seconds.
    moments : int
        In which hulls are compared.

    Returns
    -------
    found : Synchrony
    shares : ndarray, shape (2, n_cameras)
        The share of each camera's silhouettes that the hull of the other cameras covers (`silhouette_agreement`), before and after; NaN
        where that cannot be told.
    """
    small = small_recording(recording)
    packed = packed_silhouettes(small)
    n = len(packed)
    reach = max(1, min(round(search_s * recording.fps), round(MOST_APART * n)))
    evidence = by_silhouettes(small.rig, packed, reach)
    found = find_synchrony(evidence)
    keypoints = None if found.all_sure else open_keypoints(small)
    if keypoints is not None:
        # Keypoints scatter more than silhouettes of a known background do, but need none.
        other = find_synchrony(combined([evidence, by_keypoints(small.rig, keypoints, recording.start, n, reach)]))
        found = joined(found, other)
    found = with_sound(found, listen(recording, search_s), n)
    now = [np.arange(n)] * len(small.rig)
    then = [one.course.frames(n) for one in found.cameras]
    whole = [t for t in range(n) if all(0 <= own[t] < n for own in then)] or list(range(n))
    chosen = sorted({whole[round(k)] for k in np.linspace(0, len(whole) - 1, min(moments, len(whole)))})
    masks = [
        [None if mask is None else _enlarged(mask, camera.size) for mask, camera in zip(frame, small.rig, strict=True)]
        for frame in (*masks_at(packed, now, chosen), *masks_at(packed, then, chosen))
    ]
    shares = np.stack([covered_shares(small, masks[: len(chosen)]), covered_shares(small, masks[len(chosen) :])])
    return found, shares


def _enlarged(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A mask at a camera's size again, (h, w) bool."""
    rows = np.arange(size[1]) * mask.shape[0] // size[1]
    columns = np.arange(size[0]) * mask.shape[1] // size[0]
    return mask[np.ix_(rows, columns)]


def sync_lines(recording: Recording, found: Synchrony, shares: np.ndarray, first_frames: Mapping[str, int]) -> list[str]:
    """A table: a head, a line a camera, and a line for what is to be said of one."""
    names = recording.rig.names
    wide = max(8, *(len(name) for name in names))
    lines = [f"{'camera':{wide}}  offset   +/-   sound  first frame  drift/s  dropped  how sure  unlike others   covered by hulls"]
    for c, (name, one) in enumerate(zip(names, found.cameras, strict=True)):
        course = one.course
        dropped = "?" if one.unplaced else str(sum(-change for _, change in course.steps if change < 0))
        first = str(first_frames.get(name, "times"))
        cells = f"{_offset(one):>6}  {_doubt(one):>4}  {_heard(one):>6}  {first:>11}  {course.slope * recording.fps:7.2f}"
        cells += f"  {dropped:>7}  {one.status:>8}"
        lines.append(
            f"{name:{wide}}  {cells}  {_number(one.before)} -> {_number(one.after)}  {_share(shares[0, c])} -> {_share(shares[1, c])}"
        )
    for name, one in zip(names, found.cameras, strict=True):
        lines += _remarks(name, one)
    return lines + [found.note] * bool(found.note)


def _remarks(name: str, one: CameraTime) -> list[str]:
    if one.status == "misfit":
        return [f"camera '{name}' fits the others at no time: is this its video, and has it moved since it was calibrated?"]
    if one.status == "weak":
        return [f"camera '{name}': when it took its frames cannot be told; left as it is"]
    if one.status == "sound":
        by_sound = f"camera '{name}': its time is by its sound alone, to about {one.doubt:.1f} frames"
        return [by_sound if one.fits else f"{by_sound}; its images fit the others at no time: has it moved since it was calibrated?"]
    told = _told_otherwise(name, one)
    if one.unplaced:
        seems = f"about {one.unplaced} frame{'s' * (one.unplaced > 1)}"
        return [*told, f"camera '{name}': seems to have dropped {seems}, but where cannot be told; nothing is written of that"]
    steps = one.course.steps
    if not steps:
        return told
    gone, unsure, shift = [], [], one.course.shift
    for number, (moment, change) in enumerate(steps):
        gone += [moment + k + shift for k in range(change, 0)]
        low, high = one.course.spans[number] if one.course.spans else (moment, moment)
        if change < 0 and high - low >= WIDE:
            unsure.append(f"{low + change + shift} to {high + change + shift}")
        shift += change
    told += [f"camera '{name}': frames are missing before its frame{'s' * (len(gone) > 1)} {_listed(gone)}"] if gone else []
    if unsure:
        told += [f"camera '{name}': where people hardly move, that cannot be told well: it may be any frame from {', '.join(unsure)}"]
    return told + ([f"camera '{name}': has frames twice"] if any(change > 0 for _, change in steps) else [])


def _told_otherwise(name: str, one: CameraTime) -> list[str]:
    """A sentence where the sound of a camera whose images are sure says another time."""
    seen = one.course.shift + float(np.nan_to_num(one.fraction))
    if not one.course.is_plain or not abs(one.heard - seen) > one.heard_doubt + one.doubt + 1:
        return []
    return [f"camera '{name}': its sound is {one.heard:+.1f} frames ahead and its images {seen:+.1f}; images count. Is it its own sound?"]


def _heard(one: CameraTime) -> str:
    return "-" if np.isnan(one.heard) else f"{one.heard:+.1f}"


def _offset(one: CameraTime) -> str:
    """Frames, to a tenth where that is known."""
    course = one.course
    if one.status not in TOLD:
        return "-"
    return f"{course.shift:+d}" if np.isnan(one.fraction) or course != Course(course.shift) else f"{course.shift + one.fraction:+.1f}"


def _doubt(one: CameraTime) -> str:
    return f"{one.doubt:.1f}" if one.status in TOLD and np.isfinite(one.doubt) else "-"


def _listed(values: list[int]) -> str:
    return ", ".join(map(str, values[:12])) + (", ..." if len(values) > 12 else "")


def _number(value: float) -> str:
    return "    -" if np.isnan(value) else f"{value:.3f}"


def _share(value: float) -> str:
    return "   -" if np.isnan(value) else f"{value:4.0%}"
