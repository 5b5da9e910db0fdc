"""A person's own body from some of their frames: which frames teach it, and whether the others bear it out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from hmc.body.dimensions import FitBodySettings, prior_deviations, whole_deviations
from hmc.body.flesh import surface_coordinates
from hmc.body.model import BodyModel
from hmc.pose.method import Subject
from hmc.pose.objectives.objective import Objective
from hmc.pose.starts.fit_body import WORTH_IT, fit_body
from hmc.pose.steps.refine import RefineSettings, refine
from hmc.processes import share_out

__all__ = ["LEAST_BODY_FRAMES", "choose_frames", "own_body"]

#: Fewer frames say too little of a body: what they cannot tell apart, such as fat silhouettes from a tall person, would be fitted.
LEAST_BODY_FRAMES = 6
#: Frames that a body is tried on and not fitted to, at most.
MOST_HELD_OUT = 8


def choose_frames(costs: np.ndarray, n: int) -> tuple[list[int], list[int]]:
    """Frames to which a body is fitted, and others on which it is tried: well spread in time, without the worst third.

    Parameters
    ----------
    costs : ndarray, shape (n_frames,)
        Of the poses, in order of time; NaN where there is none. A frame in which the pose is in doubt teaches nothing of the body.
    n : int
        Frames to fit to, at most.

    Returns
    -------
    picks, held_out : list of int
        Places in `costs`; both empty where there are fewer than `LEAST_BODY_FRAMES`.
    """
    good = np.flatnonzero(np.isfinite(costs)).tolist()
    if len(good) < LEAST_BODY_FRAMES:
        return [], []
    limit = np.quantile(costs[good], 0.67)
    good = [k for k in good if costs[k] <= limit]
    held_out, rest = good[1::3], [k for k in good if k not in set(good[1::3])]
    picks = sorted({rest[round(q * (len(rest) - 1))] for q in np.linspace(0, 1, n)})
    return picks, held_out[:: max(1, len(held_out) // MOST_HELD_OUT)]


def own_body(
    subject: Subject,
    poses: Mapping[int, tuple[Objective, np.ndarray]],
    chosen: tuple[list[int], list[int]],
    settings: FitBodySettings,
    refinement: RefineSettings,
    surface_samples: int,
    equip: Callable[[BodyModel], Subject],
) -> tuple[Subject, tuple[float, ...]]:
    """The subject with a body fitted to some frames, if others agree, and how well the frames tell it.

    Parameters
    ----------
    subject : Subject
        From whose body the fit starts, and to which a prior holds it.
    poses : mapping of int to (Objective, ndarray of shape (37,))
        Of the frames: the objective, with the subject's body, and the pose.
    chosen : (list of int, list of int)
        As from `choose_frames`.
    settings : FitBodySettings
    refinement : RefineSettings
        With which both bodies are tried on the frames that were held out.
    surface_samples : int
        Points of the body's surface.
    equip : callable
        A body to its subject.

    Returns
    -------
    subject : Subject
    deviations : tuple of 20 floats
        Of each of `hmc.body.dimensions.FITTED` (`hmc.body.dimensions.whole_deviations`); those of the prior where frames are too few.
    """
    picks, held_out = chosen
    if not picks or not held_out:
        return subject, tuple(whole_deviations(np.diag(prior_deviations(settings) ** 2)).tolist())
    objectives, states = zip(*(poses[k] for k in picks), strict=True)
    coordinates, workers = surface_coordinates(subject.body, surface_samples), subject.capture.workers
    body, _, info = fit_body(objectives, np.array(states), coordinates, settings, workers)
    fitted = equip(body)
    tried = [poses[k] for k in held_out]

    def costs(one: Subject) -> list[float]:
        return [refine(objective.of_body(one.body, one.points), state, refinement)[1].cost_after for objective, state in tried]

    before, after = share_out([partial(costs, subject), partial(costs, fitted)], workers)
    # Of frames that it was not fitted to.
    return fitted if np.mean(after) < WORTH_IT * np.mean(before) else subject, info.deviations
