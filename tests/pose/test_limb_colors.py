"""Limbs that colors bring back: an arm on the wrong side, garbage, and a run that was stopped."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from methods import BY_RULES, HEIGHT_M, VOXEL_M, followed, tiny_clip, true_joints, true_tracks

from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.proportions import make_bodies
from hmc.landmarks import LANDMARKS
from hmc.pose import limb_colors, second_pass
from hmc.pose.backward import backward
from hmc.pose.follow import FollowOptions
from hmc.pose.part_colors import ColorSettings
from hmc.pose.registry import pose_method
from hmc.search.paths import cheapest_path
from hmc.voxels.run_options import RunOptions

FRAMES = 10
LOST = slice(3, 7)
ARM = [LANDMARKS.index(name) for name in ("l_elbow", "l_wrist")]


@pytest.fixture(scope="module")
def one_pass(tmp_path_factory):
    run = RunOptions(BY_RULES, masks=tmp_path_factory.mktemp("kept") / "masks", key="clip")
    return followed(("apf", "default"), FRAMES, run), run


@pytest.fixture
def no_sweep(monkeypatch):
    """The second pass leaves every pose as it is, so that what changes is by colors alone."""
    monkeypatch.setattr("hmc.pose.backward._sweep", lambda *_: None)


def with_the_arm_before_the_chest(people):
    """The same poses, but for an arm that is folded before the chest in some frames."""
    states = people.states.states.copy()
    (body,) = make_bodies(people.states.bodies).values()
    arm = LIMBS["l_arm"].dofs
    states[LOST, arm] = np.clip([-1.0, 0.3, np.pi / 3, -2.2], body.limits.low[arm], body.limits.high[arm])
    poses = replace(people.poses, positions=landmarks(body, states))
    return replace(people, poses=poses, states=replace(people.states, states=states))


def second(people, run, colors):
    method = pose_method("apf")
    others = {"fit_body": None, "turned": None, "anew": None, "hidden_places": False, "smooth_s": None}
    method = replace(method, back=replace(method.back, **others, colors=colors))
    return backward(tiny_clip(FRAMES), true_tracks(FRAMES), method, people, FollowOptions(VOXEL_M, 3, HEIGHT_M), run)


def errors(people):
    return np.linalg.norm(people.positions - true_joints(FRAMES), axis=2)


def test_an_arm_before_the_chest_is_put_where_its_colors_are(one_pass, no_sweep):
    people, run = one_pass
    lost = with_the_arm_before_the_chest(people)
    assert errors(lost)[LOST][:, ARM].max(axis=1).min() > 0.2
    as_it_was, found = second(lost, run, None), second(lost, run, ColorSettings())
    np.testing.assert_allclose(as_it_was.positions, lost.positions, atol=1e-9)
    assert errors(found)[LOST][:, ARM].max() < 0.12
    assert (errors(found) < errors(lost) + 0.02).all()


def test_images_of_one_color_change_nothing_but_what_silhouettes_deny(one_pass, no_sweep, monkeypatch):
    people, run = one_pass
    lost = with_the_arm_before_the_chest(people)
    read, asked = second_pass.iterate_frames, []

    def grey(*args, **options):
        for frame in read(*args, **options):
            asked.append(frame.index)
            yield replace(frame, images=tuple(None if image is None else np.full_like(image, 120) for image in frame.images))

    monkeypatch.setattr(second_pass, "iterate_frames", grey)
    settings = ColorSettings(own_share=2.0, least_nats=-1.0)
    np.testing.assert_allclose(second(people, run, settings).positions, people.positions, atol=1e-9)
    assert asked
    found = second(lost, run, settings)
    others = [k for k in range(len(LANDMARKS)) if k not in ARM]
    np.testing.assert_allclose(found.positions[:, others], lost.positions[:, others], atol=1e-9)
    assert (errors(found) < errors(lost) + 0.02).all()


def test_silhouettes_alone_change_nothing(one_pass, no_sweep, monkeypatch):
    people, run = one_pass
    lost = with_the_arm_before_the_chest(people)
    monkeypatch.setattr("hmc.io.recording.Recording.has_images", False)
    np.testing.assert_allclose(second(lost, run, ColorSettings()).positions, lost.positions, atol=1e-9)


def test_a_stopped_run_goes_on_to_the_same_numbers_with_any_number_of_workers(one_pass, no_sweep, tmp_path):
    people, run = one_pass
    lost = with_the_arm_before_the_chest(people)
    run = replace(run, journal=tmp_path / "journal")
    whole = second(lost, run, ColorSettings())
    lines = run.journal.read_text().splitlines(keepends=True)
    asked = [k for k, line in enumerate(lines) if '"limbs":[{' in line]
    assert len(asked) >= 3
    run.journal.write_text("".join(lines[: asked[1]]))
    again = second(lost, replace(run, workers=2), ColorSettings())
    np.testing.assert_array_equal(again.states.states, whole.states.states)
    assert len(run.journal.read_text().splitlines()) == len(lines)
    assert json.loads(lines[asked[0]].rpartition("}")[0] + "}")["frame"] in range(FRAMES)


def test_the_path_is_the_cheapest_of_all():
    """Against all paths, for few frames."""
    rng = np.random.default_rng(5)
    settings = ColorSettings(step_weight=0.02)
    frames, fps = np.array([0, 1, 3, 4]), 25.0
    costs = [rng.random(n) * 1e-3 for n in (2, 3, 1, 3)]
    places = [rng.random((len(some), 2, 3)) * 0.3 for some in costs]

    def of(path):
        total = sum(some[k] for some, k in zip(costs, path, strict=True))
        for k in range(1, len(path)):
            way = ((places[k][path[k]] - places[k - 1][path[k - 1]]) ** 2).sum(axis=1).mean()
            total += 0.02 * fps / 30 / (frames[k] - frames[k - 1]) * way
        return total

    every = list(np.ndindex(*(len(some) for some in costs)))
    path = cheapest_path(costs, partial(limb_colors._ways, frames, places, fps, settings))
    assert tuple(path) == min(every, key=of)
