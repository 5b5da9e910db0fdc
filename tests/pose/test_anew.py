"""Poses that were lost for long are found anew; those that are not are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from methods import HEIGHT_M, VOXEL_M, followed, tiny_clip, true_joints, true_tracks

from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.proportions import make_bodies
from hmc.pose.anew import AnewSettings, doubtful_frames
from hmc.pose.backward import backward
from hmc.pose.follow import FollowOptions
from hmc.pose.registry import pose_method
from hmc.voxels.run_options import RunOptions

FRAMES = 10
ASTRAY = slice(4, FRAMES)


@pytest.fixture(scope="module")
def one_pass(tmp_path_factory):
    run = RunOptions(masks=tmp_path_factory.mktemp("kept") / "masks", key="clip")
    return followed(("apf", "default"), FRAMES, run), run


def gone_astray(people):
    """The same, but from a frame on turned about, bowed and a step aside, as who was taken for another goes on."""
    states = people.states.states.copy()
    states[ASTRAY, :2] += [0.3, -0.2]
    states[ASTRAY, 3] += np.pi
    states[ASTRAY, 6:] = states[ASTRAY, 6:] * 0.3 + 0.4
    return with_states(people, states)


def with_states(people, states):
    """Other poses of the same people, at six times the cost where they go astray."""
    (body,) = make_bodies(people.states.bodies).values()
    states = np.clip(states, body.limits.low, body.limits.high)
    costs = people.costs.copy()
    costs[ASTRAY] *= 6
    poses = replace(people.poses, positions=landmarks(body, states))
    return replace(people, poses=poses, states=replace(people.states, states=states), costs=costs)


def with_an_arm_for_a_head(people):
    """The same, but from a frame on the head is bent into the chest, and an arm is where it was."""
    states = people.states.states.copy()
    states[ASTRAY, dof_index("torso_y", "neck_y", "r_shoulder_x")] += np.radians([60, 60, -140])
    return with_states(people, states)


def errors(people):
    return np.linalg.norm(people.positions - true_joints(FRAMES), axis=2).mean(axis=1)


def second(people, run, anew):
    method = pose_method("apf")
    method = replace(method, back=replace(method.back, fit_body=None, anew=anew))
    return backward(tiny_clip(FRAMES), true_tracks(FRAMES), method, people, FollowOptions(VOXEL_M, 3, HEIGHT_M), run)


def test_a_body_that_went_astray_is_found_anew(one_pass):
    people, run = one_pass
    astray = gone_astray(people)
    assert errors(astray)[ASTRAY].min() > 0.25
    without, found = (errors(second(astray, run, anew))[ASTRAY] for anew in (None, AnewSettings()))
    assert without[3:].min() > 0.15  # no frame near these knows better
    assert found[-1] < 0.05 and found[0] < 0.05 and found.mean() < 0.1


def test_an_arm_in_the_place_of_a_head_is_undone(one_pass, monkeypatch):
    """By typical trunks and arms on the legs that are there, where a start from the hulls finds nothing, as among others."""
    people, run = one_pass
    astray = with_an_arm_for_a_head(people)
    monkeypatch.setattr("hmc.pose.anew.first_poses", lambda *given: (np.zeros((0, N_DOF)), np.zeros(0)))
    without, found = (errors(second(astray, run, anew))[ASTRAY] for anew in (None, AnewSettings()))
    assert without[-1] > 0.1 and found[-1] < 0.05 and found.mean() < 0.05


def test_where_nothing_was_lost_nothing_changes(one_pass, monkeypatch):
    people, run = one_pass
    tried = []
    monkeypatch.setattr("hmc.pose.backward.pose_anew", lambda *given: tried.append(given) or [])
    level = replace(people, costs=np.full_like(people.costs, np.nanmedian(people.costs)))
    found = second(level, run, AnewSettings())
    assert not tried
    np.testing.assert_array_equal(found.positions, second(level, run, None).positions)


def test_a_pose_that_fits_is_not_exchanged_for_another(one_pass):
    """Of a frame that only its costs make doubtful no pose comes that fits much better."""
    people, run = one_pass
    doubted = replace(people, costs=np.where(np.arange(FRAMES) < 4, people.costs, 9 * people.costs))
    found, without = (second(doubted, run, anew) for anew in (AnewSettings(), None))
    np.testing.assert_array_equal(found.positions, without.positions)


costs_of = st.lists(st.one_of(st.floats(1e-5, 1e-2), st.just(float("nan"))), min_size=1, max_size=60).map(np.array)


@given(st.dictionaries(st.integers(0, 3), costs_of, min_size=1), st.sampled_from([10.0, 25.0, 60.0]))
@settings(max_examples=80, deadline=None)
def test_every_doubtful_frame_has_one_near_that_is_tried(costs, fps):
    how = AnewSettings()
    found = doubtful_frames(costs, fps, how)
    assert found.keys() == costs.keys()
    lowest = [np.nanquantile(of, 0.25) for of in costs.values() if np.isfinite(of).any()]
    width, stride = round(how.median_s * fps), max(1, round(how.every_s * fps))
    for person, of in costs.items():
        if not np.isfinite(of).any():
            assert not len(found[person])
            continue
        own = np.nanquantile(of, 0.25)
        filled = np.where(np.isfinite(of), of, own)
        reach = np.arange(width) - width // 2 if width > 1 else np.zeros(1, int)
        around = np.clip(np.arange(len(of))[:, None] + reach, 0, len(of) - 1)
        lost = np.sort(filled[around], axis=1)[:, len(reach) // 2] > min(how.ratio * own, how.others * min(lowest))
        assert lost[found[person]].all()
        for k in np.flatnonzero(lost):
            later = found[person][found[person] >= k]
            assert len(later) and later[0] - k < stride and lost[k : later[0] + 1].all()


def test_one_person_s_loss_is_told_by_the_others_costs_too():
    lost = np.full(30, 9e-4)
    assert not len(doubtful_frames({0: lost}, 30.0, AnewSettings())[0])  # alone, it is what is usual
    found = doubtful_frames({0: lost, 1: np.full(30, 2e-4)}, 30.0, AnewSettings())
    assert len(found[0]) and found[0][-1] == 29 and not len(found[1])
