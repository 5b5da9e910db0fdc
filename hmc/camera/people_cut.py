"""People cut out of one camera's images by color, where it is known roughly where they are: for scenes that were never seen empty.

Colors of people and of the scene are learnt from pixels of which it is known what they show (`learn_colors`). Then a graph cut (Rother
et al. (2004), "GrabCut") decides between the two, pixel by pixel and with its neighbours. Limbs that never move do not differ from the
scene as it is known; those are found by their color, which is that of the people and not that of what surrounds them
(`hmc.camera.local_color`), and held in the cut. So are legs in trousers of a color of their own: under a body that seems to hang in the
air, what has no color of the surroundings. And so is, on the other side, what looks like the floor and the walls around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.camera.local_color import Palette, learn_palette, looks_like_people, looks_like_surroundings, looks_unlike_surroundings

__all__ = ["PeopleColors", "View", "color_mixture", "cut_people", "disc", "learn_colors"]

#: Widths in pixels of an image whose longer side is 320: how deep in a person is surely inside, gaps that may be a person's, how thick a
#: limb is at least, and the surroundings that decide about a place: of 20, a black panel beside a person became hers.
CORE_PX = 5
LIMB_PX = 9
THIN_PX = 3
AROUND_PX = 32
#: Fewer pixels than this do not tell what colors people or the scene have; more than that tell no more.
FEWEST_PX, MOST_PX = 50, 20_000
#: Gaussians of each mixture, how often and how long their clusters are looked for, and grey levels, squared, that any color varies.
N_GAUSSIANS, BEGINNINGS, ROUNDS, LEAST_STEP, LEAST_VARIANCE = 5, 8, 30, 0.1, 0.01


@dataclass(frozen=True)
class View:
    """What is known of one image before colors are looked at.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        Small: some 320 pixels are enough.
    differs : ndarray of bool, shape (height, width)
        Where it is not the scene.
    surely, possibly : ndarray of bool, shape (height, width)
        Where all cameras, and nearly all, agree that a person is (`hmc.voxels.agreement`).
    unseen : ndarray of bool, shape (height, width)
        Where the scene is not known.
    below : ndarray of bool, shape (height, width)
        What is under a body that nothing seems to hold up: its legs are there, though they may not differ from the scene.
    changed : ndarray of bool, shape (height, width), optional
        Where the scene is not known and the image is not what is there most of the time.
    """

    image: np.ndarray
    differs: np.ndarray
    surely: np.ndarray
    possibly: np.ndarray
    unseen: np.ndarray
    below: np.ndarray
    changed: np.ndarray | None = None


@dataclass(frozen=True)
class PeopleColors:
    """Colors of people and of their surroundings in one camera.

    Attributes
    ----------
    palette : Palette
        Of people.
    people, scene : ndarray, shape (1, 65)
        OpenCV's mixtures of Gaussians.
    """

    palette: Palette
    people: np.ndarray
    scene: np.ndarray


def learn_colors(views: Sequence[View]) -> PeopleColors | None:
    """Colors of people and of the scene, one model for all images of a camera.

    Colors of people are learnt where the image differs from a scene that is known, colors of the scene away from that: what stands
    still between the two may be either, so it teaches nothing.

    Parameters
    ----------
    views : sequence of View

    Returns
    -------
    PeopleColors or None
        None where too little is known of either's colors.
    """
    hints = [_hints(view) for view in views]
    palette = learn_palette([view.image[_near(labels) & telling] for view, (labels, telling) in zip(views, hints, strict=True)])
    if palette is None:
        return None
    hints = [_hints(view, _limbs(view, labels, palette, view.possibly)) for view, (labels, _) in zip(views, hints, strict=True)]
    pixels = np.concatenate([view.image[telling] for view, (_, telling) in zip(views, hints, strict=True)])
    labels = np.concatenate([labels[telling] for labels, telling in hints])
    theirs = _near(labels)
    if min(np.count_nonzero(theirs), np.count_nonzero(~theirs)) < FEWEST_PX:
        return None
    cv2.setRNGSeed(0)  # the colors are clustered with OpenCV's own generator
    return PeopleColors(palette, color_mixture(pixels[theirs]), color_mixture(pixels[~theirs]))


def color_mixture(pixels: np.ndarray) -> np.ndarray:
    """A mixture of Gaussians, those of the clusters of some colors.

    `cv2.grabCut` makes its own of clusters that it begins once: they differ from one beginning to another, by so much that a thigh became
    floor or not.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (n, 3)

    Returns
    -------
    ndarray, shape (1, 65)
        As OpenCV writes it: 5 weights, means and covariances.
    """
    some = pixels[np.linspace(0, len(pixels) - 1, min(len(pixels), MOST_PX)).astype(int)].astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_MAX_ITER + cv2.TERM_CRITERIA_EPS, ROUNDS, LEAST_STEP)
    _, cluster, _ = cv2.kmeans(some, N_GAUSSIANS, None, criteria, BEGINNINGS, cv2.KMEANS_PP_CENTERS)  # type: ignore[call-overload]
    own = [some[cluster[:, 0] == k] for k in range(N_GAUSSIANS)]
    means = np.array([one.mean(axis=0) for one in own], float)
    spreads = np.array([np.cov(one.T, bias=True) + LEAST_VARIANCE * np.eye(3) for one in own])
    return np.concatenate([[len(one) / len(some) for one in own], means.ravel(), spreads.ravel()])[None]


def cut_people(view: View, colors: PeopleColors, where: np.ndarray | None = None) -> np.ndarray:
    """Where people are in an image.

    Parameters
    ----------
    view : View
    colors : PeopleColors
    where : ndarray of bool, shape (height, width), optional
        Pixels that are asked for; by default all.

    Returns
    -------
    ndarray of bool, shape (height, width)
        True at pixels that are asked for alone.
    """
    people = np.zeros(view.possibly.shape, bool)
    asked = view.possibly if where is None else view.possibly & where
    if not asked.any():
        return people
    # A cut is decided by what is around it: not by all of the image.
    around = cv2.dilate(asked.view(np.uint8), disc(people, AROUND_PX))
    possibly = view.possibly & around.view(bool)
    labels, _ = _hints(view)
    labels, _ = _hints(view, _limbs(view, labels, colors.palette, possibly))
    labels[_ground(view, colors.palette, possibly) & (labels != cv2.GC_FGD)] = cv2.GC_BGD
    labels[~around.view(bool)] &= 1  # surely what they probably are
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(around)
    for piece, (left, top, width, height, _) in enumerate(stats[1:].tolist(), 1):
        box = np.s_[top : top + height, left : left + width]
        part = np.ascontiguousarray(labels[box])
        scene, theirs = colors.scene.copy(), colors.people.copy()
        cv2.grabCut(np.ascontiguousarray(view.image[box]), part, None, scene, theirs, 1, cv2.GC_EVAL_FREEZE_MODEL)  # type: ignore[call-overload]
        people[box] |= _near(part) & (pieces[box] == piece)
    return people & asked


def _near(labels: np.ndarray) -> np.ndarray:
    """Pixels that are, or probably are, people."""
    return np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))


def _limbs(view: View, labels: np.ndarray, palette: Palette, asked: np.ndarray) -> np.ndarray:
    """Solid parts that touch people, and look like them where they may be and are asked for, or below them like nothing else."""
    people = _near(labels)
    # What has changed may be the limb itself, which is no surroundings of its own.
    found = looks_like_people(view.image, people if view.changed is None else people | view.changed, palette, asked)
    if view.below.any():
        found |= looks_unlike_surroundings(view.image, people | view.below, asked & view.below & ~view.differs)
    solid = cv2.morphologyEx(found.view(np.uint8), cv2.MORPH_OPEN, disc(found, THIN_PX))
    _, pieces = cv2.connectedComponents(solid | people.view(np.uint8), connectivity=8)
    return (solid > 0) & np.isin(pieces, np.unique(pieces[people]))


def _ground(view: View, palette: Palette, possibly: np.ndarray) -> np.ndarray:
    """Solid parts that do not differ from the scene and look like what is around all places where people may be: floor, and walls.

    The cut's mixtures are of the whole image and too coarse for that: the floor between two people was people's.
    """
    thin = disc(view.possibly, THIN_PX)
    # Elsewhere it is scene anyway; what is thin is told with what is around it.
    asked = cv2.dilate(possibly.view(np.uint8), thin, iterations=2).view(bool) & ~view.differs
    found = looks_like_surroundings(view.image, view.possibly, palette, asked)
    return cv2.morphologyEx(found.view(np.uint8), cv2.MORPH_OPEN, thin).view(bool)


def _hints(view: View, limbs: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """What a graph cut starts from, and which pixels teach it their colors."""
    differs = view.differs if limbs is None else view.differs | limbs
    near = cv2.morphologyEx((differs & view.possibly).view(np.uint8), cv2.MORPH_CLOSE, disc(differs, LIMB_PX)).view(bool)
    around = cv2.dilate(near.view(np.uint8), disc(differs, LIMB_PX)).view(bool)
    near &= view.possibly
    labels = np.full(differs.shape, cv2.GC_BGD, np.uint8)
    labels[view.possibly] = cv2.GC_PR_BGD
    labels[near] = cv2.GC_PR_FGD
    core = view.surely & near & view.differs & ~view.unseen
    labels[cv2.erode(core.view(np.uint8), disc(differs, CORE_PX)).view(bool)] = cv2.GC_FGD
    if limbs is not None:
        labels[cv2.erode((limbs & near).view(np.uint8), disc(differs, THIN_PX)).view(bool)] = cv2.GC_FGD
    # Gaps that were closed may show either.
    return labels, np.where(near, differs, ~around) & ~view.unseen


def disc(image: np.ndarray, width: float) -> np.ndarray:
    """A disc, its width given for an image whose longer side is 320 pixels."""
    side = max(3, 2 * round((width * max(image.shape[:2]) / 320 - 1) / 2) + 1)
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
