"""Carving against a loop over voxels that projects each one with OpenCV."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.model import Camera, Rig, backproject, look_at, project
from hmc.errors import InputError
from hmc.voxels.carving import carve, carve_levels, make_tables, pixel_of_voxel, pixels_at, shared_tables
from hmc.voxels.grid import VoxelGrid

ROOM = [[-1.0, -0.8, 0.0], [1.0, 0.8, 1.3]]
OUTSIDE = ("ignore", "carve", "keep")


@pytest.fixture(scope="module")
def scene():
    """Cameras of different sizes and lenses, one of them inside the room; a grid whose sides are no multiples of a block."""
    places = [(2.6, 0.3, 1.8), (-0.4, 2.4, 1.5), (-2.5, -0.6, 1.9), (0.5, -2.2, 1.2), (0.2, 0.1, 1.25)]
    sizes = [(160, 120), (120, 160), (200, 100), (160, 120), (96, 96)]
    lenses = [(0, 0, 0, 0), (-0.2, 0.05, 0, 0), (0.1, 0, 0.001, -0.002), (0, 0, 0, 0), (-0.3, 0.1, 0, 0)]
    rig = Rig(
        tuple(
            look_at(f"c{i}", size, place, [0, 0, 0.5], 60, lens)
            for i, (place, size, lens) in enumerate(zip(places, sizes, lenses, strict=True))
        )
    )
    grid = VoxelGrid.from_room(ROOM, 0.07)
    assert any(n % 8 for n in grid.shape)
    return grid, rig, make_tables(grid, rig)


def votes_by_opencv(grid: VoxelGrid, camera: Camera):
    """Pixel of every voxel's centre and whether the camera sees it; projection by OpenCV."""
    points = grid.centres().reshape(-1, 3)
    uv = cv2.projectPoints(points, cv2.Rodrigues(camera.rotation)[0], camera.translation, camera.matrix, camera.distortions)[0][:, 0]
    cam = points @ camera.rotation.T + camera.translation
    radius = np.hypot(cam[:, 0], cam[:, 1]) / np.maximum(cam[:, 2], 1e-9)
    column, row = np.floor(np.clip(uv, -1e6, 1e6) + 0.5).astype(int).T
    width, height = camera.size
    seen = (cam[:, 2] > 1e-6) & (radius < camera.max_radius) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    return column, row, seen


def brute_force(grid, rig, masks, tolerance, outside, min_views):
    """The definition in the module's docstring, one voxel and one camera at a time."""
    misses, votes = np.zeros(grid.n_voxels, int), np.zeros(grid.n_voxels, int)
    for camera, mask in zip(rig, masks, strict=True):
        if mask is None:
            continue
        for v, (column, row, seen) in enumerate(zip(*votes_by_opencv(grid, camera), strict=True)):
            if seen:
                votes[v] += 1
                misses[v] += not mask[row, column]
            elif outside == "carve":
                votes[v] += 1
                misses[v] += 1
            elif outside == "keep":
                votes[v] += 1
    n_masks = sum(mask is not None for mask in masks)
    needed = min(3, n_masks) if min_views is None else min_views
    return ((misses <= tolerance) & (votes >= needed) & (n_masks > 0)).reshape(grid.shape)


def blob(camera, rng, share=0.5):
    """A mask of large blobs that cover a share of the image."""
    noise = cv2.GaussianBlur(rng.standard_normal(camera.size[::-1]), (0, 0), 9)
    return noise > np.quantile(noise, 1 - share)


def speckled(mask, rng, share=0.002):
    """The mask with a share of its pixels turned."""
    return mask ^ (rng.random(mask.shape) < share)


def blob_masks(rig, rng, share=0.5):
    """Masks with large blobs, holes and single pixels."""
    return [speckled(blob(camera, rng, share), rng) for camera in rig]


@pytest.mark.parametrize("outside", OUTSIDE)
@pytest.mark.parametrize("tolerance", [0, 1, 2])
def test_equals_a_loop_over_voxels(scene, outside, tolerance):
    grid, rig, tables = scene
    masks = blob_masks(rig, np.random.default_rng(tolerance), 0.6)
    for min_views in (None, 4):
        expected = brute_force(grid, rig, masks, tolerance, outside, min_views)
        got = carve(tables, masks, tolerance, outside=outside, min_views=min_views)
        assert got.shape == grid.shape and got.dtype == bool
        np.testing.assert_array_equal(got, expected)
    assert 0 < carve(tables, masks, tolerance).sum() < grid.n_voxels


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.sampled_from([0.0, 0.05, 0.5, 0.9, 1.0]),
    absent=st.sets(st.integers(0, 4)),
    tolerance=st.integers(0, 6),
    outside=st.sampled_from(OUTSIDE),
    min_views=st.sampled_from([None, 0, 1, 2, 5, 6]),
)
def test_equals_votes_counted_over_the_room(scene, seed, share, absent, tolerance, outside, min_views):
    grid, rig, tables = scene
    masks = [None if c in absent else mask for c, mask in enumerate(blob_masks(rig, np.random.default_rng(seed), share))]
    misses, votes = np.zeros(grid.shape, int), np.zeros(grid.shape, int)
    for camera, mask in zip(rig, masks, strict=True):
        if mask is not None:
            column, row, seen = pixel_of_voxel(camera, grid.centres())
            hit = mask[row, column]
            misses += np.where(seen, ~hit, outside == "carve")
            votes += seen if outside == "ignore" else 1
    n_masks = len(rig) - len(absent)
    needed = min(3, n_masks) if min_views is None else min_views
    expected = (misses <= tolerance) & (votes >= needed) & (n_masks > 0)
    np.testing.assert_array_equal(carve(tables, masks, tolerance, outside=outside, min_views=min_views), expected)


@pytest.fixture(scope="module")
def fine(scene):
    """Blocks smaller than people: many of them lie inside a silhouette or beside it. With the pixel of every voxel in each camera."""
    _, rig, _ = scene
    grid = VoxelGrid.from_room(ROOM, 0.025)
    return rig, make_tables(grid, rig), [pixel_of_voxel(camera, grid.centres()) for camera in rig]


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    share=st.sampled_from([0.1, 0.3, 0.6, 0.95]),
    speckles=st.sampled_from([0.0, 0.0005]),
    absent=st.sets(st.integers(0, 4), max_size=3),
    tolerances=st.lists(st.integers(0, 3), min_size=1, max_size=3),
    outside=st.sampled_from(OUTSIDE),
    min_views=st.sampled_from([None, 1, 3]),
)
def test_blocks_that_are_told_as_a_whole_equal_votes_of_their_voxels(fine, seed, share, speckles, absent, tolerances, outside, min_views):
    rig, tables, pixels = fine
    rng = np.random.default_rng(seed)
    masks = [None if c in absent else speckled(blob(camera, rng, share), rng, speckles) for c, camera in enumerate(rig)]
    misses, votes = np.zeros(tables.grid.shape, int), np.zeros(tables.grid.shape, int)
    for mask, (column, row, seen) in zip(masks, pixels, strict=True):
        if mask is not None:
            misses += np.where(seen, ~mask[row, column], outside == "carve")
            votes += seen if outside == "ignore" else 1
    needed = min(3, len(rig) - len(absent)) if min_views is None else min_views
    hulls = carve_levels(tables, masks, tolerances, outside=outside, min_views=min_views)
    for hull, tolerance in zip(hulls, tolerances, strict=True):
        np.testing.assert_array_equal(hull, (misses <= tolerance) & (votes >= needed))


def test_pixels_of_voxels_are_those_of_their_centres(scene):
    grid, rig, tables = scene
    voxels = np.random.default_rng(3).integers(0, grid.shape, (500, 3))
    for camera, pixels in zip(rig, pixels_at(tables, voxels), strict=True):
        column, row, seen = pixel_of_voxel(camera, grid.centres(voxels))
        np.testing.assert_array_equal(pixels, np.where(seen, row * camera.size[0] + column, camera.size[0] * camera.size[1]))


def test_levels_are_the_single_hulls_and_nested(scene):
    _, rig, tables = scene
    masks = blob_masks(rig, np.random.default_rng(5), 0.7)
    strict, tolerant = carve_levels(tables, masks)
    np.testing.assert_array_equal(strict, carve(tables, masks, 0))
    np.testing.assert_array_equal(tolerant, carve(tables, masks, 1))
    assert not np.any(strict & ~tolerant)
    assert strict.sum() < tolerant.sum()


def test_despeckling_is_a_median_of_the_masks(scene):
    _, rig, tables = scene
    masks = blob_masks(rig, np.random.default_rng(6))
    cleaned = [cv2.medianBlur(mask.astype(np.uint8), 3) > 0 for mask in masks]
    np.testing.assert_array_equal(carve(tables, masks, despeckle=True), carve(tables, cleaned))


def test_a_sphere_comes_back_as_itself():
    rig = Rig(
        tuple(
            look_at(f"c{i}", (320, 240), [2.5 * np.cos(a), 2.5 * np.sin(a), 1.6], [0, 0, 0.6], 50)
            for i, a in enumerate(np.arange(8) * 0.785)
        )
    )
    grid = VoxelGrid.from_room(ROOM, 0.04)
    centre, radius = np.array([0.1, -0.1, 0.6]), 0.35
    masks = []
    for camera in rig:  # a ray hits the sphere or not
        pixels = np.stack(np.meshgrid(np.arange(320), np.arange(240)), axis=-1)
        rays = backproject(camera, pixels)
        along = rays @ (centre - camera.centre)
        masks.append(np.sum((centre - camera.centre) ** 2) - along**2 < radius**2)
    hull = carve(make_tables(grid, rig), masks)
    inside = np.linalg.norm(grid.centres() - centre, axis=-1) < radius - 0.01
    assert not np.any(inside & ~hull)
    assert inside.sum() < hull.sum() < 1.35 * inside.sum()


@pytest.mark.parametrize("lens", [(0, 0, 0, 0), (-0.3, 0.1, 0.001, -0.002), (0.2, 0, 0, 0)])
@pytest.mark.parametrize("place", [(2.6, 0.3, 1.8), (0.2, 0.1, 0.6), (0, -3, 0.5)])
def test_tables_hold_the_pixel_of_every_voxel(place, lens):
    """But for centres that fall on an edge between pixels, of which many do where a camera looks along an axis: there rounding decides."""
    camera = look_at("c", (160, 120), place, [0, 0, 0.5], 2 * np.degrees(np.arctan(0.5)), lens)
    grid = VoxelGrid.from_room(ROOM, 0.05)
    voxels = np.stack(np.unravel_index(np.arange(grid.n_voxels), grid.shape), axis=-1)
    column, row, seen = pixel_of_voxel(camera, grid.centres(voxels))
    uv, valid = project(camera, grid.centres(voxels))
    clear = ~valid | (np.abs(uv % 1 - 0.5).min(axis=1) > 1e-9)
    assert seen.any() and clear.mean() > 0.9
    expected = np.where(seen, row * 160 + column, 160 * 120)
    np.testing.assert_array_equal(pixels_at(make_tables(grid, Rig((camera,))), voxels)[0, clear], expected[clear])


def test_tables_are_made_once_for_a_grid_and_a_rig(ring):
    grids = [VoxelGrid.from_room(ROOM, size) for size in (0.1, 0.1, 0.2)]
    first, again, other = (shared_tables(grid, ring) for grid in grids)
    assert again is first and other.grid.shape == grids[2].shape
    np.testing.assert_array_equal(other.pixels, make_tables(grids[2], ring).pixels)
    assert shared_tables(grids[2], Rig(ring.cameras[:2])).pixels.shape[0] == 2


def test_a_voxel_behind_a_camera_is_not_voted_down_by_it():
    ahead = look_at("ahead", (64, 64), [0, 0, 0.5], [1, 0, 0.5], 60)
    grid = VoxelGrid.from_room([[-1, -0.2, 0.3], [1, 0.2, 0.7]], 0.1)
    tables = make_tables(grid, Rig((ahead,)))
    behind = grid.centres()[..., 0] < 0
    nothing = [np.zeros((64, 64), bool)]
    assert carve(tables, nothing, min_views=0)[behind].all()
    assert not carve(tables, nothing, min_views=0, outside="carve")[behind].any()
    assert not carve(tables, nothing)[behind].any()  # nobody voted


def test_nobody_there_and_no_camera(scene):
    grid, rig, tables = scene
    empty = [np.zeros(camera.size[::-1], bool) for camera in rig]
    assert not carve(tables, empty).any()
    assert not carve(tables, [None] * len(rig)).any()
    assert carve(tables, [None] * len(rig)).shape == grid.shape


def test_more_cameras_than_a_byte_counts():
    rig = Rig(tuple(look_at(f"c{i:02d}", (60, 40), [2 * np.cos(i), 2 * np.sin(i), 1], [0, 0, 0.4], 50) for i in range(20)))
    grid = VoxelGrid.from_room([[-0.3, -0.3, 0.1], [0.3, 0.3, 0.7]], 0.05)
    tables = make_tables(grid, rig)
    masks = blob_masks(rig, np.random.default_rng(0), 0.8)
    for tolerance in (0, 3, 17):
        misses = np.zeros(grid.shape, int)
        votes = np.zeros(grid.shape, int)
        for camera, mask in zip(rig, masks, strict=True):
            column, row, seen = pixel_of_voxel(camera, grid.centres())
            misses += seen & ~mask[row, column]
            votes += seen
        np.testing.assert_array_equal(carve(tables, masks, tolerance), (misses <= tolerance) & (votes >= 3))


def test_bad_masks_and_options(scene):
    _, rig, tables = scene
    masks = blob_masks(rig, np.random.default_rng(0))
    with pytest.raises(InputError, match=r"`masks` must hold one mask a camera: 5; got 4"):
        carve(tables, masks[:-1])
    with pytest.raises(InputError, match=r"camera 'c1': the mask must be \(height, width\) = \(160, 120\); got \(120, 160\)"):
        carve(tables, [masks[0], masks[1].T, *masks[2:]])
    with pytest.raises(InputError, match="`outside` must be one of"):
        carve(tables, masks, outside="maybe")
    with pytest.raises(InputError, match="`tolerance`"):
        carve(tables, masks, -1)
