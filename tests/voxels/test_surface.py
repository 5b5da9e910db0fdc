"""Surface voxels against scipy's erosion."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from hmc.voxels.surface import surface


@given(st.tuples(*[st.integers(1, 9) for _ in range(3)]), st.floats(0, 1), st.integers(0, 2**32 - 1))
def test_equals_what_an_erosion_takes_off(shape, share, seed):
    occupied = np.random.default_rng(seed).random(shape) < share
    cross = ndimage.generate_binary_structure(3, 1)
    np.testing.assert_array_equal(surface(occupied), np.argwhere(occupied & ~ndimage.binary_erosion(occupied, cross)))


def test_a_solid_cube_has_its_six_sides():
    occupied = np.zeros((12, 12, 12), bool)
    occupied[2:10, 2:10, 2:10] = True
    assert len(surface(occupied)) == 8**3 - 6**3


def test_nothing_there():
    assert surface(np.zeros((3, 4, 5), bool)).shape == (0, 3)
