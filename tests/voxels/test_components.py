"""Connected components against scipy.ndimage.label."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from hmc.voxels.components import components, label_voxels
from hmc.voxels.grid import VoxelGrid

shapes = st.tuples(*[st.integers(1, 12) for _ in range(3)])


@given(shapes, st.sampled_from([0.0, 0.03, 0.1, 0.2, 0.5, 1.0]), st.integers(0, 2**32 - 1))
def test_same_partition_as_scipy(shape, share, seed):
    occupied = np.random.default_rng(seed).random(shape) < share
    voxels, labels = label_voxels(occupied)
    np.testing.assert_array_equal(voxels, np.argwhere(occupied))
    theirs, n = ndimage.label(occupied, np.ones((3, 3, 3)))
    assert len(set(labels.tolist())) == n
    pairs = set(zip(labels.tolist(), theirs[occupied].tolist(), strict=True))
    assert len(pairs) == n


@given(shapes, st.sampled_from([0.03, 0.1, 0.3]), st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_sizes_centroids_and_bounds(shape, share, seed, least):
    occupied = np.random.default_rng(seed).random(shape) < share
    grid = VoxelGrid(np.array([1.0, -2.0, 0.5]), 0.05, shape)
    blobs = components(occupied, grid, least)
    theirs, n = ndimage.label(occupied, np.ones((3, 3, 3)))
    sizes = np.bincount(theirs.ravel(), minlength=n + 1)[1:]
    np.testing.assert_array_equal(blobs.sizes, sorted(sizes[sizes >= least], reverse=True))
    np.testing.assert_allclose(blobs.volumes, blobs.sizes * 0.05**3)
    np.testing.assert_array_equal(blobs.labels, np.repeat(np.arange(len(blobs)), blobs.sizes))
    for b in range(len(blobs)):
        number = theirs[tuple(blobs.of(b)[0])]
        np.testing.assert_array_equal(blobs.of(b), np.argwhere(theirs == number))
        np.testing.assert_allclose(blobs.centroids[b], grid.centres(np.array(ndimage.center_of_mass(theirs == number))))
        corners = [[s.start for s in ndimage.find_objects(theirs)[number - 1]], [s.stop for s in ndimage.find_objects(theirs)[number - 1]]]
        np.testing.assert_allclose(blobs.bounds[b], grid.origin + 0.05 * np.array(corners))


def test_ends_of_rows_are_not_neighbours():
    occupied = np.zeros((3, 4, 5), bool)
    occupied[0, 0, 4] = occupied[0, 1, 0] = occupied[1, 3, 4] = occupied[2, 0, 0] = True
    assert len(components(occupied, VoxelGrid(np.zeros(3), 1, (3, 4, 5)))) == 4


@pytest.mark.parametrize("least", [1, 100])
def test_nothing_there(least):
    occupied = np.zeros((4, 4, 4), bool)
    occupied[1, 1, 1] = least > 1
    blobs = components(occupied, VoxelGrid(np.zeros(3), 0.1, (4, 4, 4)), least)
    assert len(blobs) == 0 and blobs.voxels.shape == (0, 3) and blobs.centroids.shape == (0, 3) and blobs.bounds.shape == (0, 2, 3)
