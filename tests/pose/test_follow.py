"""What holds for every pose method of the registry, run by the one driver: seeds, stopped runs, people whom nothing shows, limbs, legs."""

import importlib
import os
from dataclasses import replace

import numpy as np
import pytest
from drawn import draw_recording, walk
from methods import (
    CASES,
    HOUSE,
    MOST_FRAMES,
    QUICK,
    TINY,
    TRACKED,
    VOXEL_M,
    case_id,
    clip_views,
    each,
    followed,
    lean_method,
    lean_work,
    tiny_clip,
    true_detections,
    true_joints,
    true_tracks,
)
from numpy.testing import assert_array_equal
from stopped import Stopped, killed, noting, stopping

from hmc.body.exchange import swapped_pose
from hmc.body.joints import DOF_NAMES, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.proportions import make_body
from hmc.camera.segmentation import SegmentationSettings
from hmc.errors import InputError
from hmc.experiments.over_time import hidden
from hmc.io.masks import keep_masks
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable
from hmc.landmarks import landmark_index
from hmc.pose.follow import FollowOptions, PosedPeople, follow, persons_of
from hmc.pose.method import Capture, begin_tracking
from hmc.pose.person import NO_START, DecidedFrames, PersonState
from hmc.pose.recovery import LossSettings
from hmc.pose.registry import METHODS
from hmc.pose.views.person_view import PersonView
from hmc.processes import may_fork
from hmc.tracking.resumable import person_grid
from hmc.voxels.hulls import FrontendSettings, stream_hulls, stream_masks
from hmc.voxels.run_options import RunOptions

follow_module = importlib.import_module("hmc.pose.follow")
APF, CANTON, MARKERS = ("apf", "default"), ("apf", "canton2009"), ("marker-apf", "default")
FRAMES = MOST_FRAMES
#: Where nobody is.
EMPTY_M = [2.2, 2.0, 0.9]


@pytest.fixture(scope="module", autouse=True)
def little_work():
    with pytest.MonkeyPatch.context() as patch:
        lean_work(patch)
        yield


@pytest.fixture(scope="module")
def whole():
    """A run of a method without a stop, made once."""
    runs: dict[tuple[str, str], PosedPeople] = {}

    def run(case) -> PosedPeople:
        if case not in runs:
            runs[case] = followed(case, FRAMES)
        return runs[case]

    return run


def equal(one: PosedPeople, other: PosedPeople) -> None:
    for a, b in ((one.poses, other.poses), (one.states, other.states)):
        assert_array_equal(a.frames, b.frames)
        assert_array_equal(a.persons, b.persons)
    assert_array_equal(one.poses.positions, other.poses.positions)
    assert_array_equal(one.states.states, other.states.states)
    assert_array_equal(one.costs, other.costs)
    assert one.states.bodies == other.states.bodies and one.notes == other.notes
    assert one.status == other.status and [dict(told) for told in one.details] == [dict(told) for told in other.details]


def body_of(people: PosedPeople, case, person=0):
    return make_body(people.states.bodies[person], lean_method(*case).limits)


# --- what a run gives


def test_the_registry_and_its_cases_are_the_same_methods():
    assert {name for name, _ in CASES} == set(METHODS) - {"keypoints"}
    assert all(lean_method(*case).name == case[0] and lean_method(*case).source for case in CASES)


@each(CASES)
def test_every_frame_of_a_track_has_a_row_and_the_poses_are_those_of_states_and_bodies(whole, case):
    people = whole(case)
    assert people.poses.frames.tolist() == list(range(FRAMES)) and set(people.poses.persons) == {0}
    assert len(people.status) == len(people.details) == len(people.costs) == FRAMES
    fitted = np.array(people.status) == "fitted"
    assert fitted.sum() >= (FRAMES if case != ("pso", "hsiao2008") else 4)
    assert people.states.dof_names == DOF_NAMES
    body, states = body_of(people, case), people.states.states[fitted]
    known = np.isfinite(states)
    # As printed, a limb that is in doubt once is left out at once: what hangs on an angle that is not known is not known.
    assert known.all(axis=1).sum() >= (1 if "ddm" in case[0] and case[1] == "canton2009" else 4)
    found = people.poses.positions[fitted]
    told = np.isfinite(found)
    assert told[known.all(axis=1)].all()
    assert_array_equal(landmarks(body, np.where(known, states, 0.0))[told], found[told])
    assert np.isnan(people.poses.positions[~fitted]).all()
    # Inverse kinematics may end a rounding beyond a limit.
    assert np.all((states >= body.limits.low - 1e-9)[known] & (states <= body.limits.high + 1e-9)[known])


@each(HOUSE)
def test_in_the_house_s_company_every_method_has_the_person(whole, case):
    people = whole(case)
    assert people.notes == ()
    error = np.linalg.norm(people.poses.positions - true_joints(FRAMES), axis=-1)
    assert error[:, landmark_index("pelvis")].max() < 0.15 and np.median(error) < 0.10
    assert np.isfinite(people.costs).all() and (people.costs > 0).all()


@each([case for case in CASES if case not in HOUSE and case[0] != "marker-apf"])
def test_the_papers_methods_are_where_the_person_is(case):
    """From silhouettes as the papers have them: a mixture of Gaussians with shadow removal, which nothing repairs."""
    mixture = SegmentationSettings(gap_threshold=1e9, reach_threshold=1e9, halo_share=0.0)
    people = followed(case, FRAMES, RunOptions(frontend=FrontendSettings(mixture, complete=False, cut_shadows=False)))
    error = np.linalg.norm(people.poses.positions - true_joints(FRAMES), axis=-1)
    assert np.nanmax(error[:, landmark_index("pelvis")]) < 0.35


@each(CASES)
def test_another_seed_gives_another_result(whole, case):
    other, people = followed(case, 3, seed=4), whole(case)
    differences = np.abs(other.poses.positions - people.poses.positions[:3])
    assert np.nanmax(differences) > 1e-4


# --- runs that are stopped


def stopped_and_resumed(case, tmp_path, stop, **how):
    """Stop a run after so many frames, with a torn line in its journal; finish it. What it came to, the frames that were visited, files."""
    kept = {"journal": tmp_path / "journal", "key": "run"}
    with pytest.raises(Stopped):
        followed(case, FRAMES, RunOptions(**kept, progress=stopping(stop)), **how)
    beside = sorted(path.name for path in tmp_path.iterdir() if path.suffix == ".npz")
    with open(kept["journal"], "a") as file:
        file.write('{"person":0,"frames":[2],"sta')  # the power went while a line was written
    seen: list[int] = []
    people = followed(case, FRAMES, RunOptions(**kept, progress=noting(seen)), **how)
    again: list[int] = []
    equal(followed(case, FRAMES, RunOptions(**kept, progress=noting(again)), **how), people)
    assert again == []  # a finished run is read back without a frame being touched
    return people, seen, beside


@each(CASES)
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been(whole, case, tmp_path):
    """What each remembers besides the pose is in a file beside the journal: particles, colors, evidence for a heading, markers' places."""
    people, seen, beside = stopped_and_resumed(case, tmp_path, 5)
    equal(people, whole(case))
    # What was decided is not computed again; legs are decided two frames later.
    decided = 3 if lean_method(*case).legs is not None else 5
    assert seen[0] == decided
    remembers = lean_method(*case).recover is not None or case[1] != "default"
    assert remembers == bool(beside)
    for name in beside:
        assert name in ("journal.0.0.npz", "journal.0.1.npz")
        with np.load(tmp_path / name, allow_pickle=False) as data:
            assert any(entry.startswith("memory_") for entry in data.files)


@pytest.mark.parametrize("stop", [1, 2, 3, 4, 6])
def test_wherever_it_was_stopped(whole, stop, tmp_path):
    """While the person is watched, in the frame in which that ends, and while followed."""
    people, seen, _ = stopped_and_resumed(CANTON, tmp_path, stop)
    equal(people, whole(CANTON))
    assert seen[0] <= stop


@pytest.mark.slow
@pytest.mark.parametrize("case", [("smd", "default"), ("marker-apf", "canton2009")], ids=case_id)
def test_hulls_that_are_made_anew_lead_to_the_same(case, tmp_path, monkeypatch):
    """From images, from silhouettes that the tracker kept, and from the frame on in which a run goes on."""
    monkeypatch.setattr("hmc.pose.follow.stream_hulls", stream_hulls)
    clip, masks = tiny_clip(5), tmp_path / "masks"
    for _ in keep_masks(masks, "run", 0, stream_masks(clip), pytest.fail):
        pass
    expected = followed(case, 5)
    equal(followed(case, 5, RunOptions(masks=masks, key="run")), expected)
    kept = {"journal": tmp_path / "journal", "masks": masks, "key": "run"}
    with pytest.raises(Stopped):
        followed(case, 5, RunOptions(**kept, progress=stopping(4)))
    equal(followed(case, 5, RunOptions(**kept)), expected)


@pytest.mark.slow
@pytest.mark.parametrize("case", [case for case in CASES if case[1] == "default"], ids=case_id)
def test_a_run_that_was_killed_goes_on_to_the_same_bytes(whole, case, tmp_path):
    """The process ends in the middle of a frame, without a word."""
    kept = RunOptions(journal=tmp_path / "journal", key="run")
    killed(followed_until, case, tmp_path / "journal")
    assert (tmp_path / "journal").exists()
    equal(followed(case, FRAMES, kept), whole(case))


def followed_until(dies, case, journal):
    """In a process of its own: a run that dies in its sixth frame."""
    with pytest.MonkeyPatch.context() as patch:
        lean_work(patch)
        method = lean_method(*case)

        def step(rng, tracked, view):
            if view.frame == 5:
                dies()
            return method.step(rng, tracked, view)

        followed(case, FRAMES, RunOptions(journal=journal, key="run"), method=replace(method, step=step))


def test_a_journal_of_another_run_is_begun_anew(tmp_path):
    kept = {"journal": tmp_path / "journal"}
    with pytest.raises(Stopped):
        followed(CANTON, FRAMES, RunOptions(**kept, key="one", progress=stopping(5)), seed=1)
    anew = followed(CANTON, FRAMES, RunOptions(**kept, key="other"), seed=2)
    equal(anew, followed(CANTON, FRAMES, seed=2))


def test_a_damaged_journal_ends_where_it_is_damaged(tmp_path, whole):
    (tmp_path / "journal").write_text('{"key":"run"}\nnot json\n{"person":0}\n')
    people = followed(APF, FRAMES, RunOptions(journal=tmp_path / "journal", key="run"))
    assert_array_equal(people.poses.positions, whole(APF).poses.positions)


# --- frames and people whom nothing shows


def test_what_an_experiment_hides_is_not_seen(tmp_path):
    """Hulls are changed before anybody sees them, be silhouettes new or kept."""
    run = RunOptions(masks=tmp_path / "masks", key="clip")
    for _ in range(2):
        people = followed(("apf", "default"), FRAMES, run, change=lambda step: hidden(step, 0, 10**9))
        assert set(people.status) == {NO_START} and np.isnan(people.positions).all()


@each(TRACKED)
def test_a_track_without_a_hull_gets_no_pose_and_a_note(whole, case):
    """A second track stands where nobody is; the first person is not disturbed by it."""
    tracks, ghost = true_tracks(FRAMES), TrackTable(np.arange(1, 6), np.full(5, 7), np.tile(EMPTY_M, (5, 1)))
    both = TrackTable(*(np.concatenate([getattr(one, name) for one in (tracks, ghost)]) for name in ("frames", "persons", "positions")))
    people, alone = followed(case, FRAMES, tracks=both), whole(case)
    lost = people.poses.of(7)
    assert lost.frames.tolist() == [1, 2, 3, 4, 5] and np.isnan(lost.positions).all()
    assert people.states.frames.tolist() == people.poses.frames.tolist() and set(people.states.bodies) == {0}
    about = [note for note in people.notes if note.startswith("person 7")]
    assert len(about) == 1 and about[0].startswith("person 7: 5 frames without a pose: ")
    assert_array_equal(people.poses.of(0).positions, alone.poses.positions)


@each(CASES)
def test_frames_in_which_a_person_is_not_shown_are_nan_and_noted(case):
    """The track leaves the person for two frames, or no marker is seen in them: the pose waits and is not given out as one."""
    tracks = true_tracks(FRAMES)
    tracks.positions[4:6] = EMPTY_M
    people = followed(case, FRAMES, tracks=tracks, detections=true_detections(FRAMES, without=(4, 5)))
    fitted = [status == "fitted" for status in people.status]
    assert fitted[4:6] == [False] * 2
    # So few particles as here lose the thesis's swarm a frame.
    assert sum(fitted[:4]) == 4 or (case == ("pso", "hsiao2008") and sum(fitted[:4]) == 3)
    assert np.isnan(people.poses.positions[4:6]).all() and np.isnan(people.costs[4:6]).all()
    assert_array_equal(np.isfinite(people.poses.positions).any((1, 2)), fitted)
    assert any(note.startswith("person 0: 2 frames without a pose: ") for note in people.notes)


@each(TRACKED)
@pytest.mark.slow
def test_one_camera_is_enough_to_run(case):
    """What it shows is little, and the run ends in rows that say so or in poses of finite numbers."""
    people = followed(case, 4, recording=tiny_clip(4, ("cam_00",)))
    assert people.poses.frames.tolist() == [0, 1, 2, 3]
    for status, positions in zip(people.status, people.poses.positions, strict=True):
        assert np.isfinite(positions).any() == (status == "fitted")


def test_one_camera_is_not_enough_for_markers():
    with pytest.raises(InputError, match="two cameras"):
        followed(MARKERS, 3, recording=tiny_clip(3, ("cam_00",)))


def test_a_method_that_needs_detections_asks_for_them():
    with pytest.raises(InputError, match="needs detections"):
        follow(tiny_clip(3), None, lean_method(*MARKERS), FollowOptions(VOXEL_M))


@pytest.fixture(scope="module")
def pair(tmp_path_factory, ring):
    """Two drawn people, one of whom walks past the other."""
    frames = [[*one, (0.9, -0.9)] for one in walk(30)[:4]]
    places = np.array([[*place, 0.9] for frame in frames for place in frame])
    folder = draw_recording(tmp_path_factory.mktemp("pair") / "two", ring, frames)
    return open_recording(folder), TrackTable(np.repeat(np.arange(4), 2), np.tile([3, 5], 4), places)


@each(TRACKED)
@pytest.mark.slow
def test_two_people_keep_their_numbers(pair, case):
    """Drawn people are egg-shaped, but each is fitted where it stands."""
    recording, tracks = pair
    people = follow(recording, tracks, lean_method(*case), FollowOptions(0.08))
    assert people.poses.frames.tolist() == [0, 0, 1, 1, 2, 2, 3, 3] and people.poses.persons.tolist() == [3, 5] * 4
    off = np.abs(people.poses.positions[:, 0, :2] - tracks.positions[:, :2])
    assert np.all(np.isnan(off) | (off < 0.4))
    if case[0] != "pso" or case[1] == "default":  # eggs have no curves
        assert np.isfinite(off).all() and set(people.states.bodies) == {3, 5}


# --- what the house gives to any method


@pytest.fixture(scope="module")
def subjects(whole):
    """The body that a method's run found, as its step takes it; the state of the third frame."""

    def subject(case):
        people, method = whole(case), lean_method(*case)
        clip = tiny_clip(FRAMES)
        capture = Capture(clip.fps, VOXEL_M, clip.room, clip.rig)
        return method.equip(body_of(people, case), capture), people.states.states[2].copy()

    return subject


def worst(tracked, frame: int, *names: str) -> float:
    """The largest error among some landmarks, metres."""
    rows = [landmark_index(name) for name in names]
    found, truth = landmarks(tracked.subject.body, tracked.state)[rows], true_joints(FRAMES)[frame, rows]
    return float(np.linalg.norm(found - truth, axis=1).max())


@each(HOUSE)
def test_a_lost_limb_is_found(subjects, case):
    """An arm held out where there is nothing."""
    method, (subject, state) = lean_method(*case), subjects(case)
    state[dof_index("l_shoulder_x", "l_shoulder_z", "l_elbow_z")] = 1.4, 0.0, -0.2
    tracked = begin_tracking(subject, state)
    assert worst(tracked, 2, "l_wrist") > 0.3
    for frame in range(3, 6):
        tracked, info = method.step(np.random.default_rng([0, frame]), tracked, clip_views()[frame])
        assert info.status == "fitted"
    assert worst(tracked, 5, "l_elbow", "l_wrist") < 0.12


@each(HOUSE)
@pytest.mark.slow
def test_legs_that_a_step_exchanged_are_told(case):
    """In one frame a method ends with exchanged legs: without what tells them they stay so."""
    method = lean_method(*case)

    def confused(rng, tracked, view):
        tracked, info = method.step(rng, tracked, view)
        if view.frame != 4:
            return tracked, info
        return replace(tracked, state=swapped_pose(tracked.subject.body, tracked.state, "legs")), info

    feet = [landmark_index("l_ankle"), landmark_index("r_ankle")]

    def errors(**without):
        positions = followed(case, FRAMES, method=replace(method, step=confused, **without)).poses.positions
        return np.linalg.norm(positions[:, feet] - true_joints(FRAMES)[:, feet], axis=-1).max(1)

    assert errors().max() < 0.15
    if case == QUICK[0]:
        assert errors(alternatives=None, legs=None)[4] > 0.4


@each(HOUSE)
def test_a_person_who_was_left_behind_is_found_again(subjects, case):
    method, (subject, state) = lean_method(*case), subjects(case)
    recover = replace(method.recover, settings=LossSettings(patience_s=0.1))
    state[:2] += 1.5, 1.0
    tracked = begin_tracking(subject, state, memory=recover.first(np.array([1e-4])))
    for frame in range(2, 6):
        rng = np.random.default_rng([0, frame])
        view = clip_views()[frame]
        tracked, _ = recover(rng, tracked, method.step(rng, tracked, view), view)
    assert worst(tracked, 5, "pelvis", "head_top") < 0.15


# --- selections, gaps and rooms: the driver's own, with the quickest method


def test_a_track_with_a_gap(tmp_path):
    tracks = true_tracks(FRAMES)
    kept = tracks.where(~np.isin(tracks.frames, [4]))
    whole = followed(CANTON, FRAMES, tracks=kept)
    assert whole.poses.frames.tolist() == [0, 1, 2, 3, 5, 6]
    people, _, _ = stopped_and_resumed(CANTON, tmp_path, 5, tracks=kept)
    equal(people, whole)


def test_a_selection_counts_frames_absolutely_and_tracks_may_go_on_after_it():
    for case in (CANTON, APF):
        people = followed(case, FRAMES, recording=open_recording(TINY, start=1, frames=3))
        assert people.poses.frames.tolist() == [1, 2, 3] and np.isfinite(people.poses.positions).all()


def test_one_frame_is_enough():
    people = followed(CANTON, 1)
    assert people.poses.frames.tolist() == [0] and np.isfinite(people.poses.positions).all()


def test_nobody_gives_empty_tables(tmp_path, ring):
    folder = draw_recording(tmp_path / "empty", ring, [[]] * 3)
    nobody = TrackTable(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)))
    people = follow(open_recording(folder), nobody, lean_method(*APF), FollowOptions(0.08))
    assert people.poses.positions.shape == (0, 15, 3) and people.states.states.shape == (0, len(DOF_NAMES))
    assert people.notes == () and not people.states.bodies


def test_a_person_at_the_edge_of_the_room(tmp_path, ring):
    """Half of the drawn body stands outside the room."""
    folder = draw_recording(tmp_path / "edge", ring, [[(1.95, 0.0)]] * 2)
    track = TrackTable(np.arange(2), np.zeros(2, int), np.tile([1.9, 0.0, 0.9], (2, 1)))
    people = follow(open_recording(folder), track, lean_method(*CANTON), FollowOptions(0.08))
    assert len(people.poses.frames) == 2
    found = people.poses.positions[np.isfinite(people.poses.positions).all((1, 2))]
    assert len(found) == 2 and np.all(np.abs(found[:, 0, :2] - [1.9, 0.0]) < 0.6)


def test_voxels_that_do_not_fit_are_refused():
    with pytest.raises(InputError, match="would fit"):
        follow(tiny_clip(3), true_tracks(3), lean_method(*APF), FollowOptions(0.0005))
    with pytest.raises(InputError, match="would fit"):
        person_grid(tiny_clip(3), 0.0005)


@pytest.mark.skipif(not may_fork(), reason="processes are forked on Linux alone")
def test_people_beside_others_are_followed_in_processes_of_their_own(monkeypatch, pair):
    """With steps that add up what they see, and tell who took them."""
    recording, tracks = pair

    def step(task, person, state, view):
        total = (0.0 if state.tracked is None else state.tracked.state) + np.full(len(DOF_NAMES), person.number * view.frame + 1.0)
        tracked = None if view.frame < 1 else begin_tracking(None, total)
        rows = DecidedFrames(person.number, (view.frame,), total[None], (os.getpid(),), tracked)
        return replace(state, tracked=tracked, done_to=view.frame), [rows]

    monkeypatch.setattr(follow_module, "person_step", step)
    monkeypatch.setattr(follow_module, "starts_with", lambda *_: False)
    found = {}
    for workers in (1, 2, 5):
        persons = persons_of(recording, tracks)
        views = iter([(frame, dict.fromkeys((3, 5), PersonView(frame))) for frame in range(4)])
        states = dict.fromkeys(persons, PersonState())
        rows = list(follow_module._decided(None, persons, states, views, RunOptions(workers=workers)))
        order = sorted(rows, key=lambda pair: (pair[0].person, pair[0].frames))
        found[workers] = [(one.person, one.frames, one.states.sum(), before) for one, before in order]
        apart = {one.person for one, _ in order if one.infos[0] != os.getpid()}
        assert apart == (set() if workers == 1 else {5})
    assert len(found[1]) == 8 and found[1] == found[2] == found[5]
