"""The skeleton model, its error and the swarm: against matrix exponentials, OpenCV, brute force and SciPy."""

from dataclasses import replace
from itertools import pairwise, permutations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment
from test_spectral import BODY, SIZE, drawn

from hmc.body.spin_skeleton import (
    ANGLE_INDEX,
    ANGLES,
    N_PARAMETERS,
    default_limits,
    model_of_height,
    part_chains,
    segment_ends,
    skeleton_landmarks,
    thesis_limits,
    torso_frames,
)
from hmc.landmarks import LANDMARKS
from hmc.pose.method import Capture
from hmc.pose.methods.pso import SWARM_PRESETS, pso_method
from hmc.pose.objectives.curves import KINDS, MODEL_PARTS, observe_curves, pair_errors, skeleton_error
from hmc.pose.objectives.volume import volume_error
from hmc.pose.spectral.reading import read_body
from hmc.pose.spectral.skeleton import equally_spaced
from hmc.pose.spectral.volume import FARTHEST_M, observe_volume
from hmc.pose.steps.swarm.fit import (
    PARTS,
    STAGES,
    FitSettings,
    bounds_around,
    fit_around,
    fit_flat,
    fit_hierarchical,
    rest_state,
    torso_moves,
)
from hmc.pose.steps.swarm.heading import facing_evidence, heading_of, spin_towards
from hmc.pose.steps.swarm.temporal import RestartSettings, SwarmSettings, is_upright, start_fits, swarm_step
from hmc.pose.views.person_view import PersonView
from hmc.search.swarm import PsoSettings, pso_init, pso_run, pso_step

MODEL = model_of_height(1.75)


def random_states(seed, n=5):
    rng = np.random.default_rng(seed)
    states = np.zeros((n, N_PARAMETERS))
    states[:, :3] = rng.normal(0, 1, (n, 3))
    states[:, 3:6] = states[:, :3] + rng.normal(0, 1, (n, 3))
    states[:, 6] = rng.uniform(-np.pi, np.pi, n)
    states[:, 7:] = rng.uniform(MODEL.low, MODEL.high, (n, 16))
    return states


def by_twists(model, state):
    """Table 3-2 and Eqs. 3-19 to 3-26 word by word: products of matrix exponentials of twists, in homogeneous coordinates."""

    def turn(axis, point, angle):
        w = np.eye(3)["xyz".index(axis)]
        twist = np.zeros((4, 4))
        twist[:3, :3] = np.cross(np.eye(3), w)
        twist[:3, :3] = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        twist[:3, 3] = -np.cross(w, point)
        return expm(twist * angle)

    a = dict(zip(ANGLES, state[7:], strict=True))
    half = model.torso / 2
    tips = {"head_top": ([0, 0, half + model.head], [("x", [0, 0, half], a["neck_x"]), ("y", [0, 0, half], a["neck_y"])])}
    for side, sign in (("l", 1), ("r", -1)):
        shoulder = np.array([0, sign * model.shoulder / 2, half - model.shoulder_drop])
        elbow = shoulder + [0, sign * model.upper_arm, 0]
        hip = np.array([0, sign * model.hip / 2, -half])
        knee = hip - [0, 0, model.thigh]
        ball = [(axis, shoulder, a[f"{side}_shoulder_{axis}"]) for axis in "xyz"]
        leg = [(axis, hip, a[f"{side}_hip_{axis}"]) for axis in "xy"]
        tips[f"{side}_elbow"] = (elbow, ball)
        tips[f"{side}_wrist"] = (elbow + [0, sign * model.forearm, 0], [*ball, ("z", elbow, a[f"{side}_elbow_z"])])
        tips[f"{side}_knee"] = (knee, leg)
        tips[f"{side}_ankle"] = (knee - [0, 0, model.shank], [*leg, ("y", knee, a[f"{side}_knee_y"])])
    up = (state[3:6] - state[:3]) / np.linalg.norm(state[3:6] - state[:3])
    between = np.cross([0, 0, 1], up)
    angle = np.arctan2(np.linalg.norm(between), up[2])
    onto = cv2.Rodrigues(angle * between / max(np.linalg.norm(between), 1e-12))[0]
    spin = cv2.Rodrigues(state[6] * up)[0]
    out = {}
    for name, (place, turns) in tips.items():
        product = np.eye(4)
        for one in turns:
            product = product @ turn(*one)
        out[name] = spin @ onto @ (product @ [*place, 1])[:3] + state[:3]
    return out


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_landmarks_equal_products_of_exponentials(seed):
    states = random_states(seed, 2)
    ours = skeleton_landmarks(MODEL, states)
    for k, state in enumerate(states):
        for name, place in by_twists(MODEL, state).items():
            np.testing.assert_allclose(ours[k, LANDMARKS.index(name)], place, atol=1e-9)


def test_a_torso_upside_down_is_still_a_rotation():
    state = np.zeros((1, N_PARAMETERS))
    state[0, 5] = -1.0
    frame = torso_frames(state)[0]
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1) and frame[2, 2] == pytest.approx(-1)


def test_limits_let_arms_and_legs_go_where_people_can():
    """Forwards across the chest, which Table 3-4 forbids on its own axes, and not far backwards; elbows and knees the right way."""
    low, high = default_limits()
    index = {name: k for k, name in enumerate(ANGLES)}
    assert low[index["l_shoulder_z"]] < -np.pi / 2 < thesis_limits()[0][index["l_shoulder_z"]] + 1e-9
    assert high[index["l_shoulder_z"]] < np.pi / 2 + 1e-9
    state = rest_state(MODEL, np.zeros(3), np.array([0, 0, 1.0]))
    state[ANGLE_INDEX["l_shoulder_x"]] = 0
    state[ANGLE_INDEX["l_shoulder_z"]] = np.radians(-90)
    points = skeleton_landmarks(MODEL, state)
    assert points[LANDMARKS.index("l_elbow"), 0] > 0.9 * MODEL.upper_arm  # X is forward
    for side in "lr":
        bent = rest_state(MODEL, np.zeros(3), np.array([0, 0, 1.0]))
        knee = ANGLE_INDEX[f"{side}_knee_y"]
        bent[knee] = MODEL.high[knee - 7]
        assert skeleton_landmarks(MODEL, bent)[LANDMARKS.index(f"{side}_ankle"), 0] < -0.1
        elbow = ANGLE_INDEX[f"{side}_elbow_z"]
        bent[elbow] = (MODEL.low if side == "l" else MODEL.high)[elbow - 7]
        assert skeleton_landmarks(MODEL, bent)[LANDMARKS.index(f"{side}_wrist"), 0] > 0.1


def brute_error(points, nodes):
    """Eq. 3-27, node by node."""
    same = sum(np.linalg.norm(a - b) for a, b in zip(nodes, points, strict=True))
    turned = sum(np.linalg.norm(a - b) for a, b in zip(nodes, points[::-1], strict=True))
    return min(same, turned) / len(nodes)


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_error_is_that_of_the_best_assignment(seed):
    rng = np.random.default_rng(seed)
    names = list(rng.permutation(["trunk", "head", "arm_1", "arm_2", "leg_1", "leg_2"]))[: int(rng.integers(1, 7))]
    curves = {name: np.cumsum(rng.normal(0, 0.05, (20, 3)), axis=0) for name in names}
    observed = observe_curves(MODEL, curves, 5, named=False, from_tip=False)
    states = random_states(seed, 3)
    errors, choice = skeleton_error(MODEL, states, observed)
    chains = part_chains(*segment_ends(MODEL, states))
    for k in range(3):
        matrix = np.full((len(names), 6), 1e3)
        for q, (row, part) in enumerate(observed.pairs):
            matrix[row, part] = brute_error(observed.blends[q] @ chains[k, part], observed.nodes[row])
        rows, columns = linear_sum_assignment(matrix)
        assert errors[k] == pytest.approx(matrix[rows, columns].mean())
        told = observed.parts_of(int(choice[k]))
        assert matrix[range(len(names)), [MODEL_PARTS.index(told[name]) for name in names]].mean() == pytest.approx(errors[k])


def test_named_curves_keep_their_kind():
    curves = {name: np.linspace([0, 0, 0], [0, 0, 1], 10) for name in ("trunk", "head", "arm_1", "arm_2", "leg_1", "leg_2")}
    observed = observe_curves(MODEL, curves)
    assert len(observed.choices) == 4
    free = observe_curves(MODEL, curves, named=False)
    assert len(free.choices) == len(list(permutations(range(5)))) and free.parts_of(0)["trunk"] == "torso"
    for choice in range(4):
        for name, part in observed.parts_of(choice).items():
            assert MODEL_PARTS.index(part) in KINDS[name]


def test_what_a_curve_is_called_is_nothing_to_the_printed_error():
    """Section 3.2.2.1: the least sum of one-to-one pairs; in a stage with fewer parts, of the curves that fit them best."""
    state = random_states(3, 1)[0]
    curves = model_curves(state)
    turned = dict(zip(("trunk", "leg_1", "other_1", "head", "arm_2", "arm_1"), curves.values(), strict=True))
    away = random_states(4, 1)
    for drawn_curves in (curves, turned):
        observed = observe_curves(MODEL, drawn_curves, named=False)
        assert skeleton_error(MODEL, state[None], observed)[0][0] == pytest.approx(0, abs=0.01)
        np.testing.assert_allclose(
            skeleton_error(MODEL, away, observed)[0], skeleton_error(MODEL, away, observe_curves(MODEL, curves, named=False))[0]
        )
    head = observe_curves(MODEL, turned, named=False).only(("trunk", "head"))
    errors, choice = skeleton_error(MODEL, state[None], head)
    assert errors[0] == pytest.approx(0, abs=0.01)
    assert head.parts_of(int(choice[0])) == {"trunk": "torso", "leg_1": "head"}


def test_of_more_branches_than_parts_the_longest_count():
    curves = model_curves(random_states(5, 1)[0]) | {"other_1": np.zeros((4, 3)), "other_2": np.linspace([0, 0, 0], [0, 0, 5], 9)}
    observed = observe_curves(MODEL, curves, named=False)
    assert len(observed.names) == 6 and "other_2" in observed.names and "other_1" not in observed.names


def test_the_printed_preset_minimises_curves_alone_and_has_a_fit_wherever_there_are_curves():
    preset = SWARM_PRESETS["hsiao2008"]
    voxels, points, _ = drawn(BODY)
    reading = read_body(voxels, points, SIZE, 1.75, preset.reading)
    assert reading.status == "read" and len(reading.curves) == 6
    model = model_of_height(1.75, thesis=True)
    state, info = swarm_step(np.random.default_rng(0), model, None, reading, 30.0, None, preset.swarm)
    observed = observe_curves(model, reading.curves, preset.swarm.nodes, named=False)
    assert info.status == "fitted" and info.cost_m == pytest.approx(float(skeleton_error(model, state.state[None], observed)[0][0]))
    far = replace(state, state=state.state + np.r_[np.full(6, 3.0), np.zeros(17)])
    after, info = swarm_step(np.random.default_rng(1), model, far, reading, 30.0, None, preset.swarm)
    assert info.started and info.error_m < 0.2  # Figure 3-22: the start of the frame alone fits better
    assert np.linalg.norm(after.state[:3] - state.state[:3]) < 0.2


def model_curves(state, n=16):
    """Curves as they would be drawn of a model's own parts."""
    chains = part_chains(*segment_ends(MODEL, state[None]))[0]
    names = ("trunk", "head", "arm_1", "arm_2", "leg_1", "leg_2")
    return {name: equally_spaced(chain, n) for name, chain in zip(names, chains, strict=True)}


def test_a_model_has_no_error_against_itself_and_half_a_limb_fits_its_end():
    state = random_states(3, 1)[0]
    curves = model_curves(state)
    errors, _ = skeleton_error(MODEL, state[None], observe_curves(MODEL, curves))
    assert errors[0] < 0.01
    half = curves | {"arm_1": curves["arm_1"][8:]}
    assert skeleton_error(MODEL, state[None], observe_curves(MODEL, half))[0][0] < 0.015
    assert skeleton_error(MODEL, state[None], observe_curves(MODEL, half, from_tip=False))[0][0] > 0.02


def sphere(x):
    return ((x - 0.3) ** 2).sum(1)


@pytest.mark.parametrize("topology", ["global", "ring", "swarms"])
def test_swarm_finds_the_minimum_of_a_bowl(topology):
    low, high = np.full(5, -2.0), np.full(5, 2.0)
    found = pso_run(np.random.default_rng(0), sphere, low, high, PsoSettings(30, 120, topology=topology))
    np.testing.assert_allclose(found.leader, 0.3, atol=1e-2)
    assert found.evaluations == 30 * 121


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_a_step_stays_in_the_box_and_never_forgets_the_best(seed):
    rng = np.random.default_rng(seed)
    low, high = np.array([-1.0, 0.5, -3.0]), np.array([1.0, 2.0, -2.0])
    plan = PsoSettings(8, 5, topology=("global", "ring", "swarms")[seed % 3])
    state = pso_init(rng, sphere, low, high, plan, np.array([[5.0, 1.0, -2.5]]))
    assert state.positions[0].tolist() == [1.0, 1.0, -2.5]
    for _ in range(6):
        new = pso_step(rng, sphere, low, high, plan, state)
        assert (new.positions >= low).all() and (new.positions <= high).all()
        assert (new.best_costs <= state.best_costs).all()
        np.testing.assert_allclose(sphere(new.best), new.best_costs)
        state = new


def test_two_runs_of_one_seed_are_the_same():
    low, high = np.full(3, -1.0), np.full(3, 1.0)
    a, b = (pso_run(np.random.default_rng(4), sphere, low, high).leader for _ in range(2))
    np.testing.assert_array_equal(a, b)


def test_stages_keep_what_was_free_before():
    for (before, _), (after, _) in pairwise(STAGES):
        assert set(before) < set(after)
    assert set(STAGES[-1][0]) == set(range(N_PARAMETERS))


def test_hierarchical_fit_finds_a_pose_and_beats_a_flat_one():
    true = rest_state(MODEL, np.array([0.2, -0.1, 1.1]), np.array([0.05, 0, 1.0]), 0.4)
    for name, degrees in (
        ("l_shoulder_x", -20),
        ("l_elbow_z", -70),
        ("r_shoulder_z", 60),
        ("r_shoulder_x", 10),
        ("r_hip_y", -50),
        ("r_knee_y", 60),
    ):
        true[ANGLE_INDEX[name]] = np.radians(degrees)
    observed = observe_curves(MODEL, model_curves(true), 8)
    start = rest_state(MODEL, true[:3] + 0.05, np.array([0, 0, 1.0]), 0.0)
    found = fit_hierarchical(np.random.default_rng(0), MODEL, observed, start, spin_range=1.0)
    gap = np.linalg.norm(skeleton_landmarks(MODEL, found.state) - skeleton_landmarks(MODEL, true), axis=1)
    assert found.error_m < 0.02 and gap.mean() < 0.05
    assert (found.state[7:] >= MODEL.low - 1e-12).all() and (found.state[7:] <= MODEL.high + 1e-12).all()
    flat = fit_flat(np.random.default_rng(0), MODEL, observed, start, PsoSettings(50, found.evaluations // 50), 1.0)
    assert found.error_m < flat.error_m


def test_as_printed_no_particle_knows_where_the_last_search_ended():
    """With no iteration a swarm's best is its best first particle: the known pose, unless all lie anywhere in their ranges."""
    curves = observe_curves(MODEL, model_curves(rest_state(MODEL, np.zeros(3), np.array([0.0, 0.0, 1.0]))))
    known = rest_state(MODEL, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    box, swarm = bounds_around(MODEL, known, 0.05, 0.3), PsoSettings(12, 0)
    near = fit_around(np.random.default_rng(0), MODEL, curves, known[None], box, swarm)
    assert near.error_m < 1e-4 and np.allclose(near.state, known)
    printed = fit_around(np.random.default_rng(0), MODEL, curves, known[None], box, replace(swarm, anywhere=True))
    rng = np.random.default_rng(0)
    drawn_states = rng.uniform(*box, (12, N_PARAMETERS))
    assert np.isclose(np.abs(drawn_states[:, 7:] - printed.state[7:]).max(1).min(), 0)
    assert printed.error_m > 0.01


def test_the_printed_preset_minimises_nothing_but_the_curves_error_from_anywhere():
    swarm = SWARM_PRESETS["hsiao2008"].swarm
    assert swarm.fit.swarm.anywhere and swarm.last_weight == swarm.spin_weight == swarm.rest_weight == swarm.facing_m == 0


def test_headings():
    state = rest_state(MODEL, np.zeros(3), np.array([0, 0, 1.0]))
    feet = np.array([[0.0, 0.2, -0.02], [0.05, 0.18, 0.0]])
    heading = heading_of(feet, np.array([0.0, 1.0, 0.0]))
    state[6] = spin_towards(state, heading)
    forward = torso_frames(state)[:, 0]
    assert facing_evidence(state, heading) > 1.9 and forward[1] > 0.9
    assert heading_of(np.zeros((0, 3))) is None and heading_of(np.zeros((0, 3)), np.array([0.1, 0, 0])) is None
    assert facing_evidence(state, None) == 0.0
    lying = rest_state(MODEL, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    assert np.isfinite(spin_towards(lying, heading))


def read(capsules):
    voxels, points, _ = drawn(capsules)
    return read_body(voxels, points, SIZE, 1.75)


def test_a_person_is_found_followed_and_not_found_where_there_is_none():
    quick = SwarmSettings(fit=FitSettings(), restart=RestartSettings())
    state, info = swarm_step(np.random.default_rng(0), MODEL, None, read(BODY), 30.0, None, quick)
    assert info.status == "fitted" and info.started and info.error_m < 0.1 and info.cost_m < 0.05
    points = skeleton_landmarks(MODEL, state.state)
    wrists = points[[LANDMARKS.index("l_wrist"), LANDMARKS.index("r_wrist")]]
    assert sorted(np.sign(wrists[:, 1]).tolist()) == [-1, 1] and (np.abs(wrists[:, 1]) > 0.55).all()
    empty, nothing = swarm_step(np.random.default_rng(1), MODEL, state, read(BODY[1:2]), 30.0, None, quick)
    assert nothing.status.startswith("no fit: ") and np.isnan(nothing.error_m)
    assert empty.missed == 1
    moved = [((*a[:2], a[2] + 0.02), (*b[:2], b[2] + 0.02), r, p) for a, b, r, p in BODY]
    again, info = swarm_step(np.random.default_rng(2), MODEL, empty, read(moved), 30.0, None, quick)
    assert info.status == "fitted" and not info.started and again.missed == 0


def test_a_frame_without_a_person_before_the_first_fit():
    state, info = swarm_step(np.random.default_rng(0), MODEL, None, read(BODY[1:2]), 30.0)
    assert state is None and info.status.startswith("no fit")


def test_pairs_do_not_depend_on_the_other_curves():
    state = random_states(8, 1)
    curves = model_curves(random_states(9, 1)[0])
    together = observe_curves(MODEL, curves)
    alone = together.only(("arm_1", "head"))
    rows = [k for k, (row, _) in enumerate(together.pairs) if together.names[row] in ("arm_1", "arm_2", "head")]
    chains = part_chains(*segment_ends(MODEL, state))
    np.testing.assert_allclose(pair_errors(chains, alone)[0], pair_errors(chains, together)[0][rows])
    assert len(alone.choices) == 2


def standing():
    """A pose with the arms spread, as `BODY` has."""
    state = rest_state(MODEL, np.array([0, 0, 1.13]), np.array([0, 0, 1.0]))
    state[[ANGLE_INDEX["l_shoulder_x"], ANGLE_INDEX["r_shoulder_x"], ANGLE_INDEX["l_elbow_z"], ANGLE_INDEX["r_elbow_z"]]] = 0
    return state


def test_how_a_skeleton_lies_in_voxels_is_what_a_plain_loop_says():
    voxels, points, _ = drawn(BODY)
    volume = observe_volume(voxels, points, SIZE, 40)
    assert len(volume.shell) == 40
    # Every voxel is where it says, and each of the shell has an empty neighbour.
    place = np.rint((points - volume.origin) / SIZE).astype(int)
    assert (volume.outside_m[tuple(place.T)] == 0).all() and np.count_nonzero(volume.outside_m == 0) == len(points)
    shell = np.rint((volume.shell - volume.origin) / SIZE).astype(int)
    assert all(max(volume.outside_m[tuple(one + step)] for step in (*np.eye(3, dtype=int), *-np.eye(3, dtype=int))) > 0 for one in shell)
    states = np.concatenate([standing()[None], random_states(1, 2)])
    starts, ends = segment_ends(MODEL, states)
    found = volume_error(MODEL, starts, ends, volume)
    # The other half: distances of points of the segments from the nearest voxel.
    share = np.array([0.3, 0.6, 0.9])
    for k in range(3):
        a, b = starts[k], ends[k]
        sides = [(a[0] + 0.6 * (a[hip] - a[0]), b[0] + 0.35 * (a[arm] - b[0])) for hip, arm in ((6, 2), (8, 4))] + list(
            zip(a[1:], b[1:], strict=True)
        )
        widths = MODEL.torso * np.array([0.22, 0.22, 0.19, 0.10, 0.08, 0.10, 0.08, 0.16, 0.11, 0.16, 0.11]) + SIZE / 2
        bare = [min(max(_way(p, u, v) - w, 0.0) for (u, v), w in zip(sides, widths, strict=True)) for p in volume.shell]
        inner = np.array([u + s * (v - u) for s in share for u, v in sides])
        out = [min(np.linalg.norm(points - p, axis=1).min(), FARTHEST_M) for p in inner]
        assert found[k] == pytest.approx(np.minimum(bare, FARTHEST_M).mean() + np.mean(out), abs=0.012)
    assert found[0] < 0.03 < found[1:].min()


def _way(p, u, v):
    """Distance of a point from a segment."""
    t = np.clip((p - u) @ (v - u) / ((v - u) @ (v - u)), 0, 1)
    return float(np.linalg.norm(p - u - t * (v - u)))


def test_a_torso_turns_beneath_its_limbs():
    state = rest_state(MODEL, np.array([0.1, 0, 1.1]), np.array([0.1, 0.05, 1.0]), 0.3)
    state[ANGLE_INDEX["l_elbow_z"]], state[ANGLE_INDEX["r_knee_y"]] = -1.0, 0.7
    moves = torso_moves(MODEL, state)
    np.testing.assert_array_equal(moves[:, :7], np.eye(7))
    names = [f"{side}_{joint}" for side in "lr" for joint in ("elbow", "wrist", "knee", "ankle")]
    rows = [LANDMARKS.index(name) for name in names]
    before = skeleton_landmarks(MODEL, state)[rows]
    turned = state + 0.2 * moves[6]
    rigid = state.copy()
    rigid[6] += 0.2
    with_limbs = np.linalg.norm(skeleton_landmarks(MODEL, rigid)[rows] - before, axis=1)
    beneath = np.linalg.norm(skeleton_landmarks(MODEL, turned)[rows] - before, axis=1)
    assert beneath.mean() < 0.5 * with_limbs.mean()


def upside_down():
    """`BODY` as it is misread: the head's curve is a leg's, and the other leg's the head's, the trunk's goes down."""
    reading = read(BODY)
    curves = reading.curves
    low = np.array([curves["leg_1"][-1], curves["leg_2"][-1]]).mean(0)
    head = np.linspace(curves["trunk"][0], low, 20)
    return replace(reading, curves={"trunk": curves["trunk"][::-1], "head": head, "leg_1": curves["head"], "leg_2": curves["arm_1"]})


def test_nobody_begins_on_the_head():
    """The misread curves are fitted upside down, and in such a frame nobody begins, whether the voxels count beside them or not."""
    reading = upside_down()
    on_head = start_fits(np.random.default_rng(0), MODEL, reading, None, SwarmSettings())[0]
    assert not is_upright(on_head.state)
    for voxels in (True, False):
        none, info = swarm_step(np.random.default_rng(0), MODEL, None, reading, 30.0, None, SwarmSettings(voxels=voxels))
        assert none is None and info.status == "no fit: no person is upright in the curves"


def test_a_pose_that_is_too_far_from_the_curves_is_no_fit():
    state, _ = swarm_step(np.random.default_rng(0), MODEL, None, read(BODY), 30.0)
    lost = SwarmSettings(restart=RestartSettings(lost_m=0.001))
    after, info = swarm_step(np.random.default_rng(1), MODEL, state, read(BODY), 30.0, None, lost)
    assert info.status == "no fit: the nearest pose is too far from the curves" and after.missed == 1
    np.testing.assert_array_equal(after.state, state.state)


def test_who_is_followed_badly_is_started_anew_and_not_where_the_fit_is_good():
    """The swarm cannot leave the pose in one frame; a start can, and is taken where it is better by the margin."""
    reading, still = read(BODY), {"reach_m_s": 0.0, "least_reach_m": 0.001, "reach_rad_s": 0.0, "least_reach_rad": 0.001}
    good, _ = swarm_step(np.random.default_rng(0), MODEL, None, reading, 30.0)
    kept, info = swarm_step(np.random.default_rng(1), MODEL, good, reading, 30.0)
    assert not info.started and kept.missed == 0
    bad = good.state.copy()
    bad[3:6] = bad[:3] + 0.5 * MODEL.torso * np.array([0.8, 0.0, 0.6])
    costs = {}
    for doubt_m in (0.02, 9.0):
        settings = SwarmSettings(**still, restart=RestartSettings(lost_m=1.0, doubt_m=doubt_m))
        _, info = swarm_step(np.random.default_rng(1), MODEL, replace(good, state=bad), reading, 30.0, None, settings)
        costs[info.started] = info.cost_m
    assert costs[True] < 0.6 * costs[False]


def test_evaluations_are_those_of_all_fits_of_a_frame_whichever_is_taken():
    reading, swarm = read(BODY), SWARM_PRESETS["hsiao2008"].swarm
    tried = start_fits(np.random.default_rng(0), MODEL, reading, None, SwarmSettings(restart=RestartSettings()))
    state, first = swarm_step(np.random.default_rng(0), MODEL, None, reading, 30.0, None, SwarmSettings(restart=RestartSettings()))
    assert first.evaluations == sum(one.evaluations for one in tried) > tried[0].evaluations
    stages = sum(particles * (1 + iterations) for particles, iterations in swarm.fit.stages)
    tuning = len(PARTS) * swarm.fit.tune_rounds * swarm.fit.tune_particles * (1 + swarm.fit.tune_iterations)
    both = stages + swarm.particles * (1 + swarm.iterations) + 2 * tuning
    for margin_m, started in ((np.inf, False), (-np.inf, True)):
        settings = replace(swarm, restart=replace(swarm.restart, margin_m=margin_m))
        _, info = swarm_step(np.random.default_rng(1), MODEL, state, reading, 30.0, None, settings)
        assert (info.started, info.evaluations) == (started, both)


def test_what_is_read_in_the_voxels_can_be_given():
    asked = []

    def read(view, height_m):
        asked.append((view.frame, height_m))

    start = pso_method(SWARM_PRESETS["hsiao2008"], read=read).start
    assert start(np.random.default_rng, [PersonView(frame=3), PersonView(frame=4)], Capture(), 1.7) is None
    assert asked == [(3, 1.7), (4, 1.7)]
