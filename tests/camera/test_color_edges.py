"""Color edges against plain loops and against OpenCV's Canny under a shadow."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.color_edges import ColorEdgeSettings, color_edges, color_gradient
from hmc.errors import InputError

SHARP = ColorEdgeSettings(sigma_px=0.0)


def distance_by_hand(a, b, settings):
    """Wesolkowski and Jernigan's mixture, one pair of colors."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    alpha = [1 / (1 + np.exp(-settings.slope * (color.mean() - settings.bright))) for color in (a, b)]
    rho = np.sqrt(alpha[0] * alpha[1])
    cosine = a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-3)
    return rho * np.sqrt(max(1 - cosine**2, 0)) + (1 - rho) * np.linalg.norm(a - b) / (255 * np.sqrt(3))


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_gradient_is_the_largest_distance_across_a_pixel(seed):
    image = np.random.default_rng(seed).integers(0, 256, (6, 7, 3), dtype=np.uint8)
    found = color_gradient(image, SHARP).max(axis=0)
    for row in range(1, 5):
        for column in range(1, 6):
            pairs = [((0, -1), (0, 1)), ((-1, 0), (1, 0)), ((-1, -1), (1, 1)), ((-1, 1), (1, -1))]
            across = [distance_by_hand(image[row + a[0], column + a[1]], image[row + b[0], column + b[1]], SHARP) for a, b in pairs]
            assert found[row, column] == pytest.approx(max(across), abs=2e-3)
    assert not found[0].any()
    assert not found[:, -1].any()


@pytest.mark.parametrize("angle", [0, 20, 45, 70, 90, 120, 160])
def test_an_edge_is_thin_and_points_across(angle):
    v, u = np.mgrid[-30:31, -30:31]
    normal = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    share = np.clip(u * normal[0] + v * normal[1] + 0.5, 0, 1)[..., None]
    image = (share * [40, 90, 200] + (1 - share) * [190, 120, 40]).astype(np.uint8)
    edges = color_edges(image)
    inner = edges.strength[8:-8, 8:-8] > 0
    rows, columns = np.nonzero(inner)
    distance = (columns - 22) * normal[0] + (rows - 22) * normal[1]
    assert np.abs(distance).max() <= 1.6
    # One or two to every row or column that the line crosses.
    assert len(rows) <= 2 * 45
    assert len(rows) >= 40
    across = np.abs(edges.direction[8:-8, 8:-8][inner] @ normal)
    assert np.median(across) > np.cos(np.radians(8))


def test_a_shadow_makes_no_edge_where_canny_sees_one():
    light = np.ones((60, 90))
    light[:, 30:] = 0.62  # a shadow's edge; the color's direction stays
    image = np.empty((60, 90, 3))
    image[:] = (200, 170, 150)
    image[:, 60:] = (90, 120, 220)
    image = np.clip(image * light[..., None], 0, 255).astype(np.uint8)
    ours = color_edges(image).strength > 0
    canny = cv2.Canny(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), 60, 120) > 0
    assert canny[10:-10, 26:34].any()
    assert not ours[10:-10, 26:34].any()
    assert ours[10:-10, 56:64].any(axis=1).all()


def test_grey_images_are_refused():
    with pytest.raises(InputError, match="height, width, 3"):
        color_edges(np.zeros((5, 5), np.uint8))


def test_tiny_images_have_no_edges():
    assert not color_edges(np.zeros((2, 9, 3), np.uint8)).strength.any()
