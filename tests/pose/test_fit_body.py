"""A person's own dimensions, from rendered people of known stature."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose
from posed import COST, body_of, mean_error, true_state

from hmc.body.dimensions import FITTED, FitBodySettings, prior_deviations, reshaped, whole_deviations
from hmc.body.flesh import surface_coordinates
from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.body.proportions import ASYMMETRIES, DEFAULT_LENGTHS, default_body
from hmc.landmarks import landmark_index
from hmc.pose.objectives.symmetric import Symmetric, body_points
from hmc.pose.starts.fit_body import _Prior, _without_poses, fit_body, of_a_start
from hmc.pose.steps.refine import RefineSettings, refine
from hmc.pose.views.rays import points_to_cover

FRAMES = (0, 1, 3, 4, 6, 7)


def start(acted, height_m: float):
    """A body of some stature on the frames of an act, and the poses refined with it."""
    body, points = body_of(height_m)
    targets = [acted.targets[k] for k in FRAMES]
    objectives = [Symmetric(body, points, target, target.surface[::4], COST) for target in targets]
    states = [refine(one, true_state(body, acted, k), RefineSettings())[0] for k, one in zip(FRAMES, objectives, strict=True)]
    return objectives, np.array(states)


def with_body(objectives, body, coordinates) -> list[Symmetric]:
    """The same frames for another body, or for its surface sampled elsewhere."""
    points = body_points(body, coordinates)
    return [replace(one, body=body, points=points) for one in objectives]


def pose_cost(objectives, states) -> float:
    return float(np.mean([refine(one, state, RefineSettings())[1].cost_after for one, state in zip(objectives, states, strict=True)]))


def stature(body) -> float:
    """What the lengths from ankles to crown add up to, over what they do in a person of average proportions, metres."""

    def sum_of_lengths(dimensions) -> float:
        return sum(dimensions[name] for name in ("trunk", "head", "thigh", "shank"))

    return sum_of_lengths(body.dimensions) / sum_of_lengths(default_body(1.0).dimensions)


def sized(body) -> list[str]:
    """Dimensions that are sizes, not differences from what is nothing in an average person."""
    return [name for name, value in body.dimensions.items() if value > 0]


#: The others that are fitted.
DIFFERENCES = ("pelvis_flesh_forward", *ASYMMETRIES)


@pytest.mark.parametrize("height", [1.62, 1.84])
def test_stature_is_recovered_from_perfect_silhouettes(height):
    """Seven cameras keep the hull from being much fatter than the person."""
    acted = act("gesture", cameras=7, height_m=height)
    found = []
    for assumed in (height - 0.1, height + 0.12):
        objectives, states = start(acted, assumed)
        body = objectives[0].body
        coordinates = surface_coordinates(body, 250)
        fitted, poses, info = fit_body(objectives, states, coordinates, FitBodySettings())
        found.append(stature(fitted))
        assert info.cost_after < info.cost_before
        assert pose_cost(with_body(objectives, fitted, coordinates), poses) < pose_cost(objectives, states)
        assert np.all((poses >= body.limits.low) & (poses <= body.limits.high))
        errors = [mean_error(landmarks(fitted, s), acted.landmarks[k]) for s, k in zip(poses, FRAMES, strict=True)]
        assert np.mean(errors) < 0.05
    assert found == pytest.approx([height, height], rel=0.06)
    assert found[0] == pytest.approx(found[1], rel=0.03)  # it comes from the data, not from what was assumed


@pytest.fixture(scope="module")
def walking():
    return start(act("walk"), 1.78)


def test_the_body_stays_a_person(walking):
    objectives, states = walking
    body = objectives[0].body
    fitted, _, _ = fit_body(objectives, states, surface_coordinates(body, 200), FitBodySettings())
    assert set(fitted.dimensions) == set(body.dimensions)
    ratio = np.array([fitted.dimensions[name] / body.dimensions[name] for name in sized(body)])
    assert np.all((ratio > 0.5) & (ratio < 2.0))
    assert all(abs(fitted.dimensions[name]) < 0.03 for name in DIFFERENCES)
    assert fitted.height_m == fitted.dimensions["height"]
    assert_allclose(fitted.limits.low, body.limits.low)
    # What the fit leaves free follows the common scale.
    scale = fitted.height_m / body.height_m
    for name in ("foot", "ankle_height"):
        assert fitted.dimensions[name] == pytest.approx(scale * body.dimensions[name])


def test_fists_shorten_hands():
    """Open hands of the actor reach 10 % of the stature beyond the wrists, fists 6 %; the table has 8.5, where open ones stay at most."""
    hands = {}
    for fists in (False, True):
        acted = act("gesture", fps=3, cameras=7, voxel_m=0.02, fists=fists)
        body, points = body_of(1.78)
        asked = [points_to_cover(np.random.default_rng(0), target, 600, COST.ray_share) for target in acted.targets]
        objectives = [Symmetric(body, points, *pair, COST) for pair in zip(acted.targets, asked, strict=True)]
        states = np.array([refine(one, true_state(body, acted, k), RefineSettings())[0] for k, one in enumerate(objectives)])
        fitted, _, _ = fit_body(objectives, states, surface_coordinates(body, 350), FitBodySettings())
        hands[fists] = fitted.dimensions["hand"] / fitted.height_m
    assert hands[True] < 0.95 * hands[False]
    assert hands[False] <= DEFAULT_LENGTHS["hand"] * 1.0001


def test_unequal_limbs_are_told_by_their_sides():
    """Fits of a person and of the one with sides exchanged: what both have in common is the gait's and the cameras'."""
    found = []
    for sign in (1, -1):
        acted = act("walk", fps=8, cameras=7, longer_left=(-0.06 * sign, 0.06 * sign))
        true = acted.landmarks[0]
        limbs = {"legs": ("hip", "knee", "ankle"), "arms": ("shoulder", "elbow", "wrist")}
        for kind, names in limbs.items():
            left, right = (
                sum(np.linalg.norm(np.diff([true[landmark_index(f"{side}_{name}")] for name in names], axis=0), axis=1)) for side in "lr"
            )
            assert left - right == pytest.approx(sign * (0.06 if kind == "legs" else -0.06) * (left + right) / 2)
        objectives, states = start(acted, 1.78)
        settings = FitBodySettings(asymmetry_deviation=0.15)  # little held, so that frames tell
        coordinates = surface_coordinates(objectives[0].body, 250)
        of_a_run, at_a_start = (
            fit_body(objectives, states, coordinates, one)[0].dimensions for one in (settings, of_a_start(settings, False))
        )
        found.append([of_a_run[f"{kind}_longer_left"] for kind in limbs])
        assert all(abs(at_a_start[f"{kind}_longer_left"]) < 1e-3 for kind in limbs)  # both sides may be the other
    legs, arms = (np.array(found[0]) - found[1]) / 2
    assert 0.03 < legs < 0.09 and -0.09 < arms < -0.012  # of six frames in a hull of 35 mm; arms are less than twice as thick as that


def test_the_body_does_not_depend_on_the_number_of_processes(walking):
    objectives, states = walking
    coordinates, settings = surface_coordinates(objectives[0].body, 100), FitBodySettings(iterations=2)
    alone, poses, info = fit_body(objectives, states, coordinates, settings)
    for workers in (2, 3):
        body, others, other_info = fit_body(objectives, states, coordinates, settings, workers)
        assert body.dimensions == alone.dimensions and other_info == info
        np.testing.assert_array_equal(others, poses)


def test_a_strong_prior_keeps_the_body(walking):
    objectives, states = walking
    body = objectives[0].body
    coordinates = surface_coordinates(body, 200)
    strong, _, info = fit_body(objectives, states, coordinates, FitBodySettings(prior_weight=10.0))
    weak, _, _ = fit_body(objectives, states, coordinates, FitBodySettings())

    def change(fitted):
        of_differences = max(abs(fitted.dimensions[name]) for name in DIFFERENCES)
        return max(of_differences, *(abs(np.log(fitted.dimensions[name] / body.dimensions[name])) for name in sized(body)))

    assert change(strong) < 0.01 < change(weak)
    assert all(abs(strong.dimensions[name]) < 1e-3 for name in DIFFERENCES)
    assert info.cost_after <= info.cost_before


def test_no_iterations_change_nothing(walking):
    objectives, states = walking
    body = objectives[0].body
    same, poses, info = fit_body(objectives, states, surface_coordinates(body, 200), FitBodySettings(iterations=0))
    assert same.dimensions == pytest.approx(body.dimensions)
    assert_allclose(poses, states)
    assert info.cost_after == info.cost_before


def test_one_frame_is_enough_to_run(walking):
    objectives, states = walking
    body = objectives[0].body
    fitted, poses, info = fit_body(objectives[:1], states[:1], surface_coordinates(body, 150), FitBodySettings())
    assert poses.shape == (1, N_DOF) and np.isfinite(poses).all()
    assert 1.4 < fitted.height_m < 2.2 and info.cost_after <= info.cost_before


def test_pairs_chosen_for_another_body_give_the_same_distances():
    acted = act("gesture", frames=1)
    body, points = body_of(1.78)
    state = true_state(body, acted, 0)
    here = Symmetric(body, points, acted.targets[0], acted.targets[0].surface[::4], COST)
    near = here.linearise(state).near
    for unit in np.eye(len(FITTED)):
        other = reshaped(body, 0.02 * unit)
        there = here.of_body(other, body_points(other, surface_coordinates(other, 100)))
        found, fresh = there.linearise(state, near), there.linearise(state)
        assert_allclose(np.minimum(found.nearest.distance, COST.cap_m), np.minimum(fresh.nearest.distance, COST.cap_m), atol=1e-9)
        assert_allclose(found.residuals, fresh.residuals, atol=1e-9)


def test_a_place_is_in_tenths_of_the_stature_and_grows_with_it_and_a_share_is_added():
    body = default_body(1.6)
    shape = dict.fromkeys(FITTED, 0.0) | {"pelvis_flesh_forward": 0.1, "legs_longer_left": 0.03, "height": np.log(1.1)}
    one = reshaped(body, np.array(list(shape.values())))
    told = [one.dimensions[name] for name in ("pelvis_flesh_forward", "legs_longer_left")]
    assert told == pytest.approx([0.01 * 1.76, 0.03])
    back = reshaped(one, np.array(list((shape | {"pelvis_flesh_forward": -0.1, "height": 0.0}).values())))
    assert back.dimensions["pelvis_flesh_forward"] == pytest.approx(0) and back.dimensions["legs_longer_left"] == pytest.approx(0.06)


def test_how_well_dimensions_are_known_is_what_the_whole_problem_says():
    """Poses and dimensions of three frames in one dense matrix, inverted: what is left for the dimensions when poses are not known."""
    rng, n_frames, n_shape = np.random.default_rng(0), 3, len(FITTED)
    frames = [(rng.normal(size=200), rng.normal(size=(200, N_DOF)), rng.normal(size=(200, n_shape))) for _ in range(n_frames)]
    precision, hold = rng.uniform(1, 50, n_shape), rng.uniform(1, 9, N_DOF)
    limits = default_body(1.7).limits
    states = np.repeat((np.maximum(limits.low, -9) + np.minimum(limits.high, 9))[None] / 2, n_frames, axis=0)
    prior = _Prior(states, hold, precision, np.full(n_shape, np.inf))
    told, _, _ = _without_poses(frames, np.zeros(n_shape), states, prior, 0.0, limits)
    n = n_shape + n_frames * N_DOF
    dense = np.zeros((n, n))
    dense[:n_shape, :n_shape] = np.diag(n_frames * precision)
    for k, (_, by_pose, by_shape) in enumerate(frames):
        own = slice(n_shape + k * N_DOF, n_shape + (k + 1) * N_DOF)
        rows = np.zeros((len(by_pose), n))
        rows[:, :n_shape], rows[:, own] = by_shape, by_pose
        dense += rows.T @ rows
        dense[own, own] += np.diag(hold)
    assert_allclose(np.linalg.inv(told), np.linalg.inv(dense)[:n_shape, :n_shape], rtol=1e-8)


def test_a_length_is_known_with_the_scale_that_it_follows():
    settings = FitBodySettings()
    by_the_prior = dict(zip(FITTED, whole_deviations(np.diag(prior_deviations(settings) ** 2)), strict=True))
    assert by_the_prior["height"] == settings.scale_deviation and by_the_prior["girth_arms"] == settings.girth_deviation
    assert by_the_prior["pelvis_flesh_forward"] == pytest.approx(settings.place_deviation)
    assert by_the_prior["legs_longer_left"] == by_the_prior["arms_longer_left"] == settings.asymmetry_deviation
    assert by_the_prior["thigh"] == pytest.approx(np.hypot(settings.scale_deviation, settings.length_deviation))
    # A thigh that grows as the scale shrinks is known however little is known of either.
    covariance = np.diag(prior_deviations(settings) ** 2)
    height, thigh = FITTED.index("height"), FITTED.index("thigh")
    covariance[np.ix_([height, thigh], [height, thigh])] = [[0.01, -0.01], [-0.01, 0.01]]
    assert whole_deviations(covariance)[thigh] == pytest.approx(0, abs=1e-12)


def test_what_frames_show_is_known_better_than_by_the_prior_and_no_frame_makes_it_worse():
    acted = act("gesture", cameras=7, height_m=1.75)
    objectives, states = start(acted, 1.7)
    coordinates, settings = surface_coordinates(objectives[0].body, 200), FitBodySettings(iterations=1)
    by_the_prior = whole_deviations(np.diag(prior_deviations(settings) ** 2))
    few, many = (np.array(fit_body(objectives[:n], states[:n], coordinates, settings)[2].deviations) for n in (1, 6))
    assert (few < by_the_prior).all() and (many < by_the_prior).all()
    shown = [FITTED.index(name) for name in ("height", "thigh", "shank", "trunk", "girth_torso")]
    assert (many[shown] < 0.5 * by_the_prior[shown]).all()
    nothing = fit_body(objectives, states, coordinates, FitBodySettings(iterations=0))[2].deviations
    assert_allclose(nothing, by_the_prior)
