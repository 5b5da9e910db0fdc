"""Exact distance to the nearest occupied voxel, as far as a bound: a body's surface that is farther off pulls no more."""

from __future__ import annotations

import cv2
import numpy as np

__all__ = ["distances_of_squares", "look_up", "near_distance", "near_squares"]


def near_distance(occupied: np.ndarray, reach: int) -> np.ndarray:
    """Distance of every voxel's centre to that of the nearest occupied one.

    Parameters
    ----------
    occupied : ndarray of bool, shape (nx, ny, nz)
    reach : int
        Voxels, at least 1.

    Returns
    -------
    ndarray of float32, shape (nx, ny, nz)
        Voxels; ``reach + 1`` where it is that or more.
    """
    return look_up(distances_of_squares(reach), near_squares(occupied, reach))


def near_squares(occupied: np.ndarray, reach: int) -> np.ndarray:
    """Square of the distance of every voxel's centre to that of the nearest occupied one.

    Squares of whole numbers, one axis after the other as in an exact Euclidean transform (Felzenszwalb and Huttenlocher 2012), but
    from the voxels within reach alone, which is a minimum of shifted copies. Only the box around what is occupied is looked at: after each
    axis it is longer by `reach` at either end of that axis. These margins part neighbouring rows, so that all shifts are shifts of
    the flat array.

    Parameters
    ----------
    occupied : ndarray of bool, shape (nx, ny, nz)
    reach : int
        Voxels, at least 1.

    Returns
    -------
    ndarray of unsigned int, shape (nx, ny, nz)
        Squared voxels; ``(reach + 1)**2`` where it is that or more.
    """
    beyond = (reach + 1) ** 2
    out = np.full(occupied.shape, beyond, np.min_scalar_type(beyond))
    low, high = _box(occupied)
    if np.any(low >= high):
        return out
    box = occupied[tuple(map(slice, low, high))]
    squares = np.where(box, out.dtype.type(0), out.dtype.type(beyond))
    for axis in reversed(range(squares.ndim)):
        squares = _spread(squares, axis, reach)
    first, last = np.maximum(low - reach, 0), np.minimum(high + reach, occupied.shape)
    out[tuple(map(slice, first, last))] = squares[tuple(map(slice, first - low + reach, last - low + reach))]
    return out


def distances_of_squares(reach: int) -> np.ndarray:
    """Distances, float32, shape ((reach + 1)**2 + 1,), of the squares that `near_squares` tells."""
    return np.sqrt(np.arange((reach + 1) ** 2 + 1, dtype=np.float32))


def look_up(table: np.ndarray, squares: np.ndarray) -> np.ndarray:
    """A table's value at each of some squares.

    Parameters
    ----------
    table : ndarray of float32, shape (n,)
    squares : ndarray of unsigned int, shape (nx, ny, nz)
        Below n.

    Returns
    -------
    ndarray of float32, shape (nx, ny, nz)
    """
    if squares.dtype != np.uint8 or not squares.size:
        return table.take(squares)
    return cv2.LUT(squares.reshape(len(squares), -1), np.resize(table, (1, 256))).reshape(squares.shape)


def _box(occupied: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and one past the last occupied place along each axis, shape (3,); equal where nothing is occupied."""
    columns = np.logical_or.reduce(occupied, axis=0)
    sides = (np.flatnonzero(side) for side in (occupied.any(axis=(1, 2)), columns.any(axis=1), columns.any(axis=0)))
    ends = [(side[0], side[-1] + 1) if side.size else (0, 0) for side in sides]
    return np.array([first for first, _ in ends]), np.array([last for _, last in ends])


def _spread(squares: np.ndarray, axis: int, reach: int) -> np.ndarray:
    """The least, along an axis, of squares and the squared steps to them; longer by `reach` at either end of the axis."""
    beyond = (reach + 1) ** 2
    longer = [n + 2 * reach if k == axis else n for k, n in enumerate(squares.shape)]
    padded = np.full(longer, beyond, squares.dtype)  # `numpy.pad` takes several times as long
    padded[(slice(None),) * axis + (slice(reach, -reach),)] = squares
    before, out = padded.ravel(), padded.copy()
    after, shifted = out.ravel(), np.empty_like(before)
    stride = int(np.prod(padded.shape[axis + 1 :]))
    most = np.iinfo(squares.dtype).max
    for step in range(1, reach + 1):
        if beyond + step**2 > most:  # what would not fit is beyond reach
            np.minimum(before, before.dtype.type(most - step**2), out=shifted)
            shifted += before.dtype.type(step**2)
        else:
            np.add(before, before.dtype.type(step**2), out=shifted)
        shift = step * stride
        np.minimum(after[shift:], shifted[:-shift], out=after[shift:])
        np.minimum(after[:-shift], shifted[shift:], out=after[:-shift])
    return out
