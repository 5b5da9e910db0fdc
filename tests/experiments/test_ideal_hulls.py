"""Silhouettes and voxels of a body in a pose, and an actor's silhouettes, against a walk along each pixel's ray, all voxels, and the
pictures that were rendered."""

import cv2
import numpy as np
import pytest

from hmc.body.cones import cone_distance
from hmc.body.kinematics import segment_transforms
from hmc.body.model import neutral_state
from hmc.body.proportions import canton_body
from hmc.camera.model import backproject
from hmc.experiments.ideal_hulls import actor_masks, body_masks, body_voxels
from hmc.io.recording import open_recording
from hmc.synthetic.recipe import load_recipe
from hmc.synthetic.scene import build_scene
from hmc.voxels.grid import VoxelGrid

TINY = "data/synthetic/tiny"


@pytest.fixture(scope="module")
def tiny():
    return open_recording(TINY)


@pytest.fixture(scope="module")
def body():
    return canton_body(1.75)


@pytest.fixture(scope="module")
def state(body):
    state = neutral_state("down", body.limits)
    state[:3] = 0.1, -0.2, 0.95
    state[5:12] += 0.3
    return np.clip(state, body.limits.low, body.limits.high)


def in_some_cone(body, state, points):
    rotations, positions = segment_transforms(body, state)
    inside = np.zeros(len(points), bool)
    for cone, segment in enumerate(body.cones.segment):
        inside |= cone_distance(body.cones, cone, (points - positions[segment]) @ rotations[segment]) <= 0
    return inside


def test_a_silhouette_is_where_rays_meet_the_body(tiny, body, state):
    rng = np.random.default_rng(3)
    (step,) = body_masks(tiny.rig, body, {7: state})
    assert step.index == 7 and len(step.masks) == len(tiny.rig)
    for camera, mask in list(zip(tiny.rig, step.masks, strict=True))[:2]:
        rows, columns = np.nonzero(cv2.dilate(mask.astype(np.uint8), np.ones((9, 9), np.uint8)))
        some = rng.choice(len(rows), 250, replace=False)
        pixels = np.stack([columns[some], rows[some]], axis=-1)
        centre, directions = camera.centre, backproject(camera, pixels.astype(float))
        away = np.linalg.norm(state[:3] - centre)
        steps = np.arange(away - 1.3, away + 1.3, 0.004)
        met = np.array([in_some_cone(body, state, centre + steps[:, None] * one).any() for one in directions])
        assert (met == mask[pixels[:, 1], pixels[:, 0]]).mean() > 0.97  # they may differ on the outline
        assert 0.3 < met.mean() < 0.95


def test_voxels_are_those_whose_centre_is_in_the_body(body, state):
    grid = VoxelGrid.from_room(np.array([[-0.6, -0.9, 0.2], [0.7, 0.6, 2.0]]), 0.05)  # the feet are below it
    inside = body_voxels(body, state, grid)
    np.testing.assert_array_equal(inside.ravel(), in_some_cone(body, state, grid.centres().reshape(-1, 3)))
    assert inside.any()


def test_voxels_of_a_body_elsewhere_are_none(body, state):
    grid = VoxelGrid.from_room(np.array([[5.0, 5, 0], [6, 6, 2]]), 0.1)
    assert not body_voxels(body, state, grid).any()


def test_an_actors_silhouettes_are_those_that_were_rendered(tiny):
    rendered = sorted((tiny.path / "truth" / "silhouettes" / tiny.rig.names[0]).glob("*.png"))
    frames = [int(path.stem) for path in rendered][:2]
    assert frames
    for step in actor_masks(tiny.rig, build_scene(load_recipe("tiny")), frames):
        for camera, mask in zip(tiny.rig, step.masks, strict=True):
            path = tiny.path / "truth" / "silhouettes" / camera.name / f"{step.index:06d}.png"
            true = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 127
            np.testing.assert_array_equal(mask, true)
