"""Where branches end near the origin: each from its tip inwards until it meets another one.

In an eigenmap, distance from the origin falls along a limb from its tip to the trunk. Taking the nodes from the farthest one on, a branch
begins at each local maximum; two that meet have come to what they share, which is trunk. A branch that is small, or whose tip is hardly
farther than the place where it meets another, is a bump of that one (superlevel sets and their persistence; Edelsbrunner et al. 2002).
Where two branches meet in a narrow place and go on apart, they only touch there: feet, or hands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Branches", "PieceSettings", "limb_pieces"]


@dataclass(frozen=True)
class PieceSettings:
    """When branches begin, touch and end.

    Parameters
    ----------
    least_nodes : int
        Smaller branches are bumps.
    least_rise : float
        A tip that is not at least so many times farther than where its branch meets another is that of a bump.
    widest_touch : int
        Faces of voxels over which branches may touch; those that share more have met for good.
    apart_nodes : int
        Nodes by which a branch grows without touching the other one until a touch is over.
    """

    least_nodes: int = 30
    least_rise: float = 1.2
    widest_touch: int = 30
    apart_nodes: int = 60


@dataclass(frozen=True)
class Branches:
    """The branches of an embedded graph.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        Number of the branch of each node, from 0, the one with the farthest tip first; -1 for the trunk.
    touches : tuple of (int, int)
        Branches that touch before they end.
    cut : ndarray of int, shape (k, 2)
        Pairs of neighbours across touches.
    """

    labels: np.ndarray
    touches: tuple[tuple[int, int], ...]
    cut: np.ndarray

    @property
    def count(self) -> int:
        """Number of branches."""
        return int(self.labels.max(initial=-1)) + 1


def limb_pieces(edges: np.ndarray, far: np.ndarray, nearest: float, settings: PieceSettings | None = None) -> Branches:
    """Find the branches.

    Parameters
    ----------
    edges : ndarray of int, shape (m, 2)
    far : ndarray, shape (n,)
        Distances from the origin.
    nearest : float
        Nodes nearer than this to the origin are trunk.
    settings : PieceSettings, optional
    """
    settings = settings or PieceSettings()
    n = len(far)
    starts, neighbours = _neighbour_lists(edges, n)
    height = far.tolist()
    parent, size = list(range(n)), [1] * n
    seen, trunk = [False] * n, [False] * n
    ended: dict[int, float] = {}  # branch -> height at which it ended
    meetings: dict[tuple[int, int], _Meeting] = {}

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    def grown(one: int, level: float) -> bool:
        return size[one] >= settings.least_nodes and height[one] >= settings.least_rise * level

    order = np.argsort(-far, kind="stable")
    order = order[far[order] > nearest].tolist()
    for node in order:
        level = height[node]
        near = [other for other in neighbours[starts[node] : starts[node + 1]] if seen[other]]
        seen[node] = True
        met = [root(other) for other in near if not trunk[other]]
        if met and len(met) == len(near) == met.count(met[0]) and met[0] not in ended:
            # Most nodes lie within one branch.
            parent[node] = met[0]
            size[met[0]] += 1
            continue
        roots = sorted(set(met), key=lambda one: -height[one])
        if len(met) < len(near) or any(one in ended for one in roots):
            trunk[node] = True
            for one in roots:
                ended.setdefault(one, level)
            continue
        large = [one for one in roots if grown(one, level)]
        if len(large) > 1:
            # The node goes to the branch that it has most neighbours in; its faces with the others are where they touch.
            home = max(large, key=lambda one: (met.count(one), height[one]))
            for other in large:
                if other != home:
                    pair = (min(home, other), max(home, other))
                    meeting = meetings.setdefault(pair, _Meeting())
                    sizes = (size[pair[0]], size[pair[1]])
                    if not meeting.now or min(a - b for a, b in zip(sizes, meeting.sizes, strict=True)) > settings.apart_nodes:
                        meeting.now, meeting.began = [], level
                        meeting.episodes.append(meeting.now)
                    meeting.sizes = sizes
                    meeting.now.extend((node, place) for place in near if not trunk[place] and root(place) == other)
                    if len(meeting.now) > settings.widest_touch:
                        # They have met for good, and that began with this meeting.
                        meeting.episodes.pop()
                        for one in pair:
                            ended[one] = max(meeting.began, ended.get(one, 0.0))
                        meeting.now = []
            parent[node] = home
            size[home] += 1
            roots = [one for one in roots if one not in large]
            roots.insert(0, home)
        elif roots:
            parent[node] = roots[0]
            size[roots[0]] += 1
        for one in roots[1:]:
            parent[one] = roots[0]
            size[roots[0]] += size[one]
    labels = np.full(n, -1)
    tips: dict[int, int] = {}
    for node in order:
        one = root(node)
        if not trunk[node] and size[one] >= settings.least_nodes and height[node] > ended.get(one, 0.0):
            labels[node] = tips.setdefault(one, len(tips))
    touches, cut = [], []
    for pair, meeting in meetings.items():
        places = [edge for episode in meeting.episodes for edge in episode if labels[edge[0]] >= 0 and labels[edge[1]] >= 0]
        if places and pair[0] in tips and pair[1] in tips:
            touches.append((min(tips[pair[0]], tips[pair[1]]), max(tips[pair[0]], tips[pair[1]])))
            cut += places
    return Branches(labels, tuple(sorted(set(touches))), np.array(cut, int).reshape(-1, 2))


class _Meeting:
    """Where two branches have met so far: the faces of each touch, the level at which the present one began, and the sizes then."""

    def __init__(self) -> None:
        self.episodes: list[list[tuple[int, int]]] = []
        self.now: list[tuple[int, int]] = []
        self.began = 0.0
        self.sizes = (0, 0)


def _neighbour_lists(edges: np.ndarray, n: int) -> tuple[list[int], list[int]]:
    """Neighbours of all nodes one after the other, and where each node's begin."""
    both = np.concatenate([edges, edges[:, ::-1]])
    order = np.argsort(both[:, 0], kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(both[:, 0], minlength=n))])
    return starts.tolist(), both[order, 1].tolist()
