"""An arm cut out of silhouettes: what is cut, when it counts as taken back, and what the report says of runs that are known."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from acted import act, ring
from hypothesis import given
from hypothesis import strategies as st
from posed import subject_of, true_state, view_of

from hmc.body.kinematics import landmarks
from hmc.camera.model import project
from hmc.experiments import Plan, find_experiment
from hmc.experiments.engine.experiment import Cell
from hmc.experiments.engine.style import house_style
from hmc.experiments.lost_arm import BACK_M, STAYS, taken_back, without_arm
from hmc.landmarks import landmark_index
from hmc.pose.method import begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.steps.presets import PRESETS
from hmc.pose.views.hull_target import make_target
from hmc.pose.views.rays import with_rays
from hmc.search.filters import AnnealedSettings
from hmc.voxels.carving import carve_levels, make_tables


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


def arm_errors(targets, acted, arm, search, seed):
    """The worse error of elbow and wrist, frame by frame, of a filter that starts from the truth."""
    preset = replace(PRESETS["default"], annealed=AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5), search=search)
    subject, step = subject_of(acted, preset), annealed_pose_step(preset)
    tracked, errors = begin_tracking(subject, true_state(subject.body, acted)), []
    for frame, target in enumerate(targets):
        tracked, _ = step(np.random.default_rng([seed, frame]), tracked, view_of(target))
        off = landmarks(subject.body, tracked.state)[arm[1:]] - acted.landmarks[frame][arm[1:]]
        errors.append(float(np.linalg.norm(off, axis=1).max()))
    return np.array(errors)


@pytest.mark.slow
def test_an_arm_that_is_lost_for_more_than_half_a_second_is_taken_back():
    """A talking man's left arm, in one camera's silhouette alone for twelve frames; without the limb search it stays lost for longer."""
    acted, gone = act("gesture", frames=30, fps=20), (3, 15)
    arm = [landmark_index(f"l_{part}") for part in ("shoulder", "elbow", "wrist")]
    tables, targets = make_tables(acted.grid, ring()), list(acted.targets)
    for frame in range(*gone):
        whole = acted.masks[frame]
        cut = [without_arm(camera, mask, acted.landmarks[frame][arm]) for camera, mask in zip(ring(), whole, strict=True)]
        masks = [whole[0], *cut[1:]]
        strict, tolerant = carve_levels(tables, masks, (0, 1))
        targets[frame] = with_rays(make_target(acted.grid, np.argwhere(strict), np.argwhere(tolerant)), ring(), masks)
    waits: dict[bool, list[int]] = {True: [], False: []}
    for seed in range(2):
        for searches, found in waits.items():
            errors = arm_errors(targets, acted, arm, PRESETS["default"].search if searches else None, seed)
            assert errors[: gone[0]].max() < 0.15 and errors[gone[1] - 1] > 0.3
            back = taken_back(errors[gone[1] :])
            found.append(len(errors) if back is None else back)
    assert max(waits[True]) <= 15 and max(waits[False]) > 2 * max(waits[True])


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
