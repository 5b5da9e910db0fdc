"""Where silhouettes end for pairs of cameras: the same planes for both, of any body, and none others when a camera has turned."""

from dataclasses import replace
from itertools import combinations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from hmc.camera.epipolar import fundamental_matrices, undistorted_pixels
from hmc.camera.model import Rig, look_at, project
from hmc.camera.tangency import Outlines, convex_outline, tangent_misses
from hmc.camera.turned_cameras import with_turns

PAIRS = list(combinations(range(4), 2))


def ring(rng, n=4):
    """Cameras around the origin, of different lenses and heights."""
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False) + rng.uniform(-0.3, 0.3, n)
    places = np.column_stack([3 * np.cos(angles), 3 * np.sin(angles), rng.uniform(1, 2.5, n)])
    lenses = np.pad(rng.uniform(-0.2, 0, (n, 1)), ((0, 0), (0, 3)))
    return Rig(tuple(look_at(f"cam_{c:02d}", (640, 480), places[c], (0, 0, 1), 60, lenses[c]) for c in range(n)))


def bodies(rng, n_frames, n_points=40):
    """Clouds of points, as high as people; what is convex around each is a body."""
    return rng.uniform((-0.4, -0.4, 0.1), (0.4, 0.4, 1.8), (n_frames, n_points, 3)) + rng.uniform(-0.3, 0.3, (n_frames, 1, 3)) * (1, 1, 0)


def outlines(rig, points):
    """As if every point were a corner: those that are none touch no outermost plane."""
    rays = points[:, None] - rig.centres[:, None]
    return Outlines(rays, np.ones(rays.shape[:3], bool), points.mean(axis=1))


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_of_any_body_two_cameras_have_the_same_outermost_planes(seed):
    rng = np.random.default_rng(seed)
    rig, points = ring(rng), bodies(rng, 3)
    misses = tangent_misses(rig.centres, outlines(rig, points), PAIRS)
    assert misses.shape == (3, 6, 2)
    told = np.isfinite(misses)
    assert told.mean() > 0.5  # opposite cameras look along the line through both
    assert_allclose(misses[told], 0, atol=1e-12)


def test_a_camera_that_turns_misses_by_as_much_as_it_moves_what_it_sees():
    rng = np.random.default_rng(0)
    rig, points = ring(rng), bodies(rng, 20)
    seen = outlines(rig, points)
    turned = replace(seen, rays=with_turns(seen.rays, {1: np.array([0, 0, 0.01])}))
    misses = np.abs(tangent_misses(rig.centres, turned, PAIRS))
    own = [1 in pair for pair in PAIRS]
    assert np.nanmax(misses[:, ~np.array(own)]) < 1e-12
    assert 0.005 < np.nanmedian(misses[:, own]) < 0.04  # .01 rad at 3 m, seen from the side it is turned to


def test_outlines_of_images_end_where_fundamental_matrices_have_the_tangents():
    """By another way: epipolar lines in undistorted pixels of the corner where one camera's outline ends touch the other's."""
    rng = np.random.default_rng(1)
    rig, points = ring(rng), bodies(rng, 1)[0]
    outline = []
    for camera in rig:
        image = np.zeros((480, 640), np.uint8)
        # What is convex in space is convex in the image of a lens without distortion.
        uv = project(camera, points)[0]
        hull = cv2.convexHull(undistorted_pixels(camera, uv).astype(np.float32))[:, 0]
        edge = np.concatenate([hull[k] + (hull[(k + 1) % len(hull)] - hull[k]) * np.linspace(0, 1, 50)[:, None] for k in range(len(hull))])
        normalised = (edge - camera.matrix[:2, 2]) / camera.matrix[[0, 1], [0, 1]]
        world = camera.centre + np.column_stack([normalised, np.ones(len(edge))]) @ camera.rotation
        cv2.fillPoly(image, [np.round(project(camera, world)[0]).astype(np.int32)], 1)
        outline.append(convex_outline(camera, image.view(bool)))
        assert outline[-1][1].all()
    most = max(len(inside) for _, inside in outline)
    rays, inside = np.full((1, 4, most, 3), np.nan), np.zeros((1, 4, most), bool)
    for c, (own, whole) in enumerate(outline):
        rays[0, c, : len(own)], inside[0, c, : len(own)] = own, whole
    misses = tangent_misses(rig.centres, Outlines(rays, inside, points.mean(axis=0)[None]), PAIRS)
    assert np.nanmax(np.abs(misses)) < 0.01  # a pixel is 5 mm
    matrices = fundamental_matrices(rig)
    for one, other in PAIRS:
        lines = np.column_stack([undistorted_pixels(rig[one], project(rig[one], points)[0]), np.ones(len(points))]) @ matrices[one, other].T
        target = np.column_stack([undistorted_pixels(rig[other], project(rig[other], points)[0]), np.ones(len(points))])
        # A line that touches leaves all points on one side; both cameras have two such, of the same points.
        sides = (lines @ target.T) / np.abs(lines @ target.T).max()
        touching = np.flatnonzero((sides > -1e-9).all(axis=1) | (sides < 1e-9).all(axis=1))
        assert len(touching) in (0, 2)
        assert (len(touching) == 2) >= np.isfinite(misses[0, PAIRS.index((one, other))]).all()


def test_what_ends_at_the_border_is_not_told():
    camera = look_at("cam_00", (640, 480), (3, 0, 1), (0, 0, 1), 60)
    image = np.zeros((480, 640), bool)
    image[100:480, 200:300] = True
    rays, inside = convex_outline(camera, image)
    assert len(rays) == len(inside) and inside.any() and not inside.all()
    assert len(convex_outline(camera, np.zeros((480, 640), bool))[0]) == 0


@pytest.mark.parametrize("empty", [True, False])
def test_a_camera_that_shows_nothing_tells_nothing(empty):
    rng = np.random.default_rng(2)
    rig = ring(rng)
    seen = outlines(rig, bodies(rng, 4))
    if empty:
        seen.rays[:, 2] = np.nan
    else:
        seen.inside[:, 2] = False
    misses = tangent_misses(rig.centres, seen, PAIRS)
    assert np.isnan(misses[:, [2 in pair for pair in PAIRS]]).all()


def test_cameras_at_one_place_have_no_plane_through_both():
    rng = np.random.default_rng(3)
    rig = ring(rng)
    seen = outlines(rig, bodies(rng, 2))
    assert np.isnan(tangent_misses(rig.centres[[0, 0, 1, 2]], seen, [(0, 1)])).all()
