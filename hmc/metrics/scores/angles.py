"""Angular scores of poses: estimate and truth read as one reference body, angle by angle (Canton 2009, section 5.3.2)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hmc.metrics.angles import IMAGE_ANGLES, REFERENCE_ANGLES, angular_errors, score_angles

__all__ = ["angle_rows"]


def angle_rows(label: str, groups: Mapping[str, tuple[np.ndarray, np.ndarray]], threshold: float) -> list[dict]:
    """Mean and deviation of the angles' errors as rows of a table: one an angle, then ``overall``, for all together and for each group.

    Parameters
    ----------
    label : str
        Name of the column that tells the groups apart: ``person`` or ``camera``.
    groups : mapping of str to (estimate, truth)
        Both of shape (n_frames, 15, d), d being 3 or 2; NaN where missing.
    threshold : float
        An angle counts only where both landmarks that it belongs to are no farther from the truth than this, in the unit of the points.

    Returns
    -------
    list of dict
        Degrees, as the columns' names say; ``compared`` is how many frames an angle was compared in, and overall how many angles.
    """
    errors = {name: angular_errors(*both, threshold) for name, both in groups.items()}
    errors = {"all": np.concatenate(list(errors.values())), **errors}
    rows = []
    for name, own in errors.items():
        names = REFERENCE_ANGLES if own.shape[1] == len(REFERENCE_ANGLES) else IMAGE_ANGLES
        each, overall = score_angles(own, "angle"), score_angles(own)
        for place, angle in enumerate((*names, "overall")):
            mean, deviation, compared = (np.append(a, b)[place] for a, b in zip(_parts(each), _parts(overall), strict=True))
            rows.append(
                {label: name, "angle": angle, "mean_deg": float(np.degrees(mean)), "deviation_deg": float(np.degrees(deviation)),
                 "compared": int(compared)}
            )  # fmt: skip
    return rows


def _parts(scores) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return scores.mean, scores.deviation, scores.counted
