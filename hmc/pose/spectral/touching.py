"""Parts that touch: a body is a star, whose limbs meet the trunk once each and one another never; what else meets, touches."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

__all__ = ["contacts", "touching_parts"]

#: Limbs may meet this share of their length from their bases: thighs do below the crotch.
BASE_SHARE = 0.35
#: Fewer edges than this are no contact.
LEAST_EDGES = 3


def contacts(labels: np.ndarray, edges: np.ndarray, first: int, second: int) -> list[np.ndarray]:
    """Places where two parts meet.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        Part of each voxel.
    edges : ndarray of int, shape (m, 2)
        Face neighbours.
    first, second : int
        Labels.

    Returns
    -------
    list of ndarray of int
        Voxels of the first part that have a neighbour in the second, place by place; the largest first.
    """
    a, b = edges.T
    border = np.concatenate([a[(labels[a] == first) & (labels[b] == second)], b[(labels[b] == first) & (labels[a] == second)]])
    here, counts = np.unique(border, return_counts=True)
    if len(here) == 0:
        return []
    # Border voxels belong to one place when a path of two steps within the first part joins them: borders are jagged.
    n, inside = len(labels), (labels[a] == first) & (labels[b] == first)
    graph = csr_array((np.ones(2 * inside.sum(), np.int32), (np.r_[a[inside], b[inside]], np.r_[b[inside], a[inside]])), shape=(n, n))
    near = graph[here] @ graph[:, here] + graph[here][:, here]
    pieces = connected_components(near, directed=False)[1]
    found = [here[pieces == piece] for piece in range(pieces.max() + 1) if counts[pieces == piece].sum() >= LEAST_EDGES]
    return sorted(found, key=len, reverse=True)


def touching_parts(labels: np.ndarray, edges: np.ndarray, along: np.ndarray, names: tuple[str, ...]) -> tuple[str, ...]:
    """Which parts touch where they should not.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        0 the trunk, from 1 on the branches, -1 unknown.
    edges : ndarray of int, shape (m, 2)
    along : ndarray, shape (n,)
        How far along its branch a voxel is: 0 at the tip, 1 at the base.
    names : tuple of str
        Of the labels.

    Returns
    -------
    tuple of str
        One a contact, such as ``"arm_1 and arm_2"``, or ``"arm_1 and trunk"`` for a limb that meets the trunk a second time.
    """
    found = []
    for k in range(1, len(names)):
        if len(contacts(labels, edges, k, 0)) > 1:
            found.append(f"{names[k]} and {names[0]}")
        for other in range(k + 1, len(names)):
            places = contacts(labels, edges, k, other)
            if any(along[place].mean() < 1 - BASE_SHARE for place in places):
                found.append(f"{names[k]} and {names[other]}")
    return tuple(found)
