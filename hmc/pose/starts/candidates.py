"""Candidate poses of one frame, and what speaks for them beside the hulls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hmc.body.limbs import LIMBS
from hmc.pose.method import Subject
from hmc.pose.objectives.objective import Objective, cost_at
from hmc.pose.starts.spectral import spectral_poses
from hmc.pose.starts.templates import first_poses
from hmc.pose.steps.limb_search import search_limbs
from hmc.pose.steps.polish import PolishSettings, fine_objective
from hmc.pose.steps.presets import PosePreset
from hmc.pose.steps.refine import refine
from hmc.pose.views.keypoint_pose import keypoint_pose
from hmc.pose.views.person_view import PersonView

__all__ = ["StartSettings", "candidates", "search_all", "walk_factor"]


@dataclass(frozen=True)
class StartSettings:
    """How the first pose is found.

    Parameters
    ----------
    anchors : int
        Frames of the window from which candidates are taken.
    candidates : int
        Candidates followed.
    trials_s, follow_s : tuple of float, float
        How long each is followed, to both sides, seconds: all for a first trial, longer those that are left after it, and to the end those
        that are left after the last. Left are those whose cost is not ...
    behind : float
        ... more than so many times the least, ...
    same_m : float
        ... and of those that have come to the same pose at both ends (no landmark farther apart than this, metres) the cheapest.
    walk_speed_m_s : float
        Above this speed of the track, a body is taken to face where it goes.
    walk_penalty : float
        Share by which facing straight backwards raises the cost.
    searched : float
        Logarithm of the ratio of costs that a search of the limbs gains on the mean, whoever it is: it is no evidence that a body turned
        about is the right one.
    body_frames : int
        Frames to which the body's dimensions are fitted.
    """

    anchors: int = 3
    candidates: int = 5
    trials_s: tuple[float, ...] = (0.07, 0.13)
    follow_s: float = 0.4
    behind: float = 1.25
    same_m: float = 0.04
    walk_speed_m_s: float = 0.5
    walk_penalty: float = 2.0
    searched: float = 0.1
    body_frames: int = 12


def candidates(rng: np.random.Generator, subject: Subject, view: PersonView, preset: PosePreset) -> tuple[np.ndarray, np.ndarray]:
    """Candidate poses of one frame, best first, and their costs: from typical poses, or from the skeleton in the voxels too.

    Where a detector's keypoints are seen, what they show is one of them, and they have a say in the order.

    Parameters
    ----------
    rng : numpy.random.Generator
    subject : Subject
    view : PersonView
        With hulls.
    preset : PosePreset
    """
    find = spectral_poses if preset.start == "spectral" else first_poses
    if view.target is None:
        raise ValueError("the frame has no hulls of this person")
    states, costs = find(rng, subject, view.target, preset.symmetric, subject.capture.floor_z)
    if view.keypoints is None:
        return states, costs
    objective = fine_objective(rng, subject, view, preset.polish)
    trials = [*states, *keypoint_pose(subject.body, view.keypoints, states[0])]
    refined = [refine(objective, trial, preset.polish.refine) for trial in trials]
    refined.sort(key=lambda pair: pair[1].cost_after)
    return np.array([state for state, _ in refined]), np.array([info.cost_after for _, info in refined])


def search_all(rng: np.random.Generator, objective: Objective, state: np.ndarray, settings: PolishSettings) -> tuple[np.ndarray, float]:
    """A pose with each limb where it fits the hulls best, and its cost; as it is where nothing is to be searched.

    Parameters
    ----------
    rng : numpy.random.Generator
    objective : Objective
    state : ndarray, shape (37,)
    settings : PolishSettings
    """
    cost = cost_at(objective, state)
    if settings.search is None:
        return state, cost
    return search_limbs(rng, objective, (state, cost), list(LIMBS), settings.refine, settings.search)[:2]


def walk_factor(headings: np.ndarray, velocities: np.ndarray, settings: StartSettings) -> np.ndarray:
    """By how much walking backwards raises a cost.

    Parameters
    ----------
    headings : ndarray, shape (n,)
        Radians about Z.
    velocities : ndarray, shape (n, 3) or (3,)
        Of the track, metres a second.
    settings : StartSettings

    Returns
    -------
    ndarray, shape (n,)
        1 for forwards or hardly moving, 1 + walk_penalty for straight back.
    """
    speed = np.hypot(velocities[..., 0], velocities[..., 1])
    forwards = (np.cos(headings) * velocities[..., 0] + np.sin(headings) * velocities[..., 1]) / np.maximum(speed, 1e-9)
    return np.where(speed > settings.walk_speed_m_s, 1 + settings.walk_penalty * (1 - forwards) / 2, 1.0)
