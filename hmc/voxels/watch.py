"""Do the cameras fit each other while a recording runs? A step with state, which says of each camera what is wrong with it, since when.

Each frame is looked at as it comes: an image alone tells that nothing changes, that it is dark, or that the walls have moved
(`hmc.camera.image_signs`); and ten times a second the silhouettes of all cameras tell which of them do not fit the others'
(`hmc.voxels.fitting`). A camera is out when half a second of evidence says so, from its first bad frame on, and back when a second of
evidence says that it fits again. What is remembered is a second of small images and packed silhouettes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hmc.camera.image_signs import image_shift, is_dark, is_repeated, small_gray
from hmc.camera.model import Rig
from hmc.io.camera_faults import CameraFault
from hmc.voxels.carving import CarvingTables
from hmc.voxels.fitting import LEAST_LEFT, Fit, fit_of_cameras, fitting_tables, missed_share

__all__ = ["CameraWatch", "Watch", "WatchState", "begin_watch", "make_watch", "watch_step"]

#: Silhouettes are compared, and shifts measured, so often, times a second.
FITS_HZ, SHIFTS_HZ = 10.0, 5.0
#: Seconds that are remembered; a camera is early or late by less.
MEMORY_S = 0.7
#: Images that are missing or dark for so long are told of, and repeated ones, at least so many; seconds and frames. Without silhouettes of
#: others to go by, repeated ones for longer.
GONE_S, DARK_S, FROZEN_S, FROZEN_ALONE_S, LEAST_FROZEN = 0.5, 0.1, 0.2, 1.0, 5
#: A camera has moved by so many pixels of an image 640 wide (half a degree, or 4 cm before a camera that is 4 m away), in so many
#: measurements, unless its silhouettes fit as well as this.
MOVED_PX, MOVED_TIMES, FITTING = 6.0, 2, 0.15
#: Of so many comparisons so many must say that a camera does not fit, and so many that it fits again.
JUDGED, LEAST_BAD, LEAST_GOOD = 5, 4, 6
#: Without the camera so many silhouettes must be left where its image alone tells; else `hmc.voxels.fitting.LEAST_LEFT`.
LEAST_MASKS = 3
#: A camera is out of time where so much is missed at most, and this share of what is missed now, some frames away; of moments that differ
#: by less the one in the middle is taken.
TIMED, BETTER, ALIKE = 0.3, 0.5, 0.02
#: Moments that are tried for it.
TIMES = 3

Packed = tuple[tuple[int, int], np.ndarray] | None


@dataclass(frozen=True, eq=False)
class Watch:
    """What does not change.

    Attributes
    ----------
    names : tuple of str
    fps : float
    tables : CarvingTables or None
        Of coarse voxels; None where there are too few cameras.
    references : tuple of ndarray of uint8, shape (h, w), or None; one a camera
        Small images of the empty scene.
    widths : tuple of int
        The longer sides of the images, pixels.
    exclude : bool
        Whether cameras with a fault are to be left out.
    """

    names: tuple[str, ...]
    fps: float
    tables: CarvingTables | None
    references: tuple[np.ndarray | None, ...]
    widths: tuple[int, ...]
    exclude: bool = True

    def every(self, hertz: float) -> int:
        """Frames between two looks."""
        return max(1, round(self.fps / hertz))

    def frames(self, seconds: float) -> int:
        """Frames of a time, one at least."""
        return max(1, round(seconds * self.fps))


@dataclass(frozen=True, eq=False)
class CameraWatch:
    """What is remembered of a camera.

    Attributes
    ----------
    fault : CameraFault or None
    gone, dark, same : int
        Frames so far without an image, with a dark one, and with the same one.
    fits : tuple of (int, float, bool)
        Of the last comparisons that told something: frame, share that was missed, and whether it fits not.
    shifts : tuple of (int, float)
        Of the last measurements that told something: frame and pixels of the images.
    smalls : tuple of (int, ndarray)
        The last small images.
    """

    fault: CameraFault | None = None
    gone: int = 0
    dark: int = 0
    same: int = 0
    fits: tuple[tuple[int, float, bool], ...] = ()
    shifts: tuple[tuple[int, float], ...] = ()
    smalls: tuple[tuple[int, np.ndarray], ...] = ()


@dataclass(frozen=True, eq=False)
class WatchState:
    """All cameras between two frames, and the silhouettes of the last frames."""

    cameras: tuple[CameraWatch, ...]
    masks: tuple[tuple[int, tuple[Packed, ...]], ...] = field(default=(), repr=False)

    @property
    def faults(self) -> tuple[CameraFault | None, ...]:
        """What is wrong now; one a camera."""
        return tuple(camera.fault for camera in self.cameras)


def make_watch(rig: Rig, room: np.ndarray, fps: float, scenes: Sequence[Sequence[np.ndarray]], exclude: bool = True) -> Watch:
    """What is needed to watch cameras.

    Parameters
    ----------
    rig : Rig
    room : ndarray, shape (2, 3)
        Lower and upper corner, metres.
    fps : float
    scenes : sequence (cameras) of sequence of ndarray of uint8, shape (h, w, 3)
        A few images of the empty scene; none where it is not known.
    exclude : bool
        Whether cameras with a fault are to be left out.
    """
    references = tuple(
        np.mean([small_gray(image) for image in images], axis=0).round().astype(np.uint8) if len(images) else None for images in scenes
    )
    tables = fitting_tables(room, rig) if len(rig) > LEAST_LEFT else None
    return Watch(tuple(rig.names), fps, tables, references, tuple(max(camera.size) for camera in rig), exclude)


def begin_watch(watch: Watch) -> WatchState:
    """The state before the first frame."""
    return WatchState((CameraWatch(),) * len(watch.names))


def watch_step(
    watch: Watch, state: WatchState, index: int, images: Sequence[np.ndarray | None], masks: Sequence[np.ndarray | None]
) -> WatchState:
    """The state after one more frame.

    Parameters
    ----------
    watch : Watch
    state : WatchState
    index : int
        Absolute frame number.
    images : sequence of ndarray of uint8, shape (h, w, 3), or None; one a camera
    masks : sequence of ndarray of bool, shape (h, w), or None; one a camera
        As each camera sees people by itself, of cameras with a fault too.
    """
    cameras = tuple(_seen(watch, c, one, index, (images[c], masks[c])) for c, one in enumerate(state.cameras))
    kept = (*state.masks, (index, tuple(_pack(mask) for mask in masks)))[-watch.frames(MEMORY_S) :]
    fit, judged = None, index % watch.every(FITS_HZ) == 0
    if judged and watch.tables is not None:
        usable = [None if camera.dark else mask for camera, mask in zip(cameras, masks, strict=True)]
        fit = fit_of_cameras(watch.tables, usable)
        cameras = tuple(_judged(camera, index, fit, c) for c, camera in enumerate(cameras))
    state = WatchState(cameras, kept)
    moving = sum(mask is not None and not camera.same for camera, mask in zip(cameras, masks, strict=True))
    shows = [mask is not None and bool(mask.any()) for mask in masks] if any(camera.same for camera in cameras) else [False] * len(masks)
    for c, camera in enumerate(cameras):
        fault = camera.fault if camera.fault is not None and not _is_over(watch, camera, c, index) else None
        new = _plain_fault(watch, camera, c, index, shows[c] and moving >= (len(masks) + 1) // 2)
        if new is None and (fault is None or fault.fault == "frozen"):
            new = _displaced(watch, state, c, index)
        if new is not None and (fault is None or fault.fault != new.fault):
            fault = replace(new, left_out=_can_go(watch, state, masks, c, new))
        if fault is not camera.fault:
            state = replace(state, cameras=(*state.cameras[:c], replace(camera, fault=fault), *state.cameras[c + 1 :]))
    return state


def _seen(watch: Watch, c: int, camera: CameraWatch, index: int, seen: tuple[np.ndarray | None, np.ndarray | None]) -> CameraWatch:
    """A camera after its image and silhouette."""
    image, mask = seen
    if image is None:
        return replace(camera, gone=camera.gone + 1 if mask is None else 0, dark=0, same=0, smalls=())
    small, reference = small_gray(image), watch.references[c]
    dark = reference is not None and is_dark(small, reference)
    same = bool(camera.smalls) and not dark and is_repeated(small, camera.smalls[-1][1])
    shifts, every = camera.shifts, watch.every(SHIFTS_HZ)
    if reference is not None and not dark and index % every == 0:
        shift = image_shift(reference, small) * watch.widths[c] / max(small.shape)
        shifts = shifts if np.isnan(shift) else (*shifts, (index, shift))[-MOVED_TIMES:]
    smalls = (*camera.smalls, (index, small))[-2 * every - 1 :]
    if camera.same >= LEAST_FROZEN and not same:  # what it showed so far was of another moment
        camera = replace(camera, fits=())
    return replace(camera, gone=0, dark=camera.dark + 1 if dark else 0, same=camera.same + 1 if same else 0, shifts=shifts, smalls=smalls)


def _judged(camera: CameraWatch, index: int, fit: Fit | None, c: int) -> CameraWatch:
    """A camera after a comparison of all silhouettes."""
    if fit is None or np.isnan(fit.missed[c]):
        return camera
    return replace(camera, fits=(*camera.fits, (index, float(fit.missed[c]), bool(fit.misfit[c])))[-LEAST_GOOD:])


def _plain_fault(watch: Watch, camera: CameraWatch, c: int, index: int, still: bool) -> CameraFault | None:
    """What is wrong with a camera's images; `still`: it shows somebody, and others move."""
    name = watch.names[c]
    for kind, n, enough in (("lost", camera.gone, GONE_S), ("dark", camera.dark, DARK_S)):
        if n >= watch.frames(enough):
            return CameraFault(name, kind, index - n + 1, index)
    if still and camera.same >= max(LEAST_FROZEN, watch.frames(FROZEN_S if watch.tables is not None else FROZEN_ALONE_S)):
        return CameraFault(name, "frozen", index - camera.same + 1, index)
    return None


def _displaced(watch: Watch, state: WatchState, c: int, index: int) -> CameraFault | None:
    """A camera that has moved, or whose silhouettes do not fit, by what is remembered."""
    camera, name = state.cameras[c], watch.names[c]
    moved = [shift for _, shift in camera.shifts]
    limit = MOVED_PX * watch.widths[c] / 640
    recent = [missed for _, missed, _ in camera.fits[-MOVED_TIMES:]]
    if len(moved) == MOVED_TIMES and min(moved) >= limit and not (recent and max(recent) < FITTING):
        return CameraFault(name, "moved", _moved_since(watch, camera, c, limit), index, float(np.median(moved)))
    bad = [one for one in camera.fits[-JUDGED:] if one[2]]
    if len(bad) >= LEAST_BAD and camera.fits[-1][2] and not camera.same:
        return _misfit(watch, state, c, index, float(np.median([missed for _, missed, _ in bad])))
    return None


def _is_over(watch: Watch, camera: CameraWatch, c: int, index: int) -> bool:
    """Whether a camera's fault is over."""
    fault = camera.fault
    if fault is None or fault.fault == "lost":
        return not camera.gone
    if fault.fault == "dark":
        return not camera.dark
    if camera.gone or camera.dark or camera.same:
        return False
    if fault.fault == "moved" and camera.shifts and camera.shifts[-1][1] >= MOVED_PX * watch.widths[c] / 640:
        return False
    good = [one for one in camera.fits if not one[2] and one[0] > fault.since]
    if watch.tables is None:
        return index - camera.smalls[0][0] >= len(camera.smalls) - 1 >= 2 * watch.every(SHIFTS_HZ)
    return len(good) >= LEAST_GOOD


def _can_go(watch: Watch, state: WatchState, masks: Sequence[np.ndarray | None], c: int, fault: CameraFault) -> bool:
    """Whether enough silhouettes are left without a camera."""
    if fault.fault in ("lost", "dark") or not watch.exclude:
        return fault.fault in ("lost", "dark")
    out = [camera.fault is not None and camera.fault.left_out for camera in state.cameras]
    left = sum(mask is not None and not gone and k != c for k, (mask, gone) in enumerate(zip(masks, out, strict=True)))
    return left >= (LEAST_LEFT if fault.fault in ("late", "early", "misfit") else LEAST_MASKS)


def _moved_since(watch: Watch, camera: CameraWatch, c: int, limit: float) -> int:
    """The first of the frames that are remembered, after the last in which it was where it had been, in which a camera has moved."""
    reference, since = watch.references[c], camera.shifts[0][0]
    for frame, small in reversed([one for one in camera.smalls if one[0] < since]):
        if reference is None or not image_shift(reference, small) * watch.widths[c] / max(small.shape) >= limit:
            break
        since = frame
    return since


def _misfit(watch: Watch, state: WatchState, c: int, index: int, missed: float) -> CameraFault:
    """A camera that does not fit: since when, and whether it is out of time."""
    camera, name = state.cameras[c], watch.names[c]
    good = [frame for frame, _, bad in camera.fits if not bad]
    since = next(frame for frame, _, bad in camera.fits if bad and frame > max(good, default=-1))
    others = [k for k, one in enumerate(state.cameras) if k != c and one.fault is None and not (one.fits and one.fits[-1][2])]
    tables, memory = watch.tables, [(frame, [_unpack(one) for one in packed]) for frame, packed in state.masks]
    if tables is None or len(others) < LEAST_LEFT:
        return CameraFault(name, "misfit", since, index, missed)
    for frame, masks in reversed(memory):
        if max(good, default=-1) < frame < since:
            if not missed_share(tables, masks, c, others) > missed / 2:
                break
            since = frame
    shift = _out_of_time(tables, memory, c, others, (since, missed))
    kind = "misfit" if not shift else "late" if shift > 0 else "early"
    return CameraFault(name, kind, since, index, missed if not shift else abs(shift))


def _out_of_time(
    tables: CarvingTables, memory: Sequence[tuple[int, list[np.ndarray | None]]], c: int, others: Sequence[int], now: tuple[int, float]
) -> int:
    """By how many frames a camera is late (above 0) or early; 0 where no other moment fits well.

    `now` is the first bad frame and what the camera misses.
    """
    since, missed = now
    by_frame, reach = dict(memory), len(memory) - 1
    newest = memory[-1][0]
    found: list[tuple[float, int]] = []
    for shift in (*range(-reach, 0), *range(1, reach + 1)):
        shares = []
        for k in range(TIMES):
            # Late: its silhouette of a moment is what the others saw earlier.
            own, theirs = (newest - 2 * k, newest - 2 * k - shift) if shift > 0 else (newest - 2 * k + shift, newest - 2 * k)
            if own >= since and own in by_frame and theirs in by_frame:
                masks = [by_frame[own][c] if one == c else mask for one, mask in enumerate(by_frame[theirs])]
                shares.append(missed_share(tables, masks, c, others))
        known = [share for share in shares if not np.isnan(share)]
        if known:
            found.append((float(np.mean(known)), shift))
    best = min(found, default=(1.0, 0))[0]
    if best > min(TIMED, BETTER * missed):
        return 0
    alike = sorted(shift for share, shift in found if share <= best + ALIKE)
    return alike[len(alike) // 2]


def _pack(mask: np.ndarray | None) -> Packed:
    return None if mask is None else ((mask.shape[0], mask.shape[1]), np.packbits(mask))


def _unpack(packed: Packed) -> np.ndarray | None:
    if packed is None:
        return None
    shape, bits = packed
    return np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape).view(bool)
