"""The second pass: what it mends, what it leaves, and that it goes on where it was stopped."""

from __future__ import annotations

import multiprocessing
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from methods import HEIGHT_M, VOXEL_M, followed, tiny_clip, true_joints, true_tracks

import hmc
from hmc.body.exchange import swapped_pose
from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS
from hmc.body.proportions import make_bodies
from hmc.errors import InputError
from hmc.io.masks import kept_frames
from hmc.landmarks import LANDMARKS
from hmc.pose.backward import backward
from hmc.pose.follow import FollowOptions
from hmc.pose.registry import pose_method
from hmc.pose.starts.own_body import LEAST_BODY_FRAMES, choose_frames
from hmc.pose.turned import turn_about
from hmc.pose.views.person_view import views_of
from hmc.pose.views.recent import RecentViews, bytes_of
from hmc.tracking.resumable import person_grid
from hmc.tracking.tracks import velocities
from hmc.voxels.hulls import stream_hulls
from hmc.voxels.run_options import RunOptions

FRAMES = 10
LOST = slice(3, 7)
WRIST = LANDMARKS.index("l_wrist")


@pytest.fixture(scope="module")
def one_pass(tmp_path_factory):
    """The clip's person after one pass, and the run that kept the silhouettes."""
    run = RunOptions(masks=tmp_path_factory.mktemp("kept") / "masks", key="clip")
    return followed(("apf", "default"), FRAMES, run), run


def with_a_lost_arm(people):
    """The same poses, but for an arm that is held up in some frames."""
    states = people.states.states.copy()
    states[LOST, LIMBS["l_arm"].dofs] = [0.9, 0.3, -0.2, -0.1]
    (body,) = make_bodies(people.states.bodies).values()
    poses = replace(people.poses, positions=landmarks(body, states))
    return replace(people, poses=poses, states=replace(people.states, states=states))


def second(people, run, method=None, recent=None):
    method = method or pose_method("apf")
    options = FollowOptions(VOXEL_M, 3, HEIGHT_M, recent=recent)
    return backward(tiny_clip(FRAMES), true_tracks(FRAMES), method, people, options, run)


def as_found():
    """The method that leaves each frame's pose as it was found by itself."""
    method = pose_method("apf")
    return replace(method, back=replace(method.back, smooth_s=None))


def turned_about(people, wrong):
    """The same poses, in the rows `wrong` the wrong way round: left is right, and front is back."""
    (body,) = make_bodies(people.states.bodies).values()
    states = people.states.states.copy()
    states[wrong] = [swapped_pose(body, state, "all") for state in states[wrong]]
    poses = replace(people.poses, positions=landmarks(body, states))
    return replace(people, poses=poses, states=replace(people.states, states=states))


@pytest.mark.parametrize(
    ("switch", "function"),
    [("hidden_places", "backward.learn_hidden_places"), ("own_rays", "second_pass.with_own_rays")],
)
def test_what_is_switched_off_is_not_done(one_pass, monkeypatch, switch, function):
    people, run = one_pass
    monkeypatch.setattr(f"hmc.pose.{function}", None)
    method = pose_method("apf")
    off = second(people, run, replace(method, back=replace(method.back, **{switch: False}, fit_body=None)))
    assert np.nanmean(errors(off)) < 0.06
    with pytest.raises(TypeError, match="not callable"):
        second(people, run, replace(method, back=replace(method.back, fit_body=None)))


def errors(people):
    return np.linalg.norm(people.positions - true_joints(FRAMES), axis=2)


def test_a_lost_arm_is_taken_up_from_the_frames_after(one_pass):
    people, run = one_pass
    lost = with_a_lost_arm(people)
    found = second(lost, run)
    assert errors(lost)[LOST, WRIST].min() > 0.2
    assert errors(found)[LOST, WRIST].max() < 0.06
    assert np.median(errors(found)) < 1.1 * np.median(errors(people))
    assert found.status == people.status and np.isfinite(found.costs).all()


def test_it_finds_nothing_where_the_silhouettes_show_nothing(one_pass, tmp_path):
    """On garbage, silhouettes of another place in the room, poses stay as bad as they are."""
    people, run = one_pass
    lost = with_a_lost_arm(people)
    nobody = replace(true_tracks(FRAMES), positions=true_tracks(FRAMES).positions + [50.0, 0, 0])
    found = backward(tiny_clip(FRAMES), nobody, as_found(), lost, FollowOptions(VOXEL_M, 3, HEIGHT_M), run)
    np.testing.assert_allclose(found.positions, lost.positions, atol=1e-9)


def test_in_the_end_poses_are_smoothed_and_nothing_else_of_them_is_changed(one_pass):
    people, run = one_pass
    fps = tiny_clip(FRAMES).fps
    rough, smooth = second(people, run, as_found()), second(people, run)
    asked = rough.smoothed("polynomial", window_s=pose_method("apf").back.smooth_s, fps=fps, limits=pose_method("apf").limits)
    np.testing.assert_array_equal(smooth.positions, asked.positions)
    np.testing.assert_array_equal(smooth.costs, rough.costs)
    np.testing.assert_array_equal(smooth.passes_apart, rough.passes_apart)

    def jitter(one):
        return np.linalg.norm(np.diff(one.positions - true_joints(FRAMES), 2, axis=0), axis=2).mean()

    assert jitter(smooth) < 0.9 * jitter(rough) and np.mean(errors(smooth)) < np.mean(errors(rough)) + 0.001


def test_a_stopped_pass_goes_on_to_the_same_numbers(one_pass, tmp_path):
    people, run = one_pass
    run = replace(run, journal=tmp_path / "journal")
    whole = second(people, run)
    lines = (tmp_path / "journal").read_text().splitlines(keepends=True)
    for kept in (1, 2, 5, len(lines)):
        (tmp_path / "journal").write_text("".join(lines[:kept]) + lines[-1][:10])
        again = second(people, run)
        np.testing.assert_array_equal(again.states.states, whole.states.states)
        np.testing.assert_array_equal(again.positions, whole.positions)
        assert again.states.bodies == whole.states.bodies


@pytest.mark.parametrize("part", [slice(None), slice(6, None)])
def test_who_was_followed_the_wrong_way_round_is_turned_about(part, one_pass, tmp_path):
    """All of the run or its end, with which the second pass begins, also where it was stopped; with that switched off it stays wrong."""
    people, run = one_pass
    wrong = turned_about(people, part)
    assert np.median(errors(wrong)[part, WRIST]) > 0.2
    run = replace(run, journal=tmp_path / "journal")
    found = second(wrong, run)
    assert np.median(errors(found)[:, WRIST]) < 0.06 and np.mean(errors(found)) < 1.3 * np.mean(errors(people))
    lines = (tmp_path / "journal").read_text().splitlines(keepends=True)
    (tmp_path / "journal").write_text("".join(lines[:4]))
    np.testing.assert_array_equal(second(wrong, run).states.states, found.states.states)
    method = pose_method("apf")
    off = second(wrong, replace(run, journal=None), replace(method, back=replace(method.back, turned=None)))
    assert np.median(errors(off)[part, WRIST]) > 0.2


def test_views_that_the_first_pass_left_are_not_made_again_and_change_nothing(one_pass, monkeypatch):
    people, run = one_pass
    method = pose_method("apf")
    method = replace(method, back=replace(method.back, hidden_places=False, fit_body=None, turned=None, colors=None))
    clip, tracks = tiny_clip(FRAMES), true_tracks(FRAMES)
    grid = person_grid(clip, VOXEL_M)
    steps = stream_hulls(clip, grid, masks=kept_frames(run.masks, run.key, range(FRAMES)))
    views = {step.index: views_of(clip, grid, tracks, step) for step in steps}
    last = sorted(views)[FRAMES // 2 :]
    recent = RecentViews(sum(bytes_of(view) for frame in last for view in views[frame].values()))
    for frame, of_frame in views.items():
        recent.add(frame, of_frame)
    assert list(recent.views) == last  # the others no longer fitted
    carved = multiprocessing.get_context("fork").Value("q", 0)

    def counted(*args, **options):
        with carved.get_lock():  # processes count
            carved.value += 1
        return views_of(*args, **options)

    whole = second(people, run, method)
    monkeypatch.setattr("hmc.pose.second_pass.views_of", counted)
    for workers in (1, 2):
        carved.value = 0
        found = second(people, replace(run, workers=workers), method, recent)
        assert carved.value == FRAMES - len(last)
        np.testing.assert_array_equal(found.states.states, whole.states.states)
        np.testing.assert_array_equal(found.costs, whole.costs)


@pytest.mark.parametrize("kept", [False, True], ids=["made anew", "of the first pass"])
def test_who_may_be_turned_about_is_seen_on_the_way(one_pass, monkeypatch, kept):
    """The tiny clip's person walks."""
    people, run = one_pass
    clip, tracks = tiny_clip(FRAMES), true_tracks(FRAMES)
    steps = stream_hulls(clip, person_grid(clip, VOXEL_M), masks=kept_frames(run.masks, run.key, range(FRAMES)))
    recent = RecentViews()
    for step in steps if kept else ():
        recent.add(step.index, views_of(clip, person_grid(clip, VOXEL_M), tracks, step))
    seen = []

    def noted(rng, subject, state, view, *settings):
        seen.append((view.frame, view.velocity))
        return turn_about(rng, subject, state, view, *settings)

    monkeypatch.setattr("hmc.pose.backward.turn_about", noted)
    second(people, run, recent=recent if kept else None)
    speeds = dict(zip(tracks.frames.tolist(), velocities(tracks, clip.fps), strict=True))
    assert seen and all(np.hypot(*velocity[:2]) > 0.5 for _, velocity in seen)
    for frame, velocity in seen:
        np.testing.assert_allclose(velocity, speeds[frame])


def test_without_silhouettes_on_disk_the_poses_stay_and_a_note_says_so(one_pass):
    people, run = one_pass
    for without in (replace(run, masks=None), replace(run, key="another")):
        found = second(people, without)
        assert found.poses is people.poses and "one pass" in found.notes[-1]
    assert second(people, run, pose_method("apf", passes=1)) is people


@given(st.lists(st.one_of(st.floats(1e-6, 1e-2), st.just(float("nan"))), max_size=80), st.integers(1, 30))
@settings(max_examples=60, deadline=None)
def test_a_body_is_tried_on_frames_that_it_was_not_fitted_to(costs, n):
    costs = np.array(costs, float)
    picks, held_out = choose_frames(costs, n)
    good = np.flatnonzero(np.isfinite(costs))
    if len(good) < LEAST_BODY_FRAMES:
        assert picks == held_out == []
        return
    assert not set(picks) & set(held_out) and picks == sorted(picks) and 1 <= len(picks) <= n and held_out
    worst = np.sort(costs[good])[int(np.ceil(0.67 * len(good))) :]
    assert max(costs[[*picks, *held_out]]) <= worst.min() if len(worst) else True


def test_other_numbers_of_passes_are_refused():
    with pytest.raises(InputError, match="1 or 2"):
        pose_method("apf", passes=3)
    assert pose_method("apf").back is not None and pose_method("apf", "canton2009").back is None


@pytest.mark.slow
def test_who_stands_above_the_floor_is_not_pulled_down_to_it_and_it_is_told(monkeypatch):
    recording, n = tiny_clip(16), 16
    lowered = replace(recording, room=recording.room - np.array([[0, 0, 0.06], [0, 0, 0]]))

    def posed():
        people = hmc.pose(lowered, true_tracks(n), height_m=HEIGHT_M)
        return 1000 * np.linalg.norm(people.positions - true_joints(n), axis=-1).mean(), people.notes

    found, notes = posed()
    assert len(notes) == 1 and "person 0 stands some" in notes[0] and "cm above the floor (z = -0.06 m)" in notes[0]
    monkeypatch.setattr("hmc.pose.contacts.RAISED_M", np.inf)
    pulled, notes = posed()
    assert not notes and found < pulled - 2
