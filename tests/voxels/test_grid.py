"""Voxel grid: the centre convention, round trips, and the memory check."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from hmc.errors import InputError
from hmc.voxels.grid import BYTES_PER_CAMERA, BYTES_PER_VOXEL, MEMORY_SHARE, VoxelGrid, available_memory, check_memory, voxels_of


def test_first_centre_lies_half_a_voxel_inside_the_room():
    grid = VoxelGrid.from_room([[-1, -2, 0], [1, 2, 2]], 0.1)
    assert grid.shape == (20, 40, 20)
    np.testing.assert_allclose(grid.centres(np.array([0, 0, 0])), [-0.95, -1.95, 0.05])
    np.testing.assert_allclose(grid.bounds, [[-1, -2, 0], [1, 2, 2]])


def test_all_centres_are_in_c_order():
    grid = VoxelGrid(np.array([1.0, 2.0, 3.0]), 0.5, (2, 3, 4))
    centres = grid.centres()
    assert centres.shape == (2, 3, 4, 3)
    np.testing.assert_allclose(centres[1, 2, 3], [1.75, 3.25, 4.75])


@given(
    st.tuples(*[st.floats(-20, 20) for _ in range(3)]),
    st.floats(0.01, 0.5),
    st.lists(st.tuples(*[st.integers(-300, 300) for _ in range(3)]), min_size=1, max_size=20),
)
def test_index_of_a_centre_is_the_voxel(origin, size, voxels):
    grid = VoxelGrid(np.array(origin), size, (10, 20, 30))
    voxels = np.array(voxels)
    np.testing.assert_array_equal(grid.index_of(grid.centres(voxels)), voxels)


@given(st.tuples(*[st.floats(0.05, 8) for _ in range(3)]), st.floats(0.02, 0.3))
def test_grid_covers_the_room_and_little_more(extent, size):
    room = np.array([[0.3, -0.7, 0.0], np.add([0.3, -0.7, 0.0], extent)])
    grid = VoxelGrid.from_room(room, size)
    over = grid.bounds[1] - room[1]
    assert np.all(over > -1e-6) and np.all(over < size)


def test_a_room_that_fills_whole_voxels_gets_no_extra_layer():
    assert VoxelGrid.from_room([[0, 0, 0], [0.3, 0.6, 0.9]], 0.1).shape == (3, 6, 9)


def test_too_fine_a_grid_says_what_it_needs_and_what_would_fit():
    extent, available = np.array([6.0, 5.0, 3.0]), 2 << 30
    with pytest.raises(InputError, match=r"need .* GiB and .* GiB may be used; voxels of (\d\.\d+) m would fit") as caught:
        check_memory(extent, 0.005, 7, available)
    fits = float(str(caught.value).split("voxels of ")[-1].split(" m")[0])
    check_memory(extent, fits, 7, available)
    needed = np.prod(np.ceil(extent / fits)) * (BYTES_PER_VOXEL + 7 * BYTES_PER_CAMERA)
    assert 0.8 * MEMORY_SHARE * available < needed <= MEMORY_SHARE * available


def test_memory_is_no_more_than_the_process_s_own_limit_leaves(monkeypatch):
    """As `ulimit -v` sets it: else a large room ends in a traceback, however much the machine has."""
    resource = pytest.importorskip("resource")
    free = available_memory()
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (2**60, resource.RLIM_INFINITY))
    assert abs(available_memory() - free) < 2**30
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (1, resource.RLIM_INFINITY))
    assert available_memory() == 0


@pytest.mark.parametrize(
    ("room", "size", "words"),
    [
        ([[0, 0, 0], [0, 1, 1]], 0.1, "empty"),
        ([[0, 0, 0], [np.nan, 1, 1]], 0.1, "two corners"),
        ([[0, 0], [1, 1]], 0.1, "two corners"),
        ([[0, 0, 0], [1, 1, 1]], 0, "voxel size"),
        ([[0, 0, 0], [1, 1, 1]], float("nan"), "voxel size"),
        ([[0, 0, 0], [5000, 5000, 3000]], 0.001, "GiB"),
    ],
)
def test_bad_rooms_and_sizes(room, size, words):
    with pytest.raises(InputError, match=words):
        VoxelGrid.from_room(room, size)


def test_grids_do_not_change():
    grid = VoxelGrid(np.zeros(3), 0.1, (1, 1, 1))
    with pytest.raises(ValueError, match="read-only"):
        grid.origin[0] = 1


@given(arrays(bool, array_shapes(min_dims=3, max_dims=3, max_side=6)))
def test_the_voxels_of_a_volume_are_those_of_numpy(volume):
    np.testing.assert_array_equal(voxels_of(volume), np.argwhere(volume))
