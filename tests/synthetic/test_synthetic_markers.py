"""Balls on an actor: closed, outward, on the skin beside the joints, and they move with the limbs."""

from dataclasses import replace

import numpy as np

from hmc.synthetic.actor import make_actor, pose_mesh
from hmc.synthetic.markers import BALL_RADIUS_M, _sphere, with_balls
from hmc.synthetic.recipe import load_recipe
from hmc.synthetic.skeleton import landmark_positions
from hmc.synthetic.surface import volume_centroid


def test_a_ball_is_a_closed_sphere():
    vertices, faces = _sphere()
    volume, centre = volume_centroid(vertices, faces)
    assert 0.9 * 4 / 3 * np.pi < volume < 4 / 3 * np.pi
    np.testing.assert_allclose(centre, 0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1)


def test_fifteen_balls_are_worn_beside_the_joints():
    bare = make_actor(1.75, "average", np.random.default_rng(0), cell_m=0.025)
    actor = with_balls(bare, (1.0, 0.8, 0.0))
    n, each = len(bare.vertices), len(_sphere()[0])
    assert len(actor.vertices) == n + 15 * each == len(actor.albedo) == actor.weights.shape[0]
    np.testing.assert_allclose(actor.albedo[n], np.array([0.0, 0.8, 1.0]) ** 2.2)
    frames = np.array(bare.bind_frames)
    root = np.array([0.0, 0.0, bare.skeleton.hip_height])
    vertices, _ = pose_mesh(actor, root, frames)
    centres = vertices[n:].reshape(15, each, 3).mean(axis=1)
    joints = landmark_positions(bare.skeleton, root[None], frames[None])[0]
    apart = np.linalg.norm(joints[:, None] - centres, axis=-1)
    assert (apart.min(axis=1) < 0.22).all() and len(set(apart.argmin(axis=1))) >= 13
    skin = np.linalg.norm(vertices[:n, None] - centres, axis=-1).min(axis=0)
    assert (skin < 2 * BALL_RADIUS_M).all()


def test_the_shipped_recipe_wears_them():
    recipe = load_recipe("markers")
    assert recipe.actors[0].pattern == "markers"
    assert replace(recipe, actors=(replace(recipe.actors[0], pattern="plain"),)) != recipe
