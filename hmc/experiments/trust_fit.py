"""The fit of `hmc.pose.trust_model`: a logistic regression without weights below 0, and the threshold of what is doubtful."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from hmc.pose.trust import KIND_OF_LANDMARK
from hmc.pose.trust_model import KINDS, NEAR_M, TrustModel

__all__ = ["GARBAGE_WEIGHT", "Sample", "fit_model", "predict", "sample_of", "smallest_threshold"]

#: Ridge on the weights, of features of unit deviation, and on how far kinds are from their mean.
RIDGE, RIDGE_KINDS = 0.003, 0.001
#: Poses at wrong times count as much of those as they are.
GARBAGE_WEIGHT = 0.1


@dataclass(frozen=True)
class Sample:
    """Landmarks of one recording.

    Parameters
    ----------
    recording : str
    features : ndarray, shape (n, k)
    kind : ndarray of int, shape (n,)
        Places in `KINDS`.
    near : ndarray of bool, shape (n,)
        Within `NEAR_M` of the truth.
    """

    recording: str
    features: np.ndarray
    kind: np.ndarray
    near: np.ndarray


def sample_of(recording: str, features: np.ndarray, errors_m: np.ndarray, n_features: int) -> Sample:
    """The landmarks that have an estimate, a truth and each of the first `n_features` features.

    Parameters
    ----------
    recording : str
    features : ndarray, shape (n, 15, 6)
    errors_m : ndarray, shape (n, 15)
    n_features : int
    """
    features = features[..., :n_features]
    known = np.isfinite(errors_m) & np.isfinite(features).all(axis=-1)
    kind = np.broadcast_to(KIND_OF_LANDMARK, known.shape)
    return Sample(recording, features[known], kind[known], errors_m[known] <= NEAR_M)


def predict(model: TrustModel, sample: Sample) -> np.ndarray:
    """The model's trust in each landmark, shape (n,)."""
    return np.asarray(expit(np.array(model.intercepts)[sample.kind] - sample.features @ np.array(model.weights)))


def fit_model(samples: Sequence[Sample], garbage: Sequence[Sample] = ()) -> TrustModel:
    """The most likely model of some recordings, each of which counts the same.

    Parameters
    ----------
    samples : sequence of Sample
        None of them empty.
    garbage : sequence of Sample
        Of poses at wrong times: what never happens to sound ones, a body beside all silhouettes, is learnt of these.
    """
    every = [*samples, *garbage]
    features, kind, near = (np.concatenate([getattr(one, name) for one in every]) for name in ("features", "kind", "near"))
    counts = np.array([1.0] * len(samples) + [GARBAGE_WEIGHT] * len(garbage))
    weight = np.concatenate(
        [np.full(len(one.near), count / len(one.near)) for one, count in zip(every, counts / counts.sum(), strict=True)]
    )
    scale = features.std(axis=0) + 1e-9
    scaled, columns, n = features / scale, np.eye(len(KINDS))[kind], len(KINDS)

    def loss(values: np.ndarray) -> tuple[float, np.ndarray]:
        logit = columns @ values[:n] - scaled @ values[n:]
        pull = weight * (expit(logit) - near)
        kinds = values[:n] - values[:n].mean()
        cost = weight @ np.logaddexp(0, np.where(near, -logit, logit)) + RIDGE * values[n:] @ values[n:] + RIDGE_KINDS * kinds @ kinds
        return float(cost), np.concatenate([columns.T @ pull + 2 * RIDGE_KINDS * kinds, -scaled.T @ pull + 2 * RIDGE * values[n:]])

    start = np.concatenate([np.full(n, 3.0), np.full(len(scale), 0.1)])
    bounds = [(None, None)] * n + [(0, None)] * len(scale)
    best = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 1000}).x
    return TrustModel(tuple(map(float, best[:n])), tuple(map(float, best[n:] / scale)))


def smallest_threshold(trust: np.ndarray, near: np.ndarray, share: float) -> float:
    """The smallest trust, to two decimals, from which on a share of the landmarks is near; 1 where there is none.

    Parameters
    ----------
    trust : ndarray, shape (n,)
    near : ndarray of bool, shape (n,)
    share : float
    """
    for threshold in np.arange(50, 100) / 100:
        good = trust >= threshold
        if good.any() and near[good].mean() >= share:
            return float(threshold)
    return 1.0
