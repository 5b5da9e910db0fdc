"""People cut out of one camera's images by color, where it is known roughly where they are: for scenes that were never seen empty.

Colors of people and of the scene are learnt from pixels of which it is known what they show (`learn_colors`). Then a graph cut (Rother
et al. (2004), "GrabCut") decides between the two, pixel by pixel and with its neighbours. Limbs that never move do not differ from the
scene as it is known; those are found by their color, which is that of the people and not that of what surrounds them
(`hmc.camera.local_color`), and held in the cut. So is, on the other side, what looks like the floor and the walls around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.camera.local_color import Palette, learn_palette, looks_like_people, looks_like_surroundings

__all__ = ["PeopleColors", "View", "cut_people", "disc", "learn_colors"]

#: Widths in pixels of an image whose longer side is 320: how deep in a person is surely inside, gaps that may be a person's, how thick a
#: limb is at least, and the surroundings of people in which the graph cut works.
CORE_PX = 5
LIMB_PX = 9
THIN_PX = 3
AROUND_PX = 20
#: Fewer pixels than this do not tell what colors people or the scene have.
FEWEST_PX = 50


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
    """

    image: np.ndarray
    differs: np.ndarray
    surely: np.ndarray
    possibly: np.ndarray
    unseen: np.ndarray


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
    hints = [_hints(view, _limbs(view, labels, palette)) for view, (labels, _) in zip(views, hints, strict=True)]
    pixels = np.concatenate([view.image[telling] for view, (_, telling) in zip(views, hints, strict=True)])
    labels = np.concatenate([labels[telling] for labels, telling in hints])
    if min(np.count_nonzero(_near(labels)), np.count_nonzero(~_near(labels))) < FEWEST_PX:
        return None
    cv2.setRNGSeed(0)  # the colors are clustered with OpenCV's own generator
    models = np.zeros((1, 65)), np.zeros((1, 65))
    cv2.grabCut(pixels[None], labels[None], None, *models, 0, cv2.GC_INIT_WITH_MASK)  # type: ignore[call-overload]
    scene, people = models
    return PeopleColors(palette, people, scene)


def cut_people(view: View, colors: PeopleColors) -> np.ndarray:
    """Where people are in an image.

    Parameters
    ----------
    view : View
    colors : PeopleColors

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    people = np.zeros(view.possibly.shape, bool)
    left, top, width, height = cv2.boundingRect(cv2.dilate(view.possibly.view(np.uint8), disc(people, AROUND_PX)))
    if width == 0:
        return people
    labels, _ = _hints(view)
    labels, _ = _hints(view, _limbs(view, labels, colors.palette))
    labels[_ground(view, colors.palette) & (labels != cv2.GC_FGD)] = cv2.GC_BGD
    box = np.s_[top : top + height, left : left + width]
    part = np.ascontiguousarray(labels[box])
    scene, theirs = colors.scene.copy(), colors.people.copy()
    cv2.grabCut(np.ascontiguousarray(view.image[box]), part, None, scene, theirs, 1, cv2.GC_EVAL_FREEZE_MODEL)  # type: ignore[call-overload]
    people[box] = _near(part)
    return people


def _near(labels: np.ndarray) -> np.ndarray:
    """Pixels that are, or probably are, people."""
    return np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))


def _limbs(view: View, labels: np.ndarray, palette: Palette) -> np.ndarray:
    """Solid parts that look like people where they are, and touch people."""
    people = _near(labels)
    found = looks_like_people(view.image, people, palette, view.possibly)
    solid = cv2.morphologyEx(found.view(np.uint8), cv2.MORPH_OPEN, disc(found, THIN_PX))
    _, pieces = cv2.connectedComponents(solid | people.view(np.uint8), connectivity=8)
    return (solid > 0) & np.isin(pieces, np.unique(pieces[people]))


def _ground(view: View, palette: Palette) -> np.ndarray:
    """Solid parts that do not differ from the scene and look like what is around all places where people may be: floor, and walls.

    The cut's mixtures are of the whole image and too coarse for that: the floor between two people was people's.
    """
    thin = disc(view.possibly, THIN_PX)
    # Elsewhere it is scene anyway; what is thin is told with what is around it.
    asked = cv2.dilate(view.possibly.view(np.uint8), thin, iterations=2).view(bool) & ~view.differs
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
