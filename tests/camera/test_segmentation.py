"""Silhouettes on made scenes whose truth is known, and on rendered recordings with true silhouettes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import pytest

from hmc.camera import mixture
from hmc.camera.background import stable_background
from hmc.camera.reduction import reduce_image
from hmc.camera.segmentation import SegmentationSettings, segment, segment_views, train_background
from hmc.camera.shade import floor_pixels
from hmc.camera.silhouettes import cut_halo, evidence
from hmc.errors import InputError
from hmc.io.recording import background_frames, iterate_frames, open_recording

SIZE = (320, 240)


class Scene:
    """A wall above a floor with some texture, sensor noise, and a person of a few parts."""

    def __init__(self, seed=0, noise=2.0, light=1.0):
        self.rng = np.random.default_rng(seed)
        texture = cv2.resize(self.rng.normal(0, 6, (24, 32, 3)), SIZE, interpolation=cv2.INTER_CUBIC)
        wall = np.array([150, 160, 165]) + texture
        wall[150:] = np.array([110, 115, 125]) + texture[150:]
        self.wall, self.noise, self.light = wall, noise, light

    def empty(self):
        return self.expose(self.wall)

    def expose(self, image):
        image = image * self.light + self.rng.normal(0, self.noise, image.shape)
        return np.clip(image + 0.5, 0, 255).astype(np.uint8)

    def person(self, x=160, shirt=(60, 40, 150), trousers=(50, 45, 40), shadow=0.75):
        """Image and true silhouette; the shadow lies on the floor to the right."""
        image, mask = self.wall.copy(), np.zeros(SIZE[::-1], np.uint8)
        if shadow < 1:
            dark = np.zeros(SIZE[::-1], np.uint8)
            cv2.ellipse(dark, (x + 25, 205), (35, 9), 0, 0, 360, 1, -1)
            image *= (1 - (1 - shadow) * cv2.GaussianBlur(dark.astype(float), (0, 0), 2))[..., None]
        for (left, top, right, bottom), color in (
            ((x - 8, 60, x + 8, 82), (120, 150, 200)),
            ((x - 18, 82, x + 18, 140), shirt),
            ((x - 30, 86, x - 19, 138), (120, 150, 200)),
            ((x - 16, 140, x - 2, 205), trousers),
            ((x + 3, 140, x + 16, 205), trousers),
        ):
            image[top:bottom, left:right] = color
            mask[top:bottom, left:right] = 1
        return self.expose(image), mask.view(bool)


def overlap(mask, truth):
    return np.sum(mask & truth) / np.sum(mask | truth)


def lamp(left, right):
    """The light of a lamp at one side of the room, from the left to the right of the image."""
    return np.linspace(left, right, SIZE[0])[None, :, None]


def hard_light(lit, dark):
    """Light that falls in stripes, as through a window: nothing that changes smoothly over the image accounts for it."""
    return np.where(np.arange(SIZE[0]) // 40 % 2, lit, dark)[None, :, None]


def trained(scene, frames=30, settings=None):
    return train_background((scene.empty() for _ in range(frames)), settings)


def test_a_person_is_found_and_the_shadow_is_not():
    scene = Scene()
    model = trained(scene)
    image, truth = scene.person()
    mask, _ = segment(model, image)
    assert mask.dtype == bool and mask.shape == truth.shape
    assert overlap(mask, truth) > 0.93
    assert np.mean(mask[truth]) > 0.98
    assert not mask[200:212, 190:215].any()  # the middle of the shadow


def test_a_pale_band_is_filled_in_that_the_mixture_takes_for_shadow():
    """Stripes of two thirds of the wall's color pass for a shadow of it; by rules, between dark stripes they are clothes."""
    scene, rules = Scene(1, noise=1.0), SegmentationSettings(least_chance=0)
    model = trained(scene, settings=rules)
    image, truth = scene.person()
    for top in (90, 105, 120):
        image[top : top + 7, 142:178] = scene.wall[top : top + 7, 142:178] * 0.66
    raw = model.mixture.apply(image, learningRate=0) == 255
    mask, _ = segment(model, image, rules)
    assert np.mean(raw[truth]) < 0.88
    assert np.mean(mask[truth]) > 0.97
    assert np.mean(mask & ~truth) < 0.01


def test_what_was_filled_for_its_darkness_alone_is_told():
    """Stripes as above, and dark ones beside them, of which the mixture is sure."""
    scene, rules = Scene(1, noise=1.0), SegmentationSettings(least_chance=0)
    model = trained(scene, settings=rules)
    image, _ = scene.person()
    for top in (90, 105, 120):
        image[top : top + 7, 142:178] = scene.wall[top : top + 7, 142:178] * 0.66
    mask, model = segment(model, image, rules)
    assert model.chance is None and model.filled is not None and not (model.filled & ~mask).any()
    assert np.mean(model.filled[91:96, 145:175]) > 0.95  # but for a rim that the evidence mixes with what is beside it
    assert not model.filled[100:103, 145:175].any() and not model.filled[150:185].any()
    assert not segment(model, scene.empty(), rules)[1].filled.any()


def test_the_network_guesses_in_images_of_half_the_size_as_in_whole_ones():
    """It has learnt from both; of a quarter it knows nothing."""
    scene = Scene(1, noise=1.0)
    image = Scene(1, noise=0.0).person()[0]
    image[91:96, 142:178] = scene.wall[91:96, 142:178] * 0.66
    exposed = [scene.expose(cv2.resize(one, (640, 480), interpolation=cv2.INTER_NEAREST)) for one in (*[scene.wall] * 10, image)]
    *empty, image = (reduce_image(one, 2) for one in exposed)
    small = segment(train_background(empty, factor=2), image)[1]
    whole = segment(train_background(exposed[:-1]), exposed[-1])[1]
    assert small.filled is None and small.chance.shape == image.shape[:2] and small.chance[92:95, 145:175].all()
    there = cv2.resize(whole.chance, (320, 240), interpolation=cv2.INTER_AREA)[92:95, 145:175].astype(float)
    assert np.abs(small.chance[92:95, 145:175] - there).mean() < 40
    tiny = segment(train_background([cv2.resize(one, (160, 120)) for one in empty]), cv2.resize(image, (160, 120)))[1]
    assert tiny.chance is None and tiny.filled is not None


def test_where_the_network_guesses_it_says_so_and_nothing_is_filled_by_rules():
    """Where it is not asked, what is filled is told."""
    scene = Scene(1, noise=1.0)
    empty = [cv2.resize(scene.empty(), (640, 480)) for _ in range(10)]
    image = scene.person()[0]
    image[91:96, 142:178] = scene.wall[91:96, 142:178] * 0.66
    image = cv2.resize(image, (640, 480))
    model = segment(train_background(empty), image)[1]
    assert model.filled is None and model.chance is not None and model.chance[182:192, 290:350].any() and not model.chance[:40].any()
    model = segment(train_background(empty), image, SegmentationSettings(least_chance=0))[1]
    assert model.chance is None and model.filled is not None and model.filled[182:192, 290:350].any()


def test_an_empty_scene_has_no_silhouette():
    scene = Scene(2)
    model = trained(scene)
    for _ in range(20):
        mask, model = segment(model, scene.empty())
        assert not mask.any()


def test_one_background_frame_is_enough_to_go_on_with():
    scene = Scene(3)
    model = trained(scene, 1)
    image, truth = scene.person()
    assert overlap(segment(model, image)[0], truth) > 0.85


def test_who_stands_still_is_never_learnt():
    scene = Scene(4)
    model = trained(scene)
    settings = SegmentationSettings(learn_every=1, learning_rate=0.05)
    for _ in range(150):
        image, truth = scene.person(x=100)
        mask, model = segment(model, image, settings)
    assert overlap(mask, truth) > 0.9
    for x in (140, 200):  # and no ghost is left where they stood
        image, truth = scene.person(x=x)
        mask, model = segment(model, image, settings)
        assert overlap(mask, truth) > 0.85


@pytest.mark.parametrize("fps", [4, 10])
def test_daylight_on_a_wall_is_followed_at_few_frames_a_second_too(fps):
    """A patch that brightens by half a grey level a second for a minute; with the ten frames of thirty a second it becomes a person."""
    scene = Scene(7)
    model, wall = trained(scene), scene.wall
    patch = np.zeros(SIZE[::-1])
    patch[40:110, 60:110] = 1
    patch = cv2.GaussianBlur(patch, (0, 0), 6)[..., None]
    settings = SegmentationSettings().at_rate(fps)
    for k in range(60 * fps):
        scene.wall = wall + 0.5 * k / fps * patch
        mask, model = segment(model, scene.empty(), settings)
    assert mask.sum() < 50


def test_light_that_drifts_is_followed():
    """A tenth brighter in stripes over four hundred frames, with somebody there; without learning these would be foreground."""
    scene = Scene(5)
    following = trained(scene)
    frozen = trained(scene)
    settings = SegmentationSettings(learn_every=2, learning_rate=0.15)
    for light in np.linspace(1, 1.1, 400):
        scene.light = hard_light(light, 1.0)
        image, truth = scene.person(x=120)
        mask, following = segment(following, image, settings)
        assert mask is not None
    assert overlap(mask, truth) > 0.85
    assert following.mean[..., 0].mean() > 1.025 * frozen.mean[..., 0].mean()


@pytest.mark.parametrize(
    "light", [1.3, 0.6, 0.96, (1.03, 1.0, 0.97), (0.95, 1.0, 1.06), (1.6, 1.4, 1.2), lamp(0.9, 1.1), lamp(1.3, 0.7), lamp(1.6, 0.8)]
)
def test_automatic_exposure_white_balance_and_flicker_cost_nothing(light):
    scene = Scene(8)
    model = trained(scene)
    for i in range(12):
        scene.light = 1.0 if i % 2 else np.array(light)
        image, truth = scene.person(x=100 + 4 * i)
        mask, model = segment(model, image)
        assert mask is not None and overlap(mask, truth) > 0.95


@pytest.mark.parametrize("frames", [1, 2])
def test_a_flash_costs_no_more_than_its_frames(frames):
    """A flash is no matter of exposure: it leaves hard shadows."""
    scene = Scene(9)
    model = trained(scene)
    for i in range(14):
        scene.light = hard_light(2.0, 1.1) if 4 <= i < 4 + frames else 1.0
        image, truth = scene.person(x=100 + 4 * i)
        mask, model = segment(model, image)
        assert (mask is None) if i == 4 else (4 < i < 4 + frames or overlap(mask, truth) > 0.85)
    assert model.before is None


@pytest.mark.parametrize("light", [(0.4, 0.35, 0.25), (0.3, 0.4, 0.6)])
def test_a_light_switch_costs_the_camera_one_frame(light):
    scene = Scene(6)
    model = trained(scene)
    for _ in range(5):
        mask, model = segment(model, scene.person(x=120)[0])
    scene.light = np.array(light)
    mask, model = segment(model, scene.person(x=121)[0])
    assert mask is None
    for x in range(122, 134):
        image, truth = scene.person(x=x)
        mask, model = segment(model, image)
        assert overlap(mask, truth) > 0.75
    assert not segment(model, scene.empty())[0][:, 200:].any()


def test_no_image_no_mask_no_change():
    model = trained(Scene(), 5)
    mask, after = segment(model, None)
    assert mask is None and after is model


def test_views_of_different_sizes_and_threads_change_nothing():
    def run(pool):
        scenes = [Scene(seed) for seed in range(3)]
        models = [trained(scene) for scene in scenes]
        masks = []
        for i in range(15):
            images = [scene.person(x=100 + 5 * i)[0] for scene in scenes]
            images[1] = images[1] if i != 4 else None
            found, models = segment_views(models, images, None, pool)
            masks.append(found)
        return masks

    plain = run(None)
    with ThreadPoolExecutor(3) as pool:
        threaded = run(pool)
    assert plain[4][1] is None
    for one, other in zip(plain, threaded, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_grey_images_in_three_channels():
    scene = Scene(7)
    grey = lambda image: cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)  # noqa: E731
    model = train_background(grey(scene.empty()) for _ in range(20))
    image, truth = scene.person(shirt=(60, 60, 60))
    assert np.mean(segment(model, grey(image))[0][truth]) > 0.8


def test_evidence_of_a_shadow_has_no_chroma():
    """A Gaussian a pixel, against the definitions written out in NumPy; darkening scales chroma, so that a shadow keeps none."""
    background = np.full((9, 9, 3), (90, 120, 150), np.uint8)
    mean = cv2.cvtColor(background, cv2.COLOR_BGR2YCrCb).astype(np.float32)
    deviation = np.dstack([np.full((9, 9), 2.0), np.full((9, 9), 1.0)]).astype(np.float32)
    seen = evidence((background * 0.7).astype(np.uint8), mean, deviation)
    np.testing.assert_allclose(seen.lost, 0.3, atol=0.01)
    np.testing.assert_allclose(seen.luma, -0.3 * mean[0, 0, 0] / 2, rtol=0.03)
    assert seen.chroma2.max() < 2
    colored = evidence(np.full((9, 9, 3), (150, 120, 90), np.uint8), mean, deviation)
    assert colored.chroma2.min() > 100
    np.testing.assert_array_equal(mean, cv2.cvtColor(background, cv2.COLOR_BGR2YCrCb))  # inputs are left as they were


def test_the_halo_of_a_blurred_square_is_cut_at_half_contrast():
    background = np.full((60, 60, 3), 60, np.uint8)
    sharp = background.copy()
    sharp[20:40, 20:40] = 200
    image = cv2.GaussianBlur(sharp, (0, 0), 1.5)
    mean = cv2.cvtColor(background, cv2.COLOR_BGR2YCrCb).astype(np.float32)
    fat = np.zeros((60, 60), np.uint8)
    fat[16:44, 16:44] = 1
    seen = evidence(image, mean, np.full((60, 60, 2), 2, np.float32))
    cut = cut_halo(fat, seen, 0.5, 1.0)
    assert 18**2 <= cut.sum() <= 24**2
    np.testing.assert_array_equal(cut_halo(fat, seen, 0.0, 1.0), fat)


def visited(scene, times, n=30):
    """Images in which somebody in ever other clothes stands at the left in the first `times` of `n`; and where that is."""
    truth = scene.person(x=90)[1]
    images = [scene.empty() for _ in range(n)]
    for image in images[:times]:
        image[truth] = np.clip(scene.rng.uniform(20, 90, 3) + scene.rng.normal(0, 2, (truth.sum(), 3)), 0, 255)
    return images, truth


def test_the_background_behind_somebody_who_is_mostly_there():
    """Seen empty in four of ten images, a place has its background all the same; a median over time has the person."""
    scene = Scene(8)
    images, truth = visited(scene, 18)
    background, unseen = stable_background(images)
    inside = cv2.erode(truth.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert np.abs(background - scene.wall)[inside].mean() < 3
    assert np.abs(np.median(images, axis=0) - scene.wall)[inside].mean() > 40
    assert unseen.mean() < 0.01


def test_a_place_that_was_never_empty_is_unseen_and_nothing_is_learnt_there():
    scene = Scene(9)
    images, truth = visited(scene, 30)
    _, unseen = stable_background(images)
    assert np.mean(unseen[truth]) > 0.9 and np.mean(unseen[~truth]) < 0.02
    settings = SegmentationSettings(learn_every=1)
    model = train_background((scene.empty() for _ in range(20)), settings, unseen=unseen)
    before = model.mean.copy()
    dimmed = (scene.empty() * 0.97).astype(np.uint8)
    dimmed[unseen] = 250
    for _ in range(20):
        _, model = segment(model, dimmed, settings)
    # All around the light went down, and what is not seen is taken to have gone down likewise.
    assert np.abs(model.mean[unseen] - before[unseen]).max() < 15
    assert (model.mean[~unseen, 0] < before[~unseen, 0]).mean() > 0.9


def test_bad_input():
    with pytest.raises(InputError, match="no background frame"):
        train_background([])
    with pytest.raises(InputError, match="differ in size"):
        train_background([np.zeros((20, 30, 3), np.uint8), np.zeros((30, 20, 3), np.uint8)])
    with pytest.raises(InputError, match="no image to find the background in"):
        stable_background([])
    with pytest.raises(InputError, match="`share` must lie between 0 and 1"):
        stable_background([np.zeros((20, 30, 3), np.uint8)], 1.0)
    with pytest.raises(InputError, match="`shadow_factor` must lie between 0 and 1"):
        SegmentationSettings(shadow_factor=1.5)
    with pytest.raises(InputError, match="`learn_every` must be positive"):
        SegmentationSettings(learn_every=0)
    with pytest.raises(InputError, match="40 x 20 pixels, the background 30 x 20"):
        segment(train_background([np.zeros((20, 30, 3), np.uint8)]), np.zeros((20, 40, 3), np.uint8))


@pytest.mark.parametrize(
    ("name", "camera", "least_overlap", "least_recall"), [("r1", 0, 0.88, 0.95), ("r2", 3, 0.88, 0.95), ("r4", 1, 0.87, 0.95)]
)
def test_true_silhouettes_of_rendered_recordings(shared_data, name, camera, least_overlap, least_recall):
    """Another program's renderings, video compression included: the first 61 frames in order, as in a run."""
    recording = open_recording(shared_data / "rendered" / name, cameras=[f"cam_{camera:02d}"], frames=61)
    model = train_background(background_frames(recording, 0), floor=floor_pixels(recording.rig.cameras[0], recording.room))
    both = either = true = 0
    for frame in iterate_frames(recording):
        mask, model = segment(model, frame.images[0])
        if frame.index % 30 == 0:
            folder = shared_data / "rendered" / name / "truth" / "silhouettes" / f"cam_{camera:02d}"
            truth = cv2.imread(str(folder / f"{frame.index:06d}.png"), cv2.IMREAD_GRAYSCALE) > 0
            both, either, true = both + np.sum(mask & truth), either + np.sum(mask | truth), true + truth.sum()
    assert both / either > least_overlap
    assert both / true > least_recall


def test_an_empty_scene_under_lamps_that_flicker_is_as_sharp_as_under_steady_light():
    scene = Scene(12)
    steady = trained(scene).deviation

    def flickering():
        for i in range(30):
            scene.light = 1 + 0.04 * np.sin(1.9 * i)
            yield scene.empty()

    deviation = train_background(flickering()).deviation
    assert np.median(deviation[..., 0] / steady[..., 0]) < 1.2


@pytest.mark.parametrize("shirt", [(60, 40, 150), (150, 152, 154)])
def test_where_nothing_changed_the_mixture_need_not_be_asked(monkeypatch, shirt):
    """Asked everywhere, or by an OpenCV that cannot be told where not to look, it finds the same people."""
    masks = []
    for name, value in ((None, None), ("_LOOKS_AWAY", False), ("same", lambda image, scene: np.zeros(image.shape[:2], np.uint8))):
        with monkeypatch.context() as patch:
            if name is not None:
                patch.setattr(mixture, name, value)
            scene = Scene(3, noise=2.5)
            model = trained(scene)
            masks.append(segment(model, scene.person(shirt=shirt)[0])[0])
    np.testing.assert_array_equal(masks[0], masks[1])
    assert masks[0].any() and overlap(masks[0], masks[2]) > 0.999


def test_the_mixture_is_asked_where_something_changed():
    scene = Scene(4)
    model = trained(scene)
    image, truth = scene.person()
    same = mixture.same(image, model.coarse) > 0
    assert not (same & truth).any() and same.mean() > 0.5
