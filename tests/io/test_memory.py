"""Images in memory are as good as a recording on disk."""

import numpy as np
import pytest
from drawn import draw_recording, post, walk
from numpy.testing import assert_array_equal

import hmc
from hmc.errors import InputError
from hmc.io.recording import background_frames, iterate_frames, open_recording


@pytest.fixture(scope="module")
def on_disk(tmp_path_factory, ring):
    return open_recording(draw_recording(tmp_path_factory.mktemp("take") / "one", ring, walk(6), silhouettes=True, shape=post))


def arrays_of(recording):
    frames = list(iterate_frames(recording))
    images = [np.stack([frame.images[c] for frame in frames]) for c in range(len(recording.rig))]
    masks = [np.stack([frame.silhouettes[c] for frame in frames]) for c in range(len(recording.rig))]
    return images, [list(background_frames(recording, c)) for c in range(len(recording.rig))], masks


def test_the_same_frames_and_tracks_come_out(on_disk):
    images, background, masks = arrays_of(on_disk)
    given = {"fps": on_disk.fps, "room": on_disk.room}
    in_memory = hmc.recording_of(on_disk.rig, images, background, masks, **given)
    assert (in_memory.n_frames, in_memory.n_background_frames) == (on_disk.n_frames, on_disk.n_background_frames)
    for one, other in zip(iterate_frames(on_disk, 2, 5), iterate_frames(in_memory, 2, 5), strict=True):
        assert one.index == other.index
        for c in range(len(on_disk.rig)):
            assert_array_equal(one.images[c], other.images[c])
            assert_array_equal(one.silhouettes[c], other.silhouettes[c])
    for kept in ({"silhouettes": masks}, {"images": images, "background": background}):
        tracks = hmc.track(hmc.recording_of(on_disk.rig, **kept, **given))
        assert len(np.unique(tracks.persons)) == 1 and len(tracks.frames) == 6
    assert_array_equal(hmc.track(hmc.recording_of(on_disk.rig, silhouettes=masks, **given)).positions, tracks_by_masks(on_disk))


def tracks_by_masks(recording):
    """Of the recording on disk, whose silhouettes come before its images."""
    return hmc.track(recording).positions


def test_cameras_of_other_lengths_are_told(on_disk):
    images, background, _ = arrays_of(on_disk)
    recording = hmc.recording_of(on_disk.rig, [images[0][:3], *images[1:]], background)
    assert len(recording.problems) == 1 and "cameras differ in length (cam_00 3, cam_01 6" in recording.problems[0]
    assert not hmc.recording_of(on_disk.rig, images, background).problems


def test_frames_may_be_missing_and_come_late(on_disk):
    images, background, _ = arrays_of(on_disk)

    asked = []

    class Loaded:
        """Loads when it is asked."""

        def __len__(self):
            return 6

        def __getitem__(self, k):
            asked.append(k)
            return images[0][k]

        def __iter__(self):
            return (self[k] for k in range(6))

    recording = hmc.recording_of(on_disk.rig, [Loaded(), [None, *images[1][1:]], *images[2:]], background)
    asked.clear()
    seen = [frame.images for frame in iterate_frames(recording, 0, 2)]
    assert set(asked) <= {0, 1, 2} and seen[0][1] is None and seen[1][1] is not None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda images: images[:-1], "one entry a camera, 5 of them; got 4"),
        (lambda images: [images[0][:, :-1], *images[1:]], r"cam_00.*uint8, shape \(120, 160, 3\).*got uint8 of shape \(119, 160, 3\)"),
        (lambda images: [images[0].astype(float), *images[1:]], "got float64"),
        (lambda images: [[None, None], *images[1:]], "all of its images are None"),
        (lambda images: [[], *images[1:]], "neither images nor silhouettes"),
        (lambda images: [[1, 2], *images[1:]], "got int"),
        (lambda images: [(image for image in images[0]), *images[1:]], "cam_00.*must be an array or a list.*got generator"),
        (lambda images: [np.uint8(3), *images[1:]], "must be an array or a list.*got uint8"),
        (lambda images: (own for own in images), "one entry a camera, 5 of them; got generator"),
        (lambda images: 5, "one entry a camera, 5 of them; got int"),
    ],
)
def test_what_is_no_recording_is_told(on_disk, change, said):
    images, _, _ = arrays_of(on_disk)
    with pytest.raises(InputError, match=said):
        hmc.recording_of(on_disk.rig, change(images))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"fps": 0}, "`fps` must be a number above 0; got 0"),
        ({"fps": None}, "`fps` must be a number above 0; got None"),
        ({"fps": "15"}, "`fps` must be a number above 0; got '15'"),
        ({"fps": np.nan}, "`fps` must be a number above 0; got nan"),
        ({"room": [[0, 0, 0], [1, 1, 0]]}, "lower corner first"),
        ({"room": [[0, 0, 0], [1, 1, np.inf]]}, "`room` must be .* in metres"),
        ({"room": np.array([[0, 0], [1, 1]])}, "lower corner first"),
        ({"room": "auto"}, "lower corner first"),
        ({"room": [[-2000, -2000, 0], [2000, 2000, 2500]]}, "looks like millimetres"),
        ({"persons": -1}, "`persons` must be a whole number, 0 or more; got -1"),
        ({"persons": 1.5}, "`persons` must be a whole number"),
        ({"name": None}, "`name` must be a text; got None"),
        ({"name": 3}, "`name` must be a text; got 3"),
        ({"height_m": 177}, r"`height_m` must be statures in metres, such as \[1.77\]; got 177"),
        ({"height_m": np.nan}, "`height_m` must be statures"),
        ({"height_m": (1.7, "1.8")}, "`height_m` must be statures"),
    ],
)
def test_settings_that_cannot_be_are_told(on_disk, more, said):
    with pytest.raises(InputError, match=said) as told:
        hmc.recording_of(on_disk.rig, arrays_of(on_disk)[0], **more)
    assert "\n" not in str(told.value) and "subject" not in str(told.value)


@pytest.mark.parametrize(
    ("more", "statures"),
    [
        ({"height_m": 1.7}, (1.7,)),
        ({"height_m": [1.5, np.float32(1.75)]}, (1.5, 1.75)),
        ({"height_m": np.array([1.5, 2])}, (1.5, 2)),
        ({"height_m": None}, ()),
        ({"fps": np.float32(12.5), "persons": np.int64(2), "room": np.array([[-1, -1, 0], [1, 1, 2]])}, ()),
    ],
)
def test_settings_may_be_numpy_s(on_disk, more, statures):
    recording = hmc.recording_of(on_disk.rig, arrays_of(on_disk)[0], **more)
    assert recording.subject_height_m == statures and recording.persons == more.get("persons") and recording.fps == more.get("fps", 30)


@pytest.mark.parametrize(
    ("change", "got"),
    [
        (lambda image: image.astype(float), r"float64 of shape \(120, 160, 3\)"),
        (lambda image: np.dstack([image, image[..., :1]]), r"uint8 of shape \(120, 160, 4\)"),
        (lambda image: image[..., 0], r"uint8 of shape \(120, 160\)"),
        (lambda image: "late.png", "str"),
    ],
)
@pytest.mark.parametrize("what", ["images", "background", "silhouettes"])
def test_a_later_frame_that_is_no_image_is_told(on_disk, change, got, what):
    """When it is read: which camera's, and which frame."""
    images, background, masks = (list(map(list, own)) for own in arrays_of(on_disk))
    spoilt = {"images": images, "background": background, "silhouettes": masks}[what]
    spoilt[1][2] = change(images[1][2])
    if what == "silhouettes" and spoilt[1][2] is not None and np.ndim(spoilt[1][2]) == 2:
        spoilt[1][2], got = images[1][2], r"uint8 of shape \(120, 160, 3\)"  # flat is what a silhouette is
    recording = hmc.recording_of(on_disk.rig, images, background, masks)
    with pytest.raises(InputError, match=f"camera 'cam_01': frame 2 of its {what} must be .*; got {got}$"):
        _ = list(background_frames(recording, 1)) if what == "background" else list(iterate_frames(recording))
    if what != "background":
        assert any(finding.severity == "error" and "frame 2 of its" in finding.sentence for finding in hmc.check(recording))


def test_a_later_frame_of_another_size_is_left_out(on_disk):
    images = list(map(list, arrays_of(on_disk)[0]))
    images[1][2] = images[1][2][:-1]
    told = []
    frames = list(iterate_frames(hmc.recording_of(on_disk.rig, images), on_problem=told.append))
    assert frames[2].images[1] is None and told == ["cam_01: frame 2 is 160 x 119 and not 160 x 120; left out"]
