"""The likelihood on some parts of the body only: the same functions, given a body that has no others.

A model that lacks a limb neither fills voxels with it nor is asked to cover what the limb covers.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hmc.body.keypoint_places import KEYPOINT_PART
from hmc.body.limbs import CHAIN_OF_PART
from hmc.body.model import PART_OF_SEGMENT, PARTS, BodyModel, Cones
from hmc.body.nearest_cone import part_distances
from hmc.pose.method import Subject
from hmc.pose.objectives.four_scores import (
    ScoreMaps,
    ScoreTable,
    ScoreVariances,
    log_likelihood_by_part,
    log_likelihood_factorised,
    log_likelihood_global,
    observe,
    scores,
)
from hmc.pose.objectives.keypoints import KeypointCost, KeypointSettings
from hmc.pose.objectives.objective import Objective, Sum
from hmc.pose.objectives.symmetric import BodyPoints, Symmetric, SymmetricSettings, thinned
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.keypoints import SeenKeypoints
from hmc.search.filters import LogLikelihood
from hmc.voxels.grid import VoxelGrid

__all__ = [
    "ScoreData",
    "SymmetricData",
    "coarser_table",
    "nearest_part",
    "part_body",
    "part_mask",
    "restrict_table",
    "restrict_target",
    "restricted",
    "score_maps",
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


def restricted(subject: Subject, keep: np.ndarray, free: np.ndarray | None = None) -> Subject:
    """A person with the flesh of some parts only.

    Parameters
    ----------
    subject : Subject
    keep : ndarray of bool, shape (n_parts,)
    free : ndarray of bool, shape (37,), optional
        Angles that may move; as before by default.
    """
    free = subject.free if free is None else free
    if keep.all():
        return replace(subject, free=free)
    surface, axes, cones = subject.points.surface, subject.points.axes, subject.body.cones
    rows = keep[surface.part]
    surface = surface.where(rows)
    # Points on the axes stay, so that overlap weighs as much as ever; those of missing parts meet nothing.
    there = keep[PART_OF_SEGMENT[axes.segment]]
    axes = replace(axes, against=axes.against[:, keep[cones.part]] & there[:, None])
    table = None if subject.flesh is None else restrict_table(subject.flesh, keep)
    body, parts = part_body(subject.body, keep), subject.parts & keep
    return replace(subject, body=body, points=BodyPoints(surface, axes), flesh=table, parts=parts, free=free)


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
    # Parts without flesh have scores that are not read.
    return replace(table, points=table.points[np.concatenate(rows)], blocks=tuple(blocks), counts=np.maximum(counts, 1))


def nearest_part(body: BodyModel, state: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The part of a posed body nearest to each hull point or ray.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)
    points : ndarray, shape (k, 3) or (k, 6)
        As from `hmc.pose.views.rays.points_to_cover`.

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
        What has to be covered.
    settings : SymmetricSettings
    part : ndarray of int, shape (k,), optional
        Which part is expected to cover each: the nearest one in the pose that is expected. Needed for some parts only.
    keypoints : SeenKeypoints, optional
        What a detector saw besides, and what it weighs.
    """

    target: HullTarget
    points: np.ndarray
    settings: SymmetricSettings
    part: np.ndarray | None = None
    keypoints: tuple[SeenKeypoints, KeypointSettings] | None = None

    def likelihood(self, subject: Subject, keep: np.ndarray, every: int = 1, by_limb: bool = False) -> LogLikelihood:
        """The log-likelihood of the kept parts, at every so many-th point of the body's surface; whole, or a column a limb."""
        one, target = restricted(subject, keep), restrict_target(self.target, keep)
        samples = one.points if every == 1 else thinned(one.points, max(1, len(one.points.surface.points) // every))
        if self.part is None:
            objective = self._with_keypoints(Symmetric(one.body, samples, target, self.points, self.settings), subject)
            return lambda states: -objective.cost(states)
        rows = np.flatnonzero(keep[self.part])
        rows = rows if len(rows) else np.arange(1)
        objective = self._with_keypoints(
            Symmetric(one.body, samples, target, self.points[rows], self.settings, self.part[rows]), subject, keep
        )
        if by_limb:
            return lambda states: -objective.by_part(states) @ _LIMBS  # type: ignore[operator]
        return lambda states: -objective.cost(states)

    def _with_keypoints(self, objective: Symmetric, subject: Subject, keep: np.ndarray | None = None) -> Objective:
        """The hulls' objective, and the keypoints of the kept parts."""
        if self.keypoints is None:
            return objective
        seen, settings = self.keypoints
        kept = seen if keep is None else seen.of(keep[KEYPOINT_PART[seen.keypoint]])
        return Sum([objective, KeypointCost(objective.body, kept, subject.capture.beside, settings)]) if len(kept.keypoint) else objective


@dataclass(frozen=True)
class ScoreData:
    """A frame as the four scores read it.

    Parameters
    ----------
    maps : ScoreMaps
    whole : bool
        The product of the scores of the whole body in place of that of its parts.
    """

    maps: ScoreMaps
    whole: bool = False

    def likelihood(self, subject: Subject, keep: np.ndarray, every: int = 1, by_limb: bool = False) -> LogLikelihood:
        """The log-likelihood of the kept parts, at every so many-th point of the flesh; whole, or a column a limb if it is a product."""
        if subject.flesh is None:
            raise ValueError("the subject has no table of its flesh")
        keep = keep & subject.parts
        table = coarser_table(restrict_table(subject.flesh, keep), every)
        variances, counts = ScoreVariances(), table.counts[keep]
        if self.whole:
            return lambda states: log_likelihood_global(scores(table, states, self.maps)[:, keep], counts, variances.whole_body())
        if by_limb:
            kept = variances.by_part()[keep]
            return lambda states: log_likelihood_by_part(scores(table, states, self.maps)[:, keep], kept) @ _LIMBS[keep]
        return lambda states: log_likelihood_factorised(scores(table, states, self.maps)[:, keep], variances.by_part()[keep])


def score_maps(target: HullTarget, room: np.ndarray | None, hull: Literal["strict", "tolerant"] = "tolerant") -> ScoreMaps:
    """A hull as the four scores read it.

    Parameters
    ----------
    target : HullTarget
    room : ndarray, shape (2, 3), or None
        Where a body may be, metres; for the score Out.
    hull : {"strict", "tolerant"}
    """
    grid = VoxelGrid(target.origin - 0.5 * target.voxel_size_m, target.voxel_size_m, target.distance.shape)
    return observe(target.strict if hull == "strict" else target.tolerant, grid, room)
