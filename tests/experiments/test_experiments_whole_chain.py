"""The whole chain, and without its parts: cells that are `hmc pose`, what they share, and reports that follow the figures."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from results_at_random import RESULTS, held_always

import hmc
from hmc.body.joints import DOF_NAMES, TRUNK_JOINTS
from hmc.errors import InputError
from hmc.experiments import ablation, chain_runs, whole_chain
from hmc.experiments.chain_runs import FEW, PARTS, WHOLE
from hmc.experiments.engine.experiment import Cell, Plan, Source
from hmc.experiments.engine.inputs import Inputs, rendered, source_of
from hmc.experiments.engine.library import find_experiment
from hmc.experiments.engine.sweep import plan_of
from hmc.io.results import read_joints
from hmc.landmarks import LANDMARKS

TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"
LABEL = "tiny@0"
#: Frames of the cells here, and their seed.
FRAMES, SEED = 8, 2
#: Parts of the second pass, whose first pass is the whole's.
SECOND = (
    "second pass", "own body of the whole run", "limbs of unequal length", "what furniture hides", "others' rays",
    "fresh starts for who is lost",
    "turning about who faces backwards",
    "colors of a person's parts",
    "feet that stand",
    "smoothing",
)  # fmt: skip


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    return Inputs(tmp_path_factory.mktemp("inputs"), {LABEL: TINY})


def cell(inputs, without=WHOLE, frames=FRAMES, label=LABEL):
    parameters = {"recording": label, "cameras": 0, "without": without, "frames": frames, "repeat": SEED}
    return chain_runs.cell(parameters, inputs, np.random.default_rng(0))


@pytest.fixture(scope="module")
def whole(inputs):
    return cell(inputs)


@pytest.fixture(scope="module")
def by_hmc():
    """The same by the package's own functions, after one pass and after both."""
    recording = hmc.open_recording(TINY, frames=FRAMES)
    ways = {"second pass": hmc.pose_method("apf", passes=1), WHOLE: "apf"}
    return {part: hmc.pose(recording, method=way, seed=SEED, height_m="auto") for part, way in ways.items()}


@pytest.mark.slow
def test_a_cell_has_the_joints_of_the_command(whole, by_hmc):
    found = by_hmc[WHOLE]
    assert_array_equal(whole["estimate_m"], found.positions.round(6))
    assert_array_equal(whole["frames"], found.frames)
    scores = hmc.evaluate(found, hmc.open_recording(TINY, frames=FRAMES)).summary
    row = whole_chain._row([Cell({"repeat": SEED}, whole)])
    assert row["mean_mm"] == pytest.approx(row[f"seed_{SEED}_mm"], rel=1e-12) and row["mean_mm"] == pytest.approx(
        scores["mean_mm"], abs=1e-3
    )
    assert row["within_50_percent"] == pytest.approx(100 * scores["mmta_at_50mm"])
    assert row["low_mm"] is None and row["MOTA"] == 1 and row["exchanged"] == 0
    assert (whole["cameras"], whole["reference"], whole["fps"]) == (7, False, 15)


@pytest.mark.slow
def test_parts_of_the_second_pass_share_the_first(inputs, whole, by_hmc, monkeypatch):
    monkeypatch.setattr("hmc.pose.follow.person_step", None)  # nobody is followed once more
    monkeypatch.setattr(chain_runs, "stream_masks", None)
    monkeypatch.setattr("hmc.tracking.resumable.observe_step", None)
    found = {part: cell(inputs, part)["estimate_m"] for part in SECOND}
    assert_array_equal(found["second pass"], by_hmc["second pass"].positions.round(6))
    assert_array_equal(found["others' rays"], whole["estimate_m"])  # there is nobody else
    assert np.abs(found["second pass"] - whole["estimate_m"]).max() > 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("part", [part for part in PARTS if PARTS[part].changes_first])
def test_the_other_parts_have_a_first_pass_of_their_own(part, inputs, whole):
    found = cell(inputs, part)
    assert found["estimate_m"].shape == whole["estimate_m"].shape
    assert np.nanmean(np.linalg.norm(found["estimate_m"] - found["truth_m"], axis=2)) < 0.1


def test_every_part_changes_one_thing_only():
    whole = chain_runs.method_without(PARTS[WHOLE])
    assert whole.settings == hmc.pose_method("apf").settings and whole.back == hmc.pose_method("apf").back
    for name, part in PARTS.items():
        assert sum(map(bool, (part.frontend, part.preset, part.method, part.back is None or part.back))) == (name != WHOLE), name
        assert part.changes_first == (name not in (WHOLE, *SECOND)), name
        method = chain_runs.method_without(part)
        changed = [method.settings != whole.settings, (method.recover is None) or (method.legs is None), method.back != whole.back]
        assert any(changed) == (name != WHOLE and not part.frontend), name
    for name, field in (("hips where each has them", "place_deviation"), ("limbs of unequal length", "asymmetry_deviation")):
        assert getattr(chain_runs.method_without(PARTS[name]).back.fit_body, field) < 1e-4 < getattr(whole.back.fit_body, field)
    stiff = chain_runs.method_without(PARTS["a trunk that bends"])
    held = np.array([name.startswith(TRUNK_JOINTS) for name in DOF_NAMES])
    assert not stiff.limits.low[held].any() and not stiff.limits.high[held].any()
    assert_array_equal(stiff.limits.low[~held], whole.limits.low[~held])


@pytest.mark.slow
def test_a_stiff_trunk_stays_straight():
    people = hmc.pose(
        hmc.open_recording(TINY, frames=4), method=chain_runs.method_without(PARTS["a trunk that bends"]), seed=SEED, height_m="auto"
    )
    bends = np.array([name.startswith(TRUNK_JOINTS) for name in people.angle_names])
    assert not people.angles[:, bends].any() and people.angles[:, ~bends].any()


@pytest.fixture
def with_a_reference(tmp_path):
    """A recording whose truth is another system's."""
    for name in ("calibration.toml", "recording.toml", "videos", "background"):
        (tmp_path / name).symlink_to(TINY / name)
    (tmp_path / "reference").mkdir()
    (tmp_path / "reference" / "joints.csv").symlink_to(TINY / "truth" / "joints.csv")
    return tmp_path


def test_joints_of_another_system_stand_for_the_truth(inputs, with_a_reference, monkeypatch):
    poses = read_joints(TINY / "truth" / "joints.csv")
    monkeypatch.setattr(chain_runs, "_run", lambda *args: (SimpleNamespace(poses=poses), {}))
    found = cell(Inputs(inputs.folder, {"other@0": with_a_reference}), label="other@0")
    assert found["reference"] and found["tracks"] == {}
    assert_allclose(found["truth_m"], poses.positions[: len(found["frames"])], atol=1e-6)
    assert_array_equal(found["estimate_m"], found["truth_m"])
    (with_a_reference / "reference" / "joints.csv").unlink()
    with pytest.raises(InputError, match=r"has no truth/joints\.csv and no reference/joints\.csv"):
        cell(Inputs(inputs.folder, {"other@0": with_a_reference}), label="other@0")


def test_grids_have_four_cameras_where_many_see_one_person(tmp_path):
    grid = find_experiment("whole-chain").grid(Plan())
    few = {one["recording"].partition("@")[0] for one in grid if one["cameras"] == FEW}
    assert few == {"box", "jog", "gesture", "throw_catch", "pale"}
    assert len(grid) == 3 * (len(whole_chain.RECORDINGS) + len(few))
    assert chain_runs.one_before_many(source_of(TINY)) and not chain_runs.one_before_many(Source("mine@0", tmp_path))
    parts = find_experiment("ablation").grid(Plan())
    assert len(parts) == 3 * len(PARTS) * len(ablation.RECORDINGS)
    assert [one for one in parts if one["without"] == WHOLE and one in grid] == [one for one in parts if one["without"] == WHOLE]


def test_recordings_may_be_named_by_their_recipes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert plan_of(recordings=[Path("box"), TINY]).recordings == (rendered("box"), source_of(TINY))
    with pytest.raises(InputError, match="nowhere"):
        plan_of(recordings=[Path("nowhere")])


def moving(rng, n=40):
    """A person's landmarks, whose limbs move at random about a trunk that turns."""
    truth = np.zeros((n, len(LANDMARKS), 3))
    truth[:, LANDMARKS.index("neck"), 2] = truth[:, LANDMARKS.index("head_top"), 2] = 0.5
    for side, sign in (("l", 1), ("r", -1)):
        for name in ("hip", "shoulder"):
            truth[:, LANDMARKS.index(f"{side}_{name}")] = 0, 0.2 * sign, 0.5 * (name == "shoulder")
    turns = rng.uniform(0, 2 * np.pi, n)
    across = np.stack([[np.cos(turns), -np.sin(turns)], [np.sin(turns), np.cos(turns)]])
    truth[..., :2] = np.einsum("ijf,fkj->fki", across, truth[..., :2])
    return truth, across


def test_offsets_of_the_other_half_are_taken_off():
    truth, across = moving(np.random.default_rng(0))
    offset = np.zeros_like(truth)
    offset[..., :2] = np.einsum("ijf,j->fi", across, [0.03, 0.01])[:, None]
    assert_allclose(whole_chain.left_of_other_half(truth + offset, truth), 0, atol=1e-12)
    offset[20:] *= -1
    assert_allclose(whole_chain.left_of_other_half(truth + offset, truth), 2 * np.hypot(0.03, 0.01))
    assert np.isnan(whole_chain.left_of_other_half(truth[:12], truth[:12])).all()  # too few frames for offsets


def reported(name, off_m, quick=False):
    """The report where landmarks are off by so many metres: ``off_m(parameters, rng)``."""
    cells = []
    for parameters in find_experiment(name).grid(Plan(quick=quick)):
        results = RESULTS["chain"](np.random.default_rng(1), parameters, False)
        results["estimate_m"] = results["truth_m"] + np.array([off_m(parameters), 0, 0])
        cells.append(Cell(parameters, results))
    return find_experiment(name).report(cells, Plan(quick=quick))


def test_claims_of_the_whole_chain_follow_the_figures():
    def holding(off_m):
        return [claim.holds for claim in reported("whole-chain", off_m).claims]

    assert holding(lambda parameters: 0.02) == [True] * 6
    assert holding(lambda parameters: 0.027) == [False, True, True, True, True, True]
    assert holding(lambda parameters: 0.2 if parameters["cameras"] == FEW else 0.02) == [True, True, True, False, True, True]
    assert holding(lambda parameters: 0.2 if "close" in parameters["recording"] else 0.02) == [True] * 4 + [False] * 2


def test_nothing_is_claimed_of_references_and_of_recordings_that_are_not_there():
    experiment, cells = find_experiment("whole-chain"), []
    for parameters in experiment.grid(Plan(quick=True)):
        if parameters["recording"].startswith("box"):
            results = RESULTS["chain"](np.random.default_rng(1), parameters, False) | {"reference": parameters["cameras"] == FEW}
            cells.append(Cell(parameters, results))
    report = experiment.report(cells, Plan(quick=True))
    assert len(report.tables[0].rows) == 2
    assert [claim.text.partition(":")[0] for claim in report.claims] == ["one person, 7 or 8 cameras"] * 3


def test_costs_are_means_over_clips_however_many_people_there_are():
    def off(parameters):
        dear = parameters["without"] == "recovery" and parameters["recording"].startswith("close_white")
        return 0.018 if dear else 0.012 if parameters["without"] not in (WHOLE, "limb search") else 0.01

    report = reported("ablation", off)
    rows = {row["part"]: row for row in report.tables[0].rows}
    assert list(rows) == [part for part in PARTS if part != WHOLE]
    assert rows["recovery"]["costs_mm"] == pytest.approx((7 * 2 + 8) / 8) and rows["recovery"]["most"] == "close_white +8.0 mm"
    assert rows["limb search"]["costs_mm"] == pytest.approx(0, abs=1e-9) and rows["limb search"]["helps_on"] == 0
    assert rows["second pass"]["helps_on"] == len(ablation.RECORDINGS)
    useful, harmless = report.claims
    assert not useful.holds and useful.detail == "not shown of: limb search" and harmless.holds
    clips = {row["without"]: row for row in report.tables[1].rows}
    assert clips["nothing (the whole)"]["box_mm"] == pytest.approx(10) and clips["recovery"]["close_white_mm"] == pytest.approx(8)


def test_a_part_that_harms_and_one_seed_are_told():
    useful, harmless = reported("ablation", lambda parameters: 0.01 - 0.003 * (parameters["without"] == "recovery")).claims
    assert not useful.holds and not harmless.holds and harmless.detail.startswith("recovery costs -3.0")
    assert len(reported("ablation", lambda parameters: 0.01, quick=True).claims) == 1  # nothing tells how far one seed scatters


@pytest.mark.slow
@pytest.mark.parametrize("noise", [False, True])
def test_nothing_holds_of_full_runs_at_random(noise):
    for name in ("whole-chain", "ablation"):
        assert not held_always(name, lambda rng, parameters: RESULTS["chain"](rng, parameters, noise), quick=False)
