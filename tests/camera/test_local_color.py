"""Pixels that look like people and not like what surrounds them."""

import numpy as np
import pytest

from hmc.camera.local_color import learn_palette, looks_like_people, looks_like_surroundings

SKIN, CLOTH, WALL, MAT = (120, 150, 190), (200, 180, 40), (130, 155, 185), (40, 40, 40)


EVERYWHERE = np.ones((320, 240), bool)


def room_with_somebody(rng):
    """A wall of the color of skin above a dark mat; a trunk in cloth, an arm before the wall, a leg on the mat."""
    image = np.empty((320, 240, 3), float)
    image[:130], image[130:] = WALL, MAT
    parts = {"trunk": np.s_[90:170, 100:130], "arm": np.s_[95:125, 130:180], "leg": np.s_[170:206, 111:119]}
    image[parts["trunk"]] = CLOTH
    image[parts["arm"]] = image[parts["leg"]] = SKIN
    return np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8), parts


def mask_of(shape, *parts):
    mask = np.zeros(shape, bool)
    for part in parts:
        mask[part] = True
    return mask


def test_a_limb_is_told_from_the_mat_below_it_though_the_wall_has_its_color():
    image, parts = room_with_somebody(np.random.default_rng(0))
    shape = image.shape[:2]
    known = mask_of(shape, parts["trunk"], parts["arm"])
    found = looks_like_people(image, known, learn_palette([image[known]]), EVERYWHERE)
    assert found[parts["leg"]].mean() > 0.9
    nobody = ~mask_of(shape, *parts.values())
    assert found[nobody].mean() < 0.01


def test_few_pixels_are_no_palette_and_shares_add_up():
    image, parts = room_with_somebody(np.random.default_rng(1))
    assert learn_palette([image[0, :3], image[1, :3]]) is None
    palette = learn_palette([image[parts["trunk"]].reshape(-1, 3), image[parts["arm"]].reshape(-1, 3)])
    assert np.isclose(palette.shares.sum(), 1)
    cloth = np.linalg.norm(palette.colors - CLOTH, axis=1) < 15
    pixels = [image[parts[part]].size for part in ("trunk", "arm")]
    assert np.isclose(palette.shares[cloth].sum(), pixels[0] / sum(pixels), atol=0.02)


def test_what_is_like_its_surroundings_is_not_found_whatever_the_palette_says():
    image, _ = room_with_somebody(np.random.default_rng(1))
    nobody = np.zeros(image.shape[:2], bool)
    found = looks_like_people(image, nobody, learn_palette([image[10:60, 10:60].reshape(-1, 3)]), EVERYWHERE)
    assert found[:80].mean() < 0.01


def test_a_stricter_ratio_finds_less():
    image, parts = room_with_somebody(np.random.default_rng(2))
    known = mask_of(image.shape[:2], parts["trunk"], parts["arm"])
    palette = learn_palette([image[known]])
    loose, strict = (looks_like_people(image, known, palette, EVERYWHERE, ratio) for ratio in (0.0, 3.0))
    assert strict.sum() < loose.sum() and not (strict & ~loose).any()


def test_the_mat_beside_a_leg_looks_like_the_mat_around_and_the_leg_does_not():
    image, parts = room_with_somebody(np.random.default_rng(3))
    palette = learn_palette([image[mask_of(image.shape[:2], *parts.values())]])
    maybe = mask_of(image.shape[:2], np.s_[80:215, 90:190])
    found = looks_like_surroundings(image, maybe, palette, EVERYWHERE)
    assert found[175:205, 130:180].mean() > 0.95
    assert found[parts["leg"]].mean() < 0.05 and found[parts["trunk"]].mean() < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_only_what_is_asked_is_answered_and_as_a_loop_over_pixels_and_rings_has_it(seed):
    rng = np.random.default_rng(seed)
    image = (rng.integers(0, 6, (60, 40, 3)) * 25 + rng.integers(0, 20, (60, 40, 3))).astype(np.uint8)
    people, where = rng.random((60, 40)) < 0.3, rng.random((60, 40)) < 0.2
    palette = learn_palette([image[people]])

    def kernel(one, other):
        return np.exp(-np.sum((one.astype(float) - other) ** 2) / (2 * 12.0**2))

    def ratio(row, column, radii, n):
        """Of the densities of a pixel's color, among people's and on rings around it; a 60 pixels high image is .1875 of 320."""
        theirs = sum(share * kernel(image[row, column], color) for share, color in zip(palette.shares, palette.colors, strict=True))
        around = []
        for turn, radius in enumerate(radii):
            for k in range(n):
                angle = 2 * np.pi * (k + turn / len(radii)) / n
                y, x = row - round(radius * 0.1875 * np.sin(angle)), column - round(radius * 0.1875 * np.cos(angle))
                if 0 <= y < 60 and 0 <= x < 40 and not people[y, x]:
                    around.append(kernel(image[row, column], image[y, x]))
        return (theirs + 1e-3) / ((np.mean(around) if around else 0) + 1e-3)

    near, far = (looks_like(image, people, palette, where) for looks_like in (looks_like_people, looks_like_surroundings))
    assert not (near | far)[~where].any() and 0 < near.sum() < where.sum() and 0 < far.sum() < where.sum()
    for row, column in zip(*np.nonzero(where), strict=True):
        assert near[row, column] == (ratio(row, column, (12, 18, 26), 8) > np.exp(1.0))
        assert far[row, column] == (ratio(row, column, (18, 32, 48, 64, 80), 12) < np.exp(-1.5))
