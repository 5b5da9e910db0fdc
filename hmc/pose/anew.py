"""Poses that a first pass lost for long, looked for anew from single frames.

Who was lost among others may be fitted wrongly ever after: the filter knows no other pose, and by the time that nobody is near, its own
high cost is what is usual for it (`hmc.pose.recovery`). When the recording is over, a person's costs tell where that was: far above those
of the same person's better frames, or of the best fitted person's. There a pose is found as a first one is, from the hulls of one frame,
or with other trunks and arms on the legs that are there (`upper_bodies`), and the second pass (`hmc.pose.backward`) follows it back if
it fits far better.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from hmc.body.joints import N_DOF
from hmc.body.limbs import LIMBS
from hmc.body.model import BodyModel
from hmc.pose.method import Subject
from hmc.pose.objectives.objective import Objective
from hmc.pose.starts.templates import first_poses, template_states
from hmc.pose.steps.polish import PolishSettings
from hmc.pose.steps.refine import refine_all
from hmc.pose.views.hull_target import HullTarget

__all__ = ["AnewSettings", "doubtful_frames", "pose_anew", "upper_bodies"]

#: Angles above the hips.
UPPER = np.setdiff1d(np.arange(6, N_DOF), [k for limb in LIMBS.values() if not limb.is_arm for k in (*limb.dofs, *limb.end_dofs)])


@dataclass(frozen=True)
class AnewSettings:
    """When a pose is looked for anew.

    Parameters
    ----------
    ratio : float
        Where the cost is above so many times the lower quartile of the person's costs ...
    others : float
        ... or so many times the least of all people's lower quartiles.
    median_s : float
        Costs are medians over so long, seconds: a frame that went wrong is no loss.
    every_s : float
        In such a stretch, so often, from its last frame back, seconds.
    gain : float
        It counts where its cost is below this share of the first pass's pose, refined.
    """

    ratio: float = 1.5
    others: float = 2.5
    median_s: float = 0.25
    every_s: float = 0.25
    gain: float = 0.75


def doubtful_frames(costs: Mapping[int, np.ndarray], fps: float, settings: AnewSettings) -> dict[int, np.ndarray]:
    """The frames of each person in which a pose is looked for.

    Parameters
    ----------
    costs : mapping of int to ndarray, shape (n,)
        Of each person's frames, in order of time, square metres; NaN where there is none.
    fps : float
    settings : AnewSettings

    Returns
    -------
    dict of int to ndarray of int
        Places among the person's frames, rising.
    """
    quartiles = {person: float(np.nanquantile(of, 0.25)) for person, of in costs.items() if np.isfinite(of).any()}
    found = {person: np.zeros(0, int) for person in costs}
    width, stride = max(1, round(settings.median_s * fps)), max(1, round(settings.every_s * fps))
    for person, own in quartiles.items():
        limit = min(settings.ratio * own, settings.others * min(quartiles.values()))
        of = np.where(np.isfinite(costs[person]), costs[person], own)
        lost = np.flatnonzero(median_filter(of, width, mode="nearest") > limit)
        stretches = np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1)
        found[person] = np.sort(np.concatenate([stretch[::-stride] for stretch in stretches]))
    return found


def pose_anew(
    rng: np.random.Generator,
    subject: Subject,
    target: HullTarget,
    objective: Objective,
    present: tuple[np.ndarray, float],
    polish: PolishSettings,
    settings: AnewSettings,
) -> list[np.ndarray]:
    """The best pose that a start from one frame's hulls, or from the present legs, finds, if it costs far less than the present one.

    Parameters
    ----------
    rng : numpy.random.Generator
    subject : Subject
    target : HullTarget
    objective : Objective
        Of the frame.
    present : tuple of (ndarray, float)
        The present pose, shape (37,), and its cost, square metres.
    polish : PolishSettings
    settings : AnewSettings

    Returns
    -------
    list of ndarray, shape (37,)
        One, or none.
    """
    pose, cost = present
    states, _ = first_poses(rng, subject, target, polish.symmetric, subject.capture.floor_z)
    trials = refine_all(objective, [*states, *upper_bodies(subject.body, pose)], polish.refine)
    best, info = min(trials, key=lambda trial: trial[1].cost_after)
    return [best] if info.cost_after < settings.gain * cost else []


def upper_bodies(body: BodyModel, state: np.ndarray) -> np.ndarray:
    """A pose with the trunk, head and arms of each typical pose in place of its own.

    An arm that stands for a head, which is bent into the chest, explains the hulls nearly as well as the head does, and no search for
    one limb alone undoes both.

    Parameters
    ----------
    body : BodyModel
    state : ndarray, shape (37,)

    Returns
    -------
    ndarray, shape (n, 37)
    """
    typical = template_states(body, state[:2], 0.0, state[3:4])[0]
    others = np.unique(typical[:, UPPER], axis=0)
    states = np.repeat(state[None], len(others), axis=0)
    states[:, UPPER] = others
    return states
