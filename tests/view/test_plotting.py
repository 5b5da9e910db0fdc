"""Pictures of the stages: the right data in the right places, axes in and axes out."""

from __future__ import annotations

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from hmc.body.kinematics import landmarks
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.io.results import PoseTable, TrackTable
from hmc.landmarks import BONES
from hmc.metrics.scores import evaluate_pose
from hmc.view import plots as plotting
from hmc.view.curve import PALE, draw_curve
from hmc.view.mosaic import Person
from hmc.view.overlay import LEFT
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface


@pytest.fixture(autouse=True)
def close_figures():
    yield
    for number in plt.get_fignums():
        plt.figure(number).canvas.draw()  # what cannot be drawn fails here
    plt.close("all")


def person_points():
    body = default_body(1.7)
    state = neutral_state("sideways", body.limits)
    state[2] = 0.9
    return body, state, landmarks(body, state)


def test_axes_that_are_given_come_back():
    _, (flat, other) = plt.subplots(1, 2)
    room = plt.figure().add_subplot(projection="3d")
    body, state, points = person_points()
    grid = VoxelGrid(np.zeros(3), 0.1, (3, 3, 3))
    tracks = TrackTable(np.arange(2), np.zeros(2, int), np.zeros((2, 3)))
    assert plotting.draw_mask(None, np.eye(4, dtype=bool), flat) is flat
    assert plotting.draw_tracks(tracks, ax=flat) is flat
    assert plotting.draw_errors(np.arange(3), np.full((3, 15), 0.02), other) is other
    assert plotting.draw_voxels(grid, np.ones(grid.shape, bool), ax=room) is room
    assert plotting.draw_sticks(points, room) is room
    assert plotting.draw_body(body, state, room) is room


def test_a_mask_tints_its_pixels_and_only_them():
    image = np.full((20, 30, 3), 100, np.uint8)
    mask = np.zeros((20, 30), bool)
    mask[5:10, 8:20] = True
    shown = plotting.draw_mask(image, mask).images[0].get_array()
    assert (shown[~mask] == 75).all() and (shown[mask][:, 0] > shown[mask][:, 2]).all()
    plotting.draw_mask(image, np.zeros((20, 30), bool))
    plotting.draw_mask(None, np.ones((20, 30), bool))


def test_an_overlay_leaves_the_image_as_it_was(ring):
    _, _, points = person_points()
    image = np.zeros((120, 160, 3), np.uint8)
    ax = plotting.draw_overlay(ring[0], image, [Person(0, points)])
    assert not image.any() and ax.images[0].get_array().any()
    assert (ax.images[0].get_array() == LEFT[::-1]).all(axis=-1).any()  # drawn blue-green-red, shown red-green-blue


@pytest.mark.parametrize("n", [1, 2, 3])
def test_voxels_show_their_bare_faces(n):
    grid = VoxelGrid(np.array([1.0, 2.0, 0.5]), 0.2, (5, 5, 5))
    occupied = np.zeros(grid.shape, bool)
    occupied[1 : 1 + n, 1 : 1 + n, 1 : 1 + n] = True
    colors = np.tile(np.array([[10, 20, 250]], np.uint8), (len(surface(occupied)), 1))
    ax = plotting.draw_voxels(grid, occupied, colors)
    (faces,) = [part for part in ax.collections if isinstance(part, Poly3DCollection)]
    corners = np.array(faces._faces)
    assert len(corners) == 6 * n * n
    np.testing.assert_allclose(corners.reshape(-1, 3).min(axis=0), grid.origin + 0.2)
    np.testing.assert_allclose(corners.reshape(-1, 3).max(axis=0), grid.origin + 0.2 * (1 + n))
    assert (faces.get_facecolor()[:, 0] > faces.get_facecolor()[:, 2]).all()  # red, as it was in BGR


def test_an_empty_volume_is_an_empty_picture():
    grid = VoxelGrid(np.zeros(3), 0.2, (3, 3, 3))
    plotting.draw_voxels(grid, np.zeros(grid.shape, bool))


def test_sticks_leave_out_missing_bones_and_widen_the_limits():
    _, _, points = person_points()
    missing = points.copy()
    missing[5] = np.nan  # the left wrist ends one bone
    ax = plotting.draw_sticks(np.stack([points, missing]), label="estimate")
    (lines,) = [part for part in ax.collections if isinstance(part, Line3DCollection)]
    assert len(lines._segments3d) == 2 * len(BONES) - 1
    plotting.draw_sticks(points + np.array([3, 0, 0]), ax, color="black", label="truth")
    low, high = ax.get_xlim3d()
    assert low <= points[:, 0].min() and high >= points[:, 0].max() + 3
    limits = np.array([ax.get_xlim3d(), ax.get_ylim3d(), ax.get_zlim3d()])
    np.testing.assert_allclose(ax._box_aspect / np.ptp(limits, axis=1), (ax._box_aspect / np.ptp(limits, axis=1))[0])
    assert to_rgb(ax.lines[-1].get_color()) == (0, 0, 0)


def test_a_body_is_drawn_around_its_landmarks():
    body, state, points = person_points()
    ax = plotting.draw_body(body, state)
    (faces,) = [part for part in ax.collections if isinstance(part, Poly3DCollection)]
    corners = np.concatenate([np.asarray(polygon) for polygon in faces._faces])
    inner = points[[0, 1, 4, 7, 10, 13]]
    assert (corners.min(axis=0) <= inner.min(axis=0)).all() and (corners.max(axis=0) >= inner.max(axis=0)).all()
    assert 1.4 < np.ptp(corners[:, 2]) < 2.0


def test_tracks_break_where_frames_are_missing():
    frames = np.array([0, 2, 4, 10, 12])
    table = TrackTable(frames, np.zeros(5, int), np.arange(15.0).reshape(5, 3))
    ax = plotting.draw_tracks(table, room=np.array([[0, 0, 0], [15, 15, 2]]), truth=table)
    x = ax.lines[1].get_xdata()
    np.testing.assert_array_equal(np.isnan(x), [False, False, False, True, False, False])
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["person 0", "truth"]
    plotting.draw_tracks(table.where(np.array([0])))
    plotting.draw_tracks(table.where(np.zeros(0, int)))


def test_error_curves_are_in_millimetres_and_by_frame():
    errors = np.full((4, 15), 0.03)
    errors[2] = np.inf
    errors[3, 0] = 0.33
    ax = plotting.draw_errors(np.array([3, 2, 1, 0]), errors)
    curve = next(line for line in ax.lines if line.get_label() == "mean of all")
    np.testing.assert_array_equal(curve.get_xdata(), [0, 1, 2, 3])
    np.testing.assert_allclose(curve.get_ydata(), [50, np.nan, 30, 30])


def test_scores_put_the_worst_landmark_first():
    rng = np.random.default_rng(0)
    truth = PoseTable(np.arange(6), np.zeros(6, int), rng.normal(size=(6, 15, 3)))
    moved = truth.positions + np.array([0.02, 0, 0])
    moved[:, 8] += np.array([0.05, 0, 0])
    rows = evaluate_pose(PoseTable(truth.frames, truth.persons, moved), truth).rows
    ax = plotting.draw_scores(rows)
    assert ax.get_yticklabels()[0].get_text() == "r_wrist"
    assert ax.patches[0].get_width() == pytest.approx(70) and len(ax.patches) == 15


def test_a_curve_is_pale_where_it_is_doubtful_and_its_legend_is_not():
    ax = plt.figure().add_subplot()
    times, values = np.arange(6.0), np.array([1.0, 2, np.nan, 4, 5, 6])
    draw_curve(ax, times, values, np.array([False, True, False, False, True, False]), "left", color="red")
    draw_curve(ax, times, 2 * values, np.zeros(6, bool), "right", color="blue")
    below, left, right = ax.lines
    assert below.get_alpha() == PALE and below.get_zorder() < min(left.get_zorder(), right.get_zorder())
    np.testing.assert_array_equal(below.get_ydata(), values)
    np.testing.assert_array_equal(left.get_ydata(), [1, np.nan, np.nan, 4, np.nan, 6])
    np.testing.assert_array_equal(right.get_ydata(), 2 * values)
    handles, labels = ax.get_legend_handles_labels()
    assert handles == [left, right] and labels == ["left", "right"] and {one.get_alpha() for one in handles} == {None}
