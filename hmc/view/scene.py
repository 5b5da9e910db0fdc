"""The room in perspective: floor, cameras, voxels. Quick enough for video, which matplotlib is not."""

from __future__ import annotations

import numpy as np

from hmc.camera.model import Camera, Rig, backproject, look_at, project
from hmc.view.overlay import draw_label, draw_paths
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = ["BACKGROUND", "draw_floor", "draw_rig", "draw_voxels", "from_above", "shading", "viewpoint"]

BACKGROUND = (46, 40, 36)
FLOOR = (84, 76, 70)
CAMERAS = (150, 140, 130)
VOXELS = np.array([214, 200, 188.0])

#: Where the viewer stands: degrees from the world's x axis, and above the floor.
AZIMUTH_DEG, ELEVATION_DEG = -55.0, 24.0
FIELD_OF_VIEW_DEG = 40.0
#: From above the viewer stands so far off that people appear where they are, and do not lean outwards.
ABOVE_FIELD_OF_VIEW_DEG = 6.0
#: Light comes from above the viewer's left shoulder.
LIGHT_AZIMUTH_DEG, LIGHT_ELEVATION_DEG = -100.0, 50.0


def viewpoint(
    bounds: np.ndarray,
    size: tuple[int, int],
    margin: float = 0.94,
    away: np.ndarray | None = None,
    field_of_view_deg: float = FIELD_OF_VIEW_DEG,
) -> Camera:
    """A virtual camera that has a box in view.

    Parameters
    ----------
    bounds : ndarray, shape (2, 3)
        Lowest and highest corner, world, metres.
    size : (width, height)
        Of the picture, pixels.
    margin : float
        Share of the picture that the box may fill.
    away : ndarray, shape (3,), optional
        Unit vector from the middle of the box to the viewer; by default aside and a little above.
    field_of_view_deg : float

    Returns
    -------
    Camera
    """
    corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    middle, away = bounds.mean(axis=0), _direction(AZIMUTH_DEG, ELEVATION_DEG) if away is None else away
    near = look_at("view", size, middle + away, middle, field_of_view_deg)
    offsets = (corners - middle) @ near.rotation.T
    # A corner is in the picture from the distance on at which focal * |x| / (distance + z) falls to half its width, and so for y.
    reach = near.matrix[0, 0] * np.abs(offsets[:, :2]) / (margin * np.array(size) / 2)
    distance = (reach - offsets[:, 2:]).max()
    return look_at("view", size, middle + distance * away, middle, field_of_view_deg)


def from_above(bounds: np.ndarray, size: tuple[int, int]) -> Camera:
    """A viewpoint straight above a box, x to the right and y upwards: a plan of the room; arguments as for `viewpoint`."""
    return viewpoint(bounds, size, away=np.array([0, 0, 1.0]), field_of_view_deg=ABOVE_FIELD_OF_VIEW_DEG)


def draw_floor(image: np.ndarray, camera: Camera, room: np.ndarray) -> None:
    """Draw the floor of the room, shape (2, 3), as a grid of metres."""
    (x0, y0), (x1, y1) = room[0, :2], room[1, :2]
    t = np.linspace(0, 1, 33)
    along_y = [np.stack([np.full(33, x), y0 + t * (y1 - y0), 0 * t], axis=1) for x in (x0, *np.arange(np.ceil(x0), x1), x1)]
    along_x = [np.stack([x0 + t * (x1 - x0), np.full(33, y), 0 * t], axis=1) for y in (y0, *np.arange(np.ceil(y0), y1), y1)]
    draw_paths(image, camera, np.array(along_y + along_x), FLOOR, 1)


def draw_rig(image: np.ndarray, camera: Camera, rig: Rig, depth_m: float = 0.25) -> None:
    """Draw the cameras of a rig as small pyramids with their names."""
    for member in rig:
        width, height = member.size
        corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1.0]])
        ends = member.centre + depth_m * backproject(member, corners)
        a, b, c, d = ends
        pen = np.array([a, b, c, d, a, member.centre, b, member.centre, c, member.centre, d])
        draw_paths(image, camera, pen, CAMERAS, 1)
        uv, valid = project(camera, member.centre)
        if valid and (uv > 0).all() and (uv < camera.size).all():
            draw_label(image, member.name, uv + np.array([6, -6]), CAMERAS, 0.35)


def draw_voxels(image: np.ndarray, camera: Camera, grid: VoxelGrid, occupied: np.ndarray) -> None:
    """Draw the surface of a volume as shaded little squares, the nearest on top.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3), uint8
        Drawn into.
    camera : Camera
    grid : VoxelGrid
    occupied : ndarray of bool, shape (nx, ny, nz)
    """
    indices = surface(occupied)
    if not len(indices):
        return
    centres = grid.centres(indices)
    uv, valid = project(camera, centres)
    depth = (centres - camera.centre) @ camera.rotation[2]
    far_to_near = np.argsort(-depth, kind="stable")
    far_to_near = far_to_near[valid[far_to_near]]
    uv, depth = uv[far_to_near], depth[far_to_near]
    shade = shading(occupied, indices[far_to_near])
    # 1.2: neighbours seen at a slant leave no gaps.
    side = np.maximum(np.ceil(1.2 * camera.matrix[0, 0] * grid.voxel_size_m / depth), 1).astype(int)
    dy, dx = (offset.ravel() for offset in np.indices((side.max(), side.max())))
    first = np.round(uv - (side[:, None] - 1) / 2).astype(int)
    columns, rows = first[:, :1] + dx, first[:, 1:] + dy
    height, width = image.shape[:2]
    inside = (dx < side[:, None]) & (dy < side[:, None]) & (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    colors = np.clip(shade[:, None] * VOXELS, 0, 255).astype(np.uint8)
    # Entries stand from far to near, and of several for one pixel the last one stays.
    image.reshape(-1, 3)[(rows * width + columns)[inside]] = np.repeat(colors, inside.sum(axis=1), axis=0)


def shading(occupied: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Brightness of surface voxels by the direction in which their neighbourhood is empty, shape (n,), about .35 to 1."""
    padded = np.pad(occupied, 2).astype(np.int8)
    normals = np.zeros((len(indices), 3))
    for offset in np.ndindex(5, 5, 5):
        step = np.array(offset) - 2
        normals -= padded[tuple((indices + offset).T)][:, None] * step
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return 0.35 + 0.65 * np.clip(0.5 + 0.5 * normals @ _direction(LIGHT_AZIMUTH_DEG, LIGHT_ELEVATION_DEG), 0, 1)


def _direction(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
