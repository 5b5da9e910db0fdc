"""Errors of landmarks without what is constant in them: each landmark's offset in the frame of the trunk.

Two systems that define a joint differently (the hip a few centimetres higher, say) disagree by a vector that goes with the body, whatever
the body does. Expressed in the trunk's frame it is constant, and taken off it leaves what changes from frame to frame. A constant is not
harmless for that: a mistake that is made in every frame, such as a trunk fitted too short, is constant too, and in a clip in which a
person hardly moves every mistake is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.errors import InputError
from hmc.landmarks import LANDMARKS, landmark_index
from hmc.metrics.landmarks import landmark_errors

__all__ = ["LEAST_FRAMES", "TRUNK", "OffsetErrors", "constant_offsets", "trunk_frames"]

#: A landmark that is compared in fewer frames has no offset: a constant taken from few frames explains them whatever they are.
LEAST_FRAMES = 10
#: The landmarks that the trunk's frame is made of.
TRUNK = ("pelvis", "neck", "l_hip", "r_hip", "l_shoulder", "r_shoulder")
#: Where the line across the trunk is closer to the line along it, the landmarks do not show where forward is.
LEAST_ASIDE_RAD = np.radians(10)


@dataclass(frozen=True)
class OffsetErrors:
    """Errors of one person's landmarks, as they are and without each landmark's offset.

    Attributes
    ----------
    offsets : ndarray, shape (15, 3)
        Estimate minus truth, forward, left and up along the true trunk, metres: the component-wise median over frames. NaN where fewer
        frames than asked for can be compared.
    errors, remaining : ndarray, shape (n_frames, 15)
        Distances from the truth as estimated, and after the offset is taken off, metres. NaN in both where a landmark is not compared or
        has no offset, so that both are of the same landmarks and frames.
    compared : ndarray of int, shape (15,)
        Frames in which each landmark can be compared, be they enough or not.
    missing, flat : ndarray of bool, shape (n_frames,)
        Frames with something to compare that are left out, as the truth lacks a landmark of the trunk, or has the trunk's all in a line.
    """

    offsets: np.ndarray
    errors: np.ndarray
    remaining: np.ndarray
    compared: np.ndarray
    missing: np.ndarray
    flat: np.ndarray


def trunk_frames(points: np.ndarray) -> np.ndarray:
    """The trunk's frame: x forward, y to the person's left, z from the pelvis to the neck.

    The line across is the sum of those from the right hip and shoulder to the left ones: half-way between pelvis and chest where the
    spine is twisted. It is made perpendicular to z.

    Parameters
    ----------
    points : ndarray, shape (..., 15, 3)
        In the order of `hmc.landmarks.LANDMARKS`, in any right-handed frame; NaN where missing.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Rotations whose columns are forward, left and up. NaN where a landmark of `TRUNK` is missing, or the line across is within
        `LEAST_ASIDE_RAD` of z.

    Raises
    ------
    InputError
        When the shape is another.
    """
    points = np.asarray(points, float)
    if points.ndim < 2 or points.shape[-2:] != (len(LANDMARKS), 3):
        raise InputError(f"`points` must be (..., {len(LANDMARKS)}, 3); got {points.shape}")
    pelvis, neck, l_hip, r_hip, l_shoulder, r_shoulder = (points[..., landmark_index(name), :] for name in TRUNK)
    up, _ = _unit(neck - pelvis)
    line, _ = _unit((l_hip - r_hip) + (l_shoulder - r_shoulder))
    left, aside = _unit(line - (line * up).sum(axis=-1, keepdims=True) * up)
    frames = np.stack([np.cross(left, up), left, up], axis=-1)
    # A comparison with NaN is false: what is missing is left out here too.
    return np.where((aside > np.sin(LEAST_ASIDE_RAD))[..., None, None], frames, np.nan)


def constant_offsets(estimate: np.ndarray, truth: np.ndarray, least_frames: int = LEAST_FRAMES) -> OffsetErrors:
    """The constant part of one person's landmark errors, and the errors without it.

    The offset is the median, component by component: a limb that is lost in less than half of the frames leaves it where it was, and a mean
    would go with it. It comes of the frames that it is then taken off (in-sample), which flatters what remains: noise alone has some
    median, the longer the fewer the frames and the more alike they are. As the component-wise median is not the point from which the mean
    distance is least, errors without any constant part may also come out a little larger.

    Parameters
    ----------
    estimate, truth : ndarray, shape (n_frames, 15, 3)
        Metres; NaN where missing. The trunk is the truth's.
    least_frames : int
        A landmark that can be compared in fewer frames has no offset and does not count.

    Returns
    -------
    OffsetErrors

    Raises
    ------
    InputError
        When the shapes differ, or are others.
    """
    errors = landmark_errors(estimate, truth)
    truth = np.asarray(truth, float)
    frames = trunk_frames(truth)
    known = ~np.isnan(frames).any(axis=(1, 2))
    whole = ~np.isnan(truth[:, [landmark_index(name) for name in TRUNK]]).any(axis=(1, 2))
    something = np.isfinite(errors).any(axis=1)
    counts = np.isfinite(errors) & known[:, None]
    compared = counts.sum(axis=0)
    counts &= compared >= max(least_frames, 1)
    vectors = np.einsum("fji,fkj->fki", frames, np.asarray(estimate, float) - truth)
    offsets = np.full((len(LANDMARKS), 3), np.nan)
    for place in np.flatnonzero(counts.any(axis=0)):
        offsets[place] = np.median(vectors[counts[:, place], place], axis=0)
    # Turned back into the world or not, what remains is as long.
    remaining = np.linalg.norm(vectors - offsets, axis=-1)
    return OffsetErrors(
        offsets,
        np.where(counts, errors, np.nan),
        np.where(counts, remaining, np.nan),
        compared,
        missing=something & ~whole,
        flat=something & whole & ~known,
    )


def _unit(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors, NaN of a zero one, and the lengths, shape (...)."""
    length = np.linalg.norm(vectors, axis=-1)
    return vectors / np.where(length > 1e-9, length, np.nan)[..., None], length
