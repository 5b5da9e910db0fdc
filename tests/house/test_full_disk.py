"""A disk that is full in the middle of a command: words, no half file under its name, and the same bytes once there is room."""

import shutil

import numpy as np
import pytest
from full_disk import COMMANDS, PAGE, can_mount, trial, whole
from miniature import build


@pytest.mark.slow
def test_a_full_disk_costs_nothing_but_time(tmp_path):
    folder, rng = tmp_path / "work" / "in", np.random.default_rng(0)
    if not can_mount(tmp_path / "disk"):
        pytest.skip("needs the right to mount a file system")
    shutil.copytree(build(tmp_path / "miniature"), folder)
    for name in ("track", "synth", "check", "view, picture", "view, video", "export, mot"):
        left, unsteady, needed = whole(folder, COMMANDS[name])
        assert left and not unsteady, name
        for share in rng.uniform(0.1, 0.9, 2):
            kind, full, text = trial(folder, COMMANDS[name], left, unsteady, max(1, int(share * needed / PAGE)) * PAGE)
            assert kind == "same" and full, (name, text)
