"""Poses of whole recordings: a run that was stopped equals one that was not, both presets, people without a hull, nobody."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from drawn import draw_recording, walk
from numpy.testing import assert_array_equal
from stopped import Stopped, noting, stopping

from hmc.body.joints import DOF_NAMES, canton_limits, default_limits
from hmc.body.kinematics import landmarks
from hmc.body.proportions import make_body
from hmc.errors import InputError
from hmc.io.recording import open_recording
from hmc.io.results import TrackTable, read_centroids, read_joints
from hmc.landmarks import landmark_index
from hmc.pose.legs import LegSettings
from hmc.pose.person import FollowSettings
from hmc.pose.sequence import pose_recording as pose_whole_recording
from hmc.pose.starts.window import StartSettings
from hmc.pose.steps.limb_search import SearchSettings
from hmc.pose.steps.presets import PRESETS
from hmc.search.filters import AnnealedSettings

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
FRAMES, VOXEL_M = 7, 0.05
# Little work a frame; everything else as in the presets.
PRESET = {
    "default": replace(
        PRESETS["default"],
        annealed=AnnealedSettings(layers=2, particles=30, survival_rate=0.1, spread=0.5),
        search=SearchSettings(draws=40),
    ),
    "canton2009": replace(PRESETS["canton2009"], annealed=AnnealedSettings(layers=3, particles=60)),
}

# People are watched for three frames, so that frames are left to follow them, and few starts are tried.
SETTINGS = FollowSettings(window_s=0.2, start=StartSettings(anchors=1, candidates=1), legs=LegSettings(lag_s=0.1))
pose_recording = partial(pose_whole_recording, settings=SETTINGS)


@pytest.fixture(scope="module")
def recording():
    """The small rendered clip that comes with the package."""
    return open_recording(TINY, frames=FRAMES)


@pytest.fixture(scope="module")
def tracks():
    """The true centroids, so that nothing here depends on the tracker."""
    truth = read_centroids(TINY / "truth" / "centroids.csv")
    return truth.where(truth.frames < FRAMES)


@pytest.fixture(scope="module", params=PRESET)
def whole(request, recording, tracks):
    """A run without a stop, and its preset's name."""
    return request.param, pose_recording(recording, tracks, VOXEL_M, PRESET[request.param], seed=3)


def equal(one, other) -> None:
    for a, b in ((one.poses, other.poses), (one.states, other.states)):
        assert_array_equal(a.frames, b.frames)
        assert_array_equal(a.persons, b.persons)
    assert_array_equal(one.poses.positions, other.poses.positions)
    assert_array_equal(one.states.states, other.states.states)
    assert_array_equal(one.costs, other.costs)
    assert one.states.bodies == other.states.bodies and one.notes == other.notes


def test_every_frame_of_a_track_has_a_pose(whole, recording):
    name, people = whole
    assert people.poses.frames.tolist() == list(range(FRAMES)) and set(people.poses.persons) == {0}
    assert np.isfinite(people.poses.positions).all()
    assert people.notes == ()
    assert people.states.dof_names == DOF_NAMES
    # The poses are those of the stored states and bodies.
    limits = canton_limits() if name == "canton2009" else default_limits()
    body = make_body(people.states.bodies[0], limits)
    assert_array_equal(landmarks(body, people.states.states), people.poses.positions)
    assert np.all((people.states.states >= limits.low) & (people.states.states <= limits.high))


def test_the_body_is_where_the_person_is(whole):
    name, people = whole
    truth = read_joints(TINY / "truth" / "joints.csv")
    truth = truth.where(truth.frames < FRAMES)
    error = np.linalg.norm(people.poses.positions - truth.positions, axis=-1)
    assert error[:, landmark_index("pelvis")].max() < (0.15 if name == "default" else 0.35)
    if name == "default":
        assert np.median(error) < 0.10


@pytest.mark.parametrize("stop", [1, 5])
def test_a_stopped_run_goes_on_and_ends_as_if_it_had_not_been(whole, recording, tracks, tmp_path, stop):
    """Stopped while the person is still watched, and while followed."""
    name, people = whole
    journal = tmp_path / "journal"
    options = {"seed": 3, "journal": journal, "key": "run"}
    with pytest.raises(Stopped):
        pose_recording(recording, tracks, VOXEL_M, PRESET[name], progress=stopping(stop), **options)
    with open(journal, "a") as file:
        file.write('{"person":0,"frames":[2],"sta')  # the power went while a line was written
    seen: list[int] = []
    equal(pose_recording(recording, tracks, VOXEL_M, PRESET[name], progress=noting(seen), **options), people)
    # What was decided is not computed again; legs are decided two frames later.
    assert seen[0] == (0 if stop < 3 else stop if name == "canton2009" else 3)
    # A finished run is read back without a frame being touched.
    seen.clear()
    equal(pose_recording(recording, tracks, VOXEL_M, PRESET[name], progress=noting(seen), **options), people)
    assert seen == []


def test_a_journal_of_another_run_is_begun_anew(recording, tracks, tmp_path):
    journal = tmp_path / "journal"
    preset = PRESET["canton2009"]
    with pytest.raises(Stopped):
        pose_recording(recording, tracks, VOXEL_M, preset, seed=1, journal=journal, key="one", progress=stopping(5))
    anew = pose_recording(recording, tracks, VOXEL_M, preset, seed=2, journal=journal, key="other")
    equal(anew, pose_recording(recording, tracks, VOXEL_M, preset, seed=2))


def test_a_damaged_journal_is_one_clear_line(recording, tracks, tmp_path):
    journal = tmp_path / "journal"
    journal.write_text('{"key":"run"}\nnot json\n{"person":0}\n')
    with pytest.raises(InputError, match="line 2: damaged; delete"):
        pose_recording(recording, tracks, VOXEL_M, PRESET["default"], journal=journal, key="run")


def test_another_seed_gives_another_result(whole, recording, tracks):
    name, people = whole
    if name == "canton2009":  # the quicker one says it too
        other = pose_recording(recording, tracks, VOXEL_M, PRESET[name], seed=4)
        assert np.abs(other.poses.positions - people.poses.positions).max() > 1e-4


def test_a_track_without_a_hull_gets_no_pose_and_a_note(recording, tracks):
    """A second track stands where nobody is; the first person is not disturbed by it."""
    ghost = TrackTable(np.arange(1, 6), np.full(5, 7), np.tile([2.2, 2.0, 0.9], (5, 1)))
    both = TrackTable(
        np.r_[tracks.frames, ghost.frames], np.r_[tracks.persons, ghost.persons], np.vstack([tracks.positions, ghost.positions])
    )
    people = pose_recording(recording, both, VOXEL_M, PRESET["canton2009"], seed=3)
    lost = people.poses.of(7)
    assert lost.frames.tolist() == [1, 2, 3, 4, 5] and np.isnan(lost.positions).all()
    assert people.states.frames.tolist() == people.poses.frames.tolist() and set(people.states.bodies) == {0}
    assert len(people.notes) == 1 and people.notes[0].startswith("person 7: 5 frames without a pose")
    equal_one = pose_recording(recording, tracks, VOXEL_M, PRESET["canton2009"], seed=3)
    assert_array_equal(people.poses.of(0).positions, equal_one.poses.positions)


def test_frames_in_which_a_person_has_no_hull_are_nan_and_noted(recording, tracks):
    """The track leaves the person for two frames: the pose waits there and is not given out as one."""
    positions = tracks.positions.copy()
    positions[4:6] = 2.2, 2.0, 0.9
    led_astray = TrackTable(tracks.frames, tracks.persons, positions)
    people = pose_recording(recording, led_astray, VOXEL_M, PRESET["canton2009"], seed=3)
    fitted = np.isfinite(people.poses.positions).all((1, 2))
    assert fitted.tolist() == [True] * 4 + [False] * 2 + [True]
    assert np.isnan(people.poses.positions[4:6]).all() and np.isnan(people.costs[4:6]).all()
    assert people.notes == ("person 0: 2 frames without a pose: no hull of this person in this frame",)


def test_a_track_with_a_gap(recording, tracks, tmp_path):
    kept = tracks.where(~np.isin(tracks.frames, [4]))
    options = {"seed": 3, "journal": tmp_path / "journal", "key": "gap"}
    whole = pose_recording(recording, kept, VOXEL_M, PRESET["canton2009"], seed=3)
    assert whole.poses.frames.tolist() == [0, 1, 2, 3, 5, 6]
    with pytest.raises(Stopped):
        pose_recording(recording, kept, VOXEL_M, PRESET["canton2009"], progress=stopping(5), **options)
    equal(pose_recording(recording, kept, VOXEL_M, PRESET["canton2009"], **options), whole)


def test_a_selection_counts_frames_absolutely(tracks):
    part = open_recording(TINY, start=2, frames=3)
    people = pose_recording(part, tracks.where((tracks.frames >= 2) & (tracks.frames < 5)), VOXEL_M, PRESET["canton2009"])
    assert people.poses.frames.tolist() == [2, 3, 4]


@pytest.mark.parametrize("name", PRESET)
def test_tracks_that_go_on_after_the_selection(tracks, name):
    part = open_recording(TINY, start=1, frames=3)
    people = pose_recording(part, tracks, VOXEL_M, PRESET[name])
    assert people.poses.frames.tolist() == [1, 2, 3] and np.isfinite(people.poses.positions).all()


def test_one_frame_is_enough(tracks):
    one = open_recording(TINY, frames=1)
    people = pose_recording(one, tracks.where(tracks.frames < 1), VOXEL_M, PRESET["canton2009"])
    assert people.poses.frames.tolist() == [0] and np.isfinite(people.poses.positions).all()


def test_nobody_gives_empty_tables(tmp_path, ring):
    folder = draw_recording(tmp_path / "empty", ring, [[]] * 3)
    nobody = TrackTable(np.zeros(0, int), np.zeros(0, int), np.zeros((0, 3)))
    people = pose_recording(open_recording(folder), nobody, 0.08, PRESET["default"])
    assert people.poses.positions.shape == (0, 15, 3) and people.states.states.shape == (0, len(DOF_NAMES))
    assert people.notes == () and not people.states.bodies


def test_a_person_at_the_edge_of_the_room(tmp_path, ring):
    """Half of the drawn body stands outside the room."""
    folder = draw_recording(tmp_path / "edge", ring, [[(1.95, 0.0)]] * 2)
    track = TrackTable(np.arange(2), np.zeros(2, int), np.tile([1.9, 0.0, 0.9], (2, 1)))
    people = pose_recording(open_recording(folder), track, 0.08, PRESET["canton2009"])
    assert len(people.poses.frames) == 2
    found = people.poses.positions[np.isfinite(people.poses.positions).all((1, 2))]
    assert len(found) == 2 and np.all(np.abs(found[:, 0, :2] - [1.9, 0.0]) < 0.6)


def test_two_people_keep_their_numbers(tmp_path, ring):
    """Drawn people are egg-shaped, but each is fitted where it stands."""
    frames = [[*one, (0.9, -0.9)] for one in walk(30)[:4]]
    folder = draw_recording(tmp_path / "two", ring, frames)
    places = np.array([[*place, 0.9] for frame in frames for place in frame])
    track = TrackTable(np.repeat(np.arange(4), 2), np.tile([3, 5], 4), places)
    people = pose_recording(open_recording(folder), track, 0.08, PRESET["canton2009"])
    assert people.poses.frames.tolist() == [0, 0, 1, 1, 2, 2, 3, 3] and people.poses.persons.tolist() == [3, 5] * 4
    assert np.abs(people.poses.positions[:, 0, :2] - places[:, :2]).max() < 0.4
    assert set(people.states.bodies) == {3, 5}


def test_voxels_that_do_not_fit_are_refused(recording, tracks):
    with pytest.raises(InputError, match="would fit"):
        pose_recording(recording, tracks, 0.0005, PRESET["default"])
