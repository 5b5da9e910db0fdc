"""What a rig sees of the world: points in view, the floor under pixels, the point looked at, and a room where none is given."""

from __future__ import annotations

import math

import numpy as np

from hmc.camera.model import Camera, Rig, project, undistort

__all__ = ["estimate_room", "floor_points", "in_view", "inside_image", "nearest_pixels", "point_looked_at"]

#: Height of an estimated room, metres: a tall person with raised arms.
ROOM_HEIGHT_M = 2.4


def estimate_room(rig: Rig) -> np.ndarray:
    """The room a rig can watch: where half of the cameras (at least two) see a standing person whole.

    On a grid over the floor, a place counts where points at 0, 1 and 2 m height are each in the image of at least half of the
    cameras. The grid reaches as far beyond the point that the cameras look at as they stand on this side of it. The room is the box
    around the places that count, without the outermost 2 % on every side, from the floor to 2.4 m. Where no place counts, it is a
    box of 3 m around the point looked at.

    Parameters
    ----------
    rig : Rig

    Returns
    -------
    ndarray, shape (2, 3)
        Lower and upper corner, metres.
    """
    centres = rig.centres[:, :2]
    target = point_looked_at(rig)[:2]
    reach = np.clip(np.abs(centres - target).max(axis=0), 1.5, 12.0)
    axes = [np.linspace(target[i] - reach[i], target[i] + reach[i], 81) for i in range(2)]
    floor = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    points = np.stack([np.column_stack([floor, np.full(len(floor), height)]) for height in (0.0, 1.0, 2.0)])
    seen = np.stack([in_view(camera, points) for camera in rig])
    need = min(len(rig), max(2, math.ceil(len(rig) / 2)))
    places = floor[(seen.sum(axis=0) >= need).all(axis=0)]
    if len(places) == 0:
        places = np.stack([target - 1.5, target + 1.5])
    low, high = np.percentile(places, (2, 98), axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.75)
    return np.array([[*(middle - half), 0.0], [*(middle + half), ROOM_HEIGHT_M]])


def floor_points(camera: Camera, uv: np.ndarray, floor_z: float) -> np.ndarray:
    """Where the rays of pixels meet the floor.

    Parameters
    ----------
    camera : Camera
    uv : ndarray, shape (..., 2)
        Pixels, with distortion.
    floor_z : float
        Height of the floor, metres.

    Returns
    -------
    ndarray, shape (..., 2)
        x and y, world, metres; NaN where they do not.
    """
    rays = np.concatenate([undistort(camera, uv), np.ones((*uv.shape[:-1], 1))], axis=-1) @ camera.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        far = (floor_z - camera.centre[2]) / rays[..., 2]
    return camera.centre[:2] + np.where(far > 0, far, np.nan)[..., None] * rays[..., :2]


def in_view(camera: Camera, points: np.ndarray) -> np.ndarray:
    """Whether world points, (..., 3), fall into a camera's image; bool, (...)."""
    uv, valid = project(camera, points)
    return valid & inside_image(camera, uv)


def inside_image(camera: Camera, uv: np.ndarray) -> np.ndarray:
    """Whether pixels, (..., 2), lie on a camera's image, border pixels whole; bool, (...)."""
    u, v = np.moveaxis(uv, -1, 0)
    return (u >= -0.5) & (v >= -0.5) & (u < camera.size[0] - 0.5) & (v < camera.size[1] - 0.5)


def nearest_pixels(camera: Camera, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The pixel in which each world point is seen.

    Parameters
    ----------
    camera : Camera
    points : ndarray, shape (n, 3)
        World, metres.

    Returns
    -------
    pixels : ndarray of int, shape (n, 2)
        Column and row; 0, 0 where a point is not seen.
    seen : ndarray of bool, shape (n,)
    """
    uv, valid = project(camera, points)
    # Compared before the cast: beside the camera a distortion can lead beyond all integers.
    seen = valid & inside_image(camera, uv)
    return np.floor(np.where(seen[:, None], uv, 0.0) + 0.5).astype(int), seen


def point_looked_at(rig: Rig) -> np.ndarray:
    """The point nearest to all optical axes (least squares), shape (3,); with parallel axes, one in front of the cameras' middle."""
    axes = np.array([camera.rotation[2] for camera in rig])
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    # A weak pull towards 3 m in front of the cameras settles what parallel axes leave open.
    weak = 1e-3 * len(rig)
    guess = (rig.centres + 3 * axes).mean(axis=0)
    return np.linalg.solve(across.sum(axis=0) + weak * np.eye(3), np.einsum("nij,nj->i", across, rig.centres) + weak * guess)
