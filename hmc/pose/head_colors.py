"""Which way a head faces, as its colors tell: skin is redder than hair, and a face is skin.

Blood under the skin makes a face redder than hair, caps and hoods are, whatever their lightness (a* of CIE L*a*b*); where a head is of one
color all around, or its redness has nothing to do with the way to the front, nothing follows. A camera that sees everything redder than the
others says nothing by that: each is compared with itself. Ours.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmc.camera.model import Rig
from hmc.pose.part_colors import KINDS, Skin, patch_sides, shown, skin_of
from hmc.pose.views.color_patches import patch_means

if TYPE_CHECKING:
    from hmc.pose.second_pass import SecondPass

__all__ = ["face_patches", "facing_by_redness", "turned_by_heads"]

#: Below the crown of the head, metres, lies the face: from the brow to the mouth. Higher is hair also in front, lower is skin also behind.
FACE_M = 0.07, 0.17
#: Patches beside one another and in other cameras are of the same surface: so many count as one.
ALIKE = 10.0
#: Fewer patches tell nothing.
LEAST_PATCHES = 12
#: Light, shade and compression change redness by so much, of steps of 8 bits: less from front to back tells nothing.
FLOOR = 2.0
#: What a frame may say, nats.
MOST_NATS = 3.0


def face_patches(
    rig: Rig,
    images: Sequence[np.ndarray | None],
    masks: Sequence[np.ndarray | None],
    sides: Sequence[int],
    people: Iterable[tuple[Skin, np.ndarray]],
    own: Skin,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The redness of a person's head at the height of the face, all around, as far as cameras show it.

    Parameters
    ----------
    rig : Rig
    images : sequence of ndarray of uint8, shape (h, w, 3), or None
    masks : sequence of ndarray of bool, shape (h, w), or None
    sides : sequence of int
        Of the cameras' patches, pixels (`hmc.pose.part_colors.patch_sides`).
    people : iterable of (Skin, ndarray of shape (n, 3))
        As for `hmc.pose.part_colors.shown`: all others as somebody else's.
    own : Skin
        The person's.

    Returns
    -------
    azimuth : ndarray, shape (n,)
        Of each patch about the head's axis, radians from the front.
    redness : ndarray, shape (n,)
        a*, of OpenCV's 8 bits.
    camera : ndarray of int, shape (n,)
        By number.
    """
    people = list(people)
    head = KINDS.index("head")
    below = own.points[own.kind == head, 2].max() - own.points[:, 2]
    azimuths, rednesses, cameras = [np.empty(0)], [np.empty(0)], [np.empty(0, int)]
    for k, (camera, image, mask, side) in enumerate(zip(rig, images, masks, sides, strict=True)):
        if image is None or mask is None:
            continue
        patch, mean = patch_means(camera, image, mask, side)
        seen = shown(camera, side, people)
        of_head = seen.kind == head
        _, colored, nearest = np.intersect1d(patch, seen.patch[of_head], assume_unique=True, return_indices=True)
        point = seen.point[of_head][nearest]
        face = (below[point] >= FACE_M[0]) & (below[point] < FACE_M[1])
        azimuths.append(np.arctan2(own.points[point[face], 1], own.points[point[face], 0]))
        rednesses.append(mean[colored[face], 1])
        cameras.append(np.full(face.sum(), k))
    return np.concatenate(azimuths), np.concatenate(rednesses), np.concatenate(cameras)


def facing_by_redness(azimuth: np.ndarray, redness: np.ndarray, camera: np.ndarray) -> float:
    """What the redness of a head says for the way in which it is taken to face, and against the opposite one.

    Parameters
    ----------
    azimuth : ndarray, shape (n,)
        Radians from the front.
    redness : ndarray, shape (n,)
    camera : ndarray of int, shape (n,)

    Returns
    -------
    float
        Nats: how much likelier a redness is that changes with the way to the front than one that does not, by the residuals of both
        (least squares, with a level a camera and a change to the left or right in both); positive where the front is redder, negative
        where the back is.
    """
    n = len(azimuth)
    if n < LEAST_PATCHES:
        return 0.0
    aside, front = np.column_stack([camera[:, None] == np.unique(camera), np.sin(azimuth)]), np.cos(azimuth)
    # What is left of both when the cameras' levels and the change from left to right are taken off (Frisch and Waugh, 1933).
    front, red = (values - aside @ np.linalg.lstsq(aside, values, rcond=None)[0] for values in (front, redness))
    spread = float(front @ front)
    if spread < 1e-9 * n:
        return 0.0
    slope = float(front @ red) / spread
    explained, left = slope**2 * spread / n, float((red - slope * front) @ (red - slope * front)) / n
    said = n / ALIKE / 2 * np.log1p(explained / (left + FLOOR**2))
    return float(np.copysign(min(said, MOST_NATS), slope))


def turned_by_heads(pass_: SecondPass, asked: Mapping[int, Sequence[int]]) -> Iterator[dict[int, float]]:
    """What the colors of heads say for bodies turned about, against the first pass's poses.

    Parameters
    ----------
    pass_ : SecondPass
        Of a recording with images, whose silhouettes were kept.
    asked : mapping of int to sequence of int
        By frame, rising, who is asked of.

    Yields
    ------
    dict of int to float
        By person, nats (`facing_by_redness`).
    """
    if not asked:
        return
    rig, poses = pass_.recording.rig, pass_.states
    skins = {person: skin_of(body) for person, body in pass_.bodies.items()}
    for frame, step in pass_.pictures(list(asked)):
        rows = np.flatnonzero((poses.frames == frame.index) & np.isfinite(poses.states).all(axis=1))
        placed = {
            person: skins[person].placed(pass_.bodies[person], poses.states[row])
            for person, row in zip(poses.persons[rows].tolist(), rows, strict=True)
        }
        told = {}
        for person in asked[frame.index]:
            people = [(skins[one] if one == person else skins[one].of_another(), points) for one, points in placed.items()]
            sides = patch_sides(rig, placed[person].mean(axis=0))
            told[person] = -facing_by_redness(*face_patches(rig, frame.images, step.masks, sides, people, skins[person]))
        yield told
