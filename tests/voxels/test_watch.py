"""Cameras that fail while a recording runs: each is named with its first bad frame, left out, and taken back; good ones never are."""

import cv2
import numpy as np
import pytest
from drawn import draw_recording, silhouette
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.image_signs import image_shift, is_repeated, small_gray
from hmc.camera.model import Rig, look_at, project
from hmc.cli import main
from hmc.io.camera_faults import CameraFault, Faults, as_table, sentence
from hmc.io.masks import MaskStep
from hmc.io.recording import open_recording
from hmc.io.results import read_run
from hmc.voxels.fitting import LEAST_HITS, fit_of_cameras, fitting_tables, missed_share
from hmc.voxels.held import held_steps
from hmc.voxels.hulls import FrontendSettings, stream_masks
from hmc.voxels.watch import begin_watch, make_watch, watch_step

FPS, N, BAD = 30.0, 62, 25
ROOM = np.array([[-2.0, -2.0, 0.0], [2.0, 2.0, 2.2]])


def ring_of(n):
    angles = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return Rig(
        tuple(look_at(f"cam_{i:02d}", (160, 120), [3.5 * np.cos(a), 3.5 * np.sin(a), 2.0], [0, 0, 0.9], 70) for i, a in enumerate(angles))
    )


def place(frame):
    """Someone who walks 1.4 m/s."""
    return -1.4 + 1.4 * frame / FPS, 0.4 * np.sin(frame / 15)


@pytest.fixture(scope="module")
def clip():
    """Images and silhouettes of seven cameras, a list a frame, and the empty scenes: walls with large patches."""
    rig, rng = ring_of(7), np.random.default_rng(2)
    walls = [cv2.resize(rng.integers(60, 200, (15, 20, 3)).astype(np.uint8), (160, 120), interpolation=cv2.INTER_NEAREST) for _ in rig]
    masks = [[silhouette(camera, *place(frame)) for camera in rig] for frame in range(N)]
    images = [[seen(wall, mask, rng) for wall, mask in zip(walls, row, strict=True)] for row in masks]
    return rig, images, masks, [[seen(wall, np.zeros((120, 160), bool), rng)] for wall in walls]


def seen(wall, mask, rng):
    return (np.where(mask[..., None], (40, 60, 220), wall) + rng.normal(0, 2, wall.shape)).clip(0, 255).astype(np.uint8)


def pushed(image):
    return cv2.warpAffine(image, np.float32([[1, 0, 9], [0, 1, 2]]), image.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)


def faulty(kind, images, masks, c=2, to=N):
    """The clip with a fault in one camera from frame BAD to frame `to`."""
    images, masks = [list(row) for row in images], [list(row) for row in masks]
    source = [row[c] for row in images], [row[c] for row in masks]
    for frame in range(BAD, to):
        k = {"frozen": BAD - 1, "late": frame - 9, "early": min(frame + 9, N - 1)}.get(kind, frame)
        images[frame][c], masks[frame][c] = source[0][k], source[1][k]
        if kind == "lost":
            images[frame][c] = masks[frame][c] = None
        elif kind == "dark":
            images[frame][c], masks[frame][c] = np.full_like(source[0][0], 3), None
        elif kind == "moved":
            images[frame][c], masks[frame][c] = pushed(source[0][k]), pushed(source[1][k].view(np.uint8)) > 0
    return images, masks


def watched(rig, images, masks, scenes):
    watch = make_watch(rig, ROOM, FPS, scenes)
    state, found = begin_watch(watch), Faults()
    for frame, (row, own) in enumerate(zip(images, masks, strict=True)):
        state = watch_step(watch, state, frame, row, own)
        found = found.plus(frame, state.faults)
    return found


def test_of_good_cameras_nothing_is_said(clip):
    assert watched(*clip).all == ()


@pytest.mark.parametrize("kind", ["lost", "dark", "frozen", "moved", "late", "early"])
def test_a_fault_is_named_with_its_first_frame(clip, kind):
    rig, images, masks, scenes = clip
    images, masks = faulty(kind, images, masks)
    (fault,) = watched(rig, images[: N - 9], masks[: N - 9], scenes).all
    assert (fault.camera, fault.fault, fault.left_out) == ("cam_02", kind, True)
    assert BAD <= fault.since <= BAD + 1
    assert fault.amount == pytest.approx({"moved": np.hypot(9, 2), "late": 9, "early": 9}.get(kind, 0), abs=1)


@pytest.mark.parametrize("kind", ["lost", "dark", "frozen", "moved"])
def test_a_camera_is_taken_back(clip, kind):
    rig, images, masks, scenes = clip
    (fault,) = watched(rig, *faulty(kind, images, masks, to=BAD + 16), scenes).closed or pytest.fail("still out")
    assert fault.fault == kind and BAD + 15 <= fault.last <= BAD + 16 + FPS


def test_two_cameras_of_seven_that_are_late(clip):
    rig, images, masks, scenes = clip
    images, masks = faulty("late", *faulty("late", images, masks), c=5)
    found = watched(rig, images, masks, scenes).all
    assert {(one.camera, one.fault) for one in found} == {("cam_02", "late"), ("cam_05", "late")}


def test_of_four_cameras_none_is_left_out_by_silhouettes_alone(clip):
    rig, images, masks, scenes = clip
    images, masks = faulty("late", images, masks)
    few = [0, 2, 4, 5]
    chosen = [[[row[c] for c in few] for row in table] for table in (images, masks)]
    assert watched(Rig(tuple(rig[c] for c in few)), *chosen, [scenes[c] for c in few]).all == ()


def test_who_is_hidden_from_two_cameras_is_no_fault(clip):
    """A table before two cameras hides all below the chest: they miss most, and what they show is where the others see it."""
    rig, images, masks, scenes = clip
    masks = [[mask & (np.arange(120)[:, None] < 55) if c in (1, 2) else mask for c, mask in enumerate(row)] for row in masks]
    assert watched(rig, images, masks, scenes).all == ()


def test_missed_share_is_that_of_a_hull_carved_by_hand(clip):
    rig, _, masks, _ = clip
    tables, row = fitting_tables(ROOM, rig), list(masks[30])
    row[3] = masks[18][3]
    points = tables.grid.centres().reshape(-1, 3)
    shown, inside = [], []
    for camera, mask in zip(rig, row, strict=True):
        uv, valid = project(camera, points)
        column, line = np.rint(np.nan_to_num(uv)).astype(int).T
        image = valid & (column >= 0) & (column < 160) & (line >= 0) & (line < 120)
        shown.append(image & mask[np.where(image, line, 0), np.where(image, column, 0)])
        inside.append(image)
    shown, inside = np.array(shown), np.array(inside)
    others = [c for c in range(7) if c != 3]
    hull = (shown | ~inside)[others].all(axis=0) & (shown[others].sum(axis=0) >= LEAST_HITS)
    expected = (hull & inside[3] & ~shown[3]).sum() / (hull & inside[3]).sum()
    assert missed_share(tables, row, 3, others) == pytest.approx(expected, abs=1e-12)
    fit = fit_of_cameras(tables, row)
    assert fit.missed[3] == pytest.approx(expected, abs=1e-12) and np.flatnonzero(fit.misfit).tolist() == [3]


@settings(max_examples=25, deadline=None)
@given(right=st.integers(-12, 12), down=st.integers(-12, 12), seed=st.integers(0, 99))
def test_image_shift_is_how_far_the_image_was_moved(right, down, seed):
    wall = cv2.GaussianBlur(np.random.default_rng(seed).integers(0, 255, (300, 400)).astype(np.uint8), (0, 0), 2)
    one, other = wall[30:270, 40:360], wall[30 - down : 270 - down, 40 - right : 360 - right]
    assert image_shift(one, other) == pytest.approx(np.hypot(right, down), abs=0.3)


def test_noise_is_no_repetition_and_a_copy_is():
    rng = np.random.default_rng(0)
    noisy = [small_gray((100 + rng.normal(0, 3, (480, 640, 3))).astype(np.uint8)) for _ in range(2)]
    assert noisy[0].shape == (240, 320) and not is_repeated(*noisy) and is_repeated(noisy[0], noisy[0] + 1)


def test_frames_are_held_until_a_fault_is_known():
    mask, none = np.ones((2, 2), bool), (None, None)
    for out in (True, False):
        fault = CameraFault("b", "frozen", 3, 5, left_out=out)
        steps = [MaskStep(k, none, (mask, mask), none, faults=(None, fault if k >= 5 else None)) for k in range(8)]
        found = list(held_steps(iter(steps), 4))
        assert [step.index for step in found] == list(range(8))
        assert [step.masks[1] is None for step in found] == [out and k >= 3 for k in range(8)]
        assert [step.faults[1] for step in found] == [None] * 3 + [fault] * 5


def test_what_is_said_of_a_camera():
    faults = Faults()
    for k in range(10):
        faults = faults.plus(k, (None, CameraFault("b", "late", 2, k, 7.0) if 3 <= k < 6 else None, CameraFault("c", "dark", 1, k)))
    assert [sentence(one, 10) for one in faults.all] == [
        "c: from frame 1 on: dark; left out there; is the lens covered?",
        "b: frames 2 to 5: late by 7 frames; left out there; by how much exactly finds hmc sync RECORDING",
    ]
    assert as_table(faults.all)["b"] == [{"fault": "late", "since": 2, "last": 5, "amount": 7.0, "left_out": True}]


@pytest.mark.slow
def test_a_recording_with_a_frozen_camera(tmp_path, capsys):
    """On disk, in one process and in two, from a later frame on; and what `hmc track` says of it."""
    rig = ring_of(5)
    folder = draw_recording(tmp_path / "frozen", rig, [[place(10 + frame)] for frame in range(24)])
    last = (folder / "images" / "cam_02" / "000009.png").read_bytes()
    for k in range(10, 24):
        (folder / "images" / "cam_02" / f"{k:06d}.png").write_bytes(last)
    recording = open_recording(folder)
    steps = list(stream_masks(recording))
    assert [step.masks[2] is None for step in steps] == [k >= 10 for k in range(24)]
    assert all(mask is not None for step in steps for c, mask in enumerate(step.masks) if c != 2)
    for other in (stream_masks(recording, workers=2), stream_masks(recording, first=13, warm_up=300)):
        for step in other:
            same = steps[step.index]
            assert step.faults == same.faults or (step.faults[2].since, same.faults[2].since) == (10, 10)
            assert all(a is b or np.array_equal(a, b) for a, b in zip(step.masks, same.masks, strict=True))
    kept = list(stream_masks(recording, FrontendSettings(exclude=False)))
    assert all(step.masks[2] is not None for step in kept) and kept[-1].faults[2].fault == "frozen"
    for more in ((), ("--no-exclude",)):
        out = tmp_path / f"out{len(more)}"
        assert main(["track", str(folder), "--out", str(out), "--quiet", "--voxel", "0.06", *more]) == 0
        assert f"cam_02: from frame 10 on: the same image again and again while the others change; {'kept' if more else 'left out'}" in (
            capsys.readouterr().err
        )
        entry = {"fault": "frozen", "since": 10, "last": 23, "amount": 0.0, "left_out": not more}
        assert read_run(out / "run.toml")["cameras"] == {"cam_02": [entry]}
