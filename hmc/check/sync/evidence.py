"""How little each two cameras agree when one is taken some frames later: by silhouettes and, where there are some, by keypoints."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.camera.epipolar import epipolar_lines, fundamental_matrices, undistorted_pixels
from hmc.camera.model import Rig
from hmc.camera.reduction import reduce_mask, reduced_camera
from hmc.check.sync.barcodes import barcode, shared_planes, unlikeness
from hmc.io.keypoints import KeypointSource

__all__ = ["Evidence", "Packed", "by_keypoints", "by_silhouettes", "combined", "pack", "unpack"]

#: Silhouettes' longer side is made no longer than this, pixels: planes are told apart by fractions of a degree then.
SIDE_PX = 360
#: Keypoints further than this from each other's epipolar lines are as bad as any, pixels of an image 640 wide.
FAR_PX = 25.0
#: Keypoints below this confidence are left out, and moments with fewer.
LEAST_CONFIDENCE, LEAST_JOINTS = 0.3, 5
#: Curves over shifts are of so many comparisons at least, and of this share of the moments.
LEAST_MOMENTS, LEAST_SHARE = 16, 0.25

#: A silhouette's shape and its pixels, eight a byte; None where there is none.
Packed = tuple[tuple[int, int], np.ndarray] | None


@dataclass(frozen=True, eq=False)
class Evidence:
    """What speaks against each shift of each pair of cameras, moment by moment.

    Parameters
    ----------
    n_cameras, n_moments, reach : int
        Shifts are from -reach to reach frames.
    bands : dict from (int, int) to ndarray of float32, shape (n_moments, 2 * reach + 1)
        Of cameras i < j: how unlike frame t of i and frame t + k - reach of j are, from 0 to 1; NaN where that cannot be told.
    """

    n_cameras: int
    n_moments: int
    reach: int
    bands: dict[tuple[int, int], np.ndarray]

    def curves(self, moments: np.ndarray | None = None) -> np.ndarray:
        """The mean over moments, shape (n, n, 2 * reach + 1): entry (i, j, k) is of i at t and j at t + k - reach; NaN where too few."""
        size = 2 * self.reach + 1
        result = np.full((self.n_cameras, self.n_cameras, size), np.nan)
        least = max(LEAST_MOMENTS, LEAST_SHARE * self.n_moments) if moments is None else 1
        for (i, j), band in self.bands.items():
            rows = band if moments is None else band[moments]
            known = np.isfinite(rows)
            n = known.sum(axis=0)
            curve = np.where(n >= least, np.where(known, rows, 0).sum(axis=0) / np.maximum(n, 1), np.nan)
            result[i, j], result[j, i] = curve, curve[::-1]
        return result


def pack(masks: Sequence[np.ndarray | None], rig: Rig) -> list[Packed]:
    """Silhouettes of one moment, one a camera, made small and kept as bits."""
    packed: list[Packed] = []
    for mask, camera in zip(masks, rig, strict=True):
        if mask is None:
            packed.append(None)
        else:
            small = reduce_mask(mask, small_factor(camera.size))
            packed.append((small.shape, np.packbits(small)))  # type: ignore[arg-type]
    return packed


def unpack(packed: Packed) -> np.ndarray | None:
    """The silhouette that was packed, (h, w) bool."""
    if packed is None:
        return None
    shape, bits = packed
    return np.unpackbits(bits, count=shape[0] * shape[1]).reshape(shape).view(bool)


def small_factor(size: tuple[int, int]) -> int:
    """How many times smaller silhouettes are kept."""
    return max(1, round(max(size) / SIDE_PX))


def small_rig(rig: Rig) -> Rig:
    """The cameras of packed silhouettes."""
    return Rig(tuple(reduced_camera(camera, small_factor(camera.size)) for camera in rig))


def by_silhouettes(rig: Rig, packed: Sequence[Sequence[Packed]], reach: int) -> Evidence:
    """By epipolar planes that cut silhouettes (`hmc.check.sync.barcodes`).

    Parameters
    ----------
    rig : Rig
        Of the recording's images.
    packed : sequence (moments) of sequence (cameras)
        As from `pack`, of frames that follow one another.
    reach : int

    Returns
    -------
    Evidence
    """
    small = small_rig(rig)
    pairs = list(itertools.combinations(range(len(rig)), 2))
    shared = {pair: shared_planes(small, pair) for pair in pairs}
    rows: dict[tuple[int, int], np.ndarray] = {}
    for c in range(len(rig)):
        masks = [unpack(moment[c]) for moment in packed]
        for (i, j), planes in shared.items():
            if planes is not None and c in (i, j):
                rows[(i, j) if c == i else (j, i)] = barcode(masks, planes[0] if c == i else planes[1], planes[2])
    bands = {(i, j): banded(unlikeness(rows[i, j], rows[j, i]), reach) for i, j in pairs if (i, j) in rows}
    return Evidence(len(rig), len(packed), reach, bands)


def by_keypoints(rig: Rig, keypoints: KeypointSource, first: int, n: int, reach: int) -> Evidence:
    """By how far keypoints are from each other's epipolar lines, of whoever in an image has most of them.

    Parameters
    ----------
    rig : Rig
    keypoints : KeypointSource
    first, n : int
        Frames of the recording.
    reach : int

    Returns
    -------
    Evidence
    """
    points = np.full((len(rig), n, 26, 2), np.nan)
    for k in range(n):
        for c, people in enumerate(keypoints.frame(first + k)):
            if len(people):
                best = people[people[..., 2].sum(axis=1).argmax()]
                points[c, k] = np.where(best[:, 2:] >= LEAST_CONFIDENCE, best[:, :2], np.nan)
    for c, camera in enumerate(rig):
        known = np.isfinite(points[c]).all(axis=-1)
        points[c][known] = undistorted_pixels(camera, points[c][known])
    fundamental = fundamental_matrices(rig)
    bands = {}
    for i, j in itertools.combinations(range(len(rig)), 2):
        far = FAR_PX * (max(rig[i].size) + max(rig[j].size)) / 1280
        distances = np.full((n, n), np.nan, np.float32)
        there, back = epipolar_lines(fundamental[i, j], points[i]), epipolar_lines(fundamental[j, i], points[j])
        for t in range(n):
            low, high = max(0, t - reach), min(n, t + reach + 1)
            one = np.abs((there[t, :, :2] * points[j, low:high]).sum(axis=-1) + there[t, :, 2])
            other = np.abs((back[low:high, :, :2] * points[i, t]).sum(axis=-1) + back[low:high, :, 2])
            both = np.minimum(np.maximum(one, other) / far, 1)
            known = np.isfinite(both)
            number = known.sum(axis=-1)
            mean = np.where(known, both, 0).sum(axis=-1) / np.maximum(number, 1)
            distances[t, low:high] = np.where(number >= LEAST_JOINTS, mean, np.nan)
        bands[i, j] = banded(distances, reach)
    return Evidence(len(rig), n, reach, bands)


def combined(parts: Sequence[Evidence]) -> Evidence:
    """Several kinds of evidence in one: each band against its own usual value, and their mean where both are known."""
    first = parts[0]
    bands: dict[tuple[int, int], np.ndarray] = {}
    for pair in sorted({pair for part in parts for pair in part.bands}):
        own = [part.bands[pair] for part in parts if pair in part.bands and np.isfinite(part.bands[pair]).any()]
        if own:
            stack = np.stack(own)
            known = np.isfinite(stack)
            n = known.sum(axis=0)
            bands[pair] = np.where(n > 0, np.where(known, stack, 0).sum(axis=0) / np.maximum(n, 1), np.nan).astype(np.float32)
    return Evidence(first.n_cameras, first.n_moments, first.reach, bands)


def banded(matrix: np.ndarray, reach: int) -> np.ndarray:
    """The diagonals of a square matrix, (n, n) to (n, 2 * reach + 1): entry (t, k) is (t, t + k - reach), NaN outside."""
    n = len(matrix)
    padded = np.full((n, n + 2 * reach), np.nan, np.float32)
    padded[:, reach : reach + n] = matrix
    return np.stack([padded[t, t : t + 2 * reach + 1] for t in range(n)])
