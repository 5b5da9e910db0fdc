"""Branches of an eigenmap, grown as splines from their tips inwards.

Source: Hsiao (2008), section 3.1.4.1, steps B-1 to B-4 (Sundaresan's method: a branch ends where too many nodes are far from the spline),
and section 3.1.4.2, steps B-1 to B-3 (the modified one: a branch ends near the origin). Distances are shares of the distance from the origin
of the farthest node, so that settings do not depend on the number of voxels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from hmc.pose.spectral.pieces import limb_pieces

__all__ = ["Branch", "GrowSettings", "baseline_growing", "grow_branches"]


@dataclass(frozen=True)
class GrowSettings:
    """How branches are grown.

    Parameters
    ----------
    stop : {"origin", "outliers"}
        "outliers" is Sundaresan's termination, "origin" the modified one.
    first_nodes, next_nodes : int
        P and N: nodes of the first fit, and of each step.
    turn_deg : float
        A new principal direction is taken where it differs by more than this from the old one, degrees.
    origin_radius : float
        A branch ends where it is nearer to the origin than this, in median distances of the core from the origin, or meets another.
    least_rise : float
        The tip of a branch is at least so many times farther from the origin than the place where it meets another.
    outlier_error, most_outliers : float, int
        OT2, in median distances of all nodes from the origin, and OT1, nodes of a branch.
    most_branches : int
    least_nodes : int
        Smaller branches are left out.
    """

    stop: Literal["origin", "outliers"] = "origin"
    first_nodes: int = 14
    next_nodes: int = 14
    turn_deg: float = 10.0
    origin_radius: float = 1.25
    least_rise: float = 1.2
    outlier_error: float = 0.05
    most_outliers: int = 15
    reach: float = 0.15
    most_branches: int = 8
    least_nodes: int = 30


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


def grow_branches(places: np.ndarray, edges: np.ndarray, core: np.ndarray, settings: GrowSettings | None = None) -> list[Branch]:
    """All branches of an embedding, the one with the farthest tip first.

    Parameters
    ----------
    places : ndarray, shape (n, k)
        Of the nodes in the eigenspace.
    edges : ndarray of int, shape (m, 2)
        Of the graph: what is near the origin left out, a branch is connected.
    core : ndarray of bool, shape (n,)
        Nodes deep inside the body, which say how far from the origin the trunk reaches. All nodes where none is.
    settings : GrowSettings, optional

    Returns
    -------
    list of Branch
        No node is in two.
    """
    settings = settings or GrowSettings()
    if len(places) < settings.first_nodes + 1:
        return []
    far = np.linalg.norm(places, axis=1)
    free, pieces = np.ones(len(places), bool), np.zeros(len(places), int)
    if settings.stop == "origin":
        trunk = float(np.median(far[core] if core.any() else far))
        pieces = limb_pieces(edges, far, settings.origin_radius * trunk, settings.least_nodes, settings.least_rise)
        free = pieces >= 0
    branches: list[Branch] = []
    tree = cKDTree(places)
    while len(branches) < settings.most_branches and free.any():
        tip = int(np.argmax(np.where(free, far, -1.0)))
        branch = _grow(places, tree, far, free & (pieces == pieces[tip]), tip, settings)
        if settings.stop == "origin":
            branch = _with_rest(places, branch, np.setdiff1d(np.flatnonzero(free & (pieces == pieces[tip])), branch.nodes))
        free[branch.nodes] = False
        if len(branch.nodes) >= settings.least_nodes:
            branches.append(branch)
    return branches


def _with_rest(places: np.ndarray, branch: Branch, rest: np.ndarray) -> Branch:
    """A branch with nodes beside it, each at the site of the branch's nearest node."""
    if len(rest) == 0:
        return branch
    nearest = cKDTree(places[branch.nodes]).query(places[rest])[1]
    return Branch(np.concatenate([branch.nodes, rest]), np.concatenate([branch.sites, branch.sites[nearest]]))


def _grow(places: np.ndarray, tree: cKDTree, far: np.ndarray, free: np.ndarray, tip: int, settings: GrowSettings) -> Branch:
    """One branch, from its tip inwards."""
    nodes = _nearest(tree, places, free, places[tip], settings.first_nodes + 1)
    direction = _principal(places[nodes], places[nodes].mean(0) - places[tip])
    sites = (places[nodes] - places[tip]) @ direction
    free = free.copy()
    free[nodes] = False
    limit, reach = settings.outlier_error * float(np.median(far)), settings.reach * far[tip]
    outliers = 0
    while True:
        end = int(np.argmax(sites))
        here = places[nodes[end]]
        new = _nearest(tree, places, free, here, settings.next_nodes)
        new = new[np.linalg.norm(places[new] - here, axis=1) < reach]
        if len(new) == 0:
            break
        recent = np.argsort(sites)[-2 * settings.next_nodes :]
        turned = _principal(places[np.concatenate([nodes[recent], new])], direction)
        if turned @ direction < np.cos(np.radians(settings.turn_deg)):
            direction = turned
        new_sites = float(sites[end]) + (places[new] - here) @ direction
        if settings.stop == "outliers":
            curve = _curve(sites[recent], places[nodes[recent]], new_sites)
            off = np.linalg.norm(places[new] - curve, axis=1) > limit
            outliers += np.count_nonzero(off)
            if outliers > settings.most_outliers:
                break
        nodes, sites = np.concatenate([nodes, new]), np.concatenate([sites, new_sites])
        free[new] = False
    return Branch(nodes, sites)


def _nearest(tree: cKDTree, places: np.ndarray, free: np.ndarray, point: np.ndarray, n: int) -> np.ndarray:
    """The n free nodes nearest to a point."""
    k = min(4 * n, len(places))
    while True:
        found = np.atleast_1d(tree.query(point, k)[1])
        found = found[free[found]]
        if len(found) >= n or k == len(places):
            return found[:n]
        k = min(4 * k, len(places))


def _principal(points: np.ndarray, along: np.ndarray) -> np.ndarray:
    """First principal direction of some points, on the side of `along`."""
    direction = np.linalg.svd(points - points.mean(0), full_matrices=False)[2][0]
    return direction if direction @ along >= 0 else -direction


def _curve(sites: np.ndarray, places: np.ndarray, new_sites: np.ndarray) -> np.ndarray:
    """The spline through the last nodes, continued straight on to new site values: where a branch would go on."""
    middle = sites.mean()
    slope = ((sites - middle) @ (places - places.mean(0))) / max(((sites - middle) ** 2).sum(), 1e-300)
    return places.mean(0) + (new_sites - middle)[:, None] * slope
