"""Double occupancy: the exact count against sets of voxels, the quick estimate against the exact count and plain geometry."""

from dataclasses import replace

import numpy as np
import pytest

from hmc.body.cones import cone_distance
from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import N_DOF, dof_index
from hmc.body.kinematics import place_segments, segment_transforms
from hmc.body.model import PARTS, neutral_state
from hmc.body.proportions import canton_body, default_body
from hmc.pose.objectives.overlap import make_overlap_table, quick_overlap
from hmc.pose.objectives.overlap_exact import exact_overlap

# A first layer's spread: metres, then the root's angles, then the joints'.
SPREAD = np.r_[[0.05] * 3, [0.1] * 3, [0.2] * (N_DOF - 6)]


def particles(body, n, seed=0):
    pose = neutral_state("down", body.limits)
    states = pose + np.random.default_rng(seed).normal(0, 1, (n, N_DOF)) * SPREAD
    return np.clip(states, body.limits.low, body.limits.high)


def quick(body, flesh, states, **options):
    return quick_overlap(make_overlap_table(body, flesh, **options), place_segments(body, states, states[0, :3]))


def test_single_precision_places_segments_where_the_reference_does():
    body = canton_body(1.75)
    states = particles(body, 50)
    rotations, positions = segment_transforms(body, states)
    placed = place_segments(body, states, np.array([1.0, -2.0, 3.0]))
    assert placed.dtype == np.float32
    np.testing.assert_allclose(placed[:, :, :3].transpose(3, 0, 1, 2), rotations, atol=2e-6)
    np.testing.assert_allclose(placed[:, :, 3].transpose(2, 0, 1) + np.array([1.0, -2.0, 3.0]), positions, atol=2e-6)


@pytest.mark.parametrize("make", [default_body, canton_body])
def test_exact_count_equals_sets_of_voxels(make):
    body = make(1.75)
    flesh = flesh_points(body, 0.05)
    rotations, positions = segment_transforms(body, particles(body, 6))
    origin = np.array([0.013, -0.4, 7.0])
    ours = exact_overlap(flesh, rotations, positions, origin, 0.05)
    for n in range(6):
        world = place_points(rotations[n], positions[n], flesh.points, flesh.segment)
        voxels = [tuple(v) for v in np.floor((world - origin) / 0.05).astype(int)]
        takers: dict = {}
        for voxel, part in zip(voxels, flesh.part, strict=True):
            takers.setdefault(voxel, set()).add(part)
        for part in range(len(PARTS)):
            members = np.flatnonzero(flesh.part == part)
            assert ours[n, part] == pytest.approx(np.mean([len(takers[voxels[m]]) > 1 for m in members]))


def volume_shared(body, rotations, positions, a, b, n=200_000):
    """Volume that two parts share in one pose, by throwing points into a box around the first."""
    rng = np.random.default_rng(1)
    cones = body.cones

    def inside(points, part):
        hit = np.zeros(len(points), bool)
        for cone in np.flatnonzero(cones.part == part):
            segment = cones.segment[cone]
            hit |= cone_distance(cones, cone, (points - positions[segment]) @ rotations[segment]) <= 0
        return hit

    centre = np.mean(
        [positions[s] + rotations[s] @ (cones.start[c] + cones.end[c]) / 2 for c, s in enumerate(cones.segment) if cones.part[c] == a],
        axis=0,
    )
    reach = 0.45
    points = centre + rng.uniform(-reach, reach, (n, 3))
    return (inside(points, a) & inside(points, b)).mean() * (2 * reach) ** 3


def test_quick_estimate_is_the_shared_volume():
    # A forearm through the trunk, by hand: all else apart.
    body = default_body(1.75)
    flesh = flesh_points(body, 0.01)
    state = neutral_state("sideways", body.limits)
    state[dof_index("l_shoulder_x", "l_shoulder_y", "l_shoulder_z", "l_elbow_z")] = np.radians([-80, -90, 30, -60])
    rotations, positions = segment_transforms(body, state[None])
    estimate = quick(body, flesh, state[None], test_points=250)[0]
    volume = np.bincount(flesh.part, minlength=len(PARTS)) * 0.01**3
    part = PARTS.index("l_forearm")
    others = [q for q in range(len(PARTS)) if q != part]
    shared = sum(volume_shared(body, rotations[0], positions[0], part, other) for other in others)
    assert shared > 0.2 * volume[part]
    assert estimate[part] == pytest.approx(shared / volume[part], abs=0.05)


@pytest.mark.parametrize("make", [default_body, canton_body])
def test_quick_estimate_follows_the_exact_count(make):
    body = make(1.75)
    flesh = flesh_points(body, 0.02)
    states = particles(body, 300)
    exact = exact_overlap(flesh, *segment_transforms(body, states), np.zeros(3), 0.02)
    estimate = quick(body, flesh, states)
    assert estimate.shape == exact.shape and estimate.min() >= 0 and estimate.max() <= 1
    assert np.corrcoef(exact.mean(axis=1), estimate.mean(axis=1))[0, 1] > 0.97
    assert np.corrcoef(exact.ravel(), estimate.ravel())[0, 1] > 0.96


def test_what_the_capsules_leave_out_is_nothing():
    # With capsules so wide that every pair is tested, the same comes out.
    body = default_body(1.75)
    table = make_overlap_table(body, flesh_points(body, 0.03))
    states = particles(body, 80, seed=3)
    placed = place_segments(body, states, states[0, :3])
    everywhere = replace(table, pieces=replace(table.pieces, ends=table.pieces.ends + 10))
    np.testing.assert_allclose(quick_overlap(everywhere, placed), quick_overlap(table, placed), atol=1e-6)


def test_a_body_far_from_the_origin_overlaps_the_same():
    body = default_body(1.75)
    flesh = flesh_points(body, 0.03)
    states = particles(body, 20)
    far = quick(body, flesh, states + np.r_[400.0, -300.0, 2.0, np.zeros(N_DOF - 3)])
    np.testing.assert_allclose(far, quick(body, flesh, states), atol=0.01)


def test_limbs_stretched_out_overlap_only_at_their_joints():
    body = default_body(1.75)
    flesh = flesh_points(body, 0.02)
    estimate = dict(zip(PARTS, quick(body, flesh, neutral_state("sideways", body.limits)[None])[0], strict=True))
    assert max(estimate["l_shank"], estimate["r_forearm"]) < 0.1
    assert estimate["l_forearm"] == pytest.approx(estimate["r_forearm"], abs=0.05)
