"""Camera rigs round a room."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.camera.model import Camera, Rig, look_at
from hmc.errors import InputError

__all__ = ["RIGS", "RigRecipe", "make_rig"]

#: Rigs by name: cameras in a ring, in corners, overhead.
RIGS: dict[str, tuple[int, int, int]] = {
    "ring7": (7, 0, 0),
    "ring7_overhead": (7, 0, 1),
    "ring8": (8, 0, 0),
    "corners4": (0, 4, 0),
    "corners4_overhead": (0, 4, 1),
}


@dataclass(frozen=True)
class RigRecipe:
    """What a rig is like.

    Parameters
    ----------
    kind : str
        One of `RIGS`.
    size_px : (width, height)
    camera_height_m, target_height_m : float
        Heights of the wall cameras and of the point they look at.
    field_of_view_deg : float
        Horizontal; 0 takes the rig's own: 68 in a ring, 80 in corners, 95 overhead.
    distorted : bool
        Give each lens a radial distortion, k1 about -0.2.
    """

    kind: str = "ring7"
    size_px: tuple[int, int] = (640, 480)
    camera_height_m: float = 2.3
    target_height_m: float = 0.95
    field_of_view_deg: float = 0.0
    distorted: bool = False


def make_rig(recipe: RigRecipe, room: np.ndarray, rng: np.random.Generator) -> Rig:
    """A rig in a room, with the small irregularities of a real one.

    Parameters
    ----------
    recipe : RigRecipe
    room : ndarray, shape (2, 3)
        Corners of the room, metres.
    rng : Generator
        Places, aim and intrinsics vary a little from camera to camera.

    Returns
    -------
    Rig

    Raises
    ------
    InputError
        For an unknown kind.
    """
    if recipe.kind not in RIGS:
        raise InputError(f"rig {recipe.kind!r} is unknown; use one of {', '.join(RIGS)}")
    ring, corners, overhead = RIGS[recipe.kind]
    low, high = room
    middle, half = (low + high)[:2] / 2, (high - low)[:2] / 2
    places: list[tuple[np.ndarray, float]] = []
    for k in range(ring):
        angle = 2 * np.pi * (k + 0.25) / ring
        direction = np.array([np.cos(angle), np.sin(angle)])
        # As far out as the walls allow on a superellipse between the room's ellipse and its box.
        reach = 0.95 / (np.abs(direction / half) ** 4).sum() ** 0.25
        places.append((np.append(middle + direction * reach, recipe.camera_height_m), 68.0))
    for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))[:corners]:
        places.append((np.append(middle + 0.93 * half * [sx, sy], recipe.camera_height_m + 0.25), 80.0))
    for _ in range(overhead):
        places.append((np.array([middle[0] + 0.05, middle[1] + 0.03, high[2] - 0.08]), 95.0))
    cameras = []
    for k, (position, fov) in enumerate(places):
        down = k >= ring + corners
        position = position + rng.normal(0, [0.05, 0.05, 0.0 if down else 0.08])
        target = np.append(middle, 0.0 if down else recipe.target_height_m) + rng.normal(0, 0.08, 3)
        k1 = rng.normal(-0.20, 0.03) if recipe.distorted else 0.0
        k2 = 0.05 + rng.normal(0, 0.01) if recipe.distorted else 0.0
        camera = look_at(f"cam_{k:02d}", recipe.size_px, position, target, recipe.field_of_view_deg or fov, (k1, k2, 0.0, 0.0))
        cameras.append(_jitter(camera, rng))
    return Rig(tuple(cameras))


def _jitter(camera: Camera, rng: np.random.Generator) -> Camera:
    """Focal lengths off by half a per cent, the principal point by a per cent of the width."""
    matrix = np.array(camera.matrix)
    matrix[[0, 1], [0, 1]] *= 1 + rng.normal(0, 0.005) + rng.normal(0, 0.001, 2)
    matrix[:2, 2] += rng.normal(0, 0.01 * camera.size[0], 2)
    return replace(camera, matrix=matrix)
