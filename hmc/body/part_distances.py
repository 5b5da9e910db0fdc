"""How far places in a room, or rays, are from each part of one posed body."""

from __future__ import annotations

import numpy as np

from hmc.body.cone_maps import cone_maps, to_cones
from hmc.body.cones import cone_shapes, places_and_directions, slide_to_axis, squared_distance
from hmc.body.model import PARTS, BodyModel
from hmc.body.placing import place_segments

__all__ = ["part_distances"]


def part_distances(body: BodyModel, state: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of hull points, or of rays, to each part of a body.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (27,)
    points : ndarray, shape (k, 3) or (k, 6)
        World, metres (`hmc.pose.views.rays`).

    Returns
    -------
    ndarray of float32, shape (n_parts, k)
        Metres, in the order of `hmc.body.model.PARTS`; 0 inside, infinite of a part that the body lacks.
    """
    places, directions = places_and_directions(points)
    origin = places.mean(axis=0)
    maps = cone_maps(body.cones, place_segments(body, state[None], origin))
    local = np.ascontiguousarray(to_cones(maps, (places - origin).astype(np.float32)).swapaxes(0, 1))
    lengths, first, slope = cone_shapes(body.cones)
    if directions is not None:
        along = maps.to_cone[:, :, :3, 0].reshape(-1, 3) @ directions.T.astype(np.float32)
        slide_to_axis(local, along.reshape(-1, 3, len(points)).swapaxes(0, 1), lengths)
    squared = np.empty(local.shape[1:], np.float32)
    squared_distance(local, lengths, first, slope, squared)
    return np.sqrt([squared[body.cones.part == part].min(axis=0, initial=np.inf) for part in range(len(PARTS))])
