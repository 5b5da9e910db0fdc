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
    ],
)
def test_what_is_no_recording_is_told(on_disk, change, said):
    images, _, _ = arrays_of(on_disk)
    with pytest.raises(InputError, match=said):
        hmc.recording_of(on_disk.rig, change(images))


@pytest.mark.parametrize(("more", "said"), [({"fps": 0}, "fps"), ({"room": [[0, 0, 0], [1, 1, 0]]}, "lower corner first")])
def test_settings_that_cannot_be_are_told(on_disk, more, said):
    with pytest.raises(InputError, match=said):
        hmc.recording_of(on_disk.rig, arrays_of(on_disk)[0], **more)
