"""What furniture hides is learnt from poses, a body may be there, and what another person covers asks nothing."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import default_body
from hmc.camera.model import Rig, look_at, project
from hmc.io.masks import MaskStep, keep_masks
from hmc.io.results import PoseStates
from hmc.pose.occluders import (
    HiddenPlaces,
    Sightings,
    blocked_from,
    count_bodies,
    learn_hidden_places,
    no_sightings,
    unseen_voxels,
)
from hmc.pose.second_pass import with_own_rays
from hmc.pose.views.hull_target import distance_at, make_target
from hmc.pose.views.person_view import PersonView
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.run_options import RunOptions

BODY = default_body(1.75)
SIZE = (320, 240)
RIG = Rig(tuple(look_at(f"cam_{k}", SIZE, [4 * np.cos(a), 4 * np.sin(a), 1.6], [0, 0, 0.9], 40) for k, a in enumerate((0, 1.6, 3.2, 4.8))))
GRID = VoxelGrid.from_room([[-1.2, -1.2, 0.0], [1.2, 1.2, 2.0]], 0.05)
#: A board before the first camera, 1 m wide and .7 m high, a metre before the middle of the room.
BOARD = np.array([[1.0, -0.5, 0.0], [1.0, 0.5, 0.7]])


def silhouette(camera, state):
    """The flesh's pixels."""
    flesh = flesh_points(BODY, 0.02)
    uv = project(camera, place_points(*segment_transforms(BODY, state), flesh.points, flesh.segment))[0]
    mask = np.zeros(SIZE[::-1], np.uint8)
    inside = np.all((uv > 0) & (uv < np.array(SIZE) - 1), axis=1)
    mask[tuple(np.rint(uv[inside]).astype(int)[:, ::-1].T)] = 1
    return cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)).astype(bool)


def behind_the_board(camera):
    """The pixels that the board covers in a camera's image."""
    (_, y0, z0), (_, y1, z1) = BOARD
    uv = project(camera, np.array([[1.0, y, z] for y in (y0, y1) for z in (z0, z1)]))[0]
    mask = np.zeros(SIZE[::-1], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(uv.astype(np.float32)).astype(np.int32), 1)
    return mask.astype(bool)


def standing(x, y=0.0):
    state = neutral_state("down", BODY.limits)
    state[:3] = x, y, 0.95
    return state


def learnt(folder, states, board):
    """What is learnt of people in these poses, frame by frame, with or without the board before the first camera."""
    covered = behind_the_board(RIG[0]) if board else np.zeros(SIZE[::-1], bool)
    steps = []
    for frame, state in enumerate(states):
        masks = [silhouette(camera, state) for camera in RIG]
        if state[0] < BOARD[0, 0]:
            masks[0] &= ~covered
        steps.append(MaskStep(frame, (None,) * 4, tuple(masks), (None,) * 4))
    run = RunOptions(masks=folder / f"masks{board}", key="k")
    list(keep_masks(run.masks, "k", 0, steps, pytest.fail))
    n = len(states)
    table = PoseStates(np.arange(n), np.zeros(n, int), np.array(states), DOF_NAMES, {0: BODY.dimensions})
    return learn_hidden_places(RIG, GRID, run, table), steps


def test_a_board_hides_what_is_behind_it_and_only_that(tmp_path):
    there = [standing(0.1 * k - 0.4, y) for k in range(4) for y in (-0.2, 0.0, 0.2)]
    places, steps = learnt(tmp_path, there, True)
    centres = GRID.centres(places.voxels)
    hidden = places.pixels[0] < 0
    assert hidden.any() and (places.pixels[1:] >= 0).all()
    # On the line from the camera to what is hidden is the board.
    camera = RIG[0].centre
    along = (BOARD[0, 0] - camera[0]) / (centres[:, 0] - camera[0])
    height = camera[2] + along * (centres[:, 2] - camera[2])
    assert height.max() < BOARD[1, 2] + 0.1
    assert centres[:, 0].max() < BOARD[0, 0] + 0.01
    shin = np.linalg.norm(centres - [-0.1, 0.08, 0.3], axis=1).argmin()
    assert np.linalg.norm(centres[shin] - [-0.1, 0.08, 0.3]) < 0.06
    # In a frame with somebody there the place is unknown, and where the other cameras show nobody it is empty.
    assert (places.voxels[shin] == unseen_voxels(places, steps[10].masks)).all(axis=1).any()
    assert not len(unseen_voxels(places, [np.zeros(SIZE[::-1], bool)] * 4))
    assert not len(unseen_voxels(places, [None] * 4))


@pytest.mark.parametrize("away", [4.0, 14.0, 40.0])
def test_a_body_lost_before_one_that_is_shown_blocks_nothing_however_far(away):
    """Of a hundred bodies at one place five are lost, and as many are shown a metre behind: depths are told apart there as well."""
    rig = Rig(tuple(look_at(name, SIZE, [away, 0, 1.6], [0, 0, 1.6], 5) for name in "abc"))
    sightings = no_sightings(rig[0], away, (away - 2, away + 2))
    others = [no_sightings(camera, away, (away - 2, away + 2)) for camera in rig[1:]]
    mask = np.ones(SIZE[::-1], bool)
    for x, masks, times in ((0.0, np.zeros_like(mask), 5), (0.0, mask, 95), (-1.0, mask, 100)):
        step = MaskStep(0, (None,) * 3, (masks, mask, mask), (None,) * 3)
        for _ in range(times):
            count_bodies([sightings, *others], rig, step, np.array([[x, 0, 1.6]]))
    assert sightings.hidden.sum() == 5 and sightings.shown.shape[2] <= 41  # no more for who is far away
    assert blocked_from(sightings).depth[sightings.shown.any(axis=-1)].min() > away + 0.5


def test_nothing_is_hidden_where_everything_is_shown(tmp_path):
    there = [standing(0.1 * k - 0.4, y) for k in range(4) for y in (-0.2, 0.0, 0.2)]
    assert learnt(tmp_path, there, False)[0] is None


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_a_view_is_free_as_far_as_bodies_are_shown_again_and_again(seed):
    rng = np.random.default_rng(seed)
    hidden = (rng.random((9, 11, 40)) < 0.05).astype(np.uint16) * rng.integers(1, 9, (9, 11, 40)).astype(np.uint16)
    shown = np.zeros_like(hidden)
    to = int(rng.integers(2, 38))
    shown[..., to] = 200  # whoever is so far away is always seen
    depth = blocked_from(Sightings(4, shown, hidden)).depth
    assert (depth >= to * 0.1 - 1e-9).all()
    assert np.isinf(blocked_from(Sightings(4, shown, np.zeros_like(hidden))).depth).all()
    assert (blocked_from(Sightings(4, np.zeros_like(shown), hidden)).depth <= depth).all()


def test_a_patch_that_shows_nobody_tells_nothing_before_what_it_hides():
    """A table hides legs a metre behind it: a hand before the legs is behind the table too, though trunks show right above its edge."""
    shown, hidden = np.zeros((2, 20, 20, 40), np.uint16)
    hidden[10:, :, 30] = 3
    shown[:10, :, 30] = 3
    depth = blocked_from(Sightings(4, shown, hidden)).depth
    assert np.isinf(depth[:10]).sum() >= 7 * 20
    assert (depth[11:] == 0).all()
    # What the patch itself has shown is before whatever hides the rest.
    shown[15, 10, 18] = 1
    assert blocked_from(Sightings(4, shown, hidden)).depth[15, 10] == pytest.approx(1.9)


@pytest.mark.parametrize(
    ("shows", "counts"),
    [
        ((1, 1), True),
        ((1, 0), False),
        ((0, 0), False),
        ((1, 1, 0), True),
        ((1, 0, 0), False),
        ((1, 1, 0, 0), False),
        ((1,), True),
        ((), False),
    ],
)
def test_one_camera_that_sees_a_hidden_place_may_deny_it(shows, counts):
    """As of the tolerant hull, of the cameras that see: a hand before wood of its color is missing in one of them."""
    places = HiddenPlaces(np.array([[1, 2, 3]], np.int32), np.array([[-1], *([0] for _ in shows)], np.int32))
    masks = [np.zeros((2, 2), bool), *(np.full((2, 2), bool(one)) for one in shows)]
    assert len(unseen_voxels(places, masks)) == counts
    assert len(unseen_voxels(places, [np.ones((2, 2), bool), *masks[1:]])) == counts  # the first one does not see it, whatever it shows


def test_a_body_may_be_where_nothing_is_known():
    trunk = np.argwhere(np.ones((4, 4, 12), bool)) + [20, 20, 16]
    below = np.argwhere(np.ones((4, 4, 16), bool)) + [20, 20, 0]
    leg = GRID.centres(np.array([[21, 21, 5]]))
    assert distance_at(make_target(GRID, trunk, trunk, floor_z=0.0), leg) > 0.2
    assert distance_at(make_target(GRID, trunk, trunk, floor_z=0.0, unseen=below), leg) < 0.02


def test_what_another_body_covers_asks_nothing():
    """Of two people side by side, rays through the second one's body are not the first one's to cover."""
    mine, other = standing(0.0), standing(0.0, 0.8)
    flesh = flesh_points(BODY, 0.05)
    placed = [place_points(*segment_transforms(BODY, state), flesh.points, flesh.segment) for state in (mine, other)]
    trunk = np.argwhere(np.ones((4, 4, 12), bool)) + [20, 20, 16]
    towards = [points - RIG[0].centre for points in placed]
    rays = [np.hstack([points, way / np.linalg.norm(way, axis=1, keepdims=True)]) for points, way in zip(placed, towards, strict=True)]
    target = replace(make_target(GRID, trunk, trunk), rays=np.concatenate(rays))
    view = with_own_rays(PersonView(0, target), 0, {0: (BODY, mine), 1: (BODY, other)})
    np.testing.assert_array_equal(view.target.rays, rays[0])
    np.testing.assert_array_equal(with_own_rays(PersonView(0, target), 0, {0: (BODY, mine)}).target.rays, target.rays)
