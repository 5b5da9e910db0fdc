"""The empty scene out of images in which people are: for recordings without background frames.

A plain temporal median holds the people who stay about one place for more than half of the time. So people are first cut out of every
image: what differs from the median is surely theirs, what lies between such parts may be, and a graph cut on the colours (Rother et al.
2004, "GrabCut") decides. The scene is the median of what is left; pixels never seen without people are filled in from around them.

It helps but does not replace background frames: a foot that never moves stays in the scene, and where somebody moves so little that
nearly all that differs is limbs, the cut may stop at the limbs.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

__all__ = ["empty_scene", "replace_people"]

#: A pixel further than this from the scene, in grey levels, may be a person's.
DISTANCE = 25
#: Longer side of the images on which people are cut out, pixels: ten of these pixels are about a limb.
SMALL_PX = 240
#: Parts nearer than this are one person's, and what lies between them may be too; small pixels.
LINK_PX = 25
#: Smaller parts are noise; small pixels.
LEAST_PX = 40
#: A pixel seen without people in fewer images than this is filled in.
LEAST_SEEN = 2


def empty_scene(images: Sequence[np.ndarray]) -> np.ndarray:
    """The scene without the people in it.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width, 3)
        Of one camera, spread over a time in which people move; one at least.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)
    """
    median = _masked_median(images, [np.zeros(images[0].shape[:2], bool)] * len(images))
    people = [_cut_out(image, median) for image in images]
    scene = _masked_median(images, people)
    seen = len(images) - np.stack(people).sum(axis=0)
    unknown = np.asarray(seen < min(LEAST_SEEN, len(images)), np.uint8)
    return cv2.inpaint(scene, unknown, 5, cv2.INPAINT_TELEA) if unknown.any() else scene


def replace_people(image: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """The image with the scene wherever it is far from it: as if nobody were there, with the image's own noise elsewhere."""
    far = cv2.absdiff(image, scene).max(axis=2) > DISTANCE
    return np.where(far[..., None], scene, image)


def _masked_median(images: Sequence[np.ndarray], hidden: Sequence[np.ndarray]) -> np.ndarray:
    """Median over images of each pixel where it is not hidden; over all where it always is. In strips of rows, to need little memory."""
    result = np.empty_like(images[0])
    for top in range(0, len(result), 64):
        rows = slice(top, top + 64)
        stack = np.stack([image[rows] for image in images]).astype(np.int16)
        out = np.stack([mask[rows] for mask in hidden])
        out &= ~out.all(axis=0)
        stack[out] = 256  # sorts behind every grey level
        middle = ((~out).sum(axis=0) - 1) // 2
        stack.sort(axis=0)
        result[rows] = np.take_along_axis(stack, middle[None, ..., None], axis=0)[0]
    return result


def _cut_out(image: np.ndarray, median: np.ndarray) -> np.ndarray:
    """Where people are in the image, (height, width) bool, as the difference from the median and the colours tell."""
    size = [max(1, round(side * SMALL_PX / max(image.shape[:2]))) for side in image.shape[1::-1]]
    small, scene = (cv2.resize(picture, size, interpolation=cv2.INTER_AREA) for picture in (image, median))
    far = (cv2.absdiff(small, scene).max(axis=2) > DISTANCE).astype(np.uint8)
    far = cv2.morphologyEx(far, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    linked = cv2.dilate(far, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (LINK_PX, LINK_PX)))
    n_parts, parts = cv2.connectedComponents(linked)
    labels = np.full(far.shape, cv2.GC_BGD, np.uint8)
    for part in range(1, n_parts):
        pixels = cv2.findNonZero(((parts == part) & (far > 0)).astype(np.uint8))
        if pixels is not None and len(pixels) >= LEAST_PX:
            between = cv2.fillConvexPoly(np.zeros_like(far), cv2.convexHull(pixels), 1)
            labels[cv2.dilate(between, np.ones((5, 5), np.uint8)) > 0] = cv2.GC_PR_BGD
    near = labels == cv2.GC_PR_BGD
    labels[near & (far > 0)] = cv2.GC_PR_FGD
    labels[near & (cv2.erode(far, np.ones((3, 3), np.uint8)) > 0)] = cv2.GC_FGD
    people: np.ndarray = np.zeros(far.shape, np.uint8)
    if (labels == cv2.GC_FGD).any() and (labels == cv2.GC_BGD).any():
        cv2.setRNGSeed(0)  # the graph cut clusters colours with OpenCV's own generator
        cv2.grabCut(small, labels, None, np.zeros((1, 65)), np.zeros((1, 65)), 3, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
        people = cv2.dilate(np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.uint8), np.ones((3, 3), np.uint8))
    return cv2.resize(people, image.shape[1::-1], interpolation=cv2.INTER_NEAREST).view(bool)
