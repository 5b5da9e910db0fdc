"""Detections that lie beside everybody: a detector that took something else for a person, or put a person where nobody is.

A keypoint lies on a person, so on the camera's silhouette, but for what the silhouette has lost. A detection with more than a few sure
keypoints beside all silhouettes, most of whose lines of sight do not meet those of other cameras either, is of nobody. Where cameras agree
it is the silhouette that is wrong; and where no other camera has seen the person there is nothing to hold the detection against, and it
stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np

from hmc.camera.model import Rig
from hmc.pose.views.line_meeting import MEET, passing

if TYPE_CHECKING:
    from hmc.pose.views.keypoints import PersonLines

__all__ = ["off_people"]

#: A keypoint this near a silhouette is on it, metres at the person's distance: half of a joint's width, and what a silhouette loses.
NEAR_M = 0.08
#: Keypoints that are sure, and how many of them a detection has to have in the image to be judged.
SURE, LEAST_SURE = 0.5, 6
#: Detections of people have nearly all sure keypoints on silhouettes (the poorest .93 in a real room); displaced ones .87 at most.
LEAST_ON = 0.9
#: A detection agrees with other cameras where this share of its lines meet theirs.
AGREES = 0.5


def off_people(rig: Rig, own: PersonLines, points: np.ndarray, place: np.ndarray, masks: Sequence[np.ndarray | None]) -> np.ndarray:
    """Which cameras' detections of a person are on no silhouette, and meet no other camera's.

    Parameters
    ----------
    rig : Rig
    own : PersonLines
        With left and right as they are.
    points : ndarray, shape (15, 3)
        Where its lines meet, world, metres; NaN where no two do.
    place : ndarray, shape (3,)
        Where the person is tracked, world, metres.
    masks : sequence of ndarray of bool, shape (height, width), or None
        Silhouettes of everybody, one a camera; a camera without is not judged.

    Returns
    -------
    ndarray of bool, shape (n_cameras,)
    """
    given = own.confidence > 0
    off = passing(points, rig.centres, np.nan_to_num(own.directions)) / own.deviation_m  # NaN, and so no meeting, without a point
    meets, told = given & (off < MEET), given & (given.sum(axis=0) > 1)
    apart = told.any(axis=1) & (meets.sum(axis=1) < AGREES * told.sum(axis=1))
    out = np.zeros(len(rig), bool)
    for c in np.flatnonzero(apart).tolist():
        mask, camera = masks[c], rig[c]
        if mask is not None:
            depth = float(place @ camera.rotation[2] + camera.translation[2])
            sure = own.pixels[c][own.confidence[c] >= SURE]
            out[c] = _share_on(mask, sure, NEAR_M * camera.matrix[0, 0] / max(depth, NEAR_M)) < LEAST_ON
    return out


def _share_on(mask: np.ndarray, pixels: np.ndarray, near_px: float) -> float:
    """Of pixels (n, 2) in the image, how many are as near as that to a silhouette; 1 of too few."""
    column, row = np.round(pixels).astype(int).T
    inside = (column >= 0) & (column < mask.shape[1]) & (row >= 0) & (row < mask.shape[0])
    if inside.sum() < LEAST_SURE:
        return 1.0
    distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    return float((distance[row[inside], column[inside]] < near_px).mean())
