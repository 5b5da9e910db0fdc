"""Broken copies of the small rendered clip, by the command line: one clear line and exit code 2, or survived and told at the end."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from hmc.cli import main
from hmc.io.results import read_run, read_tracks

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
FRAMES = 6


@pytest.fixture
def clip(tmp_path):
    """A copy whose videos are numbered images."""
    folder = tmp_path / "clip"
    shutil.copytree(TINY, folder, ignore=shutil.ignore_patterns("videos"))
    (folder / "recording.toml").write_text("fps = 15\nroom = [[-2.8, -2.6, 0.0], [2.8, 2.6, 3.0]]\n")
    for video in sorted((TINY / "videos").iterdir()):
        capture = cv2.VideoCapture(str(video))
        (folder / "images" / video.stem).mkdir(parents=True)
        for index in range(FRAMES):
            cv2.imwrite(str(image(folder, video.stem, index)), capture.read()[1])
        capture.release()
    return folder


def image(folder, camera, index):
    return folder / "images" / camera / f"{index:06d}.png"


def change(file, function):
    cv2.imwrite(str(file), function(cv2.imread(str(file))))


def unreadable(folder):
    image(folder, "cam_02", 3).write_bytes(b"no image")


def missing(folder):
    image(folder, "cam_02", 3).unlink()


def drops_out(folder):
    for index in range(3, FRAMES):
        image(folder, "cam_02", index).unlink()


def other_size(folder):
    change(image(folder, "cam_02", 3), lambda pixels: pixels[:100, :100])


def light(folder):
    stripes = np.where(np.arange(320) // 20 % 2, 130.0, 0.0)[:, None]  # sun through a blind: no exposure or tinge accounts for it
    change(image(folder, "cam_02", 3), lambda pixels: np.clip(pixels + stripes, 0, 255).astype(np.uint8))


def background_cut(folder):
    file = folder / "background" / "cam_02.mp4"
    file.write_bytes(file.read_bytes()[:3000])


@pytest.mark.parametrize(
    ("spoil", "told"),
    [
        (unreadable, "cam_02: frame 3 cannot be read; left out"),
        (missing, "1 of 6 images are missing, the first is frame 3"),
        (drops_out, "cameras differ in length (cam_00 6, cam_01 6, cam_02 3"),
        (other_size, "cam_02: frame 3 is 100 x 100 and not 320 x 240; left out"),
        (light, "cam_02: frame 3: nearly the whole image changed at once"),
        (background_cut, "going on without this background"),
    ],
)
def test_survived_and_told(clip, tmp_path, capsys, spoil, told):
    spoil(clip)
    out = tmp_path / "out"
    assert main(["track", str(clip), "--out", str(out), "--quiet", "--voxel", "0.08", "--tracker", "naive"]) == 0
    assert any(line.startswith("note: ") and told in line for line in capsys.readouterr().err.splitlines())
    assert any(told in line for line in read_run(out / "run.toml")["problems"])
    assert read_tracks(out / "tracks.csv").frames.tolist() == list(range(FRAMES))


def test_nobody_at_all(clip, tmp_path, capsys):
    for camera in sorted((clip / "images").iterdir()):
        empty = cv2.VideoCapture(str(clip / "background" / f"{camera.name}.mp4"))
        for index in range(FRAMES):
            cv2.imwrite(str(image(clip, camera.name, index)), empty.read()[1])
        empty.release()
    assert main(["track", str(clip), "--out", str(tmp_path / "out"), "--quiet", "--voxel", "0.08", "--tracker", "naive"]) == 0
    assert "no person in 6 frames" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--out", "{tmp}/file/out"], "cannot be written (Not a directory); choose another folder"),
        (["--start", "6"], "it has 6 frames, 0 to 5: choose other --start"),
        (["--voxel", "0.0004"], "would fit"),
        (["--cameras", "cam_00,cam_77"], "no camera named 'cam_77'"),
        (["--cameras", "cam_00,cam_00"], "camera names must differ"),
    ],
)
def test_refused_in_one_line(clip, tmp_path, capsys, more, told):
    (tmp_path / "file").write_text("")
    more = [word.format(tmp=tmp_path) for word in more]
    assert main(["track", str(clip), "--out", str(tmp_path / "out"), "--quiet", "--tracker", "naive", *more]) == 2
    error = capsys.readouterr().err
    assert told in error and error.count("\n") == 1


@pytest.mark.parametrize("name", ["calibration.toml", "recording.toml"])
def test_a_file_that_is_no_text(clip, tmp_path, capsys, name):
    (clip / name).write_bytes(bytes(range(128, 256)))
    assert main(["track", str(clip), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert f"{name}: not a TOML file" in error and "mend or remove it" in error and error.count("\n") == 1


@pytest.mark.parametrize(
    "words",
    [
        "check {loop}",
        "pose {clip} --out {out} --tracks {loop}",
        "pose {clip} --out {out} --silhouettes-from {loop}",
        "track {clip} --out {loop}",
    ],
)
def test_a_link_to_itself_is_told(clip, tmp_path, capsys, words):
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    assert main(words.format(loop=loop, clip=clip, out=tmp_path / "out").split()) == 2
    said = "".join(capsys.readouterr())
    assert f"{loop}: " in said and "RuntimeError" not in said
