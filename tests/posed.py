"""Bodies, poses, subjects and views that several pose tests share."""

from dataclasses import replace
from functools import cache

import numpy as np
from acted import Act

from hmc.body.flesh import surface_coordinates
from hmc.body.inverse import fit_landmarks
from hmc.body.joints import N_DOF, dof_index
from hmc.body.model import BodyModel, neutral_state
from hmc.body.proportions import canton_body, default_body
from hmc.pose.method import Capture, Subject
from hmc.pose.objectives.symmetric import BodyPoints, SymmetricSettings, body_points
from hmc.pose.steps.annealed import annealed_subject
from hmc.pose.steps.presets import PosePreset
from hmc.pose.views.hull_target import HullTarget
from hmc.pose.views.person_view import PersonView

#: Weights of the tests' own, so that tuning the presets does not move what is claimed here.
COST = SymmetricSettings(cap_m=0.2, uncovered_weight=1.0, overlap_weight=2.0, posture_weight=3e-6)


@cache
def body_of(height_m: float = 1.78) -> tuple[BodyModel, BodyPoints]:
    """A body of average proportions and its points."""
    body = default_body(height_m)
    return body, body_points(body, surface_coordinates(body, 250))


def capture_of(acted: Act) -> Capture:
    """The recording of an act."""
    return Capture(acted.fps, acted.grid.voxel_size_m, acted.grid.bounds)


def plain_subject(height_m: float = 1.78) -> Subject:
    """A subject with the body and the points of `body_of`."""
    body, points = body_of(height_m)
    return Subject(body, Capture(), points)


def subject_of(acted: Act, preset: PosePreset) -> Subject:
    """What an annealed method makes of an actor's body of average proportions."""
    body = canton_body(acted.height_m) if preset.body == "canton" else default_body(acted.height_m)
    return annealed_subject(body, capture_of(acted), preset)


def view_of(target: HullTarget | None, velocity: np.ndarray | None = None, frame: int = 0) -> PersonView:
    """A frame that shows hulls and nothing else."""
    return PersonView(frame, target, velocity=np.zeros(3) if velocity is None else velocity)


def views_of_act(acted: Act, velocities: np.ndarray | None = None) -> list[PersonView]:
    """What an act shows, frame by frame; the track's velocities are those of the pelvis unless others are given."""
    velocities = acted.velocities if velocities is None else velocities
    return [view_of(target, velocity, k) for k, (target, velocity) in enumerate(zip(acted.targets, velocities, strict=True))]


def with_cylinders(body: BodyModel, radius_m: float = 0.05) -> BodyModel:
    """The same skeleton with circular cylinders for flesh, for which distances and their derivatives are known in closed form."""
    cones = body.cones
    axis = (cones.end - cones.start) / np.linalg.norm(cones.end - cones.start, axis=1, keepdims=True)
    across = cones.across - axis * (axis * cones.across).sum(1, keepdims=True)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return replace(body, cones=replace(cones, radii=np.full_like(cones.radii, radius_m), across=across))


def true_state(body: BodyModel, act: Act, frame: int = 0) -> np.ndarray:
    """The state whose landmarks lie nearest to an actor's true ones."""
    start = neutral_state("down", body.limits)
    start[:3], start[3] = act.landmarks[frame, 0], act.heading
    return fit_landmarks(body, act.landmarks[frame], start, iterations=80)[0]


def crossed_arms() -> np.ndarray:
    """Standing with both forearms before the chest, one through the other."""
    state = np.zeros(N_DOF)
    state[2] = 0.95
    state[dof_index("r_shoulder_x", "l_shoulder_x")] = 0.5, -0.5
    state[dof_index("r_shoulder_z", "l_shoulder_z")] = 1.5, -1.55
    state[dof_index("r_elbow_z", "l_elbow_z")] = 1.9, -1.9
    return state


def mean_error(body_landmarks: np.ndarray, truth: np.ndarray) -> float:
    """Mean distance of landmarks, metres."""
    return float(np.linalg.norm(body_landmarks - truth, axis=-1).mean())
