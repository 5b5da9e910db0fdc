"""The parts of the particle filter and of Sparse Sampling against loops and closed forms."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.errors import InputError
from hmc.tracking.appearance import N_COLORS, adapt, bhattacharyya, color_bins, histogram, similar_colors
from hmc.tracking.particle import ParticleSettings, color_likelihood, overlap
from hmc.tracking.settings import CANTON_2009
from hmc.tracking.sparse import SparseSettings, neighbourhood_counts, pseudo_likelihood, spread_out
from hmc.tracking.surroundings import blocking
from hmc.tracking.trackers import make_tracker


@pytest.mark.parametrize("radius", [1, 2, 3])
def test_neighbourhoods_are_counted_as_by_a_loop(radius):
    rng = np.random.default_rng(radius)
    volumes = rng.random((2, 9, 8, 12)) < 0.4
    voxels = [np.argwhere(volume) + offset for volume, offset in zip(volumes, (3, 40), strict=True)]
    codes = [rng.integers(1, 50, len(part)) for part in voxels]
    samples = [rng.integers(0, 14, (30, 3)) + offset for offset in (0, 37)]
    person = np.repeat([0, 1], 30)
    sums, own = neighbourhood_counts(
        np.concatenate(voxels),
        np.concatenate(codes),
        np.repeat([0, 1], [len(part) for part in voxels]),
        np.concatenate(samples),
        person,
        radius,
    )
    expected_sums, expected_own = [], []
    for mine, values, cells in zip(voxels, codes, samples, strict=True):
        for cell in cells:
            near = np.abs(mine - cell).max(axis=1)
            expected_sums.append(values[near <= radius].sum())
            expected_own.append(values[near == 0].sum())
    assert np.array_equal(sums, expected_sums) and np.array_equal(own, expected_own)


def test_a_person_without_samples_between_others_does_no_harm():
    voxels = np.array([[0, 0, 0], [5, 5, 5], [9, 9, 9]])
    sums, _ = neighbourhood_counts(voxels, np.array([1, 2, 4]), np.array([0, 1, 2]), np.array([[0, 0, 1], [9, 9, 9]]), np.array([0, 2]), 2)
    assert list(sums) == [1, 4]


def test_the_pseudo_likelihood_is_the_papers():
    counts = np.array([0, 125, 60, 60 + (10 << 10) + (4 << 20)])
    values = pseudo_likelihood(counts, np.ones(4), SparseSettings(raw_share=0.7), np.array([False, False, False, True]))
    raw = 1 - abs(2 * 60 / 125 - 1)
    assert np.allclose(values, [0, 0, raw, 0.7 * raw + 0.3 * 4 / 10])
    assert np.array_equal(pseudo_likelihood(counts, np.zeros(4), SparseSettings()), np.zeros(4))
    assert pseudo_likelihood(counts, np.zeros(4), SparseSettings(solid=False), False)[2] == pytest.approx(raw)


@given(st.integers(0, 2**32 - 1), st.integers(1, 400), st.integers(1, 9))
@settings(max_examples=60, deadline=None)
def test_no_two_samples_of_a_person_share_a_voxel(seed, n, spread):
    rng = np.random.default_rng(seed)
    samples = rng.integers(-spread, spread + 1, (n, 3))
    person = np.sort(rng.integers(0, 3, n))
    moved, whose = spread_out(rng, samples, person)
    rows = np.column_stack([whose, moved])
    assert len(np.unique(rows, axis=0)) == len(rows) <= n
    assert np.all(np.diff(whose) >= 0)
    for k in range(3):
        wanted, got = samples[person == k], moved[whose == k]
        assert {tuple(cell) for cell in wanted} <= {tuple(cell) for cell in got}  # who comes first stays
        if len(wanted):  # nobody goes further than to a neighbour
            assert np.abs(got[:, None] - wanted).max(axis=2).min(axis=1).max() <= 1


def test_a_sample_that_finds_no_room_is_dismissed():
    moved, _ = spread_out(np.random.default_rng(0), np.zeros((100, 3), int), np.zeros(100, int))
    assert len(moved) == 27


def test_overlap_is_that_of_a_loop_over_voxels():
    rng = np.random.default_rng(4)
    size, origin = 0.08, np.array([-1.0, -0.8, 0.0])
    volume = rng.random((30, 26, 24)) < 0.5
    centres = rng.uniform([-0.9, -0.7, 0.5], [1.3, 1.2, 1.3], (12, 3))
    radii = np.column_stack([np.full((12, 2), 0.3), centres[:, 2]])
    far = np.indices((60, 60, 60)).reshape(3, -1).T - 15
    places = origin + size * (far + 0.5)
    occupied = np.zeros(len(far), bool)
    within = np.all((far >= 0) & (far < volume.shape), axis=1)
    occupied[within] = volume[tuple(far[within].T)]
    expected = []
    for centre, radius in zip(centres, radii, strict=True):
        inside = (((places - centre) / radius) ** 2).sum(axis=1) <= 1
        expected.append(occupied[inside].sum() / inside.sum())
    assert np.allclose(overlap(np.argwhere(volume), centres, radii, origin, size), expected, atol=1e-12)
    assert np.array_equal(overlap(np.zeros((0, 3), int), centres, radii, origin, size), np.zeros(12))


def test_color_likelihood_is_that_of_a_loop_over_particles():
    rng = np.random.default_rng(5)
    points, colors = rng.uniform(-0.6, 0.6, (300, 3)) + (3, -2, 0.9), rng.integers(0, 40, 300)
    centres = rng.uniform(-0.5, 0.5, (15, 3)) + (3, -2, 0.9)
    centres[0] = 50
    radii = np.column_stack([np.full((15, 2), 0.3), centres[:, 2]])
    reference = np.zeros(N_COLORS)
    reference[:30] = 1 / 30
    expected = [0.0]
    for centre, radius in zip(centres[1:], radii[1:], strict=True):
        mine = colors[(((points - centre) / radius) ** 2).sum(axis=1) <= 1]
        counts = np.bincount(mine, minlength=N_COLORS) / max(len(mine), 1)
        expected.append(sum(np.sqrt(counts[b] * reference[b]) for b in range(40)))
    assert np.allclose(color_likelihood(points, colors, centres, radii, reference), expected)
    assert np.array_equal(color_likelihood(points[:0], colors[:0], centres, radii, reference), np.zeros(15))


def test_bins_are_those_of_opencvs_color_space():
    bgr = np.random.default_rng(1).integers(0, 256, (2000, 3)).astype(np.uint8)
    y, cr, cb = np.moveaxis(cv2.cvtColor(bgr[None], cv2.COLOR_BGR2YCrCb)[0].astype(int), 1, 0)
    bins = color_bins(bgr)
    edges = np.arange(1, 21) * 256 / 21
    safe = np.all([np.abs(channel[:, None] - edges).min(axis=1) > 1 for channel in (y, cb, cr)], axis=0)  # OpenCV rounds
    expected = (y * 21 // 256 * 21 + cb * 21 // 256) * 21 + cr * 21 // 256
    assert safe.mean() > 0.4 and np.array_equal(bins[safe], expected[safe])
    assert list(color_bins(np.full((1, 3), np.nan))) == [-1]


def test_histograms():
    seen = histogram(np.array([5, 5, 7, -1, -2]))
    assert seen.size == N_COLORS and seen[5] == pytest.approx(2 / 3) and seen.sum() == pytest.approx(1)
    assert histogram(np.array([-1])).size == 0
    other = histogram(np.array([7]))
    assert np.allclose(adapt(seen, other, 0.9), 0.9 * seen + 0.1 * other)
    assert adapt(seen, np.zeros(0), 0.9) is seen and adapt(np.zeros(0), other, 0.9) is other
    assert bhattacharyya(seen, seen) == pytest.approx(1) and bhattacharyya(seen, other) == pytest.approx(np.sqrt(1 / 3))


@settings(deadline=None)
@given(st.lists(st.integers(0, 50), min_size=1, max_size=40).filter(any), st.floats(0.05, 1.0))
def test_similar_colors_are_the_fewest_that_hold_the_share(values, share):
    reference = np.array(values) / sum(values)
    similar = similar_colors(reference, share)
    assert reference[similar].sum() >= share - 1e-6
    least = reference[similar].min()
    assert np.all(reference[~similar] < least)
    assert reference[reference > least].sum() < share or np.isclose(reference[reference > least].sum(), share)


def test_exclusion_zones_are_a_product_over_the_others():
    rng = np.random.default_rng(2)
    places, centres, person = rng.uniform(-1, 1, (40, 2)), rng.uniform(-1, 1, (3, 3)), rng.integers(0, 3, 40)
    expected = [
        np.prod([1 - np.exp(-5 * ((place - centres[k, :2]) ** 2).sum()) for k in range(3) if k != mine])
        for place, mine in zip(places, person, strict=True)
    ]
    assert np.allclose(blocking(places, person, centres, 5.0), expected)
    assert np.array_equal(blocking(places, person, centres, 0.0), np.ones(40))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "kalman"}, "no tracker `kalman`"),
        ({"preset": "quick"}, "`sparse` has no preset `quick`"),
        ({"name": "naive", "color": True}, "`naive` does not use colors"),
        ({"name": "naive", "particles": 5}, "`naive` has no particles"),
        ({"particles": 0}, "`samples` must be 1 or more"),
        ({"name": "particle", "particles": 0}, "`particles` must be 1 or more"),
    ],
)
def test_wrong_choices_are_one_line(arguments, message):
    with pytest.raises(InputError, match=message):
        make_tracker(**arguments)


def test_choices():
    assert make_tracker("sparse", particles=70).settings == SparseSettings(samples=70)
    assert make_tracker("particle", color=False).settings == ParticleSettings(color=False)
    assert make_tracker("sparse", preset="canton2009").settings == SparseSettings(
        noise_m=0.1, scouts=0.0, drift=0.0, solid=False, following=CANTON_2009
    )
    assert make_tracker().color and not make_tracker("naive").color
    with pytest.raises(InputError, match="1 to 4"):
        SparseSettings(radius=5)
