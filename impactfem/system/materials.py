"""Constants of the material of each cell of a body: of its group of elements, or by formulas.

A formula has its mean in each cell, so that masses are those of the formula; displacements of
degree 2 then see a material that varies in steps, to second order in the size of the cells.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from impactfem import fem
from impactfem.arrays import Booleans, Floats
from impactfem.errors import SceneError
from impactfem.fem import MPI, dolfinx_fem
from impactfem.scene.formula import Formula
from impactfem.scene.solid_checks import VARYING
from impactfem.scene.solids import NEARLY_INCOMPRESSIBLE
from impactfem.system.law_kernels import KERNELS
from impactfem.system.nodes import Nodes

_DEGREE = 4  # of formulas that means in cells are exact for
_AXES = "xyz"
_POSITIVE = 0.0, math.inf, "positive"
_STIFF = (
    "body {name}: {key} exceeds 0.45 somewhere, where elements that keep their volume at each "
    'point lock: give element = "mean_dilatation", or a formula of at most 0.45'
)


@dataclass(frozen=True)
class CellMaterials:
    """Constants of the cells of this rank, ghosts included, shape (cells,) each.

    Attributes:
        density: [kg/m^3].
        modulus: Young's [Pa].
        ratio: Poisson's.
        c01: Of Mooney's and Rivlin's law [Pa].
        linear: Whether the law is linear.
        keeps: Whether the volume is kept in the mean of the cell only.
        damped: Time of retardation as a share of the longest of the body.
        stiffest: Density times the square of the speed of the fastest waves, at once [Pa].
        whole: Stress by strain in space [Pa], (cells, 6, 6), as `OrthotropicSolid.stiffness`, of
            bodies that are orthotropic somewhere; of others (cells, 0, 0).
        terms: Of Ogden's law, mu [Pa], alpha and beta of each, (cells, 3 terms); mu = 0: no term.
    """

    density: Floats
    modulus: Floats
    ratio: Floats
    c01: Floats
    linear: Booleans
    keeps: Booleans
    damped: Floats
    stiffest: Floats
    whole: Floats
    terms: Floats

    @property
    def shear(self) -> Floats:
        """Mu [Pa]."""
        return self.modulus / (2.0 * (1.0 + self.ratio))

    @property
    def lame(self) -> Floats:
        """Lambda [Pa]."""
        nu = self.ratio
        return self.modulus * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def bulk(self) -> Floats:
        """What of lambda the mean of the volume of a cell is asked for [Pa]."""
        return np.where(self.keeps, self.lame - 4.0 * self.c01, 0.0)

    @property
    def local(self) -> Floats:
        """What of lambda acts at points under finite strain [Pa]."""
        return np.where(self.keeps, 4.0 * self.c01, self.lame)

    def at(self, cells: Any) -> "CellMaterials":
        """Those of some cells, or of one."""
        return CellMaterials(*(getattr(self, entry.name)[cells] for entry in fields(self)))


def materials_of(nodes: Nodes, solid: Any) -> CellMaterials:
    """Constants of each cell (collective).

    Raises:
        SceneError: A formula has a value that is not positive; on every rank.
    """
    topology = nodes.space.mesh.topology
    cells = topology.index_map(topology.dim)
    count = cells.size_local + cells.num_ghosts
    if solid.is_uniform:
        values = (
            solid.density, solid.youngs_modulus, solid.poisson_ratio, solid.c01 or 0.0,
            solid.material == "linear", solid.keeps_volume, 1.0,
        )  # fmt: skip
        found = [np.broadcast_to(value, count) for value in values]
        return _with_waves(found, solid, {"": slice(None)})
    means = _Means(nodes)
    groups = nodes.groups if solid.materials else {"": np.arange(count, dtype=np.int32)}
    found = [np.zeros(count) for _ in range(4)] + [np.zeros(count, dtype=bool) for _ in range(2)]
    damped, longest = np.ones(count), solid.retardation
    error = None
    for name, own in groups.items():
        one = solid.of_groups[name] if solid.materials else solid
        where = f"materials.{name}." if solid.materials else ""
        try:
            numbers = [means.of(getattr(one, key), own, f"{solid.name}: {where}{key}")
                       for key in VARYING]  # fmt: skip
        except SceneError as told:
            error = told
            break
        if one.element is None and isinstance(one.poisson_ratio, Formula):
            above = np.asarray(numbers[2]) > NEARLY_INCOMPRESSIBLE
            if above.any():
                error = SceneError(_STIFF.format(name=solid.name, key=f"{where}poisson_ratio"))
        constants = one.c01 or 0.0, one.material == "linear", one.keeps_volume
        for column, value in zip(found, (*numbers, *constants), strict=True):
            column[own] = value
        damped[own] = one.rayleigh_stiffness / longest if longest else 1.0
    fem.raise_together(nodes.comm, error)
    return _with_waves([*found, damped], solid, groups)


def _with_waves(found: list[Any], solid: Any, groups: Mapping[str, Any]) -> CellMaterials:
    """Constants with what follows from them, and the stiffness of orthotropic bodies."""
    count = len(found[0])
    each = {name: solid.of_groups[name] if name else solid for name in groups}
    terms = np.zeros((count, 3 * max(len(one.spectral) for one in each.values())))
    made = CellMaterials(*(*found, np.zeros(0), np.zeros((count, 0, 0)), terms))
    stiffest, whole = np.array(_pressing(made, solid.model)), made.whole
    if solid.is_orthotropic:
        whole = np.zeros((count, 6, 6))
        whole[:, :3, :3] = made.lame[:, None, None]
        for i in range(3):
            whole[:, i, i] += 2.0 * made.shear
            whole[:, i + 3, i + 3] = made.shear
    for name, one in each.items():
        own, law = groups[name], one.orthotropic
        terms[own, : 3 * len(one.spectral)] = np.ravel(one.spectral)
        if law is not None:
            whole[own], stiffest[own] = law.stiffness, law.wave_moduli(solid.model)[0]
        stiffest[own] *= one.at_once
    return replace(made, stiffest=stiffest, whole=whole)


def _pressing(made: CellMaterials, model: str) -> Floats:
    """Modulus of waves of pressure in bodies that are alike in all directions [Pa]."""
    if model == "plane_stress":
        return made.modulus / ((1 - made.ratio) * (1 + made.ratio))
    return made.lame + 2.0 * made.shear


def first_lame(material: CellMaterials, model: str) -> Floats:
    """Lambda [Pa] that the forms of a model have: of plane stress the reduced one."""
    nu = material.ratio
    # 2 lambda mu / (lambda + 2 mu) = 2 mu nu / (1 - nu) without the cancellation near nu = 1/2.
    return 2.0 * material.shear * nu / (1.0 - nu) if model == "plane_stress" else material.lame


class _Means:
    """Means of formulas in cells."""

    def __init__(self, nodes: Nodes) -> None:
        self._nodes = nodes
        mesh = nodes.space.mesh
        name, degree = mesh.topology.cell_type.name, int(nodes.space.ufl_element().degree)
        points, self._parts = fem.cell_quadrature(name, _DEGREE + degree)
        self._values, self._grads = fem.coordinate_basis(name, degree, points)

    def of(self, given: float | Formula, cells: Any, what: str) -> float | Floats:
        """A number, or the mean of a formula in each of some cells.

        Raises:
            SceneError: It is not positive at a point, or no Poisson's ratio.
        """
        if not isinstance(given, Formula):
            return given
        corners = self._nodes.positions[self._nodes.space.dofmap.list[cells]]
        jacobian = np.einsum("cki,jpk->cpij", corners, self._grads)
        weights = np.abs(np.linalg.det(jacobian)) * self._parts
        x = np.einsum("pk,cki->cpi", self._values, corners)
        named = {axis: x[:, :, k] for k, axis in enumerate(_AXES[: x.shape[2]])}
        values = np.broadcast_to(np.asarray(given(**named), dtype=np.float64), weights.shape)
        low, high, kind = (-1.0, 0.5, "between -1 and 0.5") if what.endswith("ratio") else _POSITIVE
        bad = np.argwhere(~((values > low) & (values < high)))
        if len(bad):
            at = tuple(bad[0])
            place = ", ".join(f"{c:.4g}" for c in x[at])
            raise SceneError(
                f"body {what} = {given.text!r} is {values[at]:g} at ({place}); give a formula "
                f"that is {kind} in the whole body"
            )
        found: Floats = (weights * values).sum(axis=1) / weights.sum(axis=1)
        return found


def relaxing_of(nodes: Nodes, solid: Any) -> tuple[Floats, Floats]:
    """Times of relaxation of the Maxwell terms of a body, and what share each cell has of them.

    Args:
        nodes: Nodes of the body.
        solid: The body.

    Returns:
        Times [s], (terms,), and shares, (terms, cells).
    """
    topology = nodes.space.mesh.topology
    cells = topology.index_map(topology.dim)
    groups = nodes.groups if solid.materials else {"": slice(None)}
    each = {name: (solid.of_groups[name] if name else solid).relaxing for name in groups}
    every = solid.of_groups.values() if solid.materials else (solid,)
    times = sorted({time for one in every for _, time in one.relaxing})
    shares = np.zeros((len(times), cells.size_local + cells.num_ghosts))
    for name, own in groups.items():
        for share, time in each[name]:
            shares[times.index(time), own] += share
    return np.array(times), shares


def law_rows(material: CellMaterials, solid: Any, first: Floats) -> Floats:
    """Materials of cells as `impactfem.system.law_kernels.stress` takes them, (cells, entries).

    Args:
        material: Of the cells.
        solid: The body.
        first: Lambda that acts at points [Pa], (cells,).
    """
    whole, terms = material.whole.reshape(len(first), -1), material.terms
    # The bulk modulus of foams is all in their terms.
    first = np.where(terms[:, 2::3].any(axis=1), 0.0, first)
    linear = KERNELS["orthotropic" if whole.size else "linear"]
    other = np.where(terms.any(axis=1), KERNELS["ogden"], KERNELS["mooney_rivlin"])
    law = np.where(material.linear, linear, other)
    flat = np.full(len(first), float(solid.model == "plane_stress"))
    more = np.zeros((len(first), max(whole.shape[1], terms.shape[1])))
    more[:, : terms.shape[1]] = terms
    if whole.size:
        more[material.linear] = whole[material.linear]
    head = np.stack([law, flat, first, material.shear, material.c01], axis=1)
    return np.ascontiguousarray(np.hstack([head, more]))


def constants_of(nodes: Nodes, solid: Any) -> Callable[[Any], Any]:
    """What makes UFL coefficients of values of all cells, (cells, ...)."""
    if solid.is_uniform:
        return lambda values: dolfinx_fem.Constant(nodes.space.mesh, np.array(values[0]))

    def function(values: Floats) -> Any:
        element = ("Discontinuous Lagrange", 0, *[values.shape[1:]] * (values.ndim > 1))
        made = dolfinx_fem.Function(dolfinx_fem.functionspace(nodes.space.mesh, element))
        places = np.ravel(made.function_space.dofmap.list)
        made.x.array.reshape(len(values), -1)[places] = values.reshape(len(values), -1)
        return made

    return function


@dataclass(frozen=True)
class StandIns:
    """Bodies of one material in place of one of several, for what is foreseen.

    Attributes:
        fastest: Whose waves cross its elements in the least time of all.
        softest: Whose waves are the slowest.
        least: Shortest edge [m] by which that time follows from the speed of the fastest; None: as
            the mesh has it.
    """

    fastest: Any
    softest: Any
    least: float | None = None


def stand_ins(nodes: Nodes, solid: Any) -> StandIns:
    """What stands in for a body whose material is not the same everywhere (collective)."""
    mesh, comm = nodes.space.mesh, nodes.comm
    own = mesh.topology.index_map(mesh.topology.dim).size_local
    each = materials_of(nodes, solid).at(slice(own))
    corners = nodes.positions[nodes.space.dofmap.list[:own]]
    corners = corners[:, : fem.num_vertices(mesh.topology.cell_type.name)]
    first, second = np.triu_indices(corners.shape[1], 1)
    edges = np.linalg.norm(corners[:, first] - corners[:, second], axis=2).min(
        axis=1, initial=np.inf
    )
    speed = np.sqrt(each.stiffest / each.density)
    # Pressure in cells that keep their volume is levelled out by waves that steps do not follow.
    shear = each.shear * each.stiffest / _pressing(each, solid.model)
    leading = np.where(each.keeps, np.sqrt(shear / each.density), speed)

    def alike(keys: Floats) -> Any:
        """The body of the material for which keys are least, the same on all ranks."""
        best = int(np.argmin(keys)) if own else 0
        mine = None
        if own:
            # Of orthotropic cells waves count, and of those that relax what they are at once.
            modulus = each.modulus[best] * (each.stiffest / _pressing(each, solid.model))[best]
            numbers = keys[best], each.density[best], modulus, each.ratio[best]
            mine = (*(float(f"{value:.9g}") for value in numbers), bool(each.linear[best]))
        _, density, modulus, ratio, linear = min(told for told in comm.allgather(mine) if told)
        law = "linear" if linear else "neo_hookean"
        return replace(
            solid, materials={}, density=density, youngs_modulus=modulus, poisson_ratio=ratio,
            rayleigh_stiffness=solid.retardation,
            viscoelastic=None, quality_factor=None, damping_ratio=None, damping=None,
            orthotropic=None, material=law, c10=None, c01=None, bulk_modulus=None, terms=(),
            strain="finite" if solid.is_finite else "small",
        )  # fmt: skip

    fastest = alike(edges / leading)
    least = comm.allreduce(float((edges / speed).min(initial=math.inf)), op=MPI.MIN)
    return StandIns(fastest, alike(speed), float(f"{fastest.p_wave_speed * least:.6g}"))
