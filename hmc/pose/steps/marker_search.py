"""The first pose from markers alone: points of the world without names, and bodies that are laid into them.

Among many false detections more than half of the points are false, so a body of any posture finds points to take. Two signs tell
the right one: its markers lie where most views agree, and no such point is left over. From every heading an annealed search looks for
it; the best finds are then fitted with a point of its own for every marker.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import linear_sum_assignment

from hmc.body.inverse import fit_landmarks
from hmc.body.joints import DOF_NAMES, dof_index
from hmc.body.kinematics import landmarks
from hmc.body.marker_places import place_tips
from hmc.body.model import BodyModel, neutral_state
from hmc.landmarks import LANDMARKS
from hmc.search.filters import AnnealedSettings, annealed_step, particle_init

__all__ = ["LEAST_POINTS", "lay_body", "left_over", "point_cost", "search_near", "start_poses"]

#: From fewer points than this no pose is begun.
LEAST_POINTS = 6
#: Headings that are tried, evenly spaced.
HEADINGS = 12
#: The search from each: the first layer's deviations (metres, radians), and its layers.
SEARCH = AnnealedSettings(layers=14, particles=2000, survival_rate=0.05, spread=0.8)
SEARCH_SD = {
    "root_t": 0.15, "root_rz": 0.3, "root_r": 0.15,
    "torso": 0.2, "spine": 0.0, "girdle": 0.0, "neck": 0.2, "shoulder": 0.8, "elbow": 0.8, "hip": 0.4, "knee": 0.5, "ankle": 0.0,
}  # fmt: skip
#: The search near a pose, with so many times those deviations.
NEAR_SEARCH = AnnealedSettings(layers=8, particles=1000, survival_rate=0.05, spread=0.7)
NEAR_SHARE = 0.5
#: A marker without a point, and a point that must be a person's without a marker, count as being this far apart, metres.
SEARCH_GATE_M = 0.4
#: What a point on which the fewest views agree counts as farther away (in squares), metres; 0 for one on which the most do.
DOUBT_M = 0.1
#: After the search so many finds are fitted, and how far a marker may then be from the point that it takes, round by round, metres.
PURSUED = 8
GATES_M = (0.2, 0.15, 0.15)
#: Poses whose markers are nearer to each other than this on the mean are alike, metres.
ALIKE_M = 0.08


def start_poses(rng: np.random.Generator, body: BodyModel, points: np.ndarray, views: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Poses that fit points, the best first.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : BodyModel
        With its markers as tips.
    points : ndarray, shape (n, 3)
    views : ndarray of int, shape (n,)
        Both from `hmc.pose.objectives.marker_points.find_points`, of one person and of false detections.

    Returns
    -------
    list of (state, cost)
        States, shape (37,), no two alike, and a cost, square metres: the mean over markers of the squared distance to the nearest point,
        with what its views leave in doubt, and of the trusted points to the nearest marker. Empty where there are too few points.
    """
    if len(points) < LEAST_POINTS:
        return []
    trust = _trust(views)
    middle = np.average(points, axis=0, weights=trust + 0.01)
    cost = point_cost(body, points, views)
    finds = []
    for heading in np.arange(HEADINGS) * 2 * np.pi / HEADINGS:
        state = neutral_state("down", body.limits)
        state[:2], state[dof_index("root_rz")] = middle[:2], heading
        state[2] += middle[2] - np.median(landmarks(body, state)[:, 2])
        finds.append(_search(rng, body, cost, state, SEARCH))
    finds.sort(key=lambda find: find[1])
    laid = np.array([lay_body(body, points, state, GATES_M, views)[0] for state, _ in finds[:PURSUED]])
    found: list[tuple[np.ndarray, float]] = []
    for state, value in sorted(zip(laid, cost(laid).tolist(), strict=True), key=lambda one: one[1]):
        places = landmarks(body, state)
        if all(np.linalg.norm(landmarks(body, other) - places, axis=1).mean() > ALIKE_M for other, _ in found):
            found.append((state, value))
    return found


def search_near(
    rng: np.random.Generator, body: BodyModel, points: np.ndarray, views: np.ndarray, state: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Look near a pose for one that fits points better, and lay the body into them.

    Parameters
    ----------
    rng : numpy.random.Generator
    body : BodyModel
    points : ndarray, shape (n, 3)
    views : ndarray of int, shape (n,)
    state : ndarray, shape (37,)

    Returns
    -------
    state : ndarray, shape (37,)
    better : bool
        Whether it fits them better, at the cost of `start_poses`.
    """
    if len(points) < LEAST_POINTS:
        return state, False
    cost = point_cost(body, points, views)
    found, _ = _search(rng, body, cost, state, NEAR_SEARCH, NEAR_SHARE)
    found, _ = lay_body(body, points, found, GATES_M, views)
    before, after = cost(np.stack([state, found]))
    return found, bool(after < before)


def _search(
    rng: np.random.Generator, body: BodyModel, cost, state: np.ndarray, settings: AnnealedSettings, share: float = 1.0
) -> tuple[np.ndarray, float]:
    """Where an annealed search from one state meets the least of a cost, and that; `share` scales its deviations."""
    sd = share * np.array([next(value for key, value in SEARCH_SD.items() if key in name) for name in DOF_NAMES])
    low, high = body.limits.low, body.limits.high
    _, info = annealed_step(rng, particle_init(state[None]), lambda states: -cost(states), sd, low, high, settings)
    return info.best, -info.best_log_likelihood


def left_over(body: BodyModel, state: np.ndarray, points: np.ndarray, views: np.ndarray, gate_m: float = SEARCH_GATE_M) -> int:
    """How many trusted points are nowhere near a body's markers, or more than a body has: those of another person, where they are many.

    A pose may lie across two people and be near the points of both; but no body has more markers that all views agree on than it has.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    state : ndarray, shape (37,)
    points : ndarray, shape (n, 3)
    views : ndarray of int, shape (n,)
    gate_m : float
        What is farther than this from all markers is nowhere near, metres.
    """
    away = np.linalg.norm(points[:, None] - landmarks(body, state), axis=-1).min(axis=1)
    trust = _trust(views)
    return max(int(((away > gate_m) & (trust >= 0.5)).sum()), int((trust == 1).sum()) - len(LANDMARKS))


def _trust(views: np.ndarray) -> np.ndarray:
    """From 0, for points on which the fewest views agree, to 1; all 1 where the same number agrees on each."""
    few, many = views.min(), views.max()
    return np.ones(len(views)) if few == many else (views - few) / (many - few)


def point_cost(body: BodyModel, points: np.ndarray, views: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """How badly states, shape (n, 37), fit points: the cost of `start_poses`, shape (n,), square metres.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    points : ndarray, shape (m, 3)
    views : ndarray of int, shape (m,)
    """
    trust = _trust(views)
    gate = np.float32(SEARCH_GATE_M**2)
    places = points.astype(np.float32)
    doubt, needed = ((DOUBT_M * (1 - trust)) ** 2).astype(np.float32), (trust**2).astype(np.float32)

    def cost(states: np.ndarray) -> np.ndarray:
        tips = place_tips(body, states)
        nearest, left_over = np.full(tips.shape[1:], gate), np.zeros(tips.shape[2], np.float32)
        for place, more, share in zip(places, doubt, needed, strict=True):
            squared = ((tips - place[:, None, None]) ** 2).sum(axis=0)
            left_over += share * np.minimum(squared.min(axis=0), gate)
            np.minimum(nearest, squared + more, out=nearest)
        return (nearest.sum(axis=0, dtype=float) + left_over) / len(nearest)

    return cost


def lay_body(
    body: BodyModel, points: np.ndarray, state: np.ndarray, gates_m: tuple[float, ...] = GATES_M, views: np.ndarray | None = None
) -> tuple[np.ndarray, float]:
    """Lay a body into points: markers take points (least total squared distance), inverse kinematics follows, and again.

    Parameters
    ----------
    body : BodyModel
        With its markers as tips.
    points : ndarray, shape (n, 3)
        World, metres.
    state : ndarray, shape (37,)
        Start.
    gates_m : tuple of float
        How far a marker may be from the point that it takes, round by round, metres.
    views : ndarray of int, shape (n,), optional
        How many views agree on each point: of two points, the marker rather takes the one on which more do.

    Returns
    -------
    state : ndarray, shape (37,)
    cost : float
        Mean squared distance of the markers to their points, square metres; that of the last gate for a marker without one. Infinite where
        too few markers found a point.
    """
    if not len(points):
        return state, np.inf
    cost, most = np.inf, gates_m[-1] ** 2
    doubt = np.zeros(len(points)) if views is None else (DOUBT_M * (1 - _trust(views))) ** 2
    for gate in gates_m:
        squared = ((landmarks(body, state)[:, None] - points) ** 2).sum(axis=-1)
        rows, columns = linear_sum_assignment(np.where(squared < gate**2, squared + doubt, (gate + DOUBT_M) ** 2))
        near = squared[rows, columns] < gate**2
        if near.sum() < LEAST_POINTS:
            return state, np.inf
        target = np.full((len(squared), 3), np.nan)
        target[rows[near]] = points[columns[near]]
        state, _ = fit_landmarks(body, target, state, iterations=8)
        off = ((landmarks(body, state) - target) ** 2).sum(axis=-1)
        cost = float(np.where(np.isnan(off), most, np.minimum(off, most)).mean())
    return state, cost
