"""The plan of solids: degree, method, step and solver, with the reasons, and cheaper models."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.errors import SceneError
from impactfem.findings import Finding
from impactfem.planning.card import Foresees
from impactfem.planning.estimates import choose_estimate
from impactfem.planning.meetings import told_contacts
from impactfem.planning.normals import choose_normals
from impactfem.planning.offers import offers
from impactfem.planning.solid_choices import (
    choose_degrees,
    choose_linear_solver,
    choose_method,
    choose_steps,
    method_findings,
    ringing_findings,
)
from impactfem.planning.solid_costs import (
    SHARE_OF_STABLE,
    Size,
    check_before_meshing,
    count_layers,
    explicit_step,
    memory_mib,
    seconds,
)
from impactfem.planning.wholes import find_whole
from impactfem.result.whole import Whole
from impactfem.scene import Scene
from impactfem.scene.solids import Solid

_MODELS = {
    "plane_strain": "in plane strain",
    "plane_stress": "in plane stress",
    "axisymmetric": "axisymmetric",
    "3d": "in 3D",
}
_CELLS = {
    (2, "simplex"): "triangles", (3, "simplex"): "tetrahedra",
    (2, "hexahedron"): "quadrilaterals", (3, "hexahedron"): "hexahedra",
}  # fmt: skip


@dataclass(frozen=True, repr=False)
class SolidPlan(Foresees):
    """What will be modelled and how, for one solid or several.

    Attributes:
        method: Name as in `impactfem methods`.
        model: The model in words.
        degree: Largest degree of the elements.
        degrees: That of each body.
        cells: "simplex" or "hexahedron", of the first body.
        mesh_size: Size of the smallest elements [m], the mean one with a mesh file.
        dt: Time step [s]; None if it is a share of the stable step, which is found at run time.
        courant: c_p dt / h of implicit methods; for explicit ones the share of the stable step, or
            None if dt is given.
        layers: Time layers; None as for dt.
        linear_solver: "mumps", "gamg" or "none".
        normals: "fixed" or "updated".
        active_set: Solver of the contact conditions.
        tolerance: Rounding level of gaps, relative to the size of the body.
        max_iterations: Limit of linear solves of one active-set loop.
        contact_pairs: Gaps: of nodes to obstacles, and between bodies.
        unknowns: Displacement components.
        memory_mib: Estimated peak memory [MiB].
        seconds: Estimated time [s], that of the runs for the error included, output excluded.
        estimate: Whether the error is estimated by runs on other elements.
        whole: What is told of, if planes of symmetry leave only a part to be computed.
        reasons: Why each choice was made, by key; "offer ..." are cheaper models of the scene.
    """

    method: str
    model: str
    degree: int
    degrees: tuple[int, ...]
    cells: str
    mesh_size: float
    dt: float | None
    courant: float | None
    layers: int | None
    linear_solver: str
    normals: str
    active_set: str
    tolerance: float
    max_iterations: int
    contact_pairs: int
    unknowns: int
    memory_mib: float
    seconds: float
    estimate: bool
    whole: Whole
    reasons: dict[str, str]


def plan_solids(scene: Scene) -> SolidPlan:
    """Choose method and numbers for the solids of a scene (collective: they are meshed).

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
        MeshError: A mesh cannot be made.
    """
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.planning.damping import damping_findings  # noqa: PLC0415  (likewise)
    from impactfem.planning.turns import flight_findings  # noqa: PLC0415  (likewise)

    solids, solve = scene.solids, scene.solve
    reasons: dict[str, str] = {}
    findings: list[Finding] = []
    degrees = choose_degrees(scene, reasons, findings)
    for solid, degree in zip(solids, degrees, strict=True):
        check_before_meshing(solid, degree)
    model = solids_model(scene, degrees, updated=solve.normals == "updated")
    if choose_normals(model, reasons) and not model.updated:
        model = solids_model(scene, degrees, updated=True)
    alone = len(model.parts) == 1
    for part in model.parts:
        if part.mesh.source is not None:
            reasons["mesh" if alone else f"mesh of {part.solid.name}"] = part.mesh.source.text
        findings += left_out(part.solid, part.mesh)
    found = [measured(part.solid, part.mesh, part.degree) for part in model.parts]
    sizes = [size for size, _ in found]
    method = choose_method(scene, sizes, [max(extents) for _, extents in found], reasons)
    steps = choose_steps(scene, method, sizes, reasons)
    linear_solver = choose_linear_solver(scene, method, sizes, reasons)
    for solid, size in zip(solids, sizes, strict=True):
        findings += ringing_findings(solid, method, size)
    flyers = [(part.solid, part.system, part.outside) for part in model.parts]
    findings += flight_findings(scene, flyers, steps.dt)
    findings += told_contacts(model, reasons)
    if alone:
        reasons |= {f"offer {name}": text for name, text in offers(scene).items()}
    findings += method_findings(method, steps.courant)
    share = (steps.courant or 1.0) / SHARE_OF_STABLE
    step = steps.dt or share * explicit_step(solids, sizes)
    count = steps.layers or count_layers(scene.duration, step)
    for solid, (size, extents) in zip(solids, found, strict=True):
        findings += damping_findings(method, solid, size, max(extents), step)
    touching = [len(numbers) for numbers in model.numbers]

    def cost(factor: float) -> float:
        return sum(
            seconds(
                size.scaled(factor), count / factor, round(nodes / factor ** (size.dim - 1)),
                linear_solver, model.comm.size,
            )
            for size, nodes in zip(sizes, touching, strict=True)
        )  # fmt: skip

    estimate, more = choose_estimate(
        scene, solids, [min(extents) for _, extents in found],
        any(is_curved(part.mesh) for part in model.parts), cost, reasons,
    )  # fmt: skip
    if model.probes:
        told = (f"{probe.name} in {probe.body}" for probe, *_ in model.probes)
        reasons["probes"] = f"in every layer: {', '.join(told)}"
    return SolidPlan(
        method=method,
        model=in_words(scene, sizes),
        degree=max(degrees),
        degrees=degrees,
        cells=sizes[0].cells,
        mesh_size=min(size.mesh_size for size in sizes),
        dt=steps.dt,
        courant=steps.courant,
        layers=steps.layers,
        linear_solver=linear_solver,
        normals="updated" if model.updated else "fixed",
        active_set=solve.active_set or "pdas",
        tolerance=solve.tolerance or 1e-13,
        max_iterations=solve.max_iterations or 200,
        contact_pairs=model.contact_count,
        unknowns=model.unknowns,
        memory_mib=memory_mib(sizes, linear_solver),
        seconds=cost(1.0) + more,
        estimate=estimate,
        whole=find_whole(scene, model.parts, reasons),
        reasons=reasons,
        findings=tuple(findings),
    )


def left_out(solid: Solid, body_mesh: Any) -> list[Finding]:
    """What of a body's mesh file is not used."""
    texts = () if body_mesh.source is None else body_mesh.source.unused
    return [Finding("mesh_file", "note", text, solid.name) for text in texts]


def is_curved(body_mesh: Any) -> bool:
    """Whether a mesh comes from a file with curved elements."""
    return body_mesh.source is not None and body_mesh.source.is_curved


def measured(solid: Solid, body_mesh: Any, degree: int) -> tuple[Size, tuple[float, ...]]:
    """Size of the discretised body and the edges of the box around it [m] (collective).

    Raises:
        SceneError: Elements shall be larger than the body.
    """
    from impactfem.fem import MPI, cell_nodes  # noqa: PLC0415

    mesh, dim = body_mesh.mesh, body_mesh.gdim
    corners = {"triangle": 3, "tetrahedron": 4, "quadrilateral": 4, "hexahedron": 8}[body_mesh.cell]
    points = mesh.geometry.x[:, :dim]
    own = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = cell_nodes(mesh)[:own, :corners]
    first, second = np.triu_indices(corners, 1)
    lengths = np.linalg.norm(points[cells[:, first]] - points[cells[:, second]], axis=2)
    least = mesh.comm.allreduce(lengths.min(initial=np.inf), op=MPI.MIN)
    total = mesh.comm.allreduce(lengths.min(axis=1).sum() if len(cells) else 0.0)
    mean = total / body_mesh.num_cells
    low = np.array([mesh.comm.allreduce(v, op=MPI.MIN) for v in points.min(axis=0, initial=np.inf)])
    high = np.array(
        [mesh.comm.allreduce(v, op=MPI.MAX) for v in points.max(axis=0, initial=-np.inf)]
    )
    if solid.mesh_size is not None and solid.mesh_size > (largest := float((high - low).max())):
        raise SceneError(
            f"body {solid.name}: mesh_size = {solid.mesh_size:g} exceeds the largest extent "
            f"{largest:.6g} of the mesh; give a smaller one in m"
        )
    kind = "simplex" if body_mesh.cell in {"triangle", "tetrahedron"} else "hexahedron"
    # Rounded, since sums depend on the number of ranks and the time step follows from the size.
    mesh_size = solid.mesh_size or float(f"{mean:.6g}")
    size = Size(body_mesh.num_nodes, dim, degree, kind, mesh_size, float(least))
    return size, tuple((high - low).tolist())


def in_words(scene: Scene, sizes: Sequence[Size]) -> str:
    """What the bodies are, in words."""
    each = [_body(solid, size) for solid, size in zip(scene.solids, sizes, strict=True)]
    if len(each) > 1:
        each = [f"{solid.name}: {text}" for solid, text in zip(scene.solids, each, strict=True)]
    rubs = any(contact.friction_coefficient > 0.0 for contact in scene.contacts)
    walls = ["rigid obstacles"] * bool(scene.rigid_obstacles)
    law = ", ".join(["linear elastic", *walls]) + (
        ", Coulomb friction" if rubs else ", no friction"
    )
    return "; ".join([*each, law])


def _body(solid: Solid, size: Size) -> str:
    what = "body of a mesh file" if solid.shape is None else solid.shape.kind
    letter = "P" if size.cells == "simplex" else "Q"
    kind = _CELLS[size.dim, size.cells]
    text = f"{what} {_MODELS[solid.model]}"
    cuts = () if solid.shape is None else solid.shape.symmetry
    if cuts:
        fraction = {1: "half", 2: "quarter", 3: "eighth"}[len(cuts)]
        text = f"{fraction} of a {text}"
    return f"{text}, {letter}{size.degree} {kind}"
