"""Features of blobs, and which blobs are people where that is known.

Source: Canton (2009), section 4.2.3, Table 4.1 and Eq. 4.1-4.3.
"""

from __future__ import annotations

import numpy as np

from hmc.tracking.blobs import Blobs, Observation
from hmc.tracking.region import PERSON_RADIUS_M, region_distance

__all__ = ["FEATURES", "assign_components", "feature_matrix"]

#: Table 4.1, in its order: the names of the columns of `feature_matrix`.
FEATURES = ("weight_kg", "centroid_z_m", "top_m", "height_m", "longer_side_m", "shorter_side_m")
#: A person is at least this share of the region of influence; with less of it the reconstruction is faulty and no person is assigned.
LEAST_FILL = 0.02


def feature_matrix(blobs: Blobs) -> np.ndarray:
    """The features of Table 4.1.

    Parameters
    ----------
    blobs : Blobs

    Returns
    -------
    ndarray, shape (n, 6)
        Columns as in `FEATURES`; extents are those of the outer faces of the voxels, so that they do not depend on the voxels' size.
    """
    return np.column_stack([blobs.weight_kg, blobs.centroid[:, 2], blobs.top_m, blobs.height_m, blobs.sides_m])


def assign_components(observation: Observation, positions: np.ndarray, least_fill: float = LEAST_FILL) -> np.ndarray:
    """The component that each true position is assigned to: the one with the largest volume in its region of influence.

    Source: Canton (2009), Eq. 4.2 and 4.3, with radii of .3, .3 m and the centroid's height.

    Parameters
    ----------
    observation : Observation
    positions : ndarray, shape (k, 3)
        Centroids, world, metres; above the floor.
    least_fill : float
        A position whose best component fills less of the region than this gets none.

    Returns
    -------
    ndarray of int, shape (k,)
        Labels of components, -1 for none. Two positions may have the same.
    """
    positions = np.asarray(positions, float).reshape(-1, 3)
    assigned = np.full(len(positions), -1)
    for k, position in enumerate(positions):
        radii = np.array([PERSON_RADIUS_M, PERSON_RADIUS_M, max(position[2], observation.voxel_size_m)])
        inside = region_distance(observation.points, position[None], radii[None])[:, 0] <= 1
        counts = np.bincount(observation.labels[inside])
        if counts.size and counts.max() * observation.voxel_size_m**3 >= least_fill * 4 / 3 * np.pi * radii.prod():
            assigned[k] = counts.argmax()
    return assigned
