"""Silhouettes kept with a result: what Pillow and the recording's own reader see in them, and what comes back."""

import errno
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from PIL import Image

from hmc.errors import InputError
from hmc.io.files import write_toml
from hmc.io.masks import MaskStep
from hmc.io.recording import iterate_frames, open_recording, reduced
from hmc.io.silhouettes import open_silhouettes, silhouettes_ahead, write_silhouettes


def steps_of(recording, seed, doubts=()):
    """Random masks of every frame; one camera tells nothing in frame 2, doubts are in some frames."""
    rng = np.random.default_rng(seed)
    for index in range(recording.start, recording.start + recording.n_frames):
        masks, doubtful = (
            tuple(rng.random(camera.size[::-1]) < 0.3 for camera in recording.rig),
            tuple(rng.random(camera.size[::-1]) < 0.1 if index in doubts else None for camera in recording.rig),
        )
        yield MaskStep(index, (None,) * len(masks), tuple(None if (index, c) == (2, 1) else mask for c, mask in enumerate(masks)), doubtful)


def keep(out, recording, steps):
    written = write_silhouettes(out, recording, [steps])
    told = {"cameras": list(recording.rig.names), "start": recording.start, "frames": recording.n_frames}
    write_toml(out / "run.toml", {"parameters": told})
    return written


def same(left, right):
    assert left.index == right.index
    for one, other in zip((*left.masks, *left.doubtful), (*right.masks, *right.doubtful), strict=True):
        assert (one is None) == (other is None)
        if one is not None:
            assert_array_equal(one, other)


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), factor=st.integers(1, 4))
def test_what_is_kept_comes_back_bit_for_bit_at_any_size_of_images(tmp_path_factory, seed, factor):
    out = tmp_path_factory.mktemp("kept")
    recording = opened(out / "recording")
    recording = recording if factor == 1 else reduced(recording, (factor,) * len(recording.rig))
    before = list(steps_of(recording, seed, doubts=(4,)))
    keep(out / "result", recording, before)
    found = open_silhouettes(out / "result")
    assert found.missing(recording) == ""
    for one, other in zip(before, found.steps(recording, range(3, 9)), strict=True):
        same(one, other)
    assert sorted(path.name for path in (out / "result").iterdir()) == ["doubtful", "run.toml", "silhouettes"]


def opened(folder):
    """A recording of two cameras of 41 x 31 pixels, of which a factor leaves rows over; frames 3 to 8 of it."""
    from conftest import write_images

    from hmc.camera.model import Rig, look_at
    from hmc.io.calibration import write_calibration

    folder.mkdir(parents=True)
    rig = Rig(tuple(look_at(f"cam_{i:02d}", (41, 31), [3.0, 2.0 * i - 1, 1.5], [0, 0, 0.9], 60) for i in range(2)))
    write_calibration(folder / "calibration.toml", rig)
    for name in rig.names:
        write_images(folder / "images" / name, range(10), (41, 31))
    return open_recording(folder, start=3, frames=6)


def test_files_are_what_a_recording_has_and_pillow_sees_one_bit_a_pixel(recording_folder, tmp_path):
    recording = open_recording(recording_folder)
    before = list(steps_of(recording, 0))
    written = keep(tmp_path / "result", recording, before)
    files = sorted((tmp_path / "result" / "silhouettes").rglob("*.png"))
    assert len(files) == 12 * 5 - 1 and written == sum(file.stat().st_size for file in files)
    image = Image.open(tmp_path / "result" / "silhouettes" / "cam_03" / "000007.png")
    assert image.mode == "1"
    assert_array_equal(np.asarray(image), before[7].masks[3])
    shutil.copytree(tmp_path / "result" / "silhouettes", recording_folder / "silhouettes")
    for frame, step in zip(iterate_frames(open_recording(recording_folder)), before, strict=True):
        same(replace(step, masks=frame.silhouettes), step)


def test_others_take_the_place_of_those_from_before_whole_or_not_at_all(recording_folder, tmp_path):
    recording = open_recording(recording_folder, frames=6)
    keep(tmp_path, recording, steps_of(recording, 1, doubts=(4,)))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.png")}

    def killed():
        yield from list(steps_of(recording, 2))[:3]
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_silhouettes(tmp_path, recording, [killed()])
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.png")} == before
    keep(tmp_path, recording, steps_of(recording, 2))
    after = {path: path.read_bytes() for path in tmp_path.rglob("*.png")}
    assert len(after) == 6 * 5 - 1 and all(after[path] != before[path] for path in after)


def test_processes_that_share_the_frames_write_the_same(recording_folder, tmp_path):
    recording = open_recording(recording_folder, frames=6)
    steps = list(steps_of(recording, 1, doubts=(4,)))
    sizes = [write_silhouettes(tmp_path / str(n), recording, [steps[k::n] for k in range(n)], workers=n) for n in (1, 2, 4)]
    alone, *shared = [
        {path.relative_to(tmp_path / str(n)): path.read_bytes() for path in (tmp_path / str(n)).rglob("*.png")} for n in (1, 2, 4)
    ]
    assert len(alone) == 7 * 5 - 1 and shared == [alone, alone] and sizes == [sum(map(len, alone.values()))] * 3


@pytest.mark.parametrize("workers", [1, 2])
def test_those_that_are_written_meanwhile_are_the_same_and_there_when_they_are_asked_for(recording_folder, tmp_path, workers):
    recording = open_recording(recording_folder, frames=6)
    steps = list(steps_of(recording, 1, doubts=(4,)))
    size = write_silhouettes(tmp_path / "alone", recording, [steps])
    with silhouettes_ahead(tmp_path / "meanwhile", recording, lambda: steps, workers) as finish:
        assert open_silhouettes(tmp_path / "meanwhile") is None and not list(tmp_path.glob("meanwhile/silhouettes"))
        assert finish() == size
    alone, meanwhile = (
        {path.relative_to(out): path.read_bytes() for path in out.rglob("*.png")} for out in (tmp_path / "alone", tmp_path / "meanwhile")
    )
    assert alone == meanwhile and {path.name for path in (tmp_path / "meanwhile").iterdir()} == {"silhouettes", "doubtful"}


@pytest.mark.parametrize("workers", [1, 2])
def test_nothing_is_left_of_those_that_are_not_asked_for(recording_folder, tmp_path, workers):
    recording = open_recording(recording_folder, frames=6)
    keep(tmp_path, recording, steps_of(recording, 1))
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.png")}
    with pytest.raises(KeyError), silhouettes_ahead(tmp_path, recording, lambda: steps_of(recording, 2), workers):
        raise KeyError
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.png")} == before


@pytest.mark.parametrize("meanwhile", [False, True])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_disk_that_takes_no_more_is_told_by_whoever_writes(recording_folder, tmp_path, monkeypatch, workers, meanwhile):
    recording = open_recording(recording_folder, frames=6)
    steps = list(steps_of(recording, 1))

    def full(path, data):
        raise OSError(errno.ENOSPC, "No space left on device")

    out = tmp_path / "result"
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"silhouettes: cannot be written \(No space left on device\); --no-silhouettes leaves it out"):
        if meanwhile:
            with silhouettes_ahead(out, recording, lambda: steps, workers) as finish:
                finish()
        else:
            write_silhouettes(out, recording, [steps[:3], steps[3:]], workers)
    assert not list(out.iterdir())


def test_what_they_lack_of_a_selection_is_said(recording_folder, tmp_path):
    part = open_recording(recording_folder, cameras=["cam_00", "cam_01", "cam_03"], start=2, frames=5)
    keep(tmp_path, part, steps_of(part, 3))
    found = open_silhouettes(tmp_path)
    assert found.missing(open_recording(recording_folder)) == "no camera cam_02, cam_04"
    assert found.missing(open_recording(recording_folder, cameras=["cam_03"])) == "frames 2 to 6 only"
    fewer = open_recording(recording_folder, cameras=["cam_03", "cam_00"], start=3, frames=2)
    assert found.missing(fewer) == ""
    assert [[mask.shape for mask in step.masks] for step in found.steps(fewer, [4, 3])] == [[(120, 160)] * 2] * 2
    assert open_silhouettes(recording_folder) is None


def test_a_file_of_another_size_and_a_damaged_one_are_told(recording_folder, tmp_path):
    recording = open_recording(recording_folder, frames=3)
    keep(tmp_path, recording, steps_of(recording, 4))
    cv2.imwrite(str(tmp_path / "silhouettes" / "cam_02" / "000000.png"), np.zeros((60, 80), np.uint8))
    (tmp_path / "silhouettes" / "cam_02" / "000001.png").write_bytes(b"none")
    found = open_silhouettes(tmp_path)
    with pytest.raises(InputError, match=r"000000\.png: is 80 x 60, not as large as"):
        next(found.steps(recording, [0]))
    with pytest.raises(InputError, match=r"000001\.png: cannot be read; remove"):
        next(found.steps(recording, [1]))
