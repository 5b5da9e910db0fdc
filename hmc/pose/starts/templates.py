"""The first pose of a person, from one frame's hulls and no knowledge but a rough heading, if that.

Canton (2009, section 6.3.3) sets the root by the tracker, the heading by the walk, and every other angle to neutral. That
loses people who do not stand with their arms down, or stand still. Here every heading is tried with a few typical poses,
the best of each heading is refined, and the caller follows the best ones for some frames before choosing
(`hmc.pose.starts.window`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hmc.body.joints import N_CANTON, N_DOF, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.model import BodyModel, neutral_state
from hmc.pose.method import Subject
from hmc.pose.objectives.symmetric import Symmetric, SymmetricSettings
from hmc.pose.starts.stature import TOP_QUANTILE
from hmc.pose.steps.refine import RefineSettings, refine
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.rays import points_to_cover

__all__ = ["FLOOR_TEMPLATES", "TEMPLATES", "first_poses", "lying_height", "template_states"]


def _bent(hips: float, knees: float) -> dict[str, float]:
    return {"r_hip_y": hips, "l_hip_y": hips, "r_knee_y": knees, "l_knee_y": knees}


#: Typical poses, degrees on top of hanging arms: (angles, height of the pelvis over the stature, lean included).
TEMPLATES: dict[str, tuple[dict[str, float], float]] = {
    "standing": ({}, 0.54),
    "arms sideways": ({"r_shoulder_x": 0, "l_shoulder_x": 0, "r_elbow_z": 0, "l_elbow_z": 0}, 0.54),
    "arms half raised": ({"r_shoulder_x": 45, "l_shoulder_x": -45}, 0.54),
    "arms up": ({"r_shoulder_x": -70, "l_shoulder_x": 70}, 0.54),
    "forearms forward": ({"r_elbow_z": 90, "l_elbow_z": -90}, 0.54),
    "guard": ({"r_shoulder_z": 30, "l_shoulder_z": -30, "r_elbow_z": 120, "l_elbow_z": -120}, 0.53),
    "arms forward": ({"r_shoulder_x": 70, "l_shoulder_x": -70, "r_shoulder_z": 80, "l_shoulder_z": -80}, 0.54),
    "left step": ({"l_hip_y": -25, "r_hip_y": 20, "r_knee_y": 20, "r_shoulder_z": 25, "l_shoulder_z": 20}, 0.53),
    "right step": ({"r_hip_y": -25, "l_hip_y": 20, "l_knee_y": 20, "l_shoulder_z": -25, "r_shoulder_z": -20}, 0.53),
    "legs apart": ({"r_hip_x": -20, "l_hip_x": 20}, 0.52),
    "on left leg": ({"r_hip_y": -40, "r_knee_y": 70}, 0.54),
    "on right leg": ({"l_hip_y": -40, "l_knee_y": 70}, 0.54),
    "half squat": ({"r_hip_y": -50, "l_hip_y": -50, "r_knee_y": 70, "l_knee_y": 70, "torso_y": 25}, 0.45),
    "sitting": ({"r_hip_y": -90, "l_hip_y": -90, "r_knee_y": 90, "l_knee_y": 90, "r_elbow_z": 60, "l_elbow_z": -60}, 0.31),
    "bent down": ({"torso_y": 70, "r_hip_y": -15, "l_hip_y": -15, "r_shoulder_z": 70, "l_shoulder_z": -70}, 0.50),
    "kneeling": ({"r_hip_y": -20, "l_hip_y": -20, "r_knee_y": 100, "l_knee_y": 100}, 0.31),
}


#: More of them, of who is on the floor or lies on something.
FLOOR_TEMPLATES: dict[str, tuple[dict[str, float], float]] = {
    "on the back": ({"root_ry": -90}, 0.06),
    "on the back, knees up": ({"root_ry": -90, **_bent(hips=-55, knees=100)}, 0.07),
    "on the back, arms up": ({"root_ry": -90, "r_shoulder_x": -70, "l_shoulder_x": 70}, 0.06),
    "on the front": ({"root_ry": 90}, 0.07),
    "on the front, hands beside the chest": ({"root_ry": 85, "r_elbow_z": 120, "l_elbow_z": -120}, 0.08),
    "on the hands": ({"root_ry": 70, "r_shoulder_z": 75, "l_shoulder_z": -75}, 0.24),
    "on hands and knees": ({"root_ry": 75, **_bent(hips=-75, knees=85), "r_shoulder_z": 80, "l_shoulder_z": -80}, 0.27),
    "on the right side": ({"root_rx": 90, **_bent(hips=-30, knees=40)}, 0.09),
    "on the left side": ({"root_rx": -90, **_bent(hips=-30, knees=40)}, 0.09),
    "on the seat, legs straight": (_bent(hips=-85, knees=5), 0.07),
    "on the seat, knees up": ({"root_ry": -15, **_bent(hips=-105, knees=90)}, 0.07),
    "squatting": ({"root_ry": 20, "torso_y": 30, **_bent(hips=-125, knees=135)}, 0.18),
}
#: A hull that ends lower than this, and begins lower than the second, is of who is on the floor; one that begins higher, is no higher than
#: the third and longer than the last, of who lies on something; metres.
FLOOR_M, RAISED_M, FLAT_M, LONG_M = 1.0, 0.25, 0.85, 1.3

#: Headings tried, evenly spread, and random variants of each template at each heading.
HEADINGS, VARIANTS = 12, 4


def template_states(body: BodyModel, xy: np.ndarray, floor_z: float, headings: np.ndarray, lying_z: float | None = None) -> np.ndarray:
    """Every template pose at every heading.

    Parameters
    ----------
    body : BodyModel
    xy : ndarray, shape (2,)
        Where the pelvis stands, world, metres.
    floor_z : float
        Height of the floor, metres.
    headings : ndarray, shape (n,)
        Radians about Z; 0 faces X.
    lying_z : float, optional
        Height of what somebody may lie on, world, metres: those of `FLOOR_TEMPLATES` on it, too.

    Returns
    -------
    ndarray, shape (n, n_templates, 37)
    """
    states = []
    poses = [(*pose, floor_z) for pose in TEMPLATES.values()]
    if lying_z is not None:
        poses += [(*pose, lying_z) for pose in FLOOR_TEMPLATES.values()]
    for angles, pelvis, below in poses:
        state = neutral_state("down", body.limits)
        for name, degrees in angles.items():
            state[dof_index(name)] = np.radians(degrees)
        state[:3] = (*xy, below + pelvis * body.height_m)
        states.append(np.clip(state, body.limits.low, body.limits.high))
    out = np.repeat(np.array(states)[None], len(headings), axis=0)
    out[:, :, 3] += np.asarray(headings)[:, None]
    return out


def lying_height(target: HullTarget, floor_z: float) -> float | None:
    """Height of what the person may lie or sit on: the floor, or what carries a long flat hull.

    Cameras that look down do not see below a table: the hull reaches below its top, and the body is in its upper half.

    Parameters
    ----------
    target : HullTarget
    floor_z : float
        Height of the floor, metres.

    Returns
    -------
    float or None
        World, metres; None of who stands.
    """
    points = target.surface
    low, high = np.quantile(points, [1 - TOP_QUANTILE, TOP_QUANTILE], axis=0)
    if high[2] - floor_z <= FLOOR_M and low[2] - floor_z <= RAISED_M:
        return floor_z
    flat = high[2] - low[2] <= FLAT_M and np.max(high[:2] - low[:2]) >= LONG_M
    return float(np.median(points[:, 2])) if flat else None


def first_poses(
    rng: np.random.Generator,
    subject: Subject,
    target: HullTarget,
    cost_settings: SymmetricSettings,
    floor_z: float = 0.0,
    keep: int = 6,
) -> tuple[np.ndarray, np.ndarray]:
    """Candidate poses of a person in one frame, best first.

    Parameters
    ----------
    rng : numpy.random.Generator
    subject : Subject
    target : HullTarget
    cost_settings : SymmetricSettings
    floor_z : float
        Height of the floor, metres.
    keep : int
        Candidates returned, from different headings.

    Returns
    -------
    states : ndarray, shape (keep, 37)
    costs : ndarray, shape (keep,)
        Square metres.
    """
    body, n_headings, variants = subject.body, HEADINGS, VARIANTS
    middle = target.surface.mean(0)
    headings = np.linspace(-np.pi, np.pi, n_headings, endpoint=False)
    states = template_states(body, middle[:2], floor_z, headings, lying_height(target, floor_z))
    n_templates = states.shape[1]
    states = np.repeat(states[:, :, None], variants, axis=2)
    spread = np.r_[0.06, 0.06, 0.05, 0.12, 0.08, 0.08, np.full(N_CANTON - 6, 0.2), np.zeros(N_DOF - N_CANTON)]
    noise = rng.standard_normal(states.shape) * spread
    noise[:, :, 0] = 0.0  # the template itself takes part
    states = np.clip(states + noise, body.limits.low, body.limits.high).reshape(n_headings, n_templates * variants, -1)
    coarse = points_to_cover(rng, target, 150, cost_settings.ray_share)
    rough = Symmetric(body, subject.points, target, coarse, cost_settings)
    costs = rough.cost(states.reshape(-1, states.shape[-1])).reshape(n_headings, -1)
    objective = replace(rough, asked=points_to_cover(rng, target, 400, cost_settings.ray_share))
    candidates = []
    settings = RefineSettings(iterations=10)
    for states_there, costs_there in zip(states, costs, strict=True):
        for pick in np.argsort(costs_there)[:2]:
            state, info = refine(objective, states_there[pick], settings)
            candidates.append((info.cost_after, state))
    candidates.sort(key=lambda pair: pair[0])
    chosen: list[tuple[float, np.ndarray]] = []
    for cost, state in candidates:
        if all(np.abs(landmarks(body, state) - landmarks(body, other)).max() > 0.05 for _, other in chosen):
            chosen.append((cost, state))
        if len(chosen) == keep:
            break
    return np.array([state for _, state in chosen]), np.array([cost for cost, _ in chosen])
