"""The empty scene out of images in which people are: for recordings without background frames.

A median over time holds the people who stay about one place. So people are cut out of every sample first, and what tells them from the
scene is, in turns:

- the scene as it is known so far: what differs from it may be a person, and so may what is where nothing is known;
- the other cameras: only what lies in a visual hull of all views can be a person, not a mirror image, a shadow or somebody far away;
- colour: a graph cut (Rother et al. (2004), "GrabCut") between the colours of this camera's people and those of its surroundings, one
  model for all samples.

The scene is the median of what is left. A place that is hardly ever left free is not filled in but told: `unseen`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

import cv2
import numpy as np

from hmc.camera.background import masked_median, stable_background

__all__ = ["Views", "empty_scenes", "replace_people"]

Masks = Sequence[np.ndarray | None]
#: From the masks of all cameras to what the cameras agree on in each view: surely people, and possibly people.
Views = Callable[[Masks], tuple[Masks, Masks]]

#: A pixel further than this from the scene, in grey levels, may be a person's.
DISTANCE = 25
#: Times that people are cut out and the scene is made of what is left.
ROUNDS = 2
#: A place left free in fewer samples than this share is unseen.
LEAST_FREE = 0.1
#: Widths in pixels of an image whose longer side is 320: how deep in a person is surely inside, gaps that may be a person's, and the
#: margin around people.
CORE_PX = 5
LIMB_PX = 9
MARGIN_PX = 5
#: Fewer pixels than this do not tell what colours people or the scene have.
FEWEST_PX = 50


def empty_scenes(
    samples: Sequence[Masks], sizes: Sequence[tuple[int, int]], views: Views, pool: Executor | None = None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The scene of each camera without the people in it.

    Parameters
    ----------
    samples : sequence of sequences of ndarray of uint8, shape (height, width, 3), or None
        Images of all cameras, a frame at a time, spread over a time in which people move; one image of each camera at least.
    sizes : sequence of (width, height), one a camera
        Of the small images on which people are cut out; some 320 pixels are enough.
    views : callable
        What cameras agree on, for masks of these sizes.
    pool : concurrent.futures.Executor, optional
        Threads to spread the cameras over; the result does not depend on it.

    Returns
    -------
    list of (scene, unseen), one a camera
        Scene: ndarray of uint8, shape (height, width, 3). Unseen: ndarray of bool, shape (height, width), where people hid it in
        nearly all samples.
    """
    run = map if pool is None else pool.map
    n_cameras = len(sizes)
    small = [
        [None if image is None else cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image, size in zip(frame, sizes, strict=True)]
        for frame in samples
    ]
    known = list(run(lambda c: stable_background(_of(small, c)), range(n_cameras)))
    hidden: list[list[np.ndarray]] = []
    for _ in range(ROUNDS):
        hidden = _find_people(small, known, views, run)
        known = list(run(_scene, (_of(small, c) for c in range(n_cameras)), hidden))
    return list(run(_scene, (_of(samples, c) for c in range(n_cameras)), hidden))


def replace_people(image: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """The image with the scene wherever it is far from it: as if nobody were there, with the image's own noise elsewhere."""
    far = cv2.absdiff(image, scene).max(axis=2) > DISTANCE
    return np.where(far[..., None], scene, image)


def _of(frames: Sequence[Masks], camera: int) -> list[np.ndarray]:
    """One camera's entries, without the frames that it has none of."""
    return [entry for frame in frames if (entry := frame[camera]) is not None]


def _find_people(small: Sequence[Masks], known: Sequence[tuple[np.ndarray, np.ndarray]], views: Views, run) -> list[list[np.ndarray]]:
    """Where people are in each camera's samples, as the scene known so far, the other cameras and the colours tell."""
    masks = [[None if image is None else _differs(image, *known[c]) for c, image in enumerate(frame)] for frame in small]
    agreed = list(run(views, masks))
    surely, possibly = ([frame[i] for frame in agreed] for i in (0, 1))
    cameras = range(len(known))
    columns = [[_of(frames, c) for c in cameras] for frames in (small, masks, surely, possibly)]
    return list(run(_cut_out, *columns, [unseen for _, unseen in known]))


def _differs(image: np.ndarray, scene: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Where the image is not the scene, or the scene is not known; gaps closed."""
    far = cv2.absdiff(cv2.blur(image, (3, 3)), cv2.blur(scene, (3, 3))).max(axis=2) > DISTANCE
    return cv2.morphologyEx((far | unseen).view(np.uint8), cv2.MORPH_CLOSE, _disc(image, 3)).view(bool)


def _scene(images: Sequence[np.ndarray], people: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Median of what people leave free, and where that is hardly ever anything."""
    size = images[0].shape[1::-1]
    hidden = [cv2.resize(mask.view(np.uint8), size, interpolation=cv2.INTER_NEAREST).view(bool) for mask in people]
    free = len(images) - np.sum(hidden, axis=0)
    return masked_median(images, hidden), free < max(1, LEAST_FREE * len(images))


def _cut_out(
    images: Sequence[np.ndarray],
    differs: Sequence[np.ndarray],
    surely: Sequence[np.ndarray],
    possibly: Sequence[np.ndarray],
    unseen: np.ndarray,
) -> list[np.ndarray]:
    """Where people are in one camera's samples, with a margin.

    Colours of people are learnt where the image differs from a scene that is known, colours of the scene away from that: what stands
    still between the two may be either, so it teaches nothing, and the graph cut decides.
    """
    boxes = [cv2.boundingRect(cv2.dilate(mask.view(np.uint8), _disc(mask, 4 * MARGIN_PX))) for mask in possibly]
    widest = max(width for _, _, width, _ in boxes)
    tiles: tuple[list, list, list] = ([], [], [])
    for image, differ, sure, possible, (left, top, width, height) in zip(images, differs, surely, possibly, boxes, strict=True):
        for tile, array in zip(tiles, (image, *_hints(differ, sure, possible, unseen)), strict=True):
            part = array[top : top + height, left : left + width]
            tile.append(np.pad(part, [(0, 0), (0, widest - width)] + [(0, 0)] * (array.ndim - 2)))
    # One below the other, so that all samples share their colours.
    found, first = _graph_cut(*(np.vstack(tile) for tile in tiles)), 0
    people = [np.zeros(mask.shape, np.uint8) for mask in possibly]
    for mask, (left, top, width, height) in zip(people, boxes, strict=True):
        mask[top : top + height, left : left + width] = found[first : first + height, :width]
        first += height
    return [cv2.dilate(mask, _disc(mask, MARGIN_PX)).view(bool) for mask in people]


def _hints(differ: np.ndarray, sure: np.ndarray, possible: np.ndarray, unseen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a graph cut starts from, and which pixels teach it their colours."""
    near = cv2.morphologyEx((differ & possible).view(np.uint8), cv2.MORPH_CLOSE, _disc(differ, LIMB_PX)).view(bool)
    around = cv2.dilate(near.view(np.uint8), _disc(differ, LIMB_PX)).view(bool)
    near &= possible
    labels = np.full(possible.shape, cv2.GC_BGD, np.uint8)
    labels[possible] = cv2.GC_PR_BGD
    labels[near] = cv2.GC_PR_FGD
    labels[cv2.erode((sure & near & differ & ~unseen).view(np.uint8), _disc(differ, CORE_PX)).view(bool)] = cv2.GC_FGD
    return labels, np.where(near, ~unseen, ~around)


def _graph_cut(picture: np.ndarray, labels: np.ndarray, telling: np.ndarray) -> np.ndarray:
    """Where the picture is people, as its colours and the labels tell; nowhere, where too little is known of either colours."""
    foreground = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if min(np.count_nonzero(telling & foreground), np.count_nonzero(telling & ~foreground)) < FEWEST_PX:
        return np.zeros(labels.shape, np.uint8)
    cv2.setRNGSeed(0)  # the colours are clustered with OpenCV's own generator
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(picture[telling][None], labels[telling][None], None, *models, 0, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    cv2.grabCut(picture, labels, None, *models, 1, cv2.GC_EVAL_FREEZE_MODEL)  # type: ignore[call-overload]
    return np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).view(np.uint8)


def _disc(image: np.ndarray, width: float) -> np.ndarray:
    """A disc, its width given for an image whose longer side is 320 pixels."""
    side = max(3, 2 * round((width * max(image.shape[:2]) / 320 - 1) / 2) + 1)
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
