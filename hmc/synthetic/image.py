"""Pictures of a scene: the empty room once a camera, the people into it frame by frame, and the sensor."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from hmc.camera.model import Camera, backproject, project
from hmc.synthetic.rasterise import Fragments, rasterise
from hmc.synthetic.room import box_mesh, cast_rays
from hmc.synthetic.scene import Crowd, Scene
from hmc.synthetic.shading import ShadowMap, contact_map, flat_index, irradiance, look_up, shadow_map, soft_shadow

__all__ = [
    "Backdrop",
    "LitCrowd",
    "develop",
    "exposure",
    "light_crowd",
    "make_backdrop",
    "person_pixels",
    "picture",
    "relit",
    "static_shadows",
]

#: Anti-aliasing: every pixel of a person is the mean of this many samples squared.
SAMPLES = 2
_CONTACT_CELL_M = 0.03


@dataclass(frozen=True)
class Backdrop:
    """The empty room as one camera sees it, and what is needed to cast shadows on it; arrays over all pixels, row by row.

    Parameters
    ----------
    radiance : ndarray, shape (n, 3)
        Linear, BGR.
    depth : ndarray, shape (n,)
        Along the optical axis, metres.
    shares : ndarray, shape (n_lights, n)
        Irradiance from each light, shadows of the furniture included.
    index, distance : ndarray, shape (n_lights, n)
        Where the place lies in the light's map, -1 outside, and how far from the light.
    floor : ndarray of int, shape (n,)
        Cell of the contact map, -1 off the floor.
    vignette : ndarray, shape (n,)
    gain : ndarray, shape (3,)
        The camera's white balance and exposure.
    """

    radiance: np.ndarray
    depth: np.ndarray
    shares: np.ndarray
    index: np.ndarray
    distance: np.ndarray
    floor: np.ndarray
    vignette: np.ndarray
    gain: np.ndarray


@dataclass(frozen=True)
class LitCrowd:
    """The people of a frame with the light on them, the same for all cameras.

    Parameters
    ----------
    crowd : Crowd
    radiance : ndarray, shape (n, 3)
        Of each vertex, linear, BGR.
    shadows : tuple of ShadowMap
        One a light.
    contact : ndarray
        From `contact_map`.
    """

    crowd: Crowd
    radiance: np.ndarray
    shadows: tuple[ShadowMap, ...]
    contact: np.ndarray


def static_shadows(scene: Scene) -> tuple[ShadowMap, ...]:
    """Shadow maps of the furniture, one a light."""
    mesh = box_mesh(scene.room.boxes)
    return tuple(shadow_map(light, *mesh) for light in scene.lights)


def make_backdrop(scene: Scene, camera: Camera, furniture: tuple[ShadowMap, ...], rng: np.random.Generator) -> Backdrop:
    """Cast a ray through every pixel, along the lens's distortion, and light what it meets.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    furniture : tuple of ShadowMap
        From `static_shadows`.
    rng : Generator
        The camera's white balance.

    Returns
    -------
    Backdrop
    """
    width, height = camera.size
    v, u = np.mgrid[0:height, 0:width]
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(float)
    # Colors are averaged over each pixel; light, which changes slowly, is taken at its middle.
    albedo = np.zeros((len(pixels), 3))
    for offset in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):
        albedo += cast_rays(scene.room, camera.centre, backproject(camera, pixels + offset)).albedo / 4
    rays = backproject(camera, pixels)
    hits = cast_rays(scene.room, camera.centre, rays)
    points = camera.centre + hits.distance[:, None] * rays
    shares, index, distance = _light_surfaces(scene, points, hits.normal, furniture)
    ambient = scene.recipe.light.ambient * _open_sky(hits.normal)[:, None]
    radiance = albedo * (ambient + sum(share[:, None] * lamp.power for share, lamp in zip(shares, scene.lights, strict=True)))
    depth = (points @ camera.rotation.T + camera.translation)[:, 2]
    corners = scene.room.corners
    on_floor = (points[:, 2] < 0.01) & (hits.normal[:, 2] > 0.5)
    cells = np.rint((points[:, :2] - corners[0, :2]) / _CONTACT_CELL_M).astype(np.int64)
    columns = int(np.ceil((corners[1, 0] - corners[0, 0]) / _CONTACT_CELL_M)) + 1
    floor = np.where(on_floor, cells[:, 1] * columns + cells[:, 0], -1).astype(np.int32)
    centre = (np.array(camera.size) - 1) / 2
    vignette = 1 - 0.14 * (((pixels - centre) / np.linalg.norm(centre)) ** 2).sum(axis=1)
    gain = np.exp(rng.normal(0, 0.025, 3) + rng.normal(0, 0.04))
    return Backdrop(
        (radiance * gain * vignette[:, None]).astype(np.float32), depth.astype(np.float32), shares, index, distance, floor,
        vignette.astype(np.float32), gain.astype(np.float32),
    )  # fmt: skip


def relit(backdrop: Backdrop, before: Scene, after: Scene) -> Backdrop:
    """The empty room of a scene under the lamps of another that differs in their power only."""
    ambient = before.recipe.light.ambient
    old, new = (
        ambient + sum(share[:, None] * lamp.power for share, lamp in zip(backdrop.shares, scene.lights, strict=True))
        for scene in (before, after)
    )
    return replace(backdrop, radiance=(backdrop.radiance * (new / old)).astype(np.float32))


def _open_sky(normals: np.ndarray) -> np.ndarray:
    """Share of the ambient light that a surface gets by where it faces."""
    return 0.80 + 0.20 * normals[:, 2]


def _light_surfaces(scene: Scene, points: np.ndarray, normals: np.ndarray, shadows: tuple[ShadowMap, ...], margin: float = 0.03):
    shares, indices, distances = [], [], []
    for light, shadow in zip(scene.lights, shadows, strict=True):
        uv, distance = look_up(light, points)
        index = flat_index(uv)
        hidden = soft_shadow(shadow, index, distance, margin)
        shares.append((irradiance(light, points, normals) * (1 - hidden)).astype(np.float32))
        indices.append(index)
        distances.append(distance.astype(np.float32))
    return np.array(shares), np.array(indices), np.array(distances)


def light_crowd(scene: Scene, crowd: Crowd, furniture: tuple[ShadowMap, ...]) -> LitCrowd:
    """Light the people: Lambert's law from every lamp, shadows on themselves, on each other and from furniture, ambient light from above.

    Parameters
    ----------
    scene : Scene
    crowd : Crowd
    furniture : tuple of ShadowMap

    Returns
    -------
    LitCrowd
    """
    shadows = tuple(shadow_map(light, crowd.vertices, crowd.triangles) for light in scene.lights)
    ambient = scene.recipe.light.ambient * (0.72 + 0.28 * crowd.normals[:, 2]) * (0.8 + 0.2 * np.clip(crowd.vertices[:, 2], 0, 1))
    total = np.repeat(ambient[:, None], 3, axis=1)
    for light, own, fixed in zip(scene.lights, shadows, furniture, strict=True):
        uv, distance = look_up(light, crowd.vertices)
        index = flat_index(uv)
        hidden = np.maximum(soft_shadow(own, index, distance, 0.05), soft_shadow(fixed, index, distance, 0.05))
        total += (irradiance(light, crowd.vertices, crowd.normals) * (1 - hidden))[:, None] * light.power
    contact = contact_map(crowd.vertices, scene.room.corners, _CONTACT_CELL_M)
    return LitCrowd(crowd, (crowd.albedo * total).astype(np.float32), shadows, contact)


def picture(scene: Scene, camera: Camera, backdrop: Backdrop, lit: LitCrowd) -> tuple[np.ndarray, np.ndarray]:
    """The room with people in it, before the sensor.

    Parameters
    ----------
    scene : Scene
    camera : Camera
    backdrop : Backdrop
    lit : LitCrowd

    Returns
    -------
    radiance : ndarray, shape (h * w, 3)
        Linear, BGR.
    labels : ndarray of uint8, shape (h, w)
        0 background, k + 1 where person k is seen.
    """
    width, height = camera.size
    radiance = backdrop.radiance.copy()
    _darken(scene, backdrop, lit, radiance)
    if scene.recipe.room.gloss:
        _mirror(scene, camera, backdrop, lit, radiance)
    labels = np.zeros(width * height, np.uint8)
    crowd = lit.crowd
    if len(crowd.vertices):
        seen, pixel = _draw(camera, crowd.vertices, crowd.triangles)
        free = seen.depth < backdrop.depth[pixel]  # furniture and walls may stand before the person
        pixel, triangles, weights = pixel[free], crowd.triangles[seen.triangles[free]], seen.weights[free]
        color = np.einsum("nk,nkc->nc", weights, lit.radiance[triangles]) * backdrop.gain
        touched, place = np.unique(pixel, return_inverse=True)
        share = 1.0 / SAMPLES**2
        coverage = np.bincount(place, minlength=len(touched)) * share
        added = np.stack([np.bincount(place, color[:, c], len(touched)) for c in range(3)], axis=1) * share
        radiance[touched] = radiance[touched] * (1 - coverage)[:, None] + added * backdrop.vignette[touched, None]
        # Furniture that moves is -1, so its row comes first and gives 0.
        whose = crowd.persons[triangles[:, 0]]
        counts = np.stack([np.bincount(place[whose == k], minlength=len(touched)) for k in range(-1, len(scene.actors))])
        labels[touched] = np.where(coverage >= 0.5, counts.argmax(axis=0), 0)
    return radiance, labels.reshape(height, width)


def person_pixels(camera: Camera, crowd: Crowd, person: int) -> np.ndarray:
    """Pixels half of which a person would cover if nothing stood before them, ndarray of bool, shape (h, w)."""
    width, height = camera.size
    _, pixel = _draw(camera, crowd.vertices, crowd.triangles[crowd.persons[crowd.triangles[:, 0]] == person])
    return (2 * np.bincount(pixel, minlength=width * height) >= SAMPLES**2).reshape(height, width)


def _draw(camera: Camera, vertices: np.ndarray, triangles: np.ndarray) -> tuple[Fragments, np.ndarray]:
    """The nearest triangle at each sample on which one falls, and the pixel of each such sample."""
    width, height = camera.size
    uv, valid = project(camera, vertices)
    depth = (vertices @ camera.rotation.T + camera.translation)[:, 2]
    uv[~valid | (depth < 0.1)] = np.nan
    seen = rasterise((uv + 0.5) * SAMPLES - 0.5, depth, triangles, (width * SAMPLES, height * SAMPLES))
    row, column = np.divmod(seen.pixels, width * SAMPLES)
    return seen, row // SAMPLES * width + column // SAMPLES


def _mirror(scene: Scene, camera: Camera, backdrop: Backdrop, lit: LitCrowd, radiance: np.ndarray) -> None:
    """Mix the people's mirror images into a glossy floor, in place."""
    crowd = lit.crowd
    if not len(crowd.vertices):
        return
    faces = crowd.triangles[:, ::-1]  # a mirror turns them round
    seen, pixel = _draw(camera, crowd.vertices * (1, 1, -1), faces)
    floor = backdrop.floor[pixel] >= 0
    pixel, triangles, weights = pixel[floor], faces[seen.triangles[floor]], seen.weights[floor]
    color = np.einsum("nk,nkc->nc", weights, lit.radiance[triangles]) * backdrop.gain * backdrop.vignette[pixel, None]
    share = np.float32(scene.recipe.room.gloss / SAMPLES**2)
    np.add.at(radiance, pixel, share * (color - backdrop.radiance[pixel]).astype(np.float32))


def _darken(scene: Scene, backdrop: Backdrop, lit: LitCrowd, radiance: np.ndarray) -> None:
    """Take from the room, in place, the light that the people keep from it."""
    contact = np.append(lit.contact.ravel(), np.float32(0))[backdrop.floor]
    taken = []
    for k, shadow in enumerate(lit.shadows):
        # Where anything is taken, the place must also lie behind the person, seen from the light.
        share = shadow.taken[backdrop.index[k]]
        some = np.flatnonzero(share > 0.004)
        share[some] *= backdrop.distance[k, some] > shadow.nearest[backdrop.index[k, some]] + 0.02
        taken.append(share)
    changed = np.flatnonzero((contact > 0.004) | (np.array(taken) > 0.004).any(axis=0))
    full = np.full((len(changed), 3), scene.recipe.light.ambient, np.float32)
    left = full * (1 - contact[changed, None])
    for light, share, shadow in zip(scene.lights, backdrop.shares, taken, strict=True):
        part = share[changed, None] * light.power.astype(np.float32)
        full += part
        left += part * (1 - shadow[changed, None]) * (1 - 0.4 * contact[changed, None])
    radiance[changed] *= left / full


def exposure(radiance: np.ndarray, backdrop: Backdrop, scene: Scene) -> float:
    """The gain of a camera in the action, as a share of that in the empty scene."""
    sensor = scene.recipe.image
    empty, now = (float(np.minimum(light[::7], 1).mean()) for light in (backdrop.radiance, radiance))
    return sensor.exposure * (empty / now) ** sensor.auto_exposure


def develop(radiance: np.ndarray, size: tuple[int, int], scene: Scene, rng: np.random.Generator, exposure: float = 1.0) -> np.ndarray:
    """What the sensor makes of the light: gain, gamma, shot and read noise, eight bits.

    Parameters
    ----------
    radiance : ndarray, shape (h * w, 3)
        Linear.
    size : (width, height)
    scene : Scene
        Its recipe's `image` has the noise.
    rng : Generator
    exposure : float
        By which the light is multiplied.

    Returns
    -------
    ndarray of uint8, shape (h, w, 3)
    """
    sensor = scene.recipe.image
    gain = exposure * (1 + sensor.flicker * rng.standard_normal())
    # The gamma curve from a table: a power for every value would be the slowest step of all.
    place = np.clip(radiance * np.float32(gain * (_GAMMA.size - 1)), 0, _GAMMA.size - 1).astype(np.int32)
    grey = _GAMMA[place]
    # Neighbouring pixels share noise, as after the interpolation of a color sensor.
    white = rng.standard_normal((size[1], size[0], 3), dtype=np.float32)
    noise = np.asarray(cv2.GaussianBlur(white, (5, 5), _GRAIN_SIGMA)).reshape(grey.shape)
    grey += noise * np.sqrt(np.float32(sensor.read_noise**2) + np.float32(sensor.shot_noise**2 / 255) * grey) / _GRAIN_SPREAD
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8).reshape(size[1], size[0], 3)


_GRAIN_SIGMA = 0.8
#: What the blur leaves of the noise's standard deviation: the sum of the squared weights of its kernel.
_GRAIN_SPREAD = np.float32((cv2.getGaussianKernel(5, _GRAIN_SIGMA) ** 2).sum())
_GAMMA = (255 * np.linspace(0, 1, 8192) ** (1 / 2.2)).astype(np.float32)
