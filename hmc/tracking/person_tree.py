"""A decision tree that tells people from other blobs, as plain numbers.

The tree is grown and pruned by `hmc.tracking.classifiers` and trained by `python -m hmc.tracking.train_person_tree`; here it is read,
written and asked, with NumPy alone. Source: Canton (2009), section 4.2.3, Figure 4.4.
"""

from __future__ import annotations

import csv
import functools
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.io.door import read_text_file
from hmc.io.files import atomic_write
from hmc.tracking.features import FEATURES

__all__ = ["PersonTree", "default_tree", "person_share", "predict_person", "read_tree", "write_tree"]

COLUMNS = ("node", "feature", "threshold", "at_most", "above", "person_share")
LEAF = -1
DEFAULT_TREE = Path(__file__).with_name("person_tree.csv")


@dataclass(frozen=True)
class PersonTree:
    """A binary decision tree over the features of Table 4.1; one entry a node, the root first.

    Attributes
    ----------
    feature : tuple of int
        Column of `hmc.tracking.features.FEATURES` that the node asks for; -1 for a leaf.
    threshold : tuple of float
        In the feature's unit; 0 for a leaf.
    at_most, above : tuple of int
        The next node where the feature is at most the threshold, and where it is above; -1 for a leaf.
    share : tuple of float
        Share of people among the components of the training that came to the node; the shipped tree's are weighted so that both classes
        weigh the same as a whole.
    """

    feature: tuple[int, ...]
    threshold: tuple[float, ...]
    at_most: tuple[int, ...]
    above: tuple[int, ...]
    share: tuple[float, ...]

    def __post_init__(self) -> None:
        n = len(self.feature)
        if n == 0 or {len(self.threshold), len(self.at_most), len(self.above), len(self.share)} != {n}:
            raise InputError("a tree needs one node at least, and all of its columns must have the same length")
        reached = {0}
        for node, (feature, *children) in enumerate(zip(self.feature, self.at_most, self.above, strict=True)):
            if not math.isfinite(self.threshold[node]) or not 0 <= self.share[node] <= 1:
                raise InputError(f"node {node}: the threshold must be a number, and the share of people lie between 0 and 1")
            if feature == LEAF:
                continue
            if not 0 <= feature < len(FEATURES):
                raise InputError(f"node {node}: there is no feature number {feature}")
            if not all(node < child < n for child in children) or reached & set(children) or children[0] == children[1]:
                raise InputError(f"node {node}: its two next nodes must come after it, and each node has one before it only")
            reached |= set(children)
        if len(reached) != n:
            raise InputError(f"node {min(set(range(n)) - reached)} cannot be reached from node 0")

    def __len__(self) -> int:
        return len(self.feature)


def person_share(tree: PersonTree, features: np.ndarray) -> np.ndarray:
    """Share of people among the components of the training that came to the same leaf.

    Parameters
    ----------
    tree : PersonTree
    features : ndarray, shape (n, 6)
        As `hmc.tracking.features.feature_matrix` gives them. Compared in single precision, as scikit-learn does.

    Returns
    -------
    ndarray, shape (n,)
        In [0, 1].
    """
    features = np.asarray(features, np.float32)
    column, at_most, above = (np.array(values) for values in (tree.feature, tree.at_most, tree.above))
    threshold = np.array(tree.threshold)
    node = np.zeros(len(features), int)
    while (inner := np.flatnonzero(column[node] != LEAF)).size:
        here = node[inner]
        low = features[inner, column[here]] <= threshold[here]
        node[inner] = np.where(low, at_most[here], above[here])
    return np.array(tree.share)[node]


def predict_person(tree: PersonTree, features: np.ndarray) -> np.ndarray:
    """Which components are people: those in leaves where people were the majority; shape (n,) bool."""
    return person_share(tree, features) > 0.5


def write_tree(path: str | Path, tree: PersonTree, notes: tuple[str, ...] = ()) -> None:
    """Write a tree as CSV, a node a line, atomically.

    Parameters
    ----------
    path : path
    tree : PersonTree
    notes : tuple of str
        Lines that say what it was trained on; they come first, each behind a ``#``.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with atomic_write(path) as file:
        for note in notes:
            file.write(f"# {' '.join(note.split())}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for node, feature in enumerate(tree.feature):
            inner = feature != LEAF
            question = (FEATURES[feature], repr(tree.threshold[node]), tree.at_most[node], tree.above[node]) if inner else ("",) * 4
            writer.writerow((node, *question, repr(tree.share[node])))


def read_tree(path: str | Path) -> PersonTree:
    """Read a tree that `write_tree` wrote.

    Raises
    ------
    InputError
        When there is no such file or it holds no tree; the line is named.
    """
    path = Path(path)
    if not Path(path).exists():
        raise InputError(f"{path}: there is no such file; train a tree: python -m hmc.tracking.train_person_tree")
    text = read_text_file(path)
    numbered = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    try:
        rows = list(csv.reader(io.StringIO("\n".join(line for _, line in numbered))))
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as a person tree ({error})") from None
    if not rows or tuple(rows[0]) != COLUMNS:
        raise InputError(f"{path}: holds no person tree; its first line must be {','.join(COLUMNS)}")
    nodes = []
    for expected, ((number, _), row) in enumerate(zip(numbered[1:], rows[1:], strict=True)):
        try:
            nodes.append(_read_node(row, expected))
        except (ValueError, IndexError) as error:
            raise InputError(f"{path}, line {number}: {error}") from None
    try:
        return PersonTree(*zip(*nodes, strict=True)) if nodes else PersonTree((), (), (), (), ())
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


@functools.cache
def default_tree() -> PersonTree:
    """The tree that comes with the package; what it was trained on stands in the first lines of its file."""
    return read_tree(DEFAULT_TREE)


def _read_node(row: list[str], expected: int) -> tuple[int, float, int, int, float]:
    """Feature, threshold, next nodes and share of one line."""
    if len(row) != len(COLUMNS):
        raise ValueError(f"{len(row)} values where the first line names {len(COLUMNS)} columns")
    node, feature, threshold, at_most, above, share = row
    if int(node) != expected:
        raise ValueError(f"node {node} where node {expected} should be")
    if not feature:
        return LEAF, 0.0, LEAF, LEAF, float(share)
    if feature not in FEATURES:
        raise ValueError(f"unknown feature {feature!r} (known: {', '.join(FEATURES)})")
    return FEATURES.index(feature), float(threshold), int(at_most), int(above), float(share)
