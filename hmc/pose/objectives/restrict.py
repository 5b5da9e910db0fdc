"""The likelihood on some parts of the body only: the same functions, given a body that has no others.

A model that lacks a limb neither fills voxels with it nor is asked to explain what the limb explains.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from hmc.body.flesh import SurfaceSamples
from hmc.body.limbs import CHAIN_OF_PART
from hmc.body.model import PART_OF_SEGMENT, PARTS, BodyModel, Cones
from hmc.body.nearest_cone import part_distances
from hmc.pose.objectives.four_scores import (
    ScoreMaps,
    ScoreTable,
    ScoreVariances,
    log_likelihood_by_part,
    log_likelihood_factorised,
    log_likelihood_global,
    scores,
)
from hmc.pose.objectives.symmetric import BodyPoints, symmetric_cost, symmetric_cost_by_part, thinned
from hmc.pose.steps.annealed import PoseFilter
from hmc.pose.views.hull_target import HullTarget
from hmc.search.filters import LogLikelihood

__all__ = [
    "ScoreData",
    "SymmetricData",
    "coarser_table",
    "nearest_part",
    "part_body",
    "part_mask",
    "restrict_filter",
    "restrict_table",
    "restrict_target",
]

#: Sums over the parts of each limb, shape (n_parts, n_limbs).
_LIMBS = np.eye(CHAIN_OF_PART.max() + 1)[CHAIN_OF_PART]


def part_mask(parts: Collection[str]) -> np.ndarray:
    """Which of `hmc.body.model.PARTS` these are: bool, shape (n_parts,)."""
    return np.isin(PARTS, list(parts))


def part_body(body: BodyModel, keep: np.ndarray) -> BodyModel:
    """The same skeleton with the flesh of some parts only.

    Parameters
    ----------
    body : BodyModel
    keep : ndarray of bool, shape (n_parts,)
    """
    cones, rows = body.cones, keep[body.cones.part]
    return replace(
        body, cones=Cones(cones.segment[rows], cones.part[rows], cones.start[rows], cones.end[rows], cones.radii[rows], cones.across[rows])
    )


def restrict_filter(filt: PoseFilter, keep: np.ndarray) -> PoseFilter:
    """A person's filter for a body of some parts only.

    Parameters
    ----------
    filt : PoseFilter
    keep : ndarray of bool, shape (n_parts,)
    """
    if keep.all():
        return filt
    surface, axes, cones = filt.samples.surface, filt.samples.axes, filt.body.cones
    rows = keep[surface.part]
    surface = SurfaceSamples(surface.points[rows], surface.normals[rows], surface.segment[rows], surface.part[rows])
    # Points on the axes stay, so that overlap weighs as much as ever; those of missing parts meet nothing.
    there = keep[PART_OF_SEGMENT[axes.segment]]
    axes = replace(axes, against=axes.against[:, keep[cones.part]] & there[:, None])
    table = None if filt.table is None else restrict_table(filt.table, keep)
    return replace(filt, body=part_body(filt.body, keep), samples=BodyPoints(surface, axes), table=table)


def restrict_table(table: ScoreTable, keep: np.ndarray) -> ScoreTable:
    """The flesh of some parts only; scores of the others are then meaningless, and their double occupancy is 0.

    Parameters
    ----------
    table : ScoreTable
    keep : ndarray of bool, shape (n_parts,)
    """
    if keep.all():
        return table
    overlap = table.overlap
    there = keep[overlap.pieces.part]
    joined = there[overlap.joints.hanging] & there[overlap.joints.holding]
    overlap = replace(overlap, pairs=overlap.pairs[there[overlap.pairs].all(axis=1)], joint_shares=overlap.joint_shares * joined)
    return replace(table, blocks=tuple(block for block in table.blocks if keep[block[0]]), overlap=overlap)


def coarser_table(table: ScoreTable, every: int) -> ScoreTable:
    """Every so many-th point of each run of the flesh; what is estimated of overlaps stays.

    Parameters
    ----------
    table : ScoreTable
    every : int
        1 or more.
    """
    if every == 1:
        return table
    blocks, rows, counts, n = [], [np.zeros(0, int)], np.zeros_like(table.counts), 0
    for part, segment, is_surface, start, stop in table.blocks:
        rows.append(np.arange(start, stop, every))
        blocks.append((part, segment, is_surface, n, n + len(rows[-1])))
        counts[part, : 4 if is_surface else 3] += len(rows[-1])
        n += len(rows[-1])
    # Parts without flesh have scores that nobody reads.
    return replace(table, points=table.points[np.concatenate(rows)], blocks=tuple(blocks), counts=np.maximum(counts, 1))


def nearest_part(body: BodyModel, state: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The part of a posed body nearest to each hull point or ray.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (27,)
    points : ndarray, shape (k, 3) or (k, 6)
        As from `hmc.pose.views.rays.points_to_explain`.

    Returns
    -------
    ndarray of int, shape (k,)
        Places in `hmc.body.model.PARTS`.
    """
    return np.argmin(part_distances(body, state, points), axis=0)


def restrict_target(target: HullTarget, keep: np.ndarray) -> HullTarget:
    """A frame's hulls for a body of some parts: without shanks nothing stands on the floor.

    Parameters
    ----------
    target : HullTarget
    keep : ndarray of bool, shape (n_parts,)
    """
    return target if keep[part_mask(["r_shank", "l_shank"])].all() else replace(target, floor_z=None)


@dataclass(frozen=True)
class SymmetricData:
    """A frame as the symmetric cost reads it.

    Parameters
    ----------
    target : HullTarget
    points : ndarray, shape (k, 3) or (k, 6)
        What has to be explained.
    part : ndarray of int, shape (k,)
        Which part is expected to explain each: the nearest one in the pose that is expected.
    """

    target: HullTarget
    points: np.ndarray
    part: np.ndarray

    def likelihood(self, filt: PoseFilter, keep: np.ndarray, every: int = 1, by_limb: bool = False) -> LogLikelihood:
        """Of the kept parts, at every so many-th point of the body's surface; `filt` is the whole body's. Whole, or a column a limb."""
        one, target, settings = restrict_filter(filt, keep), restrict_target(self.target, keep), filt.preset.symmetric
        samples = one.samples if every == 1 else thinned(one.samples, max(1, len(one.samples.surface.points) // every))
        rows = np.flatnonzero(keep[self.part])
        rows = rows if len(rows) else np.arange(1)
        points, part = self.points[rows], self.part[rows]
        if by_limb:
            return lambda states: -symmetric_cost_by_part(one.body, samples, states, target, points, part, settings) @ _LIMBS
        return lambda states: -symmetric_cost(one.body, samples, states, target, points, settings)


@dataclass(frozen=True)
class ScoreData:
    """A frame as the four scores read it."""

    maps: ScoreMaps

    def likelihood(self, filt: PoseFilter, keep: np.ndarray, every: int = 1, by_limb: bool = False) -> LogLikelihood:
        """Of the kept parts, at every so many-th point of the flesh; `filt` is the whole body's, with a table of its flesh.

        Whole; or a column a limb, if the likelihood is a product over the parts.
        """
        if filt.table is None:
            raise ValueError("`filt` has no table of its flesh")
        table = coarser_table(restrict_table(filt.table, keep), every)
        variances, counts = ScoreVariances(), table.counts[keep]
        if filt.preset.likelihood == "global":
            return lambda states: log_likelihood_global(scores(table, states, self.maps)[:, keep], counts, variances.whole_body())
        if by_limb:
            kept = variances.by_part()[keep]
            return lambda states: log_likelihood_by_part(scores(table, states, self.maps)[:, keep], kept) @ _LIMBS[keep]
        return lambda states: log_likelihood_factorised(scores(table, states, self.maps)[:, keep], variances.by_part()[keep])
