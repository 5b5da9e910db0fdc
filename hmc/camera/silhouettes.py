"""From the pixels that a background model calls foreground to whole silhouettes: gaps filled, halos cut.

A mixture of Gaussians answers yes or no, and what it misses are parts of people whose color is close to what is behind them: a pale
shirt before a pale wall, a face before bricks. A missing part costs more than a slightly fat outline, since it is cut from the visual
hull. So next to the mixture each pixel has one plain Gaussian in luma and chroma, whose lower thresholds decide where the mixture
already saw something near.

Shadows are told apart as in Canton (2009), section 2.2.3 (Landabaso's rule): the background's color, darkened but not beyond a factor.
In gaps the factor is lower, as between two parts of a person there is rather dark cloth than shadow; but a shadow under a chair lies
between legs too. So what was filled for its darkness alone (`filled_for_darkness`) is a silhouette's doubt, which the other cameras
settle (`hmc.voxels.floor_shadows`).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

__all__ = ["Evidence", "GapRules", "cut_halo", "evidence", "fill_gaps", "filled_for_darkness", "in_planes", "without_specks"]


@dataclass(frozen=True)
class Evidence:
    """How each pixel differs from the empty scene; float32 arrays of one shape (height, width).

    Attributes
    ----------
    luma : ndarray
        Difference in luma, in standard deviations; negative where darker.
    chroma2 : ndarray
        Squared difference in chroma, in variances, after the background was darkened as much as the pixel is: a shadow has none.
    lost : ndarray
        Share of the background's luma that is gone, 0 where the pixel is as bright or brighter.
    contrast : ndarray
        Largest difference in luma or chroma, grey levels.
    """

    luma: np.ndarray
    chroma2: np.ndarray
    lost: np.ndarray
    contrast: np.ndarray


@dataclass(frozen=True)
class GapRules:
    """How much weaker evidence is enough next to what is sure to be foreground.

    Parameters
    ----------
    threshold : float
        Standard deviations that are enough in gaps and bays of the seeds.
    reach_threshold : float
        Standard deviations that are enough outside of them, within reach.
    shadow, gap_shadow : float
        Darkening above which a pixel may be shadow: anywhere, and in gaps, where it is rather dark clothes.
    least : float
        Pixels of the seeds that a piece must hold, in a 640 x 480 image; others are specks.
    sure : float
        Only those pixels of the seeds count for `least` that the evidence puts so many standard deviations off, in luma or in chroma.
    """

    threshold: float
    reach_threshold: float
    shadow: float
    gap_shadow: float
    least: float
    sure: float = 0.0


def evidence(image: np.ndarray, mean: np.ndarray, deviation: np.ndarray, noise_px: int = 3) -> Evidence:
    """Compare an image with a Gaussian a pixel.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        BGR.
    mean : ndarray of float32, shape (height, width, 3)
        The empty scene in luma and chroma (OpenCV's YCrCb, chroma centred on 128); luma at least 1.
    deviation : ndarray of float32, shape (height, width, 2)
        Standard deviations of luma and of chroma (both axes alike). Quickest where each channel of both lies in one piece (`in_planes`).
    noise_px : int
        Side of the Gaussian that takes noise away, odd: noise is rougher than people, and three pixels halve it.

    Returns
    -------
    Evidence
    """
    color = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)
    # Plane by plane: `cv2.split` takes several times longer of a part of an image.
    luma, red, blue = (
        cv2.GaussianBlur(np.subtract(cv2.extractChannel(color, channel), mean[..., channel], dtype=np.float32), (noise_px, noise_px), 0)
        for channel in range(3)
    )
    contrast, spare = np.abs(luma), np.abs(red)
    np.maximum(contrast, spare, out=contrast)
    np.maximum(contrast, np.abs(blue, out=spare), out=contrast)
    lost = np.divide(luma, mean[..., 0])
    np.negative(np.clip(lost, -1, 0, out=lost), out=lost)
    for chroma, channel in ((red, 1), (blue, 2)):  # chroma shrinks with the light
        np.subtract(mean[..., channel], 128, out=spare)
        np.add(chroma, np.multiply(spare, lost, out=spare), out=chroma)
        np.multiply(chroma, chroma, out=chroma)
    np.multiply(deviation[..., 1], deviation[..., 1], out=spare)
    chroma2 = np.divide(np.add(red, blue, out=red), spare, out=red)
    return Evidence(np.divide(luma, deviation[..., 0], out=luma), chroma2, lost, contrast)


def in_planes(array: np.ndarray) -> np.ndarray:
    """The same values, (height, width, channels), with each channel's in one piece of memory."""
    return np.moveaxis(np.ascontiguousarray(np.moveaxis(array, -1, 0)), 0, -1)


def fill_gaps(seeds: np.ndarray, seen: Evidence, rules: GapRules, scale: float) -> np.ndarray:
    """Grow a foreground mask by weaker evidence: inside its gaps, and outwards over a short reach.

    Parameters
    ----------
    seeds : ndarray of uint8, shape (height, width)
        1 where the mixture sees foreground.
    seen : Evidence
    rules : GapRules
    scale : float
        Size of the image against 640 x 480.

    Returns
    -------
    ndarray of uint8, shape (height, width)
        Every piece holds `rules.least` pixels of the seeds.
    """
    gap, reach = _square(GAP_PX, scale), _square(REACH_PX, scale)
    near = cv2.dilate(seeds, gap)
    inner = cv2.erode(near, gap).view(bool)
    outer = cv2.dilate(near, reach[len(gap) - 1 :, len(gap) - 1 :]).view(bool)  # two squares in turn reach as far as their sum
    dark = seen.luma < -rules.threshold
    weak = (seen.chroma2 > rules.threshold**2) | (seen.luma > rules.threshold) | (dark & (seen.lost > 1 - rules.gap_shadow))
    far = rules.reach_threshold
    reached = (seen.chroma2 > far**2) | (seen.luma > far) | (dark & (seen.lost > 1 - rules.shadow))
    grown = cv2.morphologyEx((reached & outer).view(np.uint8), cv2.MORPH_OPEN, _square(3, scale))
    mask = cv2.bitwise_or(cv2.bitwise_or(seeds, (weak & inner).view(np.uint8)), grown)
    mask = cv2.morphologyEx(mask, cv2.MORPH_OPEN, _square(3, scale))
    # What is seen between two parts of a person may lie in their shadow: over a wide cut, darkness alone tells nothing.
    differs = ((seen.chroma2 > CUT_THRESHOLD**2) | (seen.luma > CUT_THRESHOLD)).view(np.uint8)
    cuts = cv2.bitwise_and(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(CLOSE_PX, scale)), differs)
    mask = cv2.bitwise_or(mask, cuts)
    return without_specks(mask, seeds, seen, rules, scale)


def without_specks(mask: np.ndarray, seeds: np.ndarray, seen: Evidence, rules: GapRules, scale: float) -> np.ndarray:
    """A mask with its slits closed, of those pieces that hold `rules.least` pixels of the seeds.

    Parameters
    ----------
    mask, seeds : ndarray of uint8, shape (height, width)
    seen, rules, scale
        As for `fill_gaps`.

    Returns
    -------
    ndarray of uint8, shape (height, width)
    """
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(SLIT_PX, scale))
    n, labels = cv2.connectedComponents(mask, connectivity=8)
    told = np.flatnonzero(seeds.view(bool))
    if rules.sure > 0:
        told = told[(seen.chroma2.ravel()[told] > rules.sure**2) | (np.abs(seen.luma.ravel()[told]) > rules.sure)]
    counts = np.bincount(np.asarray(labels).ravel()[told], minlength=n)
    kept = (counts >= rules.least * scale**2).view(np.uint8)
    if kept[1:].all():
        return mask
    kept[0] = 0
    return np.take(kept, np.asarray(labels))


def filled_for_darkness(mask: np.ndarray, seeds: np.ndarray, seen: Evidence, rules: GapRules) -> np.ndarray:
    """Pixels of a filled mask that are no seeds and of which no more is known than that they are darker, as shadows are.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
        As `fill_gaps` returns it, or a part of that.
    seeds, seen, rules
        As for `fill_gaps`.

    Returns
    -------
    ndarray of uint8, shape (height, width)
    """
    sure = (seen.chroma2 > rules.threshold**2) | (seen.luma > rules.threshold) | (seen.lost > 1 - rules.shadow)
    return mask & (1 - (sure.view(np.uint8) | seeds))


def cut_halo(mask: np.ndarray, seen: Evidence, share: float, scale: float) -> np.ndarray:
    """Take the rim of mixed pixels off a mask.

    A pixel on the outline is part person, part background: with contrast ``alpha`` times that of the person beside it. Video
    compression spreads it over two pixels, which low thresholds take for foreground.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
    seen : Evidence
    share : float
        Least alpha to stay, between 0 (nothing is cut) and 1.
    scale : float
        Size of the image against 640 x 480.

    Returns
    -------
    ndarray of uint8, shape (height, width)
    """
    if share <= 0:
        return mask
    person = cv2.dilate(cv2.copyTo(seen.contrast, mask), _square(5, scale))
    core = cv2.erode(mask, _square(5, scale))
    return cv2.bitwise_or(core, cv2.bitwise_and(mask, (seen.contrast > share * person).view(np.uint8)))


#: Widths in pixels of a 640 x 480 image: gaps that may be filled on weak evidence, twice the outward reach, cuts closed where color or
#: light differ by so many standard deviations, and slits closed blindly.
GAP_PX = 25
REACH_PX = 41
CLOSE_PX = 7
CUT_THRESHOLD = 3.0
SLIT_PX = 3


def _square(width: float, scale: float) -> np.ndarray:
    side = 2 * round((width * scale - 1) / 2) + 1
    return np.ones((max(3, side),) * 2, np.uint8)


def _disc(width: float, scale: float) -> np.ndarray:
    side = 2 * round((width * scale - 1) / 2) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (max(3, side),) * 2)
