"""Silhouettes of the people in one camera's images, against a learnt model of the empty scene.

The engine is an adaptive mixture of Gaussians with shadow removal (Canton (2009), section 2.2.3: Stauffer and Grimson's mixture
with Landabaso's shadow test; here OpenCV's MOG2, by Zivkovic). It is trained on frames of the empty scene, then adapts slowly and
never where a person stands.

A model is a state: `train_background` makes one, `segment` takes one and returns the next. One thing inside is not a value: the
OpenCV object that holds the mixture changes when it learns, so a model that was handed to `segment` must not be used again.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import cv2
import numpy as np

from hmc.errors import InputError

__all__ = ["BackgroundModel", "SegmentationSettings", "segment", "segment_views", "train_background"]


@dataclass(frozen=True)
class SegmentationSettings:
    """Parameters of the segmentation.

    Attributes
    ----------
    variance_threshold : float
        Squared distance to a Gaussian, in variances, beyond which a pixel is foreground. 9 loses fewer pale limbs than OpenCV's
        16 (measured on rendered recordings with known silhouettes).
    shadow_factor : float
        A pixel is shadow where it is the background darkened to no less than this share, in each channel alike. OpenCV's is .5;
        .6 keeps more dark clothes (measured likewise).
    learning_rate : float
        Share of a new image in the background each time it learns: slow, after Canton section 2.2.3 ("updated").
    learn_every : int
        Frames from one learning to the next; learning costs as much as segmenting.
    close_px, open_px : int
        Sides of the morphological closing (mends cuts) and opening (removes specks), pixels in a 640 x 480 image; scaled with
        the image.
    max_foreground : float
        Share of the image beyond which the foreground cannot be people: a light was switched. The camera then gives no mask.
    """

    variance_threshold: float = 9.0
    shadow_factor: float = 0.6
    learning_rate: float = 0.02
    learn_every: int = 5
    close_px: int = 7
    open_px: int = 3
    max_foreground: float = 0.5


@dataclass(frozen=True)
class BackgroundModel:
    """What is known of one camera's empty scene.

    Attributes
    ----------
    mixture : cv2.BackgroundSubtractorMOG2
        Changes in place when it learns.
    background : ndarray of uint8, shape (height, width, 3)
        The empty scene as an image.
    frame : int
        Images segmented so far.
    """

    mixture: cv2.BackgroundSubtractorMOG2
    background: np.ndarray
    frame: int = 0


def train_background(frames: Iterable[np.ndarray], settings: SegmentationSettings | None = None) -> BackgroundModel:
    """Learn the empty scene.

    Parameters
    ----------
    frames : iterable of ndarray of uint8, shape (height, width, 3)
        Images without people, one at least.
    settings : SegmentationSettings, optional

    Returns
    -------
    BackgroundModel

    Raises
    ------
    InputError
        When there is no frame.
    """
    settings = settings or SegmentationSettings()
    mixture = cv2.createBackgroundSubtractorMOG2(varThreshold=settings.variance_threshold, detectShadows=True)
    mixture.setShadowThreshold(settings.shadow_factor)
    count = 0
    for count, frame in enumerate(frames, start=1):  # noqa: B007
        mixture.apply(frame, learningRate=1.0 / count)
    if count == 0:
        raise InputError("no background frame to learn from; give some, or a median of the recording")
    return BackgroundModel(mixture, mixture.getBackgroundImage())


def segment(
    model: BackgroundModel, image: np.ndarray | None, settings: SegmentationSettings | None = None
) -> tuple[np.ndarray | None, BackgroundModel]:
    """The people's silhouette in one image, and the model after it.

    Parameters
    ----------
    model : BackgroundModel
        Not to be used again: go on with the one returned.
    image : ndarray of uint8, shape (height, width, 3), or None
        ``None`` where the camera has no image in this frame.
    settings : SegmentationSettings, optional
        As in training.

    Returns
    -------
    mask : ndarray of bool, shape (height, width), or None
        ``None`` where there is no image, or where nearly everything changed at once (a light was switched).
    model : BackgroundModel
    """
    settings = settings or SegmentationSettings()
    if image is None:
        return None, model
    raw = cv2.threshold(model.mixture.apply(image, learningRate=0), 254, 1, cv2.THRESH_BINARY)[1]
    scale = max(image.shape[:2]) / 640
    opening = np.ones((max(1, round(settings.open_px * scale)),) * 2, np.uint8)
    closing = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (max(1, round(settings.close_px * scale)),) * 2)
    mask = cv2.morphologyEx(cv2.morphologyEx(raw, cv2.MORPH_OPEN, opening), cv2.MORPH_CLOSE, closing)
    after = replace(model, frame=model.frame + 1)
    if cv2.countNonZero(mask) > settings.max_foreground * mask.size:
        model.mixture.apply(image, learningRate=0.3)
        return None, replace(after, background=model.mixture.getBackgroundImage())
    if after.frame % settings.learn_every == 0:
        keep = cv2.dilate(mask, np.ones((round(15 * scale),) * 2, np.uint8)).view(bool)
        empty = np.where(keep[..., None], model.background, image)
        model.mixture.apply(empty, learningRate=settings.learning_rate)
        after = replace(after, background=model.mixture.getBackgroundImage())
    return mask.view(bool), after


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
