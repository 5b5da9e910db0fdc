"""People whom no track owns yet, among the voxels of a frame: pieces put together.

What makes one a person is decided by `hmc.tracking.likeness.looks_like_person`. Source: Canton (2009), section 4.2.3.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from hmc.tracking.blobs import Blobs, Observation, blob_features
from hmc.tracking.likeness import looks_like_person
from hmc.tracking.settings import LifecycleSettings

__all__ = ["newcomers", "unowned_blobs"]


def unowned_blobs(observation: Observation, owners: np.ndarray, settings: LifecycleSettings) -> tuple[np.ndarray, Blobs]:
    """Sets of voxels that no track owns, ready to be judged.

    A component that looks like a person stands for itself; the other pieces are put together with those that stand close, seen
    from above, because a person may come in pieces.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Row of the track that owns each voxel, or -1.
    settings : LifecycleSettings

    Returns
    -------
    labels : ndarray of int, shape (n,)
        Set of each voxel, -1 for owned ones.
    blobs : Blobs
    """
    size = observation.voxel_size_m
    labels = np.full(len(owners), -1)
    free = owners < 0
    if not free.any():
        return labels, blob_features(observation.points, labels, 0, size)
    present = np.bincount(observation.labels[free]) > 0
    labels[free] = (np.cumsum(present) - 1)[observation.labels[free]]
    n_pieces = int(present.sum())
    whole = looks_like_person(blob_features(observation.points, labels, n_pieces, size), settings)
    in_pieces = free & ~whole[labels]
    where = observation.indices[in_pieces, :2]
    shape = (n_pieces, *(where.max(axis=0, initial=0) + 1))
    columns = np.unique(np.ravel_multi_index((labels[in_pieces], *where.T), shape))
    piece, x, y = np.unravel_index(columns, shape)
    near = cKDTree(np.column_stack([x, y])).query_pairs(settings.fragment_gap_m / size, output_type="ndarray")
    a, b = piece[near[:, 0]], piece[near[:, 1]]
    links = coo_array((np.ones(len(a)), (a, b)), shape=(n_pieces, n_pieces))
    n_groups, group = connected_components(links, directed=False)
    labels[free] = group[labels[free]]
    return labels, blob_features(observation.points, labels, n_groups, size)


def newcomers(observation: Observation, owners: np.ndarray, settings: LifecycleSettings) -> list[np.ndarray]:
    """Sets of voxels that look like a person and that no track owns.

    Parameters
    ----------
    observation : Observation
    owners : ndarray of int, shape (n,)
        Row of the track that owns each voxel, or -1.
    settings : LifecycleSettings

    Returns
    -------
    list of ndarray of int
        Rows of the observation's voxels, a set each.
    """
    labels, blobs = unowned_blobs(observation, owners, settings)
    return [np.flatnonzero(labels == b) for b in np.flatnonzero(looks_like_person(blobs, settings))]
