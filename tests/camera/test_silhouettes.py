"""Evidence and filled gaps against the same rules in plain NumPy and SciPy."""

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import ndimage

from hmc.camera.silhouettes import (
    CLOSE_PX,
    CUT_THRESHOLD,
    GAP_PX,
    REACH_PX,
    SLIT_PX,
    Evidence,
    GapRules,
    evidence,
    fill_gaps,
    filled_for_darkness,
)

RULES = GapRules(threshold=4.0, reach_threshold=5.0, shadow=0.6, gap_shadow=0.7, least=40)


def scene(seed: int, height: int = 90, width: int = 70) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An image, and mean and deviation of the empty scene, as parts of larger arrays."""
    rng = np.random.default_rng(seed)
    image = rng.integers(0, 256, (height + 20, width + 20, 3), dtype=np.uint8)
    mean = rng.uniform(1, 255, image.shape).astype(np.float32)
    deviation = rng.uniform(1, 6, (*image.shape[:2], 2)).astype(np.float32)
    part = slice(7, 7 + height), slice(11, 11 + width)
    return image[part], mean[part], deviation[part]


def blobs(rng: np.random.Generator, shape: tuple[int, int], share: float, size: float = 3) -> np.ndarray:
    """Random patches over a share of the image, up to its borders."""
    noise = ndimage.gaussian_filter(rng.normal(size=shape), size)
    return noise > np.quantile(noise, 1 - share)


@pytest.mark.parametrize("seed", range(3))
def test_evidence_follows_its_definition(seed):
    image, mean, deviation = scene(seed)
    before = [array.copy() for array in (image, mean, deviation)]
    seen = evidence(image, mean, deviation)
    kernel = np.outer([1, 2, 1], [1, 2, 1]) / 16
    difference = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb).astype(float) - mean
    luma, red, blue = (ndimage.convolve(difference[..., k], kernel, mode="mirror") for k in range(3))
    lost = np.clip(-luma / mean[..., 0], 0, 1)
    chroma2 = sum((c + lost * (mean[..., k] - 128)) ** 2 for c, k in ((red, 1), (blue, 2))) / deviation[..., 1] ** 2
    assert_allclose(seen.luma, luma / deviation[..., 0], atol=1e-3)
    assert_allclose(seen.lost, lost, atol=1e-5)
    assert_allclose(seen.chroma2, chroma2, rtol=1e-4, atol=1e-2)
    assert_allclose(seen.contrast, np.abs([luma, red, blue]).max(0), atol=1e-3)
    for array, old in zip((image, mean, deviation), before, strict=True):
        assert_array_equal(array, old)


@pytest.mark.parametrize("scale", [0.05, 0.5, 1.0, 1.6])
@pytest.mark.parametrize("seed", range(4))
def test_filled_gaps_follow_their_definition(seed, scale):
    rng = np.random.default_rng(seed)
    shape = (150, 120)
    seeds = blobs(rng, shape, 0.05) & (rng.random(shape) < 0.9)
    luma = rng.normal(0, 2, shape) + 9 * blobs(rng, shape, 0.2) - 9 * blobs(rng, shape, 0.2)
    chroma2 = rng.uniform(0, 12, shape) + 40 * blobs(rng, shape, 0.2)
    seen = Evidence(*(a.astype(np.float32) for a in (luma, chroma2, rng.random(shape), np.abs(luma))))
    found = fill_gaps(seeds.astype(np.uint8), seen, RULES, scale)
    expected = filled(seeds, seen, scale)
    assert_array_equal(found, expected)
    assert 0 < expected.sum() < expected.size


def filled(seeds: np.ndarray, seen: Evidence, scale: float) -> np.ndarray:
    def square(width):
        return np.ones((max(3, 2 * round((width * scale - 1) / 2) + 1),) * 2, bool)

    def grow(mask, element):
        return ndimage.binary_dilation(mask, element)

    def shrink(mask, element):
        return ndimage.binary_erosion(mask, element, border_value=1)

    def strong(threshold, shadow):
        bright = (seen.chroma2 > threshold**2) | (seen.luma > threshold)
        return bright | ((seen.luma < -RULES.threshold) & (seen.lost > 1 - shadow))

    three = square(3)

    def closed(mask, width):
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, square(width).shape).astype(bool)
        return shrink(grow(mask, disc), disc)

    in_gaps = strong(RULES.threshold, RULES.gap_shadow) & shrink(grow(seeds, square(GAP_PX)), square(GAP_PX))
    outwards = strong(RULES.reach_threshold, RULES.shadow) & grow(seeds, square(REACH_PX))
    mask = seeds | in_gaps | grow(shrink(outwards, three), three)
    mask = grow(shrink(mask, three), three)
    mask |= closed(mask, CLOSE_PX) & ((seen.chroma2 > CUT_THRESHOLD**2) | (seen.luma > CUT_THRESHOLD))
    mask = closed(mask, SLIT_PX)
    labels, n = ndimage.label(mask, np.ones((3, 3)))
    return np.isin(labels, [k for k in range(1, n + 1) if (seeds & (labels == k)).sum() >= RULES.least * scale**2])


def test_between_two_legs_their_shadow_stays_out_and_dim_cloth_in_a_gap_is_told_as_filled():
    """Two legs of three pixels' distance; between them a shadow, or the same darkness in another color; and a band across one of them."""
    shape = (120, 100)
    seeds: np.ndarray = np.zeros(shape, np.uint8)
    seeds[10:110, 30:48] = seeds[10:110, 53:71] = 1
    seeds[50:60, 30:48] = 0
    luma, chroma2, lost = (np.zeros(shape, np.float32) for _ in range(3))
    between = np.zeros(shape, bool)
    between[20:100, 48:53] = True
    luma[between], lost[between] = -9, 0.15
    band = np.zeros(shape, bool)
    band[50:60, 30:48] = True
    luma[band], lost[band] = -9, 0.35
    luma[seeds > 0], chroma2[seeds > 0], lost[seeds > 0] = -20, 99, 0.7
    seen = Evidence(luma, chroma2, lost, np.abs(luma))
    mask = fill_gaps(seeds, seen, RULES, 1.0)
    assert mask[between].mean() < 0.1 and mask[band].mean() > 0.95
    told = filled_for_darkness(mask, seeds, seen, RULES)
    assert told[band].mean() > 0.95 and not told[~band & ~between].any()
    chroma2[between] = 12.0  # not enough for a gap, enough for a cut
    mask = fill_gaps(seeds, seen, RULES, 1.0)
    assert mask[between].mean() > 0.95
