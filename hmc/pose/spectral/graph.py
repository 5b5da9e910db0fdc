"""The graph of a person's voxels: face neighbours joined by edges with heat-kernel, color-vote and shrinking weights.

Source: Hsiao (2008), Eqs. 3-9 to 3-15 and steps A-1 and A-2 of section 3.1.4.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array

from hmc.camera.model import Rig
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.grid import VoxelGrid

__all__ = ["GraphSettings", "VoxelGraph", "adjacency", "build_graph", "color_votes", "core_nodes", "face_neighbours"]


#: A camera votes for an edge when the colors at its two ends are nearer than this (Eq. 3-13), grey levels.
LIKE_COLORS = 40.0


@dataclass(frozen=True)
class GraphSettings:
    """Weights of the edges.

    Parameters
    ----------
    kernel_m : float
        Width of the heat kernel (Eq. 3-10) on positions, metres; its square is the thesis's k.
    kernel_color : float
        Width of the heat kernel on colors, grey levels; 0 leaves colors out of the kernel.
    color_bonus : float
        What is added to an edge for which all cameras vote (Eq. 3-15); half of it where at least half do. At most 1.
    color_penalty : float
        What is taken from an edge for which fewer than a quarter vote. Below 1, so that edges keep a positive weight.
    shrink : float
        Added to the edges of core nodes for each end that is one (step A-2); 0 is the plain Laplacian eigenmap.
    core_m : float
        How far from all that is empty a core node is, metres. One voxel or less is the thesis's own: all six neighbours there.
    """

    kernel_m: float = 0.05
    kernel_color: float = 0.0
    color_bonus: float = 0.5
    color_penalty: float = 0.8
    shrink: float = 2.0
    core_m: float = 0.06


@dataclass(frozen=True)
class VoxelGraph:
    """Edges between voxels.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
    edges : ndarray of int, shape (m, 2)
        Pairs of face neighbours, rows of `voxels`; each pair once.
    weights : ndarray, shape (m,)
        Positive.
    """

    voxels: np.ndarray
    edges: np.ndarray
    weights: np.ndarray


def face_neighbours(voxels: np.ndarray) -> np.ndarray:
    """Pairs of voxels that share a face.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
        No voxel twice.

    Returns
    -------
    ndarray of int, shape (m, 2)
        Rows of `voxels`; each pair once, sorted by axis, then by first voxel.
    """
    if len(voxels) == 0:
        return np.zeros((0, 2), np.int32)
    place = voxels - voxels.min(0)
    table = np.full(place.max(0) + 2, -1, np.int32)
    table[tuple(place.T)] = np.arange(len(voxels))
    pairs = []
    for axis in np.eye(3, dtype=int):
        ahead = table[tuple((place + axis).T)]
        here = np.flatnonzero(ahead >= 0).astype(np.int32)
        pairs.append(np.stack([here, ahead[here]], axis=1))
    return np.concatenate(pairs)


def color_votes(
    edges: np.ndarray, voxels: np.ndarray, grid: VoxelGrid, rig: Rig, images: Sequence[np.ndarray | None], distance: float = LIKE_COLORS
) -> tuple[np.ndarray, np.ndarray]:
    """How many cameras see like colors at both ends of each edge (Eqs. 3-13 and 3-15).

    Parameters
    ----------
    edges : ndarray of int, shape (m, 2)
    voxels : ndarray of int, shape (n, 3)
    grid : VoxelGrid
    rig : Rig
    images : sequence of ndarray of uint8, shape (height, width, 3), or None
        One a camera; a camera without an image has no vote.
    distance : float
        Largest distance of like colors, grey levels.

    Returns
    -------
    votes, voters : ndarray of int, shape (m,)
        Cameras that vote for the edge, and cameras in whose images both ends lie.
    """
    votes, voters = np.zeros(len(edges), int), np.zeros(len(edges), int)
    points = grid.centres(voxels)
    for camera, image in zip(rig, images, strict=True):
        if image is None:
            continue
        column, row, inside = pixel_of_voxel(camera, points)
        color = image[row, column].astype(np.float32)
        asked = inside[edges].all(1)
        differ = color[edges[:, 0]] - color[edges[:, 1]]
        voters += asked
        votes += asked & ((differ**2).sum(1) < distance**2)
    return votes, voters


def core_nodes(voxels: np.ndarray, voxel_size_m: float, core_m: float) -> np.ndarray:
    """Which voxels lie deep inside: all within `core_m` of their centres is occupied; one voxel at least, so all six neighbours are.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
    voxel_size_m : float
    core_m : float

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    if len(voxels) == 0:
        return np.zeros(0, bool)
    low = voxels.min(0) - 1
    occupied = np.zeros(voxels.max(0) - low + 2, bool)
    occupied[tuple((voxels - low).T)] = True
    depth = ndimage.distance_transform_edt(occupied)
    return depth[tuple((voxels - low).T)] > max(core_m / voxel_size_m, 1.0) + 1e-9


def build_graph(
    voxels: np.ndarray,
    voxel_size_m: float,
    settings: GraphSettings | None = None,
    votes: tuple[np.ndarray, np.ndarray] | None = None,
    colors: np.ndarray | None = None,
) -> VoxelGraph:
    """Edges and their weights.

    Parameters
    ----------
    voxels : ndarray of int, shape (n, 3)
        No voxel twice.
    voxel_size_m : float
    settings : GraphSettings, optional
    votes : (votes, voters), each ndarray of int, shape (m,), optional
        As from `color_votes` over `face_neighbours`; without them colors add nothing.
    colors : ndarray, shape (n, 3), optional
        Of the voxels, for a kernel on colors.

    Returns
    -------
    VoxelGraph
    """
    settings = settings or GraphSettings()
    edges = face_neighbours(voxels)
    # Face neighbours are all equally far: on positions alone the kernel is the same for every edge.
    exponent = np.full(len(edges), (voxel_size_m / settings.kernel_m) ** 2)
    if colors is not None and settings.kernel_color > 0:
        differ = ((colors[edges[:, 0]] - colors[edges[:, 1]]) ** 2).sum(1)
        exponent += np.nan_to_num(differ) / settings.kernel_color**2
    weights = np.exp(-exponent) / np.exp(-((voxel_size_m / settings.kernel_m) ** 2))
    if votes is not None:
        count, voters = votes
        share = count / np.maximum(voters, 1)
        bonus = np.where(share >= 1, settings.color_bonus, np.where(share >= 0.5, settings.color_bonus / 2, 0.0))
        bonus = np.where(share < 0.25, -settings.color_penalty * weights, bonus)
        weights = weights + np.where(voters > 0, bonus, 0.0)
    if settings.shrink > 0:
        weights = weights + settings.shrink * core_nodes(voxels, voxel_size_m, settings.core_m)[edges].sum(1)
    return VoxelGraph(voxels, edges, weights)


def adjacency(graph: VoxelGraph) -> csr_array:
    """The symmetric adjacency matrix E, shape (n, n)."""
    (a, b), w, n = graph.edges.T, graph.weights, len(graph.voxels)
    return csr_array((np.concatenate([w, w]), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(n, n))
