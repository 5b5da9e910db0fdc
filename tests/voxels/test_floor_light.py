"""Person or shadow by the floor: trousers and a shadow of one darkness, drawn exactly into a room whose floor has one color."""

import cv2
import numpy as np
import pytest
from drawn import floor_patch, silhouette
from hypothesis import given
from hypothesis import strategies as st

from hmc.camera.light import in_light_of, light_gains
from hmc.camera.shade import floor_pixels
from hmc.voxels.completion import make_completion_tables
from hmc.voxels.floor_light import (
    EVERY_PX,
    LEAST_CHANCE,
    SAME_CHROMA,
    SAME_LUMA,
    UNLIKE,
    FloorEvidence,
    _median,
    floor_balance,
    floor_evidence,
    person_by_floor,
    tell_shades,
)
from hmc.voxels.floor_shadows import Scene, lit_views
from hmc.voxels.frontend_settings import FrontendSettings
from hmc.voxels.hulls import settle
from hmc.voxels.looks import Look

ROOM = np.array([[-2.5, -2.5, 0.0], [2.5, 2.5, 2.2]])
FLOOR, WALL, DARK = (110, 125, 140), (190, 170, 150), 0.6


@pytest.fixture(scope="module")
def tables(ring):
    return make_completion_tables(ROOM, ring)


@pytest.fixture(scope="module")
def people(ring):
    return [silhouette(camera, 0.3, 0.1) for camera in ring]


@pytest.fixture(scope="module")
def shadows(ring, people):
    return [floor_patch(camera) & ~person for camera, person in zip(ring, people, strict=True)]


@pytest.fixture(scope="module")
def floors(ring):
    return [floor_pixels(camera, ROOM) for camera in ring]


def scene_of(image):
    return Scene(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb).astype(np.float32))


def empty_images(floors):
    return [np.where(floor[..., None], FLOOR, WALL).astype(np.uint8) for floor in floors]


def darkened(images, places, share=DARK):
    return [np.where(place[..., None], share * image, image).astype(np.uint8) for image, place in zip(images, places, strict=True)]


def lit(images, scenes, people=None):
    """The images in the light of their scenes."""
    people = people or [np.zeros(image.shape[:2], bool) for image in images]
    each = zip(images, scenes, people, strict=True)
    return lit_views(images, scenes, [None if scene is None else light_gains(image, scene.mean, person) for image, scene, person in each])


def guesses(places, chance):
    return [np.where(place, round(255 * chance), 0).astype(np.uint8) for place in places]


def lower(people):
    """The half of each person that stands before the floor: dark trousers of the floor's color, which the camera alone has lost."""
    rows = [np.flatnonzero(person.any(axis=1)) for person in people]
    return [person & (np.arange(len(person)) > row.mean())[:, None] for person, row in zip(people, rows, strict=True)]


@pytest.fixture(scope="module")
def told(tables, people, shadows, floors):
    """All that is darker guessed as a person's with a chance of .3, with half of the shadow in the silhouettes all the same."""
    trousers = [legs & floor for legs, floor in zip(lower(people), floors, strict=True)]
    empty = empty_images(floors)
    dark = [legs | shadow for legs, shadow in zip(trousers, shadows, strict=True)]
    images = darkened(empty, dark)
    halves = [shadow & (np.arange(shadow.shape[1]) % 40 < 20) for shadow in shadows]
    masks = [(person & ~legs) | half for person, legs, half in zip(people, trousers, halves, strict=True)]
    after = tell_shades(tables, lit(images, [scene_of(image) for image in empty]), guesses(dark, 0.3), masks)
    return trousers, halves, masks, after


def test_trousers_before_the_bare_floor_are_a_persons(told):
    for legs, _, mask, after in zip(*told, strict=True):
        assert (mask & legs).sum() == 0
        assert (after & legs).sum() > 0.85 * legs.sum()


def test_what_others_see_as_dark_is_a_shadow(told, shadows):
    taken = left = 0
    for legs, half, _, after, shadow in zip(*told, shadows, strict=True):
        middle = cv2.erode((shadow & ~legs).view(np.uint8), np.ones((5, 5), np.uint8)) > 0
        taken += (half & middle).sum()
        left += (after & middle).sum()
    assert taken > 100 and left < 0.1 * taken


def test_a_table_hides_the_floor_and_tells_nothing(tables, people, shadows, floors):
    """A shadow on a table top: behind it the others see a lit floor, of another color than the table's."""
    empty = empty_images(floors)
    empty[0] = np.where(shadows[0][..., None], (60, 90, 160), empty[0]).astype(np.uint8)
    only = [shadows[0], *(np.zeros_like(shadow) for shadow in shadows[1:])]
    images = darkened(empty, only)
    scenes = [scene_of(image) for image in empty]
    done = tell_shades(tables, lit(images, scenes), guesses(only, 0.3), people)
    assert all(after is person for after, person in zip(done, people, strict=True))
    bare = empty_images(floors)  # without the table it would be somebody
    done = tell_shades(tables, lit(darkened(bare, only), [scene_of(image) for image in bare]), guesses(only, 0.3), people)
    assert (done[0] & shadows[0]).sum() > 0.8 * shadows[0].sum()


def test_a_seat_of_nearly_the_floors_color_tells_nothing(tables, people, shadows, floors):
    """A tenth darker: on the seat the shadow is, behind it the others see a lit floor."""
    empty = empty_images(floors)
    empty[0] = np.where(shadows[0][..., None], 0.88 * empty[0], empty[0]).astype(np.uint8)
    only = [shadows[0], *(np.zeros_like(shadow) for shadow in shadows[1:])]
    done = tell_shades(tables, lit(darkened(empty, only), [scene_of(image) for image in empty]), guesses(only, 0.3), people)
    assert all(after is person for after, person in zip(done, people, strict=True))


#: How much brighter the cameras of a rig are, and how much redder, bluer: as far apart as cameras of one make are.
BRIGHTER, TINTS = (0.95, 1.1, 1.0, 1.05), ((0, 0), (6, -4), (-3, 5), (-5, -2))


def unlike_cameras(images):
    """The same room before cameras of other gain and white balance."""
    unlike = []
    for k, image in enumerate(images):
        color = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb).astype(float)
        color[..., 0] *= BRIGHTER[k % len(BRIGHTER)]
        color[..., 1:] += TINTS[k % len(TINTS)]
        unlike.append(cv2.cvtColor(np.clip(np.round(color), 0, 255).astype(np.uint8), cv2.COLOR_YCrCb2BGR))
    return unlike


def test_cameras_of_other_white_balance_see_the_same_floor(tables, people, shadows, floors):
    trousers = [legs & floor for legs, floor in zip(lower(people), floors, strict=True)]
    empty = unlike_cameras(empty_images(floors))
    images = darkened(empty, trousers)
    masks = [person & ~legs for person, legs in zip(people, trousers, strict=True)]
    after = tell_shades(tables, lit(images, [scene_of(image) for image in empty]), guesses(trousers, 0.3), masks)
    for legs, mask in zip(trousers, after, strict=True):
        assert (mask & legs).sum() > 0.85 * legs.sum()


def test_the_balance_is_how_cameras_differ_whatever_hides_a_fifth_of_each_ones_floor(tables, ring, floors):
    rng = np.random.default_rng(1)
    scenes = {}
    for c, image in enumerate(unlike_cameras(empty_images(floors))):
        scenes[c] = scene_of(image).mean
        hidden = rng.random((24, 32)) < 0.2
        rows, columns = (np.arange(size) * count // size for size, count in zip(image.shape[:2], hidden.shape, strict=True))
        scenes[c][hidden[rows][:, columns]] = rng.uniform(60, 200, 3)
    balance = np.stack(list(floor_balance(tables, scenes).values()))[..., 0]
    true = np.array([(np.log(BRIGHTER[c % 4]), *TINTS[c % 4]) for c in range(len(ring))])
    between = balance - balance[0] - (true - true[0])
    assert np.abs(between[:, 0]).max() < 0.03 and np.abs(between[:, 1:]).max() < 2


def test_a_camera_that_shares_no_floor_has_the_balance_of_the_rig(tables, ring, floors):
    scene = scene_of(empty_images(floors)[0]).mean
    for scenes in ({}, {0: scene}):
        assert all((one == 0).all() for one in floor_balance(tables, scenes).values())


@pytest.mark.filterwarnings("error")
def test_a_camera_that_sees_nothing_but_black_has_a_balance(tables, floors):
    scenes = {c: scene_of(image).mean for c, image in enumerate(empty_images(floors))}
    scenes[1] = np.zeros_like(scenes[1])
    assert all(np.isfinite(one).all() for one in floor_balance(tables, scenes).values())


def test_the_evidence_is_that_of_a_loop_over_pixels(tables, ring, people, shadows, floors):
    rng = np.random.default_rng(0)
    empty = [np.clip(image + rng.normal(0, 6, image.shape[:2])[..., None], 0, 255).astype(np.uint8) for image in empty_images(floors)]
    shares = [0.5 + 0.1 * k for k in range(len(ring))]
    images = [darkened([image], [shadow], share)[0] for image, shadow, share in zip(empty, shadows, shares, strict=True)]
    scenes = [scene_of(image) for image in empty]
    found = floor_evidence(tables, lit(images, scenes, people), guesses(shadows, 0.4), people)
    balance = floor_balance(tables, {c: scene.mean for c, scene in enumerate(scenes)})
    light = []
    for image, scene, person in zip(images, scenes, people, strict=True):
        color = cv2.GaussianBlur(cv2.cvtColor(in_light_of(image, scene.mean, person), cv2.COLOR_BGR2YCrCb), (3, 3), 0).astype(float)
        share = np.maximum(color[..., 0], 1) / scene.mean[..., 0]
        tint = np.abs(color[..., 1:] - 128 - np.minimum(share, 1)[..., None] * (scene.mean[..., 1:] - 128)).max(axis=-1)
        light.append(np.where(tint < 6, np.clip(np.log(share), -0.7, 0.1), np.nan))
    n_cells, n_told = len(tables.cell_pixels[0]), 0
    for c, one in found.items():
        told = dict(zip(one.pixels.tolist(), zip(one.light.tolist(), one.others.tolist(), strict=True), strict=True))
        width = people[c].shape[1]
        for pixel in range(0, people[c].size, 7):
            cell = int(tables.pixel_cells[c].ravel()[pixel])
            lights = []
            for other in range(len(ring)) if cell < n_cells else ():
                spot = int(tables.cell_pixels[other][cell])
                if other == c or spot >= people[other].size or people[other].ravel()[spot] or np.isnan(light[other].ravel()[spot]):
                    continue
                own, its = (scenes[k].mean.reshape(-1, 3)[place] for k, place in ((c, pixel), (other, spot)))
                usual = (balance[c] - balance[other])[:, 0]
                luma, chroma = np.log(own[0] / its[0]) - usual[0], own[1:] - its[1:] - usual[1:]
                if abs(luma) < SAME_LUMA and np.abs(chroma).max() < SAME_CHROMA:
                    lights.append(light[other].ravel()[spot])
            asked = shadows[c].ravel()[pixel] and pixel // width % EVERY_PX == 0 and pixel % width % EVERY_PX == 0
            if asked and lights and np.isfinite(light[c].ravel()[pixel]):
                assert told[pixel] == pytest.approx((light[c].ravel()[pixel], np.mean(lights)), abs=1e-4)
                n_told += 1
            else:
                assert pixel not in told
    assert n_told > 30


def chances_of(guess, light, others):
    evidence = np.broadcast_arrays(*(np.atleast_1d(np.float32(one)) for one in (guess, light, others)))
    return person_by_floor(FloorEvidence(np.arange(evidence[0].size), *evidence))


def test_the_brighter_the_spot_to_others_the_likelier_a_person():
    others = np.linspace(-0.5, 0.0, 10)
    for guess in (-4.0, 0.0, 4.0):
        assert (np.diff(chances_of(guess, -0.5, others)) > 0).all()
    even = chances_of(0.0, -0.5, others)
    assert even[0] < 0.2 and even[-1] > 0.8 and even[4:6] == pytest.approx(0.5, abs=0.12)  # half way it may be either


@pytest.mark.parametrize("guess", [-2.0, 0.0, 2.0])
def test_what_has_lost_next_to_no_light_is_what_the_guess_says(guess):
    """Grey trousers before a grey floor: whatever the others see, it cannot be less light than this camera sees."""
    others = np.linspace(-0.3, 0.05, 8)
    assert chances_of(guess, 0.0, others) == pytest.approx(1 / (1 + np.exp(-guess)), abs=1e-6)
    assert chances_of(guess, -0.01, others) == pytest.approx(1 / (1 + np.exp(-guess)), abs=0.07)


def test_a_spot_that_others_see_dark_for_another_reason_does_not_outweigh_a_sure_guess():
    odds = np.exp(4) * UNLIKE / (1 + UNLIKE)  # the most that the floor takes of them
    assert chances_of(4.0, -0.6, -0.6)[0] == pytest.approx(odds / (1 + odds), abs=1e-3)
    assert chances_of(-4.0, -0.6, 0.0)[0] == pytest.approx(1 / (1 + odds), abs=1e-3)
    assert chances_of(4.0, -0.6, -0.6)[0] > 0.5 and chances_of(-4.0, -0.6, 0.0)[0] < LEAST_CHANCE


def test_cameras_without_an_empty_scene_or_a_mask_neither_tell_nor_are_told(tables, people, shadows, floors):
    empty = empty_images(floors)
    images, chances = darkened(empty, shadows), guesses(shadows, 0.3)
    assert tell_shades(tables, lit(images, [None] * len(images)), chances, people) == tuple(people)
    one = [scene_of(empty[0]), *[None] * (len(images) - 1)]  # nobody to ask
    assert tell_shades(tables, lit(images, one), chances, people) == tuple(people)
    scenes = [scene_of(image) for image in empty]
    done = tell_shades(tables, lit(images, scenes), [None, *chances[1:]], [*people[:2], None, *people[3:]])
    assert done[0] is people[0] and done[2] is None


def test_what_the_network_is_sure_of_is_not_cut_for_the_floor_alone(tables, people, shadows, floors):
    """Shoes of the floor's color stand in their own shadow: all cameras see the spot as dark."""
    empty = empty_images(floors)
    images, none = darkened(empty, shadows), (None,) * len(empty)
    masks = tuple(person | shadow for person, shadow in zip(people, shadows, strict=True))
    scenes = tuple(scene_of(image) for image in empty)

    def left(chances):
        look = Look(0, tuple(images), masks, none, none, chances, none, scenes, ())
        after, _ = settle(tables, look, FrontendSettings(complete=False))
        return sum(int((mask & shadow & ~person).sum()) for mask, shadow, person in zip(after, shadows, people, strict=True))

    whole = sum(int((shadow & ~person).sum()) for shadow, person in zip(shadows, people, strict=True))
    assert left(tuple(guesses(shadows, 0.99))) > 0.9 * whole  # told, and left
    assert left(none) < 0.5 * whole  # where there was no guess, the floor decides as before
    assert left(tuple(guesses(shadows, 0.3))) < 0.2 * whole


@given(st.integers(0, 10**6), st.sampled_from([0, -1]), st.integers(1, 8), st.integers(1, 9))
def test_medians_of_what_is_seen_are_those_of_numpy(seed, axis, n, m):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(n, 3, m)).astype(np.float32)
    values[rng.random(values.shape) < 0.4] = np.nan
    values[(slice(None), slice(None), 0) if axis else (0,)] = 1  # a number everywhere
    np.testing.assert_array_equal(_median(values, axis), np.nanmedian(values, axis=axis, keepdims=True))
