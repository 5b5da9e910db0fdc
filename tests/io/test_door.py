"""The door: what is no regular file, too large, too deep or damaged is one line, whichever reader it is given to."""

import os
import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from families import FAMILIES

from hmc.camera.model import Rig, look_at
from hmc.check.given_points import read_points
from hmc.errors import InputError
from hmc.experiments.engine.store import cell_text, read_cell
from hmc.io.c3d import read_c3d
from hmc.io.calibration import read_calibration, write_calibration
from hmc.io.detections import read_detections
from hmc.io.door import LIMITS, kept_arrays, limit, read_arrays, read_image, read_json_file, read_toml_file, read_xml_file
from hmc.io.footage import open_video
from hmc.io.keypoints.csv_forms import read_csv_table
from hmc.io.keypoints.json_forms import read_json_frame, read_json_table
from hmc.io.nested_settings import read_settings_table
from hmc.io.results import PoseStates, read_centroids, read_joints, read_pose, read_run, read_tracks, write_pose
from hmc.io.settings import read_settings
from hmc.io.timing import read_times
from hmc.pose.methods.model_file import read_hierarchy
from hmc.synthetic.bvh import read_bvh
from hmc.synthetic.recipe import load_recipe
from hmc.tracking.person_tree import read_tree
from hmc.trials.session_file import read_session

CAMERA = look_at("c", (64, 48), [3, 0, 2], [0, 0, 1], 60)
SIZES = {"c": (64, 48)}
BVH = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 1 0
  }
}
MOTION
Frames: 2
Frame Time: 0.033
0 0 0 0 0 0
0 0 0 0 0 1
"""


@dataclass(frozen=True)
class Reader:
    """A reader, the name of its file, and what a good file holds (text, or a function that writes it)."""

    read: Callable[[Path], Any]
    name: str
    good: str | Callable[[Path], None]


def _calibration(path):
    write_calibration(path, Rig((CAMERA,)))


def _storage(path):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in (("camera_matrix", CAMERA.matrix), ("rotation", CAMERA.rotation), ("translation", CAMERA.translation)):
        storage.write(name, np.array(value))
    storage.release()


def _pose(path):
    names = ("a", "b", "c")
    write_pose(path, PoseStates(np.arange(3), np.zeros(3, int), np.zeros((3, 3)), names, {0: {"height_m": 1.7}}))


def _image(path):
    cv2.imwrite(str(path), np.full((20, 30, 3), 90, np.uint8))


def _video(path):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25, (64, 48))
    for level in range(4):
        writer.write(np.full((48, 64, 3), 40 * level, np.uint8))
    writer.release()


calibration = partial(read_calibration, sizes=SIZES)
MODEL = """kind = "inclusive"
thinning = 2
[[model]]
name = "trunk"
angles = ["root"]
parts = ["torso"]
"""


def kept(path):
    """As experiments read what they keep for themselves."""
    with kept_arrays(path) as arrays:
        np.zeros(9)[arrays["voxels"]] = arrays["levels"]


READERS = {
    "recording.toml": Reader(lambda path: read_settings(path.parent), "recording.toml", "fps = 15\nroom = [[-2, -2, 0], [2, 2, 2]]\n"),
    "calibration.toml": Reader(calibration, "calibration.toml", _calibration),
    "OpenCV YAML": Reader(calibration, "c.yml", _storage),
    "OpenCV XML": Reader(calibration, "c.xml", _storage),
    "OpenCV JSON": Reader(calibration, "cam_c.json", _storage),
    "joints": Reader(read_joints, "joints.csv", "frame,person,joint,x,y,z\n0,0,pelvis,0.1,0.2,0.9\n1,0,pelvis,0.1,0.2,0.9\n"),
    "tracks": Reader(read_tracks, "tracks.csv", "frame,person,x,y,z\n0,0,0.1,0.2,0.9\n1,0,0.1,0.2,0.9\n"),
    "centroids": Reader(read_centroids, "c.csv", "frame,person,x,y,z,head_x,head_y,head_z\n0,0,0.1,0.2,0.9,0,0,1.7\n"),
    "pose": Reader(read_pose, "pose.npz", _pose),
    "run": Reader(read_run, "run.toml", 'method = "apf"\nseed = 0\n[parameters]\nstart = 0\nframes = 3\n'),
    "settings": Reader(read_settings_table, "s.toml", "[annealed]\nlayers = 3\n"),
    "session": Reader(read_session, "session.toml", 'name = "s"\n[[trial]]\nname = "one"\n'),
    "recipe": Reader(load_recipe, "r.toml", 'name = "r"\nfps = 15\nseconds = 1\n[[actor]]\nheight_m = 1.7\nmotion = "walk"\n'),
    "times": Reader(read_times, "c.csv", "frame,time_s\n0,0.0\n1,0.1\n"),
    "detections": Reader(lambda path: read_detections(path, ["c"]), "d.csv", "frame,camera,u,v\n0,c,1.5,2.5\n"),
    "keypoints of a frame": Reader(
        read_json_frame, "f.json", '{"people": [{"pose_keypoints_2d": [' + ", ".join(["1.5, 2.5, 0.9"] * 25) + "]}]}"
    ),
    "keypoints of a camera": Reader(read_json_table, "c.json", '{"frames": [{"frame": 0, "people": []}]}'),
    "keypoints in a table": Reader(read_csv_table, "c.csv", "frame,keypoint,x,y,confidence\n0,nose,1,2,0.5\n"),
    "points": Reader(lambda path: read_points(path, Rig((CAMERA,))), "p.csv", "point,camera,u,v\na,c,1,2\n"),
    "motion": Reader(read_bvh, "m.bvh", BVH),
    "C3D": Reader(read_c3d, "points.c3d", lambda path: path.write_bytes((Path(__file__).parents[1] / "files" / "points.c3d").read_bytes())),
    "body model": Reader(read_hierarchy, "model.toml", MODEL),
    "kept arrays": Reader(kept, "00000003.npz", lambda path: np.savez(path, voxels=np.arange(3), levels=np.ones(3, np.uint8))),
    "person tree": Reader(read_tree, "tree.csv", "a,b\n1,2\n"),
    "cell": Reader(read_cell, "cell.json", cell_text({}, {"a": 1})),
    "image": Reader(read_image, "i.png", _image),
    "video": Reader(open_video, "v.avi", _video),
}
#: How often each family is tried; what is said to be huge is tried elsewhere.
TIMES = {"flip bytes": 6, "truncate": 3, "a strange number": 8, "a digit": 3, "huge": 0, "strange neighbors": 0, "another name": 0}


@pytest.mark.parametrize("name", READERS)
def test_nothing_but_one_line_comes_out_of_garbage(tmp_path, name):
    reader, refused = READERS[name], 0
    for k, (family, spoil) in enumerate(FAMILIES.items()):
        for turn in range(TIMES.get(family, 1)):
            folder = tmp_path / f"{k}_{turn}"
            folder.mkdir()
            path = folder / reader.name
            path.write_text(reader.good) if isinstance(reader.good, str) else reader.good(path)
            spoil(np.random.default_rng((k, turn)), path)
            try:
                reader.read(path)
            except InputError as error:
                refused += 1
                assert "\n" not in str(error) and len(str(error)) < 1500, family
    assert refused >= 5


def test_other_than_files_are_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(InputError, match=r"cannot be read \((no regular file|a folder)"):
            read_toml_file(path)


def test_limits_are_raised_by_the_environment(tmp_path, monkeypatch):
    path = tmp_path / "a.toml"
    path.write_text("a = 1\n" + "#" * 1000)
    monkeypatch.setenv("HMC_MAX_SETTINGS_MB", "0.0005")
    with pytest.raises(InputError, match=r"more than the 0.0005 MB .* set HMC_MAX_SETTINGS_MB higher"):
        read_toml_file(path)
    monkeypatch.setenv("HMC_MAX_SETTINGS_MB", "1")
    assert read_toml_file(path) == {"a": 1}
    monkeypatch.setenv("HMC_MAX_SETTINGS_MB", "much")
    with pytest.raises(InputError, match="HMC_MAX_SETTINGS_MB=much: must be a number above 0"):
        limit("HMC_MAX_SETTINGS_MB")
    assert all(value > 0 for value in LIMITS.values())


@pytest.mark.parametrize("suffix", ["png", "jpg", "bmp"])
def test_an_image_s_size_is_looked_at_before_it_is_decoded(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"i.{suffix}"
    cv2.imwrite(str(path), np.zeros((400, 300, 3), np.uint8))
    assert read_image(path).shape == (400, 300, 3)
    monkeypatch.setenv("HMC_MAX_IMAGE_MPIXEL", "0.1")
    with pytest.raises(InputError, match=r"300 x 400 pixels, more than the 0\.1 million"):
        read_image(path)


@pytest.mark.parametrize("there", [False, True])
def test_arrays_that_are_said_to_be_huge_are_not_unpacked(tmp_path, monkeypatch, there):
    monkeypatch.setenv("HMC_MAX_ARRAYS_MB", "1")
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({250_000 if there else 10**12},), }}".ljust(117) + "\n"
    data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + bytes(2_000_000 if there else 0)
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("states.npy", data)
    with pytest.raises(InputError, match="more than the 1 MB" if there else "which are not there"):
        read_arrays(tmp_path / "a.npz")


def test_deep_texts_are_refused(tmp_path):
    for name, text, read in (
        ("a.toml", "[" + "a." * 100_000 + "a]\n", read_toml_file),
        ("b.toml", "a = " + "[" * 100_000 + "]" * 100_000, read_toml_file),
        ("a.json", "[" * 100_000 + "]" * 100_000, read_json_file),
        ("a.xml", "<a>" * 100_000 + "</a>" * 100_000, partial(read_xml_file, what="a list")),
        ("a.yml", "a: " + "[" * 100_000 + "]" * 100_000, read_calibration),
        ("b.yml", "- " * 100_000 + "1", read_calibration),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError):
            read(tmp_path / name)


def test_numbers_beyond_64_bits_are_refused(tmp_path):
    (tmp_path / "a.toml").write_text("[parameters]\nstart = 99999999999999999999\n")
    with pytest.raises(InputError, match=r"`parameters.start` is a number beyond 64 bits"):
        read_toml_file(tmp_path / "a.toml")


def test_complex_numbers_are_no_plain_ones(tmp_path):
    np.savez(tmp_path / "a.npz", a=np.ones(2, complex))
    with pytest.raises(InputError, match=r"a\.npy holds no plain numbers"):
        read_arrays(tmp_path / "a.npz")
