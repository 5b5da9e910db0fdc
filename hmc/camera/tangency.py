"""Where silhouettes end for pairs of cameras: at the same planes through both centres, whatever is seen.

A plane through two cameras' centres that touches a body touches its silhouettes in both images. So of any body, and of all bodies together
that both cameras show whole, the two outermost such planes are the same for both: by how much they differ tells of the calibration and of
the silhouettes' edges, and of nothing else. Only the corners of a silhouette's convex outline can touch them. Source: Sinha, Pollefeys and
McMillan, "Camera network calibration from dynamic silhouettes" (2004), section 3; for cameras whose lenses and places are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.camera.model import Camera, backproject, undistort

__all__ = ["Outlines", "convex_outline", "tangent_misses"]

#: Nearer to the line through two cameras than this, metres, and wider than this as seen along it, radians, bodies are not asked about.
NEAREST_M, WIDEST = 0.7, 2.0
#: Corners this near to the image's border, pixels, are where the image ends.
BORDER_PX = 2


@dataclass(frozen=True)
class Outlines:
    """Convex outlines of the silhouettes of some frames.

    Parameters
    ----------
    rays : ndarray, shape (n_frames, n_cameras, k, 3)
        Directions of the outlines' corners from the camera's centre, world; NaN after the last, and where a camera tells nothing.
    inside : ndarray of bool, shape (n_frames, n_cameras, k)
        Corners that are not where the image ends.
    middles : ndarray, shape (n_frames, 3)
        In the midst of the bodies, metres.
    """

    rays: np.ndarray
    inside: np.ndarray
    middles: np.ndarray


def convex_outline(camera: Camera, silhouette: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The corners of a silhouette's convex outline: their directions from the camera, (k, 3), and which are inside the image, (k,) bool.

    Parameters
    ----------
    camera : Camera
    silhouette : ndarray of bool, shape (height, width)
        Straight lines are straight without the lens's distortion only; the outline is convex there.
    """
    contours, _ = cv2.findContours(silhouette.view(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return np.empty((0, 3)), np.empty(0, bool)
    pixels = np.concatenate(contours)[:, 0].astype(float)
    corners = pixels[cv2.convexHull(undistort(camera, pixels).astype(np.float32), returnPoints=False)[:, 0]]
    last = np.array(silhouette.shape[::-1]) - 1
    inside = ((corners >= BORDER_PX) & (corners <= last - BORDER_PX)).all(axis=1)
    return backproject(camera, corners), inside


def tangent_misses(centres: np.ndarray, outlines: Outlines, pairs: Sequence[tuple[int, int]]) -> np.ndarray:
    """How far apart two cameras have the outermost planes through both that touch what they see.

    Parameters
    ----------
    centres : ndarray, shape (n_cameras, 3)
        Of the cameras, metres.
    outlines : Outlines
    pairs : sequence of pairs of int
        Of cameras.

    Returns
    -------
    ndarray, shape (n_frames, n_pairs, 2)
        Metres in the midst of the bodies, with a sign; NaN where it is not told: something ends at the image's border, or the bodies are
        too near to the line through both cameras.
    """
    misses = np.full((len(outlines.middles), len(pairs), 2), np.nan)
    for place, (one, other) in enumerate(pairs):
        axis = centres[other] - centres[one]
        if not axis.any():
            continue
        axis = axis / np.linalg.norm(axis)
        away = outlines.middles - centres[one]
        away = away - (away @ axis)[:, None] * axis
        reach = np.linalg.norm(away, axis=1)
        away = away / np.maximum(reach, NEAREST_M)[:, None]
        ends = [_ends(outlines, c, away, np.cross(axis, away)) for c in (one, other)]
        misses[:, place] = np.where(reach >= NEAREST_M, reach, np.nan)[:, None] * (ends[0] - ends[1])
    return misses


def _ends(outlines: Outlines, c: int, away: np.ndarray, up: np.ndarray) -> np.ndarray:
    """The least and largest angle about an axis of what a camera on it shows, (n_frames, 2); NaN where it is not told."""
    rays, inside = outlines.rays[:, c], outlines.inside[:, c]
    angles = np.arctan2(np.einsum("nki,ni->nk", rays, up), np.einsum("nki,ni->nk", rays, away))
    there = np.isfinite(angles)
    rows = np.arange(len(angles))
    least, most = np.where(there, angles, np.inf).argmin(axis=1), np.where(there, angles, -np.inf).argmax(axis=1)
    ends = np.stack([np.where(inside[rows, place], angles[rows, place], np.nan) for place in (least, most)], axis=1)
    ends[angles[rows, most] - angles[rows, least] > WIDEST] = np.nan
    return ends
