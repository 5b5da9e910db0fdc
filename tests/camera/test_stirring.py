"""What stirs in a camera's images: outlines that sway, not light that changes."""

import numpy as np

from hmc.camera.stirring import stirring


def images_of(n, sway, light, seed=0):
    """A dark box before a bright wall, whose edges move by so many pixels; the light changes by so many grey levels on the right."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        image = np.full((120, 160, 3), 150.0)
        left = 40 + round(sway * np.sin(1.7 * k))
        image[30:100, left : left + 20] = 60
        image[:, 100:] += light * np.sin(0.9 * k) * np.linspace(0, 1, 60)[:, None]
        yield (image + rng.normal(0, 1.5, image.shape)).clip(0, 255).astype(np.uint8)


def test_outlines_that_sway_stir_and_light_that_changes_does_not():
    images = list(images_of(12, 2, 12))
    amount, known = stirring(images, [np.zeros((120, 160), bool)] * 12)
    assert known.all()
    assert amount[35:95, 38:43].mean() > 0.5 and amount[35:95, 58:63].mean() > 0.5
    assert amount[:, 105:155].mean() < 0.2 and amount[35:95, 10:30].mean() < 0.2


def test_what_stands_still_does_not_stir_and_behind_people_nothing_is_known():
    images = list(images_of(12, 0, 0))
    people = np.zeros((120, 160), bool)
    people[:, 120:] = True
    amount, known = stirring(images, [people] * 12)
    assert amount[35:95, 38:63].mean() < 0.2
    assert not known[:, 120:].any() and known[:, :110].all() and not amount[:, 120:].any()
