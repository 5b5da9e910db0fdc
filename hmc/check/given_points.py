"""Points on the floor that a user shows: marked by hand in some cameras' images, or the corners of a chessboard that lies there."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from hmc.camera.model import Rig, project
from hmc.camera.triangulation import triangulate_pixels
from hmc.camera.world import World
from hmc.errors import InputError
from hmc.io.door import open_text

__all__ = ["GroundPoints", "board_points", "read_points"]

#: Points that are farther off than this from where they are said to be, or from their common plane, of the points' extent, are no floor.
WORST = 0.05
#: A board's corners, seen by two cameras, must fall together to so many pixels of an image 640 wide.
BOARD_PX = 3.0
#: No pixel, and no metre, is as large.
MOST = 1e6


@dataclass(frozen=True, eq=False)
class GroundPoints:
    """What points on the floor say, in the calibration's coordinates and units.

    Parameters
    ----------
    up : ndarray, shape (3,)
        The floor's normal, of length 1, on the cameras' side.
    floor : float
        ``up @ x`` of points on the floor.
    lines : tuple of str
        What was found.
    unit_m : float or None
        Metres a unit, where the points tell.
    world : World or None
        All of it, where points' places in the new world are given.
    """

    up: np.ndarray
    floor: float
    lines: tuple[str, ...]
    unit_m: float | None = None
    world: World | None = None


def read_points(path: Path, rig: Rig) -> GroundPoints:
    """Points that were marked by hand.

    Parameters
    ----------
    path : Path
        CSV with the columns ``point, camera, u, v`` (pixels), a row for every camera that shows a point, two cameras at least; where
        ``x, y, z`` (metres) are there too, they are the point's place in the new world; else all points are on the floor.
    rig : Rig

    Raises
    ------
    InputError
        When the file is not of this form, or points do not lie as they should.
    """
    try:
        with open_text(path) as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as CSV ({error})") from None
    missing = [name for name in ("point", "camera", "u", "v") if not rows or name not in rows[0]]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}; a row is point,camera,u,v and, where known, x,y,z in metres")
    names = list(dict.fromkeys(row["point"] for row in rows))
    uv = np.full((len(names), len(rig), 2), np.nan)
    places = np.full((len(names), 3), np.nan)
    for line, row in enumerate(rows, start=2):
        if row["camera"] not in rig.names:
            raise InputError(f"{path}, line {line}: no camera named {row['camera']!r}; the rig has {', '.join(rig.names)}")
        uv[names.index(row["point"]), rig.names.index(row["camera"])] = _numbers(path, line, row, "uv")
        if all(row.get(axis) for axis in "xyz"):
            places[names.index(row["point"])] = _numbers(path, line, row, "xyz")
    lonely = [name for name, seen in zip(names, np.isfinite(uv).all(axis=2).sum(axis=1), strict=True) if seen < 2]
    if lonely or len(names) < 3:
        what = f"point {lonely[0]!r} is marked in one camera only" if lonely else f"{len(names)} points"
        raise InputError(f"{path}: {what}; three points or more are wanted, each in two cameras at least")
    found = triangulate_pixels(list(rig), uv)
    known = np.isfinite(places).all(axis=1)
    if known.sum() >= 3:
        return _placed(path, rig, found[known], places[known])
    return _on_floor(rig, found, f"{path.name}: {len(names)} points of the floor")


def _numbers(path: Path, line: int, row: Mapping[str, str | None], names: Sequence[str]) -> list[float]:
    try:
        values = [float(row[name] or "") for name in names]
    except ValueError:
        raise InputError(f"{path}, line {line}: u, v, x, y and z must be numbers") from None
    if not all(abs(value) < MOST for value in values):
        raise InputError(f"{path}, line {line}: {', '.join(names)} must be numbers below {MOST:.0e} (u, v pixels; x, y, z metres)")
    return values


def board_points(rig: Rig, images: Sequence[np.ndarray | None], size: tuple[int, int], square_m: float | None = None) -> GroundPoints:
    """The inner corners of a chessboard that lies on the floor.

    Parameters
    ----------
    rig : Rig
    images : sequence of ndarray of uint8, shape (h, w, 3), or None
        One a camera.
    size : (int, int)
        Inner corners a row and a column.
    square_m : float, optional
        Side of its squares, metres.

    Raises
    ------
    InputError
        When fewer than two cameras show it, or they do not agree.
    """
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    seen = {}
    for c, image in enumerate(images):
        if image is not None:
            there, corners = cv2.findChessboardCornersSB(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), size, flags=flags)
            if there:
                seen[c] = corners.reshape(-1, 2).astype(float)
    names = ", ".join(rig.names[c] for c in seen)
    if len(seen) < 2:
        raise InputError(
            f"--board {size[0]}x{size[1]}: found by {names or 'no camera'}; two at least must show it whole, in the first image"
        )
    first, *others = seen
    chosen = {first: seen[first]}
    for c in others:
        # A board looks the same turned about: the order in which the first camera's corners fall together with these.
        both = [rig[first], rig[c]]
        ways = [np.stack([seen[first], one], axis=1) for one in (seen[c], seen[c][::-1])]
        errors = [_reprojection(both, uv) for uv in ways]
        if min(errors) <= BOARD_PX:
            chosen[c] = ways[int(np.argmin(errors))][:, 1]
    if len(chosen) < 2:
        raise InputError(f"--board {size[0]}x{size[1]}: the corners that {names} see do not fall together; is the calibration theirs?")
    found = triangulate_pixels([rig[c] for c in chosen], np.stack(list(chosen.values()), axis=1))
    grid = found.reshape(size[1], size[0], 3)
    side = float(np.mean([np.linalg.norm(np.diff(grid, axis=k), axis=2).mean() for k in (0, 1)]))
    points = _on_floor(
        rig, found, f"a board of {size[0]} x {size[1]} corners on the floor, seen by {', '.join(rig.names[c] for c in chosen)}"
    )
    return points if square_m is None else GroundPoints(points.up, points.floor, points.lines, square_m / side)


def _reprojection(cameras: Sequence, uv: np.ndarray) -> float:
    """How far triangulated points fall from their pixels (n, n_views, 2) on the mean, pixels of an image 640 wide."""
    points = triangulate_pixels(cameras, uv)
    back = np.stack([project(camera, points)[0] for camera in cameras], axis=1)
    scale = np.array([max(camera.size) / 640 for camera in cameras])
    return float((np.linalg.norm(back - uv, axis=2) / scale).mean())


def _on_floor(rig: Rig, points: np.ndarray, what: str) -> GroundPoints:
    middle = points.mean(axis=0)
    _, extents, axes = np.linalg.svd(points - middle, full_matrices=False)
    if extents[1] < 0.02 * extents[0]:
        raise InputError(f"{what}: all on one line, which tells no floor; mark one beside it")
    if extents[2] > WORST * extents[0]:
        raise InputError(f"{what}: not in one plane ({extents[2] / extents[0]:.0%} of their extent apart); are they all on the floor?")
    up = axes[2] * np.sign(np.median((rig.centres - middle) @ axes[2]) or 1.0)
    return GroundPoints(up, float(middle @ up), (what,))


def _placed(path: Path, rig: Rig, found: np.ndarray, places: np.ndarray) -> GroundPoints:
    """The similarity that takes the points to their places (Umeyama 1991), for three or more that are not on a line."""
    a, b = found - found.mean(axis=0), places - places.mean(axis=0)
    extents = np.linalg.svd(b, compute_uv=False)
    if extents[1] < 0.02 * extents[0]:
        raise InputError(f"{path}: the points with x, y, z are all on one line; mark one beside it")
    rotation, _ = Rotation.align_vectors(b, a * np.linalg.norm(b) / np.linalg.norm(a))
    turned = a @ rotation.as_matrix().T
    scale = float((b * turned).sum() / (turned**2).sum())
    left = np.linalg.norm(scale * turned - b, axis=1).max()
    if left > WORST * extents[0]:
        raise InputError(
            f"{path}: points come out up to {left * 100:.0f} cm from where they should be; look at their pixels and x, y, z again"
        )
    world = World(rotation.as_matrix(), found.mean(axis=0) - rotation.as_matrix().T @ places.mean(axis=0) / scale, scale)
    line = f"{path.name}: {len(found)} points, which come out {left * 100:.1f} cm from their places at most"
    return GroundPoints(world.rotation[2], float(world.rotation[2] @ world.origin), (line,), scale, world)
