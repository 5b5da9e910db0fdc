"""Do silhouettes and calibration agree? A coarse visual hull tells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from hmc.camera.coverage import inside_image
from hmc.camera.model import Camera, project
from hmc.recording import Frame, Recording, background_frames

__all__ = ["disagreements", "silhouette_agreement"]

#: Spacing of the points that the hull is made of (metres; wider in a room that would need more than MAX_POINTS).
SPACING_M = 0.06
MAX_POINTS = 100_000
#: Masks are compared on cells as large as this many times the points' spacing appears.
CELL = 1.5
#: A cell counts as silhouette from this share of its pixels on; a point may be somebody's from the lower one, so that thin limbs stay.
COVERED = 0.5
TOUCHED = 0.2
#: Grey levels by which a pixel must differ from the empty scene; well above the noise of a camera, to need no model of it.
DIFFERENCE = 40
#: More than this share of an image in the foreground says that the light changed, not that somebody is there.
FULL = 0.5
#: Share of a silhouette that the others' hull explains: .97 or so in a good rig, .83 where furniture hides half of the person from two
#: cameras, .5 to .9 when one camera is turned by 5 degrees, below .4 when two videos are swapped.
GOOD_AGREEMENT = 0.9
LEAST_AGREEMENT = 0.6
#: A camera is to blame if leaving it out lifts the others' mean share by this much.
GAIN = 0.07
#: Cells of silhouette below which nothing is said.
LEAST_CELLS = 10


class _View(NamedTuple):
    """Where the room's points fall in one camera: ``seen`` (n,), and each point's cell in an image of ``shape`` cells."""

    seen: np.ndarray
    cell: np.ndarray
    shape: tuple[int, int]


def disagreements(recording: Recording, frames: Sequence[Frame]) -> list[str]:
    """Name the cameras whose silhouettes do not fit the others'.

    Silhouettes are those on disk, or else the difference from the median background frame; where there are neither, nothing is said.

    Parameters
    ----------
    recording : Recording
    frames : sequence of Frame
        A few moments, with somebody in the room.

    Returns
    -------
    list of str
        Empty when all fit; else one sentence, for the camera without which all others fit, or for all of them.
    """
    empty = [None if recording.has_silhouettes else _empty_scene(recording, index) for index in range(len(recording.rig))]
    masks = [_masks(frame, empty) for frame in frames]
    if all(len([mask for mask in frame if mask is not None]) < 3 for frame in masks):
        return []
    views = _views(recording)
    everyone = list(range(len(views)))
    shares = silhouette_agreement(views, masks, everyone)
    known = shares[~np.isnan(shares)]
    if not known.size or known.min() >= GOOD_AGREEMENT:
        return []
    names = recording.rig.names
    for index in everyone:
        others = [other for other in everyone if other != index]
        rest = silhouette_agreement(views, masks, others)
        better = ~np.isnan(rest) & ~np.isnan(shares[others])
        if better.any() and rest[better].mean() >= max(GOOD_AGREEMENT, shares[others][better].mean() + GAIN):
            return [
                f"camera '{names[index]}': its silhouettes do not fit the calibration and the other cameras', which fit each other; "
                "is this its video, and has it moved since it was calibrated?"
            ]
    if known.min() >= LEAST_AGREEMENT:
        return []
    listed = ", ".join(f"{name} {share:.0%}" for name, share in zip(names, shares, strict=True) if not np.isnan(share))
    return [
        f"silhouettes and calibration disagree (share of each that fits the others': {listed}); "
        "is each video that of its camera, and are they synchronised?"
    ]


def silhouette_agreement(views: Sequence[_View], masks: Sequence[Sequence[np.ndarray | None]], members: Sequence[int]) -> np.ndarray:
    """The share of each camera's silhouettes that the hull of the other cameras explains.

    The hull for a camera is made of the points that at least two of the others see and all of those have in their silhouettes. A cell
    of the camera's silhouette counts if it shows a point of the room that two others see, and is explained if it, or a neighbour,
    shows one of the hull.

    Parameters
    ----------
    views : sequence of _View
        One a camera.
    masks : sequence (frames) of sequence (cameras) of ndarray, shape (h, w) bool, or None
    members : sequence of int
        The cameras to compare.

    Returns
    -------
    ndarray, shape (len(members),)
        Summed over the frames; nan where there is too little to say.
    """
    explained, there = np.zeros(len(members)), np.zeros(len(members))
    for frame in masks:
        coarse = {index: _coarse(mask, views[index].shape) for index in members if (mask := frame[index]) is not None}
        hits = {index: (coarse[index][views[index].cell] > TOUCHED) & views[index].seen for index in coarse}
        n_seen = np.sum([views[index].seen for index in coarse], axis=0, dtype=np.uint8)
        n_hits = np.sum([hits[index] for index in coarse], axis=0, dtype=np.uint8)
        for index in coarse:
            view = views[index]
            others = n_seen - view.seen
            judged = view.seen & (others >= 2)
            hull = judged & (n_hits - hits[index] == others)
            silhouette = (coarse[index] > COVERED) & _lit(view, judged)
            covered = cv2.dilate(_lit(view, hull).reshape(view.shape).astype(np.uint8), np.ones((3, 3), np.uint8)).ravel() > 0
            place = members.index(index)
            there[place] += silhouette.sum()
            explained[place] += (silhouette & covered).sum()
    return np.where(there >= LEAST_CELLS, explained / np.maximum(there, 1), np.nan)


def _views(recording: Recording) -> list[_View]:
    low, high = recording.room
    spacing = max(SPACING_M, float((np.prod(high - low) / MAX_POINTS) ** (1 / 3)))
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return [_view(camera, points, spacing) for camera in recording.rig]


def _view(camera: Camera, points: np.ndarray, spacing: float) -> _View:
    uv, valid = project(camera, points)
    seen = valid & inside_image(camera, uv)
    depth = (points[seen] @ camera.rotation[2] + camera.translation[2]) if seen.any() else np.ones(1)
    pixels = max(1.0, CELL * spacing * camera.matrix[0, 0] / float(np.median(depth)))
    width, height = camera.size
    shape = (max(1, round(height / pixels)), max(1, round(width / pixels)))
    column, row = ((np.where(seen[:, None], uv, 0) + 0.5) * shape[::-1] / camera.size).astype(int).T
    return _View(seen, row * shape[1] + column, shape)


def _lit(view: _View, points: np.ndarray) -> np.ndarray:
    lit = np.zeros(view.shape[0] * view.shape[1], bool)
    lit[view.cell[points]] = True
    return lit


def _coarse(mask: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    return cv2.resize(mask.astype(np.float32), shape[::-1], interpolation=cv2.INTER_AREA).ravel()


def _masks(frame: Frame, empty: Sequence[np.ndarray | None]) -> list[np.ndarray | None]:
    if frame.silhouettes is not None:
        return list(frame.silhouettes)
    masks: list[np.ndarray | None] = []
    for image, scene in zip(frame.images, empty, strict=True):
        mask = None if image is None or scene is None else cv2.medianBlur(cv2.absdiff(image, scene), 5).max(axis=2) > DIFFERENCE
        masks.append(None if mask is None or mask.mean() > FULL else mask)
    return masks


def _empty_scene(recording: Recording, index: int) -> np.ndarray | None:
    frames = list(background_frames(recording, index, limit=5))
    return np.median(frames, axis=0).astype(np.uint8) if frames else None
