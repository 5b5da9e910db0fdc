"""A session: images in, people out, frame by frame; near the truth, as a recording's tracks, and no larger with time."""

import pickle
from dataclasses import replace
from functools import cache
from itertools import chain, repeat
from threading import Event
from time import sleep
from types import SimpleNamespace

import numpy as np
import pytest
from drawn import draw_recording, walk
from methods import TINY, lean_method, lean_work, tiny_clip, true_joints
from numpy.testing import assert_allclose, assert_array_equal
from threadpoolctl import threadpool_info, threadpool_limits

import hmc
from hmc.body.kinematics import landmarks
from hmc.io.recording import background_frames, iterate_frames, reduced
from hmc.session import front, step
from hmc.session.newest import live
from hmc.session.step import session_step
from hmc.voxels.looks import look_once

FRAMES = 12


@pytest.fixture(scope="module", autouse=True)
def little_work():
    with pytest.MonkeyPatch.context() as patch:
        lean_work(patch)
        yield


@cache
def clip_images(frames=FRAMES):
    """The clip's images, one tuple a frame."""
    return [frame.images for frame in iterate_frames(tiny_clip(frames))]


@cache
def empty_scene():
    """Images of the clip's empty scene, one list a camera."""
    clip = tiny_clip(FRAMES)
    return [list(background_frames(clip, camera)) for camera in range(len(clip.rig))]


@cache
def settings(posed=True):
    clip = tiny_clip(FRAMES)
    return front.session_settings(clip.rig, clip.fps, clip.room, lean_method("apf") if posed else None, 1.76, 1, voxel_size_m=0.05)


def begun(posed=True):
    return front.begin_session(settings(posed), empty_scene())


def stepped(frames, posed=True, state=None):
    """The states after each of these frames, and what they show."""
    state, states, found = state or begun(posed), [], []
    for images in frames:
        state, one = session_step(settings(posed), state, images)
        states.append(state)
        found.append(one)
    return states, found


@cache
def watched():
    return stepped(clip_images())


def errors(decided):
    """Of every landmark of these poses, metres."""
    truth = true_joints(FRAMES)
    return np.concatenate([np.linalg.norm(landmarks(one.body, one.states) - truth[list(one.frames)], axis=-1).ravel() for one in decided])


def test_poses_are_near_the_truth_and_no_later_than_is_said():
    found = watched()[1]
    shown = [(one.index, one.people[0]) for one in found if 0 in one.people and one.people[0].landmarks is not None]
    truth = true_joints(FRAMES)
    assert np.median([np.linalg.norm(person.landmarks - truth[person.decided_frame], axis=-1) for _, person in shown]) < 0.12
    assert np.median([np.linalg.norm(person.latest - truth[index], axis=-1) for index, person in shown]) < 0.12
    assert np.median([np.linalg.norm(person.head - truth[index, 2]) for index, person in shown]) < 0.2
    first = next(one.index for one in found if one.people)
    fps = settings().scene.fps
    assert shown[0][0] - first + 1 == round(settings().first_delay_s * fps)
    assert max(index - person.decided_frame for index, person in shown) <= round(settings().delay_s * fps)
    for _, person in shown:
        assert_allclose(landmarks(person.body, person.state), person.landmarks)


def test_every_frame_of_a_person_is_decided_once():
    states, found = watched()
    first = next(one.index for one in found if one.people)
    state, rest = front.end_session(settings(), states[-1])
    decided = [*chain.from_iterable(one.decided for one in found), *rest]
    assert [frame for one in decided for frame in one.frames] == list(range(first, FRAMES))
    assert np.median(errors(decided)) < 0.12
    assert not state.people and not state.tracker.tracks


def test_tracks_are_those_of_the_recording_from_when_a_person_is_told():
    tracks, found = hmc.track(tiny_clip(FRAMES)), stepped(clip_images(), posed=False)[1]
    told = [one for one in found if one.people]
    assert [one.index for one in told] == list(range(told[0].index, FRAMES)) and told[0].index <= 4
    rows = tracks.where(tracks.frames >= told[0].index)
    assert_array_equal([one.people[0].position for one in told], rows.positions)
    assert_array_equal([one.people[0].head for one in told], rows.heads)
    assert all(one.people[0].landmarks is None for one in told)


def test_a_step_leaves_its_state_as_it_was_and_can_be_taken_again():
    states, _ = watched()
    before = states[-2]  # between two frames in which the empty scene is learnt
    kept = pickle.dumps(replace(before, models=()))
    (one,), (shown,) = stepped(clip_images()[-1:], state=before)
    assert pickle.dumps(replace(before, models=())) == kept
    (two,), (again,) = stepped(clip_images()[-1:], state=before)
    assert_array_equal(one.people[0].pose.tracked.state, two.people[0].pose.tracked.state)
    assert_array_equal(shown.people[0].position, again.people[0].position)


def test_images_are_not_kept():
    """A camera writes its next image where the last one was."""
    buffers, states = [image.copy() for image in clip_images()[0]], begun()
    for images in clip_images():
        for buffer, image in zip(buffers, images, strict=True):
            buffer[...] = image
        states, found = session_step(settings(), states, buffers)
        for buffer in buffers:
            buffer[...] = 0
    assert_array_equal(found.people[0].latest, watched()[1][-1].people[0].latest)


def test_large_images_are_made_smaller(halved_images, monkeypatch):
    """As if cameras with half as many pixels had filmed, but that averaging is known to lower noise."""
    monkeypatch.setattr("hmc.camera.noise.LEAST_LEFT", 1.0)
    clip = tiny_clip(FRAMES)
    with_full = front.session_settings(clip.rig, clip.fps, clip.room, None, persons=1, full_images=True)
    large = front.session_settings(clip.rig, clip.fps, clip.room, None, persons=1)
    assert with_full.scene.rig is clip.rig and with_full.scene.factors == (1,) * 7
    assert large.rig is clip.rig and large.scene.factors == (2,) * 7 and {camera.size for camera in large.scene.rig} == {(160, 120)}
    halved = reduced(clip, (2,) * 7)
    small = front.session_settings(halved.rig, clip.fps, clip.room, None, persons=1, full_images=True)
    ends = []
    for chosen, recording in ((large, clip), (small, halved)):
        state = front.begin_session(chosen, [background_frames(recording, camera) for camera in range(7)])
        for frame in iterate_frames(recording):
            state, found = session_step(chosen, state, frame.images)
        ends.append(found.people[0].position)
    assert_array_equal(*ends)


def test_a_camera_that_drops_out_and_a_moment_without_any():
    without = [(None, *images[1:]) if index > 6 else images for index, images in enumerate(clip_images())]
    without[8] = (None,) * len(without[8])
    found = stepped(without)[1]
    names = settings().scene.rig.names
    assert found[7].silent == names[:1] and found[8].silent == names and not found[6].silent
    assert not found[8].people and sorted(found[9].people) == [0]
    assert np.median(np.linalg.norm(found[-1].people[0].latest - true_joints(FRAMES)[-1], axis=-1)) < 0.12


def test_who_leaves_is_forgotten_and_an_empty_room_takes_no_memory():
    states, found = stepped(clip_images())
    empty = [images[0] for images in empty_scene()]
    after, shown = stepped(repeat(empty, 60), state=states[-1])
    rest = [frame for one in shown for two in one.decided for frame in two.frames]
    assert rest[0] == 1 + max(frame for one in found for two in one.decided for frame in two.frames)
    assert not any(one.people for one in shown[1:]) and not after[-1].people and not after[-1].tracker.tracks
    sizes = [len(pickle.dumps(replace(state, models=()))) for state in after]
    assert sizes[-1] == sizes[30] < sizes[0]  # what is left are the colors of who left
    many = replace(after[-1], tracker=replace(after[-1].tracker, departed=after[-1].tracker.departed * 1000))
    assert len(session_step(settings(), many, empty)[0].tracker.departed) == 50


def test_views_are_held_for_the_window_alone():
    states, _ = watched()
    held = [len(person.pose.watched) for state in states for person in state.people.values()]
    open_frames = [len(person.pose.followed) for state in states for person in state.people.values()]
    task = settings().task
    assert max(held) == task.window - 1 and max(open_frames) < task.window + 2 * task.lag


def test_candidates_who_never_become_persons_do_not_grow(monkeypatch):
    """No one can be there, it is said, and one is."""
    monkeypatch.setattr("hmc.session.step.CANDIDATE_S", 1.0)
    state = begun(posed=False)
    for images in clip_images()[:5]:
        state, _ = session_step(settings(False), state, images)
    state = replace(state, tracker=replace(state.tracker, tracks=(), memories=(), most=0))
    rows = []
    for _ in range(25):
        state, _ = session_step(settings(False), state, clip_images()[5])
        rows.append(max((len(one.rows) for one in state.tracker.candidates), default=0))
    assert rows[-1] == rows[-2] == settings(False).scene.fps > rows[10]


def test_arrays_alone_are_enough(tmp_path, ring):
    """No recording and no path: the drawn person's track from images in memory, backgrounds by name, and any room."""
    recording = hmc.open_recording(draw_recording(tmp_path / "walk", ring, walk(8)))
    images = [frame.images for frame in iterate_frames(recording)]
    empty = {camera.name: np.stack(list(background_frames(recording, c))) for c, camera in enumerate(ring)}
    session = hmc.Session(ring, empty, fps=20, method=None, persons=1)
    (tmp_path / "walk").rename(tmp_path / "gone")
    found = [one.people for one in map(session.step, images)]
    assert len(found[-1]) == 1 and np.hypot(*(found[-1][0].position[:2] - (0.8, 0.3))) < 0.1


def test_the_lines_of_the_readme_run():
    clip = tiny_clip(FRAMES)
    page = (TINY.parents[2] / "README.md").read_text(encoding="utf-8").split("## Images in memory, and live")[1]
    arrays, lines = (part.split("```")[0] for part in page.split("```python\n")[1:3])
    assert len(arrays.splitlines()) <= 10 and len(lines.splitlines()) <= 10
    calibration = [(one.name, one.size, one.matrix, one.distortions, one.rotation, one.translation) for one in clip.rig]
    names = {"calibration": calibration, "background": empty_scene(), "frames": clip_images()[:6]}
    names["images"] = [np.stack(own) for own in zip(*clip_images(), strict=True)]
    exec(compile(arrays, "README.md", "exec"), names)
    assert np.isfinite(names["people"].positions).all() and len(names["people"].frames) == len(names["images"][0])
    exec(compile(lines, "README.md", "exec"), names)
    assert list(names["found"].people) == [0] and names["person"].position.shape == (3,)


def test_linear_algebra_has_one_thread_in_a_step_and_as_many_as_before_after_it(monkeypatch):
    def threads():
        return [library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"]

    seen = []

    def look(*given):
        seen.append(threads())
        return look_once(*given)

    monkeypatch.setattr(step, "look_once", look)
    with threadpool_limits(2, "blas"):
        before = threads()
        stepped(clip_images()[:1], posed=False)
        assert threads() == before
    assert seen and set(seen[0]) == {1}


def test_wrong_input_is_told_in_a_line():
    clip, images, state = tiny_clip(FRAMES), clip_images()[0], begun(posed=False)
    first = clip.rig.names[0]

    def step(images):
        return session_step(settings(False), state, images)

    with pytest.raises(hmc.InputError, match=f"one image a camera, {len(images)} of them.*got {len(images) - 1}"):
        step(images[1:])
    with pytest.raises(hmc.InputError, match=r"one image a camera.*NoneType"):
        step(None)
    with pytest.raises(
        hmc.InputError, match=rf"'{first}': its image must be uint8, shape \(240, 320, 3\), BGR; got uint8 of shape \(120, 160, 3\)"
    ):
        step([images[0][::2, ::2], *images[1:]])
    for wrong in (images[0][..., 0], images[0] / 255, "frame.png"):
        with pytest.raises(hmc.InputError, match=f"'{first}': its image must be uint8, shape"):
            step([wrong, *images[1:]])
    with pytest.raises(hmc.InputError, match=f"no background for camera '{first}'"):
        front.begin_session(settings(False), [[], *empty_scene()[1:]])
    with pytest.raises(hmc.InputError, match=f"no background for camera '{first}'"):
        front.begin_session(settings(False), dict(zip(clip.rig.names[1:], empty_scene()[1:], strict=True)))
    with pytest.raises(hmc.InputError, match="background is of 2 cameras, the rig has 7"):
        front.begin_session(settings(False), empty_scene()[:2])
    with pytest.raises(hmc.InputError, match="an image of its background must be uint8, shape"):
        front.begin_session(settings(False), [images[0], *empty_scene()[1:]])
    with pytest.raises(hmc.InputError, match="needs more than images"):
        front.session_settings(clip.rig, method="marker-apf")
    with pytest.raises(hmc.InputError, match="two at least"):
        front.session_settings(hmc.Rig(tuple(clip.rig)[:1]))
    with pytest.raises(hmc.InputError, match="`room` must be"):
        front.session_settings(clip.rig, room=np.zeros((2, 3)))
    with pytest.raises(hmc.InputError, match="`fps` must be"):
        front.session_settings(clip.rig, fps=0)
    with pytest.raises(hmc.InputError, match="`height_m` must be"):
        front.session_settings(clip.rig, height_m=176)
    assert step(images)[1].index == 0  # the state is good still


class Slow:
    """Stands for a session that works on the first frame until it is let go."""

    def __init__(self, fps):
        self.fps, self.seen, self.go = fps, [], Event()

    def step(self, images):
        self.seen.append(images)
        assert self.go.wait(10)
        return SimpleNamespace(index=len(self.seen))


def counting(session, n, pause_s=0.0):
    """Numbers for images: the first alone, the others while it is worked on."""
    yield 0
    while not session.seen:
        sleep(0.001)
    for k in range(1, n):
        sleep(pause_s)
        yield k
    session.go.set()


def test_of_frames_that_came_meanwhile_the_newest_is_taken(caplog):
    session, told = Slow(fps=1e9), []
    done = live(session, counting(session, 10), lambda found, images: told.append(images))
    assert session.seen == told == [0, 9] and (done.steps, done.dropped, done.between) == (2, 8, 0)
    assert "8 of 10 frames were dropped" in caplog.text and "fewer frames a second (`fps`)" in caplog.text


def test_frames_may_wait():
    session = Slow(fps=1e9)
    done = live(session, counting(session, 10), lambda found, images: None, wait_s=4e-9)
    assert session.seen == [0, 6, 7, 8, 9] and done.dropped == 5


def test_frames_that_come_too_soon_are_left_out():
    session = Slow(fps=1e-3)
    done = live(session, counting(session, 10), lambda found, images: None)
    assert session.seen == [0] and (done.steps, done.dropped, done.between) == (1, 0, 9)


def test_a_source_that_fails_is_told_and_the_caller_can_stop():
    session = Slow(fps=1e9)
    session.go.set()

    def failing():
        yield 0
        raise OSError("unplugged")

    with pytest.raises(OSError, match="unplugged"):
        live(session, failing(), lambda found, images: None)
    assert live(session, iter(range(100)), lambda found, images: False).steps == 1


def test_it_is_the_public_one():
    assert hmc.Session is front.Session and hmc.live is live and TINY.is_dir()
    session = hmc.Session(tiny_clip(FRAMES).rig, empty_scene(), 15, tiny_clip(FRAMES).room, lean_method("apf"), voxel_size_m=0.05)
    assert (session.fps, session.first_delay_s, session.delay_s) == (15, settings().first_delay_s, settings().delay_s)
    assert [sorted(session.step(images).people) for images in clip_images()[:6]][-1] == [0]
    assert [one.frames for one in session.end()] == [(3, 4, 5)] and session.end() == () and session.state.index == 6
