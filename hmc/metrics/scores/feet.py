"""Scores of the feet's points against truth, for people who were matched by their landmarks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hmc.io.results import PoseTable
from hmc.landmarks import FOOT_POINTS
from hmc.metrics.scores.poses import PersonErrors

__all__ = ["feet_errors"]


def feet_errors(estimate: PoseTable, truth: PoseTable, persons: Sequence[PersonErrors]) -> dict[str, float]:
    """Mean distance of the ends of the soles from the true ones, in all frames with both.

    Parameters
    ----------
    estimate, truth : PoseTable
        Of `hmc.landmarks.FOOT_POINTS`, metres.
    persons : sequence of PersonErrors
        Who is who, as from `hmc.metrics.scores.poses.evaluate_pose`.

    Returns
    -------
    dict of str to float
        ``heels_mm``, ``toes_mm`` and how many points each mean is of, ``heels`` and ``toes``; empty where no frame has both.
    """
    apart = [np.zeros((0, len(FOOT_POINTS)))]
    for person in persons:
        found, true = estimate.where(np.isin(estimate.persons, person.estimated_as)), truth.of(person.person)
        _, a, b = np.intersect1d(found.frames, true.frames, return_indices=True)
        apart.append(np.linalg.norm(found.positions[a] - true.positions[b], axis=2))
    errors, scores = np.concatenate(apart), dict[str, float]()
    for kind in ("heel", "toe"):
        own = errors[:, [name.endswith(kind) for name in FOOT_POINTS]]
        known = own[np.isfinite(own)]
        if len(known):
            scores |= {f"{kind}s_mm": 1000 * float(known.mean()), f"{kind}s": len(known)}
    return scores
