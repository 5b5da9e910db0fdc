"""The incremental hull against carving from scratch, frame after frame."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.model import Rig, look_at
from hmc.errors import InputError
from hmc.voxels.carving import carve, make_tables
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.incremental import colored_surface, hull_init, hull_step, make_pixel_tables
from hmc.voxels.surface import surface


@pytest.fixture(scope="module")
def scene():
    """Four cameras, one inside the room; the tables of either way."""
    places = [(2.6, 0.3, 1.8), (-0.4, 2.4, 1.5), (-2.5, -0.6, 1.9), (0.2, 0.1, 1.25)]
    sizes = [(80, 60), (60, 80), (100, 50), (48, 48)]
    rig = Rig(tuple(look_at(f"c{i}", size, place, [0, 0, 0.5], 60) for i, (place, size) in enumerate(zip(places, sizes, strict=True))))
    grid = VoxelGrid.from_room([[-1.0, -0.8, 0.0], [1.0, 0.8, 1.3]], 0.07)
    return rig, make_tables(grid, rig), make_pixel_tables(grid, rig)


def random_masks(rng, rig, before=None, drop=0.0):
    """Random blobs; some pixels of the masks before, where there are any, turned over."""
    masks = []
    for c, camera in enumerate(rig):
        if rng.random() < drop:
            masks.append(None)
            continue
        shape = camera.size[::-1]
        mask = rng.random(shape) < 0.9 if before is None or before[c] is None else before[c] ^ (rng.random(shape) < 0.05)
        masks.append(mask)
    return masks


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), tolerance=st.integers(0, 2), drop=st.sampled_from([0.0, 0.3]))
def test_equals_carving_from_scratch(scene, seed, tolerance, drop):
    rig, blocks, pixels = scene
    rng = np.random.default_rng(seed)
    masks = random_masks(rng, rig, drop=drop)
    state = hull_init(pixels, masks, tolerance)
    for _ in range(4):
        np.testing.assert_array_equal(state.occupied, carve(blocks, masks, tolerance))
        masks = random_masks(rng, rig, masks, drop)
        state = hull_step(pixels, state, masks, tolerance)
    np.testing.assert_array_equal(state.occupied, carve(blocks, masks, tolerance))


def test_a_step_leaves_the_state_before_alone(scene):
    rig, _, pixels = scene
    rng = np.random.default_rng(3)
    masks = random_masks(rng, rig)
    state = hull_init(pixels, masks)
    bits, occupied = state.bits.copy(), state.occupied.copy()
    hull_step(pixels, state, random_masks(rng, rig, masks))
    np.testing.assert_array_equal(state.bits, bits)
    np.testing.assert_array_equal(state.occupied, occupied)


def test_surface_and_colors_in_one(scene):
    rig, _, pixels = scene
    masks = [np.ones(camera.size[::-1], bool) for camera in rig]
    images = [np.full((*camera.size[::-1], 3), (10, 20, 30), np.uint8) for camera in rig]
    state = hull_init(pixels, masks)
    voxels, colors = colored_surface(pixels, state, images)
    np.testing.assert_array_equal(voxels, surface(state.occupied))
    known = np.isfinite(colors).all(axis=1)
    assert known.any()
    np.testing.assert_allclose(colors[known], np.tile([10.0, 20.0, 30.0], (known.sum(), 1)))


def test_wrong_masks_are_refused(scene):
    _, _, pixels = scene
    with pytest.raises(InputError, match="one mask a camera"):
        hull_init(pixels, [None])
    with pytest.raises(InputError, match="camera 'c0': the mask must be"):
        hull_init(pixels, [np.zeros((3, 3), bool), None, None, None])


def test_more_cameras_than_bits_are_refused():
    rig = Rig(tuple(look_at(f"c{i:02d}", (8, 8), (2, 0.01 * i, 1), [0, 0, 0.5], 60) for i in range(33)))
    with pytest.raises(InputError, match="32"):
        make_pixel_tables(VoxelGrid.from_room([[0, 0, 0], [1, 1, 1]], 0.5), rig)
