"""Pixels that look like people and not like what surrounds them."""

import numpy as np

from hmc.camera.local_color import learn_palette, looks_like_people, looks_like_surroundings

SKIN, CLOTH, WALL, MAT = (120, 150, 190), (200, 180, 40), (130, 155, 185), (40, 40, 40)


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
    found = looks_like_people(image, known, learn_palette([image[known]]))
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
    found = looks_like_people(image, nobody, learn_palette([image[10:60, 10:60].reshape(-1, 3)]))
    assert found[:80].mean() < 0.01


def test_a_stricter_ratio_finds_less():
    image, parts = room_with_somebody(np.random.default_rng(2))
    known = mask_of(image.shape[:2], parts["trunk"], parts["arm"])
    palette = learn_palette([image[known]])
    loose, strict = (looks_like_people(image, known, palette, ratio) for ratio in (0.0, 3.0))
    assert strict.sum() < loose.sum() and not (strict & ~loose).any()


def test_the_mat_beside_a_leg_looks_like_the_mat_around_and_the_leg_does_not():
    image, parts = room_with_somebody(np.random.default_rng(3))
    palette = learn_palette([image[mask_of(image.shape[:2], *parts.values())]])
    maybe = mask_of(image.shape[:2], np.s_[80:215, 90:190])
    found = looks_like_surroundings(image, maybe, palette)
    assert found[175:205, 130:180].mean() > 0.95
    assert found[parts["leg"]].mean() < 0.05 and found[parts["trunk"]].mean() < 0.05
