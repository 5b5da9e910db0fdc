"""How alike what two cameras see is, over time, by epipolar planes alone: no hull, and only two cameras are needed.

A plane through both cameras' centres cuts a person in both views or in none. Which planes do is a row of bits, one a plane, for each
moment of each camera; two rows of one moment are equal but for noise, of whatever shape the people are. The ends of the rows are the
epipolar tangents of Sinha and Pollefeys (2004, "Synchronization and calibration of camera networks from silhouettes"); rows over time are
the motion barcodes of Ben-Artzi et al. (2016, "Camera calibration from dynamic silhouettes using motion barcodes").
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.camera.model import Camera, Rig, undistort

__all__ = ["barcode", "shared_planes", "unlikeness"]

#: Cameras nearer to each other than this share of the usual distance from the cameras' middle have no planes to speak of.
LEAST_BASELINE = 0.01
#: A row with fewer planes that cut a person tells nothing.
LEAST_PLANES = 8


def shared_planes(rig: Rig, pair: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, int] | None:
    """Planes through two cameras' centres that both can see.

    Parameters
    ----------
    rig : Rig
    pair : (int, int)
        Two cameras, by their places in the rig.

    Returns
    -------
    (index, index, n) or None
        For either camera the plane of each pixel, (h, w) int, -1 where the other camera does not see it, and how many planes there are;
        None where the cameras stand in one place or share no plane.
    """
    one, other = pair
    baseline = rig[other].centre - rig[one].centre
    length = float(np.linalg.norm(baseline))
    usual = float(np.median(np.linalg.norm(rig.centres - rig.centres.mean(axis=0), axis=1)))
    if length <= LEAST_BASELINE * usual:
        return None
    across = np.linalg.svd(baseline[None] / length)[2][1:]
    angles = [_plane_angles(rig[c], across) for c in pair]
    # Planes lie as far apart as neighbouring pixels do in the coarser view.
    step = max(float(np.median(np.abs(_wrapped(np.diff(angle, axis=axis))))) for angle in angles for axis in (0, 1))
    places = [np.floor((angle + np.pi) / step).astype(int) for angle in angles]
    common = np.intersect1d(places[0], places[1])
    if len(common) < LEAST_PLANES:
        return None
    index = np.full(int(np.ceil(2 * np.pi / step)) + 2, -1)
    index[common] = np.arange(len(common))
    return index[places[0]], index[places[1]], len(common)


def _plane_angles(camera: Camera, across: np.ndarray) -> np.ndarray:
    """The angle about the baseline of the half plane in which each pixel's ray lies, (h, w), radians."""
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    normalised = undistort(camera, np.stack([u, v], axis=-1).reshape(-1, 2).astype(float))
    rays = np.column_stack([normalised, np.ones(len(normalised))]) @ camera.rotation
    return np.arctan2(rays @ across[1], rays @ across[0]).reshape(height, width)


def _wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


def barcode(masks: Sequence[np.ndarray | None], index: np.ndarray, n: int) -> np.ndarray:
    """Which planes cut one camera's silhouettes.

    Parameters
    ----------
    masks : sequence (moments) of ndarray of bool, shape (h, w), or None
    index, n
        As from `shared_planes`.

    Returns
    -------
    ndarray of bool, shape (moments, n)
    """
    rows = np.zeros((len(masks), n), bool)
    for row, mask in zip(rows, masks, strict=True):
        if mask is not None:
            hit = index[mask]
            row[hit[hit >= 0]] = True
    # Pixels leave gaps between planes where these are close.
    wide = rows.copy()
    wide[:, 1:] |= rows[:, :-1]
    wide[:, :-1] |= rows[:, 1:]
    closed = wide.copy()
    closed[:, 1:] &= wide[:, :-1]
    closed[:, :-1] &= wide[:, 1:]
    return closed | rows


def unlikeness(first: np.ndarray, second: np.ndarray, least: int = LEAST_PLANES) -> np.ndarray:
    """One minus what rows have in common, as a share of what either has (Jaccard distance), of all moments of both.

    Parameters
    ----------
    first, second : ndarray of bool, shape (n, planes) and (m, planes)
        Or of anything else that is there or not, such as pixels.
    least : int
        Rows with less tell nothing.

    Returns
    -------
    ndarray of float32, shape (n, m)
        From 0, alike, to 1; NaN where a row has too little.
    """
    one, other = first.astype(np.float32), second.astype(np.float32)
    n, m = one.sum(axis=1), other.sum(axis=1)
    common = one @ other.T
    result = 1 - common / np.maximum(n[:, None] + m - common, 1)
    result[n < least] = np.nan
    result[:, m < least] = np.nan
    return result
