"""Light on surfaces: point lights with soft shadows, kept in one shadow map a light that looks down from the ceiling.

A light's map is a stereographic picture of everything below it, so that one map serves the whole room and all cameras.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from hmc.synthetic.rasterise import rasterise

__all__ = ["Light", "ShadowMap", "contact_map", "flat_index", "irradiance", "look_up", "make_lights", "shadow_map", "soft_shadow"]

#: Width and height of a shadow map, pixels; some 2 cm on the floor below a ceiling light.
MAP_SIZE = 768
#: The map's edge, as the tangent of half the angle from straight down: about 105 degrees.
_EDGE = 1.3
_FAR = np.float32(1e6)


@dataclass(frozen=True)
class Light:
    """A small round lamp.

    Parameters
    ----------
    position : ndarray, shape (3,)
    power : ndarray, shape (3,)
        BGR; irradiance at one metre on a surface that faces it.
    softness : float
        Half-width of the penumbra in the shadow map, pixels.
    """

    position: np.ndarray
    power: np.ndarray
    softness: float = 2.0


@dataclass(frozen=True)
class ShadowMap:
    """What stands below a light.

    Parameters
    ----------
    distance : ndarray, shape (MAP_SIZE, MAP_SIZE)
        Of the nearest surface from the light, metres.
    nearest : ndarray, shape (MAP_SIZE ** 2 + 1,)
        The least distance in the neighbourhood of each pixel, as wide as the penumbra; a last entry, far away, serves index -1.
    taken : ndarray, shape (MAP_SIZE ** 2 + 1,)
        How much of the light is kept from what lies behind, in [0, 1]; a last entry, 0, serves index -1.
    """

    distance: np.ndarray
    nearest: np.ndarray
    taken: np.ndarray


def make_lights(room: np.ndarray, count: int, brightness: float, rng: np.random.Generator) -> tuple[Light, ...]:
    """Lamps below the ceiling, of unequal strength, slightly warm or cold.

    Parameters
    ----------
    room : ndarray, shape (2, 3)
    count : int
    brightness : float
        1 lights an average room so that white is nearly white.
    rng : Generator
    """
    low, high = room
    lights = []
    strengths = rng.uniform(0.6, 1.4, count)
    height = high[2] - 0.15
    for k in range(count):
        angle = 2 * np.pi * (k + rng.uniform(0.1, 0.9)) / count
        spot = (low + high)[:2] / 2 + (high - low)[:2] * 0.20 * [np.cos(angle), np.sin(angle)]
        tint = 1 + rng.normal(0, 0.02) * np.array([1.0, 0.0, -1.0])
        power = 1.05 * brightness * height**2 * strengths[k] / strengths.sum() * tint
        lights.append(Light(np.append(spot, height), power, float(rng.uniform(1.5, 3.0))))
    return tuple(lights)


def look_up(light: Light, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where points lie in a light's map.

    Parameters
    ----------
    light : Light
    points : ndarray, shape (n, 3)

    Returns
    -------
    uv : ndarray, shape (n, 2)
        Pixels of the map; NaN above the light's edge.
    distance : ndarray, shape (n,)
        Metres from the light.
    """
    away = points - light.position
    distance = np.maximum(np.linalg.norm(away, axis=1), 1e-6)
    toward = away / distance[:, None]
    scale = 1 / np.maximum(1 - toward[:, 2], 1e-6) / _EDGE  # stereographic from straight down: tan(angle / 2)
    uv = (toward[:, :2] * scale[:, None] + 1) * (MAP_SIZE / 2) - 0.5
    outside = (np.abs(toward[:, :2] * scale[:, None]) >= 1).any(axis=1)
    uv[outside] = np.nan
    return uv, distance


def flat_index(uv: np.ndarray) -> np.ndarray:
    """Flat indices into a map of the pixels nearest to ``uv``; -1 outside."""
    with np.errstate(invalid="ignore"):
        nearest = np.clip(np.rint(np.nan_to_num(uv, nan=0.0)), 0, MAP_SIZE - 1).astype(np.int32)
    return np.where(np.isnan(uv[:, 0]), -1, nearest[:, 1] * MAP_SIZE + nearest[:, 0]).astype(np.int32)


def shadow_map(light: Light, vertices: np.ndarray, triangles: np.ndarray) -> ShadowMap:
    """What a mesh hides from a light."""
    uv, distance = look_up(light, vertices)
    fragments = rasterise(uv, distance, triangles, (MAP_SIZE, MAP_SIZE), cull=False)
    nearest = np.full((MAP_SIZE, MAP_SIZE), _FAR)
    nearest.ravel()[fragments.pixels] = fragments.depth
    width = 2 * max(3, int(np.ceil(2 * light.softness))) + 1
    around = cv2.erode(nearest, np.ones((width, width), np.uint8))
    taken = cv2.GaussianBlur((nearest < _FAR).astype(np.float32), (0, 0), light.softness)
    return ShadowMap(nearest, np.append(around.ravel(), _FAR), np.append(taken.ravel(), np.float32(0)))


def soft_shadow(shadows: ShadowMap, index: np.ndarray, distance: np.ndarray, margin: float) -> np.ndarray:
    """Share of a light that does not reach points, (n,) in [0, 1], by comparing distances over a neighbourhood of the map.

    Parameters
    ----------
    shadows : ShadowMap
    index, distance : ndarray, shape (n,)
        From `flat_index` and `look_up`.
    margin : float
        Metres by which the hiding surface must be nearer to the light.
    """
    # Only where the neighbourhood holds something nearer to the light is there anything to compare.
    some = np.flatnonzero(distance > shadows.nearest[index] + margin)
    column, row = index[some] % MAP_SIZE, index[some] // MAP_SIZE
    total = np.zeros(len(some), np.float32)
    offsets = [(dx, dy) for dx in (-3, -1, 1, 3) for dy in (-3, -1, 1, 3)]
    for dx, dy in offsets:
        near = shadows.distance[np.clip(row + dy, 0, MAP_SIZE - 1), np.clip(column + dx, 0, MAP_SIZE - 1)]
        total += distance[some] > near + margin
    share = np.zeros(len(index), np.float32)
    share[some] = total / len(offsets)
    return share


def irradiance(light: Light, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Lambert's cosine over the distance squared, (n,), without shadows."""
    to_light = light.position - points
    squared = np.einsum("ij,ij->i", to_light, to_light)
    return np.maximum(np.einsum("ij,ij->i", to_light, normals), 0) / np.maximum(squared, 0.09) ** 1.5


def contact_map(vertices: np.ndarray, corners: np.ndarray, cell_m: float = 0.03, reach_m: float = 0.35) -> np.ndarray:
    """How much of the ambient light low parts of a body keep from the floor near it, (ny, nx) in [0, 1].

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
    corners : ndarray, shape (2, 3)
        Of the room.
    cell_m, reach_m : float
        Size of a cell; height up to which a body darkens the floor.
    """
    low = vertices[vertices[:, 2] < reach_m]
    shape = np.ceil((corners[1, :2] - corners[0, :2]) / cell_m).astype(int) + 1
    darkness = np.zeros((shape[1], shape[0]), np.float32)
    cells = np.clip(np.rint((low[:, :2] - corners[0, :2]) / cell_m).astype(int), 0, shape - 1)
    np.maximum.at(darkness, (cells[:, 1], cells[:, 0]), (1 - low[:, 2] / reach_m).astype(np.float32))
    return 0.75 * np.minimum(cv2.GaussianBlur(darkness, (0, 0), 1.3) * 0.6 + cv2.GaussianBlur(darkness, (0, 0), 4.0), 1)
