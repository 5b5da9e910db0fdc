"""Do the cameras' keypoints agree? Epipolar lines tell, and name a camera that is off in place or in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.epipolar import epipolar_lines, fundamental_matrices, undistorted_pixels
from hmc.camera.model import Rig
from hmc.check.cures import sync_command
from hmc.io.keypoints import KEYPOINTS, KeypointSource
from hmc.io.places import AnyPlaces
from hmc.io.recording import Recording

__all__ = ["KeypointAgreement", "agreement_lines", "keypoint_agreement", "keypoint_findings"]

#: Moments that are compared, and shifts that are tried, frames.
COMPARED_FRAMES = 60
MOST_SHIFT = 15
#: Points below this confidence, and people beyond this many in one image, are left out.
LEAST_CONFIDENCE = 0.3
MOST_PEOPLE = 6
#: Moments in which a camera must have somebody, and comparisons that there must be, for anything to be said of it.
LEAST_SEEN = 5
LEAST_POINTS = 40
#: Pixels are told for an image whose longer side has so many.
REFERENCE_SIDE = 640
#: A camera is off in place when its residual is so many times that of the others among themselves, and so many pixels more: in rendered
#: rigs, which are exact, the worst camera has 1.5 times and 1.4 px more.
FACTOR, EXCESS_PX = 1.7, 4.0
#: All are off when the residual is as large as this although no camera is to blame, pixels.
MOST_PX = 12.0
#: A camera is off in time when a shift leaves this share of its residual, and takes so many pixels away.
SHIFT_SHARE, SHIFT_GAIN_PX = 0.75, 1.0
#: Groups of joints that the table tells apart.
GROUPS = {
    "head": ("nose", "l_eye", "r_eye", "l_ear", "r_ear", "head_top", "neck"),
    "shoulders": ("l_shoulder", "r_shoulder"),
    "elbows": ("l_elbow", "r_elbow"),
    "wrists": ("l_wrist", "r_wrist"),
    "hips": ("l_hip", "r_hip", "pelvis"),
    "knees": ("l_knee", "r_knee"),
    "ankles": ("l_ankle", "r_ankle"),
    "feet": ("l_heel", "r_heel", "l_big_toe", "r_big_toe", "l_small_toe", "r_small_toe"),
}


@dataclass(frozen=True, eq=False)
class KeypointAgreement:
    """How far the cameras' keypoints of one person are from each other's epipolar lines.

    Parameters
    ----------
    cameras : tuple of str
        In the rig's order.
    present : tuple of bool
        Which have keypoints at all.
    n_frames : int
        Moments that were compared.
    seen : ndarray of int, shape (n_cameras,)
        In how many of them each camera has somebody.
    by_joint : ndarray, shape (n_cameras, 26)
        Median over moments and other cameras of the symmetric epipolar distance, undistorted pixels, by `hmc.io.keypoints.KEYPOINTS`;
        NaN where there is nothing to compare.
    residual : ndarray, shape (n_cameras,)
        The median over all joints.
    others : ndarray, shape (n_cameras,)
        The same of the other cameras among themselves.
    by_shift : ndarray, shape (n_cameras, 31)
        The residual when the camera's detections are taken 15 frames earlier to 15 frames later, as a share of that without a shift,
        over the comparisons that both have; NaN where these are few.
    scales : ndarray, shape (n_cameras,)
        Each image's longer side over that for which thresholds are stated.
    """

    cameras: tuple[str, ...]
    present: tuple[bool, ...]
    n_frames: int
    seen: np.ndarray
    by_joint: np.ndarray
    residual: np.ndarray
    others: np.ndarray
    by_shift: np.ndarray
    scales: np.ndarray


def keypoint_agreement(recording: Recording, keypoints: KeypointSource) -> KeypointAgreement:
    """Compare the cameras' keypoints over up to 60 moments, spread over the selected frames.

    Of several people in an image the one is taken that fits the other cameras' best; points of confidence below .3 are left out.

    Parameters
    ----------
    recording : Recording
    keypoints : KeypointSource

    Returns
    -------
    KeypointAgreement

    Raises
    ------
    InputError
        When a file of keypoints is broken.
    """
    rig, first, last = recording.rig, recording.start, recording.start + recording.n_frames
    moments = np.unique(np.linspace(first, last - 1, min(COMPARED_FRAMES, last - first)).round().astype(int))
    shifts = np.arange(-MOST_SHIFT, MOST_SHIFT + 1)
    wanted = np.unique((moments[:, None] + shifts).clip(first, last - 1))
    people = _read(rig, keypoints, wanted)
    now = people[np.searchsorted(wanted, moments)]
    fundamental = fundamental_matrices(rig)
    chosen = np.stack([_matching(fundamental, moment) for moment in now])
    pairs = np.stack([_to_others(fundamental, c, chosen[:, c, None], chosen)[:, 0] for c in range(len(rig))], axis=1)
    seen = np.isfinite(chosen).all(axis=-1).any(axis=-1).sum(axis=0)
    # A camera that has somebody in a few moments only is told of, but judges nobody.
    steady = seen >= LEAST_SEEN
    judges = np.where(steady[:, None, None], chosen, np.nan)
    judged = np.where((steady[:, None] & steady)[:, :, None], pairs, np.nan)
    by_shift = np.full((len(rig), len(shifts)), np.nan)
    for c in range(len(rig)):
        for k, shift in enumerate(shifts):
            there = (moments + shift >= first) & (moments + shift < last)
            moved = people[np.searchsorted(wanted, moments[there] + shift), c]
            by_shift[c, k] = _share(_best(_to_others(fundamental, c, moved, judges[there])), pairs[there, c])
    return KeypointAgreement(
        cameras=rig.names,
        present=keypoints.present,
        n_frames=len(moments),
        seen=seen,
        by_joint=np.array([[_median(pairs[:, c, :, k]) for k in range(len(KEYPOINTS))] for c in range(len(rig))]),
        residual=np.array([_median(pairs[:, c]) for c in range(len(rig))]),
        others=np.array([_median(np.delete(np.delete(judged, c, axis=1), c, axis=2)) for c in range(len(rig))]),
        by_shift=by_shift,
        scales=np.array([max(camera.size) / REFERENCE_SIDE for camera in rig]),
    )


def keypoint_findings(agreement: KeypointAgreement, recording: AnyPlaces) -> list[str]:
    """Name the cameras that are off in time or in place.

    Parameters
    ----------
    agreement : KeypointAgreement
    recording : str, Path or RecordingPlaces
        Its folder, or where its parts lie, for the command that finds more.

    Returns
    -------
    list of str
        A sentence a camera; or one for all, when it cannot be told which of them is off. Empty when all agree.
    """
    known = np.flatnonzero(np.isfinite(agreement.residual) & (agreement.seen >= LEAST_SEEN)).tolist()
    if len(known) < 2:
        return []
    late = {c: shift for c in known if (shift := _late(agreement, c))}
    off = [c for c in known if _is_off(agreement, c)]
    names, residual = agreement.cameras, agreement.residual
    sync = sync_command(recording)
    if len(known) == 2:
        one, other = known
        pair = f"cameras '{names[one]}' and '{names[other]}': their keypoints are {residual[one]:.1f} px from each other's epipolar lines"
        if late:
            shift = late.get(other, -late.get(one, 0))
            share = agreement.by_shift[other, MOST_SHIFT + shift]
            then = "" if np.isnan(share) else f", {share * residual[other]:.1f} px"
            cure = "which of them is early or late cannot be told; `first_frame` for either in recording.toml mends it, and is found by"
            return [f"{pair}{then} if those of '{names[other]}' are taken {_frames(shift)}; {cure}: {sync}"]
        if residual[one] > MOST_PX * agreement.scales[[one, other]].mean():
            return [f"{pair}; have they moved since they were calibrated? Which one cannot be told from two"]
        return []
    if 2 * len(late) > len(known):
        # One that is off lends some of its gain to the others: it gains most itself.
        late = dict([min(late.items(), key=lambda item: agreement.by_shift[item[0], MOST_SHIFT + item[1]])])
    sentences = []
    for c, shift in late.items():
        then = agreement.by_shift[c, MOST_SHIFT + shift] * residual[c]
        sentences.append(
            f"camera '{names[c]}': its keypoints are {residual[c]:.1f} px from the other cameras' epipolar lines, {then:.1f} px if they "
            f"are taken {_frames(shift)}; its video seems to begin {_count(shift)} {'before' if shift > 0 else 'after'} the others': "
            f"`first_frame` in recording.toml mends that, and is found by: {sync}"
        )
    rest = [c for c in off if c not in late]
    if 2 * len(rest) > len(known) or (not sentences and not rest and _median(residual[known] / agreement.scales[known]) > MOST_PX):
        listed = ", ".join(f"{names[k]} {residual[k]:.0f}" for k in known)
        return [
            *sentences,
            f"keypoints and calibration disagree (px from the other cameras' epipolar lines: {listed}); are they of these videos, "
            f"at their size, and are the cameras synchronised ({sync})?",
        ]
    for c in rest:
        sentences.append(
            f"camera '{names[c]}': its keypoints are {residual[c]:.1f} px from the other cameras' epipolar lines, theirs "
            f"{agreement.others[c]:.1f} px from each other's; has it moved since it was calibrated, and are they of its video?"
        )
    return sentences


def agreement_lines(agreement: KeypointAgreement) -> list[str]:
    """A table: a head, and a line a camera with its median residual over all and over groups of joints, pixels."""
    wide = max(10, *(len(name) for name in agreement.cameras))
    lines = [f"{'keypoints':{wide}}  frames  px from others'  " + "  ".join(GROUPS)]
    for c, name in enumerate(agreement.cameras):
        if not agreement.present[c]:
            lines.append(f"{name:{wide}}  none")
            continue
        cells = [_median(agreement.by_joint[c, [KEYPOINTS.index(joint) for joint in joints]]) for joints in GROUPS.values()]
        groups = "  ".join(f"{_cell(cell):>{len(group)}}" for group, cell in zip(GROUPS, cells, strict=True))
        seen = f"{agreement.seen[c]}/{agreement.n_frames}"
        lines.append(f"{name:{wide}}  {seen:>6}  {_cell(agreement.residual[c]):>15}  {groups}")
    return lines


def _cell(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.1f}"


def _frames(shift: int) -> str:
    return f"{_count(shift)} {'later' if shift > 0 else 'earlier'}"


def _count(shift: int) -> str:
    return f"{abs(shift)} frame{'s' * (abs(shift) > 1)}"


def _late(agreement: KeypointAgreement, c: int) -> int:
    """By how many frames a camera's detections should be taken later; 0 when no shift helps clearly."""
    shares = agreement.by_shift[c]
    if np.isnan(shares).all():
        return 0
    best = int(np.nanargmin(shares))
    then = shares[best] * agreement.residual[c]
    gain = agreement.residual[c] - then
    # What stays far off with the shift is off in place: some frame's pose happens to lie better.
    if _exceeds(agreement, c, then) or shares[best] >= SHIFT_SHARE or gain <= SHIFT_GAIN_PX * agreement.scales[c]:
        return 0
    return best - MOST_SHIFT


def _is_off(agreement: KeypointAgreement, c: int) -> bool:
    return _exceeds(agreement, c, agreement.residual[c])


def _exceeds(agreement: KeypointAgreement, c: int, residual: float) -> bool:
    """Whether a residual of a camera is far above that of the others among themselves."""
    others = agreement.others[c]
    return bool(residual > FACTOR * others and residual - others > EXCESS_PX * agreement.scales[c])


def _read(rig: Rig, keypoints: KeypointSource, frames: np.ndarray) -> np.ndarray:
    """Undistorted points, shape (n_frames, n_cameras, n_people, 26, 2); NaN where there is none to be trusted."""
    read = [keypoints.frame(int(frame)) for frame in frames]
    most = max([len(own) for views in read for own in views], default=0)
    people = np.full((len(frames), len(rig), min(max(most, 1), MOST_PEOPLE), len(KEYPOINTS), 2), np.nan)
    for row, views in zip(people, read, strict=True):
        for place, own in zip(row, views, strict=True):
            best = np.argsort(-own[..., 2].sum(axis=1), kind="stable")[: place.shape[0]]
            place[: len(best)] = np.where(own[best, :, 2:] >= LEAST_CONFIDENCE, own[best, :, :2], np.nan)
    for c, camera in enumerate(rig):
        trusted = np.isfinite(people[:, c]).all(axis=-1)
        people[:, c][trusted] = undistorted_pixels(camera, people[:, c][trusted])
    return people


def _to_others(fundamental: np.ndarray, c: int, points: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Symmetric epipolar distances of candidates of camera `c`, (m, p, 26, 2), to the other cameras' points, (m, n, 26, 2).

    Returns
    -------
    ndarray, shape (m, p, n, 26)
        NaN to the camera itself and where a point is missing.
    """
    others = chosen[:, None]
    own = points[:, :, None]
    ahead, back = fundamental[c][None, None, :, None], fundamental[:, c][None, None, :, None]
    there = _offset(epipolar_lines(ahead, own), others)
    here = _offset(epipolar_lines(back, others), own)
    return np.hypot(there, here)


def _offset(lines: np.ndarray, points: np.ndarray) -> np.ndarray:
    return lines[..., 0] * points[..., 0] + lines[..., 1] * points[..., 1] + lines[..., 2]


def _best(distances: np.ndarray) -> np.ndarray:
    """Distances of the candidate whose median is least, (m, p, n, 26) to (m, n, 26)."""
    medians = [[_median(candidate) for candidate in moment] for moment in distances]
    place = np.argmin(np.nan_to_num(np.array(medians).reshape(distances.shape[:2]), nan=np.inf), axis=1)
    return distances[np.arange(len(distances)), place]


def _matching(fundamental: np.ndarray, people: np.ndarray) -> np.ndarray:
    """The people of one moment, (n, p, 26, 2), that are one person, one a camera, (n, 26, 2).

    Everybody of every camera in turn is taken as the one who is meant, and the others' best match joined; the set that agrees best stays.
    """
    chosen = people[:, 0].copy()
    there = np.isfinite(people).all(axis=-1).any(axis=-1)  # (n, p)
    if (there.sum(axis=1) <= 1).all():
        return chosen
    best = np.inf
    for c, p in zip(*np.nonzero(there), strict=True):
        trial = np.full_like(chosen, np.nan)
        trial[c] = people[c, p]
        for other in np.argsort(there.sum(axis=1), kind="stable"):
            if other != c and there[other].any():
                medians = [_median(one) for one in _to_others(fundamental, other, people[None, other], trial[None])[0]]
                trial[other] = people[other, int(np.argmin(np.nan_to_num(medians, nan=np.inf)))]
        total = _median(np.concatenate([_to_others(fundamental, k, trial[None, k, None], trial[None]) for k in range(len(people))]))
        if total < best:
            best, chosen = total, trial
    return chosen


def _share(moved: np.ndarray, still: np.ndarray) -> float:
    """The median with a shift over that without, of the comparisons that both have."""
    both = np.isfinite(moved) & np.isfinite(still)
    if both.sum() < max(LEAST_POINTS, 0.3 * np.isfinite(still).sum()):
        return np.nan
    return float(np.median(moved[both]) / max(np.median(still[both]), 1e-9))


def _median(values: np.ndarray | Sequence[float]) -> float:
    """Of the known values; NaN of none."""
    values = np.asarray(values)
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")
