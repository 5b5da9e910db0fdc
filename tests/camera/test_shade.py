"""Shades: the numbers that tell of a pixel, the network that is asked, and what it makes of cloth and of shadows."""

import cv2
import numpy as np
import pytest
from scipy import ndimage
from sklearn.neural_network import MLPClassifier

from hmc.camera.segmentation import SegmentationSettings, segment, train_background
from hmc.camera.shade import (
    FEATURES,
    ShadeNet,
    chance_map,
    default_net,
    floor_pixels,
    is_shade,
    person_chance,
    read_net,
    shade_features,
    told_by_chance,
)
from hmc.camera.silhouettes import Evidence, evidence
from hmc.errors import InputError
from hmc.io.recording import background_frames, iterate_frames, open_recording
from hmc.voxels.train_shade import PERSON_COUNTS, train_shade, write_net

SHAPE = 240, 320


@pytest.fixture(scope="module")
def scene():
    """A wall with the texture of plaster, and a figure of red cloth before it: mean, deviation, image, seeds and the evidence."""
    rng = np.random.default_rng(0)
    wall = 150 + cv2.GaussianBlur(rng.normal(0, 25, SHAPE), (0, 0), 1.5)
    image = wall.copy()
    image[60:200, 40:140] *= 0.75  # a shadow
    image[60:200, 180:280] = 110 + 6 * np.sin(np.arange(100) / 4)  # grey cloth with folds
    image = np.repeat(image[..., None], 3, axis=2)
    image[100:180, 150:170] = 40, 40, 180
    noisy = np.clip(image + rng.normal(0, 1.5, image.shape), 0, 255).astype(np.uint8)
    empty = np.repeat(np.clip(wall, 0, 255).astype(np.uint8)[..., None], 3, axis=2)
    mean = cv2.cvtColor(empty, cv2.COLOR_BGR2YCrCb).astype(np.float32)
    deviation = np.full((*SHAPE, 2), (1.5, 0.8), np.float32)
    seeds = np.zeros(SHAPE, np.uint8)
    seeds[100:180, 150:170] = 1
    return mean, deviation, noisy, seeds, evidence(noisy, mean, deviation)


def column(features, name):
    return features[:, FEATURES.index(name)]


def test_the_numbers_are_those_of_scipy(scene):
    mean, deviation, image, seeds, seen = scene
    pixels, features = shade_features(image, mean, deviation, seen, seeds, 1.0)
    rows, columns = np.unravel_index(pixels, SHAPE)
    assert len(pixels) > 5000 and features.shape == (len(pixels), len(FEATURES)) and np.isfinite(features).all()
    assert is_shade(seen).ravel()[pixels].all()
    away = ndimage.distance_transform_edt(seeds == 0)[rows, columns]
    assert np.abs(column(features, "distance") - away).max() < 0.05 * away.max()
    assert away.max() <= 60 * np.sqrt(2) + 1
    for width in (9, 21, 41):
        share = ndimage.uniform_filter(seeds.astype(float), width, mode="mirror")[rows, columns]
        np.testing.assert_allclose(column(features, f"sure_{width}"), share, atol=0.005)
    luma = cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)[..., 0], (3, 3), 0).astype(float)
    light = np.log((luma + 4) / (mean[..., 0] + 4))
    np.testing.assert_allclose(column(features, "lost"), 1 - np.exp(light[rows, columns]), atol=1e-5)
    spread = ndimage.generic_filter(light, np.std, 7, mode="mirror")[rows, columns]
    np.testing.assert_allclose(column(features, "rough_7"), spread * (mean[..., 0][rows, columns] + 4) / 1.5, rtol=0.02, atol=0.05)
    assert (column(features, "floor") == 0.5).all()


def test_a_shadow_keeps_the_texture_and_cloth_does_not(scene):
    mean, deviation, image, seeds, seen = scene
    pixels, features = shade_features(image, mean, deviation, seen, seeds, 1.0)
    rows, columns = np.unravel_index(pixels, SHAPE)
    inside = (rows > 66) & (rows < 194)
    shadow, cloth = inside & (columns > 96) & (columns < 134), inside & (columns > 186) & (columns < 220)
    left = column(features, "left_texture")
    assert np.median(left[shadow]) + 1 < np.median(left[cloth])
    chance = person_chance(default_net(), features)
    assert ((chance >= 0) & (chance <= 1)).all()
    assert np.median(chance[shadow]) < np.median(chance[cloth])


@pytest.mark.parametrize(("scale", "side"), [(1.0, 5), (0.5, 3)])
def test_chances_are_averaged_over_shades_alone(scene, scale, side):
    mean, deviation, image, seeds, seen = scene
    pixels, features = shade_features(image, mean, deviation, seen, seeds, scale)
    guess = chance_map(SHAPE, pixels, features, scale)
    shade, chance = np.zeros((2, SHAPE[0] * SHAPE[1]))
    shade[pixels], chance[pixels] = 1, person_chance(default_net(), features)
    shade, chance = shade.reshape(SHAPE), chance.reshape(SHAPE)
    assert ((guess > 0) == (shade > 0)).all() and len(pixels) > 1000
    kernel = cv2.getGaussianKernel(side, 0)[:, 0]
    smooth = [ndimage.correlate1d(ndimage.correlate1d(one, kernel, 0, mode="mirror"), kernel, 1, mode="mirror") for one in (chance, shade)]
    expected = 255 * smooth[0] / np.maximum(smooth[1], 0.2)
    assert np.abs(guess - np.maximum(expected, 1))[shade > 0].max() <= 1.001


def test_chances_of_half_the_size_tell_of_the_whole_image():
    """What is a shade in the large image is what the nearest chances say; what is none stays as it was."""
    luma = np.full((80, 120), -10.0, np.float32)
    luma[:, :20] = 0  # as the empty scene
    mask, zeros = np.zeros((80, 120), np.uint8), np.zeros((80, 120), np.float32)
    mask[10:70, 5:50] = 1
    seen = Evidence(luma, zeros, np.full_like(zeros, 0.2), zeros)
    chance = np.ones((40, 60), np.uint8)
    chance[10:30, 15:40] = 255
    told = told_by_chance(mask, seen, chance, 0.4).astype(bool)
    expected = np.zeros((80, 120), bool)
    expected[20:60, 30:80] = True
    expected[10:70, 5:20] = True
    assert (told == expected).mean() > 0.97  # but for outlines
    np.testing.assert_array_equal(told[:, :20], expected[:, :20])
    whole = told_by_chance(mask, seen, chance.repeat(2, axis=0).repeat(2, axis=1), 0.4).astype(bool)
    np.testing.assert_array_equal(whole, expected)


def test_nothing_is_asked_where_nobody_is(scene):
    mean, deviation, image, _, seen = scene
    pixels, features = shade_features(image, mean, deviation, seen, np.zeros(SHAPE, np.uint8), 1.0)
    assert len(pixels) == 0 and features.shape == (0, len(FEATURES))


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
def test_the_network_is_that_of_scikit_learn(tmp_path):
    rng = np.random.default_rng(0)
    features = rng.normal(0, 2, (12000, len(FEATURES))).astype(np.float32)
    people = features[:, 0] > features[:, 1]
    net = train_shade(features, people)
    even = PERSON_COUNTS / (PERSON_COUNTS + 1)  # people count for more
    assert np.mean((person_chance(net, features) > even) == people) > 0.9
    write_net(tmp_path / "net.csv", net, ["a note"])
    again = read_net(tmp_path / "net.csv")
    np.testing.assert_allclose(person_chance(again, features), person_chance(net, features), atol=1e-3)
    other = MLPClassifier((5,), activation="relu", max_iter=3, random_state=1).fit(features, people)
    (inner, outer), (inner_bias, outer_bias) = other.coefs_, other.intercepts_
    n = len(FEATURES)
    same = ShadeNet(np.zeros(n), np.ones(n), inner, inner_bias, outer[:, 0], float(outer_bias[0]))
    np.testing.assert_allclose(person_chance(same, features), other.predict_proba(features)[:, 1], atol=1e-5)


def test_too_few_examples_are_refused():
    with pytest.raises(InputError, match="too few shades"):
        train_shade(np.zeros((300, len(FEATURES)), np.float32), np.zeros(300, bool))


@pytest.mark.parametrize("text", ["", "lost,1,2,3\n", "lost,1,two,3\n", "\0"])
def test_what_is_no_network_is_refused(tmp_path, text):
    path = tmp_path / "net.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=r"net\.csv: cannot be read as a network"):
        read_net(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_net(tmp_path / "missing.csv")


def test_the_floor_is_where_rays_meet_it(ring):
    room = np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]])
    camera = ring.cameras[0]
    floor = floor_pixels(camera, room)
    assert floor.shape == camera.size[::-1] and 0.01 < floor.mean() < 0.9
    rng = np.random.default_rng(0)
    points = np.c_[rng.uniform(-1, 1, (200, 2)), np.zeros(200)]
    seen = points @ camera.rotation.T + camera.translation
    pixels = cv2.projectPoints(points, cv2.Rodrigues(camera.rotation)[0], camera.translation, camera.matrix, camera.distortions)[0]
    column, row = np.round(pixels[:, 0]).astype(int).T
    inside = (seen[:, 2] > 0) & (column >= 0) & (row >= 0) & (column < camera.size[0]) & (row < camera.size[1])
    assert inside.sum() > 20 and floor[row[inside], column[inside]].mean() > 0.98


@pytest.mark.parametrize("name", ["r2", "r3"])
def test_silhouettes_of_people_that_it_has_not_seen_are_nearer_with_it(shared_data, name):
    """Rendered by another program; against the rules on single pixels, over every frame whose silhouettes are known."""
    recording = open_recording(shared_data / "rendered" / name)
    known = shared_data / "rendered" / name / "truth" / "silhouettes"
    frames = sorted({int(file.stem) for file in known.glob("*/*.png")} - {0})
    overlaps: dict[float, list[float]] = {0.0: [], SegmentationSettings().least_chance: []}
    for c, camera in enumerate(recording.rig.cameras[:4]):
        model = train_background(background_frames(recording, c, 20), floor=floor_pixels(camera, recording.room))
        for number in frames:
            (frame,) = iterate_frames(recording, number, number + 1)
            true = cv2.imread(str(known / camera.name / f"{number:06d}.png"), cv2.IMREAD_GRAYSCALE) > 0
            for chance, found in overlaps.items():
                mask, _ = segment(model, frame.images[c], SegmentationSettings(least_chance=chance))
                found.append(np.sum(mask & true) / np.sum(mask | true))
    ruled, asked = (np.mean(found) for found in overlaps.values())
    assert asked > ruled + 0.005


def test_small_images_are_told_by_the_rules_alone(scene):
    _, _, image, _, _ = scene
    rng = np.random.default_rng(1)
    empty = [np.clip(150 + rng.normal(0, 2, (*SHAPE, 3)), 0, 255).astype(np.uint8) for _ in range(20)]
    masks = [segment(train_background(empty), image, SegmentationSettings(least_chance=chance))[0] for chance in (0.0, 0.45)]
    np.testing.assert_array_equal(*masks)


def test_pixels_unlike_all_others_have_a_chance_all_the_same():
    far = 1e4 * np.random.default_rng(0).normal(size=(50, len(FEATURES))).astype(np.float32)
    chance = person_chance(default_net(), far)  # a warning would be an error here
    assert ((chance >= 0) & (chance <= 1)).all() and {0.0, 1.0} >= set(np.unique(chance.round(6)).tolist())
