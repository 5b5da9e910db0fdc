"""An arm cut out of silhouettes: what is cut, when it counts as taken back, and what the report says of runs that are known."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from acted import act, ring
from hypothesis import given
from hypothesis import strategies as st

from hmc.camera.model import project
from hmc.experiments import Plan, find_experiment
from hmc.experiments.experiment import Cell
from hmc.experiments.lost_arm import BACK_M, STAYS, taken_back, without_arm
from hmc.experiments.style import house_style
from hmc.landmarks import landmark_index


def test_the_arm_is_cut_out_and_the_rest_stays():
    acted = act("gesture", frames=1)
    arm = acted.landmarks[0, [landmark_index(f"l_{part}") for part in ("shoulder", "elbow", "wrist")]]
    others = acted.landmarks[0, [landmark_index(name) for name in ("head_top", "l_knee", "r_knee", "l_ankle", "r_ankle")]]
    for camera, mask in zip(ring(), acted.masks[0], strict=True):
        cut = without_arm(camera, mask, arm)
        assert not np.any(cut & ~mask) and 0.6 * mask.sum() < cut.sum() < 0.99 * mask.sum()
        column, row = np.rint(project(camera, arm[1:])[0]).astype(int).T
        assert not cut[row, column].any()
        column, row = np.rint(project(camera, others)[0]).astype(int).T
        assert np.array_equal(cut[row, column], mask[row, column])


@given(st.lists(st.booleans(), max_size=30))
def test_taken_back_is_the_first_frame_from_which_it_stays(there):
    errors = np.where(there, BACK_M / 2, 2 * BACK_M)
    found = taken_back(errors)
    starts = [k for k in range(len(there)) if len(there) - k >= STAYS and all(there[k : k + STAYS])]
    assert found == (starts[0] if starts else None)


def made(frames_lost, repeat):
    """A run that has the arm back so many frames after it can be seen."""
    errors = np.full(130, 0.02)
    errors[50 : 80 + frames_lost] = 0.3
    results = {"frames": np.arange(130), "errors_m": errors, "gone": [50, 80]}
    return Cell({"recording": "box@0", "arm": "l", "repeat": repeat}, results)


@pytest.mark.parametrize(("frames_lost", "in_time"), [(0, True), (15, True), (16, False), (20, False)])
def test_the_report_counts_frames(frames_lost, in_time):
    experiment = find_experiment("lost-arm")
    with house_style():
        report = experiment.report([made(3, 0), made(frames_lost, 1)], Plan())
        plt.close("all")
    assert [row["frames_until_taken_back"] for row in report.tables[0].rows] == [3, frames_lost]
    assert [row["worst_while_gone_mm"] for row in report.tables[0].rows] == pytest.approx([300, 300])
    lost, back = report.claims
    assert lost.holds and back.holds == in_time
