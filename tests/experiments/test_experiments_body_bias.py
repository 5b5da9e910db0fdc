"""How far the body alone pulls poses off: the body of true joint lengths, whole cells, and claims that follow the figures."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from hmc.body.joints import N_CANTON, N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import PARTS, neutral_state
from hmc.body.proportions import DEFAULT_LENGTHS, SOLE, default_body, make_body
from hmc.errors import InputError
from hmc.experiments import body_bias
from hmc.experiments.body_bias import AS_IT_IS, FLAT, MIDDLE, NEITHER, STIFF
from hmc.experiments.engine.experiment import Cell, Plan
from hmc.experiments.engine.inputs import Inputs
from hmc.experiments.engine.library import find_experiment
from hmc.landmarks import LANDMARKS, landmark_index

TINY = Path(__file__).parents[2] / "data" / "synthetic" / "tiny"
LABEL = "tiny@0"
#: The joints of the limbs and the waist: a spine that bends is shorter from end to end.
MOVED = np.r_[np.zeros(6), np.full(N_CANTON - 6, 0.2), np.zeros(N_DOF - N_CANTON)]


def cell(body, recording=TINY, frames=6):
    parameters = {"recording": LABEL, "body": body, "cameras": 0, "frames": frames}
    return body_bias.cell(parameters, Inputs(Path("unused"), {LABEL: recording}), np.random.default_rng(0))


def test_the_body_has_the_joint_lengths_of_the_landmarks():
    rng = np.random.default_rng(5)
    usual = default_body(1.7).dimensions
    told = ("trunk", "shoulder_half_width", "hip_half_width", "upper_arm", "forearm", "thigh", "shank")
    person = make_body(usual | {name: usual[name] * rng.uniform(0.9, 1.1) for name in told})
    states = neutral_state("down", person.limits) + rng.normal(size=(5, N_DOF)) * MOVED
    found = body_bias._body(landmarks(person, states), (), SOLE, ())
    assert_allclose([found.dimensions[name] for name in (*told, "head")], [person.dimensions[name] for name in (*told, "head")])
    upright = ("trunk", "head", "thigh", "shank")
    stature = sum(person.dimensions[name] for name in upright) / sum(DEFAULT_LENGTHS[name] for name in upright)
    assert found.dimensions["hair"] == pytest.approx(DEFAULT_LENGTHS["hair"] * stature)


def test_variants_differ_in_hair_in_soles_and_in_where_joints_are_alone():
    points = landmarks(default_body(1.7), neutral_state("down"))[None]
    bodies = {name: body_bias._body(points, *variant) for name, variant in body_bias.VARIANTS.items()}
    middle, stiff, flat = bodies.pop(MIDDLE), bodies.pop(STIFF), bodies.pop(FLAT)
    held = dof_index("l_ankle_y", "l_ankle_z", "r_ankle_y", "r_ankle_z")
    assert set(np.flatnonzero(flat.limits.low == flat.limits.high)) == set(held)
    assert np.all(bodies[AS_IT_IS].limits.low < bodies[AS_IT_IS].limits.high)
    assert_allclose(landmarks(stiff, neutral_state("down")), points[0], atol=1e-9)
    shrugging = neutral_state("down")
    shrugging[dof_index("l_girdle_x", "r_girdle_x")] = 0.4, -0.4
    shoulders = [landmark_index("l_shoulder"), landmark_index("r_shoulder")]
    still, raised = (landmarks(body, shrugging)[shoulders, 2] for body in (stiff, bodies[AS_IT_IS]))
    assert_allclose(still, points[0, shoulders, 2])
    assert np.all(raised - still > 0.05)
    arms = middle.cones.part == PARTS.index("l_forearm")
    assert_allclose(middle.cones.start[arms][:, [0, 2]], 0, atol=1e-9)  # on the axis from joint to joint
    assert_allclose(middle.cones.radii, bodies[AS_IT_IS].cones.radii)
    assert_allclose(landmarks(middle, neutral_state("down")), points[0], atol=1e-9)
    lower = {name: bodies[AS_IT_IS].cones.end[:, 2] - body.cones.end[:, 2] for name, body in bodies.items()}
    hair, sole = 1.7 * DEFAULT_LENGTHS["hair"], 1.7 * (SOLE - body_bias.FLOOR_SOLE)
    changed = {name: sorted(by[np.abs(by) > 1e-9]) for name, by in lower.items()}
    wanted = {AS_IT_IS: [], "no hair": [hair], "feet to the floor": [sole, sole], NEITHER: [hair, sole, sole]}
    assert changed == {name: pytest.approx(by) for name, by in wanted.items()}
    assert_allclose(landmarks(bodies[NEITHER], neutral_state("down")), points[0], atol=1e-9)


def test_a_cell_has_the_frames_with_a_truth_and_starts_alike_for_all_variants():
    now, bare = cell(AS_IT_IS), cell(NEITHER)
    assert now["off_m"].shape == now["start_off_m"].shape == (2, len(LANDMARKS), 3)  # frames 0 and 5, one person
    assert_allclose(now["start_off_m"], bare["start_off_m"], atol=1e-9)
    assert np.linalg.norm(now["start_off_m"], axis=2).mean() < 0.02
    assert 0 < np.linalg.norm(now["off_m"] - now["start_off_m"], axis=2).mean() < 0.05
    assert np.linalg.norm(now["off_m"] - bare["off_m"], axis=2).max() > 1e-3


def test_a_recording_without_truth_is_refused(tmp_path):
    for name in ("calibration.toml", "recording.toml", "videos", "background"):
        (tmp_path / name).symlink_to(TINY / name)
    with pytest.raises(InputError, match=r"has no truth/joints\.csv"):
        cell(AS_IT_IS, tmp_path)
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "joints.csv").symlink_to(TINY / "truth" / "joints.csv")
    with pytest.raises(InputError, match="has nobody with truth/silhouettes in these frames"):
        cell(AS_IT_IS, tmp_path)


def reported(off_m):
    """The report where each recording and variant has such an offset (3,), metres."""
    cells = []
    for parameters in find_experiment("body-bias").grid(Plan()):
        off = np.zeros((4, len(LANDMARKS), 3)) + np.array(off_m(parameters["body"], parameters["recording"].partition("@")[0]))
        cells.append(Cell(parameters, {"start_off_m": 0 * off, "off_m": off}))
    return find_experiment("body-bias").report(cells, Plan())


def test_the_table_has_distances_and_upward_shifts():
    rows = reported(lambda body, name: (0.003, 0.0, -0.004)).tables[0].rows
    assert len(rows) == len(body_bias.CLIPS) * len(body_bias.VARIANTS)
    for row in rows:
        assert row["mean_mm"] == pytest.approx(5) and row["start_mm"] == 0 and row["poses"] == 4
        assert row["up_mm"] == row["ankles_up_mm"] == row["crown_up_mm"] == pytest.approx(-4)


def holding(off_m):
    return [claim.holds for claim in reported(off_m).claims]


def test_claims_follow_the_figures():
    def bare(body):
        return body in (NEITHER, MIDDLE, STIFF, FLAT)

    assert holding(lambda body, name: (0, 0, 0.012 if bare(body) else 0.008)) == [True, True, True, True, True]
    assert holding(lambda body, name: (0, 0, 0.012 if body == MIDDLE else 0.008)) == [False, True, False, False, True]
    assert holding(lambda body, name: (0, 0, 0.012 if body == NEITHER else 0.008)) == [True, False, False, False, True]
    assert holding(lambda body, name: (0, 0, 0.012 if body == STIFF else 0.008)) == [False, False, True, False, True]
    assert holding(lambda body, name: (0, 0, 0.012 if body == FLAT else 0.008)) == [False, False, False, True, True]
    assert holding(lambda body, name: (0, 0, 0.008)) == [False, False, False, False, True]
    # On five of eight only, and on seven of eight with a harm on the last that outweighs them.
    some, last = body_bias.CLIPS[:5], body_bias.CLIPS[-1]
    assert holding(lambda body, name: (0.03 if bare(body) or name not in some else 0.02, 0, 0)) == [False, False, False, False, True]
    assert holding(lambda body, name: (0.03 if bare(body) == (name == last) else 0.1 if name == last else 0.031, 0, 0)) == [
        False,
        False,
        False,
        False,
        True,
    ]
    for sign in (1, -1):
        lifted = holding(lambda body, name, sign=sign: (0.02 * bare(body), 0, sign * (0.012 if name == last else 0.005)))
        assert lifted == [True, True, True, True, False]
