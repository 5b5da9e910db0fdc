"""Fixtures that several test files share."""

import os
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from hmc.camera.model import Rig, look_at
from hmc.io.calibration import write_calibration


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real and rendered recordings: environment variable HMC_DATA, else ../shared/data beside the checkout; skips without it."""
    folder = Path(os.environ.get("HMC_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("the recordings are not on this machine (set HMC_DATA to their folder)")
    return folder


@pytest.fixture(scope="session")
def ring() -> Rig:
    """Five cameras around the origin, one of them distorted, 3.5 m away and 2 m up."""
    angles = np.linspace(0, 2 * np.pi, 5, endpoint=False)
    return Rig(
        tuple(
            look_at(
                f"cam_{i:02d}",
                (160, 120),
                [3.5 * np.cos(a), 3.5 * np.sin(a), 2.0],
                [0, 0, 0.9],
                70,
                (-0.1 * (i == 2), 0.02 * (i == 2), 0, 0),
            )
            for i, a in enumerate(angles)
        )
    )


def write_video(path: Path, frames: int, size: tuple[int, int], level=lambda index: 40 + 5 * index, fps: float = 25) -> Path:
    """A video whose frame ``index`` is grey of brightness ``level(index)``; Motion JPEG, so every frame can be read alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), fps, size)
    for index in range(frames):
        writer.write(np.full((size[1], size[0], 3), level(index), np.uint8))
    writer.release()
    return path


def write_images(folder: Path, numbers, size: tuple[int, int], level=lambda index: 40 + 5 * index, name: str = "{:06d}.png") -> Path:
    """Grey images, named by number."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        cv2.imwrite(str(folder / name.format(number)), np.full((size[1], size[0], 3), level(number), np.uint8))
    return folder


@pytest.fixture
def recording_folder(tmp_path, ring) -> Path:
    """A good recording on disk: the ring's five cameras, 12 frames of video, 4 of the empty scene; frame i has brightness 40 + 5 i."""
    folder = tmp_path / "take_1"
    folder.mkdir()
    write_calibration(folder / "calibration.toml", ring)
    for camera in ring:
        write_video(folder / "videos" / f"{camera.name}.avi", 12, camera.size)
        write_video(folder / "background" / f"{camera.name}.avi", 4, camera.size, lambda index: 20)
    return folder


@pytest.fixture
def halved_images(monkeypatch) -> None:
    """Images of any size are read at half of it, as those that are twice as large as voxels show are."""
    monkeypatch.setattr("hmc.io.recording.reduction_factors", lambda rig, room, voxel_size_m: tuple(1 + (max(c.size) > 100) for c in rig))


@pytest.fixture(autouse=True)
def _no_figure_is_left():
    """What a test drew is closed after it: matplotlib warns of many, and the next test would be blamed."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
