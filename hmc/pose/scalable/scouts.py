"""Scouts: annealed filters that look for a missing limb where it may be (Canton 2009, section 7.4.1).

A scout moves the missing limb widely, and with it the limb on which it hangs (elbow and shoulder say together where a forearm is), and
leaves the rest of the body where the tracked limbs' filter has put it. Only a limb that is found changes that estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.montecarlo.filters import AnnealedSettings, annealed_step, particle_init
from hmc.montecarlo.truncated import truncated_normal
from hmc.montecarlo.weights import normalise
from hmc.pose.annealed.scores import ScoreMaps, ScoreTable, ScoreVariances, log_likelihood_factorised, scores
from hmc.pose.annealed.symmetric import POSTURE, body_distance
from hmc.pose.body.flesh import place_points
from hmc.pose.body.joints import dof_index
from hmc.pose.body.kinematics import segment_transforms
from hmc.pose.scalable.limbs import LimbSettings, limb_spread_deg
from hmc.pose.scalable.restrict import part_body, part_mask, restrict_table

#: Flesh nearer than this to another part says nothing of its own part, metres.
FREE_M = 0.05
#: Where less than this share of a limb is free, nothing is said of it.
LEAST_FREE = 0.2

#: Angles that turn upper arms and thighs about themselves, near enough; a hull shows them by the lower limb alone.
TWISTS = dof_index("r_shoulder_y", "l_shoulder_y", "r_hip_z", "l_hip_z")
#: How far the limb on which a missing one hangs is moved, against the missing one.
SEEN_SHARE = 0.2

__all__ = ["ScoutReport", "in_doubt", "limb_closeness", "limb_dofs", "limb_occupancy", "scout"]


@dataclass(frozen=True)
class ScoutReport:
    """What a limb's scouts found.

    Parameters
    ----------
    state : ndarray, shape (27,)
        The body with the limb at the scouts' mean.
    spread_deg : float
        Median spread of the limb's own angles, degrees.
    occupancy : float
        As `limb_occupancy`, at that mean.
    evaluations : int
    """

    state: np.ndarray
    spread_deg: float
    occupancy: float
    evaluations: int


def limb_dofs(settings: LimbSettings, limb: int) -> np.ndarray:
    """Places in a state of what moves a limb: its own angles, and those of the limbs on which it hangs."""
    tree, dofs = settings.tree, []
    while limb >= 0:
        dofs.append(tree.limbs[limb].dofs)
        limb = tree.parent[limb]
    return np.concatenate(dofs)


def limb_occupancy(table: ScoreTable, state: np.ndarray, maps: ScoreMaps, parts: tuple[str, ...], others: np.ndarray) -> float:
    """Share of a limb's flesh in occupied voxels (Eq. 6.15), of the flesh that is free of other parts.

    Hulls are fatter than their people: beside the trunk or behind a thigh there is room in them for a limb that is not there.

    Parameters
    ----------
    table : ScoreTable
        Of the whole body.
    state : ndarray, shape (27,)
    maps : ScoreMaps
    parts : tuple of str
        The limb's.
    others : ndarray of bool, shape (n_parts,)
        Which parts there are beside it.

    Returns
    -------
    float
        0 to 1; NaN where hardly any of the limb is free, and nothing can be said.
    """
    free = _free_voxels(table, state, maps, parts, others, part_mask(parts)[table.flesh.part])
    return np.nan if free is None else float(maps.occupancy[tuple(free[0].T)].sum() / free[1])


def limb_closeness(table: ScoreTable, state: np.ndarray, maps: ScoreMaps, parts: tuple[str, ...], others: np.ndarray) -> float:
    """How near the skin of a limb is to the hull's surface (1 - Eq. 6.16), of what is free of other parts; as `limb_occupancy`.

    A limb that is seen has its skin where the hull ends. One that is hidden and has found room inside of a fat hull has not.
    """
    skin = part_mask(parts)[table.flesh.part] & table.flesh.is_surface
    free = _free_voxels(table, state, maps, parts, others, skin)
    return np.nan if free is None else float(maps.surface[tuple(free[0].T)].sum(dtype=float) / 255 / free[1])


def _free_voxels(table, state, maps, parts, others, rows) -> tuple[np.ndarray, int] | None:
    """Voxels of those of a limb's points that are free of other parts, and how many points these are; None where too few are."""
    rotations, positions = segment_transforms(table.body, state)
    points = place_points(rotations, positions, table.flesh.points[rows], table.flesh.segment[rows])
    free = body_distance(part_body(table.body, others & ~part_mask(parts)), state[None], points)[0] > FREE_M
    if free.mean() < LEAST_FREE:
        return None
    index = np.floor((points[free] - maps.origin) / maps.voxel_size_m).astype(int)
    return index[np.all((index >= 0) & (index < maps.occupancy.shape), axis=1)], len(index)


def in_doubt(table: ScoreTable, maps: ScoreMaps, state: np.ndarray, limb: int, active: np.ndarray, settings: LimbSettings) -> bool:
    """Whether a tracked limb is not shown: its free flesh is in the void, or it lies folded inside of the hull.

    A limb that furniture hides often ends up there: it is the only place of the hull that is left for it. What it hangs on is then
    covered by it and the trunk, and its skin is not where the hull ends.

    Parameters
    ----------
    table, maps
        As for `limb_occupancy`.
    state : ndarray, shape (27,)
    limb : int
        Place in the tree's `limbs`.
    active : ndarray of bool, shape (n_limbs,)
    settings : LimbSettings
    """
    tree = settings.tree
    own, there = tree.limbs[limb].parts, part_mask(tree.model(active).parts)
    if limb_occupancy(table, state, maps, own, there) < settings.lost_occupancy:
        return True
    if tree.parent[limb] < 0 or not np.isnan(limb_occupancy(table, state, maps, tree.limbs[tree.parent[limb]].parts, there)):
        return False
    return limb_closeness(table, state, maps, own, there) < settings.lost_closeness


def scout(
    rng: np.random.Generator,
    table: ScoreTable,
    maps: ScoreMaps,
    state: np.ndarray,
    limb: int,
    active: np.ndarray,
    settings: LimbSettings,
) -> ScoutReport:
    """Look for one missing limb.

    Parameters
    ----------
    rng : numpy.random.Generator
    table : ScoreTable
        Of the whole body.
    maps : ScoreMaps
    state : ndarray, shape (27,)
        Estimate of the tracked limbs.
    limb : int
        Place in the tree's `limbs`; what it hangs on must be there.
    active : ndarray of bool, shape (n_limbs,)
    settings : LimbSettings
    """
    tree = settings.tree
    own_parts, dofs = tree.limbs[limb].parts, limb_dofs(settings, limb)
    scored = part_mask([*own_parts, *(tree.limbs[tree.parent[limb]].parts if tree.parent[limb] >= 0 else ())])
    others = part_mask(tree.model(active).parts)
    low, high = table.body.limits.low[dofs], table.body.limits.high[dofs]
    variances = ScoreVariances().by_part()[scored]

    def log_likelihood(angles: np.ndarray) -> np.ndarray:
        values = _scored(table, _with(state, dofs, angles), maps, scored, others)
        return log_likelihood_factorised(values, variances)

    own = tree.limbs[limb].dofs
    starts = np.repeat(state[None, dofs], settings.scouts, axis=0)
    broad = np.isin(dofs, own)
    common = settings.scouts // 2
    drawn = np.concatenate(
        [
            truncated_normal(rng, np.tile(POSTURE[0][dofs], (common, 1)), POSTURE[1][dofs], low, high),
            rng.uniform(low, high, (settings.scouts - common, len(dofs))),
        ]
    )
    starts[:, broad] = drawn[:, broad]
    # With its lower part hidden the upper one may have gone astray into what is now shown again: every other scout draws that too.
    starts[::2] = drawn[::2]
    third = max(1, settings.scouts // 3)
    annealed = AnnealedSettings(
        settings.scout_layers, (settings.scouts, *[third] * (settings.scout_layers - 1)), settings.scout_survival, spread=0.5
    )
    # The limb on which it hangs is seen: of that one only the twist is open.
    sd = np.radians(settings.scout_spread_deg) * np.where(broad | np.isin(dofs, TWISTS), 1.0, SEEN_SHARE)
    cloud, info = annealed_step(rng, particle_init(starts), log_likelihood, sd, low, high, annealed)
    weights = normalise(cloud.log_weights)
    found = _with(state, dofs, (weights @ cloud.particles)[None])[0]
    spread = float(np.median(limb_spread_deg(cloud.particles, weights)[broad]))
    occupancy = limb_occupancy(table, found, maps, own_parts, others)
    return ScoutReport(found, spread, occupancy, info.evaluations + 1)


def _with(state: np.ndarray, dofs: np.ndarray, angles: np.ndarray) -> np.ndarray:
    states = np.repeat(state[None], len(angles), axis=0)
    states[:, dofs] = angles
    return states


def _scored(table: ScoreTable, states: np.ndarray, maps: ScoreMaps, own: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Scores of a limb's parts beside others, shape (n, n_own, 4): only its flesh is looked up, but its overlap with all is counted."""
    flesh, there = restrict_table(table, own), restrict_table(table, own | others)
    return scores(replace(flesh, overlap=there.overlap), states, maps)[:, own]
