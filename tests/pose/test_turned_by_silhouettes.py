"""Cameras that have turned since they were calibrated: found by silhouettes, turned back, told; and none where nothing has turned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hmc
import hmc.pose.turned_by_silhouettes as turned_by_silhouettes_module
from hmc.camera.model import Rig
from hmc.camera.turned_cameras import TurnedCamera, turn_back
from hmc.errors import InputError
from hmc.io.camera_turns import TURNED_CAMERAS, as_posed, read_turns, write_turns
from hmc.io.masks import keep_masks, kept_masks
from hmc.io.result_files import BESIDE
from hmc.io.results import TrackTable, read_centroids, read_joints
from hmc.pose.turned_back import turned_back
from hmc.pose.turned_by_silhouettes import people_outlines, turned_by_silhouettes
from hmc.voxels.hulls import FrontendSettings, stream_masks
from hmc.voxels.run_options import RunOptions

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
FOUR = ("cam_00", "cam_02", "cam_04", "cam_06")
TURN = np.radians(1.5) * np.array([0.6, -0.48, 0.64])


@pytest.fixture(scope="module")
def masks(tmp_path_factory):
    """Silhouettes of the small clip, as segmented with the calibration as it is."""
    path = tmp_path_factory.mktemp("masks") / "masks"
    recording = hmc.open_recording(TINY)
    for _ in keep_masks(path, "key", 0, stream_masks(recording), print):
        pass
    return path


def changed(masks, path, change):
    """The same silhouettes with something done to each frame's."""
    steps = list(kept_masks(masks, "key", 0, 30))
    for _ in keep_masks(path, "key", 0, [change(steps, step) for step in steps], print):
        pass
    return RunOptions(masks=path, key="key")


def opened(masks, turn=None, camera=1, cameras=()):
    """The recording with one camera calibrated as before it was turned, where people are, and the run that kept the silhouettes."""
    recording = hmc.open_recording(TINY, cameras or None)
    if turn is not None:
        right = recording.rig[camera]
        rotation = right.rotation @ Rotation.from_rotvec(turn).as_matrix().T
        wrong = replace(right, rotation=rotation, translation=-rotation @ right.centre)
        recording = replace(recording, rig=Rig(tuple(wrong if c == camera else one for c, one in enumerate(recording.rig))))
    return recording, read_centroids(TINY / "truth" / "centroids.csv"), RunOptions(masks=masks, key="key")


@pytest.fixture
def few(masks, tmp_path):
    """Silhouettes of four cameras alone."""
    names = hmc.open_recording(TINY).rig.names
    chosen = [names.index(name) for name in FOUR]
    return changed(
        masks, tmp_path / "few", lambda _, step: replace(step, masks=tuple(step.masks[c] for c in chosen), doubtful=(None,) * len(FOUR))
    ).masks


def left(rig, found, true, camera):
    """Degrees by which a camera is off when it is turned back."""
    turned = turn_back(rig, {one.name: one.turn for one in found})[camera]
    return np.degrees(Rotation.from_matrix(turned.rotation @ true[camera].rotation.T).magnitude())


def test_a_camera_that_has_turned_is_found_and_turned_back(masks):
    recording, tracks, run = opened(masks, TURN)
    (found,) = turned_by_silhouettes(recording, tracks, run)
    assert found.name == "cam_01" and found.after_m < 0.3 * found.before_m
    assert left(recording.rig, [found], hmc.open_recording(TINY).rig, 1) < 0.25


def test_one_of_four_cameras_is_found(few):
    recording, tracks, run = opened(few, TURN, 2, FOUR)
    (found,) = turned_by_silhouettes(recording, tracks, run)
    assert found.name == "cam_04"
    assert left(recording.rig, [found], hmc.open_recording(TINY, FOUR).rig, 2) < 0.5


def test_two_of_seven_cameras_are_found(masks):
    recording, tracks, run = opened(masks, TURN)
    other, _, _ = opened(masks, -1.4 * TURN[::-1], 4)
    rig = Rig(tuple(other.rig[c] if c == 4 else camera for c, camera in enumerate(recording.rig)))
    found = turned_by_silhouettes(replace(recording, rig=rig), tracks, run)
    assert [one.name for one in found] == ["cam_04", "cam_01"]  # the farther off first
    true = hmc.open_recording(TINY).rig
    assert max(left(rig, found, true, c) for c in (1, 4)) < 0.4


def test_where_nothing_has_turned_nothing_is_turned(masks, few):
    assert turned_by_silhouettes(*opened(masks)) == []
    assert turned_by_silhouettes(*opened(few, cameras=FOUR)) == []


def test_three_cameras_do_not_tell_which_of_them_has_turned(few, tmp_path):
    run = changed(few, tmp_path / "three", lambda _, step: replace(step, masks=step.masks[:3], doubtful=(None,) * 3))
    assert turned_by_silhouettes(*opened(run.masks, TURN, cameras=FOUR[:3])) == []


def test_a_camera_that_is_late_or_loses_legs_has_not_turned(masks, tmp_path):
    recording, tracks, _ = opened(masks)

    def of_one(mask):
        def change(steps, step):
            own = list(step.masks)
            own[3] = mask(steps, step)
            return replace(step, masks=tuple(own))

        return change

    def late(steps, step):
        return steps[max(0, step.index - 4)].masks[3]

    def without_legs(steps, step):
        own = step.masks[3].copy()
        rows = np.flatnonzero(own.any(axis=1))
        if step.index % 3 and len(rows):
            own[rows[0] + 3 * len(rows) // 5 :] = False
        return own

    for change in (late, without_legs):
        found = turned_by_silhouettes(recording, tracks, changed(masks, tmp_path / change.__name__, of_one(change)))
        assert found == []


def test_noise_in_place_of_silhouettes_turns_nothing(masks, tmp_path):
    rng = np.random.default_rng(0)

    def noise(_, step):
        return replace(step, masks=tuple(np.roll(mask, rng.integers(-40, 40, 2), (0, 1)) for mask in step.masks))

    recording, tracks, _ = opened(masks)
    assert turned_by_silhouettes(recording, tracks, changed(masks, tmp_path / "noise", noise)) == []


def test_a_turn_that_leaves_a_smaller_hull_is_none(masks, monkeypatch):
    """As planes through cameras at one height may tell: heads and soles fit, and what is to the side does not."""
    recording, tracks, run = opened(masks, TURN)
    aside = TurnedCamera("cam_04", np.array([0.0, 0.0, 0.03]), 0.03, 0.002, "silhouettes end beside")
    monkeypatch.setattr(turned_by_silhouettes_module, "_turned", lambda rig, outlines: [aside])
    assert turned_by_silhouettes(recording, tracks, run) == []
    back = replace(aside, name="cam_01", turn=-TURN)
    monkeypatch.setattr(turned_by_silhouettes_module, "_turned", lambda rig, outlines: [back])
    assert turned_by_silhouettes(recording, tracks, run) == [back]


def test_nothing_is_told_without_silhouettes_or_people(masks, tmp_path):
    recording, tracks, run = opened(masks, TURN)
    nobody = TrackTable(np.empty(0, int), np.empty(0, int), np.empty((0, 3)))
    assert turned_by_silhouettes(recording, nobody, run) == []
    assert turned_by_silhouettes(recording, tracks, RunOptions()) == []
    assert turned_by_silhouettes(recording, tracks, replace(run, masks=tmp_path / "none")) == []


def test_blobs_beside_people_and_cameras_that_miss_one_do_not_count(masks):
    recording, tracks, run = opened(masks)
    step = next(kept_masks(run.masks, "key", 10, 11))
    whole = people_outlines(recording.rig, tracks.at(10), step)
    dirty = replace(step, masks=tuple(_with_blob(mask) for mask in step.masks))
    for (rays, inside), (same, also) in zip(whole, people_outlines(recording.rig, tracks.at(10), dirty), strict=True):
        assert np.array_equal(rays, same) and np.array_equal(inside, also)
    elsewhere = tracks.at(10) | {99: np.array([0.0, 0.0, 30.0])}
    assert not any(len(rays) for rays, _ in people_outlines(recording.rig, elsewhere, step))


def _with_blob(mask):
    dirty = mask.copy()
    dirty[2:6, 2:6] = True
    return dirty


def test_poses_are_found_with_the_camera_turned_back_or_kept_as_asked(masks):
    recording, tracks, run = opened(masks, TURN)
    mended = turned_back(recording, tracks, run)
    assert mended.cues is None and len(mended.notes) == 1
    assert "'cam_01' has turned by 1." in mended.notes[0] and "silhouettes end beside" in mended.notes[0]
    assert left(mended.recording.rig, [], hmc.open_recording(TINY).rig, 1) < 0.25
    kept = turned_back(recording, tracks, replace(run, frontend=FrontendSettings(exclude=False)))
    assert kept.recording is recording and not kept.turns and "kept as it is" in kept.notes[0]
    assert turned_back(mended.recording, tracks, run).notes == ()


def test_pictures_are_drawn_by_the_cameras_with_which_poses_were_found(masks, tmp_path):
    recording, tracks, run = opened(masks, TURN)
    turns = turned_back(recording, tracks, run).turns
    write_turns(tmp_path, turns)
    assert (tmp_path / TURNED_CAMERAS).name in BESIDE
    again = read_turns(tmp_path)
    assert list(again) == ["cam_01"]
    assert left(as_posed(recording, again).rig, [], hmc.open_recording(TINY).rig, 1) < 0.25
    assert read_turns(tmp_path / "none") == {} and as_posed(recording, {}) is recording


@pytest.mark.parametrize(
    "text", ["cam_01 = 3", 'cam_01 = ["a", 0, 0]', "cam_01 = [0.1, 0.2]", "cam_01 = [nan, 0, 0]", "cam_01 = [true, 0, 0]"]
)
def test_turns_that_are_none_are_told_with_their_file(tmp_path, text):
    (tmp_path / TURNED_CAMERAS).write_text(text)
    with pytest.raises(InputError, match=r"turned_cameras\.toml: `cam_01` must be a rotation vector"):
        read_turns(tmp_path)


@pytest.mark.slow
def test_a_turned_camera_costs_poses_little(tmp_path):
    recording, _, _ = opened(None, TURN)
    truth = read_joints(TINY / "truth" / "joints.csv")
    right, wrong = (hmc.pose(one) for one in (hmc.open_recording(TINY), recording))
    assert not right.turned and list(wrong.turned) == ["cam_01"]
    errors = [1000 * np.linalg.norm(one.positions - truth.positions[one.frames], axis=-1).mean() for one in (right, wrong)]
    assert errors[1] < errors[0] + 3
    wrong.save(tmp_path)
    assert list(read_turns(tmp_path)) == ["cam_01"]
    right.save(tmp_path)
    assert read_turns(tmp_path) == {}
