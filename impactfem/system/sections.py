"""A bar and the loads along it on elements: integrals with hat functions and over elements."""

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Bar
from impactfem.scene.means import mean_of

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_SHARES = 0.5 * (1.0 + _POINTS)
_VALUES = 20_000  # means of a load that are looked for together


def weighted_velocity(bar: Bar, travel: Floats) -> Floats:
    """Integral of rho A u_t(0, x) times each hat function over rho A, as in the weak form [m^2/s].

    Args:
        bar: The bar.
        travel: Nodes as in `Bar.places`, (nodes,).
    """
    left, h = travel[:-1, None], np.diff(travel)[:, None]
    velocity = bar.initial_velocity(x=bar.places((left + h * _SHARES).ravel()))
    velocity = np.reshape(velocity + np.zeros(h.size * len(_SHARES)), (len(h), -1))
    weights = 0.5 * h * _WEIGHTS * bar.weights(travel)[:, None] * velocity
    integrals = np.zeros(len(travel))
    integrals[:-1] += weights @ (1.0 - _SHARES)
    integrals[1:] += weights @ _SHARES
    return integrals


def lumped(values: Floats) -> Floats:
    """Half of the values of both elements beside each node, (..., elements) -> (..., nodes)."""
    none = np.zeros((*values.shape[:-1], 1))
    sides = [np.concatenate(pair, axis=-1) for pair in ((values, none), (none, values))]
    return np.asarray(0.5 * (sides[0] + sides[1]))


def node_loads(bar: Bar, times: Floats, travel: Floats) -> Floats:
    """Mean force of the load on each node in each layer, over rho A [m^2/s^2].

    That of an element goes to both of its nodes alike, as its weight does: a load -rho A g is
    gravity, to rounding.

    Args:
        bar: The bar.
        times: Levels [s], (layers + 1,).
        travel: Nodes as in `Bar.places`.

    Returns:
        Shape (layers, nodes); a single row that holds for all layers if the load does not change,
        and none if there is no load.
    """
    if not bar.is_loaded:
        return np.zeros((0, len(travel)))
    x = bar.places(travel)
    h = np.diff(x)
    places = x[:-1, None] + h[:, None] * _SHARES
    if "x" not in bar.load.used:
        places = places[:1, :1]
    start, end = times[:-1, None], times[1:, None]
    if "t" not in bar.load.used:
        start, end = start[:1], end[:1]
    rows = max(1, _VALUES // places.size)
    means = np.concatenate(
        [
            mean_of(bar.load, start[k : k + rows], end[k : k + rows], x=places.ravel())
            for k in range(0, len(start), rows)
        ]
    ).reshape(len(start), *places.shape)
    along = means @ (0.5 * _WEIGHTS) if "x" in bar.load.used else means[:, :, 0]
    return lumped(along * h / bar.section)


def row_loads(nodes: Floats, layers: int) -> Floats:
    """Force on each node in each row of nodes, (layers, nodes), from that of `node_loads`.

    A test function of a row spans the two layers beside it: the mean of both (row 0: one).
    """
    if not len(nodes):
        return np.zeros((layers, nodes.shape[1]))
    full = np.broadcast_to(nodes, (layers, nodes.shape[1]))
    return np.concatenate([full[:1], 0.5 * (full[1:] + full[:-1])])
