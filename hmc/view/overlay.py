"""Drawing people into an image: stick figures, outlines of the flesh, tracks, labels. Every function draws into the image it is given.

Left limbs are orange and right limbs blue, of every person; trunk, head, outline and label have the person's color. Colors are BGR.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from hmc.body.flesh import place_points, surface_samples
from hmc.body.kinematics import segment_transforms
from hmc.body.model import BodyModel
from hmc.camera.model import Camera, project
from hmc.io.keypoints import KEYPOINTS
from hmc.landmarks import BONES, landmark_index

__all__ = ["LEFT", "RIGHT", "draw_keypoints", "draw_label", "draw_outline", "draw_paths", "draw_sticks", "draw_track", "person_color"]

Color = tuple[int, int, int]

LEFT: Color = (40, 140, 255)
RIGHT: Color = (255, 160, 60)
PERSONS: tuple[Color, ...] = ((120, 230, 110), (220, 110, 235), (70, 225, 250), (225, 225, 90), (150, 150, 255), (200, 200, 200))
DARK: Color = (25, 22, 20)
WHITE: Color = (255, 255, 255)

#: Sub-pixel bits of OpenCV's drawing functions.
SHIFT = 4
#: Pieces into which a bone is cut, so that it bends as the lens bends it.
PIECES = 8
#: Points around each end of a cone.
RING = 16
#: Points along and around the ellipsoid of a person of whom only the position is known, and the ellipsoid's radius across, metres.
TRACK_POINTS = 24
TRACK_RADIUS_M = 0.3


def person_color(person: int) -> Color:
    """The color of a person's number; six of them, over and over."""
    return PERSONS[person % len(PERSONS)]


def draw_sticks(
    image: np.ndarray, camera: Camera, points: np.ndarray, person: int, width: float = 2.0, doubtful: np.ndarray | None = None
) -> None:
    """Draw a person's landmarks as a stick figure.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3), uint8
        Drawn into; of the camera's size.
    camera : Camera
    points : ndarray, shape (15, 3)
        Landmarks, world, metres; bones with a missing (NaN) end are left out.
    person : int
        Number that decides the color.
    width : float
        Of a bone, pixels.
    doubtful : ndarray of bool, shape (15,), optional
        Landmarks that are not to be relied on: the bones that end there are broken lines, and the landmark has no white dot.
    """
    doubtful = np.zeros(len(points), bool) if doubtful is None else doubtful
    ends = np.array([[landmark_index(a), landmark_index(b)] for a, b in BONES])
    t = np.linspace(0, 1, PIECES + 1)[:, None]
    lines = points[ends[:, 0], None] * (1 - t) + points[ends[:, 1], None] * t
    lines[np.ix_(doubtful[ends[:, 1]], np.arange(2, PIECES, 3))] = np.nan
    colors = [{"l_": LEFT, "r_": RIGHT}.get(b[:2], person_color(person)) for _, b in BONES]
    # Dark edges first, so that no edge covers a neighbour's color.
    draw_paths(image, camera, lines, DARK, width + 2)
    draw_paths(image, camera, lines, colors, width)
    uv, valid = project(camera, points)
    for u, v in uv[valid & ~doubtful & _near_image(uv, camera)]:
        centre = round(u * 2**SHIFT), round(v * 2**SHIFT)
        cv2.circle(image, centre, round((width * 0.5 + 1) * 2**SHIFT), DARK, -1, cv2.LINE_AA, SHIFT)
        cv2.circle(image, centre, round((width * 0.5 + 0.25) * 2**SHIFT), (255, 255, 255), -1, cv2.LINE_AA, SHIFT)


def draw_outline(image: np.ndarray, camera: Camera, body: BodyModel, state: np.ndarray, person: int, width: float = 1.0) -> None:
    """Draw the outline of a body's flesh.

    Parameters
    ----------
    image, camera, person, width
        As for `draw_sticks`.
    body : BodyModel
    state : ndarray, shape (37,)
    """
    uv, valid = project(camera, cone_rings(body, state))
    mask = np.zeros(image.shape[:2], np.uint8)
    for ring, seen in zip(uv, valid & _near_image(uv, camera), strict=True):
        if seen.all():
            hull = cv2.convexHull(np.round(ring * 2**SHIFT).astype(np.int32))
            cv2.fillConvexPoly(mask, hull, 255, cv2.LINE_8, SHIFT)
    outlines, _ = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    smooth = [cv2.approxPolyDP(outline, 0.8, True) for outline in outlines]  # the staircase of pixels
    cv2.polylines(image, smooth, True, person_color(person), max(1, round(width)), cv2.LINE_AA)


def cone_rings(body: BodyModel, state: np.ndarray) -> np.ndarray:
    """Points around both ends of every cone of the flesh: their convex hull in an image is the cone's silhouette.

    Returns
    -------
    ndarray, shape (n_cones, 2 * RING, 3)
        World, metres.
    """
    n = len(body.cones.segment)
    along = np.tile(np.repeat([0.0, 1.0], RING), n)
    angle = np.tile(np.arange(RING) * 2 * np.pi / RING, 2 * n)
    samples = surface_samples(body, (np.repeat(np.arange(n), 2 * RING), along, angle))
    return place_points(*segment_transforms(body, state), samples.points, samples.segment).reshape(n, 2 * RING, 3)


def draw_track(image: np.ndarray, camera: Camera, position: np.ndarray, person: int, width: float = 2.0) -> None:
    """Mark a person of whom only the position is known: the outline of an upright ellipsoid that stands on the floor.

    Its half axes are .3 m, .3 m and the centroid's height (Canton 2009, section 4.2.3).

    Parameters
    ----------
    image, camera, person, width
        As for `draw_sticks`.
    position : ndarray, shape (3,)
        Centroid, world, metres.
    """
    uv, valid = project(camera, track_ellipsoid(position))
    seen = uv[valid & _near_image(uv, camera)]
    if len(seen) < 3:
        return
    outline = cv2.convexHull(np.round(seen * 2**SHIFT).astype(np.int32))
    for color, extra in ((DARK, 2.0), (person_color(person), 0.0)):
        cv2.polylines(image, [outline], True, color, max(1, round(width + extra)), cv2.LINE_AA, SHIFT)


def track_ellipsoid(position: np.ndarray) -> np.ndarray:
    """Points on the ellipsoid of `draw_track`, shape (n, 3), metres."""
    along, around = np.meshgrid(np.linspace(0, np.pi, TRACK_POINTS), np.arange(TRACK_POINTS) * 2 * np.pi / TRACK_POINTS)
    sphere = np.stack([np.sin(along) * np.cos(around), np.sin(along) * np.sin(around), np.cos(along)], axis=-1).reshape(-1, 3)
    return position + sphere * np.array([TRACK_RADIUS_M, TRACK_RADIUS_M, position[2]])


def draw_keypoints(image: np.ndarray, points: np.ndarray, reach: float = 3.0) -> None:
    """Mark what a 2-D detector found with crosses: left ones orange, right ones blue, those of neither side white.

    Parameters
    ----------
    image : ndarray, shape (h, w, 3), uint8
        Drawn into.
    points : ndarray, shape (n_people, 26, 3)
        x, y (pixels of this image) and confidence, as of `hmc.io.keypoints.KeypointSource.frame`; what is not given is left out.
    reach : float
        Of an arm of a cross, pixels.
    """
    sides = [{"l_": LEFT, "r_": RIGHT}.get(name[:2], WHITE) for name in KEYPOINTS]
    far = 3 * max(image.shape[:2])
    given = (points[..., 2] > 0) & (np.abs(np.nan_to_num(points[..., :2], nan=np.inf)) < far).all(axis=-1)
    arms = reach * np.array([[[-1, -1], [1, 1]], [[-1, 1], [1, -1]]])
    for person, k in np.argwhere(given):
        ends = np.round((points[person, k, :2] + arms) * 2**SHIFT).astype(np.int32)
        for color, width in ((DARK, 3), (sides[k], 1)):
            cv2.polylines(image, list(ends), False, color, width, cv2.LINE_AA, SHIFT)


def draw_paths(image: np.ndarray, camera: Camera, paths: np.ndarray, colors: Color | list[Color], width: float) -> None:
    """Draw chains of world points; the parts that the camera cannot have in view are left out.

    Parameters
    ----------
    image, camera, width
        As for `draw_sticks`.
    paths : ndarray, shape (k, 3) or (n, k, 3)
        One chain or many, metres; a point with NaN interrupts its chain.
    colors : color, or list of n of them
    """
    paths = paths.reshape(-1, *paths.shape[-2:])
    uv, valid = project(camera, paths)
    seen = valid & _near_image(uv, camera)
    pixels = np.round(np.where(seen[..., None], uv, 0) * 2**SHIFT).astype(np.int32)
    for k, chain in enumerate(pixels):
        color = colors[k] if isinstance(colors, list) else colors
        parts = [chain] if seen[k].all() else [part[seen_part] for part, seen_part in _split(chain, seen[k])]
        cv2.polylines(image, [part for part in parts if len(part) > 1], False, color, max(1, round(width)), cv2.LINE_AA, SHIFT)


def _split(chain: np.ndarray, seen: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """A chain cut before every unseen point, with what of each part is seen."""
    cuts = np.flatnonzero(~seen)
    return list(zip(np.split(chain, cuts), np.split(seen, cuts), strict=True))


def draw_label(
    image: np.ndarray, text: str, place: np.ndarray | Sequence[float], color: Color = (255, 255, 255), scale: float = 0.45
) -> None:
    """Write a line with a shadow; `place` is its lower left corner in pixels."""
    x, y = round(float(place[0])), round(float(place[1]))
    for corner, ink in (((x + 1, y + 1), DARK), ((x, y), color)):
        cv2.putText(image, text, corner, cv2.FONT_HERSHEY_SIMPLEX, scale, ink, 1, cv2.LINE_AA)


def _near_image(uv: np.ndarray, camera: Camera) -> np.ndarray:
    """Within three image widths of the image; what lies beyond is not worth drawing, and overflows OpenCV's integers."""
    return (np.abs(uv) < 3 * max(camera.size)).all(axis=-1)
