"""Mass and stiffness of a straight free beam: axial, deflection and rotation of its nodes.

Coordinates: (axial a_k, deflection w_k, rotation r_k) of the nodes k = 0..n one after the other,
then inner ones of the elements, if any. Axial displacements are P1. Source of the Hermite matrices:
J. S. Przemieniecki, Theory of Matrix Structural Analysis (Dover, 1985), chapters 5 and 11.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.scene.beams import Beam


@dataclass(frozen=True)
class BeamMatrices:
    """A beam after discretisation along its axis; s is measured from its middle.

    Attributes:
        mass: M (d, d), consistent.
        stiffness: K (d, d).
        nodes: s of the nodes [m], shape (n + 1,).
        deflections: Coordinates that are deflections, shape (deflections,).
        places: s of these [m], shape (deflections,).
        rotations: Coordinates that are rotations, shape (rotations,).
        turning_places: s of these [m], shape (rotations,).
    """

    mass: Floats
    stiffness: Floats
    nodes: Floats
    deflections: NDArray[np.int64]
    places: Floats
    rotations: NDArray[np.int64]
    turning_places: Floats

    def strains(self, u: Floats) -> tuple[Floats, Floats]:
        """Stretch a' and curvature r' of the elements [-, 1/m], (..., elements), by u (..., d)."""
        at, h = 3 * np.arange(len(self.nodes)), np.diff(self.nodes)
        return np.diff(u[..., at], axis=-1) / h, np.diff(u[..., at + 2], axis=-1) / h

    def section(self, s: float) -> Floats:
        """Axial displacement, deflection [m] and rotation at s by the coordinates, (3, d)."""
        found, nodes = np.zeros((3, len(self.mass))), self.nodes
        k = int(np.clip(np.searchsorted(nodes, s) - 1, 0, len(nodes) - 2))
        h = nodes[k + 1] - nodes[k]
        x = (s - nodes[k]) / h
        found[0, [3 * k, 3 * k + 3]] = 1.0 - x, x
        if len(self.places) == len(nodes):  # cubic Hermite elements: the rotation is the slope
            own = 3 * k + np.array([1, 2, 4, 5])
            found[1, own] = (
                1 - 3 * x**2 + 2 * x**3, h * x * (1 - x) ** 2, 3 * x**2 - 2 * x**3,
                h * x**2 * (x - 1),
            )  # fmt: skip
            found[2, own] = (
                6 * x * (x - 1) / h, (1 - x) * (1 - 3 * x), 6 * x * (1 - x) / h, x * (3 * x - 2)
            )  # fmt: skip
            return found
        fields = ((self.deflections, self.places), (self.rotations, self.turning_places))
        for row, (coordinates, places) in enumerate(fields, start=1):
            own = np.flatnonzero(np.abs(places - 0.5 * (nodes[k] + nodes[k + 1])) < 0.6 * h)
            found[row, coordinates[own]] = _lagrange(places[own], s)
        return found


def _lagrange(places: Floats, s: float) -> Floats:
    """Values at s of the polynomials that are 1 at one of some places and 0 at the others."""
    off = np.eye(len(places), dtype=bool)
    return np.asarray(
        np.where(off, 1.0, s - places).prod(axis=1)
        / np.where(off, 1.0, places[:, None] - places).prod(axis=1)
    )


def hermite_mass(h: float, line_mass: float, rotary_inertia: float) -> Floats:
    """Consistent mass of (w_0, r_0, w_1, r_1) on an element of length h, shape (4, 4)."""
    line = np.array(
        [
            [156.0, 22 * h, 54.0, -13 * h],
            [22 * h, 4 * h * h, 13 * h, -3 * h * h],
            [54.0, 13 * h, 156.0, -22 * h],
            [-13 * h, -3 * h * h, -22 * h, 4 * h * h],
        ]
    )
    rotary = np.array(
        [
            [36.0, 3 * h, -36.0, 3 * h],
            [3 * h, 4 * h * h, -3 * h, -h * h],
            [-36.0, -3 * h, 36.0, -3 * h],
            [3 * h, -h * h, -3 * h, 4 * h * h],
        ]
    )
    return line_mass * h / 420.0 * line + rotary_inertia / (30.0 * h) * rotary


def hermite_stiffness(h: float, bending_stiffness: float) -> Floats:
    """Stiffness of (w_0, r_0, w_1, r_1) on an element of length h, shape (4, 4)."""
    return (
        bending_stiffness
        / h**3
        * np.array(
            [
                [12.0, 6 * h, -12.0, 6 * h],
                [6 * h, 4 * h * h, -6 * h, 2 * h * h],
                [-12.0, -6 * h, 12.0, -6 * h],
                [6 * h, 2 * h * h, -6 * h, 4 * h * h],
            ]
        )
    )


def euler_bernoulli(beam: Beam, *, rotary: bool = False) -> BeamMatrices:
    """Cubic Hermite elements without shear.

    Args:
        beam: The beam.
        rotary: Whether the sections have rotary inertia (Rayleigh's beam).
    """
    n = beam.elements
    h, line_mass = beam.length / n, beam.density * beam.area
    mass, stiffness = _axial(beam, 3 * (n + 1))
    inertia = beam.density * beam.second_moment if rotary else 0.0
    local_mass = hermite_mass(h, line_mass, inertia)
    local_stiffness = hermite_stiffness(h, beam.youngs_modulus * beam.second_moment)
    for k in range(n):
        dofs = np.ix_(*[3 * k + np.array([1, 2, 4, 5])] * 2)
        mass[dofs] += local_mass
        stiffness[dofs] += local_stiffness
    nodes = _nodes(beam)
    first = 3 * np.arange(n + 1)
    return BeamMatrices(mass, stiffness, nodes, first + 1, nodes, first + 2, nodes)


def timoshenko(beam: Beam, degree: int = 2) -> BeamMatrices:
    """Elements with shear and rotary inertia, assembled by DOLFINx.

    Args:
        beam: The beam.
        degree: k of the rotations; deflections have k + 1.
    """
    # DOLFINx takes a second to load: only those who ask for shear wait.
    from basix.ufl import element, mixed_element  # noqa: PLC0415

    from impactfem import fem  # noqa: PLC0415
    from impactfem.forms.beam import TimoshenkoForms  # noqa: PLC0415

    mesh = fem.dolfinx_mesh.create_interval(
        fem.MPI.COMM_SELF, beam.elements, [-0.5 * beam.length, 0.5 * beam.length]
    )
    pair = [element("Lagrange", "interval", degree + 1), element("Lagrange", "interval", degree)]
    space = fem.dolfinx_fem.functionspace(mesh, mixed_element(pair))
    section = (beam.density * beam.area, beam.density * beam.second_moment)
    elastic = (beam.youngs_modulus * beam.second_moment, beam.shear_stiffness)
    data = [fem.dolfinx_fem.Constant(mesh, float(entry)) for entry in (*section, *elastic)]
    forms = TimoshenkoForms(space, *data)
    parts = [space.sub(i).collapse() for i in range(2)]
    places = [part.tabulate_dof_coordinates()[:, 0] for part, _ in parts]
    # The nodes' coordinates first, then the inner ones, both along the axis.
    nodes = _nodes(beam)
    order = [_nodes_first(x, nodes) for x in places]
    old = np.concatenate([np.ravel(parts[i][1])[order[i]] for i in range(2)])
    new = [_coordinates(order[i], len(nodes), 1 + i) for i in range(2)]
    inner = 3 * len(nodes)
    new[1][len(nodes) :] += len(order[0]) - len(nodes)
    mass, stiffness = _axial(beam, inner + len(old) - 2 * len(nodes))
    numbers = np.empty(len(old), dtype=np.int64)
    numbers[old] = np.concatenate(new)
    for matrix, form in ((mass, forms.mass), (stiffness, forms.stiffness)):
        rows, columns, values = fem.assemble_rows(fem.compile_form(form))
        np.add.at(matrix, (numbers[rows], numbers[columns]), values)
    return BeamMatrices(
        mass, stiffness, nodes, new[0], places[0][order[0]], new[1], places[1][order[1]]
    )


def beam_matrices(beam: Beam) -> BeamMatrices:
    """Matrices of the beam's theory; an Euler-Bernoulli beam has no rotary inertia."""
    return timoshenko(beam) if beam.theory == "timoshenko" else euler_bernoulli(beam)


def _nodes(beam: Beam) -> Floats:
    return np.linspace(-0.5 * beam.length, 0.5 * beam.length, beam.elements + 1)


def _axial(beam: Beam, size: int) -> tuple[Floats, Floats]:
    """Mass and stiffness (size, size) with the entries of P1 bar elements."""
    line_mass, stiffness = beam.density * beam.area, beam.youngs_modulus * beam.area
    return linear_elements(beam, line_mass, stiffness, size, stride=3)


def linear_elements(
    beam: Beam, line_mass: float, stiffness: float, size: int, stride: int = 1
) -> tuple[Floats, Floats]:
    """Mass and stiffness (size, size) with the entries of P1 elements along a beam.

    Args:
        beam: The beam.
        line_mass: By length [kg/m], of twists [kg m].
        stiffness: By strain [N], of twists by rate of twist [N m^2].
        size: Number of coordinates.
        stride: From node to node among these.
    """
    h, mass, stiff = beam.length / beam.elements, np.zeros((size, size)), np.zeros((size, size))
    local_mass = line_mass * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    local = stiffness / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
    for first in range(0, stride * beam.elements, stride):
        dofs = np.ix_([first, first + stride], [first, first + stride])
        mass[dofs] += local_mass
        stiff[dofs] += local
    return mass, stiff


def _nodes_first(places: Floats, nodes: Floats) -> NDArray[np.int64]:
    """Order of dofs with those at nodes first, each group along the axis."""
    near = np.abs(places[:, None] - nodes).min(axis=1) < 1e-6 * (nodes[1] - nodes[0])
    return np.lexsort((places, ~near)).astype(np.int64)


def _coordinates(order: NDArray[np.int64], nodes: int, part: int) -> NDArray[np.int64]:
    """Numbers of the coordinates of one field, as if it alone had inner ones."""
    own = 3 * np.arange(nodes) + part
    inner = 3 * nodes + np.arange(len(order) - nodes)
    return np.concatenate((own, inner)).astype(np.int64)
