"""Pretended keypoints: where they should be, hidden where a rule says so, and the same for the same seed."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import hmc
from hmc.camera.model import look_at, project
from hmc.io.keypoints import KEYPOINTS, open_keypoints
from hmc.io.results import read_joints
from hmc.landmarks import LANDMARKS
from hmc.synthetic.keypoints import KeypointNoise, body_keypoints, hidden_keypoints, write_keypoints

TINY = Path(__file__).resolve().parents[2] / "data" / "synthetic" / "tiny"
EXACT = KeypointNoise(noise_px=0, offset_spread_m=0, miss_rate=0, hidden_miss_rate=0, swap_rate=0, lost_rate=0, false_rate=0)
NO_BOXES = np.zeros((0, 2, 3))


@pytest.fixture
def tiny(tmp_path):
    return Path(shutil.copytree(TINY, tmp_path / "tiny"))


def standing():
    """Joints of somebody who stands at the origin and looks along x, shape (15, 3)."""
    places = {
        "pelvis": (0, 0, 0.95), "neck": (0, 0, 1.5), "head_top": (0, 0, 1.75), "shoulder": (0, 0.2, 1.42), "elbow": (0, 0.25, 1.1),
        "wrist": (0, 0.28, 0.85), "hip": (0, 0.1, 0.95), "knee": (0, 0.1, 0.5), "ankle": (0, 0.1, 0.08),
    }  # fmt: skip
    rows = [np.array(places[name.split("_")[1] if name[1] == "_" else name]) for name in LANDMARKS]
    return np.array([row * (1, -1 if name.startswith("r_") else 1, 1) for name, row in zip(LANDMARKS, rows, strict=True)])


def test_the_landmarks_of_a_body():
    points = dict(zip(KEYPOINTS, body_keypoints(standing()), strict=True))
    assert_allclose(points["l_hip"], [0, 0.125, 0.92])
    assert_allclose(points["r_shoulder"], [0, -0.18, 1.43])
    assert points["nose"][0] > 0.1 and points["l_ear"][1] > 0.05 > points["r_ear"][1] and points["r_big_toe"][0] > 0.1
    turned = standing() @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    assert body_keypoints(turned)[KEYPOINTS.index("nose")][1] > 0.1


def test_what_hides_a_landmark():
    body = standing()
    points = body_keypoints(body)
    left = look_at("left", (640, 480), [0, 4, 1.2], [0, 0, 1], 60)
    hidden = dict(zip(KEYPOINTS, hidden_keypoints(left, points, body[None], NO_BOXES), strict=True))
    assert hidden["r_hip"] and hidden["r_shoulder"] and not hidden["l_wrist"] and not hidden["l_ankle"]
    table = np.array([[[-1, 1, 0], [1, 1.5, 0.7]]])
    hidden = dict(zip(KEYPOINTS, hidden_keypoints(left, points, np.zeros((0, 15, 3)), table), strict=True))
    assert hidden["l_ankle"] and not hidden["l_shoulder"] and not hidden["l_hip"]


def test_exact_ones_lie_on_the_truth(tiny):
    write_keypoints(tiny, np.random.default_rng(0), EXACT)
    recording = hmc.open_recording(tiny)
    truth = read_joints(tiny / "truth" / "joints.csv")
    views = open_keypoints(recording).frame(12)
    expected, _ = project(recording.rig, body_keypoints(truth.positions[np.flatnonzero(truth.frames == 12)[0]]))
    for view, uv in zip(views, expected, strict=True):
        given = view[0, :, 2] > 0
        assert len(view) == 1 and given.sum() > 15
        assert_allclose(view[0, given, :2], uv[given], atol=1e-3)


def test_errors_last_and_the_seed_decides(tiny):
    noise = KeypointNoise(false_rate=0.3)
    write_keypoints(tiny, np.random.default_rng(1), noise)
    recording = hmc.open_recording(tiny)
    noisy = [open_keypoints(recording).frame(k) for k in range(recording.n_frames)]
    first = {path.name: path.read_bytes() for path in (tiny / "keypoints" / "cam_00").iterdir()}
    write_keypoints(tiny, np.random.default_rng(1), noise)
    assert first == {path.name: path.read_bytes() for path in (tiny / "keypoints" / "cam_00").iterdir()}
    counts = np.array([[len(view) for view in views] for views in noisy])
    assert counts.min() <= 1 < counts.max()
    write_keypoints(tiny, np.random.default_rng(1), EXACT)
    exact = [open_keypoints(recording).frame(k) for k in range(recording.n_frames)]
    missing = np.full((26, 2), np.nan)
    apart = np.array(
        [
            [a[0, :, :2] - b[0, :, :2] if len(a) and len(b) else missing for a, b in zip(one, other, strict=True)]
            for one, other in zip(noisy, exact, strict=True)
        ]
    )
    apart = np.where(np.abs(apart) < 15, apart, np.nan)
    now, later = apart[:-1].ravel(), apart[1:].ravel()
    both = np.isfinite(now) & np.isfinite(later)
    assert 1 < np.nanstd(apart) < 6 and 0.6 < np.corrcoef(now[both], later[both])[0, 1] < 0.95


def test_a_noise_that_is_none():
    with pytest.raises(hmc.InputError, match="`swap_rate` must be at least 0, and a rate at most 1; got 2"):
        KeypointNoise(swap_rate=2)
