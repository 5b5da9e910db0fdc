"""Silhouettes of the people in one camera's images, against a learnt model of the empty scene.

The engine is an adaptive mixture of Gaussians with shadow removal (Canton (2009), section 2.2.3: Stauffer and Grimson's mixture with
Landabaso's shadow test; here OpenCV's MOG2, by Zivkovic (2004)). It is trained on frames of the empty scene and then adapts slowly, and
never where a person stands. What it finds is cleaned and completed (`hmc.camera.silhouettes`).

A model is a state: `train_background` makes one, `segment` takes one and returns the next. Two parts of it are not values: the OpenCV
mixture and the running mean change in place when they learn, so go on with the model that `segment` returns, not with the one it was given.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import chain, islice

import cv2
import numpy as np

from hmc.camera.image_signs import is_dark
from hmc.camera.light import FEW, as_image, brought_back, gains_of, is_same_light, light_gains, luma_chroma
from hmc.camera.mixture import SHADOW, ask_mixture, coarse
from hmc.camera.noise import blur_for, blurred, is_grey, left_of_noise, noise_floor
from hmc.camera.segmentation_settings import SegmentationSettings
from hmc.camera.shade import chance_map, noise_px, shade_features, told_by_chance
from hmc.camera.silhouettes import Evidence, GapRules, cut_halo, evidence, fill_gaps, filled_for_darkness, in_planes, without_specks
from hmc.camera.zoom import enlarged, enlarged_mask, reduced_mask
from hmc.errors import InputError

__all__ = [
    "BackgroundModel",
    "SegmentationSettings",
    "empty_image",
    "segment",
    "segment_views",
    "shades_of",
    "train_background",
]

#: Gaussians a pixel. OpenCV's five take 100 bytes a pixel and camera; an indoor scene needs no more than three (Stauffer and
#: Grimson 1999 take three to five).
MIXTURES = 3
#: Least standard deviations of luma and chroma, grey levels: rounding and video compression.
LEAST_DEVIATION = (1.5, 0.8)
#: The same where too few frames were learnt from to know any.
ASSUMED_DEVIATION = (3.0, 1.2)
FEWEST_FRAMES = 5
#: Frames that tell how rough the noise is.
NOISE_FRAMES = 8
#: Most variance of a pixel in the mixture: OpenCV's, and in terms of the least.
MOST_VARIANCE, VARIANCE_RANGE = 75.0, 4.0
#: Near people, differences beyond this many standard deviations are doubtful. Of points on pale people before pale walls that have no
#: silhouette, nine in ten are doubtful, most of them as shadows (measured).
DOUBT = 3.0
#: Share of the image that people's shadows may fill.
MOST_SHADOW = 0.2
#: Where people are, the foreground holds squares of this side, pixels; in small images of the least.
SOLID_PX, LEAST_SOLID_PX = 4, 2
#: Silhouettes are completed in images about this wide at least: smaller ones are enlarged, for there limbs are as thin as specks.
COMPLETION_PX = 640
#: Of images enlarged more than so many times the network knows nothing.
MOST_ZOOM = 2
#: What was found holds a piece of a person where this many standard deviations of the evidence say so too.
SURE = 6.0
#: How far around those squares the image is looked at, pixels of a 640 x 480 image.
MARGIN_PX = 24
#: In the light of the empty scene an image leaves less in the foreground than as it is, unless that is less than this share anyway, and
#: never more than that share.
SUSPECT_SHARE, MOST_LEFT = 0.03, 0.2
#: Share of the new image when everything changed at once, and in the frames after that.
SWITCH_RATE = 0.5
SETTLING_RATE = 0.2
SETTLING_FRAMES = 10


@dataclass(frozen=True)
class BackgroundModel:
    """What is known of one camera's empty scene.

    Attributes
    ----------
    mixture : cv2.BackgroundSubtractorMOG2
        Changes in place when it learns.
    mean : ndarray of float32, shape (height, width, 3)
        Luma, 1 at least, and chroma (OpenCV's YCrCb) of the empty scene; changes in place when it learns.
    deviation : ndarray of float32, shape (height, width, 2)
        Standard deviations of luma and of chroma.
    people : ndarray of bool, shape (height, width)
        The last silhouette; nothing is learnt there.
    frame : int
        Images segmented so far.
    settling : int
        Frames left of learning quickly, after a light was switched.
    before : ndarray of float32, shape (height, width, 3), or None
        The mean before the light was switched, while settling: what changed may have been a flash.
    doubtful : ndarray of bool, shape (height, width), or None
        Where the last image is not quite the empty scene: the silhouette, shadows, and near people whatever differs a little. What
        other cameras see decides there (`hmc.voxels.completion`). None before the first image.
    filled : ndarray of bool, shape (height, width), or None
        Pixels of the last silhouette that were filled for their darkness alone, by rules: what other cameras see of the floor decides
        there (`hmc.voxels.floor_shadows`). None before the first image, and where shades have a `chance`.
    chance : ndarray of uint8, shape (height, width), or None
        Of each pixel of the last image that may as well be a shadow, how likely it is a person, of 255 (`hmc.camera.shade`), which other
        cameras' sight of the floor may tell better (`hmc.voxels.floor_light`); 0 of all others. None before the first image, and where
        the network that guesses it does not know such images: grey, noisy or small ones.
    gains : ndarray of float32, shape (rows, columns, 3), or None
        By which factors the last image was brighter than the empty scene (`hmc.camera.light.light_gains`); None: taken as it is.
    unseen : ndarray of bool, shape (height, width), or None
        Where the empty scene was never seen (`hmc.camera.empty_scene`): nothing is learnt there, and what is found there tells nothing.
    blur : int
        Images are smoothed first by a Gaussian of this side, pixels, since this camera is noisy; 0: they are not.
    grey : bool
        The empty scene has no color: images without any may come from a monochrome camera.
    floor : ndarray of bool, shape (height, width), or None
        Which pixels look at the floor of the room, where that is known (`hmc.camera.shade.floor_pixels`).
    coarse : ndarray of uint8, shape (height / n, width / n, 3)
        The mean as a small image, BGR (`hmc.camera.mixture.coarse`).
    large : tuple of ndarray of float32, shapes (zoom * height, zoom * width, 3) and (zoom * height, zoom * width, 2)
        Mean and deviation as silhouettes are completed in them: enlarged, if images are small (`hmc.camera.zoom`).
    changes : int
        How often the mean has changed.
    """

    mixture: cv2.BackgroundSubtractorMOG2
    mean: np.ndarray
    deviation: np.ndarray
    people: np.ndarray
    coarse: np.ndarray
    large: tuple[np.ndarray, np.ndarray]
    frame: int = 0
    settling: int = 0
    before: np.ndarray | None = None
    doubtful: np.ndarray | None = None
    filled: np.ndarray | None = None
    chance: np.ndarray | None = None
    gains: np.ndarray | None = None
    unseen: np.ndarray | None = None
    blur: int = 0
    grey: bool = False
    floor: np.ndarray | None = None
    changes: int = 0


def train_background(
    frames: Iterable[np.ndarray],
    settings: SegmentationSettings | None = None,
    unseen: np.ndarray | None = None,
    floor: np.ndarray | None = None,
    factor: int = 1,
) -> BackgroundModel:
    """Learn the empty scene.

    Parameters
    ----------
    frames : iterable of ndarray of uint8, shape (height, width, 3)
        BGR images without people, one at least and 20 or more for a good model; they are read once and not kept.
    settings : SegmentationSettings, optional
    unseen : ndarray of bool, shape (height, width), optional
        Where a person stood in all frames.
    floor : ndarray of bool, shape (height, width), optional
        Which pixels look at the floor (`hmc.camera.shade.floor_pixels`).
    factor : int
        How many times smaller the images are than the camera's (`hmc.camera.reduction`): they have less noise for it.

    Returns
    -------
    BackgroundModel

    Raises
    ------
    InputError
        When there is no frame, or when frames differ in size.
    """
    settings = settings or SegmentationSettings()
    mixture = cv2.createBackgroundSubtractorMOG2(varThreshold=settings.variance_threshold, detectShadows=True)
    mixture.setNMixtures(MIXTURES)
    frames = iter(frames)
    first = list(islice(frames, NOISE_FRAMES))
    blur = blur_for(first)
    total = squares = None
    count = 0
    for count, frame in enumerate(chain(first, frames), start=1):
        frame = blurred(frame, blur)
        if total is not None and frame.shape == total.shape:
            gains = gains_of(frame[FEW], total[FEW] / (count - 1))
            frame = frame if is_same_light(gains) else brought_back(frame, total / (count - 1), gains)
        mixture.apply(frame, learningRate=1.0 / count)
        color = cv2.cvtColor(frame, cv2.COLOR_BGR2YCrCb)
        if total is None or squares is None:
            total, squares = np.zeros((2, *color.shape), np.float32)
        if color.shape != total.shape:
            raise InputError(f"background frames differ in size: {total.shape[1::-1]} and {color.shape[1::-1]} pixels")
        cv2.accumulate(color, total)
        cv2.accumulateSquare(color, squares)
    if total is None or squares is None:
        raise InputError("there is no background frame to learn from: give some, or a median of the recording")
    mean = (total / count).astype(np.float32)
    if count < FEWEST_FRAMES:
        deviation = np.broadcast_to(np.array(ASSUMED_DEVIATION, np.float32), (*mean.shape[:2], 2)).copy()
    else:
        # A pixel's own few samples say little of its noise; its neighbours' do.
        squares -= np.square(total, out=total) / count  # sums of whole numbers, exact for some 250 frames
        variance = cv2.blur((squares / (count - 1)).astype(np.float32), (9, 9))
        variance = np.stack([variance[..., 0], variance[..., 1:].mean(axis=2)], axis=-1)
        deviation = np.sqrt(variance)
        noise = noise_floor(deviation, factor)
        least = np.array(LEAST_DEVIATION, np.float32) * left_of_noise(factor)
        deviation = np.maximum(np.maximum(deviation, noise.deviation), least)
        mixture.setVarMin(noise.variance)
        mixture.setVarMax(max(MOST_VARIANCE, VARIANCE_RANGE * noise.variance))
        mixture.apply(as_image(mean), learningRate=0)  # raises the variances that are smaller, and changes nothing else
    mean[..., 0] = np.maximum(mean[..., 0], 1)
    people = np.zeros(mean.shape[:2], bool)
    empty = as_image(mean)
    planes = in_planes(mean), in_planes(deviation)
    large = (_enlarged(planes[0]), _enlarged(planes[1]))
    return BackgroundModel(mixture, *planes, people, coarse(empty), large, unseen=unseen, blur=blur, grey=is_grey(empty), floor=floor)


def shades_of(model: BackgroundModel, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pixels of an image that may be shadows or people, flat, and what tells of each (`hmc.camera.shade.shade_features`)."""
    _, found = ask_mixture(model.mixture, image, model.coarse)
    zoom = _zoom(image.shape)
    return _shades(model, image, reduced_mask(_seeds(found, zoom), zoom), (slice(None), slice(None)))


def segment(
    model: BackgroundModel, image: np.ndarray | None, settings: SegmentationSettings | None = None
) -> tuple[np.ndarray | None, BackgroundModel]:
    """The people's silhouette in one image, and the model after it.

    Parameters
    ----------
    model : BackgroundModel
        Not to be used again: go on with the one returned.
    image : ndarray of uint8, shape (height, width, 3), or None
        BGR; ``None`` where the camera has no image in this frame.
    settings : SegmentationSettings, optional
        As in training.

    Returns
    -------
    mask : ndarray of bool, shape (height, width), or None
        ``None`` where there is no image or a dark one, and where more than `max_foreground` of it changed at once: the camera does not vote
        in this frame, and, but for dark ones, the background is learnt anew around where people were last. An image that as a whole is
        brighter or darker by one factor in each channel (automatic exposure and white balance, flicker) is brought back first.
    model : BackgroundModel

    Raises
    ------
    InputError
        When the image differs in size from the frames that were learnt.
    """
    settings = settings or SegmentationSettings()
    if image is None:
        return None, model
    if image.shape != model.mean.shape:
        raise InputError(
            f"the image is {image.shape[1]} x {image.shape[0]} pixels, the background {model.mean.shape[1]} x {model.mean.shape[0]}"
        )
    if is_dark(image[FEW], model.mean[FEW][..., 0]):  # nothing is learnt of it
        return None, model
    image = blurred(image, model.blur)
    if model.grey and is_grey(image):
        settings = replace(settings, shadow_factor=settings.grey_shadow_factor, gap_shadow_factor=settings.grey_gap_shadow_factor)
    model.mixture.setShadowThreshold(settings.shadow_factor)
    if model.before is not None and _nearer(image, model.before, model.mean):  # it was a flash
        model.mean[...] = model.before
        model = _with_new_mean(replace(model, before=None))
    image, gains, answer, found = _level(model, image)
    if cv2.countNonZero(found) > settings.max_foreground * found.size:
        return None, _adapt_to_switch(model, image, settings)
    mask, filled, chance, doubtful = _complete(found, cv2.threshold(answer, SHADOW - 1, 1, cv2.THRESH_BINARY)[1], image, model, settings)
    mask = mask.view(bool)
    doubtful = np.bitwise_or(doubtful.view(bool), mask, out=doubtful.view(bool))
    if model.unseen is not None:
        doubtful &= ~model.unseen
    settling = max(0, model.settling - 1)
    told = {"doubtful": doubtful, "filled": filled, "chance": chance, "gains": gains}
    after = replace(model, people=mask, frame=model.frame + 1, settling=settling, **told)
    if not after.settling and after.before is not None:
        after = replace(after, before=None)
    if after.settling or after.frame % settings.learn_every == 0:
        rate = SETTLING_RATE if after.settling else settings.learning_rate
        people = mask if model.unseen is None else mask | model.unseen
        _learn(after, image, _hidden(people, answer, settings), rate, settings)
        after = _with_new_mean(after)
    return mask, after


def empty_image(model: BackgroundModel) -> np.ndarray:
    """The empty scene as an image, BGR, uint8, (h, w, 3)."""
    return as_image(model.mean)


def segment_views(
    models: Sequence[BackgroundModel],
    images: Sequence[np.ndarray | None],
    settings: SegmentationSettings | None = None,
    pool: Executor | None = None,
) -> tuple[tuple[np.ndarray | None, ...], tuple[BackgroundModel, ...]]:
    """`segment` for every camera of a rig.

    Parameters
    ----------
    models, images : sequences, one entry a camera
    settings : SegmentationSettings, optional
    pool : concurrent.futures.Executor, optional
        Threads to spread the cameras over (OpenCV lets them run at once); the result does not depend on it.

    Returns
    -------
    masks : tuple of ndarray of bool, or None, one a camera
    models : tuple of BackgroundModel
    """
    run = map if pool is None else pool.map
    results = list(run(segment, models, images, [settings] * len(models)))
    return tuple(mask for mask, _ in results), tuple(model for _, model in results)


def _level(model: BackgroundModel, image: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray, np.ndarray]:
    """The image in the light of the empty scene, or as it is where that accounts for no less of it; its gains, and `ask_mixture` of it."""
    gains = light_gains(image, model.mean, model.people)
    level = brought_back(image, model.mean, gains)
    answer, found = ask_mixture(model.mixture, level, model.coarse)
    left = cv2.countNonZero(found)
    if level is not image and left > SUSPECT_SHARE * found.size:
        answer_as_is, found_as_is = ask_mixture(model.mixture, image, model.coarse)
        if left > MOST_LEFT * found.size or left >= cv2.countNonZero(found_as_is):
            return image, None, answer_as_is, found_as_is
    return level, gains, answer, found


def _nearer(image: np.ndarray, one: np.ndarray, other: np.ndarray) -> bool:
    """Whether most of an image is nearer to one background than to another."""
    luma = luma_chroma(image[FEW])[..., 0]
    return bool(np.median(np.abs(luma - one[FEW][..., 0])) < np.median(np.abs(luma - other[FEW][..., 0])))


def _complete(
    found: np.ndarray, doubtful: np.ndarray, image: np.ndarray, model: BackgroundModel, settings: SegmentationSettings
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None, np.ndarray]:
    """What the mixture found, cleaned and completed; its `filled` or `chance`; what is doubtful.

    Only the part of the image around what was found is looked at.
    """
    scale, zoom = _scale(image.shape), _zoom(image.shape)
    # The network has learnt from sharp images in color of 640 x 480 and of half of that.
    guesses = settings.least_chance > 0 and zoom <= MOST_ZOOM and not model.blur and not model.grey
    mask = np.zeros_like(found)
    filled, chance = (None, np.zeros_like(found)) if guesses else (np.zeros(found.shape, bool), None)
    # Specks are all over the image; a person has some solid part.
    solid = min(SOLID_PX, max(LEAST_SOLID_PX, round(SOLID_PX * scale)))
    left, top, width, height = cv2.boundingRect(cv2.erode(found, np.ones((solid, solid), np.uint8)))
    if width == 0:
        return mask, filled, chance, np.zeros_like(found)
    margin = round(MARGIN_PX * scale)
    rows = slice(max(0, top - margin), min(top + height + margin, found.shape[0]))
    columns = slice(max(0, left - margin), min(left + width + margin, found.shape[1]))
    box = rows, columns
    seeds = _seeds(found[box], zoom)
    as_read = image[box]
    image = enlarged(as_read, zoom)
    mean, deviation = (one[zoom * rows.start : zoom * rows.stop, zoom * columns.start : zoom * columns.stop] for one in model.large)
    seen = evidence(image, mean, deviation)
    rules = GapRules(
        threshold=settings.gap_threshold,
        reach_threshold=settings.reach_threshold,
        shadow=settings.shadow_factor,
        gap_shadow=settings.gap_shadow_factor,
        least=settings.least_blob_px,
        sure=SURE,
    )
    scale *= zoom
    part = cut_halo(fill_gaps(seeds, seen, rules, scale), seen, settings.halo_share, scale)
    if chance is not None:
        # In the image as it was read: enlarged it shows no more.
        shades = _shades(model, as_read, reduced_mask(seeds, zoom), box, seen if zoom == 1 else None)
        guess = chance[box] = chance_map(as_read.shape[:2], *shades, _scale(found.shape))
        part = told_by_chance(part, seen, guess, settings.least_chance)
        part = cut_halo(without_specks(part, seeds, seen, rules, scale), seen, settings.halo_share, scale)
    elif filled is not None:
        filled[box] = reduced_mask(filled_for_darkness(part, seeds, seen, rules), zoom)
    mask[box] = reduced_mask(part, zoom)
    doubtful[box] |= reduced_mask(((seen.chroma2 > DOUBT**2) | (np.abs(seen.luma) > DOUBT)).view(np.uint8), zoom)
    return mask, filled, chance, cv2.morphologyEx(doubtful, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))


def _seeds(found: np.ndarray, zoom: int) -> np.ndarray:
    """What the mixture found, so many times as wide and high, without specks."""
    return cv2.morphologyEx(enlarged_mask(found, zoom), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))


def _shades(
    model: BackgroundModel, image: np.ndarray, seeds: np.ndarray, box: tuple[slice, slice], seen: Evidence | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The shades of a part of an image, flat, and `hmc.camera.shade.shade_features` of them; `seen` is the evidence, where it is known."""
    mean, deviation, scale = model.mean[box], model.deviation[box], _scale(model.mean.shape)
    seen = evidence(image, mean, deviation, noise_px(scale)) if seen is None else seen
    return shade_features(image, mean, deviation, seen, seeds, scale, None if model.floor is None else model.floor[box])


def _scale(shape: tuple[int, ...]) -> float:
    """Size of images of a shape against 640 x 480."""
    return max(shape[:2]) / 640


def _zoom(shape: tuple[int, ...]) -> int:
    """How many times images of a shape are enlarged before silhouettes are completed."""
    return max(1, round(COMPLETION_PX / max(shape[:2])))


def _enlarged(values: np.ndarray) -> np.ndarray:
    """A map of the empty scene as silhouettes are completed in it; the very map where images are large enough."""
    zoom = _zoom(values.shape)
    return values if zoom == 1 else in_planes(enlarged(values, zoom))


def _hidden(mask: np.ndarray, answer: np.ndarray, settings: SegmentationSettings) -> np.ndarray:
    """Where the scene is not as it is when empty, 1 or 0: around people, and in their shadows."""
    side = 2 * round(settings.keep_out_px * max(mask.shape) / 640) + 1
    hidden = cv2.dilate(mask.view(np.uint8), np.ones((side, side), np.uint8))
    shadow = cv2.inRange(answer, SHADOW, SHADOW)
    shadow = cv2.dilate(cv2.morphologyEx(shadow, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), np.ones((5, 5), np.uint8))
    if cv2.countNonZero(shadow) < MOST_SHADOW * mask.size:  # more is no shadow but light that went down
        hidden[shadow > 0] = 1
    return hidden


def _learn(model: BackgroundModel, image: np.ndarray, hidden: np.ndarray, rate: float, settings: SegmentationSettings) -> None:
    """Let the background take in a share of the image, in place; where it is hidden, it changes as its surroundings do.

    Left as it is while the light drifts, a hidden place would be foreground, be hidden for that, and never be learnt again.
    """
    mean = model.mean
    seen = 1 - hidden
    step = cv2.copyTo(np.subtract(luma_chroma(image), mean, dtype=np.float32, order="C"), seen)
    coarse = (max(1, mean.shape[1] // 8), max(1, mean.shape[0] // 8))
    window = (coarse[0] // 2 + 1, coarse[1] // 2 + 1)
    weight = cv2.blur(cv2.resize(seen.astype(np.float32), coarse, interpolation=cv2.INTER_AREA), window)
    around = cv2.blur(cv2.resize(step, coarse, interpolation=cv2.INTER_AREA), window) / np.maximum(weight, 1e-3)[..., None]
    cv2.copyTo(cv2.resize(around, mean.shape[1::-1]), hidden, step)
    for channel in range(3):
        plane = mean[..., channel]
        cv2.scaleAdd(cv2.extractChannel(step, channel), rate, plane, dst=plane)
    np.maximum(mean[..., 0], 1, out=mean[..., 0])
    # There the mixture is shown the mean, one deviation up and down in turns: shown no noise at all, it would come to expect none.
    turn = 1 if model.frame // settings.learn_every % 2 else -1
    luma = cv2.addWeighted(mean[..., 0], 1, model.deviation[..., 0], turn, 0)
    empty = as_image(cv2.merge([luma, mean[..., 1], mean[..., 2]]))
    cv2.copyTo(image, seen, empty)
    model.mixture.apply(empty, learningRate=rate)


def _adapt_to_switch(model: BackgroundModel, image: np.ndarray, settings: SegmentationSettings) -> BackgroundModel:
    """Take the image for the new background; where people were last, relight the old background as its surroundings were."""
    side = 2 * round(2 * settings.keep_out_px * max(image.shape[:2]) / 640) + 1
    near = cv2.dilate(model.people.view(np.uint8), np.ones((side, side), np.uint8))
    outside = (1 - near)[..., None].astype(np.float32)
    before = model.mean.copy() if model.before is None else model.before
    old = as_image(model.mean).astype(np.float32)
    window = (4 * side + 1, 4 * side + 1)
    gain = (cv2.blur(image * outside, window) + 1e-3) / (cv2.blur(old * outside, window) + 1e-3)
    empty = np.where(near[..., None] > 0, np.clip(old * gain, 0, 255), image).astype(np.uint8)
    model.mean[...] = luma_chroma(empty)
    model.mixture.apply(empty, learningRate=SWITCH_RATE)
    return _with_new_mean(replace(model, frame=model.frame + 1, settling=SETTLING_FRAMES, before=before))


def _with_new_mean(model: BackgroundModel) -> BackgroundModel:
    """The model after its mean has changed."""
    large = (_enlarged(model.mean), model.large[1])
    return replace(model, coarse=coarse(as_image(model.mean)), large=large, changes=model.changes + 1)
