"""What is true of a rendered scene beyond joints and centroids: which part of an actor's body is at a place, how it is painted, and whether
people walk through one another."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from hmc.io.results import PoseTable
from hmc.landmarks import landmark_index
from hmc.synthetic.scene import Crowd, Scene, crowd_at

__all__ = ["through_one_another", "true_colors", "true_parts"]

#: Pelvises that are nearer than this, seen from above, metres, are of bodies in one another: people are about as deep as that.
THROUGH_M = 0.2


def through_one_another(poses: PoseTable) -> list[str]:
    """Which people pass through each other, as no real ones do: recipes are not kept from it.

    Parameters
    ----------
    poses : PoseTable
        True ones.

    Returns
    -------
    list of str
        A line a pair.
    """
    pelvis = poses.positions[:, landmark_index("pelvis"), :2]
    places = {person: dict(zip(*_of(poses, pelvis, person), strict=True)) for person in np.unique(poses.persons).tolist()}
    lines = []
    for one, other in combinations(places, 2):
        apart = {frame: float(np.hypot(*(at - places[other][frame]))) for frame, at in places[one].items() if frame in places[other]}
        near = [frame for frame, metres in apart.items() if metres < THROUGH_M]
        if near:
            nearest = min(near, key=lambda frame: apart[frame])
            lines.append(
                f"persons {one} and {other} are in one another in {len(near)} {'frames' if len(near) > 1 else 'frame'} "
                f"({100 * apart[nearest]:.0f} cm from pelvis to pelvis in frame {nearest}), as no real people are"
            )
    return lines


def _of(poses: PoseTable, points: np.ndarray, person: int) -> tuple[list[int], np.ndarray]:
    rows = np.flatnonzero(poses.persons == person)
    return poses.frames[rows].tolist(), points[rows]


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
