"""Which row goes with which unknown in the space-time system, the same on every rank."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Integers
from impactfem.mesh.spacetime import SpaceTimeMesh, nearest

_NEAR = 1e-9  # dimensionless distance within which a node lies on a side


@dataclass(frozen=True)
class Numbering:
    """Global indices of nodes and multipliers, and the causal pairing of rows.

    Petrov-Galerkin trial functions vanish at t = 0, test functions at t = T: the equation of test
    node m - 1 determines the displacement of node m. ``row`` moves each test row to the slot of
    the unknown it determines, so that the diagonal is not zero; the slots left over hold the
    initial and the clamped values.

    Attributes:
        points: Dimensionless (t, x) of every node in global order, shape (nodes, 2).
        row: Slot of each node's test equation; -1 where the test function vanishes, (nodes,).
        fixed: Nodes whose displacement is given, shape (fixed,).
        wall: Nodes at x = 0 in the order of time, shape (pairs + 1,).
        far: Nodes at x = L in the order of time.
        multipliers: Global multiplier of each wall interval in the order of time, (pairs,).
        grid: Nodes by layer and position, shape (layers + 1, elements + 1); None without layers.
    """

    points: NDArray[np.float64]
    row: Integers
    fixed: Integers
    wall: Integers
    far: Integers
    multipliers: Integers
    grid: Integers | None


def number(space: SpaceTimeMesh, nodes: Any, multipliers: Any, *, clamped: bool) -> Numbering:
    """Number the unknowns of a space-time mesh.

    Args:
        space: Space-time mesh.
        nodes: P1 space on it.
        multipliers: P0 space on its wall.
        clamped: Whether the far end is held.
    """
    comm = space.mesh.comm
    # Owned blocks are contiguous in the global numbering, so gathering puts them in order.
    owned = nodes.dofmap.index_map.size_local
    points = fem.gather(comm, nodes.tabulate_dof_coordinates()[:owned, :2])
    owned = multipliers.dofmap.index_map.size_local
    middles = fem.gather(comm, multipliers.tabulate_dof_coordinates()[:owned, 0])
    t, x = points[:, 0], points[:, 1]
    end = t.max()
    wall = _sorted(x < _NEAR, t)
    far = _sorted(x > 1.0 - _NEAR, t)
    start, stop = _sorted(t < _NEAR * end, x), _sorted(t > end * (1.0 - _NEAR), x)
    grid = _grid(space, points)
    row = np.arange(len(points))
    if grid is not None:
        row[grid[:-1]] = grid[1:]
    else:
        row[start] = stop
        row[wall[:-1]] = wall[1:]
    row[stop] = -1
    if clamped:
        row[far] = -1
        fixed = np.union1d(start, far)
    else:
        fixed = start
    return Numbering(points, row, fixed, wall, far, np.argsort(middles), grid)


def _sorted(chosen: NDArray[np.bool_], key: NDArray[np.float64]) -> Integers:
    """Integers of the chosen nodes in the order of ``key``."""
    found = np.flatnonzero(chosen)
    return found[np.argsort(key[found])]


def _grid(space: SpaceTimeMesh, points: NDArray[np.float64]) -> Integers | None:
    """Arrange the nodes of a layered mesh by layer and position."""
    times, positions = space.layout.times, space.layout.nodes
    if times is None or positions is None:
        return None
    grid = np.empty((len(times), len(positions)), dtype=np.int64)
    grid[nearest(times, points[:, 0]), nearest(positions, points[:, 1])] = np.arange(len(points))
    return grid
