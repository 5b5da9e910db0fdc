"""A person who hardly moves, cut out of one camera's images: where the person stands is known, what belongs to the person is told by color.

A standing person's clothes change from head to foot, and so does what is behind them: dark trousers before a dark floor are told from it
by little. So a graph cut (Rother et al. (2004), "GrabCut") has models of its own for the shanks, the thighs, the trunk and the head.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from hmc.camera.model import Camera, project
from hmc.camera.people_cut import FEWEST_PX
from hmc.camera.standing import Standing, half_width

__all__ = ["BodyColors", "Figure", "around", "cut_body", "figure", "learn_body"]

#: Where the parts with colors of their own begin and end, in statures.
PARTS = ((0.0, 0.25), (0.25, 0.5), (0.5, 0.8), (0.8, 1.2))
#: How far from a figure its person may reach, and how far the surroundings are looked at, metres.
REACH_M, AROUND_M = 0.15, 0.28
#: Share of a figure's width that is surely the person, between these heights in statures: below, the floor is seen between the legs.
CORE_WIDTH, CORE_FROM, CORE_TO = 0.4, 0.5, 0.97
#: Times that colors are learnt of what was cut out with the last ones.
ROUNDS = 3
#: A pixel of the core shows the person where it is no further than this from what it showed in the samples, grey levels.
ALIKE = 40
#: Bins a channel in which colors are counted at first, and how far the counts are spread, bins.
BINS, BIN_SPREAD = 16, 0.7
#: Heights at which a figure's outline is drawn, metres, and points around it.
STEP_M, POINTS = 0.05, 16


@dataclass(frozen=True)
class Figure:
    """What is known of a standing person's outline in one view before colors are looked at.

    Attributes
    ----------
    body, core, reach : ndarray of bool, shape (height, width)
        Where an average person would be, where the person surely is, and where the person may be.
    parts : ndarray of int8, shape (height, width)
        Which of the parts of different colors each pixel is in or beside; -1 far away.
    """

    body: np.ndarray
    core: np.ndarray
    reach: np.ndarray
    parts: np.ndarray


@dataclass(frozen=True)
class BodyColors:
    """What a standing person looks like in one view.

    Attributes
    ----------
    models : tuple of (ndarray, ndarray) or None, one a part
        OpenCV's mixtures of the surroundings and of the person, each (1, 65); None where too little is seen.
    look : ndarray of uint8, shape (height, width, 3)
        Median of the samples.
    """

    models: tuple[tuple[np.ndarray, np.ndarray] | None, ...]
    look: np.ndarray


def figure(camera: Camera, place: Standing) -> Figure:
    """A standing person's figure in one view.

    Parameters
    ----------
    camera : Camera
    place : Standing
    """
    top = place.stature_m
    parts = np.full(camera.size[::-1], -1, np.int8)
    for k, (low, high) in enumerate(PARTS):
        parts[_drawn(camera, place, low * top, high * top, AROUND_M)] = k
    core = _drawn(camera, place, CORE_FROM * top, CORE_TO * top, share=CORE_WIDTH)
    return Figure(_drawn(camera, place, 0, top), core, _drawn(camera, place, 0, top, REACH_M), parts)


def around(camera: Camera, place: Standing, reach_m: float) -> np.ndarray:
    """Where a person may be in one view who moves on the spot and reaches so far, metres; bool, shape (height, width)."""
    return _drawn(camera, place, 0, place.stature_m, reach_m)


def learn_body(images: Sequence[np.ndarray], others: Sequence[np.ndarray], figure: Figure) -> BodyColors:
    """Colors of a standing person and of what is around.

    Parameters
    ----------
    images : sequence of ndarray of uint8, shape (height, width, 3)
        Of one camera, spread over the time in which the person stands there.
    others : sequence of ndarray of bool, shape (height, width)
        Where other people are.
    figure : Figure
    """
    look = np.median(np.stack(images), axis=0).astype(np.uint8)
    labels = [_labels(figure, mask) for mask in others]
    for k in range(len(PARTS)):
        _give_to_surroundings(images, labels, others, figure.parts == k)
    models: tuple = (None,) * len(PARTS)
    for _ in range(ROUNDS):
        models = tuple(_mixtures(images, labels, others, figure.parts == k) for k in range(len(PARTS)))
        labels = [_cut(image, start, figure, models) for image, start in zip(images, labels, strict=True)]
    return BodyColors(models, look)


def cut_body(image: np.ndarray, others: np.ndarray | None, figure: Figure, colors: BodyColors) -> np.ndarray:
    """Where a standing person is in an image; nowhere if what is there looks different.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
    others : ndarray of bool, shape (height, width), or None
        Where other people are, as far as is known.
    figure : Figure
    colors : BodyColors

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    labels = _labels(figure, others)
    alike = cv2.absdiff(image, colors.look).max(axis=2) <= ALIKE
    labels[(labels == cv2.GC_FGD) & ~alike] = cv2.GC_PR_FGD
    if not (labels == cv2.GC_FGD).any():
        return np.zeros(labels.shape, bool)
    person = _cut(image, labels, figure, colors.models) % 2 == 1
    # What is not joined to the core is another thing of the same color.
    _, pieces = cv2.connectedComponents(person.view(np.uint8), connectivity=8)
    return person & np.isin(pieces, np.unique(pieces[labels == cv2.GC_FGD]))


def _labels(figure: Figure, others: np.ndarray | None) -> np.ndarray:
    labels = np.full(figure.body.shape, cv2.GC_BGD, np.uint8)
    labels[figure.reach] = cv2.GC_PR_BGD
    labels[figure.body] = cv2.GC_PR_FGD
    labels[figure.core] = cv2.GC_FGD
    if others is not None:
        labels[others] = cv2.GC_BGD
    return labels


def _give_to_surroundings(images, labels, others, part: np.ndarray) -> None:
    """Change labels, in place, of pixels of one part of the figure whose color is commoner beside it: floor that shows between legs."""
    told = [part & ~mask for mask in others]
    bins = [(image[mask] // (256 // BINS)).astype(int) for image, mask in zip(images, told, strict=True)]
    given = np.concatenate([mask[at] for mask, at in zip(labels, told, strict=True)])
    shares = []
    for mine in (given % 2 == 0, given % 2 == 1):
        counts = np.zeros((BINS,) * 3)
        np.add.at(counts, tuple(np.concatenate(bins)[mine].T), 1.0)
        shares.append(gaussian_filter(counts / max(counts.sum(), 1), BIN_SPREAD))
    for label, at, colors in zip(labels, told, bins, strict=True):
        commoner = np.zeros(part.shape, bool)
        commoner[at] = shares[0][tuple(colors.T)] > shares[1][tuple(colors.T)]
        label[commoner & (label == cv2.GC_PR_FGD)] = cv2.GC_PR_BGD


def _mixtures(images, labels, others, part: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Mixtures of Gaussians of the surroundings and of the person in one part, of all images together."""
    told = [part & ~mask for mask in others]
    pixels = np.concatenate([image[mask] for image, mask in zip(images, told, strict=True)])
    given = np.concatenate([mask[at] for mask, at in zip(labels, told, strict=True)])
    if min(np.count_nonzero(given % 2), np.count_nonzero(given % 2 == 0)) < FEWEST_PX:
        return None
    cv2.setRNGSeed(0)  # the colors are clustered with OpenCV's own generator
    scene, person = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(pixels[None], given[None], None, scene, person, 0, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    return scene, person


def _cut(image: np.ndarray, labels: np.ndarray, figure: Figure, models) -> np.ndarray:
    """The labels after each part was cut by its own colors, the other parts being as they are."""
    result = labels.copy()
    for k, colors in enumerate(models):
        part = figure.parts == k
        left, top, width, height = cv2.boundingRect(part.view(np.uint8))
        if colors is None or width == 0:
            continue
        box = np.s_[top : top + height, left : left + width]
        mine = part[box]
        given = np.where(mine, labels[box], result[box] % 2)
        if given.max() <= cv2.GC_FGD and (given.min() == given.max() or not mine.any()):
            continue
        cv2.grabCut(np.ascontiguousarray(image[box]), given, None, colors[0].copy(), colors[1].copy(), 1, cv2.GC_EVAL_FREEZE_MODEL)  # type: ignore[call-overload]
        result[box][mine] = given[mine]
    return result


def _drawn(camera: Camera, place: Standing, low: float, high: float, grow: float = 0.0, share: float = 1.0) -> np.ndarray:
    """Silhouette of the body of revolution between two heights, metres, so much wider, or of so much of its width."""
    mask: np.ndarray = np.zeros(camera.size[::-1], np.uint8)
    end = high + (grow if high >= place.stature_m else 0.0)
    heights = np.linspace(low, end, 2 + int((end - low) / STEP_M))
    radius = share * half_width(np.minimum(heights, place.stature_m), place.stature_m) + grow
    turn = 2 * np.pi * np.arange(POINTS) / POINTS
    rings = np.empty((len(heights), POINTS, 3))
    rings[..., 0] = place.x + radius[:, None] * np.cos(turn)
    rings[..., 1] = place.y + radius[:, None] * np.sin(turn)
    rings[..., 2] = heights[:, None]
    uv, valid = project(camera, rings.reshape(-1, 3))
    if valid.all() and np.abs(uv).max() < 1e5:
        uv = uv.reshape(len(heights), POINTS, 2).round().astype(np.int32)
        for below, above in pairwise(uv):
            cv2.fillConvexPoly(mask, cv2.convexHull(np.concatenate([below, above])), 1)
    return mask.view(bool)
