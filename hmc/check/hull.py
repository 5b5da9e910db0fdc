"""What a fine visual hull of a few moments tells: a camera that is a few pixels off, a floor at the wrong height, a room too small.

The hull is not bound to the room but reaches a little beyond it, and below the floor. Only voxels of a coarse hull are looked at finely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from hmc.camera.model import Camera, Rig
from hmc.check.moments import Masks
from hmc.voxels.carving import pixel_of_voxel

__all__ = ["CoarseGrid", "Hull", "best_move", "beyond_room", "coarse_grid", "fine_hull", "floor_height", "misfit", "odd_camera"]

#: Column and row of the pixels on which points fall, and whether the camera sees them.
Places = tuple[np.ndarray, np.ndarray, np.ndarray]
#: How far beyond the room people are looked for, metres.
AROUND_M = 0.3
#: Sides of the coarse voxels (wider in a hall that would need more than `MOST_POINTS`) and of the fine ones, metres.
COARSE_M, FINE_M, MOST_POINTS = 0.06, 0.015, 400_000
#: Fine voxels are no smaller than half of what a pixel spans, and so many are looked at in one go.
AT_ONCE = 200_000
#: No more of them are looked at, larger ones where it would be more: 13 m^3 of the smallest.
MOST_FINE = 4_000_000
#: Half the diagonal of a cube against its side: what a voxel's centre stands for.
HALF_DIAGONAL = 0.87
#: Silhouettes are moved this far in search of a better fit, and a camera is off from that many pixels on; both for a width of 640.
SEARCH_PX, LEAST_MOVE_PX = 16, 3
#: A camera is off if moving its silhouettes covers this much more of them, and leaves at most that share of what was not covered. In good
#: rigs moving gains .003; where furniture hides legs from two cameras it gains .02, but leaves .85 (measured).
LEAST_GAIN, MOST_LEFT = 0.02, 0.6
#: A camera is an outlier if this much of its silhouettes is not covered, and without it the others, so many at least, are so much better
#: covered.
LEAST_OUTSIDE, LEAST_LIFT, LEAST_OTHERS = 0.03, 0.015, 4
#: Shares of the others' that differ by less tell nothing; then the camera is named whose own lie outside most.
ALIKE = 0.01
#: The floor is where the hull's cross-section is half of the largest one in the lowest part: height of that part, and of a layer, metres.
FEET_M, LAYER_M = 0.3, 0.01
#: Hull beyond one of the room's walls that is worth a word: cubic metres, and share of all.
LEAST_BEYOND_M3, LEAST_BEYOND = 0.004, 0.03


@dataclass(frozen=True)
class Hull:
    """Fine voxels at which at most one camera sees no person.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Centres, world, metres.
    voxel_m : float
    seen, missed : ndarray of bool, shape (n_cameras, n)
        The camera has a silhouette and sees the voxel; and sees no person there.
    pixels : tuple of ndarray of int, shape (2, n), one a camera
        Row and column on which each voxel falls; 0 where not seen.
    masks : tuple of ndarray of bool, shape (height, width), or None; one a camera
    """

    points: np.ndarray
    voxel_m: float
    seen: np.ndarray
    missed: np.ndarray
    pixels: tuple[np.ndarray, ...]
    masks: tuple[np.ndarray | None, ...]

    @property
    def strict(self) -> np.ndarray:
        """Centres of the voxels that three cameras or more see and none misses, (m, 3)."""
        return self.points[~self.missed.any(axis=0) & (self.seen.sum(axis=0) >= 3)]


@dataclass(frozen=True)
class CoarseGrid:
    """Coarse voxels of a room and a little around it, and where a rig's cameras see them: the same at every moment.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Centres, world, metres.
    voxel_m : float
    places : tuple of (column, row, seen), ndarrays of shape (n,), one a camera
        As of `pixel_of_voxel`.
    pixel_m : tuple of float, one a camera
        What a pixel spans at the points' middle depth, metres.
    """

    points: np.ndarray
    voxel_m: float
    places: tuple[Places, ...]
    pixel_m: tuple[float, ...]


def coarse_grid(rig: Rig, room: np.ndarray) -> CoarseGrid:
    """The coarse voxels in which people are looked for.

    Parameters
    ----------
    rig : Rig
    room : ndarray, shape (2, 3)
        Two opposite corners, metres.

    Returns
    -------
    CoarseGrid
    """
    low, high = room[0] - AROUND_M, room[1] + AROUND_M
    voxel_m = max(COARSE_M, float(np.prod(high - low) / MOST_POINTS) ** (1 / 3))
    axes = [np.arange(a, b, voxel_m) + voxel_m / 2 for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    places = tuple(pixel_of_voxel(camera, points) for camera in rig)
    return CoarseGrid(points, voxel_m, places, tuple(_pixel_m(camera, points) for camera in rig))


def fine_hull(rig: Rig, masks: Masks, grid: CoarseGrid) -> Hull:
    """The hull of one moment.

    Parameters
    ----------
    rig : Rig
    masks : sequence of ndarray of bool, shape (height, width), or None; one a camera
    grid : CoarseGrid
        Of this rig.

    Returns
    -------
    Hull
    """
    coarse, coarse_m = grid.points, grid.voxel_m
    wide = [None if mask is None else _dilate(mask, _reach(pixel_m, coarse_m)) for pixel_m, mask in zip(grid.pixel_m, masks, strict=True)]
    seen, missed = _look(wide, grid.places)
    kept = coarse[(seen.sum(axis=0) >= 3) & (missed.sum(axis=0) <= 1)]
    most = int((MOST_FINE / max(1, len(kept))) ** (1 / 3))  # silhouettes that are white everywhere leave the whole room
    n = max(1, min(most, round(coarse_m / max(FINE_M, min(grid.pixel_m) / 2))))
    steps = ((np.indices((n, n, n)).reshape(3, -1).T + 0.5) / n - 0.5) * coarse_m
    parts = [_near(rig, masks, (some[:, None] + steps).reshape(-1, 3)) for some in np.array_split(kept, len(kept) * n**3 // AT_ONCE + 1)]
    points, looks = np.concatenate([points for points, _ in parts]), np.concatenate([looks for _, looks in parts], axis=-1)
    seen, missed = looks[:, 2:].astype(bool).swapaxes(0, 1)
    return Hull(points, coarse_m / n, seen, missed, tuple(looks[:, :2]), tuple(masks))


def _near(rig: Rig, masks: Masks, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points that at most one camera misses; of each camera their row, column, whether it sees and misses them, (n_cameras, 4, m)."""
    looks = np.zeros((0, 4, len(points)), np.int32)
    for camera, mask in zip(rig, masks, strict=True):
        column, row, inside = pixel_of_voxel(camera, points)
        (seen,), (missed,) = _look([mask], [(column, row, inside)])
        looks = np.concatenate([looks, np.stack([row, column, seen, missed])[None]])
        near = looks[:, 3].sum(axis=0) <= 1
        if not near.all():  # what two cameras miss, the others need not look at
            points, looks = points[near], looks[:, :, near]
    return points, looks


def misfit(rig: Rig, hulls: Sequence[Hull], members: Sequence[int]) -> np.ndarray:
    """The share of each camera's silhouettes that the hull of the other members does not cover, if they were moved by so many pixels.

    Parameters
    ----------
    rig : Rig
    hulls : sequence of Hull
        A few moments.
    members : sequence of int
        Cameras to compare; others are as if they were not there.

    Returns
    -------
    ndarray, shape (len(members), 2 * 16 + 1, 2 * 16 + 1)
        By how far down and right they are moved, from -16 to 16 pixels of an image 640 wide; nan where there is no silhouette.
    """
    side = 2 * SEARCH_PX + 1
    result = np.full((len(members), side, side), np.nan)
    for place, c in enumerate(members):
        others = [other for other in members if other != c]
        reach = round(SEARCH_PX * _scale(rig[c]))
        covered, total = np.zeros((2 * reach + 1,) * 2), 0
        for hull in hulls:
            mask = hull.masks[c]
            inside = hull.seen[c] & ~hull.missed[others].any(axis=0) & (hull.seen[others].sum(axis=0) >= 2)
            if mask is None or not mask.any() or not inside.any():
                continue
            view = np.zeros(mask.shape, bool)
            view[tuple(hull.pixels[c][:, inside])] = True
            view = _dilate(view, _reach(_pixel_m(rig[c], hull.points[inside]), hull.voxel_m))
            view = cv2.copyMakeBorder(view.astype(np.float32), *(reach,) * 4, cv2.BORDER_REPLICATE)
            left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
            shape = mask[top : top + height, left : left + width].astype(np.float32)
            covered += cv2.matchTemplate(view[top : top + height + 2 * reach, left : left + width + 2 * reach], shape, cv2.TM_CCORR)
            total += int(mask.sum())
        if total:
            steps = np.round(np.linspace(0, 2 * reach, side)).astype(int)
            result[place] = 1 - covered[np.ix_(steps, steps)] / total
    return result


def best_move(outside: np.ndarray) -> tuple[float, tuple[int, int]] | None:
    """How a camera's silhouettes would fit the others' much better.

    Parameters
    ----------
    outside : ndarray, shape (33, 33)
        A camera's entry of `misfit`.

    Returns
    -------
    (share outside then, (right, down) in pixels of an image 640 wide), or None where no move makes them fit much better
    """
    now, then = float(outside[SEARCH_PX, SEARCH_PX]), float(outside.min())
    if not (now - then >= LEAST_GAIN and then <= MOST_LEFT * now):
        return None
    moves = np.argwhere(outside <= then + 0.002) - SEARCH_PX
    down, right = (int(n) for n in moves[np.hypot(*moves.T).argmin()])
    return (then, (right, down)) if np.hypot(down, right) >= LEAST_MOVE_PX else None


def odd_camera(rig: Rig, hulls: Sequence[Hull], shares: np.ndarray) -> tuple[int, float | None] | None:
    """The camera that does not fit the others.

    It is the one without which the others' silhouettes fit each other, and whose own do not fit theirs: one before which furniture hides
    a person spoils the others' fit too, but its own silhouettes are covered. Where no camera is (four cameras always fit without one of
    them, nearly), it is the one whose silhouettes would fit much better if they were moved.

    Parameters
    ----------
    rig : Rig
    hulls : sequence of Hull
    shares : ndarray
        As from `misfit`, of all cameras.

    Returns
    -------
    (camera, share of the others' silhouettes outside without it, or None), or None
    """
    outside = shares[:, SEARCH_PX, SEARCH_PX]
    found = []
    for c in np.flatnonzero(outside >= LEAST_OUTSIDE).tolist():
        others = [other for other in range(len(outside)) if other != c]
        left_out = misfit(rig, hulls, others)[:, SEARCH_PX, SEARCH_PX]
        known = ~np.isnan(left_out) & ~np.isnan(outside[others])
        if known.sum() < LEAST_OTHERS:
            continue
        before, after = float(outside[others][known].mean()), float(left_out[known].mean())
        if before - after >= LEAST_LIFT and after <= before / 2:
            found.append((c, after))
    if found:
        least = min(after for _, after in found)
        return max((one for one in found if one[1] <= least + ALIKE), key=lambda one: outside[one[0]])
    gains = [0.0 if best_move(one) is None else float(one[SEARCH_PX, SEARCH_PX] - one.min()) for one in shares]
    return (int(np.argmax(gains)), None) if any(gains) else None


def floor_height(hulls: Sequence[Hull], floor_z: float) -> float:
    """Where the hulls' feet stand, metres, in the middle of the moments; nan where no hull comes near the floor.

    A hull narrows quickly below the feet: the height is that from which on its cross-section is half of the largest one between 30 cm
    below the floor and 30 cm above. A person who sits or kneels, or whose feet are hidden, stands too high by this measure; one
    whose clothes are wide on the floor, before cameras that look down steeply, some centimetres too low.
    """
    edges = floor_z + np.arange(-round(AROUND_M / LAYER_M), round(FEET_M / LAYER_M) + 1) * LAYER_M
    heights = []
    for hull in hulls:
        area = np.histogram(hull.strict[:, 2], edges)[0].astype(float)
        # Voxels lie in layers of their own.
        area = np.convolve(area, np.full(5, 1 / 5), "same")
        if area.any():
            heights.append(edges[:-1][area >= area.max() / 2][0])
    return float(np.median(heights)) if heights else float("nan")


def beyond_room(hulls: Sequence[Hull], room: np.ndarray) -> list[tuple[int, int, float, float]]:
    """Walls and ceilings that cut people.

    Returns
    -------
    list of (0 low or 1 high, axis, share of the hulls beyond it, how far they reach beyond it in metres)
        Of the floor nothing is said (`floor_height`).
    """
    if not hulls:
        return []
    points = np.concatenate([hull.strict for hull in hulls])
    volume_m3 = sum(hull.voxel_m**3 for hull in hulls) / len(hulls)
    found = []
    for end, axis in ((0, 0), (1, 0), (0, 1), (1, 1), (1, 2)):
        depth = (points[:, axis] - room[end, axis]) * (1 if end else -1)
        n = int((depth > 0).sum())
        if n * volume_m3 >= LEAST_BEYOND_M3 * len(hulls) and n >= LEAST_BEYOND * len(points):
            found.append((end, axis, n / len(points), float(np.quantile(depth[depth > 0], 0.95))))
    return found


def _look(masks: Masks, places: Sequence[Places]) -> tuple[np.ndarray, np.ndarray]:
    """Which cameras see points that fall on these pixels, and which of them see no person there; both (n_cameras, n)."""
    seen, missed = (np.zeros((len(places), len(places[0][2])), bool) for _ in range(2))
    for c, (mask, (column, row, in_image)) in enumerate(zip(masks, places, strict=True)):
        if mask is not None:
            seen[c] = in_image
            missed[c] = in_image & ~mask[row, column]
    return seen, missed


def _reach(pixel_m: float, voxel_m: float) -> int:
    """Pixels from a voxel's centre to its corner."""
    return int(np.ceil(voxel_m * HALF_DIAGONAL / pixel_m))


def _pixel_m(camera: Camera, points: np.ndarray) -> float:
    """What a pixel spans at the points' middle depth, metres."""
    depth = float(np.median(points @ camera.rotation[2] + camera.translation[2]))
    return max(depth, 0.5) / float(camera.matrix[0, 0])


def _dilate(mask: np.ndarray, reach: int) -> np.ndarray:
    return cv2.dilate(mask.view(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)).view(bool)


def _scale(camera: Camera) -> float:
    return max(camera.size) / 640
