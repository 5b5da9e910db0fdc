"""Person or shadow: how likely a pixel that is darker than the empty scene belongs to a person.

Grey cloth before a pale wall and the shadow on that wall have the same color, and no rule on one pixel tells them apart. What is around
it does: cloth begins at an edge and shadows fade, folds are not the scene's texture while a shadow keeps it, a shadow lies on the floor
more often than on a wall, and both have their distance, and their difference in color, from what is surely a person. So some twenty
numbers of a pixel's neighbourhood are asked together, by a small network (one hidden layer) that was trained on rendered people with
true silhouettes: ``python -m hmc.voxels.train_shade``. Its weights are `shade_net.csv`; here they are asked, with NumPy alone.

To learn from labelled pixels what a shadow looks like is an old thought (Joshi and Papanikolopoulos 2008); the features are ours.
"""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from hmc.camera.coverage import floor_points
from hmc.camera.model import Camera
from hmc.camera.silhouettes import Evidence
from hmc.errors import InputError

__all__ = [
    "FEATURES",
    "ShadeNet",
    "chance_map",
    "default_net",
    "floor_pixels",
    "is_shade",
    "noise_px",
    "person_chance",
    "read_net",
    "shade_features",
    "told_by_chance",
]

#: Per pixel: light that is lost (share), luma in deviations, chroma that a shadow would not have in deviations (distance, and along both
#: axes), the empty scene's luma (share of 255), what a shadow's one gain leaves of the texture, and how much texture there is (logarithms
#: of variances), edges of the light that is left (here; most within 5 and 11 pixels, mean of 7) and its roughness in 7, distance to what is
#: surely a person (pixels) and difference in luma and chroma from it, shares of sure pixels within 9, 21 and 41, share of doubts within 9,
#: mean light of the doubts within 15, light against its surroundings, and whether the pixel looks at the floor.
FEATURES = (
    "lost", "luma", "chroma", "red", "blue", "scene", "left_texture", "texture", "edge", "edge_5", "edge_11", "edge_mean_7", "rough_7",
    "distance", "luma_from_person", "chroma_from_person", "sure_9", "sure_21", "sure_41", "doubt_9", "light_15", "light_beside", "floor",
)  # fmt: skip
#: Shades are darker than the scene by more than this many deviations, have lost between these shares of its light, and no more than so many
#: deviations of chroma; within this distance of what is surely a person, pixels of a 640 x 480 image.
LEAST_LUMA, LOST, MOST_CHROMA, REACH_PX = 4.0, (0.02, 0.65), 8.0, 60
#: Surely a person: found by the mixture, and off by so many deviations in chroma or brighter, or darker than any shadow.
SURE, DARKEST = 6.0, 0.45
#: Chances are averaged, and noise is, over squares of these sides, pixels of a 640 x 480 image. One that was made half as wide has less
#: noise, and details that such a square would wash out: shoes before a floor of their color.
SMOOTH_PX, NOISE_PX = 5, 3
#: Chances are no nearer to 0 and 1 than that of this logit.
MOST_LOGIT = 30.0
#: Where it is not known whether a pixel looks at the floor.
FLOOR_UNKNOWN = 0.5
#: The floor is looked up at every so manieth pixel, and so far beyond the room, metres.
FLOOR_STEP, FLOOR_MARGIN_M = 4, 0.3
DEFAULT_NET = Path(__file__).with_name("shade_net.csv")


@dataclass(frozen=True)
class ShadeNet:
    """Weights of the network; ``chance = logistic(max(0, (x - middle) / spread @ inner + inner_bias) @ outer + outer_bias)``.

    Attributes
    ----------
    middle, spread : ndarray of float32, shape (n_features,)
    inner : ndarray of float32, shape (n_features, n_hidden)
    inner_bias, outer : ndarray of float32, shape (n_hidden,)
    outer_bias : float
    """

    middle: np.ndarray
    spread: np.ndarray
    inner: np.ndarray
    inner_bias: np.ndarray
    outer: np.ndarray
    outer_bias: float


def floor_pixels(camera: Camera, room: np.ndarray) -> np.ndarray:
    """Which pixels of a camera look at the floor of a room, or closely beyond.

    Parameters
    ----------
    camera : Camera
    room : ndarray, shape (2, 3)
        Lower and upper corner, world, metres; the floor is at the lower z limit.

    Returns
    -------
    ndarray of bool, shape (height, width)
    """
    width, height = camera.size
    uv = np.stack(np.meshgrid(np.arange(0, width, FLOOR_STEP), np.arange(0, height, FLOOR_STEP)), axis=-1).astype(float)
    places = floor_points(camera, uv, room[0, 2])
    inside = np.all((places > room[0, :2] - FLOOR_MARGIN_M) & (places < room[1, :2] + FLOOR_MARGIN_M), axis=-1)  # NaN compares as false
    return np.ascontiguousarray(inside.repeat(FLOOR_STEP, axis=0).repeat(FLOOR_STEP, axis=1)[:height, :width])


def is_shade(seen: Evidence) -> np.ndarray:
    """Pixels that may be a shadow or a person, as they are darker than the scene and of its color: bool, shape (height, width)."""
    low, high = LOST
    return (seen.luma < -LEAST_LUMA) & (seen.lost > low) & (seen.lost < high) & (seen.chroma2 < MOST_CHROMA**2)


def shade_features(
    image: np.ndarray,
    mean: np.ndarray,
    deviation: np.ndarray,
    seen: Evidence,
    seeds: np.ndarray,
    scale: float,
    floor: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The shades of an image near people, and what tells of each.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        BGR.
    mean, deviation : ndarray of float32, shapes (height, width, 3) and (height, width, 2)
        The empty scene, as for `hmc.camera.silhouettes.evidence`.
    seen : Evidence
    seeds : ndarray of uint8, shape (height, width)
        1 where the mixture sees foreground.
    scale : float
        Size of the image against 640 x 480.
    floor : ndarray of bool, shape (height, width), optional
        Which pixels look at the floor.

    Returns
    -------
    pixels : ndarray of int, shape (n,)
        Flat.
    features : ndarray of float32, shape (n, 23)
        In the order of `FEATURES`.
    """
    told = ((seen.chroma2 > SURE**2) | (seen.luma > SURE) | (seen.lost > 1 - DARKEST)).view(np.uint8)
    sure = cv2.morphologyEx(np.bitwise_and(seeds, told), cv2.MORPH_OPEN, np.ones((noise_px(scale),) * 2, np.uint8))
    near = cv2.dilate(sure, np.ones(_square(2 * REACH_PX + 1, scale), np.uint8))
    pixels = np.flatnonzero(is_shade(seen) & near.view(bool))
    if not len(pixels):
        return pixels, np.zeros((0, len(FEATURES)), np.float32)
    away, label = cv2.distanceTransformWithLabels(1 - sure, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
    # Each label is the place of one sure pixel.
    places = np.flatnonzero(sure.view(bool))
    of_label = np.zeros(len(places) + 1, np.intp)
    of_label[label.ravel()[places]] = places
    person = of_label[label.ravel()[pixels]]
    rows = _neighbourhood(image, mean, deviation, seen, sure, scale, (pixels, person))
    rows["distance"] = np.minimum(away.ravel().take(pixels) / scale, 100)
    rows["floor"] = np.full(len(pixels), FLOOR_UNKNOWN) if floor is None else floor.ravel().take(pixels)
    # A row a feature, as they are made: the other way round costs more than all of the network.
    return pixels, np.array([rows[name] for name in FEATURES], np.float32).T


def noise_px(scale: float) -> int:
    """Side of the square over which noise is averaged, and in which specks of it are sought, in images of a size against 640 x 480."""
    return _square(NOISE_PX, min(scale, 1.0))[0]


def _square(width: int, scale: float) -> tuple[int, int]:
    return (2 * round((width * scale - 1) / 2) + 1,) * 2


def _neighbourhood(
    image: np.ndarray,
    mean: np.ndarray,
    deviation: np.ndarray,
    seen: Evidence,
    sure: np.ndarray,
    scale: float,
    places: tuple[np.ndarray, np.ndarray],
) -> dict[str, np.ndarray]:
    """What the neighbourhood of some pixels tells, by name; `places` are theirs and that of the nearest sure pixel of each, flat."""
    pixels, person = places

    def at(array: np.ndarray) -> np.ndarray:
        return np.asarray(array.ravel().take(pixels), np.float32)

    small = _square(7, scale)
    color = cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)
    luma, red, blue = (cv2.GaussianBlur(cv2.extractChannel(color, channel), (noise_px(scale),) * 2, 0) for channel in range(3))
    luma, scene = luma.astype(np.float32), np.ascontiguousarray(mean[..., 0])
    own_scene, color_noise = at(scene), at(deviation[..., 1])
    own_noise = np.maximum(at(deviation[..., 0]), 1.5)
    light = cv2.log(np.clip((luma + 4) / (scene + 4), 0.05, 2))
    own_light = at(light)
    # One gain for all of the neighbourhood, as a shadow has; what it leaves is another texture.
    squares = at(cv2.blur(scene * scene, small))
    left = at(cv2.blur(luma * luma, small)) - at(cv2.blur(luma * scene, small)) ** 2 / np.maximum(squares, 1)
    texture = squares - at(cv2.blur(scene, small)) ** 2
    rough = at(cv2.blur(light * light, small)) - at(cv2.blur(light, small)) ** 2
    edge = cv2.magnitude(cv2.Scharr(light, -1, 1, 0, scale=scale / 32), cv2.Scharr(light, -1, 0, 1, scale=scale / 32))
    doubts = ((np.abs(seen.luma) > LEAST_LUMA) | (seen.chroma2 > 9)).astype(np.float32)
    share = np.exp(own_light)
    lit = np.minimum(share, 1.1)
    own_luma, reds, blues = at(luma), at(red), at(blue)
    return {
        "lost": 1 - share,
        "luma": np.clip(at(seen.luma), -60, 60),
        "chroma": np.minimum(np.sqrt(at(seen.chroma2)), 20),
        "red": np.clip((reds - 128 - (at(mean[..., 1]) - 128) * lit) / color_noise, -15, 15),
        "blue": np.clip((blues - 128 - (at(mean[..., 2]) - 128) * lit) / color_noise, -15, 15),
        "scene": own_scene / 255,
        "left_texture": np.log1p(np.maximum(left, 0) / own_noise**2),
        "texture": np.log1p(np.maximum(texture, 0) / own_noise**2),
        "edge": at(edge),
        "edge_5": at(cv2.dilate(edge, np.ones(_square(5, scale), np.uint8))),
        "edge_11": at(cv2.dilate(edge, np.ones(_square(11, scale), np.uint8))),
        "edge_mean_7": at(cv2.blur(edge, small)),
        "rough_7": np.sqrt(np.maximum(rough, 0)) * (own_scene + 4) / own_noise,
        "luma_from_person": own_luma - luma.ravel().take(person),
        "chroma_from_person": np.hypot(reds - red.ravel().take(person), blues - blue.ravel().take(person)),
        **{f"sure_{width}": at(cv2.blur(sure * 255, _square(width, scale))) / 255 for width in (9, 21, 41)},
        "doubt_9": at(cv2.blur(doubts, _square(9, scale))),
        "light_15": at(cv2.blur(light * doubts, _square(15, scale))) / np.maximum(at(cv2.blur(doubts, _square(15, scale))), 0.05),
        "light_beside": own_light - at(cv2.GaussianBlur(light, (0, 0), 3 * scale)),
    }


def person_chance(net: ShadeNet, features: np.ndarray) -> np.ndarray:
    """How likely each of some shades is a person: float32, shape (n,), from features of shape (n, 23)."""
    weights = net.inner / net.spread[:, None]
    hidden = features @ weights + (net.inner_bias - net.middle @ weights)
    np.maximum(hidden, 0, out=hidden)
    logits = np.clip(hidden @ net.outer + net.outer_bias, -MOST_LOGIT, MOST_LOGIT)  # else a pixel unlike all others overflows
    return np.asarray(1 / (1 + np.exp(-logits)), np.float32)


def chance_map(shape: tuple[int, int], pixels: np.ndarray, features: np.ndarray, scale: float) -> np.ndarray:
    """How likely each shade of an image is a person, averaged over the shades around it.

    Parameters
    ----------
    shape : tuple of int
        Height and width.
    pixels, features
        As `shade_features` returns them.
    scale : float
        Size of the image against 640 x 480.

    Returns
    -------
    ndarray of uint8, shape (height, width)
        From 1 to 255; 0 of all other pixels.
    """
    shade, chance = np.zeros((2, *shape), np.float32)
    shade.ravel()[pixels], chance.ravel()[pixels] = 1, person_chance(default_net(), features)
    around = _square(SMOOTH_PX, scale)
    smooth = cv2.GaussianBlur(chance, around, 0) / np.maximum(cv2.GaussianBlur(shade, around, 0), 0.2)
    return np.where(shade > 0, np.maximum(255 * smooth, 1), 0).astype(np.uint8)


def told_by_chance(mask: np.ndarray, seen: Evidence, chance: np.ndarray, least: float) -> np.ndarray:
    """A silhouette in which each shade is what its chance says.

    Parameters
    ----------
    mask : ndarray of uint8, shape (height, width)
    seen : Evidence
    chance : ndarray of uint8
        As `chance_map` has it, of the same image or of a smaller one.
    least : float
        Chance from which on a shade is a person.

    Returns
    -------
    ndarray of uint8, shape (height, width)
        Without specks and whiskers.
    """
    known, person = chance > 0, chance > 255 * least
    if chance.shape != mask.shape:
        both = [np.asarray(one, np.float32) for one in (chance, known)]
        likely, share = (cv2.resize(one, mask.shape[::-1], interpolation=cv2.INTER_LINEAR) for one in both)
        known, person = share > 0, likely > 255 * least * share  # of the shades between which a pixel lies
    told = np.where(is_shade(seen) & known, person.view(np.uint8), mask)
    return cv2.morphologyEx(told, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))


@functools.cache
def default_net() -> ShadeNet:
    """The network that hmc ships."""
    return read_net(DEFAULT_NET)


def read_net(path: str | Path) -> ShadeNet:
    """A network from a CSV file: a row a feature (its name, middle, spread and weights), then the rows `inner_bias` and `outer`.

    Raises
    ------
    InputError
        When the file is no such table.
    """
    try:
        with open(path, encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
        names, table = [row[0] for row in rows], np.array([[float(cell) for cell in row[1:]] for row in rows], np.float32)
        if names != [*FEATURES, "inner_bias", "outer"] or table.ndim != 2 or table.shape[1] < 3 or not np.isfinite(table).all():
            raise ValueError("its rows are not those of a network")
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as a network of shades: {error}") from None
    n = len(FEATURES)
    return ShadeNet(table[:n, 0], table[:n, 1], table[:n, 2:], table[n, 2:], table[n + 1, 2:], float(table[n + 1, 0]))
