"""Derivatives of sums of u . K v and u . M v by stiffness and mass of each triangle of a plate.

With sums S = sum u_e v_e^T of the products of its coordinates the derivative by K_e is S itself: a
change dK_e counts S : dK_e, whatever makes it, as thickness, moduli, layers, tension or shear.
"""

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.plate import Plate
from impactfem.system.kirchhoff import DOFS, Triangles
from impactfem.system.plate import PlateSystem
from impactfem.system.plate_making import thicknesses
from impactfem.system.plate_mesh import PlateMesh

_AT_ONCE = 2**21  # coordinates of elements that are summed up together


def plate_numbers(plate: Plate, mesh: PlateMesh, *, shears: bool) -> Floats:
    """Stiffness of the triangles and, by their area, mass [kg/m^2] and rotary inertia [kg].

    Returns:
        Shape (83, cells): of the stiffness [N/m, N, N m] 9 rows after the other.

    Raises:
        SceneError: The thickness is none somewhere, or too large for its theory.
    """
    section, thickness = plate.section, thicknesses(plate, mesh)
    ratio = thickness[mesh.cells].mean(axis=1) / section.thickness
    triangles = Triangles(mesh, section, ratio, shears)
    each = triangles.elements
    if plate.residual_stress:
        each = each + plate.residual_stress * triangles.tension(section.thickness)
    turning = section.turning * ratio**3 * shears
    return np.vstack([each.reshape(len(ratio), -1).T, section.mass * ratio, turning])


class PlateSlopes:
    """Sums of products of coordinates, and their derivatives by `plate_numbers`."""

    def __init__(self, bodies: PlateSystem) -> None:
        """Take a plate."""
        self._bodies, mesh = bodies, bodies.mesh
        self._corners = (DOFS * mesh.cells[:, :, None] + np.arange(DOFS)).reshape(-1, 3 * DOFS)
        self._stiff = np.zeros((len(mesh.cells), 3 * DOFS, 3 * DOFS))
        self._heavy, self._turning = np.zeros((2, len(mesh.points)))  # by the mass of vertices
        self._waiting: list[tuple[Floats, Floats]] = []
        self._room = max(1, _AT_ONCE // self._corners.size)

    def stiff(self, one: Floats, other: Floats) -> None:
        """Add one . K other, (d,) each."""
        self._waiting.append((one, other))
        if len(self._waiting) >= self._room:
            self._sum_up()

    def heavy(self, one: Floats, other: Floats) -> None:
        """Add one . M other, (d,) each."""
        product, basis = one * other, self._bodies.basis
        self.weigh(product)
        if self._bodies.shears:
            self._turning += sum(basis[k::DOFS].power(2) @ product for k in (1, 2))

    def weigh(self, values: Floats) -> None:
        """Add the sum of the masses of deflections times values, (d,)."""
        self.weigh_vertices(self._bodies.transfer @ self._bodies.deflection(values))

    def weigh_vertices(self, values: Floats) -> None:
        """Add the sum of the masses of vertices, before any is moved, times values, (vertices,)."""
        self._heavy += values

    def weigh_whole(self, factor: float) -> None:
        """Add a factor times the mass of the plate."""
        self._heavy += factor

    def by_material(self) -> Floats:
        """Derivatives by the numbers of the triangles, (83, cells)."""
        self._sum_up()
        mesh = self._bodies.mesh
        each = (mesh.areas * at[mesh.cells].mean(axis=1) for at in (self._heavy, self._turning))
        return np.vstack([self._stiff.reshape(len(mesh.cells), -1).T, *each])

    def _sum_up(self) -> None:
        if not self._waiting:
            return
        ones, others = (self._cornered(np.array(each)) for each in zip(*self._waiting, strict=True))
        self._waiting.clear()
        self._stiff += np.matmul(ones.transpose(1, 2, 0), others.transpose(1, 0, 2))

    def _cornered(self, q: Floats) -> Floats:
        """Of corners, but for what moves all alike, which strains nothing; (several, cells, 9)."""
        found = np.asarray((self._bodies.basis @ q.T).T[:, self._corners])
        found[..., ::DOFS] -= found[..., ::DOFS].mean(axis=-1, keepdims=True)
        return found
