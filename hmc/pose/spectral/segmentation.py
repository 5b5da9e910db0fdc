"""Voxels of a person to parts of a body. Hsiao (2008), section 3.1.4; naming, joining of pieces and doubts are ours."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from hmc.pose.spectral.eigenmap import eigenmap
from hmc.pose.spectral.graph import GraphSettings, VoxelGraph, adjacency, build_graph, core_nodes
from hmc.pose.spectral.growing import (
    Branch,
    GrowSettings,
    baseline_growing,
    ends_near_origin,
    grow_branches,
    printed_growing,
    trunk_radius,
)
from hmc.pose.spectral.parts import PART_NAMES, BranchShape, branch_shape, name_branches
from hmc.pose.spectral.pieces import Branches
from hmc.pose.spectral.touching import contacts, touching_parts

__all__ = ["LimbSegmentationSettings", "Segmentation", "baseline_segmentation", "printed_segmentation", "segment_body"]


@dataclass(frozen=True)
class LimbSegmentationSettings:
    """Parameters of the segmentation.

    Parameters
    ----------
    graph : GraphSettings
    grow : GrowSettings
    dimensions : int
        Of the eigenspace.
    bridge_m : float
        Pieces of the hull that are nearer than this to the largest one belong to it, metres.
    longest_limb_m : float
        A branch that begins and ends at the trunk and is longer than this is two limbs whose ends touch, metres.
    hip_m : float
        A leg reaches so far above where it leaves the other one, metres: to the hip.
    least_voxels : int
        Fewer voxels are no body.
    """

    graph: GraphSettings = field(default_factory=GraphSettings)
    grow: GrowSettings = field(default_factory=GrowSettings)
    dimensions: int = 6
    bridge_m: float = 0.13
    longest_limb_m: float = 1.05
    hip_m: float = 0.09
    least_voxels: int = 150


@dataclass(frozen=True)
class Segmentation:
    """Parts of a body.

    Parameters
    ----------
    labels : ndarray of int, shape (n,)
        Place in `PART_NAMES` of each voxel; -1 where it is unknown.
    places : ndarray, shape (n, k)
        Of the voxels in the eigenspace; NaN for voxels that are not joined to the body.
    branches : dict of str to Branch
        By the names of their parts; nodes are rows of the voxels.
    shapes : dict of str to BranchShape
    edges : ndarray of int, shape (m, 2)
    doubts : tuple of str
        What is missing or too many.
    touching : tuple of str
        Parts that touch where they should not.
    status : str
        ``"segmented"``, or why not.
    others : tuple of ndarray of int
        Voxels of branches that are no part by their shape and place.
    """

    labels: np.ndarray
    places: np.ndarray
    branches: dict[str, Branch]
    shapes: dict[str, BranchShape]
    edges: np.ndarray
    doubts: tuple[str, ...]
    touching: tuple[str, ...]
    status: str
    others: tuple[np.ndarray, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether every part was found, and nothing else."""
        return self.status == "segmented" and set(self.branches) == set(PART_NAMES[1:]) and not self.doubts

    def voxels_of(self, part: str) -> np.ndarray:
        """Rows of the voxels of a part."""
        return np.flatnonzero(self.labels == PART_NAMES.index(part))


def baseline_segmentation() -> LimbSegmentationSettings:
    """Sundaresan's method: plain weights, branches that end by outliers. Hsiao (2008), section 3.1.4.1."""
    return LimbSegmentationSettings(GraphSettings(shrink=0.0), baseline_growing())


def printed_segmentation() -> LimbSegmentationSettings:
    """The modified method as printed (section 3.1.4.2, A-1 to B-3): nodes with all six neighbours shrink, nothing is cut or joined.

    Not printed, and as in ours: the weight of the shrinking (2 in the example of Figure 3-12), a, b, c and the thresholds of Eq. 3-15, P,
    N, the angle of a new direction and the distance from the origin.
    """
    return LimbSegmentationSettings(GraphSettings(core_m=0.0), printed_growing(), bridge_m=0.0, hip_m=0.0)


def segment_body(
    voxels: np.ndarray,
    points: np.ndarray,
    voxel_size_m: float,
    settings: LimbSegmentationSettings | None = None,
    votes: tuple[np.ndarray, np.ndarray] | None = None,
) -> Segmentation:
    """Cut a person's voxels into parts.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
    points : ndarray, shape (n, 3)
        Their centres, world, metres.
    voxel_size_m : float
    settings : LimbSegmentationSettings, optional
    votes : (votes, voters), optional
        Color votes over `face_neighbours` of the voxels (`hmc.pose.spectral.graph.color_votes`).

    Returns
    -------
    Segmentation
        Its status says why where there is none.
    """
    settings = settings or LimbSegmentationSettings()
    n = len(voxels)
    if n < settings.least_voxels:
        return _nothing(n, f"{n} voxels are too few for a body")
    graph = bridged(build_graph(voxels, voxel_size_m, settings.graph, votes), points, voxel_size_m, settings)
    pieces = connected_components(adjacency(graph), directed=False)[1]
    body = pieces == np.bincount(pieces).argmax()
    if np.count_nonzero(body) < settings.least_voxels:
        return _nothing(n, "the voxels fall into small pieces")
    inside, number = np.flatnonzero(body), np.cumsum(body) - 1
    kept = body[graph.edges].all(1)
    graph = VoxelGraph(voxels[inside], number[graph.edges[kept]], graph.weights[kept])
    places = eigenmap(adjacency(graph), settings.dimensions).vectors
    core = core_nodes(graph.voxels, voxel_size_m, settings.graph.core_m)
    limbs: Branches | None = None
    met: Branches | None = None
    if settings.grow.stop == "origin":
        limbs = ends_near_origin(places, graph.edges, core, settings.grow)
        cut = np.concatenate([limbs.cut, *(_halves(graph.edges, limbs.labels == k, points[inside], settings) for k in range(limbs.count))])
        if len(cut):
            # Without the faces over which limbs touch, each goes its own way.
            apart = without_edges(graph, cut)
            trial = eigenmap(adjacency(apart), settings.dimensions)
            if trial.labels.max() == 0:
                graph, places, met = apart, trial.vectors, limbs
                limbs = ends_near_origin(places, graph.edges, core, settings.grow)
    radius = trunk_radius(places, core, settings.grow) if settings.grow.stop == "radius" else 0.0
    branches = grow_branches(places, limbs, settings.grow, radius)
    labels = _labels_of(branches, graph.edges, len(inside))
    shapes = [branch_shape(branch, points[inside], voxel_size_m) for branch in branches]
    rest = points[inside][labels < 0]
    names, doubts = name_branches(shapes, rest.mean(0) if len(rest) else points[inside].mean(0))
    along = np.zeros(len(inside))
    for branch in branches:
        along[branch.nodes] = (branch.sites - branch.sites.min()) / max(np.ptp(branch.sites), 1e-12)
    known = [k for k, name in enumerate(names) if name]
    stars = np.zeros(len(inside), int)
    for place, k in enumerate(known):
        stars[labels == k] = place + 1
    touching = touching_parts(stars, graph.edges, along, ("trunk", *(names[k] for k in known)))
    if met is not None and names:
        found = [np.bincount(labels[(met.labels == k) & (labels >= 0)], minlength=1).argmax() for k in range(met.count)]
        touching += tuple(f"{names[found[a]]} and {names[found[b]]}" for a, b in met.touches if names[found[a]] and names[found[b]])
    if limbs is not None:
        labels = _legs_to_hips(labels, names, graph.edges, round(settings.hip_m / voxel_size_m))
    out = np.full(n, -1)
    trunk = labels < 0
    if settings.grow.stop == "outliers":
        # Sundaresan's method leaves what it does not fit; what it takes for a branch and is no limb is the trunk.
        trunk = np.isin(labels, [k for k, name in enumerate(names) if not name])
    part = np.where(trunk, 0, -1)
    for k in known:
        part[labels == k] = PART_NAMES.index(names[k])
    out[inside] = part
    all_places = np.full((n, places.shape[1]), np.nan)
    all_places[inside] = places
    if n - len(inside) > 0.1 * n:
        doubts = (*doubts, f"{n - len(inside)} of {n} voxels are apart from the body")
    edges = inside[graph.edges]
    moved = {names[k]: Branch(inside[branches[k].nodes], branches[k].sites) for k in known}
    others = tuple(inside[branch.nodes] for branch, name in zip(branches, names, strict=True) if not name)
    return Segmentation(out, all_places, moved, {names[k]: shapes[k] for k in known}, edges, doubts, touching, "segmented", others)


def _halves(edges: np.ndarray, own: np.ndarray, points: np.ndarray, settings: LimbSegmentationSettings) -> np.ndarray:
    """Where to cut a branch that is two limbs in one, pairs of neighbours: half-way between the two points where it meets the trunk."""
    none = np.zeros((0, 2), int)
    places = contacts(own.astype(int), edges, 1, 0)
    if len(places) < 2:
        return none
    rows, number = np.flatnonzero(own), np.cumsum(own) - 1
    inner = number[edges[own[edges].all(1)]]
    steps = np.ones(len(inner))
    graph = csr_array((steps, (inner[:, 0], inner[:, 1])), shape=(len(rows), len(rows)))
    ways = [dijkstra(graph, directed=False, indices=number[place], min_only=True, unweighted=True) for place in places[:2]]
    voxel = float(np.median(np.linalg.norm(points[edges[:50, 0]] - points[edges[:50, 1]], axis=1)))
    # Steps along faces are longer than the way; a limb of two has the far contact at the end of its longer half.
    if ways[0][number[places[1]]].min() * voxel < settings.longest_limb_m:
        return none
    side = ways[0] < ways[1]
    return rows[inner[side[inner[:, 0]] != side[inner[:, 1]]]]


def _legs_to_hips(labels: np.ndarray, names: list[str], edges: np.ndarray, steps: int) -> np.ndarray:
    """Labels with the legs grown into the trunk, step by step, so that they meet half-way."""
    legs = [k for k, name in enumerate(names) if name.startswith("leg")]
    labels = labels.copy()
    both = np.concatenate([edges, edges[:, ::-1]])
    for _ in range(steps):
        ahead = both[np.isin(labels[both[:, 0]], legs) & (labels[both[:, 1]] < 0)]
        labels[ahead[:, 1]] = labels[ahead[:, 0]]
    return labels


def without_edges(graph: VoxelGraph, cut: np.ndarray) -> VoxelGraph:
    """The graph without some of its edges, given as pairs of nodes in either order."""
    n = len(graph.voxels)
    keys = np.sort(graph.edges, axis=1) @ [n, 1]
    kept = ~np.isin(keys, np.sort(cut, axis=1) @ [n, 1])
    return VoxelGraph(graph.voxels, graph.edges[kept], graph.weights[kept])


def bridged(graph: VoxelGraph, points: np.ndarray, voxel_size_m: float, settings: LimbSegmentationSettings) -> VoxelGraph:
    """Join pieces of the hull that hardly lie apart: a silhouette that lost a wrist must not cost the hand.

    Parameters
    ----------
    graph : VoxelGraph
    points : ndarray, shape (n, 3)
        Centres of the voxels, metres.
    voxel_size_m : float
    settings : LimbSegmentationSettings
    """
    edges, weights = [graph.edges], [graph.weights]
    while True:
        joined = VoxelGraph(graph.voxels, np.concatenate(edges), np.concatenate(weights))
        pieces = connected_components(adjacency(joined), directed=False)[1]
        sizes = np.bincount(pieces)
        body = np.flatnonzero(pieces == sizes.argmax())
        others = np.flatnonzero(pieces != sizes.argmax())
        if len(others) == 0:
            return joined
        distance, nearest = map(np.asarray, cKDTree(points[body]).query(points[others], distance_upper_bound=settings.bridge_m))
        found = np.flatnonzero(np.isfinite(distance))
        if len(found) == 0:
            return joined
        piece = pieces[others[found]]
        # Of each piece, the pairs that are hardly farther apart than the nearest one.
        least = np.full(len(sizes), np.inf)
        np.minimum.at(least, piece, distance[found])
        found = found[distance[found] < least[piece] + 0.8 * voxel_size_m]
        edges.append(np.stack([others[found], body[nearest[found]]], axis=1).astype(graph.edges.dtype))
        weights.append(np.full(len(found), 1.0))


def _labels_of(branches: list[Branch], edges: np.ndarray, n: int) -> np.ndarray:
    """Number of the branch of each node, -1 for none; scraps that a branch cuts off the trunk are that branch's."""
    labels = np.full(n, -1)
    for k, branch in enumerate(branches):
        labels[branch.nodes] = k
    rest = labels < 0
    if not rest.any():
        return labels
    a, b = edges[rest[edges].all(1)].T
    pieces = connected_components(csr_array((np.ones(len(a), np.int8), (a, b)), shape=(n, n)), directed=False)[1]
    scraps = rest & (pieces != np.bincount(pieces[rest]).argmax())
    both = np.concatenate([edges, edges[:, ::-1]])
    both = both[scraps[both[:, 0]] & (labels[both[:, 1]] >= 0)]
    for piece in np.unique(pieces[scraps]):
        neighbours = labels[both[pieces[both[:, 0]] == piece, 1]]
        if len(neighbours):
            labels[scraps & (pieces == piece)] = np.bincount(neighbours).argmax()
    return labels


def _nothing(n: int, why: str) -> Segmentation:
    return Segmentation(np.full(n, -1), np.full((n, 0), np.nan), {}, {}, np.zeros((0, 2), int), (), (), why)
