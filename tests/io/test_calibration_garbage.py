"""Calibration files that are broken in any way: a rig or `InputError` comes out, never anything else."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.model import Rig, look_at
from hmc.errors import InputError
from hmc.io.calibration import read_calibration, write_calibration

SIZES = dict.fromkeys(("c", "dino", "00_00", "1", "cam_0", "7", "a"), (640, 480))


def good_files(folder: Path) -> dict[str, str]:
    """One small good file of each form, by name."""
    camera = look_at("cam_0", (640, 480), [3, 0, 2], [0, 0, 1], 60, (-0.1, 0.02, 0, 0))
    write_calibration(folder / "x.toml", Rig((camera,)))
    for suffix in ("yml", "xml"):
        storage = cv2.FileStorage(str(folder / f"x.{suffix}"), cv2.FILE_STORAGE_WRITE)
        storage.write("camera_matrix", np.array(camera.matrix))
        storage.write("rotation", np.array(camera.rotation))
        storage.write("translation", np.array(camera.translation))
        storage.release()
    toml, yml = (folder / "x.toml").read_text(), (folder / "x.yml").read_text()
    numbers = " ".join(map(str, [700, 700, 320, 240, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 100, 200, 3000]))
    place = 'x="1" y="2" z="3" r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0"'
    lens = 'focalLengthU="640" focalLengthV="640" centerPointU="320" centerPointV="240"'
    radial = 'radialDistortion1="0" radialDistortion2="0" tangentalDistortion1="0" tangentalDistortion2="0"'
    return {
        "calibration.toml": toml,
        "camera_array.toml": toml.replace("[cam_0]", "[cameras.0]"),
        "c.yml": yml,
        "c.xml": (folder / "x.xml").read_text(),
        "c.cal": numbers,
        "c.qca.txt": f'<calibration><camera serial="7"><fov_video left="0" top="0" right="639" bottom="479"/><transform {place}/>'
        f"<intrinsic {lens} {radial}/></camera></calibration>",
        "c.xcp": '<Cameras><Camera DEVICEID="7" TYPE="Vue_VIDEO" SENSOR_SIZE="640 480"><KeyFrames><KeyFrame FOCAL_LENGTH="700" '
        'ORIENTATION="0 0 0 1" POSITION="1 2 3" PRINCIPAL_POINT="320 240" VICON_RADIAL2="Vicon3Parameter 320 240 1e-8 0 0"/>'
        "</KeyFrames></Camera></Cameras>",
        "c.mcal": '<calibrationProfile><Camera Serial="C7"><Attributes ImagerPixelWidth="640" ImagerPixelHeight="480"/>'
        '<IntrinsicStandardCameraModel LensCenterX="320" LensCenterY="240" HorizontalFocalLength="700" VerticalFocalLength="700" k1="0" '
        'k2="0" k3="0" TangentialX="0" TangentialY="0"/><Extrinsic X="1" Y="2" Z="3" '
        + " ".join(f'OrientMatrix{i}="{int(i in (0, 4, 8))}"' for i in range(9))
        + "/></Camera></calibrationProfile>",
        "calibration.json": json.dumps(
            {"cameras": [{"name": "00_00", "K": camera.matrix.tolist(), "R": camera.rotation.tolist(), "t": [[1], [2], [3]]}]}
        ),
        "projections.csv": "1," + ",".join(map(repr, camera.projection.ravel().tolist())),
        "dino_par.txt": "1\ndino.png 700 0 320 0 700 240 0 0 1 1 0 0 0 1 0 0 0 1 0.1 0.2 0.7",
        "intri.yml": '%YAML:1.0\n---\nnames: ["1"]\nK_1: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n'
        "  data: [7, 0, 3, 0, 7, 2, 0, 0, 1]\n"
        "H_1: 480\nW_1: 640\n",
    }


EXTRI = (
    '%YAML:1.0\n---\nnames: ["1"]\nR_1: !!opencv-matrix\n  rows: 3\n  cols: 1\n  dt: d\n  data: [0, 0, 1]\n'
    "T_1: !!opencv-matrix\n  rows: 3\n  cols: 1\n  dt: d\n  data: [0, 0, 1]\n"
)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return good_files(tmp_path_factory.mktemp("good"))


def read_anything(folder: Path, name: str, content: bytes) -> Rig | str:
    """The rig, or the one line of what is wrong."""
    (folder / name).write_bytes(content)
    if name == "intri.yml":
        (folder / "extri.yml").write_text(EXTRI)
    try:
        return read_calibration(folder / name, SIZES)
    except InputError as error:
        assert name.split(".")[0] in str(error) or "extri" in str(error)
        return str(error)


NAMES = [
    *(
        "c.cal",
        "c.mcal",
        "c.qca.txt",
        "c.xcp",
        "c.xml",
        "c.yml",
        "calibration.json",
        "calibration.toml",
        "camera_array.toml",
        "dino_par.txt",
    ),
    *("intri.yml", "projections.csv"),
]


@pytest.mark.parametrize("name", NAMES)
def test_the_good_ones_are_read(good, tmp_path, name):
    assert set(good) == set(NAMES)
    rig = read_anything(tmp_path, name, good[name].encode())
    assert isinstance(rig, Rig) and len(rig) == 1
    for encoding in ("utf-8-sig", "utf-16", "latin-1"):
        again = read_anything(tmp_path, name, good[name].encode(encoding))
        assert isinstance(again, Rig), again


@pytest.mark.parametrize("name", NAMES)
@given(st.data())
@settings(max_examples=40, deadline=None)
def test_broken_ones_are_one_line(good, tmp_path_factory, name, data):
    content = bytearray(good[name].encode())
    how = data.draw(st.sampled_from(["cut", "flip", "number", "encode", "noise", "double", "swap"]))
    if how == "cut":
        content = content[: data.draw(st.integers(0, len(content)))]
    elif how == "flip":
        for _ in range(data.draw(st.integers(1, 8))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    elif how == "number":
        digits = [i for i, byte in enumerate(content) if chr(byte).isdigit()]
        i = data.draw(st.sampled_from(digits))
        content[i : i + 1] = data.draw(st.sampled_from([b"nan", b"inf", b"-inf", b"1e999", b"", b"-", b"[", b"null", b"9" * 400, b"0"]))
    elif how == "encode":
        content = bytearray(good[name].encode(data.draw(st.sampled_from(["utf-16-be", "utf-32", "utf-7", "cp037"]))))
    elif how == "noise":
        content = bytearray(data.draw(st.binary(max_size=200)))
    elif how == "double":
        content = content + content
    else:
        content = bytearray(good[data.draw(st.sampled_from(NAMES))].encode())
    folder = tmp_path_factory.mktemp("broken")
    read_anything(folder, name, bytes(content))


@pytest.mark.parametrize("name", NAMES)
def test_odd_files(tmp_path, name):
    """Empty, deep, hostile and no file at all."""
    for content in (
        b"",
        b"\0",
        b"[" * 2000,
        b'{"a":' * 2000,
        b"<" * 2000,
        b"1\n2\n3\n",
        b'{"cameras": 3}',
        b'{"cameras": [3, null]}',
        b"[1]",
    ):
        assert isinstance(read_anything(tmp_path, name, content), str)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match="no calibration found"):
        read_calibration(tmp_path / name)
    with pytest.raises(InputError, match="no calibration found"):
        read_calibration(tmp_path / "gone")


@pytest.mark.parametrize("name", ["c.qca.txt", "c.xcp", "c.mcal", "c.xml"])
def test_entities_are_refused(good, tmp_path, name):
    text = good[name]
    for head in ('<!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>', '<!DOCTYPE x SYSTEM "http://example.org/x.dtd">'):
        assert "entities are declared" in read_anything(tmp_path, name, (head + text).encode())
