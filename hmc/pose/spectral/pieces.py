"""Where branches end near the origin: each from its tip inwards until it meets another one.

In an eigenmap, distance from the origin falls along a limb from its tip to the trunk. Taking the nodes from the farthest one on, a branch
begins at each local maximum; two that meet have come to what they share, which is trunk. A branch that is small, or whose tip is hardly
farther than the place where it meets another, is a bump of that other one. (Superlevel sets and their persistence; Edelsbrunner et al. 2002.)
"""

from __future__ import annotations

import numpy as np

__all__ = ["limb_pieces"]


def limb_pieces(edges: np.ndarray, far: np.ndarray, nearest: float, least_nodes: int, least_rise: float) -> np.ndarray:
    """The branch that each node belongs to.

    Parameters
    ----------
    edges : ndarray of int, shape (m, 2)
    far : ndarray, shape (n,)
        Distances from the origin.
    nearest : float
        Nodes nearer than this to the origin are trunk.
    least_nodes : int
        Smaller branches are bumps.
    least_rise : float
        A tip that is not at least so many times farther than where its branch meets another is that of a bump.

    Returns
    -------
    ndarray of int, shape (n,)
        Number of the branch, from 0, the one with the farthest tip first; -1 for the trunk.
    """
    n = len(far)
    starts, neighbours = _neighbour_lists(edges, n)
    height = far.tolist()
    parent, size, ended = list(range(n)), [1] * n, [False] * n
    seen = [False] * n
    trunk = [False] * n

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    order = np.argsort(-far, kind="stable")
    order = order[far[order] > nearest].tolist()
    for node in order:
        seen[node] = True
        near = neighbours[starts[node] : starts[node + 1]]
        at_trunk = any(trunk[other] for other in near if seen[other])
        met = sorted({root(other) for other in near if seen[other] and not trunk[other]}, key=lambda one: height[one], reverse=True)
        grown = [one for one in met if size[one] >= least_nodes and height[one] >= least_rise * height[node]]
        if at_trunk or len(grown) > 1 or any(ended[one] for one in met):
            # Here branches meet one another, or what they share: they end, and bumps are part of what they stand on.
            trunk[node] = True
            for one in met:
                if one in grown:
                    ended[one] = True
                elif at_trunk and not ended[one]:
                    ended[one] = True
            continue
        if met:
            # The root is the tip, so it is the farthest one that stays.
            parent[node] = met[0]
            size[met[0]] += 1
            for one in met[1:]:
                parent[one] = met[0]
                size[met[0]] += size[one]
    labels = np.full(n, -1)
    tips: dict[int, int] = {}
    for node in order:
        if not trunk[node]:
            one = root(node)
            if size[one] >= least_nodes:
                labels[node] = tips.setdefault(one, len(tips))
    return labels


def _neighbour_lists(edges: np.ndarray, n: int) -> tuple[list[int], list[int]]:
    """Neighbours of all nodes one after the other, and where each node's begin."""
    both = np.concatenate([edges, edges[:, ::-1]])
    order = np.argsort(both[:, 0], kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(both[:, 0], minlength=n))])
    return starts.tolist(), both[order, 1].tolist()
