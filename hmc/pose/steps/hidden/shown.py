"""What the data shows of a limb: of its flesh in a pose, how much is in the hulls, how much at their surface, how much in other parts."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hmc.body.flesh import place_points
from hmc.body.kinematics import segment_transforms
from hmc.body.nearest_cone import part_distances
from hmc.pose.objectives.four_scores import ScoreMaps, ScoreTable
from hmc.pose.steps.hidden.limbs import LimbSettings
from hmc.pose.steps.restrict import part_mask, score_maps
from hmc.pose.views.hull_target import HullTarget, distance_at

__all__ = ["FleshInHulls", "LimbSigns", "PlacedFlesh", "covered", "flesh_in_hulls", "in_doubt", "limb_signs", "place_flesh"]

#: Flesh nearer than this to another part says nothing of its own part, metres.
FREE_M = 0.05
#: Where less than this share of a limb is free, nothing is said of it.
LEAST_FREE = 0.2
#: Flesh nearer than this to another part's is in it, or as good as, metres.
INSIDE_M = 0.02
#: A limb of which more than this share is inside of others lies folded against them.
FOLDED = 0.3
#: Share of an upper arm or thigh that is in the trunk anyway, more than of a forearm or shank in others: where they are joined.
JOINED = 0.4


@dataclass(frozen=True)
class FleshInHulls:
    """A body's flesh and the hulls of one frame in which it is looked up.

    Parameters
    ----------
    table : ScoreTable
        Of the whole body.
    target : HullTarget
        The hulls, strict and tolerant.
    maps : ScoreMaps
        Of the target.
    """

    table: ScoreTable
    target: HullTarget
    maps: ScoreMaps


def flesh_in_hulls(
    table: ScoreTable, target: HullTarget, room: np.ndarray | None = None, hull: Literal["strict", "tolerant"] = "tolerant"
) -> FleshInHulls:
    """Make a frame's hulls ready for the look-ups; `room`, shape (2, 3), and `hull` as of `hmc.pose.steps.restrict.score_maps`."""
    return FleshInHulls(table, target, score_maps(target, room, hull))


@dataclass(frozen=True)
class PlacedFlesh:
    """A body's flesh, or some parts', where a pose has it.

    Parameters
    ----------
    part : ndarray of int, shape (n,)
    is_surface : ndarray of bool, shape (n,)
    distance : ndarray, shape (n_parts, n)
        To each part of the body, metres.
    occupied, strict : ndarray of bool, shape (n,)
        In the tolerant hull, and in the strict one.
    closeness : ndarray, shape (n,)
        To the tolerant hull's surface (1 - Eq. 6.16), 0 to 1.
    """

    part: np.ndarray
    is_surface: np.ndarray
    distance: np.ndarray
    occupied: np.ndarray
    strict: np.ndarray
    closeness: np.ndarray


@dataclass(frozen=True)
class LimbSigns:
    """What speaks for a limb and against it, of what is free of other parts: shares from 0 to 1, NaN where nothing can be said.

    Parameters
    ----------
    occupancy : float
        Share in occupied voxels (Eq. 6.15). Hulls are fatter than their people: beside the trunk or behind a thigh there is room in them
        for a limb that is not there.
    closeness : float
        Of the skin to the tolerant hull's surface, in the mean: a limb that is seen has it where the hull ends.
    strict : float
        Share in the strict hull, which all cameras allow. NaN only where nothing at all is free.
    inside : float
        Share of all of the limb that lies in other parts.
    """

    occupancy: float
    closeness: float
    strict: float
    inside: float


def place_flesh(looked: FleshInHulls, state: np.ndarray, parts: Collection[str]) -> PlacedFlesh:
    """The flesh of some parts in a pose, and what the hulls say at each of its points.

    Parameters
    ----------
    looked : FleshInHulls
    state : ndarray, shape (37,)
    parts : collection of str
    """
    table, maps = looked.table, looked.maps
    flesh, rows = table.flesh, part_mask(parts)[table.flesh.part]
    points = place_points(*segment_transforms(table.body, state), flesh.points[rows], flesh.segment[rows])
    index = np.floor((points - maps.origin) / maps.voxel_size_m).astype(int)
    inside = np.all((index >= 0) & (index < maps.occupancy.shape), axis=1)
    closeness, occupied = (maps.both[tuple((index * inside[:, None]).T)] * inside[:, None]).T
    return PlacedFlesh(
        flesh.part[rows],
        flesh.is_surface[rows],
        part_distances(table.body, state, points),
        occupied > 0,
        distance_at(looked.target, points) == 0,
        closeness / 255,
    )


def limb_signs(flesh: PlacedFlesh, parts: Collection[str], others: np.ndarray) -> LimbSigns:
    """What is said of one limb.

    Parameters
    ----------
    flesh : PlacedFlesh
        With that of the limb.
    parts : collection of str
        The limb's.
    others : ndarray of bool, shape (n_parts,)
        Which parts there are beside it.
    """
    own = part_mask(parts)
    rows = own[flesh.part]
    distance = flesh.distance[others & ~own][:, rows].min(axis=0)
    free = distance > FREE_M
    skin = free & flesh.is_surface[rows]
    enough = free.mean() >= LEAST_FREE
    return LimbSigns(
        _mean(flesh.occupied[rows][free]) if enough else np.nan,
        _mean(flesh.closeness[rows][skin]) if enough else np.nan,
        _mean(flesh.strict[rows][free]),
        _mean(distance < INSIDE_M),
    )


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else np.nan


def covered(flesh: PlacedFlesh, limb: int, active: np.ndarray, settings: LimbSettings) -> bool:
    """Whether a limb lies in other parts, so that the data says nothing of it; never where `LimbSettings.lost_inside` does not matter.

    Parameters
    ----------
    flesh, limb, active, settings
        As of `in_doubt`.
    """
    signs = limb_signs(flesh, settings.tree.limbs[limb].parts, part_mask(settings.tree.model(active).parts))
    return settings.lost_inside < 1 and bool(np.isnan(signs.occupancy))


def in_doubt(flesh: PlacedFlesh, limb: int, active: np.ndarray, settings: LimbSettings) -> bool:
    """Whether the data speaks against a limb as it is posed.

    Its flesh is not in occupied voxels. Or it has found room where everything is occupied though it is elsewhere and hidden: it lies in
    other parts, or, folded against them or hanging on a limb that is, its skin is not where the hull ends; and what is left of it is not in
    the strict hull, which holds a limb before the trunk that all cameras see.

    Parameters
    ----------
    flesh : PlacedFlesh
        With that of the limb and of what it hangs on.
    limb : int
        Place in the tree's `limbs`.
    active : ndarray of bool, shape (n_limbs,)
    settings : LimbSettings
    """
    tree = settings.tree
    there = part_mask(tree.model(active).parts)
    signs = limb_signs(flesh, tree.limbs[limb].parts, there)
    if signs.occupancy < settings.lost_occupancy:
        return True
    if signs.strict >= settings.lost_strict:
        return False
    parent = tree.parent[limb]
    if signs.inside > settings.lost_inside + (JOINED if parent < 0 else 0.0):
        return True
    if parent < 0 or not signs.closeness < settings.lost_closeness:
        return False
    return signs.inside > FOLDED or bool(np.isnan(limb_signs(flesh, tree.limbs[parent].parts, there).occupancy))
