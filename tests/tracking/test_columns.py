"""Upright people in the strict hull: found though they are one set of voxels, and told from ghosts."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.model import Rig, look_at, project
from hmc.tracking.blobs import observe
from hmc.tracking.columns import BODY_M, OWN_SHARE, OWN_VIEWS, TRUNK_M, WHOLE_M3, WHOLE_SHARE, explaining, find_columns
from hmc.tracking.following import init
from hmc.tracking.rules.upright import match_columns
from hmc.tracking.settings import FollowingSettings
from hmc.tracking.update import begin_update
from hmc.tracking.views import FrameViews
from hmc.voxels.carving import carve_levels, make_tables
from hmc.voxels.grid import VoxelGrid

GRID = VoxelGrid(np.array([-2.4, -2.4, 0.0]), 0.06, (80, 80, 33))
CORNERS = ((2.3, 2.3), (-2.3, 2.3), (-2.3, -2.3), (2.3, -2.3))
RIG = Rig(tuple(look_at(f"cam_{k}", (240, 180), [x, y, 2.6], [0, 0, 0.9], 80) for k, (x, y) in enumerate(CORNERS)))
TABLES = make_tables(GRID, RIG)


def body(x, y, height=1.72):
    """Points on the surface of an upright ellipsoid."""
    angle, polar = np.meshgrid(np.linspace(0, 2 * np.pi, 60), np.linspace(0, np.pi, 60))
    around = np.stack([0.21 * np.cos(angle) * np.sin(polar), 0.21 * np.sin(angle) * np.sin(polar), height / 2 * np.cos(polar)], axis=-1)
    return around.reshape(-1, 3) + (x, y, height / 2)


def seen(people, blind=None):
    """Silhouettes as filled outlines of the projected points, and the observation of the hulls; one camera may see nobody."""
    masks = []
    for c, camera in enumerate(RIG):
        mask = np.zeros(camera.size[::-1], np.uint8)
        for points in people if c != blind else ():
            uv, _ = project(camera, points)
            cv2.fillConvexPoly(mask, cv2.convexHull(uv.astype(np.float32)).astype(np.int32), 1)
        masks.append(mask.view(bool))
    strict, tolerant = carve_levels(TABLES, masks, (0, 1))
    return observe(GRID, strict if blind is None else tolerant, strict, FrameViews(RIG, masks))


def real(observation):
    columns = find_columns(observation)
    return columns.take(explaining(observation.views, observation.points, columns, observation.voxel_size_m))


def test_four_people_who_are_one_set_of_voxels_are_four():
    places = [(-0.45, -0.2), (0.0, 0.35), (0.5, 0.1), (0.1, -0.4)]
    observation = seen([body(*place) for place in places])
    assert observation.blobs.counts.max() > 0.95 * observation.blobs.counts.sum()
    found = real(observation).centres
    assert len(found) == 4
    assert max(np.hypot(*(found - place).T).min() for place in places) < 0.15


def test_ghosts_between_people_are_left_out():
    places = [(-1.0, 0.1), (0.9, 0.2), (0.0, 1.0), (0.1, -1.0), (-0.9, 1.0)]
    observation = seen([body(*place) for place in places])
    columns = find_columns(observation)
    ghosts = [j for j, centre in enumerate(columns.centres) if min(np.hypot(*(centre - place)) for place in places) > 0.3]
    found = real(observation).centres
    assert ghosts and len(found) == 5
    assert max(np.hypot(*(found - place).T).min() for place in places) < 0.15


def own_share(observation, columns, chosen, j):
    """The share of each view that a column has alone, cell by cell."""
    shares = []
    for camera, mask in zip(RIG, observation.views.masks, strict=True):
        depths = [camera.rotation[2] @ observation.points[v] + camera.translation[2] for v in np.unique(np.concatenate(columns.voxels))]
        side = max(1, int(observation.voxel_size_m * camera.matrix[0, 0] / max(np.median(depths), 1.0)))

        def cells(i, camera=camera, mask=mask, side=side):
            found = set()
            for point in observation.points[columns.voxels[i]]:
                uv = np.floor(project(camera, point[None])[0][0] + 0.5).astype(int)
                if (uv >= 0).all() and (uv < camera.size).all() and mask[uv[1], uv[0]]:
                    found.add((uv[0] // side, uv[1] // side))
            return found

        mine = cells(j)
        shares.append(len(mine.difference(*(cells(i) for i in chosen if i != j))) / max(1, len(mine)))
    return sorted(shares)[-OWN_VIEWS]


@settings(max_examples=6, deadline=None)
@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(-1, 1)), min_size=2, max_size=4))
def test_each_that_is_kept_has_its_own_share_and_who_adds_least_goes_first(places):
    observation = seen([body(*place) for place in places])
    columns = find_columns(observation)
    kept = np.flatnonzero(explaining(observation.views, observation.points, columns, observation.voxel_size_m)).tolist()
    trunks = [
        sum(np.hypot(*(point[:2] - centre)) <= TRUNK_M for point in observation.points[voxels]) * GRID.voxel_size_m**3
        for centre, voxels in zip(columns.centres, columns.voxels, strict=True)
    ]
    enough = [WHOLE_SHARE if trunk >= WHOLE_M3 else OWN_SHARE for trunk in trunks]
    chosen = list(range(len(columns)))
    while chosen:
        shares = [own_share(observation, columns, chosen, j) / enough[j] for j in chosen]
        if min(shares) >= 1:
            break
        chosen.remove(chosen[int(np.argmin(shares))])
    assert kept == chosen


@pytest.mark.parametrize("apart", [0.42, 0.5, 0.6])
def test_two_who_stand_back_to_back_are_two(apart):
    places = [(-0.7 * apart / 2, 0.7 * apart / 2), (0.7 * apart / 2, -0.7 * apart / 2), (0.9, 0.8), (-0.8, -0.7)]
    found = real(seen([body(*place, height=height) for place, height in zip(places, (1.85, 1.6, 1.75, 1.7), strict=True)])).centres
    assert len(found) == 4
    assert max(np.hypot(*(found - place).T).min() for place in places) < 0.2


@pytest.mark.parametrize(("least_m", "columns"), [(1.2, 1), (0.0, 2)])
def test_what_stands_beside_a_body_in_the_same_hull_is_a_column_only_if_it_has_a_trunk(least_m, columns):
    x, y, z = np.moveaxis(GRID.centres(np.argwhere(np.ones(GRID.shape, bool))).reshape(*GRID.shape, 3), -1, 0)
    person = (np.hypot(x, y) < 0.3) & (z < 1.7)
    beside = (abs(y) < 0.15) & (x > 0) & (x < 0.7) & (z < 1.6) & (z > least_m)
    assert len(find_columns(observe(GRID, person))) == 1
    assert len(find_columns(observe(GRID, person | beside))) == columns


@pytest.mark.parametrize("shape", ["full", "empty", "low"])
def test_rooms_that_are_full_empty_or_hold_low_things_have_no_columns(shape):
    volume = np.zeros(GRID.shape, bool)
    if shape == "full":
        volume[:] = True
    if shape == "low":
        volume[30:40, 30:40, :14] = True
    assert len(find_columns(observe(GRID, volume))) == 0


def test_a_column_s_voxels_are_those_around_its_middle():
    observation = seen([body(0.3, -0.2)])
    columns = find_columns(observation)
    away = np.hypot(*(observation.points[:, :2] - columns.centres[0]).T)
    assert len(columns) == 1 and np.array_equal(columns.voxels[0], np.flatnonzero(away <= BODY_M))


def test_of_more_people_than_there_are_those_stay_who_cover_most():
    places = [(-0.9, -0.9), (0.8, 0.7), (0.9, -0.8)]
    observation = seen([body(*place, height=height) for place, height in zip(places, (1.8, 1.75, 1.3), strict=True)])
    columns = find_columns(observation)
    kept = columns.take(explaining(observation.views, observation.points, columns, observation.voxel_size_m, most=2)).centres
    assert len(columns) == 3 and len(kept) == 2
    assert max(np.hypot(*(kept - place).T).min() for place in places[:2]) < 0.1


@pytest.mark.parametrize(("height", "newcomers"), [(1.72, 1), (1.25, 0)])
def test_what_one_camera_misses_is_a_newcomer_only_when_it_stands(height, newcomers):
    observation = seen([body(0.3, -0.2, height)], blind=2)
    update = match_columns(begin_update(init(25.0), 0, observation, None), FollowingSettings())
    assert len(update.columns) == 1 and len(update.newcomers) == newcomers
