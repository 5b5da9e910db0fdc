"""A person's own dimensions, from rendered people of known stature."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose
from posed import COST, body_of, mean_error, true_state

from hmc.body.dimensions import FITTED, FitBodySettings, reshaped
from hmc.body.flesh import surface_coordinates
from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.body.proportions import DEFAULT_LENGTHS, default_body
from hmc.pose.objectives.symmetric import Symmetric, body_points
from hmc.pose.starts.fit_body import fit_body
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
    ratio = np.array([fitted.dimensions[name] / body.dimensions[name] for name in body.dimensions])
    assert np.all((ratio > 0.5) & (ratio < 2.0))
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
        return max(abs(np.log(fitted.dimensions[name] / body.dimensions[name])) for name in body.dimensions)

    assert change(strong) < 0.01 < change(weak)
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
