"""Frequencies of plates, most of whose degrees of freedom have no mass."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import eigsh, splu

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

_FEW = 150  # vertices with mass up to which frequencies are found by a dense matrix
_RIGID = 1e-6  # of the largest of a few squared frequencies, below which motions are rigid


def frequencies(stiffness: csr_matrix, mass: Floats, count: int) -> Floats:
    """Lowest angular frequencies [rad/s], rigid motions among them, by shifted inversion.

    Args:
        stiffness: In q.
        mass: Diagonal of the mass, 0 of what has none.
        count: How many.
    """
    heavy = mass > 0.0
    if int(heavy.sum()) <= _FEW:
        return _dense_frequencies(stiffness, mass, heavy)[:count]
    weights = csr_matrix(coo_matrix((mass, (np.arange(len(mass)),) * 2)))
    scale = float(np.median(stiffness.diagonal()[heavy]) / mass[heavy].mean())
    start = np.ones(len(mass))
    found = eigsh(
        stiffness, count, weights, sigma=-1e-9 * scale, which="LM", v0=start,
        return_eigenvectors=False,
    )  # fmt: skip
    return np.asarray(np.sqrt(np.maximum(np.sort(found), 0.0)))


def _dense_frequencies(stiffness: csr_matrix, mass: Floats, heavy: Booleans) -> Floats:
    """All of a small system, by what is left where everything without mass is in equilibrium."""
    own, beside = stiffness[heavy][:, heavy].toarray(), stiffness[~heavy][:, heavy].toarray()
    if beside.size:
        own -= beside.T @ splu(stiffness[~heavy][:, ~heavy].tocsc()).solve(beside)
    root = np.sqrt(mass[heavy])
    found = np.linalg.eigvalsh(own / np.outer(root, root))
    return np.asarray(np.sqrt(np.maximum(found, 0.0)))


def first_frequency(stiffness: csr_matrix, mass: Floats) -> float:
    """The lowest one of vibrations [rad/s]."""
    found = frequencies(stiffness, mass, min(6, int((mass > 0.0).sum())))
    lively = found[found**2 > _RIGID * found[-1] ** 2] if len(found) else found
    return float(lively[0]) if len(lively) else 0.0
