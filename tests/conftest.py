"""Fixtures that several test files share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real and rendered recordings: environment variable HMC_DATA, else ../shared/data beside the checkout; skips without it."""
    folder = Path(os.environ.get("HMC_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("the recordings are not on this machine (set HMC_DATA to their folder)")
    return folder
