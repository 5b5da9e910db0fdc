"""The four scores against a plain loop over particles and points, and the likelihoods against their equations."""

import numpy as np
import pytest
from scipy import ndimage

from hmc.body.flesh import flesh_points, place_points
from hmc.body.joints import N_DOF
from hmc.body.kinematics import segment_transforms
from hmc.body.model import PARTS, neutral_state
from hmc.body.proportions import canton_body, default_body
from hmc.pose.objectives.four_scores import (
    SCORES,
    ScoreVariances,
    log_likelihood_factorised,
    log_likelihood_global,
    make_score_table,
    observe,
    scores,
)
from hmc.voxels.grid import VoxelGrid

ROOM = np.array([[-1.5, -1.2, 0.0], [1.5, 1.3, 2.2]])


@pytest.fixture(scope="module", params=[default_body, canton_body], ids=["default body", "canton body"])
def scene(request):
    """A person's own voxels at 5 cm, and particles around the pose, two of them far off."""
    body = request.param(1.7)
    grid = VoxelGrid.from_room(ROOM, 0.05)
    pose = neutral_state("down", body.limits)
    pose[:6] = 0.213, -0.107, 0.987, 0.3, 0.02, 0.05  # in no line with the voxels
    fine = flesh_points(body, 0.02)
    index = grid.index_of(place_points(*segment_transforms(body, pose), fine.points, fine.segment))
    occupied = np.zeros(grid.shape, bool)
    occupied[tuple(index[np.all((index >= 0) & (index < grid.shape), axis=1)].T)] = True
    rng = np.random.default_rng(7)
    states = pose + rng.normal(0, 0.25, (9, N_DOF))
    states[0] = pose
    states[7, 0] += 4.0  # out of the room, and of the maps
    states[8, 2] -= 0.7  # through the floor
    return body, grid, occupied, states


def loop_scores(flesh, body, states, maps):
    """Eq. 6.13-6.16, a point at a time; also how many points lie too near a border between voxels to be sure of."""
    out = np.zeros((len(states), len(PARTS), 4))
    unsure = np.zeros((len(states), len(PARTS)), int)
    for particle, state in enumerate(states):
        rotations, positions = segment_transforms(body, state)
        world = place_points(rotations, positions, flesh.points, flesh.segment)
        voxels = [tuple(np.floor((point - maps.origin) / maps.voxel_size_m).astype(int)) for point in world]
        takers: dict = {}
        for voxel, part in zip(voxels, flesh.part, strict=True):
            takers.setdefault(voxel, set()).add(part)
        for part in range(len(PARTS)):
            members = np.flatnonzero(flesh.part == part)
            counts = np.zeros(4)
            for member in members:
                point, voxel = world[member], voxels[member]
                inside = all(0 <= v < n for v, n in zip(voxel, maps.occupancy.shape, strict=True))
                counts[0] += any(point < maps.room[0]) or any(point > maps.room[1])
                counts[1] += len(takers[voxel]) > 1
                counts[2] += not (inside and maps.occupancy[voxel])
                if flesh.is_surface[member]:
                    counts[3] += 1 - (maps.surface[voxel] / 255 if inside else 0.0)
                fraction = (point - maps.origin) / maps.voxel_size_m % 1
                near_side = np.abs(np.concatenate([point - maps.room[0], point - maps.room[1]])) < 1e-4
                unsure[particle, part] += np.any((fraction < 1e-3) | (fraction > 1 - 1e-3)) or near_side.any()
            out[particle, part] = counts / [len(members)] * np.array([1, 1, 1, len(members) / flesh.is_surface[members].sum()])
    return out, unsure


@pytest.mark.parametrize("spacing_m", [0.05, 0.08])
def test_scores_equal_a_loop_over_points(scene, spacing_m):
    body, grid, occupied, states = scene
    maps = observe(occupied, grid, ROOM)
    flesh = flesh_points(body, spacing_m)
    table = make_score_table(body, flesh)
    by_loop, unsure = loop_scores(flesh, body, states, maps)
    ours = scores(table, states, maps, exact=True)
    assert ours.shape == (len(states), len(PARTS), 4)
    difference = np.abs(ours - by_loop)
    assert np.all(difference <= (unsure / table.counts[:, 3])[..., None] + 1e-6)
    assert unsure.mean() < 0.02 * table.counts[:, 0].mean()
    # The scene exercises every score.
    assert by_loop[7, :, 0].min() == 1 and 0 < by_loop[8, PARTS.index("l_shank"), 0] <= 1
    assert by_loop[1:7, :, 2].std() > 0.01 and by_loop[1:7, :, 1].std() > 0.01


def test_the_true_pose_scores_best(scene):
    body, grid, occupied, states = scene
    table = make_score_table(body, flesh_points(body, 0.05))
    values = scores(table, states, observe(occupied, grid, ROOM))
    assert values.min() >= 0 and values.max() <= 1
    assert values[0, :, SCORES.index("empty")].max() < 0.1
    log_likelihood = log_likelihood_factorised(values, ScoreVariances().by_part())
    assert np.argmax(log_likelihood) == 0
    assert np.argmax(log_likelihood_global(values, table.counts, ScoreVariances().whole_body())) == 0


def test_the_number_of_particles_at_a_time_does_not_matter(scene):
    body, grid, occupied, states = scene
    table = make_score_table(body, flesh_points(body, 0.04))
    maps = observe(occupied, grid, ROOM)
    together = scores(table, states, maps, exact=True)
    one_by_one = np.concatenate([scores(table, state[None], maps, exact=True) for state in states])
    many = scores(table, np.repeat(states, 700, axis=0), maps)[::700]
    # The matrix product may round differently for other sizes, which can move single points across a border.
    one_point = 1.5 / table.counts[:, 3]
    assert np.all(np.abs(together - one_by_one) <= one_point[:, None])
    assert np.all(np.abs(together - many)[..., [0, 2, 3]] <= one_point[:, None])
    assert scores(table, states[:0], maps).shape == (0, len(PARTS), 4)


def test_surface_map_is_the_remapped_gaussian(scene):
    _, grid, occupied, _ = scene
    maps = observe(occupied, grid, sigma_vox=1.5)
    shell = occupied & ~ndimage.binary_erosion(np.pad(occupied, 1))[1:-1, 1:-1, 1:-1]
    smooth = ndimage.gaussian_filter(np.pad(shell, 30).astype(float), 1.5, truncate=4)
    smooth /= smooth.max()
    offset = np.rint((maps.origin - grid.origin) / grid.voxel_size_m).astype(int) + 30
    expected = smooth[tuple(slice(o, o + n) for o, n in zip(offset, maps.surface.shape, strict=True))]
    np.testing.assert_allclose(maps.surface / 255, expected, atol=0.5 / 255 + 1e-5)
    assert maps.surface.max() == 255
    inner = np.pad(occupied, 30)[tuple(slice(o, o + n) for o, n in zip(offset, maps.surface.shape, strict=True))]
    np.testing.assert_array_equal(maps.occupancy, inner)
    for array in (maps.surface, maps.occupancy):
        assert not any(np.take(array, side, axis).any() for axis in range(3) for side in (0, -1))


def test_an_empty_reconstruction_scores_worst(scene):
    body, grid, occupied, states = scene
    table = make_score_table(body, flesh_points(body, 0.08))
    values = scores(table, states, observe(np.zeros_like(occupied), grid, ROOM))
    np.testing.assert_array_equal(values[..., 2:], 1)


def test_observe_refuses_another_shape(scene):
    _, grid, occupied, _ = scene
    with pytest.raises(ValueError, match="shape"):
        observe(occupied[1:], grid)


def test_table_6_2():
    variances = ScoreVariances().by_part()
    rows = dict(zip(PARTS, variances.tolist(), strict=True))
    assert rows["torso"] == [0.01, 0.02, 0.05, 0.05]
    for part in ("head", "l_upper_arm", "r_upper_arm", "l_thigh", "r_thigh"):
        assert rows[part] == [0.01, 0.01, 0.1, 0.1]
    for part in ("l_forearm", "r_forearm", "l_shank", "r_shank"):
        assert rows[part] == [0.01, 0.01, 0.05, 0.05]


def test_likelihoods_are_the_printed_gaussians():
    rng = np.random.default_rng(0)
    values = rng.random((5, len(PARTS), 4))
    variances = ScoreVariances().by_part()
    counts = rng.integers(1, 500, (len(PARTS), 4))
    for n in range(5):
        product = 1.0
        for p in range(len(PARTS)):
            product *= np.exp(-0.5 * values[n, p] @ np.linalg.inv(np.diag(variances[p])) @ values[n, p] / 100)
        assert log_likelihood_factorised(values, variances)[n] / 100 == pytest.approx(np.log(product))
        whole = [sum(values[n, p, s] * counts[p, s] for p in range(len(PARTS))) / counts[:, s].sum() for s in range(4)]
        expected = -0.5 * sum(w * w / v for w, v in zip(whole, (0.01, 0.01, 0.1, 0.1), strict=True))
        assert log_likelihood_global(values, counts, ScoreVariances().whole_body())[n] == pytest.approx(expected)
