"""The light of an image against the empty scene's: factors that are known come out, whatever people wear."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmc.camera.light import FEW, as_image, in_light_of, light_gains, luma_chroma

SIZE = (320, 240)
NOBODY = np.zeros(SIZE[::-1], bool)
ROOM = cv2.resize(np.random.default_rng(0).uniform(60, 150, (24, 32, 3)), SIZE, interpolation=cv2.INTER_LINEAR)
MEAN = luma_chroma(np.rint(ROOM).astype(np.uint8)).astype(np.float32)


def lit(light, person=None):
    """The room in a light, (3,) or (height, width, 3), perhaps with somebody of a color in a quarter of the image."""
    room = np.rint(ROOM).copy() * light
    if person is not None:
        room[60:240, 110:220] = person
    return np.clip(np.rint(room + np.random.default_rng(1).normal(0, 2, room.shape)), 0, 255).astype(np.uint8)


def field(middle, slope, bow):
    """Light that changes over the image, shape (height, width, 3)."""
    y, x = np.meshgrid(np.linspace(-1, 1, SIZE[1]), np.linspace(-1, 1, SIZE[0]), indexing="ij")
    return np.asarray(middle) * np.exp(slope * x + bow * y * y)[..., None]


@given(
    st.tuples(*[st.floats(0.6, 1.5)] * 3),
    st.floats(-0.15, 0.15),
    st.floats(-0.1, 0.1),
    st.sampled_from([None, (20, 20, 20), (200, 60, 30), (90, 140, 220)]),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_light_is_told_whatever_people_wear(middle, slope, bow, person):
    light = field(middle, slope, bow)
    off = np.abs(np.log(light_gains(lit(light, person), MEAN, NOBODY) / light[FEW]))
    # A change over the image that is hardly more than the noise is none.
    assert np.median(off) < 0.035 and np.percentile(off, 90) < 0.12


def test_shadows_of_people_are_no_change_of_the_light():
    """A soft shadow over a third of the floor, in a light of one factor: the factor alone is told."""
    y, x = np.meshgrid(np.arange(SIZE[1]), np.arange(SIZE[0]), indexing="ij")
    shadow = 1 - 0.2 * np.exp(-(((x - 160) / 70) ** 2) - ((y - 200) / 40) ** 2)
    gains = light_gains(lit(0.96 * shadow[..., None], (40, 60, 90)), MEAN, NOBODY)
    np.testing.assert_allclose(gains, 0.96, rtol=0.015)


def test_where_nothing_tells_the_light_is_as_it_was():
    image = lit((0.8, 0.9, 1.1))
    assert (light_gains(image, MEAN, ~NOBODY) == 1).all()
    assert (light_gains(np.full_like(image, 255), MEAN, NOBODY) == 1).all()
    few = ~NOBODY
    few[:16, :160] = False  # a corner of ten pixels tells of one factor, not of how it changes
    np.testing.assert_allclose(light_gains(image, MEAN, few), np.broadcast_to((0.8, 0.9, 1.1), (15, 20, 3)), rtol=0.05)


@pytest.mark.parametrize("light", [0.9, (1.05, 1.0, 0.95), field(1.0, 0.08, -0.05)])
def test_an_image_is_brought_to_the_light_of_the_empty_scene(light):
    level = in_light_of(lit(light), MEAN, NOBODY).astype(int)
    assert np.median(np.abs(level - as_image(MEAN))) <= 2
    assert abs(np.median(level - as_image(MEAN), axis=(0, 1))).max() <= 1


def test_an_image_in_the_same_light_is_left_alone():
    image = lit(1.0, (20, 20, 20))
    assert in_light_of(image, MEAN, NOBODY) is image


def test_what_is_overexposed_may_be_as_bright_as_the_scene():
    bright = MEAN.copy()
    bright[:80] = luma_chroma(np.full((80, 320, 3), 240, np.uint8))
    image = lit(1.3)
    image[:80] = 255
    assert (in_light_of(image, bright, NOBODY)[:80] >= 239).all()
