"""Branches of an eigenmap, grown as splines from their tips inwards.

Source: Hsiao (2008), section 3.1.4.1, steps B-1 to B-4 (Sundaresan's method: a branch ends where too many nodes are far from the spline),
and section 3.1.4.2, steps B-1 to B-3 (the modified one: a branch ends near the origin). Distances are shares of the distance from the
origin of the farthest node, so that settings do not depend on the number of voxels.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from hmc.pose.spectral.pieces import Branches, PieceSettings, limb_pieces

__all__ = ["Branch", "GrowSettings", "baseline_growing", "ends_near_origin", "grow_branches", "printed_growing", "trunk_radius"]


@dataclass(frozen=True)
class GrowSettings:
    """How branches are grown.

    Parameters
    ----------
    stop : {"origin", "radius", "outliers"}
        "outliers" is Sundaresan's termination, "radius" the modified one as printed, "origin" ours, where branches end too when they meet.
    first_nodes, next_nodes : int
        P and N: nodes of the first fit, and of each step.
    turn_deg : float
        A new principal direction is taken where it differs by more than this from the old one, degrees.
    origin_radius : float
        A branch ends where it is nearer to the origin than this, in median distances of the core from the origin. The thesis says "a
        pre-defined threshold".
    pieces : PieceSettings
        When branches meet.
    outlier_error, most_outliers : float, int
        OT2, in median distances of all nodes from the origin, and OT1, nodes of a branch.
    reach : float
        How far a branch looks for its next nodes and for those beside it, as a share of the distance from the origin there: branches come
        close to one another as they come near to it.
    most_branches, least_nodes : int
        How many branches are grown where they do not meet, and how small they may be.
    """

    stop: Literal["origin", "radius", "outliers"] = "origin"
    first_nodes: int = 14
    next_nodes: int = 14
    turn_deg: float = 10.0
    origin_radius: float = 1.25
    pieces: PieceSettings = field(default_factory=PieceSettings)
    outlier_error: float = 0.05
    most_outliers: int = 15
    reach: float = 0.3
    most_branches: int = 8
    least_nodes: int = 10


@dataclass(frozen=True)
class Branch:
    """A branch of the embedding.

    Parameters
    ----------
    nodes : ndarray of int, shape (n,)
        In the order in which they were reached.
    sites : ndarray, shape (n,)
        Site values: how far along the branch each node is from the tip, in the embedding's units.
    """

    nodes: np.ndarray
    sites: np.ndarray


def baseline_growing() -> GrowSettings:
    """Sundaresan's termination."""
    return replace(GrowSettings(), stop="outliers", most_branches=6)


def printed_growing() -> GrowSettings:
    """The modified termination as printed, by the distance from the origin alone; five branches and the trunk are the six parts.

    The distance is not printed: of 1.0 to 1.3 this one puts the most voxels into their true part (docs/spectral.md).
    """
    return replace(GrowSettings(), stop="radius", most_branches=5, origin_radius=1.15)


def ends_near_origin(places: np.ndarray, edges: np.ndarray, core: np.ndarray, settings: GrowSettings | None = None) -> Branches:
    """Where branches end: near the origin, or where they meet. Arguments as for `grow_branches`, and:

    Parameters
    ----------
    places : ndarray, shape (n, k)
    edges : ndarray of int, shape (m, 2)
        Of the graph.
    core : ndarray of bool, shape (n,)
        Nodes deep inside the body, which say how far from the origin the trunk reaches. All nodes where none is.
    settings : GrowSettings, optional
    """
    settings = settings or GrowSettings()
    far = np.linalg.norm(places, axis=1)
    return limb_pieces(edges, far, trunk_radius(places, core, settings), settings.pieces)


def trunk_radius(places: np.ndarray, core: np.ndarray, settings: GrowSettings) -> float:
    """How far from the origin branches end; arguments as for `ends_near_origin`."""
    far = np.linalg.norm(places, axis=1)
    return settings.origin_radius * float(np.median(far[core] if core.any() else far))


def grow_branches(
    places: np.ndarray, pieces: Branches | None = None, settings: GrowSettings | None = None, radius: float = 0.0
) -> list[Branch]:
    """All branches of an embedding, the one with the farthest tip first.

    Parameters
    ----------
    places : ndarray, shape (n, k)
        Of the nodes in the eigenspace.
    pieces : Branches, optional
        Where branches end (`ends_near_origin`); left out, each ends by Sundaresan's outliers or near the origin.
    settings : GrowSettings, optional
    radius : float
        No branch grows nearer to the origin than this (`trunk_radius`).

    Returns
    -------
    list of Branch
        No node is in two.
    """
    settings = settings or GrowSettings()
    far = np.linalg.norm(places, axis=1)
    if pieces is not None:
        branches = []
        for number in range(pieces.count):
            own = np.flatnonzero(pieces.labels == number)
            branch = _grow(places[own], far[own], np.ones(len(own), bool), settings)
            branches.append(_with_rest(places[own], branch, own))
        return branches
    branches, free, outside = [], np.ones(len(places), bool), far > radius
    while len(branches) < settings.most_branches and np.count_nonzero(free & outside) > settings.first_nodes:
        branch = _grow(places, far, free, settings, radius)
        if settings.stop == "radius":
            branch = _with_near(places, far, _where(branch, outside), free & outside, settings.reach)
        free[branch.nodes] = False
        if len(branch.nodes) >= settings.least_nodes:
            branches.append(branch)
    return branches


def _with_rest(places: np.ndarray, branch: Branch, nodes: np.ndarray) -> Branch:
    """A branch of all these nodes: those beside what was grown have the site of the nearest grown one."""
    rest = np.setdiff1d(np.arange(len(nodes)), branch.nodes)
    nearest = cKDTree(places[branch.nodes]).query(places[rest])[1] if len(rest) else rest
    return Branch(nodes[np.concatenate([branch.nodes, rest])], np.concatenate([branch.sites, branch.sites[nearest]]))


def _where(branch: Branch, kept: np.ndarray) -> Branch:
    """A branch without some of its nodes; `kept` is of all nodes of the embedding."""
    own = kept[branch.nodes]
    return Branch(branch.nodes[own], branch.sites[own])


def _with_near(places: np.ndarray, far: np.ndarray, branch: Branch, free: np.ndarray, reach: float) -> Branch:
    """A branch with the free nodes beside it: what steps of N nodes left out would be branches of its own."""
    own = free.copy()
    own[branch.nodes] = False
    rest = np.flatnonzero(own)
    away, nearest = cKDTree(places[branch.nodes]).query(places[rest]) if len(rest) else (np.zeros(0), rest)
    near = away < reach * far[rest]
    return Branch(np.concatenate([branch.nodes, rest[near]]), np.concatenate([branch.sites, branch.sites[nearest[near]]]))


def _grow(places: np.ndarray, far: np.ndarray, free: np.ndarray, settings: GrowSettings, radius: float = 0.0) -> Branch:
    """One branch of the free nodes, from the farthest one inwards, until its end is as near to the origin as the radius."""
    free = free.copy()
    tip = int(np.argmax(np.where(free, far, -1.0)))
    nodes = _nearest(places, free, places[tip], settings.first_nodes + 1)
    direction = _principal(places[nodes], places[nodes].mean(0) - places[tip])
    sites = (places[nodes] - places[tip]) @ direction
    free[nodes] = False
    limit = settings.outlier_error * float(np.median(far))
    outliers: int = 0
    while True:
        end = int(np.argmax(sites))
        here = places[nodes[end]]
        if far[nodes[end]] <= radius:
            break
        new = _nearest(places, free, here, settings.next_nodes)
        new = new[np.linalg.norm(places[new] - here, axis=1) < settings.reach * far[nodes[end]]]
        if len(new) == 0:
            break
        recent = np.argsort(sites)[-2 * settings.next_nodes :]
        turned = _principal(places[np.concatenate([nodes[recent], new])], direction)
        if turned @ direction < np.cos(np.radians(settings.turn_deg)):
            direction = turned
        new_sites = float(sites[end]) + (places[new] - here) @ direction
        if settings.stop == "outliers":
            curve = _curve(sites[recent], places[nodes[recent]], new_sites)
            outliers += int(np.count_nonzero(np.linalg.norm(places[new] - curve, axis=1) > limit))
            if outliers > settings.most_outliers:
                break
        nodes, sites = np.concatenate([nodes, new]), np.concatenate([sites, new_sites])
        free[new] = False
    return Branch(nodes, sites)


def _nearest(places: np.ndarray, free: np.ndarray, point: np.ndarray, n: int) -> np.ndarray:
    """The n free nodes nearest to a point, nearest first."""
    left = np.flatnonzero(free)
    distance = ((places[left] - point) ** 2).sum(1)
    if len(left) > n:
        chosen = np.argpartition(distance, n)[:n]
        left, distance = left[chosen], distance[chosen]
    return left[np.argsort(distance)]


def _principal(points: np.ndarray, along: np.ndarray) -> np.ndarray:
    """First principal direction of some points, on the side of `along`."""
    centred = points - points.mean(0)
    direction = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    return direction if direction @ along >= 0 else -direction


def _curve(sites: np.ndarray, places: np.ndarray, new_sites: np.ndarray) -> np.ndarray:
    """The spline through the last nodes, continued straight on to new site values: where a branch would go on."""
    middle = sites.mean()
    slope = ((sites - middle) @ (places - places.mean(0))) / max(((sites - middle) ** 2).sum(), 1e-300)
    return places.mean(0) + (new_sites - middle)[:, None] * slope
