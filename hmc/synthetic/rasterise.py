"""A z-buffer for meshes of many small triangles, vectorised over triangles of like size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Fragments", "rasterise"]


@dataclass(frozen=True)
class Fragments:
    """What is seen, pixel by pixel.

    Parameters
    ----------
    pixels : ndarray of int, shape (n,)
        Flat indices (``row * width + column``) of the covered pixels, rising.
    triangles : ndarray of int, shape (n,)
        The nearest triangle at each.
    weights : ndarray, shape (n, 3)
        Perspective-correct barycentric coordinates in it.
    depth : ndarray, shape (n,)
        Interpolated depth.
    """

    pixels: np.ndarray
    triangles: np.ndarray
    weights: np.ndarray
    depth: np.ndarray


def rasterise(points: np.ndarray, depth: np.ndarray, triangles: np.ndarray, size: tuple[int, int], cull: bool = True) -> Fragments:
    """Find the triangle that each pixel's centre sees.

    Parameters
    ----------
    points : ndarray, shape (n, 2)
        Vertices in the image, pixels, centre of the top-left pixel at (0, 0). NaN drops every triangle of the vertex.
    depth : ndarray, shape (n,)
        Distance along the view's axis, positive; nearer wins.
    triangles : ndarray of int, shape (m, 3)
        Counter-clockwise seen from outside the body.
    size : (width, height)
    cull : bool
        Leave out triangles seen from behind (clockwise with v pointing down counts as front).

    Returns
    -------
    Fragments
    """
    width, height = size
    corners = points[triangles]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    with np.errstate(invalid="ignore"):
        keep = np.isfinite(area) & ((area < -1e-9) if cull else (np.abs(area) > 1e-9))
    keep = np.flatnonzero(keep)
    a, b, c = a[keep], b[keep], c[keep]
    low = np.maximum(np.ceil(np.minimum(np.minimum(a, b), c) - 1e-9), 0).astype(np.int64)
    high = np.minimum(np.floor(np.maximum(np.maximum(a, b), c) + 1e-9), [width - 1, height - 1]).astype(np.int64)
    extent = high - low + 1
    seen = (extent > 0).all(axis=1)
    keep, low, extent = keep[seen], low[seen], extent[seen]
    if not keep.size:
        return Fragments(np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3)), np.empty(0))
    inverse = 1 / depth[triangles[keep]]
    pieces = [
        _cover(corners[keep[group]], area[keep[group]], inverse[group], low[group], side, (width, height), keep[group])
        for side, group in _by_size(extent.max(axis=1))
    ]
    pixel, triangle, weights, near = (np.concatenate([piece[k] for piece in pieces]) for k in range(4))
    # Every pixel is written farthest first, so that the nearest stays; of equals, the last triangle.
    order = np.argsort(near, kind="stable")
    nearest = np.full(width * height, -1)
    nearest[pixel[order]] = order
    covered = np.flatnonzero(nearest >= 0)
    chosen = nearest[covered]
    return Fragments(covered, triangle[chosen], weights[chosen], 1 / near[chosen])


def _by_size(extent: np.ndarray):
    """Groups of triangles whose boxes fit into squares of 1, 2, 3, 4, 6, 8, 12, ... pixels."""
    sides = [1, 2, 3, 4]
    while sides[-1] < extent.max():
        sides.append(sides[-1] + max(1, sides[-1] // 2))
    smaller = 0
    for side in sides:
        group = np.flatnonzero((extent > smaller) & (extent <= side))
        if group.size:
            yield side, group
        smaller = side


def _cover(corners, area, inverse, low, side, size, ids):
    """Pixels inside each of a group of triangles, all searched in a square of ``side`` pixels."""
    step = np.arange(side)
    x = low[:, 0, None, None] + step[None, None, :]
    y = low[:, 1, None, None] + step[None, :, None]
    edges = []
    for first, second in ((1, 2), (2, 0), (0, 1)):
        p, q = corners[:, first], corners[:, second]
        dx, dy = (q - p).T[:, :, None, None]
        edges.append((dx * (y - p[:, 1, None, None]) - dy * (x - p[:, 0, None, None])) / area[:, None, None])
    inside = (edges[0] >= 0) & (edges[1] >= 0) & (edges[2] >= 0) & (x < size[0]) & (y < size[1])
    row, j, i = np.nonzero(inside)
    flat = np.stack([edge[row, j, i] for edge in edges], axis=1) * inverse[row]
    near = flat.sum(axis=1)
    pixel = (low[row, 1] + j) * size[0] + low[row, 0] + i
    return pixel, ids[row], flat / near[:, None], near
