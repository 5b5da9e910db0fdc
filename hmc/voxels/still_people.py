"""People who stay where they are through a recording without frames of the empty scene.

No difference from the scene tells of them: they are in all that is known of it. What does:

- they sway: where a person stands the images stir as far as a person reaches, in all views, and not beside (`hmc.camera.standing`);
- they are cut out by their colors, camera by camera, head to foot (`hmc.camera.standing_cut`);
- what is cut out in the views is one body: a hull of a person's size from near the floor up, which fills what was cut out.

Who was found by difference from the scene is not looked for again; who was in some samples alone is, at the place where they were.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import label

from hmc.camera.standing import APART_M, STATURES_M, Standing, find_standing
from hmc.camera.standing_cut import BodyColors, Figure, cut_body, figure, learn_body
from hmc.camera.stirring import stirring
from hmc.voxels.agreement import bodies, hull_view
from hmc.voxels.carving import CarvingTables, carve_levels
from hmc.voxels.grid import voxels_of

__all__ = ["StillPerson", "cut_still_people", "find_still_people"]

#: Samples by which a place is judged.
JUDGES = 7
#: A person's voxels are no further than this from their axis, metres.
REACH_M = 0.5
#: Who has a whole hull about a place in more than this share of the samples is known already.
KNOWN = 0.5
#: Hulls of a person: litres, where they begin at most and end at least above the floor, metres, and the share of what is cut out in each
#: view, or in the hull there, that both have.
LITRES = (25.0, 220.0)
LOWEST_M, TOP_M = 0.45, 1.05
AGREE = 0.45


@dataclass(frozen=True)
class StillPerson:
    """A person who hardly moves.

    Attributes
    ----------
    place : Standing
    figures : tuple of Figure, one a camera
    colors : tuple of BodyColors, one a camera
    """

    place: Standing
    figures: tuple[Figure, ...]
    colors: tuple[BodyColors, ...]


def find_still_people(
    tables: CarvingTables, samples: Sequence[Sequence[np.ndarray | None]], people: Sequence[Sequence[np.ndarray | None]]
) -> tuple[tuple[StillPerson, ...], tuple[Standing, ...]]:
    """People who hardly move and were not found as differing from the scene.

    Parameters
    ----------
    tables : CarvingTables
        Of coarse voxels, and of cameras as large as the samples.
    samples : sequence of sequences of ndarray of uint8, shape (height, width, 3), or None
        Small images of all cameras, a frame at a time.
    people : sequence of sequences of ndarray of bool, shape (height, width), or None
        People who were found in them.

    Returns
    -------
    found : tuple of StillPerson
    doubted : tuple of Standing
        Places where the images stir as if a person stood there, but of which the views do not show one body.
    """
    whole = [k for k, frame in enumerate(samples) if all(image is not None for image in frame)]
    if len(whole) < JUDGES:
        return (), ()
    images, masks = ([[one for one in frames[k] if one is not None] for k in whole] for frames in (samples, people))
    stirred = [stirring([frame[c] for frame in images], [frame[c] for frame in masks]) for c in range(len(tables.rig))]
    grid = tables.grid
    room = np.array([grid.origin, grid.origin + np.array(grid.shape) * grid.voxel_size_m])
    places = find_standing(tables.rig, room, [amount for amount, _ in stirred], [known for _, known in stirred])
    judges = np.unique(np.linspace(0, len(images) - 1, JUDGES).round().astype(int))
    images = [images[k] for k in judges]
    known = [bodies(carve_levels(tables, masks[k], (0,))[0], tables) for k in judges]
    hulls = [grid.centres(voxels_of(hull)) for hull in known]
    found: list[StillPerson] = []
    doubted: list[Standing] = []
    for place in [*places, *_at_times(tables, known)]:
        if not _apart(place, found) or _is_known(tables, hulls, place):
            continue
        person = _examine(tables, images, hulls, place)
        if person is None:
            if place.score > 0:  # else nothing speaks for it but that somebody was there
                doubted.append(place)
        elif _apart(person.place, found):
            found.append(person)
    return tuple(found), tuple(doubted)


def cut_still_people(still: Sequence[StillPerson], camera: int, image: np.ndarray | None) -> np.ndarray | None:
    """Where people who hardly move are in one image.

    Parameters
    ----------
    still : sequence of StillPerson
    camera : int
        Place among those by which they were found.
    image : ndarray of uint8, shape (height, width, 3), or None
        Small.

    Returns
    -------
    ndarray of bool, shape (height, width), or None
        None where there is no image, or nobody who hardly moves.
    """
    if image is None or not still:
        return None
    return np.logical_or.reduce([cut_body(image, None, one.figures[camera], one.colors[camera]) for one in still])


def _examine(tables: CarvingTables, samples, hulls: Sequence[np.ndarray], place: Standing) -> StillPerson | None:
    """The person at a place, or None if the views do not show one body there; `hulls` are points of those who are known, (n, 3) each."""
    for last in (False, True):
        others = [_others(tables, hull, place) for hull in hulls]
        figures = tuple(figure(camera, place) for camera in tables.rig)
        colors = tuple(
            learn_body([frame[c] for frame in samples], [masks[c] for masks in others], figures[c]) for c in range(len(tables.rig))
        )
        measured = []
        for frame, masks in zip(samples, others, strict=True):
            cuts = [cut_body(image, mask, *one) for image, mask, one in zip(frame, masks, zip(figures, colors, strict=True), strict=True)]
            measured.append(_measure(tables, place, cuts, masks, figures))
        litres, lowest, top, x, y, *agree = np.median(np.array(measured), axis=0)
        if litres < LITRES[0]:
            return None
        if not last:
            # Places are tried a step apart: what is cut out beside the true one misses the feet.
            place = replace(place, x=float(x), y=float(y), stature_m=float(top))
        elif not (litres <= LITRES[1] and _is_upright(lowest, top) and np.sort(agree)[1] >= AGREE):
            return None
    return StillPerson(place, figures, colors)


def _measure(tables: CarvingTables, place: Standing, cuts, others, figures: Sequence[Figure]) -> list[float]:
    """Litres of the hull of what was cut out, its lowest and highest point, its middle in x and y, and how well each view agrees."""
    grid = tables.grid
    filled = [cut | (mask & one.reach) for cut, mask, one in zip(cuts, others, figures, strict=True)]
    points = grid.centres(voxels_of(carve_levels(tables, filled, (0,))[0]))
    points = points[_within(points, place, REACH_M)]
    if len(points) == 0:
        return [0.0, np.inf, 0.0, place.x, place.y, *([0.0] * len(cuts))]
    agree = []
    for camera, cut, mask in zip(tables.rig, cuts, others, strict=True):
        seen = hull_view(camera, points, 0.65 * grid.voxel_size_m)
        either = (seen | cut) & ~mask
        agree.append(float((seen & cut & ~mask).sum() / either.sum()) if either.any() else 1.0)
    top = float(np.quantile(points[:, 2], 0.995)) + grid.voxel_size_m / 2
    return [1000 * len(points) * grid.voxel_size_m**3, float(points[:, 2].min()), top, *points[:, :2].mean(axis=0).tolist(), *agree]


def _others(tables: CarvingTables, hull: np.ndarray, place: Standing) -> list[np.ndarray]:
    """Where in each view people are who stand elsewhere."""
    points = hull[~_within(hull, place, 0.8 * REACH_M)]
    return [hull_view(camera, points, 0.65 * tables.grid.voxel_size_m) for camera in tables.rig]


def _within(points: np.ndarray, place: Standing, radius_m: float) -> np.ndarray:
    """Which of some points, (n, 3), are no further from a place, seen from above."""
    return np.hypot(points[:, 0] - place.x, points[:, 1] - place.y) <= radius_m


def _is_upright(lowest: float, top: float) -> bool:
    """Whether a body goes from near the floor to where one who sits ends."""
    return lowest <= LOWEST_M and top >= TOP_M


def _is_body(points: np.ndarray, voxel_size_m: float, most_litres: float = np.inf) -> bool:
    """Whether voxels of a hull, (n, 3), are a whole person."""
    litres = 1000 * len(points) * voxel_size_m**3
    return LITRES[0] <= litres <= most_litres and _is_upright(points[:, 2].min(), points[:, 2].max() + voxel_size_m / 2)


def _apart(place: Standing, found: Sequence[StillPerson]) -> bool:
    return all(np.hypot(place.x - one.place.x, place.y - one.place.y) > APART_M for one in found)


def _at_times(tables: CarvingTables, hulls: Sequence[np.ndarray]) -> list[Standing]:
    """Places at which two samples or more have a whole body: who stands still in the others is scene there."""
    grid = tables.grid
    seen: list[Standing] = []
    for hull in hulls:
        parts, n = label(hull.any(axis=2), np.ones((3, 3)))
        for part in range(1, n + 1):
            points = grid.centres(voxels_of(hull & (parts == part)[..., None]))
            if _is_body(points, grid.voxel_size_m, LITRES[1]):
                x, y = points[:, :2].mean(axis=0).tolist()
                top = float(points[:, 2].max()) + grid.voxel_size_m / 2
                seen.append(Standing(x, y, min(top, STATURES_M[-1]), 0.0))
    beside = [[np.hypot(one.x - other.x, one.y - other.y) <= APART_M / 2 for other in seen] for one in seen]
    places: list[Standing] = []
    for place, near in zip(seen, beside, strict=True):
        if sum(near) >= 2 and all(np.hypot(place.x - one.x, place.y - one.y) > APART_M for one in places):
            places.append(place)
    return places


def _is_known(tables: CarvingTables, hulls: Sequence[np.ndarray], place: Standing) -> bool:
    """Whether enough samples have the whole body of a known person about a place: one who steps from side to side is not still."""
    near = [hull[_within(hull, place, REACH_M)] for hull in hulls]
    return bool(np.mean([_is_body(points, tables.grid.voxel_size_m) for points in near]) > KNOWN)
