"""What the redness of heads says of the way that people face: of painted heads, of garbage, and in a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from methods import BY_RULES, HEIGHT_M, VOXEL_M, followed, tiny_clip, true_tracks
from standing import BODY, RIG, SIDES, SKIN, STATE

from hmc.body.exchange import swapped_pose
from hmc.body.proportions import make_bodies
from hmc.camera.model import project
from hmc.pose import second_pass
from hmc.pose.backward import backward
from hmc.pose.follow import FollowOptions
from hmc.pose.head_colors import ALIKE, FACE_M, FLOOR, LEAST_PATCHES, MOST_NATS, face_patches, facing_by_redness
from hmc.pose.part_colors import KINDS
from hmc.pose.registry import pose_method
from hmc.voxels.run_options import RunOptions

RED, GREY = (90, 110, 190), (110, 110, 110)


def heads(rng, n=60, cameras=4):
    """Places of patches about a head, and the cameras that see them."""
    camera = rng.integers(0, cameras, n)
    return 2 * np.pi * camera / cameras + rng.uniform(-1.4, 1.4, n), camera


def test_it_is_what_least_squares_of_both_models_have_it():
    rng = np.random.default_rng(0)
    azimuth, camera = heads(rng)
    redness = 6 * np.cos(azimuth) + np.sin(azimuth) + 5 * camera + rng.normal(0, 3, len(azimuth))
    levels = np.eye(4)[camera]

    def residual(*columns):
        design = np.column_stack([levels, *columns])
        return ((redness - design @ np.linalg.lstsq(design, redness, rcond=None)[0]) ** 2).mean()

    without, with_front = residual(np.sin(azimuth)), residual(np.sin(azimuth), np.cos(azimuth))
    expected = len(azimuth) / ALIKE / 2 * np.log((without + FLOOR**2) / (with_front + FLOOR**2))
    assert 0.3 < expected < MOST_NATS
    np.testing.assert_allclose(facing_by_redness(azimuth, redness, camera), expected)


@given(st.integers(0, 10_000), st.floats(0, 20))
def test_turned_about_it_says_the_opposite_and_levels_of_cameras_say_nothing(seed, contrast):
    rng = np.random.default_rng(seed)
    azimuth, camera = heads(rng)
    redness = contrast * np.cos(azimuth) + rng.normal(0, 2, len(azimuth))
    said = facing_by_redness(azimuth, redness, camera)
    assert abs(said) <= MOST_NATS
    np.testing.assert_allclose(facing_by_redness(azimuth + np.pi, redness, camera), -said, atol=1e-9)
    other_light = redness + rng.normal(0, 10, 4)[camera]
    np.testing.assert_allclose(facing_by_redness(azimuth, other_light, camera), said, atol=1e-9)


def test_garbage_and_a_head_of_one_color_say_little_and_few_patches_nothing():
    rng = np.random.default_rng(1)
    said = [facing_by_redness(azimuth, rng.normal(0, 10, 60), camera) for azimuth, camera in (heads(rng) for _ in range(300))]
    assert abs(np.mean(said)) < 0.02 and np.abs(said).max() < 1
    azimuth, camera = heads(rng)
    assert facing_by_redness(azimuth, np.full(60, 140.0), camera) == pytest.approx(0)
    n = LEAST_PATCHES - 1
    assert facing_by_redness(azimuth[:n], 20 * np.cos(azimuth[:n]), camera[:n]) == 0
    ahead = np.zeros(60)
    assert facing_by_redness(ahead, rng.normal(0, 10, 60), np.zeros(60, int)) == 0


def painted(state, red):
    """Images of a grey person before black, their head's points red where `red` has it, and the silhouettes."""
    points = SKIN.placed(BODY, state)
    images, masks = [], []
    for camera in RIG:
        width, height = camera.size
        image, mask = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), bool)
        uv, valid = project(camera, points)
        depth = points @ camera.rotation[2] + camera.translation[2]
        for k in np.argsort(-depth):
            column, row = np.round(uv[k]).astype(int)
            if valid[k] and 0 <= row < height and 0 <= column < width:
                box = slice(max(row - 3, 0), row + 4), slice(max(column - 3, 0), column + 4)
                image[box], mask[box] = RED if red[k] else GREY, True
        images.append(image)
        masks.append(mask)
    return images, masks


@pytest.mark.parametrize(("red", "sign"), [(SKIN.points[:, 0] > 0, 1), (SKIN.points[:, 0] < 0, -1)])
def test_a_painted_face_is_where_it_was_painted(red, sign):
    images, masks = painted(STATE, red & (SKIN.kind == KINDS.index("head")))
    azimuth, redness, camera = face_patches(RIG, images, masks, SIDES, [(SKIN, SKIN.placed(BODY, STATE))], SKIN)
    assert len(azimuth) > 3 * LEAST_PATCHES and set(camera) == set(range(len(RIG)))
    assert sign * facing_by_redness(azimuth, redness, camera) > 1
    of_nobody = face_patches(RIG, [None] * len(RIG), masks, SIDES, [(SKIN, SKIN.placed(BODY, STATE))], SKIN)
    assert all(len(values) == 0 for values in of_nobody) and facing_by_redness(*of_nobody) == 0


def test_only_the_height_of_the_face_counts_and_another_before_it_hides_it():
    head = SKIN.kind == KINDS.index("head")
    below = SKIN.points[head, 2].max() - SKIN.points[:, 2]
    images, masks = painted(STATE, head & ((below < FACE_M[0] - 0.03) | (below > FACE_M[1] + 0.03)) & (SKIN.points[:, 0] > 0))
    own = SKIN.placed(BODY, STATE)
    free = face_patches(RIG, images, masks, SIDES, [(SKIN, own)], SKIN)
    assert abs(facing_by_redness(*free)) < 0.3
    towards = RIG[0].centre - own[head].mean(axis=0)
    other = own + 0.5 * towards / np.linalg.norm(towards)
    hidden = face_patches(RIG, images, masks, SIDES, [(SKIN, own), (SKIN.of_another(), other)], SKIN)
    before, after = (np.bincount(some[2], minlength=len(RIG)) for some in (free, hidden))
    assert after[0] < 0.4 * before[0]
    np.testing.assert_array_equal(after[1:], before[1:])


@pytest.mark.parametrize("colored", [True, False])
def test_in_a_moment_of_a_recording_the_face_tells_who_is_the_wrong_way_round(colored, tmp_path, monkeypatch):
    """Three frames of silhouettes by rules, of which shapes turn nobody about; grey images leave it so."""
    run = RunOptions(BY_RULES, masks=tmp_path / "masks", key="clip")
    people = followed(("apf", "default"), 3, run)
    (body,) = make_bodies(people.states.bodies).values()
    states = np.array([swapped_pose(body, state, "all") for state in people.states.states])
    lost = replace(people, states=replace(people.states, states=states))
    if not colored:
        read = second_pass.iterate_frames

        def grey(*args, **options):
            for frame in read(*args, **options):
                yield replace(frame, images=tuple(None if image is None else np.full_like(image, 120) for image in frame.images))

        monkeypatch.setattr(second_pass, "iterate_frames", grey)
    found = backward(tiny_clip(3), true_tracks(3), pose_method("apf"), lost, FollowOptions(VOXEL_M, 3, HEIGHT_M), run)
    way = np.cos(found.states.states[:, 3] - people.states.states[:, 3])
    assert (way > 0.8).all() if colored else (way < -0.8).all()
