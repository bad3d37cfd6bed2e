"""Gains of a linear model of least quadratic cost, of held forces too."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats


def least_cost_gains(
    model: tuple[ArrayLike, ArrayLike], weights: Sequence[float], effort: float, sample: float
) -> Floats:
    """Gains K, (n,), of u = -K x for x' = A x + B u with the least integral of x Q x + r u^2.

    Where u is held over samples, the model and the cost are those of samples, the integral of the
    cost within them included (C. F. Van Loan, IEEE Trans. Automatic Control 23 (1978) 395-404).

    Args:
        model: A, (n, n), and B, (n,).
        weights: The diagonal of Q, (n,).
        effort: r.
        sample: Time between two samples [s]; 0: none.

    Raises:
        LinAlgError: No gains hold the model.
        ValueError: Likewise.
    """
    from scipy.linalg import expm, solve_continuous_are, solve_discrete_are  # noqa: PLC0415

    a, b = (np.asarray(each, dtype=float) for each in model)
    b = b[:, None]
    n, q, r = len(a), np.diag(weights), np.array([[effort]])
    if not sample:
        return np.asarray(np.linalg.solve(r, b.T @ solve_continuous_are(a, b, q, r))[0])
    whole, cost = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n:], cost[:n, :n], cost[n:, n:] = a, b, q, r
    found = expm(sample * np.block([[-whole.T, cost], [np.zeros((n + 1, n + 1)), whole]]))
    flow = found[n + 1 :, n + 1 :]
    cost = flow.T @ found[: n + 1, n + 1 :]
    a, b, cross = flow[:n, :n], flow[:n, n:], cost[:n, n:]
    q, r = 0.5 * (cost[:n, :n] + cost[:n, :n].T), cost[n:, n:]
    x = solve_discrete_are(a, b, q, r, s=cross)
    return np.asarray(np.linalg.solve(r + b.T @ x @ b, b.T @ x @ a + cross.T)[0])
