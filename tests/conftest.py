"""Fixtures that several test files share."""

import os
from pathlib import Path

import numpy as np
import pytest

from hmc.camera.model import Rig, look_at


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
