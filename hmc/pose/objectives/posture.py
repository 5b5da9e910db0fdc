"""What is likely of a pose whatever is seen: angles near rest, and parts that do not reach into one another.

It is the part of the symmetric cost (`hmc.pose.objectives.symmetric`) that asks no hulls, for likelihoods without any.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hmc.body.cone_maps import cone_maps
from hmc.body.joints import N_DOF
from hmc.body.kinematics import dof_masks, joint_twists, point_motions, segment_transforms
from hmc.body.model import PART_OF_DOF, PART_OF_SEGMENT, PARTS, BodyModel
from hmc.body.penetration import AxisPoints, penetration_depth, penetration_rows
from hmc.body.prior import POSTURE, posture_spread
from hmc.pose.objectives.symmetric import BodyPoints, SymmetricSettings

__all__ = ["PostureCost", "PostureSettings"]

_MASKS = dof_masks().astype(float)


@dataclass(frozen=True)
class PostureSettings:
    """Weights of the posture's cost; those of the symmetric one by default.

    Parameters
    ----------
    posture_weight : float
        Square metres that an angle one spread (`hmc.body.prior.posture_spread`) away from rest costs.
    overlap_weight : float
        Weight of parts that reach into one another.
    """

    posture_weight: float = SymmetricSettings.posture_weight
    overlap_weight: float = SymmetricSettings.overlap_weight


@dataclass(frozen=True)
class _PostureAt:
    """Depths and angles of one state, weighted, and what moves the parts that reach into others."""

    residuals: np.ndarray
    jacobian: np.ndarray
    rows: np.ndarray
    near: None = None
    misfit: None = None

    def pulls(self) -> tuple[np.ndarray, np.ndarray]:
        """The residuals of parts inside of others and of all angles, and how they change with the state, shape (m, 37)."""
        return self.rows, self.jacobian


@dataclass(frozen=True)
class PostureCost:
    """The posture's cost of poses: an objective (`hmc.pose.objectives.objective.Objective`).

    Parameters
    ----------
    body : BodyModel
    axes : AxisPoints
        Of the body.
    settings : PostureSettings
    """

    body: BodyModel
    axes: AxisPoints
    settings: PostureSettings = field(default_factory=PostureSettings)

    def cost(self, states: np.ndarray) -> np.ndarray:
        """Squared angles and mean squared depth, square metres: states (n, 37) to (n,)."""
        depth, posture = self._terms(states)
        return self.settings.overlap_weight * (depth**2).mean(axis=1) + posture.sum(axis=1)

    def by_part(self, states: np.ndarray) -> np.ndarray:
        """`cost`, each part's share of it, shape (n, n_parts)."""
        depth, posture = self._terms(states)
        columns = np.eye(len(PARTS))
        of_depth = depth**2 @ columns[PART_OF_SEGMENT[self.axes.segment]]
        return posture @ columns[PART_OF_DOF] + self.settings.overlap_weight / depth.shape[1] * of_depth

    def linearise(self, state: np.ndarray, near: Any = None) -> _PostureAt:
        """Residuals at one state (37,): of each point of the limbs' axes, then of each angle."""
        axes, centres, rotations, positions = joint_twists(self.body, state)
        maps = cone_maps(self.body.cones, np.concatenate([rotations, positions[..., None]], axis=-1)[..., None])
        depth, outward, points, segment, other = penetration_rows(self.body, self.axes, rotations, positions, maps)
        weight, angle = np.sqrt(self.settings.overlap_weight / len(depth)), np.sqrt(self.settings.posture_weight)
        spread = posture_spread(state)
        deep = np.flatnonzero(depth)
        # What carries both parts leaves them where they are to one another.
        moves = point_motions(axes, centres, points[deep], _MASKS[segment[deep]] - _MASKS[other[deep]])
        pushed = -weight * np.einsum("nid,ni->nd", moves, outward[deep])
        return _PostureAt(
            np.concatenate([weight * depth, angle * (state - POSTURE[0]) / spread]),
            np.concatenate([pushed, np.diag(angle / spread)]),
            np.concatenate([deep, len(depth) + np.arange(N_DOF)]),
        )

    def coarser(self, rng: np.random.Generator, n: int) -> PostureCost:
        """Itself: it has no points of the data."""
        return self

    def of_body(self, body: BodyModel, points: BodyPoints) -> PostureCost:
        """The same of another body and the points of its axes."""
        return replace(self, body=body, axes=points.axes)

    def _terms(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Depths, metres, shape (n, n_points), and what each angle costs, square metres, shape (n, 37)."""
        rotations, positions = segment_transforms(self.body, states)
        depth = penetration_depth(self.body, self.axes, rotations, positions)
        return depth, self.settings.posture_weight * ((states - POSTURE[0]) / posture_spread(states)) ** 2
