"""Do silhouettes and calibration agree? A coarse visual hull tells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from hmc.camera.coverage import inside_image
from hmc.camera.model import Camera, project
from hmc.check.cures import sync_command
from hmc.check.hull import Hull, best_move, beyond_room, coarse_grid, fine_hull, floor_height, misfit, odd_camera
from hmc.check.moments import Masks
from hmc.io.places import places_of
from hmc.io.recording import Recording

__all__ = ["at_odds", "covered_shares", "filled_images", "hull_findings", "silhouette_agreement"]

#: Spacing of the points that the hull is made of (metres; wider in a room that would need more than MAX_POINTS).
SPACING_M = 0.06
MAX_POINTS = 100_000
#: Masks are compared on cells as large as this many times the points' spacing appears.
CELL = 1.5
#: A cell counts as silhouette from this share of its pixels on; a point may be a person's from the lower one, so that thin limbs stay.
COVERED = 0.5
TOUCHED = 0.2
#: Cameras that must show a person for a fine hull to tell anything.
LEAST_VIEWS = 4
#: Feet this far below the floor are told, metres: in good rigs they are between -.02 and .02, a post 40 cm wide at -.05.
LEAST_DEPTH_M = 0.065
#: Share of a silhouette that the others' hull covers: .97 or so in a good rig, .83 where furniture hides half of the person from two
#: cameras, .5 to .9 when one camera is turned by 5 degrees, below .4 when two videos are swapped.
GOOD_AGREEMENT = 0.9
LEAST_AGREEMENT = 0.6
#: A camera is to blame if leaving it out lifts the others' mean share by this much.
GAIN = 0.07
#: No silhouettes of people fill as much of an image in most moments.
FILLED = 0.7
#: Cells of silhouette below which nothing is said.
LEAST_CELLS = 10


class _View(NamedTuple):
    """Where the room's points fall in one camera: ``seen`` (n,), and each point's cell in an image of ``shape`` cells."""

    seen: np.ndarray
    cell: np.ndarray
    shape: tuple[int, int]


def at_odds(recording: Recording, masks: Sequence[Sequence[np.ndarray | None]]) -> tuple[str, str] | None:
    """The camera whose silhouettes do not fit the others'.

    Parameters
    ----------
    recording : Recording
    masks : sequence (frames) of sequence (cameras) of ndarray, shape (h, w) bool, or None
        A few moments, with a person in the room.

    Returns
    -------
    (name, sentence) or None
        The camera without which all others fit, or "" where it is not one alone; None where all fit.
    """
    if all(len([mask for mask in frame if mask is not None]) < 3 for frame in masks):
        return None
    views = _views(recording)
    all_views = list(range(len(views)))
    shares = silhouette_agreement(views, masks, all_views)
    known = shares[~np.isnan(shares)]
    if not known.size or known.min() >= GOOD_AGREEMENT:
        return None
    names, sync = recording.rig.names, sync_command(places_of(recording))
    for index in all_views:
        others = [other for other in all_views if other != index]
        rest = silhouette_agreement(views, masks, others)
        better = ~np.isnan(rest) & ~np.isnan(shares[others])
        if better.any() and rest[better].mean() >= max(GOOD_AGREEMENT, shares[others][better].mean() + GAIN):
            return names[index], (
                f"camera '{names[index]}': its silhouettes do not fit the calibration and the other cameras', which fit each other; "
                f"is this its video, and has it moved since it was calibrated? If it is early or late, by how much finds: {sync}"
            )
    if known.min() >= LEAST_AGREEMENT:
        return None
    listed = ", ".join(f"{name} {share:.0%}" for name, share in zip(names, shares, strict=True) if not np.isnan(share))
    return "", (
        f"silhouettes and calibration disagree (share of each that fits the others': {listed}); "
        f"is each video that of its camera, and are they synchronised? That finds: {sync}"
    )


def hull_findings(recording: Recording, masks: Sequence[Sequence[np.ndarray | None]], told_floor: bool = False) -> list[str]:
    """What a fine hull tells: people below the floor or beyond the walls, a camera that is off by a few pixels or frames.

    Parameters
    ----------
    recording, masks
        As for `at_odds`, to which it is left to say that cameras do not fit at all.
    told_floor : bool
        It was told already that the floor is elsewhere (`hmc.check.world_findings`): where people are cut off there, no more is said.

    Returns
    -------
    list of str
    """
    rig, room = recording.rig, recording.room
    filled, masks = filled_images(recording, masks)
    moments = [frame for frame in masks if sum(mask is not None and mask.any() for mask in frame) >= LEAST_VIEWS]
    grid = coarse_grid(rig, room) if moments else None
    hulls = [hull for frame in moments if grid and len((hull := fine_hull(rig, frame, grid)).strict)]
    cut = [
        f"people reach {reach:.1f} m beyond the room's limit {'xyz'[axis]} = {room[end, axis]:g} m, where {share:.0%} of their volume is "
        "cut off; widen `room` in recording.toml"
        for end, axis, share, reach in beyond_room(hulls, room)
    ]
    depth = float(room[0, 2]) - floor_height(hulls, float(room[0, 2]))
    if depth >= LEAST_DEPTH_M:
        if told_floor:
            return [*filled, *cut]
        cut.append(
            f"people's feet are {depth * 100:.0f} cm below the floor, where they are cut off; the floor must be at z = 0 in the "
            "calibration, and the room's lower limit at the floor"
        )
    apart = at_odds(recording, masks)
    return [*filled, *(cut or ([apart[1]] if apart else _odd_camera(recording, hulls)))]


def filled_images(recording: Recording, masks: Sequence[Masks]) -> tuple[list[str], list[Masks]]:
    """A sentence for each camera whose silhouettes are no people's, as they fill its image; and the silhouettes of the others."""
    shares = [np.median([1.0 * mask.mean() for mask in own if mask is not None] or [0.0]) for own in zip(*masks, strict=True)]
    sentences = [
        f"camera '{name}': its silhouettes fill {share:.0%} of its image; people must be white and all else black, without grey "
        "or an alpha channel that says so: invert or convert them, or remove them and they are made of the images"
        for name, share in zip(recording.rig.names, shares, strict=True)
        if share > FILLED
    ]
    return sentences, [tuple(None if share > FILLED else mask for mask, share in zip(frame, shares, strict=True)) for frame in masks]


def _odd_camera(recording: Recording, hulls: Sequence[Hull]) -> list[str]:
    """A sentence on the camera that is off by a few pixels or frames."""
    rig = recording.rig
    shares = misfit(rig, hulls, range(len(rig)))
    odd = odd_camera(rig, hulls, shares)
    if odd is None:
        return []
    c, others = odd
    outside = shares[:, shares.shape[1] // 2, shares.shape[2] // 2]
    sentence = f"camera '{rig[c].name}': {outside[c]:.1%} of its silhouettes lie outside what the other cameras see"
    if others is not None:
        sentence += f", and so do {np.nanmean(np.delete(outside, c)):.1%} of theirs, but only {others:.1%} without it"
    move = best_move(shares[c])
    if move is not None:
        then, (right, down) = move
        ways = ((right, ("left", "right")), (down, ("up", "down")))
        way = " and ".join(f"{round(abs(n) * max(rig[c].size) / 640)} px {words[n > 0]}" for n, words in ways if n)
        sentence += f"; {then:.1%} of its own would if they were moved {way}"
    return [
        f"{sentence}; has it moved since it was calibrated, or is its video early or late? When each camera's frames were taken, finds: "
        f"{sync_command(places_of(recording))}"
    ]


def covered_shares(recording: Recording, masks: Sequence[Sequence[np.ndarray | None]]) -> np.ndarray:
    """`silhouette_agreement` of all cameras of a recording, shape (n_cameras,); masks as there."""
    return silhouette_agreement(_views(recording), masks, range(len(recording.rig)))


def silhouette_agreement(views: Sequence[_View], masks: Sequence[Sequence[np.ndarray | None]], members: Sequence[int]) -> np.ndarray:
    """The share of each camera's silhouettes that the hull of the other cameras covers.

    The hull for a camera is made of the points that at least two of the others see and all of those have in their silhouettes. A cell
    of the camera's silhouette counts if it shows a point of the room that two others see, and is covered if it, or a neighbour,
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
    matched, there = np.zeros(len(members)), np.zeros(len(members))
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
            matched[place] += (silhouette & covered).sum()
    return np.where(there >= LEAST_CELLS, matched / np.maximum(there, 1), np.nan)


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
