"""Matched features as residuals of the pose, and the robust objective over them. Kehl (2006), Eq. 8 to 10, 13 and 15.

A residual is a vector of up to three numbers in units of the limb's diameter, moved by one segment. How it moves with the segment is a
product of three wrenches (moment and direction, 6 numbers) with the segment's twist; how the segment's twist follows from the state are the
twists of the joints. So a Jacobian is one matrix product and a mask.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmc.body.kinematics import dof_masks, joint_twists
from hmc.body.solids import FREE, SolidBody

__all__ = [
    "Matches", "PosedBody", "evaluate", "gauss_newton_product", "jacobian", "joined", "leclerc", "leclerc_slope", "point_wrenches",
    "pose_body",
]  # fmt: skip

_MASKS = dof_masks()[:, FREE].astype(float)


@dataclass(frozen=True)
class PosedBody:
    """A body in one pose.

    Parameters
    ----------
    rotations, positions : ndarray, shapes (16, 3, 3) and (16, 3)
        Of the segments, world.
    twists : ndarray, shape (24, 6)
        Angular velocity and velocity at the world's origin that each of the 24 degrees of freedom gives what it moves.
    """

    rotations: np.ndarray
    positions: np.ndarray
    twists: np.ndarray


@dataclass(frozen=True)
class Matches:
    """Predicted features and what they were matched with.

    Parameters
    ----------
    residuals : ndarray, shape (n, 3)
        Predicted less observed, over the diameter; unused entries are 0, and all of a feature without a match.
    wrenches : ndarray, shape (n, 3, 6)
        How each entry moves with the twist of the segment.
    segment, group : ndarray of int, shape (n,)
    weight : ndarray, shape (n,)
        Of the feature in the objective; 0 without a match.
    missing : ndarray, shape (6,)
        What the features without a match add to each group's objective: their weights times the potential's limit, 1.
    """

    residuals: np.ndarray
    wrenches: np.ndarray
    segment: np.ndarray
    group: np.ndarray
    weight: np.ndarray
    missing: np.ndarray


def joined(matches: Sequence[Matches]) -> Matches:
    """All matches as one."""
    return Matches(
        np.concatenate([one.residuals for one in matches]),
        np.concatenate([one.wrenches for one in matches]),
        np.concatenate([one.segment for one in matches]),
        np.concatenate([one.group for one in matches]),
        np.concatenate([one.weight for one in matches]),
        np.sum([one.missing for one in matches], axis=0),
    )


def pose_body(body: SolidBody, state: np.ndarray) -> PosedBody:
    """Segments and twists of a state (37,)."""
    axes, centres, rotations, positions = joint_twists(body.skeleton, state)
    twists = np.concatenate([axes, np.cross(centres, axes)], axis=1)
    twists[:3] = np.eye(6)[3:]
    return PosedBody(rotations, positions, twists[FREE])


def point_wrenches(points: np.ndarray) -> np.ndarray:
    """How points move with the twist of what carries them, (n, 3) to (n, 3, 6): ``[-[x]_cross, I]``."""
    out = np.zeros((*points.shape, 6))
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    out[..., 0, 1], out[..., 0, 2] = z, -y
    out[..., 1, 0], out[..., 1, 2] = -z, x
    out[..., 2, 0], out[..., 2, 1] = y, -x
    out[..., (0, 1, 2), (3, 4, 5)] = 1.0
    return out


def leclerc(error: np.ndarray, width: float) -> np.ndarray:
    """The error potential of section 6.1: ``1 - exp(-e / width)``."""
    return 1 - np.exp(-error / width)


def leclerc_slope(error: np.ndarray, width: float) -> np.ndarray:
    """Its derivative."""
    return np.exp(-error / width) / width


def jacobian(posed: PosedBody, matches: Matches) -> np.ndarray:
    """How the residuals change with the 24 degrees of freedom, shape (n, 3, 24), matches held."""
    n = len(matches.residuals)
    out = (matches.wrenches.reshape(-1, 6) @ posed.twists.T).reshape(n, 3, -1)
    out *= _MASKS[matches.segment][:, None, :]
    return out


def evaluate(matches: Matches, rows: np.ndarray, width: float) -> tuple[float, np.ndarray, np.ndarray]:
    """The objective, its gradient and the weights of the Gauss-Newton product.

    Parameters
    ----------
    matches : Matches
    rows : ndarray, shape (n, 3, 24)
        From `jacobian`.
    width : float
        Of the potential.

    Returns
    -------
    value : float
        Eq. 8.
    gradient : ndarray, shape (24,)
    slopes : ndarray, shape (n,)
        Weight times slope of the potential, a feature.
    """
    error = 0.5 * np.einsum("ni,ni->n", matches.residuals, matches.residuals)
    slopes = matches.weight * leclerc_slope(error, width)
    gradient = (slopes[:, None] * matches.residuals).reshape(-1) @ rows.reshape(-1, rows.shape[-1])
    value = float(matches.weight @ leclerc(error, width) + matches.missing.sum())
    return value, gradient, slopes


def gauss_newton_product(rows: np.ndarray, slopes: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """``J^T W J v`` without the matrix: what stands for the Hessian's product in Eq. 19.

    Parameters
    ----------
    rows : ndarray, shape (n, 3, 24)
    slopes : ndarray, shape (n,)
    vector : ndarray, shape (24,)

    Returns
    -------
    ndarray, shape (24,)
    """
    flat = rows.reshape(-1, rows.shape[-1])
    return (np.repeat(slopes, 3) * (flat @ vector)) @ flat
