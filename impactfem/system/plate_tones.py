"""Frequencies and modes of plates, most of whose degrees of freedom have no mass, and of nets."""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import eigsh, splu

from impactfem.arrays import Floats

_FEW = 150  # vertices with mass up to which frequencies are found by a dense matrix
_RIGID = 1e-6  # of the largest of a few squared frequencies, below which motions are rigid
_SEEN = 6  # motions among which rigid ones are, of which there are 3 at most


def modes(stiffness: csr_matrix, mass: Floats, count: int) -> tuple[Floats, Floats]:
    """Lowest angular frequencies [rad/s], rigid motions among them, and their modes.

    By shifted inversion. Modes have the mass 1, and what has no mass follows them in equilibrium.

    Args:
        stiffness: In q, (d, d).
        mass: Diagonal of the mass, 0 of what has none, (d,).
        count: How many.

    Returns:
        Frequencies, (count,), and modes by columns, (d, count).
    """
    if int((mass > 0.0).sum()) <= _FEW:
        squares, shapes = _dense(stiffness, mass)
        return _rooted(squares[:count]), shapes[:, :count]
    weights = csr_matrix(coo_matrix((mass, (np.arange(len(mass)),) * 2)))
    heavy = mass > 0.0
    scale = float(np.median(stiffness.diagonal()[heavy]) / mass[heavy].mean())
    start = np.ones(len(mass))
    squares, shapes = eigsh(stiffness, count, weights, sigma=-1e-9 * scale, which="LM", v0=start)
    order = np.argsort(squares)
    return _rooted(squares[order]), shapes[:, order]


def _rooted(squares: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def _dense(stiffness: csr_matrix, mass: Floats) -> tuple[Floats, Floats]:
    """All of a small system, by what is left where everything without mass is in equilibrium."""
    heavy = mass > 0.0
    own, beside = stiffness[heavy][:, heavy].toarray(), stiffness[~heavy][:, heavy].toarray()
    follows = np.zeros_like(beside)
    if beside.size:
        follows = -splu(stiffness[~heavy][:, ~heavy].tocsc()).solve(beside)
        own += beside.T @ follows
    root = np.sqrt(mass[heavy])
    squares, found = np.linalg.eigh(own / np.outer(root, root))
    shapes = np.empty((len(mass), len(squares)))
    shapes[heavy] = found / root[:, None]
    shapes[~heavy] = follows @ shapes[heavy]
    return squares, shapes


def frequencies(stiffness: csr_matrix, mass: Floats, count: int) -> Floats:
    """Lowest angular frequencies [rad/s], rigid motions among them; see `modes`."""
    return modes(stiffness, mass, count)[0]


def vibrations(
    stiffness: csr_matrix, mass: Floats, count: int, most_rigid: int = 3
) -> tuple[Floats, Floats]:
    """The same without rigid motions, so many at most; fewer if there are no more."""
    most = int((mass > 0.0).sum())
    found, shapes = modes(stiffness, mass, min(max(_SEEN, count + most_rigid), most))
    seen = found[: max(_SEEN, most_rigid + 1)]
    rigid = int((seen**2 <= _RIGID * seen[-1] ** 2).sum()) if len(seen) else 0
    return found[rigid : rigid + count], shapes[:, rigid : rigid + count]


def first_frequency(stiffness: csr_matrix, mass: Floats, most_rigid: int = 3) -> float:
    """The lowest one of vibrations [rad/s], 0 if there is none."""
    found, _ = vibrations(stiffness, mass, 1, most_rigid)
    return float(found[0]) if len(found) else 0.0
