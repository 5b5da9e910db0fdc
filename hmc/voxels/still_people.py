"""People who stay where they are through a recording without frames of the empty scene.

No difference from the scene tells of them: they are in all that is known of it. What does:

- they sway, and move their arms: where a person stands the images stir in all views (`hmc.voxels.stirring_places`);
- they are cut out by their colors, camera by camera, head to foot (`hmc.camera.standing_cut`);
- what is cut out in the views is one body: a hull of a person's size, which fills what was cut out.

Who was found by difference from the scene is not looked for again; who was in some samples alone is, at the place where they were.
There, what looks like a person may be the wall behind nobody, so only a body that stands on the floor counts. Where something stirs,
trousers of the wall's color do not hide who does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmc.camera.empty_scene import of_camera
from hmc.camera.standing import APART_M, Standing
from hmc.camera.standing_cut import BodyColors, Figure, cut_body, figure, learn_body
from hmc.camera.stirring import stirring
from hmc.voxels.agreement import hull_view
from hmc.voxels.carving import CarvingTables, carve_levels
from hmc.voxels.grid import voxels_of
from hmc.voxels.known_bodies import LITRES, LOWEST_M, REACH_M, TOP_M, is_known, judges, known_hulls, places_at_times, within
from hmc.voxels.stirring_places import stirring_places

__all__ = ["StillPerson", "cut_still_people", "find_still_people"]

#: Share of what is cut out in each view, or in the hull there, that both have.
AGREE = 0.45
#: Times that the person is cut out, each time around the middle of what was cut out before.
ROUNDS = 3


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
    judging = judges(samples)
    if not judging:
        return (), ()
    stirred = [stirring(of_camera(samples, c), of_camera(people, c)) for c in range(len(tables.rig))]
    places = stirring_places(tables, [amount for amount, _ in stirred], [told for _, told in stirred])
    known = known_hulls(tables, people)
    hulls = [tables.grid.centres(voxels_of(hull)) for hull in known]
    images = [[image for image in samples[k] if image is not None] for k in judging]
    found: list[StillPerson] = []
    doubted: list[Standing] = []
    for place in [*places, *places_at_times(tables.grid, known)]:
        if not _apart(place, found) or is_known(hulls, place, tables.grid.voxel_size_m):
            continue
        stirs = place in places
        person = _examine(tables, images, hulls, place, place.stature_m / 2 if stirs else LOWEST_M)
        if person is None:
            if stirs:  # else nothing speaks for it but that somebody was there
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


def _examine(tables: CarvingTables, samples, hulls: Sequence[np.ndarray], place: Standing, lowest_m: float) -> StillPerson | None:
    """The person at a place, or None if the views do not show one body there that begins at such a height or below.

    `hulls` are points of those who are known, (n, 3) each.
    """
    for left in reversed(range(ROUNDS)):
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
        if left:
            # Swinging arms draw the place aside: what is cut out beside the true one misses the feet.
            place = replace(place, x=float(x), y=float(y))
        elif not (litres <= LITRES[1] and lowest <= lowest_m and top >= TOP_M and np.sort(agree)[1] >= AGREE):
            return None
    return StillPerson(place, figures, colors)


def _measure(tables: CarvingTables, place: Standing, cuts, others, figures: Sequence[Figure]) -> list[float]:
    """Litres of the hull of what was cut out, its lowest and highest point, its middle in x and y, and how well each view agrees.

    The lowest point is that of the hull in which one of four cameras or more may be wrong: shoes of the floor's color get lost in a view.
    """
    grid = tables.grid
    filled = [cut | (mask & one.reach) for cut, mask, one in zip(cuts, others, figures, strict=True)]
    hulls = carve_levels(tables, filled, (0, 1 if len(cuts) >= 4 else 0))
    points, most = (some[within(some, place, REACH_M)] for some in (grid.centres(voxels_of(hull)) for hull in hulls))
    if len(points) == 0:
        return [0.0, np.inf, 0.0, place.x, place.y, *([0.0] * len(cuts))]
    agree = []
    for camera, cut, mask in zip(tables.rig, cuts, others, strict=True):
        seen = hull_view(camera, points, 0.65 * grid.voxel_size_m)
        either = (seen | cut) & ~mask
        agree.append(float((seen & cut & ~mask).sum() / either.sum()) if either.any() else 1.0)
    top = float(np.quantile(points[:, 2], 0.995)) + grid.voxel_size_m / 2
    return [1000 * len(points) * grid.voxel_size_m**3, float(most[:, 2].min()), top, *points[:, :2].mean(axis=0).tolist(), *agree]


def _others(tables: CarvingTables, hull: np.ndarray, place: Standing) -> list[np.ndarray]:
    """Where in each view people are who stand elsewhere."""
    points = hull[~within(hull, place, 0.8 * REACH_M)]
    return [hull_view(camera, points, 0.65 * tables.grid.voxel_size_m) for camera in tables.rig]


def _apart(place: Standing, found: Sequence[StillPerson]) -> bool:
    return all(np.hypot(place.x - one.place.x, place.y - one.place.y) > APART_M for one in found)
