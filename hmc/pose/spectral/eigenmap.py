"""Laplacian eigenmap of a weighted graph: the first eigenvectors of L u = lambda D u with U^T D U = I. Hsiao (2008), Eqs. 3-9 to 3-12.

Connected components are solved one by one: a graph's eigenvectors are those of its components, and the zero eigenvalue, once a component,
is known beforehand. So disconnected graphs need no special care, and tiny ones are solved densely.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, eigsh, splu

__all__ = ["Eigenmap", "eigenmap"]

#: Components up to this size are solved densely.
DENSE_NODES = 60
#: The shift lies just below zero, so that the shifted matrix is positive definite.
SHIFT = -1e-4


@dataclass(frozen=True)
class Eigenmap:
    """An embedding of a graph's nodes.

    Parameters
    ----------
    values : ndarray, shape (k,)
        The smallest eigenvalues that are not zero, rising.
    vectors : ndarray, shape (n, k)
        U, with U^T D U = I; a node's row is its place. An eigenvector of one component is zero on the others.
    labels : ndarray of int, shape (n,)
        Connected component of each node.
    """

    values: np.ndarray
    vectors: np.ndarray
    labels: np.ndarray


def eigenmap(weights: csr_array, dimensions: int = 6, tolerance: float = 1e-7) -> Eigenmap:
    """Embed the nodes of a graph.

    Parameters
    ----------
    weights : csr_array, shape (n, n)
        Symmetric, not negative, nothing on the diagonal.
    dimensions : int
        Eigenvectors wanted. There are fewer where the graph has fewer nodes than that and its components together.
    tolerance : float
        Relative accuracy of the eigenvalues.

    Returns
    -------
    Eigenmap
        Signs are such that the entry of largest size is positive.
    """
    n = weights.shape[0]
    n_components, labels = connected_components(weights, directed=False)
    values, owners, vectors = [], [], []
    for component in range(n_components):
        nodes = np.flatnonzero(labels == component)
        if len(nodes) < 2:
            continue
        part = weights if len(nodes) == n else csr_array(weights[nodes][:, nodes])
        found, columns = _connected(part, min(dimensions, len(nodes) - 1), tolerance)
        values += found.tolist()
        owners += [nodes] * len(found)
        vectors += list(columns.T)
    order = np.argsort(values, kind="stable")[:dimensions]
    out = np.zeros((n, len(order)))
    for column, k in enumerate(order):
        vector = vectors[k]
        out[owners[k], column] = vector * (1.0 if vector[np.abs(vector).argmax()] > 0 else -1.0)
    return Eigenmap(np.array(values)[order], out, labels)


def _connected(weights: csr_array, k: int, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """The k smallest non-zero eigenvalues of a connected graph, and their eigenvectors (n, k)."""
    degree = np.asarray(weights.sum(axis=1)).ravel()
    root = 1 / np.sqrt(degree)
    n = len(degree)
    # The symmetric form: N = I - D^-1/2 E D^-1/2 has the eigenvectors D^1/2 u. A symmetric matrix by rows is the same by columns.
    rows = np.repeat(np.arange(n), np.diff(weights.indptr))
    scaled = csc_array((weights.data * root[rows] * root[weights.indices], weights.indices, weights.indptr), shape=(n, n))
    if n <= max(DENSE_NODES, 2 * k + 2):
        values, vectors = np.linalg.eigh(np.eye(n) - scaled.toarray())
        return values[1 : k + 1], root[:, None] * vectors[:, 1 : k + 1]
    shifted = csc_array(diags_array(np.full(n, 1.0 - SHIFT), format="csc") - scaled)
    factor = splu(shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    # The eigenvector of zero is known; with it taken out of the inverse, only those that are wanted are left to find.
    null = np.sqrt(degree / degree.sum())
    inverse = LinearOperator((n, n), matvec=lambda x: (y := factor.solve(np.asarray(x).ravel())) - null * (null @ y), dtype=float)
    start = _start_vector(n)
    start -= null * (null @ start)
    values, vectors = eigsh(inverse, k=k, which="LM", v0=start, tol=tolerance, ncv=2 * k + 8)
    order = np.argsort(-values)
    return 1 / values[order] + SHIFT, root[:, None] * vectors[:, order]


def _start_vector(n: int) -> np.ndarray:
    """A fixed vector that no symmetry of a graph is orthogonal to."""
    return np.sin(np.arange(n) * 1.618 + 0.5) + 0.1
