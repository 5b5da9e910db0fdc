"""Parts inside one another: depths against plain loops, the way out against finite differences."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from posed import body_of, crossed_arms, with_cylinders

from hmc.body.cone_maps import cone_maps
from hmc.body.flesh import place_points
from hmc.body.joints import N_DOF, SEGMENTS, dof_index
from hmc.body.kinematics import segment_transforms
from hmc.body.model import PARTS, neutral_state
from hmc.body.penetration import axis_points, penetration_depth, penetration_rows
from hmc.body.proportions import canton_body, default_body

BODY, _ = body_of()
AXES = axis_points(BODY)
PART_OF = {s.name: PARTS.index(s.name) for s in SEGMENTS if s.name in PARTS}


def depth_of(state, body=BODY, axes=AXES) -> np.ndarray:
    rotations, positions = segment_transforms(body, np.atleast_2d(state))
    return penetration_depth(body, axes, rotations, positions)


def point_parts(axes=AXES) -> np.ndarray:
    """Part of every axis point."""
    return np.array([PART_OF[SEGMENTS[s].name] for s in axes.segment])


def test_points_lie_on_the_axes_of_the_limbs():
    cones = BODY.cones
    for point, segment in zip(AXES.points, AXES.segment, strict=True):
        nearest = np.inf
        for c in np.flatnonzero(cones.segment == segment):
            t = np.clip((point - cones.start[c]) @ (cones.end[c] - cones.start[c]) / cones.lengths[c] ** 2, 0, 1)
            nearest = min(nearest, np.linalg.norm(point - cones.start[c] - t * (cones.end[c] - cones.start[c])))
        assert nearest < 1e-9
    assert {PARTS[p] for p in point_parts()} == set(PARTS) - {"torso", "head"}


def test_neighbours_may_touch():
    for part, against in zip(point_parts(), AXES.against, strict=True):
        foes = {PARTS[p] for p in BODY.cones.part[against]}
        side, kind = PARTS[part][0], PARTS[part][2:]
        limb = ("upper_arm", "forearm") if kind in ("upper_arm", "forearm") else ("thigh", "shank")
        assert not foes & {f"{side}_{name}" for name in limb}
        other = "r" if side == "l" else "l"
        assert {f"{other}_{name}" for name in limb} <= foes
        assert kind == "thigh" or "torso" in foes


@pytest.mark.parametrize("make", [default_body, canton_body])
def test_nothing_is_inside_anything_when_standing(make):
    body = make(1.7)
    for arms in ("down", "sideways"):
        state = neutral_state(arms, body.limits)
        state[dof_index("l_hip_x", "r_hip_x")] = 0.1, -0.1
        assert depth_of(state, body, axis_points(body)).max() == 0


def test_depths_equal_a_loop():
    rng = np.random.default_rng(0)
    states = np.stack([crossed_arms(), *(crossed_arms() + rng.normal(0, 0.3, (5, N_DOF)))])
    found = depth_of(states)
    rotations, positions = segment_transforms(BODY, states)
    cones = BODY.cones
    for n in range(len(states)):
        world = place_points(rotations[n], positions[n], AXES.points, AXES.segment)
        for k, point in enumerate(world):
            deepest = 0.0
            for c in np.flatnonzero(AXES.against[k]):
                x, y, along = cones.bases[c] @ (
                    rotations[n, cones.segment[c]].T @ (point - positions[n, cones.segment[c]]) - cones.start[c]
                )
                if 0 < along < cones.lengths[c]:
                    a, b = cones.radii[c, 0] + along / cones.lengths[c] * (cones.radii[c, 1] - cones.radii[c, 0])
                    deepest = max(deepest, (1 - np.hypot(x / a, y / b)) * min(a, b))
            assert found[n, k] == pytest.approx(deepest, abs=1e-9)
    assert (found > 0).any()


def test_depth_in_a_cylinder_in_closed_form():
    """A forearm carried straight through the other one: its points are as deep as the radius less their distance from that axis."""
    body = with_cylinders(BODY, 0.06)
    axes = axis_points(body)
    state = crossed_arms()
    rotations, positions = segment_transforms(body, state)
    found = penetration_depth(body, axes, rotations[None], positions[None])[0]
    cones = body.cones
    world = place_points(rotations, positions, axes.points, axes.segment)
    start = np.array([rotations[s] @ p + positions[s] for s, p in zip(cones.segment, cones.start, strict=True)])
    end = np.array([rotations[s] @ p + positions[s] for s, p in zip(cones.segment, cones.end, strict=True)])
    along = np.einsum("kcj,cj->kc", world[:, None] - start, (end - start) / ((end - start) ** 2).sum(1, keepdims=True))
    distance = np.linalg.norm(world[:, None] - (start + along[..., None] * (end - start)), axis=-1)
    inside = (along > 0) & (along < 1) & axes.against
    expected = np.where(inside, np.maximum(0.06 - distance, 0), 0).max(1)
    assert_allclose(found, expected, atol=1e-9)
    crossing = np.isin(point_parts(axes), [PARTS.index("l_forearm"), PARTS.index("r_forearm")])
    assert expected[crossing].max() > 0.01


def test_rows_say_the_same_as_depths_and_point_the_way_out():
    body = with_cylinders(BODY, 0.06)
    axes = axis_points(body)
    rng = np.random.default_rng(3)
    for state in crossed_arms() + np.stack([np.zeros(N_DOF), *rng.normal(0, 0.1, (3, N_DOF))]):
        rotations, positions = segment_transforms(body, state)
        maps = cone_maps(body.cones, np.concatenate([rotations, positions[..., None]], axis=-1)[..., None])
        depth, outward, points, segment, other = penetration_rows(body, axes, rotations, positions, maps)
        assert_allclose(depth, penetration_depth(body, axes, rotations[None], positions[None])[0], atol=1e-12)
        assert_allclose(np.linalg.norm(outward, axis=1), 1)
        assert_allclose(points, place_points(rotations, positions, axes.points, axes.segment))
        assert_allclose(segment, axes.segment)
        for k in np.flatnonzero(depth > 0.005):
            # Moved out along the way by less than its depth, the point is that much less deep in this cone.
            local = (points[k] + 0.004 * outward[k] - positions[other[k]]) @ rotations[other[k]]
            before = (points[k] - positions[other[k]]) @ rotations[other[k]]
            depths = []
            for at in (before, local):
                best = 0.0
                for c in np.flatnonzero((body.cones.segment == other[k]) & axes.against[k]):
                    x, y, along = body.cones.bases[c] @ (at - body.cones.start[c])
                    if 0 < along < body.cones.lengths[c]:
                        best = max(best, 0.06 - np.hypot(x, y))
                depths.append(best)
            assert depths[0] - depths[1] == pytest.approx(0.004, abs=1e-9)


def test_single_precision_gives_the_same():
    states = crossed_arms() + np.random.default_rng(1).normal(0, 0.2, (20, N_DOF))
    rotations, positions = segment_transforms(BODY, states)
    single = penetration_depth(BODY, AXES, rotations.astype(np.float32), positions.astype(np.float32))
    assert single.dtype == np.float32
    assert_allclose(single, depth_of(states), atol=1e-5)


def test_as_many_points_for_any_body():
    for height in (1.2, 1.6, 2.1):
        assert axis_points(default_body(height)).points.shape == AXES.points.shape
    larger = axis_points(default_body(1.78 * 1.01))
    assert_allclose(larger.points, 1.01 * AXES.points, atol=1e-9)
