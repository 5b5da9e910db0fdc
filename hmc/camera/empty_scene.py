"""The empty scene out of images in which people are: for recordings without background frames.

A median over time holds the people who stay about one place. So people are cut out of every sample first, and what tells them from the
scene is, in turns:

- the scene as it is known so far: what differs from it may be a person, and so may what is where nothing is known;
- the other cameras: only what lies in a visual hull of all views can be a person, not a mirror image, a shadow or a person far away;
- color: a graph cut between the colors of this camera's people and those of its surroundings (`hmc.camera.people_cut`).

The scene is the median of what is left. A place that is hardly ever left free is not filled in but told: `unseen`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import binary_fill_holes

from hmc.camera.background import masked_median, stable_background
from hmc.camera.people_cut import PeopleColors, View, cut_people, disc, learn_colors

__all__ = [
    "EmptyScene",
    "Masks",
    "SamplePeople",
    "Views",
    "add_bodies",
    "cut_again",
    "cut_samples",
    "of_camera",
    "replace_people",
    "scenes_behind",
    "shrunk",
]

Masks = Sequence[np.ndarray | None]
#: From the masks of all cameras to what the cameras agree on in each view: surely people, and possibly people.
Views = Callable[[Masks], tuple[Masks, Masks, Masks]]

#: A pixel further than this from the scene, in grey levels, may be a person's.
DISTANCE = 25
#: Times that people are cut out and the scene is made of what is left.
ROUNDS = 2
#: A place left free in fewer samples than this share is unseen.
LEAST_FREE = 0.1
#: A place that is the same in more samples than this share never changes.
STILL = 0.8
#: Where somebody was found in so many samples, and of the others a smaller share than this is alike, that is somebody too; gaps of so many
#: pixels are closed. Less than this share of a person in half of the views is nobody. So often people are cut out again.
FOUND, ALIKE, GAP_PX, LEAST_UNEVEN, MORE_ROUNDS = 2, 0.7, 9, 0.25, 2
#: Margin around people, pixels of an image whose longer side is 320.
MARGIN_PX = 5


@dataclass(frozen=True)
class EmptyScene:
    """One camera's scene without the people in it.

    Attributes
    ----------
    image : ndarray of uint8, shape (height, width, 3)
    unseen : ndarray of bool, shape (height, width)
        Where people hid it in nearly all samples; the image tells nothing there.
    colors : PeopleColors or None
        By which people are cut out of this camera's images.
    """

    image: np.ndarray
    unseen: np.ndarray
    colors: PeopleColors | None


@dataclass(frozen=True)
class SamplePeople:
    """People cut out of small samples.

    Attributes
    ----------
    masks : sequence of sequences of ndarray of bool, shape (height, width), or None
        One a camera, a frame at a time; None where there is no image.
    colors : sequence of PeopleColors or None, one a camera
        By which they were cut out.
    scenes : sequence of (ndarray of uint8, ndarray of bool), one a camera
        The scene without them, small, and where it was hardly ever seen.
    regions : sequence of ndarray of bool, shape (height, width), one a camera, or None
        Where somebody was found in some samples and is in the others as well: there, what changes though nobody was found is not the scene.
    """

    masks: Sequence[Masks]
    colors: Sequence[PeopleColors | None]
    scenes: Sequence[tuple[np.ndarray, np.ndarray]]
    regions: Sequence[np.ndarray | None]


def shrunk(samples: Sequence[Masks], sizes: Sequence[tuple[int, int]]) -> list[list[np.ndarray | None]]:
    """The samples, a frame at a time, each camera's made as small as its (width, height); some 320 pixels are enough to cut out people."""
    return [
        [None if image is None else cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image, size in zip(frame, sizes, strict=True)]
        for frame in samples
    ]


def cut_samples(small: Sequence[Masks], views: Views, pool: Executor | None = None) -> SamplePeople:
    """People cut out of small samples.

    Parameters
    ----------
    small : sequence of sequences of ndarray of uint8, shape (height, width, 3), or None
        Images of all cameras, a frame at a time, spread over a time in which people move; one image of each camera at least.
    views : callable
        What cameras agree on, for masks of these sizes.
    pool : concurrent.futures.Executor, optional
        Threads to spread the cameras over; the result does not depend on it.
    """
    run = map if pool is None else pool.map
    n_cameras = len(small[0])
    people = SamplePeople(
        [[None] * n_cameras for _ in small],
        [None] * n_cameras,
        list(run(lambda c: stable_background(of_camera(small, c)), range(n_cameras))),
        [None] * n_cameras,
    )
    for n_round in range(ROUNDS):
        people = _find_people(small, people, views, run, None, n_round)
    return people


def cut_again(
    small: Sequence[Masks], people: SamplePeople, regions: Sequence[np.ndarray], views: Views, pool: Executor | None = None
) -> SamplePeople:
    """People cut out of small samples again, with those who were found in some samples and are scene in the others.

    Parameters
    ----------
    small : sequence of sequences of ndarray of uint8, shape (height, width, 3), or None
    people : SamplePeople
        Those who were found so far.
    regions : sequence of ndarray of bool, shape (height, width), one a camera
        Where somebody was found in some samples alone.
    views, pool
        As of `cut_samples`.

    Returns
    -------
    SamplePeople
        As they were where hardly anything changes.
    """
    run = map if pool is None else pool.map
    images, masks = ([of_camera(frames, c) for c in range(len(regions))] for frames in (small, people.masks))
    scenes = list(run(_scene, images, masks, regions))
    uneven = [np.count_nonzero(unseen & ~before) for (_, unseen), (_, before) in zip(scenes, people.scenes, strict=True)]
    there = [np.mean([np.count_nonzero(mask & region) for mask in own]) for own, region in zip(masks, regions, strict=True)]
    if np.median(np.array(uneven) / np.maximum(there, 1)) < LEAST_UNEVEN:
        return people
    people = replace(people, scenes=scenes, regions=regions)
    for _ in range(MORE_ROUNDS):
        people = _find_people(small, people, views, run, None, ROUNDS)
    return people


def add_bodies(
    small: Sequence[Masks], people: SamplePeople, bodies: Sequence[Masks], views: Views, pool: Executor | None = None
) -> SamplePeople:
    """People cut out of small samples once more, with bodies that are people though they do not differ from the scene.

    Parameters
    ----------
    small : sequence of sequences of ndarray of uint8, shape (height, width, 3), or None
    people : SamplePeople
        Those who were found without.
    bodies : sequence of sequences of ndarray of bool, shape (height, width), or None
    views, pool
        As of `cut_samples`.
    """
    return _find_people(small, people, views, map if pool is None else pool.map, bodies, ROUNDS)


def scenes_behind(samples: Sequence[Masks], people: SamplePeople, pool: Executor | None = None) -> list[EmptyScene]:
    """The scene of each camera, in the samples' full size, behind people who were cut out of them."""
    run = map if pool is None else pool.map
    cameras = range(len(people.colors))
    scenes = run(_scene, (of_camera(samples, c) for c in cameras), (of_camera(people.masks, c) for c in cameras), people.regions)
    return [EmptyScene(scene, unseen, color) for (scene, unseen), color in zip(scenes, people.colors, strict=True)]


def replace_people(image: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """The image with the scene wherever it is far from it: as if no person were there, with the image's own noise elsewhere."""
    return np.where(_far(image, scene)[..., None], scene, image)


def of_camera(frames: Sequence[Masks], camera: int) -> list[np.ndarray]:
    """One camera's entries, without the frames that it has none of."""
    return [entry for frame in frames if (entry := frame[camera]) is not None]


def _find_people(small, before: SamplePeople, views: Views, run, bodies: Sequence[Masks] | None, n_round: int) -> SamplePeople:
    """People in the samples, as the scene known so far, bodies in it, the other cameras and the colors tell."""
    known = before.scenes
    bodies = [[None] * len(frame) for frame in small] if bodies is None else bodies
    masks = [
        [None if image is None else _with(_differs(image, *known[c]), body[c]) for c, image in enumerate(frame)]
        for frame, body in zip(small, bodies, strict=True)
    ]
    agreed = list(run(views, masks))
    cases: list[list[View]] = [[] for _ in known]
    for images, differs, (surely, possibly, below), body in zip(small, masks, agreed, bodies, strict=True):
        for c, (image, differ, more) in enumerate(zip(images, differs, body, strict=True)):
            if image is not None and differ is not None:
                unseen = known[c][1] if more is None else known[c][1] & ~more
                # At first, what changes all the time is people; later, where the scene is not known, colors decide.
                differ = differ if n_round == 0 else differ & ~unseen
                cases[c].append(View(image, differ, surely[c], possibly[c], unseen, below[c]))
    colors = list(run(learn_colors, cases))
    cut = [iter(found) for found in run(_cut_all, cases, colors)]
    people = [
        [None if image is None else _with(next(cut[c]), body[c]) for c, image in enumerate(frame)]
        for frame, body in zip(small, bodies, strict=True)
    ]
    cameras = range(len(known))
    scenes = list(run(_scene, (of_camera(small, c) for c in cameras), (of_camera(people, c) for c in cameras), before.regions))
    return SamplePeople(people, colors, scenes, before.regions)


def _with(mask: np.ndarray, more: np.ndarray | None) -> np.ndarray:
    return mask if more is None else mask | more


def _cut_all(views: Sequence[View], colors: PeopleColors | None) -> list[np.ndarray]:
    return [np.zeros(view.unseen.shape, bool) if colors is None else cut_people(view, colors) for view in views]


def _far(image: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """Where the two are further apart than `DISTANCE` in some channel."""
    return cv2.inRange(cv2.absdiff(image, scene), (0, 0, 0), (DISTANCE,) * 3) == 0


def _differs(image: np.ndarray, scene: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Where the image is not the scene, or the scene is not known; gaps closed."""
    far = _far(cv2.blur(image, (3, 3)), cv2.blur(scene, (3, 3)))
    return cv2.morphologyEx((far | unseen).view(np.uint8), cv2.MORPH_CLOSE, disc(image, 3)).view(bool)


def _scene(images: Sequence[np.ndarray], people: Sequence[np.ndarray], region: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Median of what people leave free, and where that is hardly ever anything.

    A place that never changes is either scene or a person who never moved: where most samples show people there, the few in which
    they were missed do not make it scene. Nor is it scene what changes in a region in which somebody was found in some samples alone.
    """
    size = images[0].shape[1::-1]
    margins = [cv2.dilate(mask.view(np.uint8), disc(mask, MARGIN_PX)).view(bool) for mask in people]
    taken, near = (
        np.stack([cv2.resize(mask.view(np.uint8), size, interpolation=cv2.INTER_NEAREST).view(bool) for mask in masks])
        for masks in (people, margins)
    )
    least = max(1, LEAST_FREE * len(images))
    # Where the margins leave too little, what is next to people is better than nothing.
    np.copyto(near, taken, where=len(images) - near.sum(axis=0) < least)
    scene = masked_median(images, list(near))
    alike = np.stack([~_far(image, scene) for image in images])
    still = (alike.sum(axis=0) > STILL * len(images)) & (2 * (alike & taken).sum(axis=0) > alike.sum(axis=0))
    times = taken.sum(axis=0)
    unseen = still | (len(images) - times < least)
    if region is not None:
        uneven = (times >= FOUND) & ((alike & ~taken).sum(axis=0) < ALIKE * (len(images) - times))
        whole = binary_fill_holes(cv2.morphologyEx(uneven.view(np.uint8), cv2.MORPH_CLOSE, disc(uneven, GAP_PX)))
        unseen |= whole & cv2.resize(region.view(np.uint8), size, interpolation=cv2.INTER_NEAREST).view(bool)
    return scene, unseen
