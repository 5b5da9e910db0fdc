"""Voxel graph, eigenmap, segmentation and skeleton curves, against scikit-learn, dense solvers, closed forms and drawn bodies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.sparse import csr_array
from scipy.spatial.distance import cdist
from sklearn.manifold import spectral_embedding

from hmc.camera.model import Rig, look_at
from hmc.pose.spectral.eigenmap import eigenmap
from hmc.pose.spectral.graph import GraphSettings, adjacency, build_graph, color_votes, core_nodes, face_neighbours
from hmc.pose.spectral.growing import grow_branches, printed_growing
from hmc.pose.spectral.parts import PART_NAMES
from hmc.pose.spectral.pieces import PieceSettings, limb_pieces
from hmc.pose.spectral.reading import cut_foot, read_body
from hmc.pose.spectral.segmentation import baseline_segmentation, printed_segmentation, segment_body
from hmc.pose.spectral.skeleton import curve_through, equally_spaced, extract_skeletons, site_values
from hmc.voxels.grid import VoxelGrid

SIZE = 0.03

#: Capsules of a person of 1.75 m with the arms spread: start, end, radius, and the part's place in PART_NAMES.
BODY = [
    ((0, 0, 0.92), (0, 0, 1.38), 0.13, 0),
    ((0, 0, 1.50), (0, 0, 1.66), 0.085, 1),
    ((0, 0.2, 1.38), (0, 0.82, 1.30), 0.045, 2),
    ((0, -0.2, 1.38), (0, -0.82, 1.30), 0.045, 3),
    ((0, 0.10, 0.88), (0, 0.22, 0.05), 0.065, 4),
    ((0, -0.10, 0.88), (0, -0.22, 0.05), 0.065, 5),
    ((0, 0, 1.38), (0, 0.2, 1.38), 0.06, 0),
    ((0, 0, 1.38), (0, -0.2, 1.38), 0.06, 0),
    ((0, 0, 1.38), (0, 0, 1.50), 0.05, 0),
]


def drawn(capsules, size=SIZE):
    """Voxels, centres and parts of capsules."""
    grid = VoxelGrid(np.array([-0.5, -1.2, 0.0]), size, (round(1.0 / size), round(2.4 / size), round(1.9 / size)))
    points = grid.centres().reshape(-1, 3)
    distance = []
    for start, end, radius, _ in capsules:
        a, b = np.array(start, float), np.array(end, float)
        t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distance.append(np.linalg.norm(points - a - t[:, None] * (b - a), axis=1) - radius)
    distance = np.array(distance)
    inside = distance.min(0) < 0
    parts = np.array([part for *_, part in capsules])[distance[:, inside].argmin(0)]
    return np.argwhere(inside.reshape(grid.shape)), points[inside], parts


def random_voxels(seed, n=400, side=9):
    rng = np.random.default_rng(seed)
    return np.argwhere(rng.random((side, side, side)) < n / side**3)


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_face_neighbours_are_all_pairs_at_distance_one(seed):
    voxels = random_voxels(seed)
    found = {tuple(sorted(pair)) for pair in face_neighbours(voxels).tolist()}
    a, b = np.nonzero(np.triu(np.abs(cdist(voxels, voxels) - 1) < 1e-9))
    assert found == set(zip(a.tolist(), b.tolist(), strict=True))
    assert len(found) == len(face_neighbours(voxels))


@given(st.integers(0, 10**6))
@settings(max_examples=15, deadline=None)
def test_eigenmap_solves_the_generalised_problem_of_any_graph(seed):
    rng = np.random.default_rng(seed)
    voxels = random_voxels(seed, n=int(rng.integers(3, 500)))
    graph = build_graph(voxels, SIZE, GraphSettings(core_m=0.03))
    weights = adjacency(graph)
    found = eigenmap(weights, 6)
    dense = weights.toarray()
    degree = dense.sum(1)
    joined = degree > 0
    laplacian = np.diag(degree) - dense
    residual = laplacian @ found.vectors - degree[:, None] * found.vectors * found.values
    assert np.abs(residual).max(initial=0) < 1e-5
    np.testing.assert_allclose(found.vectors.T @ (degree[:, None] * found.vectors), np.eye(len(found.values)), atol=1e-6)
    # the smallest that are not zero, as a dense solver finds them
    if joined.sum() > 1:
        values = eigh(laplacian[np.ix_(joined, joined)], np.diag(degree[joined]), eigvals_only=True)
        zeros = len(np.unique(found.labels[joined]))
        wanted = values[zeros : zeros + 6]
        assert len(found.values) == len(wanted)
        np.testing.assert_allclose(found.values, wanted, atol=1e-6)


def test_eigenmap_spans_what_scikit_learn_finds():
    voxels, _, _ = drawn(BODY)
    weights = adjacency(build_graph(voxels, SIZE))
    ours = eigenmap(weights, 6).vectors
    theirs = spectral_embedding(weights, n_components=6, eigen_solver="arpack", drop_first=True, random_state=0)
    for column in range(6):
        a, b = ours[:, column], theirs[:, column]
        assert abs(a @ b) / np.linalg.norm(a) / np.linalg.norm(b) == pytest.approx(1, abs=1e-4)


def test_eigenmap_of_nothing_and_of_single_nodes():
    for n in (0, 1, 3):
        found = eigenmap(csr_array((n, n)), 6)
        assert found.vectors.shape == (n, 0)


def test_core_nodes_have_all_six_neighbours_and_more():
    voxels = np.argwhere(np.ones((7, 7, 7), bool))
    thesis = core_nodes(voxels, SIZE, 0.0)
    degree = np.bincount(face_neighbours(voxels).ravel(), minlength=len(voxels))
    np.testing.assert_array_equal(thesis, degree == 6)
    deep = core_nodes(voxels, SIZE, 2 * SIZE)
    np.testing.assert_array_equal(deep, (np.abs(voxels - 3).max(1) <= 1))


def test_shrinking_draws_the_core_to_the_origin():
    voxels, _, parts = drawn(BODY)
    ratio = []
    for shrink in (0.0, 4.0):
        places = eigenmap(adjacency(build_graph(voxels, SIZE, GraphSettings(shrink=shrink))), 6).vectors
        far = np.linalg.norm(places, axis=1)
        ratio.append(np.median(far[parts == 0]) / np.median(far[parts >= 2]))
    assert ratio[1] < 0.85 * ratio[0]


def test_color_votes_weaken_edges_between_colors():
    # a column of voxels, the upper half red and the lower half blue in every image
    grid = VoxelGrid(np.array([-0.05, -0.05, 0.0]), 0.1, (1, 1, 10))
    rig = Rig(tuple(look_at(f"c{k}", (160, 120), [3 * np.cos(a), 3 * np.sin(a), 0.5], [0, 0, 0.5], 40) for k, a in enumerate((0, 2, 4))))
    voxels = np.argwhere(np.ones(grid.shape, bool))
    images = []
    for _ in rig:
        image = np.zeros((120, 160, 3), np.uint8)
        image[:60], image[60:] = (20, 20, 220), (220, 20, 20)
        images.append(image)
    edges = face_neighbours(voxels)
    votes, voters = color_votes(edges, voxels, grid, rig, [*images[:2], None], 40.0)
    assert (voters == 2).all()
    weights = build_graph(voxels, 0.1, GraphSettings(shrink=0), (votes, voters)).weights
    between = [k for k, edge in enumerate(edges.tolist()) if sorted(edge) == [4, 5]]
    assert weights[between[0]] == weights.min() == pytest.approx(0.2)
    assert (np.delete(weights, between) == 1.5).all()


def test_two_peaks_are_two_pieces_and_a_bump_is_none():
    heights = np.array([5, 4, 3, 2, 1, 2, 3, 3.4, 3.3, 4, 6.0])
    edges = np.stack([np.arange(10), np.arange(1, 11)], axis=1)
    found = limb_pieces(edges, heights, 0.5, PieceSettings(least_nodes=2, least_rise=1.2, widest_touch=0, apart_nodes=100))
    assert found.labels[10] == 0 and found.labels[0] == 1
    assert set(found.labels[5:].tolist()) <= {0, -1}
    assert found.count == 2


def test_parts_of_a_drawn_body():
    voxels, points, parts = drawn(BODY)
    found = segment_body(voxels, points, SIZE)
    assert found.whole, found.doubts
    best = max(np.mean(np.array([0, 1, *arms, *legs, -2])[found.labels] == parts) for arms in ((2, 3), (3, 2)) for legs in ((4, 5), (5, 4)))
    assert best > 0.87
    baseline = segment_body(voxels, points, SIZE, baseline_segmentation())
    assert np.mean(baseline.labels == -1) > 0.1  # Sundaresan's leaves the trunk unfitted


def test_printed_branches_end_by_their_distance_from_the_origin_alone():
    """Section 3.1.4.2, B-3, and A-2: the nodes that shrink are those with all six neighbours."""
    voxels, points, _ = drawn(BODY)
    settings_ = printed_segmentation()
    found = segment_body(voxels, points, SIZE, settings_)
    far = np.linalg.norm(found.places, axis=1)
    core = core_nodes(voxels, SIZE, settings_.graph.core_m)
    radius = settings_.grow.origin_radius * np.median(far[core])
    degree = np.bincount(face_neighbours(voxels).ravel(), minlength=len(voxels))
    np.testing.assert_array_equal(core, degree == 6)
    branches = [*found.branches.values()]
    assert 3 <= len(branches) <= 5
    assert all(far[branch.nodes].min() > radius for branch in branches)
    assert (found.labels[far < radius] <= 0).all()


@given(st.integers(0, 10**6), st.integers(2, 5))
@settings(max_examples=15, deadline=None)
def test_printed_branches_do_not_grow_through_the_origin_into_others(seed, count):
    """B-3: what is as near to the origin as the radius ends a branch; beyond it another one begins."""
    rng = np.random.default_rng(seed)
    directions = np.linalg.qr(rng.normal(size=(6, 6)))[0][:count] * rng.choice([-1, 1], (count, 1))
    distances = rng.uniform(0.0, rng.uniform(0.6, 1.0, count), (400, count)).T
    places = (distances[..., None] * directions[:, None] + rng.normal(0, 0.002, (count, 400, 6))).reshape(-1, 6)
    ray, far = np.repeat(np.arange(count), 400), np.linalg.norm(places, axis=1)
    branches = grow_branches(places, None, printed_growing(), radius=0.1)
    assert len(branches) == count
    for branch in branches:
        own = ray[branch.nodes[0]]
        assert (ray[branch.nodes] == own).all()
        assert len(branch.nodes) == np.count_nonzero((ray == own) & (far > 0.1))


def test_touching_hands_are_told_and_parted():
    joined = [*BODY[:2], ((0, 0.2, 1.38), (0.30, 0.36, 1.2), 0.045, 2), ((0.30, 0.36, 1.2), (0.42, 0.0, 1.1), 0.045, 2)]
    joined += [((0, -0.2, 1.38), (0.30, -0.36, 1.2), 0.045, 3), ((0.30, -0.36, 1.2), (0.42, -0.0, 1.1), 0.045, 3), *BODY[4:]]
    voxels, points, parts = drawn(joined)
    found = segment_body(voxels, points, SIZE)
    assert {"arm_1", "arm_2"} <= set(found.branches)
    for part in ("arm_1", "arm_2"):
        true = parts[found.voxels_of(part)]
        assert max(np.mean(true == 2), np.mean(true == 3)) > 0.8
    assert any("arm_1" in one and "arm_2" in one for one in found.touching)


@pytest.mark.parametrize("n", [0, 1, 5, 100])
def test_too_few_voxels_are_no_body(n):
    voxels, points, _ = drawn(BODY)
    found = read_body(voxels[:n], points[:n], SIZE, 1.75)
    assert found.status == f"{n} voxels are too few for a body"
    assert found.curves == {}


def test_a_ball_is_no_body_and_scattered_voxels_are_none():
    ball, points, _ = drawn([((0, 0, 0.9), (0, 0, 0.91), 0.3, 0)])
    assert read_body(ball, points, SIZE, 1.75).status.startswith("only")
    scattered = np.argwhere(np.ones((8, 8, 8), bool)) * 9
    assert read_body(scattered, scattered * SIZE, SIZE, 1.75).status == "the voxels fall into small pieces"


def test_a_missing_leg_is_told():
    voxels, points, _ = drawn([*BODY[:5], *BODY[6:]])
    found = segment_body(voxels, points, SIZE)
    assert "1 leg not found" in found.doubts
    assert "leg_1" in found.branches and "leg_2" not in found.branches


@given(st.integers(5, 60))
@settings(max_examples=20, deadline=None)
def test_site_values_of_a_path_are_even(n):
    edges = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    sites = site_values(edges, n)
    sites = sites if sites[0] < sites[-1] else sites[::-1]
    np.testing.assert_allclose(np.diff(sites), 1 / (n - 1), rtol=1e-3)


def test_curve_goes_through_a_noisy_arc():
    rng = np.random.default_rng(0)
    s = rng.uniform(0, 1, 600)
    angle = np.pi * s
    points = np.stack([np.cos(angle), np.sin(angle), 0 * s], axis=1) + rng.normal(0, 0.02, (600, 3))
    curve = curve_through(points, s)
    np.testing.assert_allclose(np.linalg.norm(curve[:, :2], axis=1), 1, atol=0.03)
    steps = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    assert steps.max() < 1.05 * steps.min()


def test_curves_of_a_drawn_body_run_down_its_axes():
    voxels, points, _ = drawn(BODY)
    curves = extract_skeletons(segment_body(voxels, points, SIZE), points)
    assert set(curves) == set(PART_NAMES)
    for part, curve in curves.items():
        ends = [(np.array(a, float), np.array(b, float)) for a, b, _, k in BODY[:6]]
        gap = min(max(np.linalg.norm(np.cross(p - a, (b - a) / np.linalg.norm(b - a))) for p in curve[4:-2]) for a, b in ends)
        assert gap < (0.08 if part == "trunk" else 0.04), part
    assert curves["leg_1"][0, 2] > curves["leg_1"][-1, 2]
    assert curves["trunk"][0, 2] < curves["trunk"][-1, 2]


def test_a_foot_is_cut_off_a_leg():
    leg = equally_spaced(np.array([[0, 0, 0.9], [0, 0, 0.1], [0.15, 0, 0.05]]), 30)
    cut, foot = cut_foot(leg, 0.16)
    assert cut[-1, 2] == pytest.approx(0.1, abs=0.01)
    assert foot[0] > 0.12 and abs(foot[1]) < 1e-9
