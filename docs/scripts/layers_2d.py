"""Stability of the space-time scheme on structured layers of a plane: largest stable c dt / h.

The rows of one layer's test functions couple three layers, B_- u_{m-1} + B_0 u_m + B_+ u_{m+1} = 0.
The scheme is stable if all roots z of det(B_+ z^2 + B_0 z + B_-) satisfy |z| <= 1. The matrices
come from DOLFINx on two layers of a small grid, for dt = h; another dt only scales the two forms.
"""

from collections.abc import Callable

import numpy as np
import scipy.linalg

from impactfem.fem import MPI, compile_form, dolfinx_fem, dolfinx_mesh, ufl

CELLS = {
    "tetrahedra": dolfinx_mesh.CellType.tetrahedron,
    "prisms": dolfinx_mesh.CellType.prism,
    "hexahedra": dolfinx_mesh.CellType.hexahedron,
}
_ROUNDING = 1e-5  # the double root 1 of the rigid motion is known to the square root of rounding


def _matrices(cells: str, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forms u_t v_t and grad u . grad v on n x n x 2 cubes, and the nodes' (i, j, layer)."""
    corner = [float(n), float(n), 2.0]
    mesh = dolfinx_mesh.create_box(MPI.COMM_SELF, [[0.0] * 3, corner], [n, n, 2], CELLS[cells])
    space = dolfinx_fem.functionspace(mesh, ("Lagrange", 1))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    # UFL would take one point on prisms, where it holds derivatives of P1 for constant.
    dx = ufl.dx(metadata={"quadrature_degree": 4})
    forms = (u.dx(2) * v.dx(2) * dx, (u.dx(0) * v.dx(0) + u.dx(1) * v.dx(1)) * dx)
    time, space_part = (dolfinx_fem.assemble_matrix(compile_form(f)).to_dense() for f in forms)
    return time, space_part, np.rint(space.tabulate_dof_coordinates()).astype(int)


def block_limit(cells: str, n: int) -> float:
    """Limit on a square of n x n cells with free edges: eigenvalues of the recursion."""
    time, space, nodes = _matrices(cells, n)
    layers = [np.lexsort(nodes.T)[k * (n + 1) ** 2 : (k + 1) * (n + 1) ** 2] for k in range(3)]
    zero, one = np.zeros(((n + 1) ** 2,) * 2), np.eye((n + 1) ** 2)

    def growth(ratio: float) -> float:
        before, here, after = (
            (-time / ratio + space * ratio)[np.ix_(layers[1], layer)] for layer in layers
        )
        left = np.block([[zero, one], [-before, -here]])
        right = np.block([[one, zero], [zero, after]])
        return float(np.abs(scipy.linalg.eigvals(left, right)).max())

    return _largest(growth)


def symbol_limit(cells: str) -> float:
    """Limit on the unbounded plane: roots for waves exp(i (i a + j b)), a and b on a grid."""
    time, space, nodes = _matrices(cells, 2)
    middle = int(np.flatnonzero((nodes == 1).all(axis=1))[0])
    a, b = np.meshgrid(*2 * [np.linspace(0.0, 2.0 * np.pi, 97)])
    waves = [np.exp(1j * ((i - 1) * a + (j - 1) * b)) for i, j, _ in nodes]

    def growth(ratio: float) -> float:
        stencil = (-time / ratio + space * ratio)[middle]
        before, here, after = (
            sum(s * w for s, w, node in zip(stencil, waves, nodes, strict=True) if node[2] == k)
            for k in range(3)
        )
        root = np.sqrt(here**2 - 4.0 * after * before)
        with np.errstate(divide="ignore", invalid="ignore"):
            z = np.stack([(-here + root) / (2.0 * after), (-here - root) / (2.0 * after)])
        return float(np.nan_to_num(np.abs(z), nan=np.inf).max())

    return _largest(growth)


def _largest(growth: Callable[[float], float], low: float = 0.05, high: float = 2.0) -> float:
    """Bisect for the largest ratio c dt / h with growth <= 1."""
    while high - low > 1e-4:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if growth(middle) <= 1.0 + _ROUNDING else (low, middle)
    return low


if __name__ == "__main__":
    for name in CELLS:
        print(name, symbol_limit(name), *(block_limit(name, n) for n in (4, 8)))
