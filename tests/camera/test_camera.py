"""The camera model against OpenCV."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from hmc.camera.coverage import estimate_room, in_view, nearest_pixels
from hmc.camera.model import Camera, Rig, backproject, look_at, project, undistort
from hmc.errors import InputError

small = st.floats(-0.02, 0.02)


def number(low, high):
    return st.floats(low, high, allow_nan=False)


@st.composite
def cameras(draw, distorted=True):
    distortions = [draw(number(-0.35, 0.2)), draw(number(-0.1, 0.2)), draw(small), draw(small), draw(small)] if distorted else [0] * 5
    matrix = [[draw(number(300, 2000)), 0, draw(number(200, 500))], [0, draw(number(300, 2000)), draw(number(200, 500))], [0, 0, 1]]
    rotation = np.array([draw(number(-3, 3)) for _ in range(3)])
    return Camera("cam", (640, 480), matrix, distortions, rotation, [draw(number(-5, 5)) for _ in range(3)])


def points_in_front(camera, rng, n=50, spread=0.4):
    """World points up to `spread` (normalised) off the axis, where every distortion drawn here is one-to-one."""
    cam = np.column_stack([rng.uniform(-spread, spread, (n, 2)), np.ones(n)]) * rng.uniform(0.5, 20, (n, 1))
    return (cam - camera.translation) @ camera.rotation


@given(cameras(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_projection_is_opencvs(camera, seed):
    points = points_in_front(camera, np.random.default_rng(seed))
    vector = Rotation.from_matrix(camera.rotation).as_rotvec()  # cv2.Rodrigues rounds small angles of a matrix to none
    expected, _ = cv2.projectPoints(points, vector, camera.translation, camera.matrix, camera.distortions)
    uv, valid = project(camera, points)
    inside = np.linalg.norm(points @ camera.rotation.T + camera.translation, axis=1) > 0
    assert_allclose(uv[valid & inside], expected[:, 0][valid & inside], atol=1e-6)
    if camera.max_radius > 0.6:
        assert valid.all()


@given(cameras(), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_undistortion_inverts_the_projection_and_agrees_with_opencv(camera, seed):
    rng = np.random.default_rng(seed)
    points = points_in_front(camera, rng, spread=0.3)
    cam = points @ camera.rotation.T + camera.translation
    uv, valid = project(camera, points)
    assert valid.all()
    assert_allclose(undistort(camera, uv), cam[:, :2] / cam[:, 2:], atol=1e-7)
    criteria = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    # OpenCV 5 takes the criteria here; OpenCV 4 has another function for it.
    theirs_of = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)
    theirs = theirs_of(uv[:, None], camera.matrix, camera.distortions, R=np.eye(3), P=np.eye(3), criteria=criteria)
    assert_allclose(undistort(camera, uv), theirs[:, 0], atol=1e-5)


@given(cameras())
@settings(max_examples=30, deadline=None)
def test_rays_go_through_the_points(camera):
    points = points_in_front(camera, np.random.default_rng(0), spread=0.3)
    rays = backproject(camera, project(camera, points)[0])
    to_points = points - camera.centre
    assert_allclose(rays, to_points / np.linalg.norm(to_points, axis=1, keepdims=True), atol=1e-6)


@given(cameras(distorted=False))
@settings(max_examples=30, deadline=None)
def test_projection_matrix_and_centre(camera):
    points = points_in_front(camera, np.random.default_rng(1))
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ camera.projection.T
    assert_allclose(project(camera, points)[0], homogeneous[:, :2] / homogeneous[:, 2:], atol=1e-6)
    assert_allclose(camera.projection @ [*camera.centre, 1], 0, atol=1e-6)


def test_any_leading_shape_and_rigs(ring):
    points = np.random.default_rng(0).uniform(-1, 1, (4, 5, 3))
    uv, valid = project(ring, points)
    assert uv.shape == (len(ring), 4, 5, 2) and valid.shape == (len(ring), 4, 5)
    single, single_valid = project(ring[2], points[1, 3])
    assert_allclose(single, uv[2, 1, 3])
    assert single_valid.shape == () and single_valid == valid[2, 1, 3]
    assert project(ring[0], np.zeros((0, 3)))[0].shape == (0, 2)


def test_points_behind_the_camera_are_not_valid():
    camera = look_at("a", (640, 480), [0, -4, 1], [0, 0, 1], 60)
    points = np.array([[0, 0, 1.0], [0, -8, 1], [0, -4, 1], [1, -4, 1]])
    uv, valid = project(camera, points)
    assert valid.tolist() == [True, False, False, False]
    assert np.isfinite(uv).all()
    assert_allclose(uv[0], [319.5, 239.5])


def test_folding_distortion_is_cut_off():
    """k1 = -0.4 turns back at r = sqrt(1 / 1.2); what OpenCV folds into the image from beyond is not in view."""
    camera = Camera("a", (640, 480), [[400, 0, 320], [0, 400, 240], [0, 0, 1]], [-0.4, 0, 0, 0], np.zeros(3), np.zeros(3))
    assert_allclose(camera.max_radius, np.sqrt(1 / 1.2))
    points = np.array([[0.9, 0, 1], [0.92, 0, 1], [1.5, 0, 1.0]])
    folded = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, camera.distortions)[0][:, 0]
    assert 0 < folded[2, 0] < 640
    assert project(camera, points)[1].tolist() == [True, False, False]
    # The image's corners lie beyond the lens' circle: the answer is finite and on the circle's rim.
    assert np.linalg.norm(undistort(camera, np.array([[2000.0, 240]]))) <= camera.max_radius


def test_skew_is_kept():
    camera = Camera("a", (640, 480), [[500, 12, 320], [0, 500, 240], [0, 0, 1]], [0.05, 0], np.zeros(3), np.zeros(3))
    points = np.array([[0.1, 0.2, 1]])
    uv, _ = project(camera, points)
    assert_allclose(undistort(camera, uv), [[0.1, 0.2]], atol=1e-10)
    radial = 1 + 0.05 * 0.05
    assert_allclose(uv, [[500 * 0.1 * radial + 12 * 0.2 * radial + 320, 500 * 0.2 * radial + 240]])


@given(number(0.2, 3))
@settings(deadline=None)
def test_scaled_camera_sees_the_resized_image(factor):
    camera = look_at("a", (640, 480), [3, -2, 1.6], [0, 0, 1], 55, distortions=(-0.1, 0.02, 0, 0))
    uv, _ = project(camera, np.array([[0.2, 0.1, 1.4]]))
    smaller, _ = project(camera.scaled(factor), np.array([[0.2, 0.1, 1.4]]))
    assert_allclose(smaller + 0.5, (uv + 0.5) * factor, atol=1e-9)  # pixel centres lie on whole numbers


def test_look_at_is_upright_and_centred():
    camera = look_at("a", (640, 480), [3, -2, 1.6], [0, 0, 1], 55)
    assert_allclose(camera.centre, [3, -2, 1.6])
    low, high = project(camera, np.array([[0, 0, 0.5], [0, 0, 1.5]]))[0]
    assert high[1] < low[1]
    assert_allclose(project(camera, np.array([0, 0, 1.0]))[0], [319.5, 239.5])
    edge = backproject(camera, np.array([-0.5, 239.5])) @ camera.rotation[2]
    assert_allclose(np.degrees(np.arccos(edge)), 55 / 2, atol=0.1)
    overhead = look_at("top", (640, 480), [0, 0, 4], [0, 0, 0], 70)
    assert_allclose(overhead.rotation @ [0, 1, 0], [0, -1, 0], atol=1e-12)


GOOD = {
    "name": "a",
    "size": (640, 480),
    "matrix": np.diag([500.0, 500, 1]),
    "distortions": np.zeros(4),
    "rotation": np.eye(3),
    "translation": np.zeros(3),
}


@pytest.mark.parametrize(
    "key, value, message",
    [
        ("size", (640, 0), "`size` must be"),
        ("size", (640,), "`size` must be"),
        ("matrix", np.eye(2), "`matrix` must be 3 x 3"),
        ("rotation", [0.0, 90.0, 0.0], "more than a full turn; give it in radians"),
        ("matrix", np.diag([-500.0, 500, 1]), "no intrinsic matrix"),
        ("matrix", np.diag([np.nan, 500, 1]), "`matrix` holds a number that is not finite"),
        ("size", "wide", "`size` must be numbers"),
        ("size", (1e12, 480), "`size` must be"),
        ("matrix", [["a", 0, 0]], "`matrix` must be numbers"),
        ("matrix", [[500, 0], [0]], "`matrix` must be numbers"),
        ("distortions", [[0, 0, 0, 0, 0, 0.1, 0, 0]], "got 8 numbers, with k4, k5, k6"),
        ("distortions", [*[0] * 8, 0.1, 0, 0, 0], r"got 12 numbers, with s1 to s4 \(thin prism\): calibrate"),
        ("distortions", [*[0] * 13, 0.1], "got 14 numbers, with tilt"),
        ("distortions", [np.inf], "`distortions` holds"),
        ("rotation", np.zeros((2, 2)), "rotation vector"),
        ("rotation", np.diag([1.0, 1, -1]), "not a rotation"),
        ("rotation", 2 * np.eye(3), "not a rotation"),
        ("rotation", [np.nan, 0, 0], "`rotation` holds"),
        ("translation", np.zeros(2), "`translation` must be 3 numbers"),
        ("translation", [0, np.inf, 0], "`translation` holds"),
    ],
)
def test_a_wrong_camera_is_refused(key, value, message):
    with pytest.raises(InputError, match=message) as caught:
        Camera(**{**GOOD, key: value})
    assert str(caught.value).startswith("camera 'a'")
    assert "\n" not in str(caught.value)


def test_a_rotation_vector_is_a_rotation():
    vector = np.array([0.3, -1.2, 0.5])
    camera = Camera(**{**GOOD, "rotation": vector})
    assert_allclose(camera.rotation, cv2.Rodrigues(vector)[0], atol=1e-12)
    assert_allclose(camera.rotation, Rotation.from_rotvec(vector).as_matrix())


@pytest.mark.parametrize("length", [0, 4, 5, 8, 12, 14])
def test_what_opencv_returns_is_taken(length):
    """Columns from `calibrateCamera` and `solvePnP`, a row of distortions of any of its lengths, a size in any form."""
    rvec, tvec = np.array([[0.3], [-1.2], [0.5]]), np.array([[0.1], [0.2], [4.0]])
    distortions = np.array([-0.2, 0.05, 0.001, -0.002, 0.01, *[0.0] * 9])[None, :length]
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    for size in ([640, 480], np.array([640, 480]), (640.0, 480.0), np.array([[640], [480]])):
        camera = Camera("a", size, GOOD["matrix"], distortions, rvec, tvec)
        assert camera.size == (640, 480) and all(type(side) is int for side in camera.size)
        expected = cv2.projectPoints(points, rvec, tvec, GOOD["matrix"], distortions if length else None)[0][:, 0]
        assert_allclose(project(camera, points)[0], expected, atol=1e-9)
    for turned in (rvec.T, rvec.ravel(), cv2.Rodrigues(rvec)[0]):
        again = Camera("a", (640, 480), GOOD["matrix"], distortions, turned, tvec.T)
        assert_allclose(again.projection, camera.projection, atol=1e-12)


def test_cameras_cannot_be_changed_from_outside():
    translation = np.zeros(3)
    camera = Camera(**{**GOOD, "translation": translation})
    translation[0] = 7
    assert camera.translation[0] == 0
    with pytest.raises(ValueError):
        camera.translation[0] = 1


def test_rig_selects_by_name(ring):
    chosen = ring.select([ring.names[3], ring.names[0]])
    assert chosen.names == (ring.names[3], ring.names[0])
    assert_allclose(chosen.centres[0], ring[3].centre)
    with pytest.raises(InputError, match="no camera named 'nobody'"):
        ring.select(["nobody"])
    with pytest.raises(InputError, match="must differ"):
        Rig((ring[0], ring[0]))
    with pytest.raises(InputError, match="at least one camera"):
        Rig(())


def test_in_view_counts_whole_pixels():
    camera = look_at("a", (640, 480), [0, -4, 1], [0, 0, 1], 60)
    rays = backproject(camera, np.array([[-0.4, 100], [-0.6, 100], [639.4, 100], [639.6, 100], [10, 479.6]]))
    assert in_view(camera, camera.centre + 3 * rays).tolist() == [True, False, True, False, False]


def test_nearest_pixels_are_those_in_view_and_points_beside_the_camera_are_in_none():
    """Where the distortion never turns back, what is beside the camera is projected beyond all integers."""
    matrix = [[240, 0, 163], [0, 239, 119], [0, 0, 1]]
    camera = Camera("a", (320, 240), matrix, [-0.15, 0.04, 0, 0, 0], np.zeros(3), np.zeros(3))
    assert camera.max_radius == np.inf
    wanted = np.array([[0, 0], [17.4, 200.4], [319.4, 0], [-0.4, 239.4], [319.6, 4], [4, -0.6]])
    points = np.vstack([camera.centre + 2 * backproject(camera, wanted), [[3.0, 2.0, 2e-6], [0, 0, -1]]])
    with np.errstate(all="raise"):
        pixels, seen = nearest_pixels(camera, points)
    assert seen.tolist() == in_view(camera, points).tolist() == [True] * 4 + [False] * 4
    assert pixels.tolist() == [[0, 0], [17, 200], [319, 0], [0, 239]] + [[0, 0]] * 4


def test_estimated_room_is_where_the_views_overlap(ring):
    room = estimate_room(ring)
    assert room.shape == (2, 3) and room[0, 2] == 0 and room[1, 2] > 2
    assert np.all(room[0, :2] < -0.8) and np.all(room[1, :2] > 0.8)
    assert np.all(np.abs(room[:, :2]) < 4)
    moved = Rig(tuple(Camera(c.name, c.size, c.matrix, c.distortions, c.rotation, c.translation - c.rotation @ [10, 5, 0]) for c in ring))
    assert_allclose(estimate_room(moved), room + np.array([10, 5, 0]), atol=1e-6)


def test_estimated_room_of_odd_rigs():
    one = Rig((look_at("a", (640, 480), [0, -4, 1.5], [0, 0, 1], 60),))
    parallel = Rig(tuple(look_at(f"{i}", (640, 480), [i, -4, 1.5], [i, 0, 1.5], 60) for i in range(2)))
    blind = Rig((look_at("a", (640, 480), [0, 0, 9], [0, 0, 20], 30), look_at("b", (640, 480), [0, 0, 9], [1, 0, 20], 30)))
    for rig in (one, parallel, blind):
        room = estimate_room(rig)
        assert np.isfinite(room).all() and np.all(room[1] - room[0] >= 1.49)
