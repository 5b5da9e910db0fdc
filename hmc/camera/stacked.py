"""Several cameras at once: points each in a camera of its own, and how their pixels move with them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from hmc.camera.model import NEAR_M, Camera

__all__ = ["Views", "project_in", "stack_views"]


@dataclass(frozen=True)
class Views:
    """Cameras as arrays over cameras.

    Parameters
    ----------
    rotation, translation, centre : ndarray, shapes (v, 3, 3), (v, 3), (v, 3)
    matrix : ndarray, shape (v, 2, 3)
        Upper rows of the intrinsic matrix.
    distortions : ndarray, shape (v, 5)
        k1, k2, p1, p2, k3.
    max_radius : ndarray, shape (v,)
        Normalised radius up to which the distortion is one-to-one.
    """

    rotation: np.ndarray
    translation: np.ndarray
    centre: np.ndarray
    matrix: np.ndarray
    distortions: np.ndarray
    max_radius: np.ndarray

    def __len__(self) -> int:
        return len(self.rotation)

    def select(self, index: np.ndarray) -> Views:
        """Some of the cameras."""
        return Views(*(getattr(self, field.name)[index] for field in fields(self)))


def stack_views(cameras: Iterable[Camera]) -> Views:
    """Put cameras together."""
    cameras = list(cameras)
    return Views(
        np.array([camera.rotation for camera in cameras]),
        np.array([camera.translation for camera in cameras]),
        np.array([camera.centre for camera in cameras]),
        np.array([camera.matrix[:2] for camera in cameras]),
        np.array([camera.distortions for camera in cameras]),
        np.array([camera.max_radius for camera in cameras]),
    )


def project_in(views: Views, index: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Project points, each into one of the cameras.

    Parameters
    ----------
    views : Views
    index : ndarray of int, shape (n,)
    points : ndarray, shape (n, 3)
        World, metres.

    Returns
    -------
    uv : ndarray, shape (n, 2)
        Pixels.
    slopes : ndarray, shape (n, 2, 3)
        How they change with the point, pixels a metre.
    valid : ndarray of bool, shape (n,)
        As `hmc.camera.model.project` says.
    """
    turn = views.rotation[index]
    cam = (turn @ points[..., None])[..., 0] + views.translation[index]
    front = cam[:, 2] > NEAR_M
    depth = np.where(front, cam[:, 2], 1.0)
    x, y = cam[:, 0] / depth, cam[:, 1] / depth
    r2 = x * x + y * y
    valid = front & (r2 < views.max_radius[index] ** 2)
    k1, k2, p1, p2, k3 = views.distortions[index].T
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    rise = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))  # of the radial factor, with x over x
    bent = np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], axis=-1)
    mixed = x * y * rise + 2 * p1 * x + 2 * p2 * y
    bend = np.empty((len(points), 2, 2))
    bend[:, 0, 0] = radial + x * x * rise + 2 * p1 * y + 6 * p2 * x
    bend[:, 0, 1] = bend[:, 1, 0] = mixed
    bend[:, 1, 1] = radial + y * y * rise + 6 * p1 * y + 2 * p2 * x
    pinhole = np.zeros((len(points), 2, 3))
    pinhole[:, 0, 0] = pinhole[:, 1, 1] = 1 / depth
    pinhole[:, 0, 2], pinhole[:, 1, 2] = -x / depth, -y / depth
    matrix = views.matrix[index]
    uv = (matrix[:, :, :2] @ bent[..., None])[..., 0] + matrix[:, :, 2]
    return uv, matrix[:, :, :2] @ bend @ pinhole @ turn, valid
