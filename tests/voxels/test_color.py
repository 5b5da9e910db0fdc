"""Line of sight against Bresenham's line in plain Python; colors of a cube whose sides differ."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.model import Rig, look_at, project
from hmc.errors import InputError
from hmc.voxels.color import color_voxels, visibility
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

GRID = VoxelGrid.from_room([[-0.5, -0.5, 0.0], [0.5, 0.5, 1.0]], 0.1)


def line(start, end):
    """Bresenham's line in 3-D with the usual error terms, from start to end, both left out."""
    point = list(start)
    length = [abs(b - a) for a, b in zip(start, end, strict=True)]
    sign = [1 if b > a else -1 for a, b in zip(start, end, strict=True)]
    main = max(range(3), key=lambda axis: (length[axis], -axis))
    error = [2 * n - length[main] for n in length]
    for _ in range(length[main] - 1):
        for axis in range(3):
            if axis == main:
                point[axis] += sign[axis]
            else:
                if error[axis] >= 0:
                    point[axis] += sign[axis]
                    error[axis] -= 2 * length[main]
                error[axis] += 2 * length[axis]
        yield tuple(point)


def free(occupied, start, end):
    inside = lambda p: all(0 <= x < n for x, n in zip(p, occupied.shape, strict=True))  # noqa: E731
    return not any(inside(p) and occupied[p] for p in line(start, end))


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.02, 0.1, 0.4, 1.0]),
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 3)), min_size=1, max_size=3),
)
def test_exact_mode_equals_a_walk_in_python(seed, share, places):
    places = [p for p in places if np.linalg.norm(np.subtract(p, [0.05, 0, 0.5])) > 0.1]
    if not places:
        return
    occupied = np.random.default_rng(seed).random(GRID.shape) < share
    rig = Rig(tuple(look_at(f"c{i}", (64, 48), place, [0.05, 0, 0.5], 60) for i, place in enumerate(places)))
    voxels = np.argwhere(occupied)
    expected = [[free(occupied, tuple(v), tuple(GRID.index_of(camera.centre).tolist())) for v in voxels.tolist()] for camera in rig]
    np.testing.assert_array_equal(visibility(occupied, GRID, rig, voxels), np.reshape(expected, (len(rig), -1)))


def body():
    """An upright capsule and another one beside it, in 2 cm voxels."""
    grid = VoxelGrid.from_room([[-0.6, -0.6, 0.0], [0.6, 0.6, 1.8]], 0.03)
    x, y, z = np.moveaxis(grid.centres(), -1, 0)
    upright = (x**2 + y**2 < 0.15**2) & (z < 1.6)
    arm = ((x - 0.3) ** 2 + (y - 0.1) ** 2 < 0.06**2) & (z > 0.8) & (z < 1.4)
    return grid, upright | arm


def test_quick_mode_agrees_on_nearly_all():
    grid, occupied = body()
    rig = Rig(tuple(look_at(f"c{i}", (320, 240), [3 * np.cos(i), 3 * np.sin(i), 2.0], [0, 0, 0.9], 60) for i in range(5)))
    for voxels in (np.argwhere(occupied), surface(occupied)):
        exact, quick = visibility(occupied, grid, rig, voxels), visibility(occupied, grid, rig, voxels, "quick")
        assert 0.1 < exact.mean() < 0.6
        assert np.mean(exact == quick) > 0.95


def test_colors_of_the_side_that_a_camera_sees():
    """Each camera sees its own color alone: by sight a voxel takes that of the camera on its side; the plain average mixes."""
    grid, occupied = body()
    rig = Rig((look_at("front", (320, 240), [3, 0, 0.9], [0, 0, 0.9], 60), look_at("back", (320, 240), [-3, 0, 0.9], [0, 0, 0.9], 60)))
    images = [np.full((240, 320, 3), color, np.uint8) for color in ((200, 0, 0), (0, 0, 100))]
    voxels = surface(occupied)
    plain = color_voxels(grid, rig, images, voxels)
    np.testing.assert_allclose(plain, np.broadcast_to([100, 0, 50], plain.shape))
    by_sight = color_voxels(grid, rig, images, voxels, visibility(occupied, grid, rig, voxels))
    x = grid.centres(voxels)[:, 0]
    np.testing.assert_allclose(by_sight[x > 0.32], np.broadcast_to([200, 0, 0], by_sight[x > 0.32].shape))
    np.testing.assert_allclose(by_sight[x < -0.12], np.broadcast_to([0, 0, 100], by_sight[x < -0.12].shape))


def test_a_voxel_has_the_color_of_its_pixel():
    rig = Rig((look_at("c", (64, 48), [2, 0, 0.5], [0, 0, 0.5], 60),))
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    voxels = np.array([[3, 4, 5], [9, 9, 9], [0, 0, 0]])
    column, row = np.rint(project(rig[0], GRID.centres(voxels))[0]).astype(int).T
    np.testing.assert_array_equal(color_voxels(GRID, rig, [image], voxels), image[row, column])


def test_nothing_known_is_nan_and_a_missing_image_tells_nothing():
    rig = Rig((look_at("a", (64, 48), [2, 0, 0.5], [0, 0, 0.5], 60), look_at("b", (64, 48), [2, 0, 0.5], [4, 0, 0.5], 60)))
    image = np.full((48, 64, 3), 7, np.uint8)
    voxels = np.array([[5, 5, 5]])
    assert np.isnan(color_voxels(GRID, rig, [None, image], voxels)).all()  # camera b looks away
    np.testing.assert_array_equal(color_voxels(GRID, rig, [image, None], voxels), [[7, 7, 7]])
    assert np.isnan(color_voxels(GRID, rig, [image, image], voxels, np.zeros((2, 1), bool))).all()


def test_nothing_asked_and_bad_questions():
    rig = Rig((look_at("a", (64, 48), [2, 0, 0.5], [0, 0, 0.5], 60),))
    nothing = np.zeros(GRID.shape, bool)
    assert visibility(nothing, GRID, rig, np.zeros((0, 3), int)).shape == (1, 0)
    with pytest.raises(InputError, match="occupied voxels"):
        visibility(nothing, GRID, rig, np.array([[1, 1, 1]]))
    with pytest.raises(InputError, match="exact or quick"):
        visibility(nothing, GRID, rig, np.zeros((0, 3), int), "sloppy")
