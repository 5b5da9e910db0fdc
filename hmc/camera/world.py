"""A change of the world's coordinates: turned, moved, and in other units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hmc.camera.model import Camera, Rig

__all__ = ["World", "in_world", "moved_camera"]


@dataclass(frozen=True, eq=False)
class World:
    """New coordinates of old ones: ``x_new = scale * rotation @ (x_old - origin)``.

    Parameters
    ----------
    rotation : ndarray, shape (3, 3)
        Its rows are the new axes in the old coordinates.
    origin : ndarray, shape (3,)
        The new origin in the old coordinates and units.
    scale : float
        New units an old unit: .001 makes metres of millimetres.
    """

    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    scale: float = 1.0

    def points(self, points: np.ndarray) -> np.ndarray:
        """Old points in new coordinates; shape (..., 3)."""
        return self.scale * (np.asarray(points, float) - self.origin) @ self.rotation.T

    def old_points(self, points: np.ndarray) -> np.ndarray:
        """New points in old coordinates; shape (..., 3)."""
        return np.asarray(points, float) @ self.rotation / self.scale + self.origin

    def after(self, first: World) -> World:
        """This change after another one, as one."""
        return World(self.rotation @ first.rotation, first.old_points(self.origin), self.scale * first.scale)


def moved_camera(camera: Camera, world: World) -> Camera:
    """A camera in new coordinates: a point and the new one of it fall on the same pixel.

    Parameters
    ----------
    camera : Camera
    world : World
    """
    translation = world.scale * (camera.rotation @ world.origin + camera.translation)
    return replace(camera, rotation=camera.rotation @ world.rotation.T, translation=translation)


def in_world(rig: Rig, world: World) -> Rig:
    """The same cameras in new coordinates (`moved_camera`)."""
    return Rig(tuple(moved_camera(camera, world) for camera in rig))
