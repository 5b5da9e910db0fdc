"""A scene that every benchmark can make for itself: people of a few ellipsoids in a room, seen by a ring of cameras."""

from __future__ import annotations

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig, look_at

ROOM = np.array([[-2.5, -2.0, 0.0], [2.5, 2.0, 2.2]])

#: Centres and radii (metres) of the parts of one person who stands at the origin, stature 1.75 m.
PARTS = np.array(
    [
        [0, 0, 1.62, 0.09, 0.09, 0.13],
        [0, 0, 1.18, 0.12, 0.19, 0.33],
        [0, 0.11, 0.45, 0.08, 0.09, 0.46],
        [0, -0.11, 0.45, 0.08, 0.09, 0.46],
        [0.12, 0.30, 1.15, 0.16, 0.06, 0.16],
        [-0.12, -0.30, 1.15, 0.16, 0.06, 0.16],
    ]
)


def ring_rig(n: int = 5, size: tuple[int, int] = (640, 480)) -> Rig:
    """Cameras on a ring around the room, a little above head height."""
    angles = np.arange(n) * 2 * np.pi / n + 0.3
    places = np.stack([4.2 * np.cos(angles), 3.8 * np.sin(angles), np.full(n, 2.3)], axis=-1)
    return Rig(tuple(look_at(f"cam_{i:02d}", size, place, [0, 0, 0.9], 72) for i, place in enumerate(places)))


def people(places) -> np.ndarray:
    """Ellipsoids, (n, 6), of people who stand at the places (x, y)."""
    return np.concatenate([PARTS + np.array([x, y, 0, 0, 0, 0]) for x, y in places])


def silhouette(camera: Camera, ellipsoids: np.ndarray) -> np.ndarray:
    """The outline of ellipsoids in one image, exact but for the half pixel of drawing: dual conics of dual quadrics."""
    mask = np.zeros(camera.size[::-1], np.uint8)
    for x, y, z, a, b, c in ellipsoids:
        move = np.eye(4)
        move[:3, 3] = x, y, z
        dual = camera.projection @ move @ np.diag([a * a, b * b, c * c, -1.0]) @ move.T @ camera.projection.T
        dual /= dual[2, 2]
        centre = dual[:2, 2]
        shape = np.outer(centre, centre) - dual[:2, :2]
        values, vectors = np.linalg.eigh(shape)
        if values.min() <= 0:
            continue
        axes = np.sqrt(values)
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
        cv2.ellipse(mask, (tuple(centre.tolist()), (2 * axes[1], 2 * axes[0]), angle), 1, -1)
    return mask > 0


def salt(mask: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """The mask with a share of its pixels set."""
    return mask | (rng.random(mask.shape) < share)
