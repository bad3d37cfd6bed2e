"""What a run of a solid costs, before it starts: steps, products, memory, time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactfem.findings import Finding
from impactfem.scene import Scene
from impactfem.scene.solids import Solid
from impactfem.sizing import check_memory

NATURAL_STEP = 0.35
"""c_p dt / h_min of the default explicit step, .9 of the stable one, on meshes of fair quality."""

SHARE_OF_STABLE = 0.9
"""Courant number of explicit schemes, as a share of the stable step, unless given."""

# Nodes that share an element with a node, itself included; by (dim, degree, cells).
_NEIGHBOURS = {
    (2, 1, "simplex"): 7.0, (2, 2, "simplex"): 11.5, (2, 1, "hexahedron"): 9.0,
    (2, 2, "hexahedron"): 16.0, (3, 1, "simplex"): 15.0, (3, 2, "simplex"): 28.0,
    (3, 1, "hexahedron"): 27.0, (3, 2, "hexahedron"): 64.0,
}  # fmt: skip

# Costs on a 2-core machine, one rank, fitted to discs and balls with 800 to 73 000 unknowns.
_SOLVE = {2: 20.0, 3: 60.0}  # a solution with the factors, in products with the stiffness
_MULTIGRID = 110.0  # the same with multigrid: iterations and cycles
_MULT_SECONDS = 1.5e-9  # of an entry of the stiffness in a product
_STEP_SECONDS = 1e-3  # of a step in contact, whatever its size
_CONTACT_SECONDS = 5e-6  # of a contact node in a step
_TOUCHED = {2: 0.3, 3: 0.1}  # share of the contact nodes that do touch: each answers once
_START_SECONDS, _MESH_SECONDS = 1.0, 3e-5  # of forms and numbering, and of an unknown of the mesh
_BASE_MIB = 280.0  # of the process with DOLFINx and Gmsh
_NODE_KIB = 1.2  # of a node in Gmsh, when the mesh is made
_ENTRY_BYTES = 45.0  # of an entry of the stiffness: matrices, vectors and assembly
_FILL = {2: 3.0, 3: 6.0}  # entries of the factors per entry of the stiffness and log2 / third root
_ROW_BYTES = 500.0  # of a layer in the history: rows of the march, columns, their writing


@dataclass(frozen=True)
class Size:
    """How large a discretised body is.

    Attributes:
        nodes: Number of nodes.
        dim: Number of coordinates.
        degree: Degree of the elements.
        cells: "simplex" or "hexahedron".
        mesh_size: Typical length of an edge [m].
        least: Shortest edge [m].
    """

    nodes: int
    dim: int
    degree: int
    cells: str
    mesh_size: float
    least: float

    @property
    def unknowns(self) -> int:
        """Number of displacement components."""
        return self.nodes * self.dim

    @property
    def entries(self) -> float:
        """Entries of the stiffness."""
        neighbours = _NEIGHBOURS[self.dim, self.degree, self.cells]
        return self.unknowns * self.dim * neighbours

    def scaled(self, factor: float) -> "Size":
        """The same body with elements so many times as large."""
        nodes = max(1, round(self.nodes / factor**self.dim))
        return replace(
            self, nodes=nodes, mesh_size=factor * self.mesh_size, least=factor * self.least
        )


def leading_speed(solid: Solid) -> float:
    """Speed of the waves that implicit steps resolve [m/s].

    Those of pressure are the fastest. In nearly incompressible bodies they level out the pressure
    long before anything has moved: then those of shear count.
    """
    return solid.s_wave_speed if solid.keeps_volume else solid.p_wave_speed


def damped(step: float, rayleigh_stiffness: float) -> float:
    """What damping by the stiffness leaves of a stable step 2 / omega [s]."""
    share = rayleigh_stiffness / step
    return step / (math.hypot(1.0, share) + share)


def explicit_step(solids: Sequence[Solid], sizes: Sequence[Size]) -> float:
    """The default step of explicit schemes [s], about: the least of all bodies."""
    return SHARE_OF_STABLE * min(
        damped(
            NATURAL_STEP * size.least / (SHARE_OF_STABLE * solid.p_wave_speed),
            solid.rayleigh_stiffness,
        )
        for solid, size in zip(solids, sizes, strict=True)
    )


def explicit_work(solids: Sequence[Solid], sizes: Sequence[Size], duration: float) -> float:
    """Products with the stiffnesses of all bodies that central differences take."""
    return duration / explicit_step(solids, sizes)


def implicit_work(
    solids: Sequence[Solid], sizes: Sequence[Size], duration: float, courant: float
) -> float:
    """The same of an implicit scheme, its factorisations included."""
    pairs = zip(solids, sizes, strict=True)
    dt = courant * min(size.mesh_size / leading_speed(solid) for solid, size in pairs)
    entries = sum(size.entries for size in sizes)
    once = sum(factorisation_work(size) * size.entries for size in sizes) / entries
    return duration / dt * _SOLVE[sizes[0].dim] + once


def factorisation_work(size: Size) -> float:
    """Products with the stiffness that last as long as its factorisation by nested dissection."""
    # Work n^(3/2) in 2D, n^2 in 3D; a product takes n.
    n = float(size.unknowns)
    return 100.0 + (2.0 * math.sqrt(n) if size.dim == 2 else 0.03 * n)


def factor_mib(size: Size) -> float:
    """Memory of the factors [MiB]."""
    growth = math.log2(size.unknowns + 2) / 8.0 if size.dim == 2 else size.unknowns ** (1 / 3) / 12
    return 12.0 * size.entries * _FILL[size.dim] * growth / 2**20


def memory_mib(sizes: Sequence[Size], linear_solver: str) -> float:
    """Estimated peak memory of all bodies and ranks together [MiB].

    Raises:
        SceneError: The machine has less.
    """
    total = _BASE_MIB
    for size in sizes:
        own = size.nodes * _NODE_KIB / 1024 + _ENTRY_BYTES * size.entries / 2**20
        total += own + {"none": 0.0, "mumps": factor_mib(size), "gamg": 0.6 * own}[linear_solver]
    _check(total, sum(size.unknowns for size in sizes))
    return total


_KERNEL_SECONDS = {2: 4e-7, 3: 9e-7}  # of a node in an explicit step under finite strain
_ITERATES = 2.0  # times a linear layer, measured 1.6 to 2.7
# Of an unknown in a step under finite strain, without factorisation: its iterates, and answers of
# contact nodes.
_NEWTON_SECONDS = {2: 5e-6, 3: 3.5e-5}


def seconds(
    size: Size,
    steps: float,
    contact: int,
    linear_solver: str,
    ranks: int,
    *,
    finite: bool = False,
    iterates: bool = False,
) -> float:
    """Estimated time of a body [s]: mesh, assembly, factorisation, steps, answers of its nodes.

    Under finite strain each implicit step has a factorisation and some iterates; of small strains
    steps by iterates look at pairs that follow several times, and solve twice.
    """
    product = size.entries * _MULT_SECONDS / ranks
    each = {"none": 1.5, "mumps": _SOLVE[size.dim], "gamg": _MULTIGRID}[linear_solver]
    once = 300.0 + (factorisation_work(size) if linear_solver == "mumps" else 0.0)
    if linear_solver != "none":  # answers of explicit contact nodes are local
        once += each * size.dim * contact * _TOUCHED[size.dim]
    start = _START_SECONDS + _MESH_SECONDS * size.unknowns
    step = _STEP_SECONDS + _CONTACT_SECONDS * contact + each * product
    if finite and linear_solver == "none":
        step += _KERNEL_SECONDS[size.dim] * size.nodes / ranks
    elif finite:
        step += factorisation_work(size) * product + _NEWTON_SECONDS[size.dim] * size.unknowns
    elif iterates:
        step *= _ITERATES
    return start + once * product + steps * step


def check_before_meshing(solid: Solid, degree: int) -> None:
    """Refuse a mesh that no machine like this one could hold, before Gmsh tries.

    Raises:
        SceneError: The machine has too little memory for the nodes alone.
    """
    shape, h = solid.shape, solid.mesh_size
    if shape is None or h is None:
        return
    # Equilateral triangles and tetrahedra have about so many nodes in the square and cube of h.
    nodes = {2: 1.15, 3: 1.4}[solid.dim] * degree**solid.dim
    count = nodes * shape.volume / h**solid.dim
    for ball in solid.refine:
        whole = math.pi * ball.radius**2 * (1.0 if solid.dim == 2 else 4 / 3 * ball.radius)
        count += nodes * min(whole, shape.volume) / ball.size**solid.dim
    needed = _BASE_MIB + count * _NODE_KIB / 1024
    _check(needed, count * solid.dim)


def count_layers(duration: float, dt: float) -> int:
    """Number of layers of ``dt`` [s] in a duration [s]; one less for rounding.

    Raises:
        SceneError: Their history would not fit into the machine's memory.
    """
    count = duration / dt * (1.0 - 1e-9)
    needed = count * _ROW_BYTES / 2**20
    what = f"the rows of {count:.3g} time steps of {dt:.3g} s in the history"
    remedy = "a shorter duration, larger elements or a larger solve.dt (check the units)"
    check_memory(needed, f"duration = {duration:g} s", what, remedy)
    return max(1, math.ceil(count))


def late_ends(scene: Scene, dt: float | None, *, amid: bool) -> list[Finding]:
    """Supports that steps of a length [s] cannot let go when they should; see `on_samples`."""
    found: list[Finding] = []
    if dt is None:
        return found
    for end in scene.ends:
        at = end / dt + 0.5 * amid * (end > 0.0)
        if abs(at - round(at)) > _SOON:
            where = "amid" if amid else "the end of"
            when = f"{(round(at) - 0.5 * amid) * dt:.6g} s, {where} a time step"
            text = f"supports let go at t = {when}, instead of {end:g} s"
            remedy = "leave solve.dt out, or give one of which it is a multiple"
            found.append(Finding("load_unresolved", "note", text, remedy=remedy))
    return found


def _check(needed: float, unknowns: float) -> None:
    """Refuse what cannot fit."""
    check_memory(
        needed,
        "body.mesh_size",
        f"{unknowns:.3g} unknowns",
        'larger elements, a symmetry of the shape, degree = 1, or solve.method = "explicit", which '
        "factorises nothing",
    )


_FEW_MORE = 64  # time steps that may be added so that some end with what happens
_SOON, _BESIDE = 0.05, 0.01  # of a step, by which they may miss it


def on_samples(
    scene: Scene, layers: int, reasons: dict[str, str] | None = None, amid: float = 0.0
) -> int:
    """Number of time steps that end with the samples of controllers, if the duration does.

    Without any they end where supports let go, as near as a few more do.

    Args:
        scene: The scene; a step that it gives stays.
        layers: As many steps as are needed, that fill the duration.
        reasons: Gets the reason.
        amid: Part of a step before whose end forces begin to act.
    """
    ends = np.array([end for end in scene.ends if end > 0.0]) / scene.duration
    if len(ends) and not scene.sampled and scene.solve.dt is None:
        counts = layers + np.arange(max(_FEW_MORE, layers // 4))
        at = counts[:, None] * ends + amid
        missed = np.abs(at - np.round(at)).max(axis=1)
        if reasons is not None:
            reasons["ends"] = "time steps end where supports let go"
        return int(counts[np.argmin(np.maximum(missed, _BESIDE))])
    spans = [each.sample for each in scene.sampled if each.sample]
    if not spans or scene.solve.dt is not None:
        return layers
    count = round(scene.duration / min(spans))
    if count < 1 or abs(count * min(spans) - scene.duration) > 1e-9 * scene.duration:
        return layers
    if reasons is not None:
        reasons["samples"] = "time steps end with the samples of controllers"
    return count * math.ceil(layers / count)
