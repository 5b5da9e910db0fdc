"""The coefficients of `hmc.pose.trust`.

Fitted by ``python -m hmc.experiments run trust`` (`hmc.experiments.trust`), which also shows how they do on recordings that had no part
in it: results/trust, docs/accuracy.md.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["KINDS", "NEAR_M", "ONE_PASS", "TWO_PASSES", "TrustModel"]

#: What is trusted: that a landmark is as near to the truth as this, metres.
NEAR_M = 0.06
#: Kinds of landmarks, each with an intercept of its own.
KINDS = ("trunk", "shoulder", "hip", "elbow", "knee", "wrist", "ankle")


@dataclass(frozen=True)
class TrustModel:
    """A logistic regression: the logit is the kind's intercept less the weighted sum of the features.

    Parameters
    ----------
    intercepts : tuple of float, of length 7
        In the order of `KINDS`.
    weights : tuple of float
        In the order of `hmc.pose.trust.FEATURES`, none below 0.
    """

    intercepts: tuple[float, ...]
    weights: tuple[float, ...]


#: Of poses that were followed forward and backward in time.
TWO_PASSES = TrustModel((5.74, 5.8, 5.66, 5.21, 6.21, 5.21, 5.01), (0.85, 0.77, 33.66, 24.41, 3.28, 2.11))
#: Of those that were followed forward only.
ONE_PASS = TrustModel((4.63, 4.84, 4.03, 3.9, 4.67, 3.61, 4.14), (0.68, 0.45, 29.84, 48.51, 2.95))
