"""What is true of a rendered scene beyond joints and centroids: which part of an actor's body is at a place, and how it is painted."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from hmc.synthetic.scene import Crowd, Scene, crowd_at

__all__ = ["true_colors", "true_parts"]


def true_parts(scene: Scene, frame: int, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The actors' parts at some places: those of the nearest point of their skins.

    Parameters
    ----------
    scene : Scene
    frame : int
    points : ndarray, shape (n, 3)
        World, metres.

    Returns
    -------
    parts : ndarray of int, shape (n,)
        Places in the keys of `hmc.synthetic.actor.PARTS`.
    distances : ndarray, shape (n,)
        To the skin, from within or without, metres.
    """
    crowd = crowd_at(scene, frame)
    people = crowd.persons >= 0
    parts = np.concatenate([scene.actors[k].parts for k in np.unique(crowd.persons[people])])
    distances, nearest = _nearest(crowd, points)
    return parts[nearest], distances


def true_colors(scene: Scene, frame: int, points: np.ndarray) -> np.ndarray:
    """The paint of the nearest point of the actors' skins and clothes.

    Parameters
    ----------
    scene : Scene
    frame : int
    points : ndarray, shape (n, 3)
        World, metres.

    Returns
    -------
    ndarray, shape (n, 3)
        Share of the light that comes back, BGR, linear, 0 to 1.
    """
    crowd = crowd_at(scene, frame)
    return crowd.albedo[crowd.persons >= 0][_nearest(crowd, points)[1]]


def _nearest(crowd: Crowd, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance to the nearest vertex of a person, and which of them it is."""
    distances, nearest = map(np.asarray, cKDTree(crowd.vertices[crowd.persons >= 0]).query(points))
    return distances, nearest
