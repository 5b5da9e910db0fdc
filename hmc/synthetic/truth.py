"""What is true of a rendered scene beyond joints and centroids: which part of an actor's body is at a place."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from hmc.synthetic.scene import Scene, crowd_at

__all__ = ["true_parts"]


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
    distances, nearest = map(np.asarray, cKDTree(crowd.vertices[people]).query(points))
    return parts[nearest], distances
