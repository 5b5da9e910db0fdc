"""Particles are drawn where a frame is not as expected, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from acted import act
from numpy.testing import assert_array_equal
from posed import COST, mean_error, subject_of, true_state, view_of

from hmc.body.joints import DOF_NAMES
from hmc.body.kinematics import landmarks
from hmc.errors import InputError
from hmc.pose.method import begin_tracking
from hmc.pose.methods.annealed import annealed_pose_step
from hmc.pose.methods.scalable import SCALABLE_METHODS, method_preset
from hmc.pose.steps.polish import PolishSettings
from hmc.pose.steps.presets import PRESETS
from hmc.pose.steps.proposal import Proposal
from hmc.pose.steps.sparing import SparingSettings, sparing
from hmc.search.filters import AnnealedSettings

FEW = AnnealedSettings(layers=2, particles=50, survival_rate=0.1, spread=0.5)
PRESET = replace(PRESETS["default"], symmetric=COST, annealed=FEW)
LENIENT = replace(PRESET, sparing=replace(PRESET.sparing, ratio=1.5))


@pytest.fixture(scope="module")
def followed():
    """A walker, and the steps of eight frames."""
    acted = act("walk")
    subject, step = subject_of(acted, LENIENT), annealed_pose_step(LENIENT)
    tracked, steps = begin_tracking(subject, true_state(subject.body, acted)), []
    for frame, target in enumerate(acted.targets[:8]):
        tracked, info = step(np.random.default_rng([3, frame]), tracked, view_of(target))
        steps.append((tracked, info))
    return acted, subject, step, steps


def test_the_first_frame_has_particles_and_expected_ones_have_none(followed):
    acted, subject, _, steps = followed
    drawn = [info.annealed is not None for _, info in steps]
    assert drawn[0] and not all(drawn)
    errors = [mean_error(landmarks(subject.body, tracked.state), acted.landmarks[k]) for k, (tracked, _) in enumerate(steps)]
    assert np.mean(errors) < 0.05
    least = FEW.layers * FEW.particles
    assert all(info.evaluations >= least for (_, info), some in zip(steps, drawn, strict=True) if some)


def elsewhere(state, subject):
    """The pose with limbs where they are not."""
    moved, limits = state.copy(), subject.body.limits
    for name, by in (("l_shoulder_x", 1.5), ("r_shoulder_x", -1.5), ("l_hip_y", -1.2), ("r_knee_y", 1.0)):
        moved[DOF_NAMES.index(name)] += by
    return np.clip(moved, limits.low, limits.high)


def test_a_frame_in_which_limbs_are_elsewhere_has_particles(followed):
    """An arm thrown back and a leg kicked up since the frame before: what the last motion leads to does not fit."""
    acted, _, step, steps = followed
    tracked, _ = steps[5]
    assert step(np.random.default_rng(0), tracked, view_of(acted.targets[6]))[1].annealed is None
    lost = replace(tracked, state=elsewhere(tracked.state, tracked.subject))
    assert step(np.random.default_rng(0), lost, view_of(acted.targets[6]))[1].annealed is not None


def test_the_usual_cost_goes_from_frame_to_frame_and_stays_where_nothing_is_seen(followed):
    acted, _, step, steps = followed
    levels = np.array([float(tracked.memory["usual"]) for tracked, _ in steps])
    costs = np.log([info.cost for _, info in steps])
    assert levels[0] == costs[0] and np.all((levels >= costs.min() - 1e-12) & (levels <= costs.max() + 1e-12))
    unseen, info = step(np.random.default_rng(0), steps[3][0], replace(view_of(acted.targets[4]), target=None))
    assert "no hull" in info.status
    assert_array_equal(unseen.memory["usual"], steps[3][0].memory["usual"])


def test_scalable_models_search_every_frame_and_sparing_needs_a_refinement():
    assert all(method_preset(PRESETS["default"], name).sparing is None for name in SCALABLE_METHODS)
    assert method_preset(PRESETS["default"], "apf").sparing == PRESETS["default"].sparing is not None
    assert PRESETS["canton2009"].sparing is None
    with pytest.raises(InputError, match="sparing"):
        replace(PRESETS["canton2009"], sparing=PRESETS["default"].sparing)


@pytest.mark.parametrize("status", ["fitted", "no fit: made up"])
def test_what_a_search_proposes_is_refined_beside_what_was_refined_already(followed, status):
    """A search that goes astray, or finds nothing, loses nothing; one that is right is taken; both are asked for in lost frames alone."""
    acted, subject, _, steps = followed
    view, truth = view_of(acted.targets[6]), true_state(subject.body, acted, 6)
    asked = []

    def proposing(pose):
        def propose(rng, tracked, view):
            asked.append(view.frame)
            return Proposal(pose, pose, evaluations=7, memory={"own": np.ones(1)}, status=status)

        return sparing(propose, PolishSettings(COST, 300, search=None), SparingSettings(ratio=1.5))

    far = truth + np.r_[2.0, np.zeros(len(truth) - 1)]
    expected, _ = proposing(far)(np.random.default_rng(0), steps[5][0], view)
    assert asked == [] and "own" not in expected.memory
    lost = replace(steps[5][0], state=elsewhere(steps[5][0].state, subject), velocity=np.zeros_like(truth))
    errors, costs = [], []
    for pose in (far, truth):
        after, info = proposing(pose)(np.random.default_rng(0), lost, view)
        errors.append(mean_error(landmarks(subject.body, after.state), acted.landmarks[6]))
        costs.append(info.cost)
        assert info.status == "fitted" and info.evaluations > 7 and "own" in after.memory and "usual" in after.memory
        assert_array_equal(after.velocity, after.state - lost.state)
    assert len(asked) == 2
    assert errors[0] < 0.5  # not two metres away, where the search says
    if status == "fitted":
        assert costs[1] < costs[0] and errors[1] < 0.04 < errors[0]
    else:
        assert costs[1] == costs[0]
