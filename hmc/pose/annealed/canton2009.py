"""The markerless annealed particle filter with the numbers the thesis prints (Canton 2009, chapters 3 and 6), as a preset.

It is kept for comparison: six layers that each keep half of the particles hardly concentrate 27 dimensions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from hmc.montecarlo import AnnealedSettings
from hmc.pose.annealed.scores import (
    ScoreMaps,
    ScoreTable,
    ScoreVariances,
    log_likelihood_factorised,
    log_likelihood_global,
    scores,
)
from hmc.pose.body.joints import DOF_NAMES

__all__ = ["CANTON2009", "FASTEST", "Canton2009", "first_drift", "score_log_likelihood"]

#: Fastest change expected of each degree of freedom, metres or radians a second: a jog's travel, a boxer's arms. The thesis
#: says that P0 follows from such numbers (3.2.2) and prints none; these are ours. Keys are beginnings of names.
FASTEST: dict[str, float] = {
    "root_tx": 2.5, "root_ty": 2.5, "root_tz": 1.0, "root_rz": 3.0, "root_ry": 1.5, "root_rx": 1.5,
    "torso": 2.5, "neck": 4.0,
    "l_shoulder": 10.0, "r_shoulder": 10.0, "l_elbow": 12.0, "r_elbow": 12.0,
    "l_hip": 6.0, "r_hip": 6.0, "l_knee": 10.0, "r_knee": 10.0,
}  # fmt: skip


@dataclass(frozen=True)
class Canton2009:
    """Settings of the printed filter.

    Parameters
    ----------
    annealing : AnnealedSettings
        6 layers of 600 particles (6.7.2), survival rate .5 in each, drift scaled by the survival rates (3.2.2).
    variances : ScoreVariances
        Below Eq. 6.22 and Table 6.2.
    likelihood : {"factorised", "global"}
        The first did better (6.7.1.2).
    sigma_vox : float
        Smoothing of the surface map, voxels; the thesis names none.
    voxel_size_m, density : float
        2 cm and as many flesh points as voxels (6.7.2).
    """

    annealing: AnnealedSettings = field(default_factory=AnnealedSettings)
    variances: ScoreVariances = field(default_factory=ScoreVariances)
    likelihood: Literal["factorised", "global"] = "factorised"
    sigma_vox: float = 1.0
    voxel_size_m: float = 0.02
    density: float = 1.0


CANTON2009 = Canton2009()


def first_drift(fps: float) -> np.ndarray:
    """P0, the first layer's drift: half of the largest change expected from one frame to the next (Canton, 3.2.2).

    Parameters
    ----------
    fps : float
        Frames a second.

    Returns
    -------
    ndarray, shape (27,)
        Standard deviations, metres and radians.
    """
    fastest = [next(speed for prefix, speed in FASTEST.items() if name.startswith(prefix)) for name in DOF_NAMES]
    return np.array(fastest) / (2 * fps)


def score_log_likelihood(table: ScoreTable, maps: ScoreMaps, settings: Canton2009 = CANTON2009) -> Callable[[np.ndarray], np.ndarray]:
    """The likelihood of one frame as a function of states, as `hmc.montecarlo.annealed_step` wants it.

    Parameters
    ----------
    table : ScoreTable
    maps : ScoreMaps
    settings : Canton2009

    Returns
    -------
    callable
        ``(n, 27) -> (n,)``.
    """
    if settings.likelihood == "global":
        whole = settings.variances.whole_body()
        return lambda states: log_likelihood_global(scores(table, states, maps), table.counts, whole)
    by_part = settings.variances.by_part()
    return lambda states: log_likelihood_factorised(scores(table, states, maps), by_part)
