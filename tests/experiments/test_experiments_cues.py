"""Silhouettes, keypoints and both: faults as they are said to be, cells that are `hmc pose`, a report that follows the figures."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from results_at_random import RESULTS, held_always

import hmc
from hmc.errors import InputError
from hmc.experiments import chain_runs, cue_runs, cues
from hmc.experiments.chain_runs import FEW, WHOLE
from hmc.experiments.cue_runs import BOTH, KEYPOINTS, SILHOUETTES, WAYS
from hmc.experiments.engine.experiment import Cell, Plan
from hmc.experiments.engine.inputs import Inputs, source_of
from hmc.experiments.engine.library import find_experiment
from hmc.experiments.keypoint_faults import ANOTHER, DISPLACED, EXCHANGED, FAULTS, NO_FAULT, fault_frames, with_fault
from hmc.io import keypoints as keypoint_files
from hmc.io.recording import open_recording
from hmc.io.results import read_joints
from hmc.synthetic.keypoints import KeypointNoise, write_keypoints

TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"
LABEL, SEED, FRAMES = "tiny@0", 2, 8
L_HIP, R_HIP = (keypoint_files.KEYPOINTS.index(name) for name in ("l_hip", "r_hip"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A recording with pretended keypoints that miss nothing."""
    folder = tmp_path_factory.mktemp("cues") / "tiny"
    shutil.copytree(TINY, folder)
    noise = KeypointNoise(miss_rate=0, hidden_miss_rate=0, swap_rate=0, lost_rate=0, false_rate=0)
    write_keypoints(folder, np.random.default_rng(0), noise)
    return folder


@pytest.fixture(scope="module")
def inputs(tmp_path_factory, folder):
    return Inputs(tmp_path_factory.mktemp("inputs"), {LABEL: folder})


def cell(inputs, cues, fault=NO_FAULT, frames=FRAMES, label=LABEL):
    parameters = {"recording": label, "cameras": FEW, "cues": cues, "fault": fault, "frames": frames, "repeat": SEED}
    return cue_runs.cell(parameters, inputs, np.random.default_rng(0))


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_of_some_cameras_for_their_time_and_the_same_again(folder, fault):
    recording = open_recording(folder, ["cam_00", "cam_02", "cam_04", "cam_06"])
    source, truth = keypoint_files.open_keypoints(recording), read_joints(folder / "truth" / "joints.csv")
    spoilt, again = (with_fault(source, recording, truth, fault, SEED) for _ in range(2))
    first, end = fault_frames(recording, fault, SEED)
    assert end - first == round(FAULTS[fault].seconds * recording.fps) and recording.start <= first
    offsets = []
    for frame in range(recording.start, recording.start + recording.n_frames):
        before, after = source.frame(frame), spoilt.frame(frame)
        for one, other in zip(after, again.frame(frame), strict=True):
            assert_array_equal(one, other)
        changed = [c for c in range(4) if not np.array_equal(before[c], after[c], equal_nan=True)]
        assert len(changed) == ((1 if fault == ANOTHER else 2) if first <= frame < end else 0)
        for c in changed:
            if fault == EXCHANGED:
                assert_array_equal(after[c][0, L_HIP], before[c][0, R_HIP])
            elif len(after[c]):
                offsets.append((c, (after[c] - before[c])[0, L_HIP, :2]))
    if fault == DISPLACED:
        for c in {c for c, _ in offsets}:
            own = np.array([off for camera, off in offsets if camera == c])
            assert_allclose(own, np.broadcast_to(own[0], own.shape), atol=1e-9)
            assert 40 <= np.linalg.norm(own[0]) * 640 / max(recording.rig[c].size) <= 80
    if fault == ANOTHER:  # a metre or more beside is more than a trunk's width, unless it is along the line of sight
        assert offsets and np.ptp([off for _, off in offsets], axis=0).max() > 0
    assert with_fault(source, recording, truth, NO_FAULT, SEED) is source


def test_seeds_have_other_faults(folder):
    recording = open_recording(folder)
    assert len({fault_frames(recording, EXCHANGED, seed) for seed in range(6)}) > 1


def test_a_low_pass_keeps_what_is_slow_and_leaves_long_gaps_open():
    frames = np.arange(120)
    slow, fast = (np.sin(2 * np.pi * hertz * frames / 30)[:, None, None] * np.ones((1, 1, 3)) for hertz in (1, 12))
    assert_allclose(cue_runs.low_passed(slow, frames, 30)[20:100], slow[20:100], atol=0.01)
    assert np.abs(cue_runs.low_passed(fast, frames, 30)[20:100]).max() < 0.01
    holes = slow.copy()
    holes[30:40], holes[60:90], holes[:5] = np.nan, np.nan, np.nan
    found = cue_runs.low_passed(holes, frames, 30)
    assert_array_equal(np.isnan(found).all(axis=(1, 2)), (frames < 5) | ((frames >= 60) & (frames < 90)))
    assert_allclose(cue_runs.low_passed(slow, frames, 10), slow)  # nothing that fast is in it
    assert cue_runs.low_passed(slow[:0], frames[:0], 30).shape == (0, 1, 3)
    assert_allclose(cue_runs.low_passed(slow[:1], frames[:1], 30), slow[:1])


def test_keypoints_alone_need_no_body(inputs):
    found = cell(inputs, KEYPOINTS)
    off = np.linalg.norm(found["estimate_m"] - found["truth_m"], axis=-1)[:, cues.LIMBS]
    assert (found["cameras"], found["reference"], found["faulty"]) == (FEW, False, [])
    assert np.isfinite(off).mean() > 0.9 and np.nanmean(off) < 0.06
    worse = cell(inputs, KEYPOINTS, DISPLACED, frames=0)
    assert worse["faulty"][1] - worse["faulty"][0] == worse["fps"]


@pytest.mark.slow
def test_the_other_ways_are_the_chain_of_the_command(inputs, folder):
    chain = {"recording": LABEL, "cameras": FEW, "without": WHOLE, "frames": FRAMES, "repeat": SEED}
    silhouettes = cell(inputs, SILHOUETTES)["estimate_m"]
    assert_array_equal(silhouettes, chain_runs.cell(chain, inputs, np.random.default_rng(0))["estimate_m"])
    both = cell(inputs, BOTH)["estimate_m"]
    assert np.abs(both - silhouettes).max() > 1e-3
    off = np.linalg.norm(both - cell(inputs, BOTH)["truth_m"], axis=-1)
    assert np.nanmean(off) < 0.1


def test_recordings_without_keypoints_are_left_out(inputs, folder):
    sources = (source_of(TINY), source_of(folder))
    grid = cues.grid(Plan(quick=True, recordings=sources))
    assert {one["recording"] for one in grid} == {sources[1].label}
    with pytest.raises(InputError, match="none of the recordings has keypoints"):
        cues.grid(Plan(recordings=sources[:1]))
    with pytest.raises(InputError, match="has no keypoints"):
        cell(Inputs(inputs.folder, {"bare@0": TINY}), KEYPOINTS, label="bare@0")


@pytest.mark.slow
def test_detections_of_rendered_recordings_are_pretended_beside_them(tmp_path, monkeypatch):
    label = "box@0"
    monkeypatch.setattr(Inputs, "recording_folder", lambda self, name: TINY)
    inputs = Inputs(tmp_path)
    recording = open_recording(TINY, ["cam_01", "cam_05"])
    found = cue_runs._keypoints(inputs, label, recording)
    assert found.cameras == recording.rig.names and all(found.present)
    assert found.path == tmp_path / label / "with-keypoints" / "keypoints" and not (TINY / "keypoints").exists()
    assert all(len(people) for people in found.frame(3))


def test_every_fault_has_its_run_without(folder):
    for plan in (Plan(), Plan(quick=True), Plan(recordings=(source_of(folder),))):
        grid = find_experiment("cues").grid(plan)
        assert all(one | {"fault": NO_FAULT} in grid for one in grid)
        assert {one["cues"] for one in grid if one["fault"]} == {BOTH, KEYPOINTS}
        assert {one["cues"] for one in grid if not one["fault"]} == set(WAYS)
    cameras = {}
    for one in find_experiment("cues").grid(Plan()):
        cameras.setdefault(one["recording"].partition("@")[0], set()).add(one["cameras"])
    assert cameras["box"] == cameras["crossing"] == {0, 2, 3, 4} and cameras["gesture"] == {0, 2, 3, 4, 7}


def reported(off_m, reference=False):
    """The report where limbs are off by so many metres: ``off_m(parameters)``."""
    cells = []
    for parameters in find_experiment("cues").grid(Plan()):
        results = RESULTS["cues"](np.random.default_rng(1), parameters, False) | {"reference": reference}
        results["estimate_m"] = results["truth_m"] + np.array([off_m(parameters), 0, 0])
        cells.append(Cell(parameters, results))
    return find_experiment("cues").report(cells, Plan())


def test_claims_follow_the_figures():
    usual = {SILHOUETTES: 0.03, KEYPOINTS: 0.04, BOTH: 0.015}

    def failing(off_m):
        return {claim.text for claim in reported(off_m).claims if not claim.holds}

    def base(one):
        return usual[one["cues"]]

    assert len(reported(base).claims) == 16 and not failing(base)
    assert failing(lambda one: 0.028 if one["cues"] == BOTH else base(one)) == {f"{n} cameras, both: wrists 20 mm at most" for n in (7, 4)}
    assert failing(lambda one: base(one) + 0.02 * (one["cues"] == BOTH and one["cameras"] == 2)) == {
        "2 cameras: both are nearer than silhouettes alone"
    }
    dear = {f"{EXCHANGED}: costs both less than 5 mm{when}" for when in ("", " while it lasts")}
    assert failing(lambda one: base(one) + 0.006 * (one["fault"] == EXCHANGED)) == dear
    assert not reported(base, reference=True).claims
    rows = reported(base).tables[0].rows
    assert rows[0]["recording"] == "box" and rows[0]["cameras"] == 7 and rows[0]["cues"] == SILHOUETTES
    assert (
        rows[0]["mean_mm"] == pytest.approx(30)
        and rows[0]["median_mm"] == pytest.approx(30)
        and rows[0]["within_50_percent"] == 100
        and rows[0]["not_found_percent"] == 0
    )
    assert len(reported(base).tables[1].rows) == 2 * len(FAULTS)


def test_what_is_not_found_counts_as_missed():
    parameters = find_experiment("cues").grid(Plan(quick=True))[0]
    results = RESULTS["cues"](np.random.default_rng(1), parameters, False)
    results["estimate_m"] = results["truth_m"].copy()
    results["estimate_m"][:30] = np.nan
    row = cues._row([Cell(parameters, results)])
    assert row["mean_mm"] == 0 and row["within_100_percent"] == row["not_found_percent"] == pytest.approx(50)


@pytest.mark.slow
@pytest.mark.parametrize("noise", [False, True])
def test_nothing_holds_of_full_runs_at_random(noise):
    assert not held_always("cues", lambda rng, parameters: RESULTS["cues"](rng, parameters, noise), quick=False)


def test_keypoints_of_a_source_may_be_changed_twice(folder):
    source = keypoint_files.open_keypoints(hmc.open_recording(folder))
    twice = source.changed(lambda index, people: people[::-1]).changed(lambda index, people: (*people[1:], people[0]))
    before, after = source.frame(0), twice.frame(0)
    assert len(after) == len(before)
    for one, other in zip(after, (*before[-2::-1], before[-1]), strict=True):
        assert_array_equal(one, other)
