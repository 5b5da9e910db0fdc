"""The nouns: random numbers for other purposes, memories, and steps around made-up proposals."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_allclose, assert_array_equal
from posed import COST, mean_error, subject_of, true_state, view_of

from hmc.body.joints import N_DOF
from hmc.body.kinematics import landmarks
from hmc.body.proportions import default_body
from hmc.errors import InputError
from hmc.pose import registry
from hmc.pose.method import (
    Capture,
    PoseMethod,
    StepInfo,
    as_found,
    begin_tracking,
    make_subject,
    other_rng,
    particles_of,
    unseen,
    with_particles,
)
from hmc.pose.registry import METHODS, pose_method, register_method
from hmc.pose.steps.polish import PolishSettings, polished
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.proposal import LEAST_SURFACE, Proposal, as_proposed
from hmc.search.filters import ParticleState

PRESET = replace(PRESETS["default"], symmetric=COST)


@pytest.mark.parametrize("seed", [7, [3, 0, 12], [1, 2**40, 5]])
def test_other_random_numbers_of_a_frame_are_the_same_whatever_was_drawn_of_the_first(seed):
    fresh, used = np.random.default_rng(seed), np.random.default_rng(seed)
    used.normal(size=100)
    assert_array_equal(other_rng(fresh, 1).random(5), other_rng(used, 1).random(5))
    drawn = [tuple(rng.random(3)) for rng in (np.random.default_rng(seed), *(other_rng(fresh, purpose) for purpose in range(1, 5)))]
    assert len(set(drawn)) == 5
    # And they draw none of the first.
    alone = np.random.default_rng(seed)
    other_rng(alone, 2).random(9)
    assert_array_equal(alone.random(4), np.random.default_rng(seed).random(4))


def test_particles_are_entries_of_a_memory_by_name():
    subject = make_subject(default_body(1.7), Capture())
    first, second = (ParticleState(np.full((4, N_DOF), k), np.arange(4.0)) for k in (1.0, 2.0))
    tracked = begin_tracking(subject, np.zeros(N_DOF), memory=with_particles(first) | with_particles(second, "_1"))
    for name, expected in (("", first), ("_1", second)):
        found = particles_of(tracked, name)
        assert_array_equal(found.particles, expected.particles)
        assert_array_equal(found.log_weights, expected.log_weights)
    alone = particles_of(tracked, "_2")
    assert_array_equal(alone.particles, [tracked.state])


def test_an_unseen_person_stays_with_what_is_remembered():
    subject = make_subject(default_body(1.7), Capture())
    before = begin_tracking(subject, np.ones(N_DOF), np.ones(N_DOF), {"own": np.arange(3)})
    after, info = unseen(before, "why not")
    assert_array_equal(after.state, before.state)
    assert not after.velocity.any() and after.memory == before.memory and info.status == "why not" and np.isnan(info.cost)


@pytest.fixture(scope="module")
def walker():
    acted = act("walk")
    subject = subject_of(acted, PRESET)
    return acted, subject, true_state(subject.body, acted, 3)


def proposing(state, **more):
    """A search that was made up, and what it was given."""
    given = []

    def propose(rng, tracked, view):
        given.append(tracked)
        return Proposal(state, state + 0.001, 0.5, 3, {"seen": np.array([len(given)])}, **more)

    return propose, given


def test_a_proposal_is_taken_as_it_is(walker):
    acted, subject, truth = walker
    propose, given = proposing(truth + 0.02, details={"error_m": 0.1}, levels=np.ones((2, N_DOF)))
    before = begin_tracking(subject, truth, memory={"own": np.ones(2)})
    after, info = as_proposed(propose)(np.random.default_rng(0), before, view_of(acted.targets[3]))
    assert given == [before]
    assert_array_equal(after.state, truth + 0.02)
    assert_allclose(after.velocity, 0.02)
    assert {name: values.tolist() for name, values in after.memory.items()} == {"seen": [1]}
    assert (info.status, info.cost, info.evaluations) == ("fitted", 0.5, 3)
    assert info.details == {"error_m": 0.1} and info.levels.shape == (2, N_DOF)


def test_a_proposal_without_a_fit_leaves_the_pose_and_keeps_what_is_remembered(walker):
    acted, subject, truth = walker
    propose, _ = proposing(truth + 0.02, status="no fit: made up")
    after, info = as_proposed(propose)(np.random.default_rng(0), begin_tracking(subject, truth, np.ones(N_DOF)), view_of(acted.targets[3]))
    assert_array_equal(after.state, truth)
    assert not after.velocity.any() and after.memory["seen"] == 1 and info.status == "no fit: made up"


@pytest.mark.parametrize("make", [as_proposed, lambda propose: polished(propose, PRESET.polish)], ids=["as proposed", "polished"])
def test_a_frame_that_shows_too_little_is_not_searched(walker, make):
    acted, subject, truth = walker
    propose, given = proposing(truth)
    few = replace(acted.targets[3], surface=acted.targets[3].surface[: LEAST_SURFACE - 1])
    before = begin_tracking(subject, truth, np.ones(N_DOF), {"own": np.ones(1)})
    for target in (None, few):
        after, info = make(propose)(np.random.default_rng(0), before, view_of(target))
        assert_array_equal(after.state, truth)
        assert after.memory == before.memory and "no hull" in info.status
    assert given == []


def test_any_proposal_is_refined_and_the_last_pose_beside_it(walker):
    acted, subject, truth = walker
    settings = PolishSettings(COST, 300, search=None)
    view = view_of(acted.targets[3])
    near = np.clip(truth + np.random.default_rng(1).normal(0, 0.06, N_DOF), subject.body.limits.low, subject.body.limits.high)
    far = truth.copy()
    far[:2] += 2.0
    found = {}
    for name, proposal, last in (("proposed", near, far), ("last", far, near), ("neither", far, far)):
        propose, _ = proposing(proposal, details={"of": name})
        step = polished(propose, settings)
        found[name], info = step(np.random.default_rng(0), begin_tracking(subject, last), view)
        assert_allclose(found[name].velocity, found[name].state - last)
        assert info.status == "fitted" and info.evaluations > 3 and info.details == {"of": name} and found[name].memory["seen"] == 1
    errors = {name: mean_error(landmarks(subject.body, one.state), acted.landmarks[3]) for name, one in found.items()}
    assert errors["proposed"] < 0.06 and errors["last"] < 0.06 < 0.2 < errors["neither"]


def test_of_a_proposal_without_a_fit_the_last_pose_is_refined_alone(walker):
    acted, subject, truth = walker
    view, settings = view_of(acted.targets[3]), PolishSettings(COST, 300, search=None)
    wrong, _ = proposing(truth, status="no fit: made up")
    last = truth.copy()
    last[:2] += 0.03
    with_it, info = polished(wrong, settings)(np.random.default_rng(0), begin_tracking(subject, last), view)
    right, _ = proposing(last)
    alone, _ = polished(right, settings)(np.random.default_rng(0), begin_tracking(subject, last), view)
    assert info.status == "fitted"
    assert_allclose(landmarks(subject.body, with_it.state), landmarks(subject.body, alone.state), atol=0.02)


# --- the registry


def still(name: str) -> PoseMethod:
    """A method that does nothing."""
    return PoseMethod(name, "made up", start=lambda *given: None, step=lambda rng, tracked, view: (tracked, StepInfo()))


def test_a_registered_method_is_found_by_its_name_and_replaces_none_of_the_packages(monkeypatch):
    monkeypatch.setattr(registry, "METHODS", dict(METHODS))
    method = still("mine")
    register_method(method, "does nothing")
    assert pose_method("mine") is method and registry.METHODS["mine"].help == "does nothing"
    with pytest.raises(InputError, match="'apf' already"):
        register_method(still("apf"))
    again = still("mine")
    register_method(again)
    assert pose_method("mine") is again and pose_method("apf").settings is not None
    with pytest.raises(InputError, match="no preset named 'other' of method mine"):
        pose_method("mine", "other")


def test_every_method_is_made_in_every_preset_and_knows_its_source():
    for name, entry in METHODS.items():
        for preset in entry.presets:
            method = pose_method(name, preset)
            assert method.name == name and method.source and method.settings is not None


def test_the_papers_presets_recover_nothing_and_decide_over_no_alternatives():
    for name, entry in METHODS.items():
        for preset in entry.presets[1:]:
            method = pose_method(name, preset)
            assert (method.recover, method.legs, method.alternatives) == (None, None, None), (name, preset)


def test_people_are_tracked_unless_detections_are_all_that_is_read():
    markers = pose_method("marker-apf")
    assert not markers.needs_tracks
    assert replace(markers, needs=frozenset({"detections", "hulls"})).needs_tracks
    keypoints = pose_method("keypoints")
    assert keypoints.needs_tracks and not keypoints.needs_hulls and not markers.needs_hulls


def test_what_a_method_has_no_use_for_is_refused():
    for given, told in (
        (("guess",), "no pose method named 'guess'; there are apf"),
        (("apf", "kehl2006"), "no preset named 'kehl2006' of method apf; there are default, canton2009"),
        (("smd", "default", ("1",)), "has no use for a scalable model"),
        (("apf", "default", (), "guess"), "--init guess: use one of"),
    ):
        with pytest.raises(InputError, match=told):
            pose_method(*given)


@pytest.mark.parametrize(
    ("name", "preset", "model", "init"),
    [
        ("apf", "canton2009", (), "spectral"),
        ("smd", "kehl2006", (), "spectral"),
        ("pso", "hsiao2008", (), "hypotheses"),
        ("marker-apf", "default", (), "spectral"),
        ("smd", "default", ("1",), None),
    ],
)
def test_a_start_or_model_that_a_method_does_not_take_is_refused(name, preset, model, init):
    with pytest.raises(InputError, match="has no use for a scalable model" if model else f"--init {init}: method {name}"):
        pose_method(name, preset, model, init)


def test_a_method_as_found_smooths_nothing_and_is_the_same_otherwise():
    method = pose_method("apf")
    assert method.back.smooth_s == 0.2 and as_found(method).back.smooth_s is None
    assert replace(as_found(method).back, smooth_s=0.2) == method.back
    one_pass = pose_method("apf", passes=1)
    assert as_found(one_pass) is one_pass
