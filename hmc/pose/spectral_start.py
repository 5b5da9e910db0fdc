"""First poses from the voxels themselves: spectral curves, a fitted skeleton, and from its landmarks the body of the particle filters.

In place of the typical poses and headings of `hmc.pose.initialisation`: it needs no heading and works in the middle of an action. Where
the curves say too little, those stand in; where parts are missing, they compete.
"""

from __future__ import annotations

import numpy as np

from hmc.pose.annealed.hull_target import HullTarget
from hmc.pose.annealed.rays import points_to_explain
from hmc.pose.annealed.refine import RefineSettings, refine
from hmc.pose.annealed.symmetric import BodyPoints, SymmetricSettings
from hmc.pose.body.inverse import fit_landmarks
from hmc.pose.body.joints import N_DOF
from hmc.pose.body.model import BodyModel, neutral_state
from hmc.pose.initialisation import first_poses, swapped_poses
from hmc.pose.spectral.reading import ReadingSettings, read_body
from hmc.pose.swarm.heading import heading_of
from hmc.pose.swarm.model import model_of_height, skeleton_landmarks
from hmc.pose.swarm.temporal import SwarmSettings, start_fits

__all__ = ["body_state", "spectral_poses", "strict_voxels"]


def strict_voxels(target: HullTarget) -> tuple[np.ndarray, np.ndarray]:
    """A target's strict hull: voxels of the crop, (n, 3), and their centres, metres."""
    inside = target.tolerant & (target.distance <= 0)
    voxels = np.argwhere(inside if inside.any() else target.tolerant)
    return voxels, target.origin + target.voxel_size_m * voxels


def body_state(body: BodyModel, points: np.ndarray) -> np.ndarray:
    """The state of a body whose landmarks are nearest to given ones, from upright and facing as hips and shoulders do.

    Parameters
    ----------
    body : BodyModel
    points : ndarray, shape (15, 3)
        In the order of `hmc.landmarks.LANDMARKS`, metres.

    Returns
    -------
    ndarray, shape (27,)
    """
    across = points[9] - points[12] + points[3] - points[6]
    start = neutral_state("down", body.limits)
    start[:3], start[3] = points[0], np.arctan2(-across[0], across[1])
    return fit_landmarks(body, points, start)[0]


def spectral_poses(
    rng: np.random.Generator,
    body: BodyModel,
    samples: BodyPoints,
    target: HullTarget,
    cost_settings: SymmetricSettings,
    floor_z: float = 0.0,
    keep: int = 6,
) -> tuple[np.ndarray, np.ndarray]:
    """Candidate poses of a person in one frame, best first; arguments and result as for `hmc.pose.initialisation.first_poses`."""
    voxels, points = strict_voxels(target)
    reading = read_body(voxels, points, target.voxel_size_m, body.height_m, ReadingSettings())
    if reading.status != "read":
        return first_poses(rng, body, samples, target, cost_settings, floor_z, keep=keep)
    model = model_of_height(body.height_m)
    heading = heading_of(reading.feet)
    trials = []
    for found in start_fits(rng, model, reading, heading, SwarmSettings()):
        trials.append(body_state(body, skeleton_landmarks(model, found.state)))
    trials += [turned for trial in trials[:1] for turned in swapped_poses(body, trial)]
    explained = points_to_explain(rng, target, 300, cost_settings.ray_share)
    refined = [refine(body, samples, trial, target, explained, cost_settings, RefineSettings()) for trial in trials]
    order = np.argsort([info.cost_after for _, info in refined])
    states = np.array([refined[k][0] for k in order]).reshape(-1, N_DOF)
    costs = np.array([refined[k][1].cost_after for k in order])
    upright = "head" in reading.curves and reading.curves["head"][:, 2].mean() > reading.curves["trunk"][:, 2].mean()
    if not (reading.segmentation.whole and upright):
        # Parts that are missing or look the wrong way up may be misread: typical poses compete.
        others, their_costs = first_poses(rng, body, samples, target, cost_settings, floor_z, keep=keep)
        states, costs = np.concatenate([states, others]), np.concatenate([costs, their_costs])
        order = np.argsort(costs)
        states, costs = states[order], costs[order]
    return states[:keep], costs[:keep]
