"""Every calibration format: a drawn rig, written by hand as the program writes it, is read back to the same pixels; and public samples."""

import json

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.camera.model import Camera, Rig, project
from hmc.errors import InputError
from hmc.io.calibration import read_calibration

SIZE = (1280, 720)


def draw_rig(rng, names, distorted=True, skew=0.0, distance=4.0):
    """Cameras around a room of some metres that look at its middle, rolled at random, with lenses of their own."""

    def camera(name):
        back = rng.normal(size=3)
        back /= np.linalg.norm(back)
        side = np.cross(back, rng.normal(size=3))
        side /= np.linalg.norm(side)
        rotation = np.stack([side, np.cross(-back, side), -back])
        matrix = np.array(
            [[rng.uniform(900, 1400), skew, rng.uniform(600, 680)], [0, rng.uniform(900, 1400), rng.uniform(330, 390)], [0, 0, 1]]
        )
        distortions = rng.uniform(-1, 1, 5) * [0.2, 0.05, 0.002, 0.002, 0.01] if distorted else np.zeros(5)
        return Camera(name, SIZE, matrix, distortions, rotation, -rotation @ (distance * back * rng.uniform(0.8, 1.2)))

    return Rig(tuple(camera(name) for name in names))


@pytest.fixture(params=[0, 1, 2])
def rng(request):
    return np.random.default_rng(request.param)


def pixels_by_opencv(camera, points):
    rvec = cv2.Rodrigues(np.array(camera.rotation))[0]
    # OpenCV leaves the skew out, so its part ends before the intrinsic matrix.
    xy = cv2.projectPoints(points, rvec, np.array(camera.translation), np.eye(3), np.array(camera.distortions))[0][:, 0]
    return xy @ camera.matrix[:2, :2].T + camera.matrix[:2, 2]


def assert_same_pixels(read, drawn, atol=1e-6, sizes=True):
    points = np.random.default_rng(9).uniform(-0.7, 0.7, (50, 3))
    assert read.names == drawn.names
    for one, other in zip(read, drawn, strict=True):
        assert not sizes or one.size == other.size
        uv, valid = project(one, points)
        assert valid.all()
        assert_allclose(uv, pixels_by_opencv(other, points), atol=atol)


def sizes_of(rig):
    return {camera.name: camera.size for camera in rig}


def vector(camera):
    return Rotation.from_matrix(camera.rotation).as_rotvec()


def toml_table(head, camera, rotation, scale=1.0, **more):
    values = {
        "size": list(camera.size),
        "matrix": camera.matrix.tolist(),
        "distortions": camera.distortions.tolist(),
        "rotation": np.asarray(rotation).tolist(),
        "translation": (camera.translation * scale).tolist(),
        **more,
    }
    return f"[{head}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items()) + "\n"


@pytest.mark.parametrize("form", ["vector", "matrix"])
def test_caliscope(tmp_path, rng, form):
    """As in its test sessions: tables by number, rotations as vectors or (older) matrices, one camera ignored, others' tables beside."""
    rig = draw_rig(rng, ["cam_0", "cam_2", "cam_10"])
    text = "".join(
        toml_table(
            f"cameras.{camera.name[4:]}",
            camera,
            camera.rotation if form == "matrix" else vector(camera),
            cam_id=int(camera.name[4:]),
            rotation_count=0,
            error=0.2,
            ignore=False,
        )
        for camera in rig
    )
    text += '[cameras.3]\ncam_id = 3\nignore = true\nrotation = "null"\nmatrix = [[1]]\nsize = [640, 480]\n\n'
    text += '[charuco]\ncolumns = 4\nrotation = "null"\n'
    (tmp_path / "camera_array.toml").write_text(text)
    assert_same_pixels(read_calibration(tmp_path), rig)
    (tmp_path / "camera_array.toml").write_text(text.replace("ignore = true", "ignore = false"))
    with pytest.raises(InputError, match=r"\[cam_3\] has no `distortions`, `rotation`, `translation`; each"):
        read_calibration(tmp_path)


def test_caliscopes_first_form(tmp_path, rng):
    """A `config.toml` with [cam_0] tables and all settings in it; Pose2Sim's Config.toml is none."""
    rig = draw_rig(rng, ["cam_0", "cam_1"])
    text = "CreationDate = 2023-03-31T09:56:43.193358\n" + "".join(
        toml_table(camera.name, camera, camera.rotation, port=k) for k, camera in enumerate(rig)
    )
    (tmp_path / "config.toml").write_text(text + "[charuco]\nrows = 5\n")
    assert_same_pixels(read_calibration(tmp_path), rig)
    (tmp_path / "config.toml").write_text("[project]\nframe_rate = 60\n")
    with pytest.raises(
        InputError,
        match=r"no calibration found here or in calibration/ \(config.toml: not of a known form\); what can be read is Anip.*_par\.txt",
    ):
        read_calibration(tmp_path)


def test_freemocap(tmp_path, rng):
    """As in its test data, with the fields of newer versions: millimetres, which recording.toml says."""
    rig = draw_rig(rng, ["synced_Cam1", "synced_Cam2"])
    text = "".join(
        toml_table(
            f"cam_{k}",
            camera,
            vector(camera),
            1000.0,
            name=camera.name,
            world_orientation=camera.rotation.T.tolist(),
            world_position=(1000 * camera.centre).tolist(),
        )
        for k, camera in enumerate(rig)
    )
    (tmp_path / "take_camera_calibration.toml").write_text(
        text + '[metadata]\ncharuco_square_size = 58.0\ngroundplane_calibration = "null"\n'
    )
    (tmp_path / "recording.toml").write_text('units = "mm"\n')
    assert_same_pixels(read_calibration(tmp_path), rig)


def vicon_ideal(lens, pixels):
    offset = pixels - lens[:2]
    r2 = (offset**2).sum(axis=1, keepdims=True)
    return lens[:2] + offset * (1 + lens[2] * r2 + lens[3] * r2**2 + lens[4] * r2**3)


@pytest.mark.parametrize("key", ["VICON_RADIAL2", "VICON_RADIAL"])
def test_vicon(tmp_path, rng, key):
    """Its lens model goes from the image to the ideal camera: each pixel that we say must, corrected so, be where a pinhole has it."""
    rig = draw_rig(rng, ["2111", "21110"], distorted=False)
    lenses, nodes = {}, ""
    for place, camera in enumerate(rig):
        matrix = np.array(camera.matrix)
        matrix[1, 1] = matrix[0, 0]
        rig = Rig((*rig[:place], Camera(camera.name, camera.size, matrix, [0], camera.rotation, camera.translation), *rig[place + 1 :]))
        centre = matrix[:2, 2] + (3.0 if key == "VICON_RADIAL2" else 0.0)
        lens = np.array([*centre, *rng.uniform(-1, 1, 3) * [6e-8, 1e-14, 1e-21 * (key == "VICON_RADIAL2")]])
        lenses[camera.name] = lens
        words = f"Vicon3Parameter {' '.join(map(repr, lens.tolist()))}" if key == "VICON_RADIAL2" else f"{lens[2]} {lens[3]}"
        nodes += (
            f'<Camera DEVICEID="{camera.name}" TYPE="Vue_VIDEO" DISPLAY_TYPE="Vue" PIXEL_ASPECT_RATIO="1" SENSOR_SIZE="1280 720" SKEW="0">'
            f'<ThresholdGrid/><KeyFrames><KeyFrame FRAME="0" FOCAL_LENGTH="{matrix[0, 0]}" WORLD_ERROR="0.3" '
            f'ORIENTATION="{" ".join(map(repr, Rotation.from_matrix(camera.rotation).as_quat().tolist()))}" '
            f'POSITION="{" ".join(map(repr, (1000 * camera.centre).tolist()))}" '
            f'PRINCIPAL_POINT="{matrix[0, 2]} {matrix[1, 2]}" {key}="{words}"/></KeyFrames></Camera>\n'
        )
    nodes += '<Camera DEVICEID="9" TYPE="VeroV2.2" SENSOR_SIZE="2048 1088"><KeyFrames><KeyFrame FRAME="0"/></KeyFrames></Camera>'
    (tmp_path / "walk.xcp").write_text(f'<?xml version="1.0" encoding="UTF-8" standalone="no" ?>\n<Cameras VERSION="1.0">{nodes}</Cameras>')
    read = read_calibration(tmp_path)
    assert read.names == rig.names
    points = rng.uniform(-0.7, 0.7, (60, 3))
    for camera, pinhole in zip(read, rig, strict=True):
        uv, _ = project(camera, points)
        inside = (uv >= 0).all(axis=1) & (uv < SIZE).all(axis=1)
        assert inside.sum() > 20
        assert_allclose(vicon_ideal(lenses[camera.name], uv[inside]), pixels_by_opencv(pinhole, points)[inside], atol=0.3)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-8"])
def test_optitrack(tmp_path, rng, encoding):
    """In UTF-16, as Motive writes it; colour cameras only; metres and y up, which recording.toml says: units are the format's own."""
    rig = draw_rig(rng, ["C11764", "C11765"])
    flip, y_up = np.diag([1.0, -1, -1]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    nodes = '<Camera Serial="M21614"><Attributes ImagerPixelWidth="1664" ImagerPixelHeight="1088"/><Extrinsic X="0"/></Camera>'
    for camera in rig:
        axes, (k1, k2, p1, p2, k3) = y_up @ camera.rotation.T @ flip, camera.distortions.tolist()
        x, y, z = (y_up @ camera.centre).tolist()
        (fx, _, cx), (_, fy, cy), _ = camera.matrix.tolist()
        nodes += (
            f'<Camera Serial="{camera.name}"><Properties CameraID="1"/><Attributes ImagerPixelWidth="1280" ImagerPixelHeight="720"/>'
            '<Intrinsic LensCenterX="1" LensCenterY="1" HorizontalFocalLength="1" VerticalFocalLength="1" k1="1"/>'
            f'<IntrinsicStandardCameraModel LensCenterX="{cx}" LensCenterY="{cy}" HorizontalFocalLength="{fx}" VerticalFocalLength="{fy}" '
            f'k1="{k1}" k2="{k2}" k3="{k3}" TangentialX="{p1}" TangentialY="{p2}"/><Extrinsic X="{x}" Y="{y}" Z="{z}" '
            + " ".join(f'OrientMatrix{i}="{value!r}"' for i, value in enumerate(axes.ravel().tolist()))
            + "/></Camera>"
        )
    text = f'<?xml version="1.0" encoding="UTF-16LE"?>\n<calibrationProfile version="1"><Calibration><Cameras Count="3">{nodes}</Cameras>'
    (tmp_path / "take.mcal").write_bytes((text + "</Calibration></calibrationProfile>").encode(encoding))
    (tmp_path / "recording.toml").write_text('up = "y"\nunits = "mm"\n')
    assert_same_pixels(read_calibration(tmp_path), rig)


def test_optitracks_public_sample(tmp_path):
    """The numbers of one real camera that is on the web with them: 2.66 m up, it looks at the room's middle, upright."""
    text = (
        '<calibrationProfile><Calibration><Cameras><Camera Serial="C11764"><Attributes ImagerPixelWidth="1920" ImagerPixelHeight="1080"/>'
        '<IntrinsicStandardCameraModel LensCenterX="960.596" LensCenterY="538.614" HorizontalFocalLength="1247.841" '
        'VerticalFocalLength="1247.755" k1="0.136385" k2="-0.125546" k3="0.000035" TangentialX="0.000259" TangentialY="-0.000259"/>'
        '<Extrinsic X="-0.268640" Y="2.655145" Z="-3.509723" OrientMatrix0="-0.995356" OrientMatrix1="-0.046982" OrientMatrix2="0.084021" '
        'OrientMatrix3="0.000355" OrientMatrix4="0.871016" OrientMatrix5="0.491255" OrientMatrix6="-0.096264" OrientMatrix7="0.489003" '
        'OrientMatrix8="-0.866954"/></Camera></Cameras></Calibration></calibrationProfile>'
    )
    (tmp_path / "one.mcal").write_text(text)
    (tmp_path / "recording.toml").write_text('up = "y"\n')
    (camera,) = read_calibration(tmp_path)
    assert_allclose(camera.centre, [-0.26864, 3.509723, 2.655145], atol=1e-5)
    (low, high), valid = project(camera, np.array([[0, 0, 0.5], [0, 0, 1.5]]))
    assert valid.all() and 0 < high[1] < low[1] < 1080 and abs(low[0] - high[0]) < 30 and 0 < low[0] < 1920


def panoptic(rig, scale=100.0, kind="hd"):
    return [
        {
            "name": camera.name,
            "type": kind,
            "resolution": list(camera.size),
            "panel": 0,
            "node": k,
            "K": camera.matrix.tolist(),
            "distCoef": camera.distortions.tolist(),
            "R": camera.rotation.tolist(),
            "t": (scale * camera.translation)[:, None].tolist(),
        }
        for k, camera in enumerate(rig)
    ]


def test_panoptic(tmp_path, rng):
    """Centimetres; the VGA cameras, of which there are hundreds, are left out where there are HD ones."""
    rig, small = draw_rig(rng, ["00_00", "00_01"]), draw_rig(rng, ["01_01"])
    data = {"calibDataSource": "160224_haggling1", "cameras": panoptic(small, kind="vga") + panoptic(rig)}
    (tmp_path / "calibration_160224_haggling1.json").write_text(json.dumps(data))
    (tmp_path / "recording.toml").write_text('units = "cm"\n')
    assert_same_pixels(read_calibration(tmp_path), rig)
    data["cameras"] = panoptic(small, kind="vga")
    (tmp_path / "calibration_160224_haggling1.json").write_text(json.dumps(data))
    assert read_calibration(tmp_path).names == small.names


def test_panoptics_public_sample(tmp_path):
    """Camera 00_00 of a public recording, as its toolbox documents the file: pixels are those of `cv2.projectPoints`, in centimetres."""
    sample = {
        "name": "00_00",
        "type": "hd",
        "resolution": [1920, 1080],
        "K": [[1632.8, 0, 943.554], [0, 1628.61, 555.893], [0, 0, 1]],
        "distCoef": [-0.217919, 0.178319, 0.000243348, 0.000605667, 0.0566046],
        "R": [
            [0.1335065269, 0.03328299897, -0.9904888941],
            [-0.0922107759, 0.9955175565, 0.02102302156],
            [0.9867487928, 0.08852703885, 0.1359771426],
        ],
        "t": [[22.59674467], [126.4923663], [283.6143792]],
    }
    (tmp_path / "calibration.json").write_text(json.dumps({"cameras": [sample]}))
    (tmp_path / "recording.toml").write_text('units = "cm"\nup = "-y"\n')
    (camera,) = read_calibration(tmp_path)
    assert 0 < camera.centre[2] < 4
    points = np.random.default_rng(0).uniform(-50, 50, (20, 3))
    expected = cv2.projectPoints(
        points, cv2.Rodrigues(np.array(sample["R"]))[0], np.array(sample["t"]), np.array(sample["K"]), np.array(sample["distCoef"])
    )[0][:, 0]
    ours = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1) / 100
    assert_allclose(project(camera, ours)[0], expected, atol=1e-6)


@pytest.mark.parametrize("suffix", [".yml", ".xml", ".json"])
def test_opencv_with_vectors_of_a_board(tmp_path, rng, suffix):
    """`calibrateCamera`'s names, with the one view that counts; with several, nobody knows which."""
    rig = draw_rig(rng, ["left", "right"])
    for camera in rig:
        storage = cv2.FileStorage(str(tmp_path / f"cam_{camera.name}{suffix}"), cv2.FILE_STORAGE_WRITE)
        storage.write("camera_matrix", np.array(camera.matrix))
        storage.write("dist_coeffs", np.pad(camera.distortions, (0, 9))[None])
        storage.write("image_size", np.array([[1280.0, 720.0]]))
        storage.write("rotation_vectors", vector(camera)[None].copy())
        storage.write("translation_vectors", camera.translation[None].copy())
        storage.release()
    assert_same_pixels(read_calibration(tmp_path), Rig(tuple(Camera(f"cam_{c.name}", *list(vars(c).values())[1:6]) for c in rig)))
    text = {"K": rig[0].matrix.tolist(), "rvecs": [[[0.1], [0.2], [0.3]], [[0.1], [0.2], [0.4]]], "tvecs": [[0, 0, 4], [0, 0, 5]]}
    (tmp_path / "calibration.toml").unlink(missing_ok=True)
    (tmp_path / "calib_left.json").write_text(json.dumps(text))
    with pytest.raises(InputError, match="`rvecs` of 'calib_left' holds 2 views of a board; keep the one"):
        read_calibration(tmp_path / "calib_left.json")


@pytest.mark.parametrize("form", ["list", "by name", "nested"])
def test_opencv_json_with_all_cameras(tmp_path, rng, form):
    rig = draw_rig(rng, ["a", "b", "c"])
    groups = [
        {
            "intrinsics": {"camera_matrix": camera.matrix.tolist(), "dist_coeff": camera.distortions.tolist()},
            "image_size": {"width": 1280, "height": 720},
            "rvec": vector(camera).tolist(),
            "tvec": camera.translation.tolist(),
        }
        for camera in rig
    ]
    named = {camera.name: group for camera, group in zip(rig, groups, strict=True)}
    listed = [{"name": name, **group} for name, group in named.items()]
    data = {"list": {"cameras": listed}, "by name": {"date": "today", **named}, "nested": {"cameras": named}}[form]
    (tmp_path / "calib.json").write_text(json.dumps(data))
    assert_same_pixels(read_calibration(tmp_path), rig)


def test_plain_yaml(tmp_path, rng):
    """Lists in lists, without OpenCV's head: as PyYAML writes them."""
    (camera,) = rig = draw_rig(rng, ["cam_1"])
    lines = [
        f"camera_matrix: {camera.matrix.tolist()}",
        f"dist: {camera.distortions.tolist()}",
        "width: 1280",
        "height: 720",
        f"rvec: {vector(camera).tolist()}",
        f"tvec: {camera.translation.tolist()}",
    ]
    (tmp_path / "cam_1.yaml").write_text("\n".join(lines) + "\n")
    assert_same_pixels(read_calibration(tmp_path), rig)


def test_what_is_missing_is_told_at_once(tmp_path):
    (tmp_path / "calib.json").write_text(json.dumps({"cameras": [{"name": "a", "K": np.eye(3).tolist()}, {"name": "b"}]}))
    with pytest.raises(InputError, match="no rotation, no translation of camera 'a'; no intrinsic matrix, no rotation, no translation of"):
        read_calibration(tmp_path)
    (tmp_path / "c.qca.txt").write_text('<calibration><camera serial="1"/><camera serial="2"><fov_video left="0"/></camera></calibration>')
    with pytest.raises(InputError, match=r"'1' needs <intrinsic>.*'1' needs <transform>.* and 2 more"):
        read_calibration(tmp_path / "c.qca.txt")
    (tmp_path / "intri.yml").write_text('%YAML:1.0\n---\nnames: ["1", "2"]\n')
    (tmp_path / "extri.yml").write_text('%YAML:1.0\n---\nnames: ["1", "2"]\n')
    with pytest.raises(InputError, match=r"intri\.yml: has no K_1, K_2; .*extri\.yml: has no R_1, T_1, R_2, T_2; every camera"):
        read_calibration(tmp_path / "intri.yml")


def test_qualisys_todays_fields(tmp_path, rng):
    """Skew and a third radial coefficient; distortions are a 64th, as Pose2Sim has them."""
    rig = draw_rig(rng, ["20"], skew=0.7)
    (camera,) = rig
    axes = np.diag([1.0, -1, -1]) @ camera.rotation
    k1, k2, p1, p2, k3 = (64 * camera.distortions).tolist()
    text = (
        '<QTM_Parameters_Ver_1.25><calibration><cameras><camera active="1" model="Miqus Video" serial="20" viewrotation="0">'
        '<fov_video left="0" top="0" right="1279" bottom="719"/><fov_video_max left="0" top="0" right="1919" bottom="1079"/><transform '
        + " ".join(f'r{i // 3 + 1}{i % 3 + 1}="{value!r}"' for i, value in enumerate(axes.ravel().tolist()))
        + " "
        + " ".join(f'{axis}="{value!r}"' for axis, value in zip("xyz", (1000 * camera.centre).tolist(), strict=True))
        + f'/><intrinsic focallength="9.3" sensorMinU="0" sensorMaxU="81919" focalLengthU="{64 * camera.matrix[0, 0]}" '
        f'focalLengthV="{64 * camera.matrix[1, 1]}" centerPointU="{64 * camera.matrix[0, 2]}" centerPointV="{64 * camera.matrix[1, 2]}" '
        f'skew="{64 * camera.matrix[0, 1]}" radialDistortion1="{k1}" radialDistortion2="{k2}" radialDistortion3="{k3}" '
        f'tangentalDistortion1="{p1}" tangentalDistortion2="{p2}"/></camera></cameras></calibration></QTM_Parameters_Ver_1.25>'
    )
    (tmp_path / "c.qca.txt").write_text(text)
    assert_same_pixels(read_calibration(tmp_path), rig)


def test_theia(tmp_path, rng):
    """Looks like Qualisys', but the transform is that of points, in pixels and without a field of view."""
    (camera,) = rig = draw_rig(rng, ["22"])
    k1, k2, p1, p2, k3 = camera.distortions.tolist()
    text = (
        '<calibration><cameras><camera active="1" serial="22" viewrotation="0"><transform '
        + " ".join(f'r{i // 3 + 1}{i % 3 + 1}="{value!r}"' for i, value in enumerate(camera.rotation.ravel().tolist()))
        + " "
        + " ".join(f'{axis}="{value!r}"' for axis, value in zip("xyz", (1000 * camera.translation).tolist(), strict=True))
        + '/><intrinsic focallength="4.6" sensorMinU="0" sensorMaxU="1280" sensorMinV="0" sensorMaxV="720" '
        f'focalLengthU="{camera.matrix[0, 0]}" focalLengthV="{camera.matrix[1, 1]}" centerPointU="{camera.matrix[0, 2]}" '
        f'centerPointV="{camera.matrix[1, 2]}" skew="0" radialDistortion1="{k1}" radialDistortion2="{k2}" radialDistortion3="{k3}" '
        f'tangentalDistortion1="{p1}" tangentalDistortion2="{p2}"/></camera></cameras></calibration>'
    )
    (tmp_path / "theia.qca.txt").write_text(text)
    assert_same_pixels(read_calibration(tmp_path), rig)


@pytest.mark.parametrize("factor", [1.0, -0.03, 250.0])
@pytest.mark.parametrize("form", ["header", "spaces", "three rows"])
def test_projection_matrices(tmp_path, rng, factor, form):
    """Their scale and sign mean nothing."""
    rig = draw_rig(rng, ["projection"] if form == "three rows" else ["3", "12"], distorted=False, skew=1.5)
    rows = {camera.name: (factor * camera.projection).ravel().tolist() for camera in rig}
    if form == "three rows":
        text = "\n".join(" ".join(map(repr, row.tolist())) for row in factor * rig[0].projection)
        path = tmp_path / "projection.txt"
    else:
        gap = "," if form == "header" else " "
        text = "\n".join(gap.join([name, *map(repr, row)]) for name, row in rows.items()) + "\n"
        text = "view," + ",".join(f"p{i}{j}" for i in range(3) for j in range(4)) + "\n" + text if form == "header" else text
        path = tmp_path / f"projections.{'csv' if form == 'header' else 'txt'}"
    path.write_text(text)
    assert_same_pixels(read_calibration(tmp_path, sizes_of(rig)), rig)


def test_middlebury(tmp_path, rng):
    rig = draw_rig(rng, ["dinoSR0001", "dinoSR0002"], distorted=False)
    lines = [
        " ".join([f"{c.name}.png", *(repr(x) for x in (*c.matrix.ravel().tolist(), *c.rotation.ravel().tolist(), *c.translation.tolist()))])
        for c in rig
    ]
    (tmp_path / "dinoSR_par.txt").write_text("\n".join([str(len(lines)), *lines]))
    assert_same_pixels(read_calibration(tmp_path, sizes_of(rig)), rig)


def test_middleburys_public_sample(shared_data):
    """The documented bounding box of the toy is in every image."""
    folder = shared_data / "dino_sparse_ring"
    names = [f"dinoSR{number:04d}" for number in range(1, 17)]
    rig = read_calibration(folder, dict.fromkeys(names, (640, 480)))
    assert rig.names == tuple(names)
    low, high = np.array([-0.061897, -0.018874, -0.057845]), np.array([0.010897, 0.068227, 0.015495])
    uv, valid = project(rig, (low + high)[None] / 2)
    assert valid.all() and (uv > 0).all() and (uv < (640, 480)).all()
    first = rig[0]
    assert_allclose(first.projection[0, 3], 3310.4 * -0.010415508744 + 316.73 * 0.673097816109)


def test_dinosaurs_public_sample(shared_data):
    """The matrices of the file come back up to scale, and the toy is in the images' middle."""
    folder = shared_data / "dinosaur"
    table = np.genfromtxt(folder / "projections.csv", delimiter=",", skip_header=1)
    rig = read_calibration(folder, {str(int(view)): (720, 576) for view in table[:, 0]})
    assert rig.names == tuple(str(int(view)) for view in table[:, 0])
    for camera, row in zip(rig, table[:, 1:], strict=True):  # its world is left-handed
        given = row.reshape(3, 4) / np.linalg.norm(row.reshape(3, 4)[2, :3]) * [-1, 1, 1, 1]
        assert_allclose(camera.projection, given, atol=1e-6 * np.abs(given).max())
    uv, valid = project(rig, np.array([0.0, -0.027, -0.63]))
    assert valid.all() and (np.abs(uv - (360, 288)) < (200, 200)).all()


def test_qualisys_of_two_people(shared_data):
    """In `calibration/`; four portrait cameras around a room of some metres, all of them above the floor."""
    rig = read_calibration(shared_data / "two_people")
    assert rig.names == ("cam01", "cam02", "cam03", "cam04") and {camera.size for camera in rig} == {(1088, 1920)}
    assert (rig.centres[:, 2] > 1).all() and (np.linalg.norm(rig.centres, axis=1) < 6).all()
    _, valid = project(rig, np.array([0.0, 0, 1]))
    assert valid.all()
