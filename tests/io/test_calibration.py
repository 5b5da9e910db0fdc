"""Calibration formats: round trips, real files beside their conversions, and files that are wrong."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.camera.model import Camera, Rig
from hmc.errors import InputError
from hmc.io.calibration import natural_key, read_calibration, write_calibration

number = st.floats(-5, 5, allow_nan=False)


@st.composite
def rigs(draw):
    def camera(i):
        focal, angle = draw(st.floats(100, 3000)), draw(st.lists(number, min_size=3, max_size=3))
        matrix = [[focal, 0, draw(number)], [0, focal * 1.01, draw(number)], [0, 0, 1]]
        distortions = draw(st.lists(number, min_size=0, max_size=5))
        translation = draw(st.lists(number, min_size=3, max_size=3))
        return Camera(
            f"cam_{i}", (draw(st.integers(1, 4000)), draw(st.integers(1, 4000))), matrix, distortions, np.array(angle), translation
        )

    return Rig(tuple(camera(i) for i in range(draw(st.integers(1, 12)))))


def assert_same(ours, theirs, atol=1e-9, names=True):
    assert len(ours) == len(theirs)
    for one, other in zip(ours, theirs, strict=True):
        assert (not names or one.name == other.name) and one.size == other.size
        for key in ("matrix", "distortions", "rotation", "translation"):
            assert_allclose(getattr(one, key), getattr(other, key), atol=atol, rtol=1e-9)


@given(rigs())
@settings(max_examples=30, deadline=None)
def test_toml_round_trip(tmp_path_factory, rig):
    path = tmp_path_factory.mktemp("rig") / "calibration.toml"
    write_calibration(path, rig)
    assert_same(read_calibration(path), rig)  # cam_10 after cam_2
    assert_same(read_calibration(path.parent), rig)


def test_natural_order():
    assert sorted(["cam_10", "cam_2", "cam_1", "b", "10", "9"], key=natural_key) == ["9", "10", "b", "cam_1", "cam_2", "cam_10"]


def write_storage(path, **items):
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for key, value in items.items():
        file.write(key, value)
    file.release()


@pytest.mark.parametrize("suffix", [".yml", ".yaml", ".xml"])
@pytest.mark.parametrize("form", ["samples", "short", "openpose"])
def test_opencv_one_file_a_camera(tmp_path, ring, suffix, form):
    for camera in ring:
        vector = cv2.Rodrigues(np.array(camera.rotation))[0]
        matrix, distortions = np.array(camera.matrix), camera.distortions[None].copy()
        translation = camera.translation[:, None].copy()
        items = {
            "samples": {
                "image_width": 160,
                "image_height": 120,
                "camera_matrix": matrix,
                "distortion_coefficients": distortions.T.copy(),
                "rvec": vector,
                "tvec": translation,
            },
            "short": {
                "image_size": np.array([[160.0, 120.0]]),
                "K": matrix,
                "D": distortions,
                "R": np.array(camera.rotation),
                "T": translation,
            },
            "openpose": {
                "CameraMatrix": np.column_stack([camera.rotation, camera.translation]),
                "Intrinsics": matrix,
                "Distortion": np.pad(distortions, ((0, 0), (0, 3))).T.copy(),
            },
        }[form]
        write_storage(tmp_path / f"{camera.name}{suffix}", **items)
    sizes = {camera.name: camera.size for camera in ring} if form == "openpose" else None
    assert_same(read_calibration(tmp_path, sizes), ring)


@pytest.mark.parametrize("with_matrix, with_size", [(True, True), (False, False)])
def test_easymocap_pair(tmp_path, ring, with_matrix, with_size):
    """Written as EasyMocap writes it: by hand, six digits, R_ a rotation vector and Rot_ a matrix."""

    def block(key, value):
        value = np.atleast_2d(np.asarray(value, float))
        data = ", ".join(f"{x:.9f}" for x in value.ravel())
        return f"{key}: !!opencv-matrix\r\n  rows: {value.shape[0]}\r\n  cols: {value.shape[1]}\r\n  dt: d\r\n  data: [{data}]\r\n"

    names = [str(i + 1) for i in range(len(ring))]
    intri = extri = "%YAML:1.0\r\n---\r\nnames:\r\n" + "".join(f'  - "{name}"\r\n' for name in names)
    for name, camera in zip(names, ring, strict=True):
        intri += block(f"K_{name}", camera.matrix) + block(f"dist_{name}", camera.distortions[None])
        intri += f"H_{name}: {camera.size[1]}\r\nW_{name}: {camera.size[0]}\r\n" if with_size else ""
        extri += block(f"R_{name}", Rotation.from_matrix(camera.rotation).as_rotvec()[:, None])
        extri += block(f"Rot_{name}", camera.rotation) if with_matrix else ""
        extri += block(f"T_{name}", camera.translation[:, None])
    (tmp_path / "intri.yml").write_text(intri)
    (tmp_path / "extri.yml").write_text(extri)
    sizes = None if with_size else {name: camera.size for name, camera in zip(names, ring, strict=True)}
    for path in (tmp_path, tmp_path / "intri.yml", tmp_path / "extri.yml"):
        rig = read_calibration(path, sizes)
        assert rig.names == tuple(names)
        assert_same(rig, ring, atol=1e-8, names=False)
    (tmp_path / "extri.yml").unlink()
    with pytest.raises(InputError, match=r"extri.yml: .*pair"):
        read_calibration(tmp_path)


def test_humaneva_numbers(tmp_path):
    rotation = Rotation.from_rotvec([0.4, -1.1, 0.3]).as_matrix()
    numbers = [700, 710, 320, 240, 0.001, -0.2, 0.1, 0.001, 0.002, 0.0, *rotation.ravel(), 1500, -20, 4000]
    (tmp_path / "C1.cal").write_text("\n".join(f"{n:.12f}" for n in numbers))
    (camera,) = read_calibration(tmp_path, {"C1": (640, 480)})
    assert camera.name == "C1"
    assert_allclose(camera.matrix, [[700, 0.7, 320], [0, 710, 240], [0, 0, 1]])
    assert_allclose(camera.distortions, [-0.2, 0.1, 0.001, 0.002, 0])
    assert_allclose(camera.rotation, rotation, atol=1e-9)
    assert_allclose(camera.translation, [1.5, -0.02, 4.0])
    with pytest.raises(InputError, match=r"'C1'.*no image size"):
        read_calibration(tmp_path)


def test_bodytrack_files_are_their_conversion(shared_data):
    folder = shared_data / "bodytrack"
    sizes = {f"Camera{i}": (640, 480) for i in range(1, 5)}
    rig = read_calibration(folder / "original", sizes)
    assert rig.names == tuple(sizes)
    assert_same(rig, read_calibration(folder), atol=1e-6, names=False)


def test_qualisys_file_is_its_conversion(shared_data):
    folder = shared_data / "balancing" / "original"
    assert_same(read_calibration(folder / "Calib.qca.txt"), read_calibration(folder / "Calib_qualisys.toml"), atol=1e-7)


QUALISYS = """<?xml version='1.0'?>
<calibration source="x"><cameras>
 <camera active="1" model="Miqus Video" serial="20"><fov_video left="10" top="20" right="649" bottom="499"/>
  <transform x="1000" y="-2000" z="1500" r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0"/>
  <intrinsic focalLengthU="64000" focalLengthV="64000" centerPointU="20480" centerPointV="16000" radialDistortion1="0"
   radialDistortion2="0" tangentalDistortion1="0" tangentalDistortion2="0"/></camera>
 <camera active="1" model="Arqus A5" serial="7"/>
 <camera active="0" model="Miqus Video" serial="8"/>
</cameras></calibration>"""


def test_qualisys_by_hand(tmp_path):
    """A camera at (1, -2, 1.5) m that looks along +y: its own x, y, z axes are x, z and -y of the room."""
    (tmp_path / "c.qca.txt").write_text(QUALISYS)
    (camera,) = read_calibration(tmp_path)
    assert camera.name == "20" and camera.size == (640, 480)
    assert_allclose(camera.centre, [1, -2, 1.5])
    assert_allclose(camera.rotation[2], [0, 1, 0], atol=1e-12)
    assert_allclose(camera.rotation[1], [0, 0, -1], atol=1e-12)
    assert_allclose(camera.matrix, [[1000, 0, 310], [0, 1000, 230], [0, 0, 1]])


GOOD = """[cam_00]
name = "cam_00"
size = [640, 480]
matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
distortions = [0, 0, 0, 0]
rotation = [0, 0, 0]
translation = [0, 0, 4]
fisheye = false
[metadata]
adjusted = false
"""


@pytest.mark.parametrize(
    "file, text, message",
    [
        ("calibration.toml", GOOD.replace("fisheye = false", "fisheye = true"), r"\[cam_00\] is a fisheye camera"),
        ("calibration.toml", GOOD.replace("rotation =", "rotations ="), r"\[cam_00\] has no `rotation`"),
        ("calibration.toml", GOOD.replace("[0, 0, 4]", "[nan, 0, 4]"), "camera 'cam_00': `translation` holds a number that is not finite"),
        ("calibration.toml", GOOD.replace("[0, 0, 4]", '["a", 0, 4]'), r"\[cam_00\] `translation` must be numbers"),
        ("calibration.toml", GOOD.replace("[640, 480]", "[640]"), r"\[cam_00\] `size` must be"),
        ("calibration.toml", GOOD.replace("[640, 480]", "[nan, 480]"), r"\[cam_00\] `size` must be"),
        ("calibration.toml", GOOD + GOOD.replace("[cam_00]", "[cam_01]").replace("[metadata]\nadjusted = false", ""), "names must differ"),
        ("calibration.toml", "[metadata]\nerror = 0\n", "no camera in this calibration"),
        ("calibration.toml", "size = [", "not a TOML file"),
        ("c.yml", "%YAML:1.0\n---\nK: [1, 2\n", "not an OpenCV YAML or XML file"),
        ("c.yml", "%YAML:1.0\n---\nalpha: 2\n", "no intrinsic matrix, no rotation"),
        ("c.xml", '<?xml version="1.0"?>\n<opencv_storage>\n<a>1</a>\n</opencv_storage>\n', "no intrinsic matrix, no rotation"),
        ("c.xml", "<other/>", "not a calibration of a known form"),
        ("c.qca.txt", "<calibration", "not a Qualisys calibration"),
        ("c.qca.txt", QUALISYS.replace('x="1000" ', ""), "camera '20' needs <transform>"),
        ("c.cal", "1 2 3", "a .cal file holds 22 numbers"),
        ("c.cal", "one two", "a .cal file holds 22 numbers"),
        ("notes.txt", "hello", r"no calibration found here or in calibration/ \(notes.txt: not of a known form\)"),
    ],
)
def test_wrong_files_say_what_is_wrong(tmp_path, file, text, message):
    (tmp_path / file).write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        read_calibration(tmp_path)
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def test_two_calibrations_in_one_folder(tmp_path):
    for name in ("Calib_a.toml", "Calib_b.toml"):
        (tmp_path / name).write_text(GOOD)
    with pytest.raises(InputError, match="more than one calibration"):
        read_calibration(tmp_path)
