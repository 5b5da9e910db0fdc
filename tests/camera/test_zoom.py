"""Small images enlarged and reduced again, against loops over squares of pixels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmc.camera.zoom import enlarged, enlarged_mask, reduced_mask


@given(st.integers(0, 10**6), st.integers(1, 3))
def test_a_square_of_which_half_is_set_is_set(seed, zoom):
    mask = np.random.default_rng(seed).integers(0, 2, (zoom * 6, zoom * 8)).astype(np.uint8)
    share = mask.reshape(6, zoom, 8, zoom).mean(axis=(1, 3))
    found = reduced_mask(mask, zoom)
    clear = np.abs(share - 0.5) > 0.01
    np.testing.assert_array_equal(found[clear], (share > 0.5)[clear])


@pytest.mark.parametrize("zoom", [1, 2, 3])
def test_what_is_enlarged_and_reduced_is_where_it_was(zoom):
    mask = np.zeros((40, 60), np.uint8)
    mask[10:25, 20:33] = 1
    again = reduced_mask(enlarged_mask(mask, zoom), zoom)
    corners = np.zeros(mask.shape, bool)
    corners[np.ix_([10, 24], [20, 32])] = True
    np.testing.assert_array_equal(again[~corners], mask[~corners])
    image = np.random.default_rng(0).integers(20, 90, (12, 10, 3)).astype(np.uint8)
    large = enlarged(image, zoom)
    assert large.shape == (12 * zoom, 10 * zoom, 3) and large.min() >= image.min()
