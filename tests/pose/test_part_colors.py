"""What colors of parts say, against loops over patches and points."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from standing import BODY, RIG, SIDES, SKIN, STATE

from hmc.body.limbs import LIMBS
from hmc.body.model import PARTS
from hmc.camera.model import project
from hmc.landmarks import LANDMARKS
from hmc.pose.part_colors import (
    ANOTHER,
    KINDS,
    MOST_NATS,
    FrameColors,
    PartColors,
    Shown,
    count_colors,
    gains,
    learn_part_colors,
    no_counts,
    shown,
)
from hmc.pose.views.color_patches import CHROMA, MOST_OF, N_BINS, OUTSIDE, STEPS, patch_bins, patch_shape


def test_bins_of_patches_are_those_of_a_loop():
    rng = np.random.default_rng(5)
    camera, side = RIG[0], 7
    width, height = camera.size
    image = rng.integers(0, 256, (height, width, 3), np.uint8)
    mask = cv2.blur(rng.random((height, width)), (25, 25)) > 0.5
    mask[:40] = False
    got = patch_bins(camera, image, mask, side).reshape(patch_shape(camera, side))
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB)
    counted = 0
    for (row, column), found in np.ndenumerate(got):
        box = slice(row * side, (row + 1) * side), slice(column * side, (column + 1) * side)
        own = lab[box][mask[box]]
        if len(own) < MOST_OF * side * side:
            assert found == OUTSIDE
            continue
        mean = own.mean(axis=0) - [0, 128 - CHROMA, 128 - CHROMA]
        lightness, a, b = np.clip(mean / [256 / STEPS, 2 * CHROMA / STEPS, 2 * CHROMA / STEPS], 0, STEPS - 1).astype(int)
        assert found == (lightness * STEPS + a) * STEPS + b
        counted += 1
    assert counted > 100


def test_an_empty_silhouette_has_no_colors():
    width, height = RIG[0].size
    bins = patch_bins(RIG[0], np.zeros((height, width, 3), np.uint8), np.zeros((height, width), bool), 5)
    assert (bins == OUTSIDE).all() and len(bins) == np.prod(patch_shape(RIG[0], 5))


def test_hands_are_beyond_the_wrists_and_nothing_else_is():
    hand = SKIN.kind == KINDS.index("hand")
    assert {PARTS.index(f"{side}_forearm") for side in "lr"} and hand.sum() > 10
    wrist = abs(BODY.tips[LANDMARKS.index("l_wrist"), 1])
    assert (np.abs(SKIN.points[hand, 1]) > wrist).all()
    assert (np.abs(SKIN.points[SKIN.kind == KINDS.index("forearm"), 1]) <= wrist + 1e-6).all()


def test_the_nearest_skin_is_shown_as_a_loop_finds_it():
    camera, side = RIG[2], SIDES[2]
    points = SKIN.placed(BODY, STATE)
    seen = shown(camera, side, [(SKIN, points)])
    nearest: dict[int, tuple[float, int]] = {}
    columns = patch_shape(camera, side)[1]
    uv, valid = project(camera, points)
    for k, (u, v) in enumerate(uv):
        row, column = int(np.floor(v + 0.5)), int(np.floor(u + 0.5))
        if valid[k] and 0 <= column < camera.size[0] and 0 <= row < camera.size[1]:
            depth = float(points[k] @ camera.rotation[2] + camera.translation[2])
            patch = row // side * columns + column // side
            if patch not in nearest or depth < nearest[patch][0]:
                nearest[patch] = depth, k
    assert seen.patch.tolist() == sorted(nearest)
    assert seen.kind.tolist() == [SKIN.kind[nearest[patch][1]] for patch in sorted(nearest)]


@pytest.mark.parametrize("name", ["l_arm", "r_leg"])
def test_gains_are_what_the_whole_person_says_less_what_is_said_without_the_limb(name):
    """Of every place of the limb, by looking at the person anew; another person hides some of it."""
    rng = np.random.default_rng(5)
    chain = 1 + list(LIMBS).index(name)
    other = STATE.copy()
    other[:2] += 0.35
    before = SKIN.of_another(), SKIN.placed(BODY, other)
    ratio = rng.normal(0, 1, (len(RIG), len(KINDS), N_BINS)).astype(np.float32)
    colors = PartColors(ratio, np.zeros(ratio.shape[:2], np.float32))
    bins = {k: rng.integers(-1, N_BINS, int(np.prod(patch_shape(RIG[k], SIDES[k])))).astype(np.int16) for k in (0, 1, 4)}
    frame = FrameColors({k: SIDES[k] for k in bins}, bins)
    states = np.repeat(STATE[None], 6, axis=0)
    states[:, LIMBS[name].dofs] += rng.normal(0, 0.4, (6, 4))
    limb, rest = SKIN.where(SKIN.chain == chain), SKIN.where(SKIN.chain != chain)
    without = {k: shown(RIG[k], SIDES[k], [before, (rest, rest.placed(BODY, STATE))]) for k in bins}
    got = gains(RIG, colors, frame, without, (limb.placed(BODY, states), limb.kind))
    for k, state in enumerate(states):
        whole = {k: shown(RIG[k], SIDES[k], [before, (SKIN, SKIN.placed(BODY, state))]) for k in bins}
        said = [sum(_said(colors, k, seen[k], bins[k]) for k in bins) for seen in (whole, without)]
        assert got[k] == pytest.approx((said[0] - said[1]) / 3, abs=1e-4)
    assert np.ptp(got) > 0.1


def _said(colors: PartColors, camera: int, seen: Shown, bins: np.ndarray) -> float:
    told = [
        colors.ratio[camera, kind, bins[patch]]
        for patch, kind in zip(seen.patch, seen.kind, strict=True)
        if kind != ANOTHER and bins[patch] != OUTSIDE
    ]
    return float(np.sum(told))


def _learnt(color_of_kind: list[int]) -> PartColors:
    counts = no_counts(RIG)
    for camera in range(len(RIG)):
        kind = np.repeat(np.arange(len(KINDS)), 100)
        bins = np.array(color_of_kind, np.int16)[kind]
        place = np.arange(len(kind))
        count_colors(counts, camera, Shown(place, np.ones(len(kind)), kind, np.zeros_like(kind), place), bins, [0])
    return learn_part_colors(counts)


def test_each_part_is_borne_out_by_its_own_color_alone():
    own = [40, 90, 140, 190, 240, 290, 340]
    ratio = _learnt(own).ratio
    at_own = ratio[0][:, own]
    assert (np.diag(at_own) > 1).all() and np.abs(ratio).max() <= MOST_NATS
    assert (at_own[~np.eye(len(KINDS), dtype=bool)] < -0.5).all()
    # What a part's colors usually say is less than that of its middle: light and shade move them.
    assert (_learnt(own).usual[0] > 0.5).all() and (_learnt(own).usual[0] < np.diag(at_own)).all()


def test_a_person_of_one_color_and_one_who_was_hardly_seen_say_nothing():
    plain = _learnt([200] * len(KINDS))
    assert np.abs(plain.ratio).max() < 1e-6 and np.abs(plain.usual).max() < 1e-6
    assert not learn_part_colors(no_counts(RIG)).ratio.any()


def test_colors_of_other_people_and_of_doubtful_limbs_are_not_learnt():
    counts = no_counts(RIG)
    seen = Shown(np.arange(4), np.ones(4), np.array([0, ANOTHER, 2, 2]), np.array([0, ANOTHER, 1, 2]), np.arange(4))
    count_colors(counts, 1, seen, np.array([5, 5, 6, 7], np.int16), [0, 1])
    assert counts.sum() == 2 and counts[1, 0, 5] == counts[1, 2, 6] == 1
