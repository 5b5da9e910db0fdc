"""Colors of voxels: plain average over the cameras, or over the cameras that have direct sight of the voxel.

Source: Canton (2009), section 2.2.4 (line from the voxel to the optical centre, drawn in the discrete space by Bresenham's algorithm; the
voxel is seen when all of the line is empty) and Kehl (2006), section 4.1. The plain average mixes the colors of front and back.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from hmc.camera.model import Rig
from hmc.errors import InputError
from hmc.voxels.carving import pixel_of_voxel
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.surface import surface

__all__ = ["color_voxels", "visibility"]

#: Quick mode: a voxel is hidden when something is nearer to the camera by more than this many voxels.
DEPTH_SLACK = 3.0
#: Quick mode: width of what a voxel hides, and half of the largest width of a depth image, in cells of a voxel's size.
SPLAT_CELLS = 2
MOST_CELLS = 1000
EMPTY, SOLID, BEYOND = 0, 1, 2


def color_voxels(
    grid: VoxelGrid,
    rig: Rig,
    images: Sequence[np.ndarray | None],
    voxels: np.ndarray,
    seen: np.ndarray | None = None,
    masks: Sequence[np.ndarray | None] | None = None,
) -> np.ndarray:
    """Average color of each voxel in the images.

    Parameters
    ----------
    grid : VoxelGrid
    rig : Rig
    images : sequence of ndarray of uint8, shape (height, width, 3), or None
        One a camera; a camera without an image tells nothing.
    voxels : ndarray of int, shape (n, 3)
    seen : ndarray of bool, shape (n_cameras, n), optional
        Which camera has direct sight of which voxel (`visibility`). All have where left out: the plain average.
    masks : sequence of ndarray of bool, shape (height, width), or None, optional
        Silhouettes, one a camera: pixels beside them tell nothing of what is occupied. A camera without one tells nothing.

    Returns
    -------
    ndarray of float32, shape (n, 3)
        BGR, 0 to 255; NaN where no camera tells anything.
    """
    points = grid.centres(voxels)
    total = np.zeros((len(voxels), 3), np.float32)
    count = np.zeros(len(voxels), np.float32)
    for c, (camera, image) in enumerate(zip(rig, images, strict=True)):
        mask = None if masks is None else masks[c]
        if image is None or (masks is not None and mask is None):
            continue
        asked = np.arange(len(points)) if seen is None else np.flatnonzero(seen[c])
        column, row, inside = pixel_of_voxel(camera, points[asked])
        if mask is not None:
            inside &= mask[row, column]
        tells, column, row = asked[inside], column[inside], row[inside]
        total[tells] += image[row, column]
        count[tells] += 1
    with np.errstate(invalid="ignore"):
        return total / np.where(count > 0, count, np.nan)[:, None]


def visibility(occupied: np.ndarray, grid: VoxelGrid, rig: Rig, voxels: np.ndarray, mode: str = "exact") -> np.ndarray:
    """Which camera has direct sight of which voxel; whether it lies inside the camera's image is not asked.

    Parameters
    ----------
    occupied : ndarray of bool, shape grid.shape
        What may stand in the way.
    grid : VoxelGrid
    rig : Rig
    voxels : ndarray of int, shape (n, 3)
        Occupied voxels (i, j, k).
    mode : {"exact", "quick"}
        "exact" walks the 3-D Bresenham line from the voxel to the camera's voxel, both ends left out; "quick" looks at
        the line's first voxel only and then compares depths in a coarse depth image of the surface; it agrees on nearly all.

    Returns
    -------
    ndarray of bool, shape (n_cameras, n)

    Raises
    ------
    InputError
        When there is no such mode, or when a voxel is not occupied.
    """
    if mode not in ("exact", "quick"):
        raise InputError(f"`mode` must be exact or quick; got {mode!r}")
    voxels = np.asarray(voxels, np.int64).reshape(-1, 3)
    if len(voxels) == 0:
        return np.zeros((len(rig), 0), bool)
    if not occupied[tuple(voxels.T)].all():
        raise InputError("visibility is asked of occupied voxels; some of `voxels` are empty")
    # Beyond the box around all that is occupied, nothing stands in the way.
    solid = np.unravel_index(np.flatnonzero(occupied), occupied.shape)
    low = np.array([axis.min() for axis in solid]) - 1
    room = np.full([axis.max() + 2 - start for axis, start in zip(solid, low, strict=True)], BEYOND, np.uint8)
    room[1:-1, 1:-1, 1:-1] = occupied[tuple(slice(start + 1, start + n - 1) for start, n in zip(low, room.shape, strict=True))]
    targets = [grid.index_of(camera.centre) - low for camera in rig]
    if mode == "exact":
        return np.stack([_walk(room, voxels - low, target) for target in targets])
    skin = surface(room == SOLID)
    facing = _faces(room, skin, np.array(targets))
    lit = np.zeros((len(rig), room.size), bool)
    camera, point = np.nonzero(facing)
    here = _nearest(rig, grid.centres(skin + low), camera, point, grid.voxel_size_m)
    strides = np.array([room.shape[1] * room.shape[2], room.shape[2], 1])
    lit[camera[here], (skin @ strides)[point[here]]] = True
    return lit[:, (voxels - low) @ strides]


def _walk(room: np.ndarray, starts: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Walk from all voxels to one target at once, one step along each line's longest axis at a time.

    Bresenham (1965) in 3-D: each of the two shorter axes steps when its error term is not negative.
    """
    strides = np.array([room.shape[1] * room.shape[2], room.shape[2], 1])
    delta = target - starts
    length = np.abs(delta)
    axes = np.argsort(-length, axis=1, kind="stable")  # the longest first; of equals x before y before z
    length = np.take_along_axis(length, axes, axis=1)
    step = np.take_along_axis(np.sign(delta) * strides, axes, axis=1)
    # Rows: line, place, steps to the target, the three steps, twice the lengths, the two error terms.
    state = np.stack(
        [
            np.arange(len(starts)),
            starts @ strides,
            length[:, 0],
            *step.T,
            *(2 * length).T,
            2 * length[:, 1] - length[:, 0],
            2 * length[:, 2] - length[:, 0],
        ]
    )
    flat = room.ravel()
    seen = np.zeros(len(starts), bool)
    while state.shape[1]:
        _, place, left, main, first, second, double_main, double_first, double_second, error_first, error_second = state
        place += main
        left -= 1
        for step_aside, double, error in ((first, double_first, error_first), (second, double_second, error_second)):
            over = error >= 0
            place += step_aside * over
            error += double - double_main * over
        # The target may lie outside the room; one step past the border is inside the array, and lines end there.
        arrived = left <= 0
        found = np.where(arrived, BEYOND, flat.take(place, mode="clip"))
        seen[state[0, found == BEYOND]] = True
        going = np.flatnonzero(found == EMPTY)
        if going.size < state.shape[1]:
            state = state.take(going, axis=1)
    return seen


def _faces(room: np.ndarray, starts: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Whether the first voxel on each Bresenham line to each target is empty, shape (n_targets, n).

    That alone tells the side that faces a camera from the others.
    """
    strides = np.array([room.shape[1] * room.shape[2], room.shape[2], 1], np.int32)
    delta = (targets[:, :, None] - starts.T).astype(np.int32)
    length = np.abs(delta)
    steps = 2 * length >= length.max(axis=1, keepdims=True)
    place = (starts @ strides).astype(np.int32) + np.einsum("tan,a->tn", np.sign(delta, out=delta) * steps, strides)
    return room.ravel().take(place) != SOLID


def _nearest(rig: Rig, points: np.ndarray, camera: np.ndarray, point: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Which pairs of a camera and a point are hidden by no other pair, by depth in images whose pixels are as large as a voxel looks.

    The images lie side by side in one. What is in front of what does not depend on the lens, so they have none; what lies
    beside or behind a camera is seen.
    """
    turn = np.stack([c.rotation for c in rig]).astype(np.float32)
    centre = np.stack([c.centre for c in rig])
    x, y, depth = np.moveaxis(turn @ (points - centre[:, None]).astype(np.float32).swapaxes(1, 2), 1, 0)[:, camera, point]
    seen = depth < voxel_size_m
    ahead = np.flatnonzero(~seen)
    camera, x, y, depth = camera[ahead], x[ahead], y[ahead], depth[ahead]
    if ahead.size == 0:
        return seen
    mean = np.bincount(camera, depth, len(rig)) / np.maximum(np.bincount(camera, minlength=len(rig)), 1)
    cells_a_depth = (mean / voxel_size_m).astype(np.float32)[camera] / depth
    # Points far to the side would make the images as large as the view spreads them.
    column, row = (np.clip(np.floor(values * cells_a_depth), -MOST_CELLS, MOST_CELLS).astype(np.int64) for values in (x, y))
    column -= column.min()
    row -= row.min()
    width = column.max() + 2  # a column between two images, whose points are not to hide one another
    place = (row * len(rig) + camera) * width + column
    nearest = np.full((row.max() + 1) * len(rig) * width, np.inf, np.float32)
    order = np.argsort(-depth)
    nearest[place[order]] = depth[order]  # the nearest is written last, and stays
    nearest = cv2.erode(nearest.reshape(-1, len(rig) * width), np.ones((SPLAT_CELLS, SPLAT_CELLS), np.uint8)).ravel()
    seen[ahead] = depth <= nearest[place] + np.float32(DEPTH_SLACK * voxel_size_m)
    return seen
