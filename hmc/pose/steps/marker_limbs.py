"""A pose against all points that the detections make: its own markers first, then limbs that went astray or were exchanged.

A marker that lost its detections takes others nearby, among which there are often enough false ones or another marker's, and looks
found. What gives it away is the point left over where it should be, if many views agree on that one. Exchanged legs leave no
point over, as points have no names, nor do exchanged arms; but they have to cross, and reach their points less well: hardly so in one
frame, plainly in a second (`hmc.pose.methods.marker_apf`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from hmc.body.exchange import swapped_pose
from hmc.body.inverse import fit_landmarks
from hmc.body.kinematics import landmarks
from hmc.body.limbs import LIMBS as LIMB_TABLE
from hmc.body.model import BodyModel
from hmc.body.prior import POSTURE, posture_spread
from hmc.pose.method import Alternatives
from hmc.pose.objectives.marker_points import find_points, matched_points
from hmc.pose.steps.marker_search import LEAST_POINTS, lay_body, left_over, point_cost, search_near
from hmc.pose.views.markers import SeenMarkers

__all__ = ["fit_all_points", "refine_to_points", "strain"]

#: From fewer markers than this no pose is refined.
LEAST_REFINED = 5
#: A marker that lies farther than this from where the refined body has it is not refined to, metres.
FARTHEST_M = 0.08
#: Two markers nearer to each other than this are one, metres.
SAME_M = 0.03
#: Middle and end of every limb, by their places among the landmarks.
LIMBS = np.concatenate([LIMB_TABLE[f"{side}_{kind}"].landmarks for side in "lr" for kind in ("arm", "leg")])
#: How far a marker may be from where it is found again, round by round, metres.
SEARCH_GATES_M = (0.6, 0.4, 0.2)
#: A trusted point farther than this from all markers is left over, metres.
LEFT_OVER_M = 0.12
#: Steps of inverse kinematics in the refinement.
REFINE_STEPS = 12
#: What of left and right may be exchanged (`hmc.body.exchange.swapped_pose`).
_EXCHANGES: tuple[Literal["legs", "arms"], ...] = ("legs", "arms")
#: A pose with exchanged legs or arms that strains more than the present one times this is not refined.
EXCHANGE_RATIO = 1.3
#: What an angle one spread (`hmc.body.prior.posture_spread`) away from rest costs, square metres.
POSTURE_WEIGHT = 1e-5


def fit_all_points(
    rng: np.random.Generator, body: BodyModel, seen: SeenMarkers, state: np.ndarray, points: np.ndarray, gate_px: float
) -> tuple[np.ndarray, np.ndarray, Alternatives]:
    """The pose that fits all points best, of one, what is found near it, and that with legs or arms exchanged.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : BodyModel
        With its markers as tips.
    seen : SeenMarkers
    state : ndarray, shape (37,)
        As refined.
    points : ndarray, shape (15, 3)
        What its markers were refined to, world, metres; NaN where nothing was found.
    gate_px : float

    Returns
    -------
    state : ndarray, shape (37,)
    points : ndarray, shape (15, 3)
        As from `refine_to_points`.
    choice : Alternatives
        The pose before such exchanges and after each of them, and how badly they fit the points, square metres.
    """
    found, views = find_points(seen)
    if len(found) < LEAST_POINTS:
        return state, points, Alternatives(np.stack([state, state]), np.zeros(2))
    cost = strain(body, found, views)
    if np.isnan(points[LIMBS]).any() or left_over(body, state, found, views, LEFT_OVER_M):
        near, better = search_near(rng, body, found, views, state)
        others = [lay_body(body, found, state, SEARCH_GATES_M, views)[0], *([near] if better else [])]
        trials = [(state, points), *(refine_to_points(body, seen, other, gate_px) for other in others)]
        state, points = trials[int(cost(np.array([one for one, _ in trials])).argmin())]
    # The last is the same pose, to be refined once more: around a better pose other points are nearest.
    states = np.array([state, *(swapped_pose(body, state, what) for what in _EXCHANGES), state])
    costs, all_points = cost(states), [points] + [np.full_like(points, np.nan)] * (len(states) - 1)
    for k in np.flatnonzero(costs[1:] < EXCHANGE_RATIO * costs[0]) + 1:
        states[k], all_points[k] = refine_to_points(body, seen, states[k], gate_px)
        costs[k] = cost(states[k][None])[0]
    best = int(costs.argmin())
    return states[best], all_points[best], Alternatives(states, costs)


def strain(body: BodyModel, points: np.ndarray, views: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """How badly states, shape (n, 37), fit points, shape (n,), square metres: `point_cost`, and how far they are from rest.

    Parameters
    ----------
    body : BodyModel
    points : ndarray, shape (m, 3)
    views : ndarray of int, shape (m,)
        Both as from `hmc.pose.objectives.marker_points.find_points`.
    """
    cost = point_cost(body, points, views)
    return lambda states: cost(states) + POSTURE_WEIGHT * (((states - POSTURE[0]) / posture_spread(states)) ** 2).sum(axis=1)


def refine_to_points(body: BodyModel, seen: SeenMarkers, state: np.ndarray, gate_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Inverse kinematics on the markers that enough views agree on, twice, as a better pose finds more of them.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    seen : SeenMarkers
    state : ndarray, shape (37,)
        Start.
    gate_px : float
        Farther than this from where it should be a detection is not a marker's; half of it the second time.

    Returns
    -------
    state : ndarray, shape (37,)
    points : ndarray, shape (15, 3)
        Where the markers were seen, world, metres; NaN where not.
    """
    points = np.full((len(body.tips), 3), np.nan)
    for gate in (gate_px, gate_px / 2):
        places = landmarks(body, state)
        points = matched_points(seen, places, gate)
        points[_taken(points, places)] = np.nan
        if np.isfinite(points).all(axis=1).sum() < LEAST_REFINED:
            break
        fitted, _ = fit_landmarks(body, points, state, iterations=REFINE_STEPS)
        # What still lies far off is another marker or a false one.
        points[np.linalg.norm(landmarks(body, fitted) - points, axis=1) > FARTHEST_M] = np.nan
        state, _ = fit_landmarks(body, points, state, iterations=REFINE_STEPS)
    return state, points


def _taken(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Markers that were found where another one was that is nearer to it, (15,): one marker cannot be two."""
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    off = np.linalg.norm(points - places, axis=1)
    return ((apart < SAME_M) & (off[:, None] > off)).any(axis=1)
