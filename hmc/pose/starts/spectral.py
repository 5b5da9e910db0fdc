"""First poses from the voxels themselves: spectral curves, a fitted skeleton, and from its landmarks the body of the particle filters.

Beside the typical poses and headings of `hmc.pose.starts.templates`, it works in the middle of an action. A frame can be misread without a
sign of it (an arm for the head, and the body stands on it), so both kinds compete by what they cost; where the curves say too little, the
typical poses stand alone.
"""

from __future__ import annotations

import numpy as np

from hmc.body.exchange import swapped_poses
from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel, neutral_state
from hmc.body.spin_skeleton import model_of_height, skeleton_landmarks
from hmc.pose.method import Subject
from hmc.pose.objectives.symmetric import Symmetric, SymmetricSettings
from hmc.pose.spectral.reading import ReadingSettings, read_body
from hmc.pose.starts.templates import first_poses
from hmc.pose.steps.refine import RefineSettings, refine
from hmc.pose.steps.swarm.heading import heading_of
from hmc.pose.steps.swarm.temporal import SwarmSettings, start_fits
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_cover
from hmc.voxels.grid import voxels_of

__all__ = ["body_state", "spectral_poses", "strict_voxels"]

#: Poses whose landmarks are all nearer than this are the same, metres.
SAME_M = 0.05


def strict_voxels(target: HullTarget) -> tuple[np.ndarray, np.ndarray]:
    """A target's strict hull: voxels of the crop, (n, 3), and their centres, metres."""
    inside = target.tolerant & (target.distance <= 0)
    voxels = voxels_of(inside if inside.any() else target.tolerant)
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
    ndarray, shape (37,)
    """
    across = points[9] - points[12] + points[3] - points[6]
    start = neutral_state("down", body.limits)
    start[:3], start[3] = points[0], np.arctan2(-across[0], across[1])
    return fit_landmarks(body, points, start)[0]


def spectral_poses(
    rng: np.random.Generator,
    subject: Subject,
    target: HullTarget,
    cost_settings: SymmetricSettings,
    floor_z: float = 0.0,
    keep: int = 6,
) -> tuple[np.ndarray, np.ndarray]:
    """Candidate poses of a person in one frame, best first.

    Skeletons fitted to the voxels' curves at several headings, the best of them with sides exchanged and turned about, and typical poses,
    all refined and ranked by the symmetric cost. Arguments and result as for `hmc.pose.starts.templates.first_poses`.
    """
    body = subject.body
    voxels, points = strict_voxels(target)
    reading = read_body(voxels, points, target.voxel_size_m, body.height_m, ReadingSettings())
    if reading.status != "read":
        return first_poses(rng, subject, target, cost_settings, floor_z, keep)
    model = model_of_height(body.height_m)
    heading = heading_of(reading.feet)
    trials = []
    for found in start_fits(rng, model, reading, heading, SwarmSettings()):
        trials.append(body_state(body, skeleton_landmarks(model, found.state)))
    objective = Symmetric(body, subject.points, target, points_to_cover(rng, target, 300, cost_settings.ray_share), cost_settings)
    refined = [_refined(objective, trial) for trial in trials]
    best = min(refined, key=lambda pair: pair[0])[1]
    refined += [_refined(objective, turned) for turned in swapped_poses(body, best)]
    typical = first_poses(rng, subject, target, cost_settings, floor_z, keep)[0]
    states = np.concatenate([[state for _, state in refined], typical])
    # All at the same points of the hull, so that costs can be compared.
    costs = objective.cost(states)
    order = np.argsort(costs)
    order = order[_distinct(landmarks(body, states[order]))][:keep]
    return states[order], costs[order]


def _refined(objective: Symmetric, state: np.ndarray) -> tuple[float, np.ndarray]:
    """The cost of a pose after steps downhill, and the pose."""
    state, info = refine(objective, state, RefineSettings())
    return info.cost_after, state


def _distinct(points: np.ndarray) -> np.ndarray:
    """Which poses (n, 15, 3) have a landmark farther than `SAME_M` from each one before them."""
    moved = np.linalg.norm(points[:, None] - points[None], axis=-1).max(-1)
    return ~np.tril(moved < SAME_M, -1).any(1)
