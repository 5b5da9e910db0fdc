"""Occluding contours of the solids, and which of their points other solids hide. Kehl (2006), sections 5.2 (Eq. 3 to 5) and 5.3 (Eq. 6, 7).

The rim of a solid parts what faces the camera from what does not. It is found along closed strips of surface points, circles of
latitude and pairs of meridians: where the sign of (normal . viewing direction) changes between two points, the place in between is
interpolated. The two rim points of a circle of latitude lie symmetric to the limb's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.solids import GROUPS, SolidBody
from hmc.body.superellipsoids import inside_outside, normals_at, points_at

__all__ = ["ContourPoints", "Strips", "contour_points", "hidden", "make_strips"]

#: Points of a strip.
STEPS = 24
#: Where circles of latitude are, in shares of the superellipsoid's length, and how many pairs of meridians there are.
LEVELS = np.linspace(0.08, 0.88, 8)
MERIDIANS = 3
#: A viewing ray is asked whether it enters a solid at so many points between its entry into the bounding box and its exit, halving the
#: gaps in between so many times.
HALVINGS = 4


@dataclass(frozen=True)
class Strips:
    """Closed strips around the limbs' solids.

    Parameters
    ----------
    solid, group : ndarray of int, shape (n,)
    is_circle : ndarray of bool, shape (n,)
        A circle of latitude; otherwise a pair of meridians.
    level : ndarray, shape (n,)
        Latitude of a circle, longitude of the first meridian, radians.
    normals : ndarray, shape (n, STEPS, 3)
        Outward, solid's frame.
    heights : ndarray, shape (n, STEPS)
        Normal times point, metres.
    circles, meridians : tuple of ndarray of int
        Strips of either kind of each limb.
    """

    solid: np.ndarray
    group: np.ndarray
    is_circle: np.ndarray
    level: np.ndarray
    normals: np.ndarray
    heights: np.ndarray
    circles: tuple[np.ndarray, ...]
    meridians: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class ContourPoints:
    """Rim points, two a strip.

    Parameters
    ----------
    points, normals : ndarray, shape (n, 2, 3)
        World: metres, and unit vectors.
    found : ndarray of bool, shape (n,)
        The strip has a rim as seen from the camera.
    """

    points: np.ndarray
    normals: np.ndarray
    found: np.ndarray


def make_strips(body: SolidBody) -> Strips:
    """Lay strips around every solid whose contours count."""
    solid, circle, level = [], [], []
    for k in np.flatnonzero(body.has_edges):
        latitudes = np.arcsin(LEVELS ** (1 / body.solids.eps1[k, 1]))
        longitudes = np.arange(MERIDIANS) * np.pi / MERIDIANS - np.pi
        solid += [k] * (len(latitudes) + MERIDIANS)
        circle += [True] * len(latitudes) + [False] * MERIDIANS
        level += [*latitudes, *longitudes]
    index, is_circle, levels = np.array(solid), np.array(circle), np.array(level)
    eta, omega = _coordinates(is_circle[:, None], levels[:, None], _STEP * np.arange(STEPS))
    wide = np.broadcast_to(index[:, None], eta.shape)
    normals = normals_at(body.solids, wide, eta, omega)
    heights = np.einsum("nsi,nsi->ns", normals, points_at(body.solids, wide, eta, omega))
    group = body.group[index]
    limbs = range(GROUPS.index("r_arm"), len(GROUPS))
    circles = tuple(np.flatnonzero(is_circle & (group == limb)) for limb in limbs)
    meridians = tuple(np.flatnonzero(~is_circle & (group == limb)) for limb in limbs)
    return Strips(index, group, is_circle, levels, normals, heights, circles, meridians)


_STEP = 2 * np.pi / STEPS


def _coordinates(is_circle: np.ndarray, level: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude of a place (an angle, 0 to 2 pi) on a strip."""
    place = place % (2 * np.pi)
    # Up one meridian from pole to pole, and down the opposite one.
    there = place < np.pi
    eta = np.where(is_circle, level, np.where(there, place - np.pi / 2, 1.5 * np.pi - place))
    omega = np.where(is_circle, place - np.pi, np.where(there, level, level + np.pi))
    return eta, omega


def contour_points(
    body: SolidBody, strips: Strips, chosen: np.ndarray, turns: np.ndarray, centres: np.ndarray, cameras: np.ndarray
) -> ContourPoints:
    """Where strips cross the rim.

    Parameters
    ----------
    body : SolidBody
    strips : Strips
    chosen : ndarray of int, shape (n,)
        Strips; one may come several times.
    turns, centres : ndarray
        Of the solids, from `hmc.body.solids.to_world`.
    cameras : ndarray, shape (n, 3)
        Centre of the camera that looks at each, world, metres.

    Returns
    -------
    ContourPoints
    """
    solid = strips.solid[chosen]
    local = np.einsum("nij,ni->nj", turns[solid], cameras - centres[solid])
    facing = strips.heights[chosen] - (strips.normals[chosen] @ local[..., None])[..., 0]  # Eq. 3; negative where seen
    following = np.roll(facing, -1, axis=1)
    changes = (facing > 0) != (following > 0)
    first = changes.argmax(axis=1)
    second = STEPS - 1 - changes[:, ::-1].argmax(axis=1)
    found = changes.sum(axis=1) == 2
    ends = np.stack([first, second], axis=1)
    rows = np.arange(len(chosen))[:, None]
    here, there = np.abs(facing[rows, ends]), np.abs(following[rows, ends])
    place = _STEP * (ends + here / np.maximum(here + there, 1e-12))  # Eq. 5
    eta, omega = _coordinates(strips.is_circle[chosen][:, None], strips.level[chosen][:, None], place)
    wide = np.broadcast_to(solid[:, None], eta.shape)
    points = points_at(body.solids, wide, eta, omega)
    normals = normals_at(body.solids, wide, eta, omega)
    turn = turns[solid]
    return ContourPoints(points @ turn.swapaxes(1, 2) + centres[solid][:, None], normals @ turn.swapaxes(1, 2), found)


def hidden(
    body: SolidBody, turns: np.ndarray, centres: np.ndarray, solid: np.ndarray, points: np.ndarray, cameras: np.ndarray
) -> np.ndarray:
    """Whether a solid stands between surface points and their cameras, or holds the point itself. Section 5.3.

    Parameters
    ----------
    body : SolidBody
    turns, centres : ndarray
        Of the solids.
    solid : ndarray of int, shape (n,)
        To which each point belongs; it does not hide it.
    points, cameras : ndarray, shape (n, 3)
        World, metres.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    # Eq. 7: point and ray in every solid's frame, shape (n_solids, n, 3).
    start = (points - centres[:, None]) @ turns
    ray = ((cameras - points) @ turns.reshape(-1, 3, 3)).reshape(len(turns), -1, 3)
    half = body.solids.across
    low = np.concatenate([-half, -body.solids.along[:, :1]], axis=1)[:, None]
    high = np.concatenate([half, body.solids.along[:, 1:]], axis=1)[:, None]
    inverse = 1 / np.where(np.abs(ray) < 1e-12, 1e-12, ray)
    a, b = (low - start) * inverse, (high - start) * inverse
    enter = np.maximum(np.minimum(a, b).max(axis=2), 0.0)
    leave = np.minimum(np.maximum(a, b).min(axis=2), 1.0)
    meets = enter < leave
    meets[solid, np.arange(len(points))] = False
    which, point = np.nonzero(meets)
    enter, leave, start, ray = enter[which, point], leave[which, point], start[which, point], ray[which, point]
    out = np.zeros(len(points), bool)
    # The point itself, then the middle of the ray's way through the box, then the quarters, ...
    shares = [np.array([0.0]), *(np.arange(1, 2**k, 2) / 2**k for k in range(1, HALVINGS + 1))]
    for share in shares:
        if not len(which):
            break
        at = start[:, None] + (enter[:, None] + share * (leave - enter)[:, None])[..., None] * ray[:, None]
        inside = (inside_outside(body.solids, np.broadcast_to(which[:, None], at.shape[:2]), at) <= 1).any(axis=1)
        out[point[inside]] = True
        going = ~out[point]
        which, point, enter, leave, start, ray = (part[going] for part in (which, point, enter, leave, start, ray))
    return out
