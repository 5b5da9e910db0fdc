"""Scouts: annealed filters that look for a missing limb where it may be (Canton 2009, section 7.4.1).

A scout moves the missing limb widely, and with it the limb on which it hangs (elbow and shoulder say together where a forearm is), and
leaves the rest of the body where the tracked limbs' filter has put it. Only a limb that is found changes that estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hmc.body.joints import dof_index
from hmc.body.prior import POSTURE
from hmc.pose.objectives.four_scores import ScoreVariances, log_likelihood_factorised, scores
from hmc.pose.steps.hidden.limbs import LimbSettings, limb_spread_deg
from hmc.pose.steps.hidden.shown import FleshInHulls, in_doubt, limb_signs, place_flesh
from hmc.pose.steps.restrict import part_mask, restrict_table
from hmc.search.filters import AnnealedSettings, annealed_step, particle_init
from hmc.search.truncated import truncated_normal
from hmc.search.weights import normalise

#: Angles that turn upper arms and thighs about themselves, near enough; a hull shows them by the lower limb alone.
TWISTS = dof_index("r_shoulder_y", "l_shoulder_y", "r_hip_z", "l_hip_z")
#: How far the limb on which a missing one hangs is moved, against the missing one.
SEEN_SHARE = 0.2

__all__ = ["ScoutReport", "limb_dofs", "scout"]


@dataclass(frozen=True)
class ScoutReport:
    """What a limb's scouts found.

    Parameters
    ----------
    state : ndarray, shape (37,)
        The body with the limb at the scouts' mean.
    spread_deg : float
        Median spread of the limb's own angles, degrees.
    occupancy : float
        Share of the limb's free flesh in occupied voxels, at that mean.
    shown : bool
        They agree on a place of which enough is in the hulls, and there the limb would not be in doubt.
    held_occupancy : float
        Of the limb on which it hangs, where the scouts have that; NaN where it hangs on none.
    evaluations : int
    """

    state: np.ndarray
    spread_deg: float
    occupancy: float
    shown: bool
    held_occupancy: float
    evaluations: int


def limb_dofs(settings: LimbSettings, limb: int) -> np.ndarray:
    """Places in a state of what places a limb: its own angles, and those of the limbs on which it hangs."""
    tree, dofs = settings.tree, []
    while limb >= 0:
        dofs.append(tree.limbs[limb].placing)
        limb = tree.parent[limb]
    return np.concatenate(dofs)


def scout(
    rng: np.random.Generator,
    looked: FleshInHulls,
    state: np.ndarray,
    limb: int,
    active: np.ndarray,
    settings: LimbSettings,
) -> ScoutReport:
    """Look for one missing limb.

    Parameters
    ----------
    rng : numpy.random.Generator
    looked : FleshInHulls
    state : ndarray, shape (37,)
        Estimate of the tracked limbs.
    limb : int
        Place in the tree's `limbs`; what it hangs on must be there.
    active : ndarray of bool, shape (n_limbs,)
    settings : LimbSettings
    """
    tree, table = settings.tree, looked.table
    own_parts, dofs = tree.limbs[limb].parts, limb_dofs(settings, limb)
    moved = [*own_parts, *(tree.limbs[tree.parent[limb]].parts if tree.parent[limb] >= 0 else ())]
    scored, others = part_mask(moved), part_mask(tree.model(active).parts)
    # Only the flesh that moves is looked up, but its overlap with all is counted.
    lean = replace(restrict_table(table, scored), overlap=restrict_table(table, scored | others).overlap)
    low, high = table.body.limits.low[dofs], table.body.limits.high[dofs]
    variances = ScoreVariances().by_part()[scored]

    def log_likelihood(angles: np.ndarray) -> np.ndarray:
        return log_likelihood_factorised(scores(lean, _with(state, dofs, angles), looked.maps)[:, scored], variances)

    own = tree.limbs[limb].placing
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
    flesh = place_flesh(looked, found, moved)
    signs = limb_signs(flesh, own_parts, others)
    enough = signs.occupancy > settings.found_occupancy or signs.strict > settings.found_strict
    shown = spread < settings.found_spread_deg and enough and not in_doubt(flesh, limb, active, settings)
    parent = tree.parent[limb]
    held = limb_signs(flesh, tree.limbs[parent].parts, others).occupancy if parent >= 0 else np.nan
    return ScoutReport(found, spread, signs.occupancy, shown, held, info.evaluations + 1)


def _with(state: np.ndarray, dofs: np.ndarray, angles: np.ndarray) -> np.ndarray:
    states = np.repeat(state[None], len(angles), axis=0)
    states[:, dofs] = angles
    return states
