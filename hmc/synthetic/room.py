"""Rooms: a box with textured walls and floor, furniture made of boxes, and what a ray meets first."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hmc.errors import InputError
from hmc.synthetic.textures import color_of, poster_color

__all__ = ["DOOR_M", "FURNITURE", "Box", "Hits", "Room", "box_mesh", "cast_rays", "furnish", "paint_boxes"]

Color = tuple[float, float, float]
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Box:
    """A solid box standing at ``centre``, turned by ``yaw`` about the vertical.

    Parameters
    ----------
    centre, half : ndarray, shape (3,)
        Metres.
    yaw : float
        Radians.
    texture : str
    color : tuple of float
        sRGB.
    """

    centre: np.ndarray
    half: np.ndarray
    yaw: float
    texture: str
    color: Color

    @property
    def axes(self) -> np.ndarray:
        """Rows: the directions of its edges."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


@dataclass(frozen=True)
class Room:
    """A room and what stands in it.

    Parameters
    ----------
    corners : ndarray, shape (2, 3)
        Lowest and highest corner, metres; the floor is at z = 0.
    walls : tuple of (texture, color)
        Four walls: x low, x high, y low, y high.
    floor : (texture, color)
    boxes : tuple of Box
    posters : tuple of (wall, along, height, width, tall), metres
    doors : tuple of (wall, along), metres
        Open, with the dark behind.
    seed : int
        Of the textures.
    """

    corners: np.ndarray
    walls: tuple[tuple[str, Color], ...]
    floor: tuple[str, Color]
    boxes: tuple[Box, ...] = ()
    posters: tuple[tuple[int, float, float, float, float], ...] = ()
    seed: int = 0
    doors: tuple[tuple[int, float], ...] = ()
    ceiling: tuple[str, Color] = field(default=("plain", (0.85, 0.85, 0.84)))


@dataclass(frozen=True)
class Hits:
    """What rays meet: distance along the ray (n,), normal (n, 3), linear reflectance BGR (n, 3)."""

    distance: np.ndarray
    normal: np.ndarray
    albedo: np.ndarray


def _legs(x: float, y: float, height: float, thickness: float) -> list[tuple[Point, Point]]:
    half = thickness / 2
    corners = [(sx * (x / 2 - half), sy * (y / 2 - half)) for sx in (-1, 1) for sy in (-1, 1)]
    return [((cx, cy, height / 2), (half, half, height / 2)) for cx, cy in corners]


def _table(width: float, depth: float, height: float) -> list[tuple[Point, Point]]:
    return [((0, 0, height - 0.02), (width / 2, depth / 2, 0.02)), *_legs(width - 0.05, depth - 0.05, height - 0.04, 0.05)]


def _chair(width: float, depth: float, height: float) -> list[tuple[Point, Point]]:
    seat = 0.45
    back = ((-(depth / 2 - 0.02), 0, (seat + height) / 2), (0.02, width / 2, (height - seat) / 2))
    return [((0, 0, seat - 0.02), (depth / 2, width / 2, 0.02)), back, *_legs(depth, width, seat - 0.04, 0.04)]


def _box(width: float, depth: float, height: float) -> list[tuple[Point, Point]]:
    return [((0, 0, height / 2), (width / 2, depth / 2, height / 2))]


def _stool(width: float, depth: float, height: float) -> list[tuple[Point, Point]]:
    seat = ((0, 0, height - 0.03), (width / 2, depth / 2, 0.03))
    return [seat, ((0, 0, (height - 0.06) / 2), (0.04, 0.04, (height - 0.06) / 2)), ((0, 0, 0.01), (width / 2.4, depth / 2.4, 0.01))]


#: Width and height of a door, metres.
DOOR_M = (0.95, 2.05)
#: Linear reflectance of a door's frame and of what is seen through it.
_FRAME, _DARK = 0.45, 0.015

#: Furniture by name: its boxes, and the default width (along its y for a chair), depth and height in metres. A chair faces its own x.
FURNITURE = {
    "table": (_table, (1.4, 0.7, 0.74)),
    "chair": (_chair, (0.44, 0.44, 0.88)),
    "box": (_box, (0.5, 0.4, 0.5)),
    "stool": (_stool, (0.38, 0.38, 0.45)),
}


def furnish(
    kind: str, at_m, heading_deg: float = 0.0, size_m=None, color: Color = (0.55, 0.42, 0.30), texture: str = "wood"
) -> tuple[Box, ...]:
    """The boxes of a piece of furniture.

    Parameters
    ----------
    kind : str
        A name of `FURNITURE`.
    at_m : (x, y)
    heading_deg : float
        Where its own x points.
    size_m : (width, depth, height), optional
    color : tuple of float
        sRGB.
    texture : str

    Returns
    -------
    tuple of Box

    Raises
    ------
    InputError
        For an unknown kind.
    """
    if kind not in FURNITURE:
        raise InputError(f"furniture {kind!r} is unknown; use one of {', '.join(FURNITURE)}")
    build, default = FURNITURE[kind]
    yaw = float(np.radians(heading_deg))
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    boxes = []
    for centre, half in build(*(size_m or default)):
        place = np.append(turn @ np.array(centre[:2]) + np.array(at_m), centre[2])
        boxes.append(Box(place, np.array(half), yaw, texture, color))
    return tuple(boxes)


def cast_rays(room: Room, origin: np.ndarray, rays: np.ndarray) -> Hits:
    """What rays from one point inside the room meet first.

    Parameters
    ----------
    room : Room
    origin : ndarray, shape (3,)
    rays : ndarray, shape (n, 3)

    Returns
    -------
    Hits
        Distances are in lengths of the rays.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        to_planes = np.where(rays > 0, room.corners[1] - origin, room.corners[0] - origin) / rays
    to_planes = np.where(np.isfinite(to_planes), to_planes, np.inf)
    axis = to_planes.argmin(axis=1)
    distance = np.take_along_axis(to_planes, axis[:, None], axis=1)[:, 0]
    positive = np.take_along_axis(rays, axis[:, None], axis=1)[:, 0] > 0
    normal = -np.eye(3)[axis] * np.where(positive, 1, -1)[:, None]
    point = origin + distance[:, None] * rays
    albedo = np.zeros_like(point)
    surfaces = [*((0, False, room.walls[0]), (0, True, room.walls[1]), (1, False, room.walls[2]), (1, True, room.walls[3]))]
    surfaces += [(2, False, room.floor), (2, True, room.ceiling)]
    for k, (a, side, (texture, color)) in enumerate(surfaces):
        seen = (axis == a) & (positive == side)
        u, v = point[seen][:, [i for i in range(3) if i != a]].T
        albedo[seen] = color_of(texture, color, u, v, room.seed + 31 * k)
    for k, (wall, along, height, width, tall) in enumerate(room.posters):
        u, v = (point[:, 1 - wall // 2] - along) / width + 0.5, (point[:, 2] - height) / tall + 0.5
        seen = (axis == wall // 2) & (positive == bool(wall % 2)) & (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
        albedo[seen] = poster_color(u[seen], v[seen], room.seed + 101 * k)
    for wall, along in room.doors:
        aside, up = np.abs(point[:, 1 - wall // 2] - along), point[:, 2]
        seen = (axis == wall // 2) & (positive == bool(wall % 2)) & (aside < DOOR_M[0] / 2 + 0.06) & (up < DOOR_M[1] + 0.06)
        albedo[seen] = _FRAME
        albedo[seen & (aside < DOOR_M[0] / 2) & (up < DOOR_M[1])] = _DARK
    for k, box in enumerate(room.boxes):
        _meet_box(box, origin, rays, distance, normal, albedo, room.seed + 500 + k)
    return Hits(distance, normal, albedo)


def _meet_box(
    box: Box, origin: np.ndarray, rays: np.ndarray, distance: np.ndarray, normal: np.ndarray, albedo: np.ndarray, seed: int
) -> None:
    """Overwrite, in place, what rays met with what they meet on a box, where that is nearer (slab method)."""
    # Rays that pass the box's bounding sphere far away are left out first.
    away = box.centre - origin
    along = rays @ away / np.einsum("ij,ij->i", rays, rays)
    near = np.flatnonzero((np.linalg.norm(along[:, None] * rays - away, axis=1) < np.linalg.norm(box.half)) & (along > 0))
    if not near.size:
        return
    start, turned = box.axes @ (origin - box.centre), rays[near] @ box.axes.T
    turned = np.where(np.abs(turned) < 1e-12, 1e-12, turned)
    enter = (-np.sign(turned) * box.half - start) / turned
    leave = (np.sign(turned) * box.half - start) / turned
    axis = enter.argmax(axis=1)
    t = enter.max(axis=1)
    hit = (t < leave.min(axis=1)) & (t > 1e-6) & (t < distance[near])
    index, axis, t, turned = near[hit], axis[hit], t[hit], turned[hit]
    distance[index] = t
    side = -np.sign(turned[np.arange(len(axis)), axis])
    normal[index] = side[:, None] * box.axes[axis]
    local = start + t[:, None] * turned
    others = np.array([[1, 2], [0, 2], [0, 1]])[axis]
    u, v = np.take_along_axis(local, others, axis=1).T
    albedo[index] = color_of(box.texture, box.color, u, v, seed)


def box_mesh(boxes: tuple[Box, ...], edge_m: float = 0.06) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and triangles (m, 3) of boxes, with faces cut into small squares."""
    vertices, triangles, count = [], [], 0
    for box in boxes:
        for axis in range(3):
            b, c = (axis + 1) % 3, (axis + 2) % 3
            for sign in (-1, 1):
                nb, nc = (int(np.ceil(2 * box.half[k] / edge_m)) + 1 for k in (b, c))
                p, q = np.meshgrid(np.linspace(-1, 1, nb), np.linspace(-1, 1, nc), indexing="ij")
                local = np.zeros((nb * nc, 3))
                local[:, axis], local[:, b], local[:, c] = sign, p.ravel(), q.ravel()
                vertices.append(box.centre + local * box.half @ box.axes)
                i, j = (g.ravel() for g in np.meshgrid(np.arange(nb - 1), np.arange(nc - 1), indexing="ij"))
                k = count + i * nc + j
                quad = np.stack([k, k + nc, k + nc + 1, k + 1], axis=1)
                quad = quad if sign > 0 else quad[:, ::-1]
                triangles += [quad[:, :3], quad[:, [0, 2, 3]]]
                count += nb * nc
    if not vertices:
        return np.zeros((0, 3)), np.zeros((0, 3), int)
    return np.concatenate(vertices), np.concatenate(triangles)


def paint_boxes(boxes: tuple[Box, ...], edge_m: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The mesh of `box_mesh` with normals and colors, for furniture that moves.

    Returns
    -------
    vertices, normals, albedo : ndarray, shape (n, 3)
        Linear reflectance, BGR.
    triangles : ndarray of int, shape (m, 3)
    """
    vertices, triangles = box_mesh(boxes, edge_m)
    corners = vertices[triangles]
    normals = np.zeros_like(vertices)
    # Every vertex belongs to one face, so any of its triangles tells its normal.
    normals[triangles] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, None]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    albedo = color_of(boxes[0].texture, boxes[0].color, vertices[:, 0] + vertices[:, 1], vertices[:, 2], seed)
    return vertices, normals, albedo, triangles
