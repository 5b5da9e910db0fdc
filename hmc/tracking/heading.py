"""Which way a person faces, as far as a track and its voxels tell: a start for the pose estimator.

Angles are radians about Z: 0 faces along X, pi/2 along Y. The shoulders' axis tells the direction but for its sign, because front and
back of a hull look alike. The sign is told by the walk of a person who walks, and else by the arms, which reach forwards.
"""

from __future__ import annotations

import numpy as np

__all__ = ["arm_reach", "facing_hypotheses", "shoulder_axis", "walking_direction"]

#: Speeds, metres a second, between which the walking direction becomes trustworthy.
SLOW, BRISK = 0.2, 0.8
#: Shares of the stature between which the shoulders lie (.82; Drillis and Contini's .818).
SHOULDER_BAND = (0.72, 0.86)
#: Voxels further from the band's middle than this, metres, are arms that are stretched out.
SHOULDER_RADIUS_M = 0.32
#: Voxels beside the trunk: further than this from its middle, metres, and between these shares of the stature.
ARM_RADIUS_M = 0.22
ARM_BAND = (0.4, 0.9)
#: Mean horizontal offset of those voxels, metres, that is a sure sign.
SURE_REACH_M = 0.15


def walking_direction(velocities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Direction in which people move.

    Parameters
    ----------
    velocities : ndarray, shape (..., 3)
        Smoothed, metres a second (`hmc.tracking.tracks.velocities`).

    Returns
    -------
    angle : ndarray, shape (...)
        Radians.
    confidence : ndarray, shape (...)
        From 0, standing, to 1, walking briskly.
    """
    velocities = np.asarray(velocities, float)
    speed = np.hypot(velocities[..., 0], velocities[..., 1])
    return np.arctan2(velocities[..., 1], velocities[..., 0]), np.clip((speed - SLOW) / (BRISK - SLOW), 0.0, 1.0)


def shoulder_axis(points: np.ndarray) -> tuple[float, float]:
    """Principal horizontal axis of the voxels at shoulder level: the body's left-right axis, of unknown sign.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres of one person's voxels, world, metres; the floor at z = 0. Best of a strict hull.

    Returns
    -------
    angle : float
        Of the axis, in [0, pi).
    confidence : float
        1 less the ratio of the minor to the major variance; 0 for a round body or too few voxels. Of meaning for people who stand.
    """
    points = np.asarray(points, float)
    if len(points) == 0:
        return 0.0, 0.0
    share = points[:, 2] / points[:, 2].max()
    band = points[(share >= SHOULDER_BAND[0]) & (share <= SHOULDER_BAND[1]), :2]
    if len(band) < 8:
        return 0.0, 0.0
    band = band[np.hypot(*(band - np.median(band, axis=0)).T) <= SHOULDER_RADIUS_M]
    variances, axes = np.linalg.eigh(np.cov(band.T))
    angle = float(np.arctan2(axes[1, 1], axes[0, 1]) % np.pi)
    return angle, float(1 - variances[0] / variances[1]) if variances[1] > 0 else 0.0


def arm_reach(points: np.ndarray) -> np.ndarray:
    """Mean horizontal offset, from the trunk's middle, of the voxels beside the trunk: arms reach forwards.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres of one person's voxels, world, metres.

    Returns
    -------
    ndarray, shape (2,)
        Metres; zero where there is nothing beside the trunk.
    """
    points = np.asarray(points, float)
    if len(points) == 0:
        return np.zeros(2)
    share = points[:, 2] / points[:, 2].max()
    trunk = points[(share > 0.5) & (share < 0.8), :2]
    if len(trunk) == 0:
        return np.zeros(2)
    offset = points[:, :2] - np.median(trunk, axis=0)
    beside = (share > ARM_BAND[0]) & (share < ARM_BAND[1]) & (np.hypot(*offset.T) > ARM_RADIUS_M)
    return offset[beside].mean(axis=0) if beside.any() else np.zeros(2)


def facing_hypotheses(points: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Directions that a person may face, with weights.

    Parameters
    ----------
    points : ndarray, shape (n, 3)
        Centres of the person's voxels, world, metres.
    velocity : ndarray, shape (3,)
        Smoothed, metres a second.

    Returns
    -------
    angles : ndarray, shape (3,)
        The two normals of the shoulders' axis, and the walking direction; radians in (-pi, pi].
    weights : ndarray, shape (3,)
        They sum to 1. The normal that agrees with the walk, or with the arms of a person who stands, weighs more; the walking direction
        itself counts where the shoulders tell little.
    """
    axis, axis_sure = shoulder_axis(points)
    walk, walk_sure = (float(value) for value in walking_direction(velocity))
    normals = np.array([axis - np.pi / 2, axis + np.pi / 2])
    reach = np.column_stack([np.cos(normals), np.sin(normals)]) @ arm_reach(points)
    arms = np.clip(reach / SURE_REACH_M, -1.0, 1.0)
    agree = walk_sure * np.cos(normals - walk) + (1 - walk_sure) * arms  # from -1 to 1
    weights = np.array([*(max(axis_sure, 1e-3) * (1 + agree) / 2), walk_sure * (1 - axis_sure)])
    angles = np.append(normals, walk)
    return np.pi - (np.pi - angles) % (2 * np.pi), weights / weights.sum()
