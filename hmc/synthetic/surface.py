"""Smooth closed surfaces: a blend of swept cross-sections, and a triangle mesh of it.

A body is described as a list of sweeps (a superelliptic cross-section whose widths and centre change along an axis) that flow into each
other. The mesh comes from naive surface nets (Gibson 1998) followed by one step of projection onto the surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["Mesh", "Sweep", "distances", "mesh_of", "volume_centroid"]


@dataclass(frozen=True)
class Sweep:
    """A cross-section moved along an axis.

    Parameters
    ----------
    bone : int
        The bone that carries it.
    origin : ndarray, shape (3,)
        Start of the axis, metres.
    axes : ndarray, shape (3, 3)
        Rows: directions of the first and second half-width, and of the axis.
    stations : ndarray, shape (k, 5)
        Along the axis: position, two half-widths, two offsets of the centre; metres, positions rising.
    power : float
        2 is an ellipse, more is squarer.
    blend : float
        Radius of the fillet to what is there before it, metres.
    """

    bone: int
    origin: np.ndarray
    axes: np.ndarray
    stations: np.ndarray
    power: float = 2.0
    blend: float = 0.03

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Roughly the signed distance of points (n, 3) to the surface, negative inside; exact enough within some centimetres."""
        local = (points - self.origin) @ self.axes.T
        s = np.clip(local[:, 2], self.stations[0, 0], self.stations[-1, 0])
        a, b, du, dv = (np.interp(s, self.stations[:, 0], self.stations[:, k]) for k in range(1, 5))
        u, v = np.abs(local[:, 0] - du), np.abs(local[:, 1] - dv)
        if self.power == 2.0:
            level = np.sqrt((u / a) ** 2 + (v / b) ** 2)
        else:
            level = ((u / a) ** self.power + (v / b) ** self.power) ** (1 / self.power)
        radius = np.sqrt(u * u + v * v)
        aside = np.where(level > 1e-3, radius - radius / np.maximum(level, 1e-3), -np.minimum(a, b))
        beyond = np.abs(local[:, 2] - s)
        return np.where(beyond > 0, np.hypot(np.maximum(aside, 0), beyond), aside)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of an axis-aligned box around it, each (3,)."""
        half = self.stations[:, 1:3].max() + np.abs(self.stations[:, 3:5]).max()
        ends = self.origin + self.stations[[0, -1], :1] * self.axes[2]
        return ends.min(axis=0) - half, ends.max(axis=0) + half


@dataclass(frozen=True)
class Mesh:
    """A closed triangle mesh.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
    normals : ndarray, shape (n, 3)
        Unit, outwards.
    triangles : ndarray of int, shape (m, 3)
        Counter-clockwise seen from outside.
    """

    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray


def _blend(first: np.ndarray, second: np.ndarray, radius: float) -> np.ndarray:
    """Smooth minimum (Quilez's polynomial form): the two surfaces meet in a fillet of about ``radius``."""
    overlap = np.maximum(radius - np.abs(first - second), 0) / radius
    return np.minimum(first, second) - overlap**2 * (radius / 4)


def distances(sweeps: list[Sweep], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points (n, 3) to the blended surface, (n,), and to every sweep alone, (n, n_sweeps)."""
    each = np.stack([sweep.distance(points) for sweep in sweeps], axis=1)
    total = each[:, 0]
    for k, sweep in enumerate(sweeps[1:], start=1):
        total = _blend(total, each[:, k], sweep.blend)
    return total, each


def mesh_of(sweeps: list[Sweep], cell: float) -> Mesh:
    """Triangle mesh of the blended surface, with edges about ``cell`` metres long."""
    corners = np.array([sweep.bounds() for sweep in sweeps])
    low = corners[:, 0].min(axis=0) - 3 * cell
    shape = np.ceil((corners[:, 1].max(axis=0) + 3 * cell - low) / cell).astype(int) + 1
    field = np.full(shape, 1.0)
    for sweep in sweeps:
        # Each sweep is evaluated near itself only: far away it could not change the blend.
        a, b = sweep.bounds()
        first = np.maximum(np.floor((a - sweep.blend - low) / cell).astype(int) - 1, 0)
        last = np.minimum(np.ceil((b + sweep.blend - low) / cell).astype(int) + 2, shape)
        block = tuple(slice(i, j) for i, j in zip(first, last, strict=True))
        ticks = np.meshgrid(*(low[k] + cell * np.arange(first[k], last[k]) for k in range(3)), indexing="ij")
        points = np.stack([t.ravel() for t in ticks], axis=1)
        field[block] = _blend(field[block], sweep.distance(points).reshape(field[block].shape), sweep.blend)
    vertices, triangles = _surface_nets(field)
    vertices = low + cell * vertices
    for _ in range(2):
        value, normals = _gradient(sweeps, vertices)
        vertices = vertices - np.clip(value, -cell / 2, cell / 2)[:, None] * normals
    _, normals = _gradient(sweeps, vertices)
    return Mesh(vertices, normals, triangles)


def _gradient(sweeps: list[Sweep], points: np.ndarray, step: float = 2e-3) -> tuple[np.ndarray, np.ndarray]:
    offsets = np.concatenate([np.zeros((1, 3)), step * np.eye(3), -step * np.eye(3)])
    values = distances(sweeps, (points[None] + offsets[:, None]).reshape(-1, 3))[0].reshape(7, -1)
    gradient = (values[1:4] - values[4:7]).T
    return values[0], gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12)


def _surface_nets(field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (in grid units) and triangles of the zero level of a field that is negative inside."""
    inside = field < 0
    cells = tuple(n - 1 for n in field.shape)
    total, count = np.zeros((*cells, 3)), np.zeros(cells)
    crossings = []
    for axis in range(3):
        low, high = _halves(field, axis)
        cut = (low < 0) != (high < 0)
        where = np.argwhere(cut)
        at = where.astype(float)
        at[:, axis] += low[cut] / (low[cut] - high[cut])
        crossings.append((where, low[cut] < 0))
        b, c = (k for k in range(3) if k != axis)
        for db in (0, -1):
            for dc in (0, -1):
                cell = where.copy()
                cell[:, b] += db
                cell[:, c] += dc
                index = tuple(cell.T)
                total[index] += at
                count[index] += 1
    if inside[[0, -1]].any() or inside[:, [0, -1]].any() or inside[:, :, [0, -1]].any():
        raise ValueError("the surface leaves the grid")
    used = count > 0
    number = np.full(cells, -1)
    number[used] = np.arange(used.sum())
    vertices = total[used] / count[used][:, None]
    triangles = []
    for axis, (where, starts_inside) in enumerate(crossings):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        ring = []
        for db, dc in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = where.copy()
            cell[:, b] += db
            cell[:, c] += dc
            ring.append(number[tuple(cell.T)])
        quad = np.stack(ring, axis=1)
        quad[~starts_inside] = quad[~starts_inside, ::-1]
        triangles += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return vertices, np.concatenate(triangles)


def _halves(field: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    first, second = [slice(None)] * 3, [slice(None)] * 3
    first[axis], second[axis] = slice(None, -1), slice(1, None)
    return field[tuple(first)], field[tuple(second)]


def volume_centroid(vertices: np.ndarray, triangles: np.ndarray) -> tuple[float, np.ndarray]:
    """Volume (cubic metres) and centroid (3,) of the body inside a closed mesh, by the divergence theorem."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return float(volumes.sum()), (volumes[:, None] * (a + b + c) / 4).sum(axis=0) / volumes.sum()
