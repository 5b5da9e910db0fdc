"""The seven person / no-person classifiers of Canton's Table 4.2, on the same features and the same split.

Source: Canton (2009), section 4.2.3, Table 4.2; the classifiers themselves are scikit-learn's. All see features scaled to unit deviation.
For tracking, only the decision tree is used, and as plain numbers: `PersonTree`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from sklearn.base import clone
from sklearn.cluster import KMeans
from sklearn.decomposition import PCA
from sklearn.mixture import GaussianMixture
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.neighbors import KernelDensity
from sklearn.neural_network import MLPClassifier
from sklearn.tree import DecisionTreeClassifier
from sklearn.tree._tree import Tree

from hmc.errors import InputError
from hmc.tracking.person_tree import LEAF, PersonTree, predict_person

__all__ = ["CLASSIFIERS", "DetectionScores", "detection_scores", "fit_classifier", "fit_tree", "frame_groups", "plain_tree"]

#: Asked which components are people: features (n, 6) to bool (n,).
Verdict = Callable[[np.ndarray], np.ndarray]

#: Components of the mixture (Table 4.2), and clusters, for which the table has no number: as many.
N_GAUSSIANS = 12
N_CLUSTERS = 12
#: Dimensions of a class's principal subspace.
N_PRINCIPAL = 3
#: Widths of the Parzen window that cross-validation chooses from, in deviations of the features.
BANDWIDTHS = np.geomspace(0.03, 1.0, 8)
#: Units of the hidden layers of the neural network.
HIDDEN = (16, 16)
#: Levels of pruning that cross-validation chooses from, at most, and its folds.
N_ALPHAS = 40
N_FOLDS = 5
#: Least components of the training in a leaf of the tree.
LEAST_LEAF = 5


@dataclass(frozen=True)
class DetectionScores:
    """Precision, recall and F-measure of the class of people; NaN where nothing was to be found or nothing was found."""

    precision: float
    recall: float
    f_measure: float


def detection_scores(is_person: np.ndarray, predicted: np.ndarray) -> DetectionScores:
    """Scores of verdicts against the truth.

    Parameters
    ----------
    is_person, predicted : ndarray of bool, shape (n,)

    Returns
    -------
    DetectionScores
    """
    is_person, predicted = np.asarray(is_person, bool), np.asarray(predicted, bool)
    hits, called, there = (int(np.count_nonzero(a)) for a in (is_person & predicted, predicted, is_person))
    nan = float("nan")
    return DetectionScores(
        hits / called if called else nan, hits / there if there else nan, 2 * hits / (called + there) if called + there else nan
    )


def fit_classifier(name: str, features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    """Train one of the classifiers of Table 4.2.

    Parameters
    ----------
    name : str
        A key of `CLASSIFIERS`.
    features : ndarray, shape (n, 6)
    is_person : ndarray of bool, shape (n,)
    groups : ndarray of int, shape (n,)
        Rows of one group are alike (frames that follow one another) and stay together in cross-validation; see `frame_groups`.
    rng : Generator

    Returns
    -------
    callable
        Features (n, 6) to verdicts (n,) bool.

    Raises
    ------
    InputError
        When the name is unknown, or there are too few rows of a class to learn from.
    """
    if name not in CLASSIFIERS:
        raise InputError(f"unknown classifier {name!r} (known: {', '.join(CLASSIFIERS)})")
    features, is_person = _checked(features, is_person)
    mean, deviation = features.mean(axis=0), features.std(axis=0)
    deviation = np.where(deviation > 0, deviation, 1.0)
    verdict = CLASSIFIERS[name]((features - mean) / deviation, is_person, groups, rng)
    return lambda rows: verdict((np.asarray(rows, float) - mean) / deviation) if len(rows) else np.zeros(0, bool)


def fit_tree(features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> PersonTree:
    """Grow a decision tree on entropy and prune it back to where cross-validation finds it best.

    Both classes weigh the same as a whole, however many components are people: else a leaf that a person out of two comes to is none's,
    because five times as many other objects were seen. Minimal cost-complexity pruning (Breiman et al. 1984): of the levels whose
    weighted share of wrong verdicts on the groups that were held out is within one standard error of the least, the one with the
    smallest tree.

    Parameters
    ----------
    features : ndarray, shape (n, 6)
    is_person : ndarray of bool, shape (n,)
    groups : ndarray of int, shape (n,)
        As for `fit_classifier`; two at least.
    rng : Generator

    Returns
    -------
    PersonTree

    Raises
    ------
    InputError
        When there are too few rows of a class, or there is one group only.
    """
    features, is_person = _checked(features, is_person)
    n_groups = len(np.unique(groups))
    if n_groups < 2:
        raise InputError("cross-validation needs two groups of frames at least; give a longer recording, or several")
    grown = DecisionTreeClassifier(criterion="entropy", class_weight="balanced", min_samples_leaf=LEAST_LEAF, random_state=_seed(rng))
    alphas = grown.cost_complexity_pruning_path(features, is_person).ccp_alphas.clip(min=0)
    alphas = np.unique(np.quantile(alphas, np.linspace(0, 1, N_ALPHAS), method="nearest"))
    folds = list(GroupKFold(min(N_FOLDS, n_groups)).split(features, is_person, groups))
    held_out = np.zeros((len(alphas), len(is_person)), bool)
    for train, test in folds:
        for a, alpha in enumerate(alphas):
            held_out[a, test] = clone(grown).set_params(ccp_alpha=alpha).fit(features[train], is_person[train]).predict(features[test])
    costs = (held_out != is_person) * np.where(is_person, 0.5 / is_person.mean(), 0.5 / (1 - is_person.mean()))
    wrong = costs.mean(axis=1)
    error = costs[wrong.argmin()].std() / np.sqrt(len(is_person))
    chosen = alphas[np.flatnonzero(wrong <= wrong.min() + error)[-1]]
    return plain_tree(clone(grown).set_params(ccp_alpha=chosen).fit(features, is_person).tree_)


def frame_groups(frames: np.ndarray, recordings: np.ndarray, frames_a_group: int = 25) -> np.ndarray:
    """Groups of rows that are alike: whole recordings where there are `N_FOLDS` or more, else stretches of frames.

    Parameters
    ----------
    frames, recordings : ndarray of int, shape (n,)
        As in `hmc.tracking.feature_table.FeatureTable`.
    frames_a_group : int
        Length of a stretch.

    Returns
    -------
    ndarray of int, shape (n,)
    """
    if len(np.unique(recordings)) >= N_FOLDS:
        return np.asarray(recordings)
    return np.unique(np.column_stack([recordings, np.asarray(frames) // frames_a_group]), axis=0, return_inverse=True)[1].ravel()


def plain_tree(tree: Tree) -> PersonTree:
    """scikit-learn's fitted tree as plain numbers.

    Parameters
    ----------
    tree : sklearn.tree._tree.Tree
        The attribute ``tree_`` of a fitted `DecisionTreeClassifier` of two classes; the second is that of people.

    Returns
    -------
    PersonTree
        The same nodes: scikit-learn numbers them from the root on, too, and knows -1 for none.
    """
    inner = tree.children_left >= 0
    share = tree.value[:, 0, 1] / tree.value[:, 0].sum(axis=1)
    columns = (np.where(inner, tree.feature, LEAF), np.where(inner, tree.threshold, 0.0), tree.children_left, tree.children_right, share)
    return PersonTree(*(tuple(column.tolist()) for column in columns))


def _checked(features: np.ndarray, is_person: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    features, is_person = np.asarray(features, float), np.asarray(is_person, bool)
    for count, what in ((np.count_nonzero(is_person), "people"), (np.count_nonzero(~is_person), "other objects")):
        if count < 2 * N_GAUSSIANS:
            raise InputError(
                f"{count} components are {what}; a classifier needs {2 * N_GAUSSIANS} at least: give more frames or recordings"
            )
    if not np.isfinite(features).all():
        raise InputError("features must be finite numbers")
    return features, is_person


def _seed(rng: np.random.Generator) -> int:
    """What scikit-learn takes in place of a generator."""
    return int(rng.integers(2**31))


def _bayes(fit: Callable[[np.ndarray], Callable[[np.ndarray], np.ndarray]], features: np.ndarray, is_person: np.ndarray) -> Verdict:
    """The class with the larger density times frequency; `fit` makes a logarithmic density of examples."""
    person, other = fit(features[is_person]), fit(features[~is_person])
    odds = np.log(is_person.mean()) - np.log1p(-is_person.mean())
    return lambda rows: person(rows) + odds > other(rows)


def _mixture(n_gaussians: int, features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    """A mixture of Gaussians with full covariances a class."""

    def fit(rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return GaussianMixture(n_gaussians, reg_covar=1e-4, random_state=_seed(rng)).fit(rows).score_samples

    return _bayes(fit, features, is_person)


def _parzen(features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    """Gaussian windows on all examples, a class; their width by cross-validated likelihood."""

    def fit(rows: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        return GridSearchCV(KernelDensity(), {"bandwidth": BANDWIDTHS}, cv=N_FOLDS).fit(rows).best_estimator_.score_samples

    return _bayes(fit, features, is_person)


def _principal(features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    """The probabilistic principal subspace of each class (Tipping and Bishop 1999)."""
    return _bayes(lambda rows: PCA(N_PRINCIPAL).fit(rows).score_samples, features, is_person)


def _k_means(features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    """Clusters of all examples; each has the class of its majority."""
    clusters = KMeans(N_CLUSTERS, n_init=10, random_state=_seed(rng)).fit(features)
    people = np.bincount(clusters.labels_, is_person, N_CLUSTERS) * 2 > np.bincount(clusters.labels_, minlength=N_CLUSTERS)
    return lambda rows: people[clusters.predict(rows)]


def _network(features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    """A multilayer perceptron."""
    return MLPClassifier(HIDDEN, learning_rate_init=0.01, tol=1e-3, max_iter=1000, random_state=_seed(rng)).fit(features, is_person).predict


def _decision_tree(features: np.ndarray, is_person: np.ndarray, groups: np.ndarray, rng: np.random.Generator) -> Verdict:
    tree = fit_tree(features, is_person, groups, rng)
    return lambda rows: predict_person(tree, rows)


#: Table 4.2's rows in its order; each is trained on scaled features, classes, groups, and a generator.
CLASSIFIERS: dict[str, Callable[[np.ndarray, np.ndarray, np.ndarray, np.random.Generator], Verdict]] = {
    "gaussian": lambda *data: _mixture(1, *data),
    "neural-network": _network,
    "k-means": _k_means,
    "pca": _principal,
    "parzen": _parzen,
    "mixture-12": lambda *data: _mixture(N_GAUSSIANS, *data),
    "decision-tree": _decision_tree,
}
