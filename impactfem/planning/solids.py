"""The plan of solids: degree, method, step and solver, with the reasons, and cheaper models."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.errors import SceneError
from impactfem.findings import Finding
from impactfem.methods import METHODS, is_explicit
from impactfem.planning.estimates import choose_estimate
from impactfem.planning.few import bar_findings, few_findings, few_step, plan_few
from impactfem.planning.meetings import told_contacts
from impactfem.planning.model_limits import as_asked
from impactfem.planning.normals import choose_normals
from impactfem.planning.offers import offers
from impactfem.planning.plans import Plan
from impactfem.planning.solid_choices import (
    choose_linear_solver,
    choose_method,
    choose_steps,
    following,
    method_findings,
    shortened,
)
from impactfem.planning.solid_costs import (
    SHARE_OF_STABLE,
    Size,
    check_before_meshing,
    count_layers,
    explicit_step,
    late_ends,
    memory_mib,
    seconds,
)
from impactfem.planning.solid_elements import choose_degrees, ringing_findings, thin_walls
from impactfem.planning.solid_plan import STARTS, MarchNumbers, few_in_words, in_words
from impactfem.planning.strains import finite_instead, told, with_strains
from impactfem.planning.time_data import data_findings, time_data
from impactfem.planning.wholes import find_whole
from impactfem.scene import Scene
from impactfem.scene.pairing import self_meeting
from impactfem.scene.solids import Solid

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart, SolidsModel


def plan_march(scene: Scene) -> Plan[MarchNumbers]:
    """Choose method and numbers for bodies that are marched (collective).

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
        MeshError: A mesh cannot be made.
    """
    return plan_solids(scene) if scene.solids else plan_few(scene)


def plan_solids(scene: Scene) -> Plan[MarchNumbers]:
    """Choose method and numbers for the solids of a scene (collective: they are meshed).

    Bodies that do not say take finite strain where small ones would not be trusted.

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
        MeshError: A mesh cannot be made.
    """
    scene = with_strains(scene, self_meeting(scene))
    made = _plan(scene)
    other = finite_instead(scene, made.findings)
    if other is None:
        return made
    larger, beyond = other
    plan = _plan(larger)
    return replace(plan, reasons=told(beyond, made.seconds, plan.seconds) | plan.reasons)


def _plan(scene: Scene) -> Plan[MarchNumbers]:
    """The plan of a scene with strains as it says."""
    from impactfem.models.ball_contacts import striking  # noqa: PLC0415  (loads SciPy)
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.planning.damping import damping_findings  # noqa: PLC0415  (likewise)
    from impactfem.planning.turns import flight_findings  # noqa: PLC0415  (likewise)
    from impactfem.planning.vibration import follow_vibration  # noqa: PLC0415  (likewise)

    reasons = dict(STARTS.get(scene.start, {}))
    findings: list[Finding] = []
    degrees, model = _meshed(scene, reasons, findings)
    if choose_normals(model, reasons) and not model.updated:
        model = solids_model(scene, degrees, updated=True)
    alone = len(model.parts) == 1
    for part in model.parts:
        if part.mesh.source is not None:
            reasons["mesh" if alone else f"mesh of {part.solid.name}"] = part.mesh.source.text
        findings += left_out(part.solid, part.mesh)
    found = [measured(part) for part in model.parts]
    alike, sizes = _of_one_material(scene, model), [size for size, _ in found]
    solids, solve = alike.solids, scene.solve
    method = choose_method(
        scene, alike.solids, sizes, [max(extents) for _, extents in found], reasons
    )
    steps = choose_steps(alike, method, sizes, reasons)
    steps = shortened(steps, scene, few_step(model.few), reasons)
    steps, apart = follow_vibration(scene, model, steps, reasons)
    data = time_data(scene, [part.system for part in model.parts], model.few)
    steps = following(steps, scene, data, explicit_step(solids, sizes), reasons)
    linear_solver = choose_linear_solver(scene, method, sizes, reasons)
    findings += few_findings(model, reasons)
    joined = {name for joint in scene.couplings for name in joint.bodies}
    flyers = [
        (part.foreseen.softest, part.system, part.outside)
        for part in model.parts
        if part.solid.name not in joined
    ]
    findings += flight_findings(scene, flyers, steps.dt)
    findings += told_contacts(model, reasons)
    if alone and scene.solid.is_uniform and not (model.few or scene.couplings):
        reasons |= {f"offer {name}": text for name, text in offers(scene).items()}
    findings += method_findings(method, steps.courant)
    share = (steps.courant or 1.0) / SHARE_OF_STABLE
    step = steps.dt or share * explicit_step(solids, sizes)
    count = steps.layers or count_layers(scene.duration, step)
    findings += [
        *bar_findings(model.few, step),
        *data_findings(data, step, count),
        *late_ends(scene, steps.dt, amid=is_explicit(method) and not scene.iterated),
    ]
    for solid, (size, extents) in zip(solids, found, strict=True):
        findings += [
            *ringing_findings(solid, method, size),
            *damping_findings(method, solid, size, max(extents), step),
        ]
    touching = [len(numbers) for numbers in model.numbers]

    active_set = solve.active_set or "pdas"
    iterates = model.takes_iterates(method, active_set)

    def cost(factor: float) -> float:
        return sum(
            seconds(
                size.scaled(factor), count / factor, round(nodes / factor ** (size.dim - 1)),
                linear_solver, model.comm.size, finite=solid.is_finite, iterates=iterates,
            )
            for solid, size, nodes in zip(solids, sizes, touching, strict=True)
        )  # fmt: skip

    balls = striking(model)
    estimate = choose_estimate(
        scene, solids,
        [min(*e, *balls.get(s.name, ())) for s, (_, e) in zip(solids, found, strict=True)],
        any(is_curved(part.mesh) for part in model.parts), cost, reasons,
    )  # fmt: skip
    others = [body.name for body in scene.bodies if not (body in solids or body.attached)]
    whole, cuts = find_whole(scene, model.parts, others, reasons)
    findings += cuts
    if model.probes:
        told = (f"{probe.name} in {probe.body}" for probe, *_ in model.probes)
        reasons["probes"] = f"in every time step: {', '.join(told)}"
    return Plan(
        method=method,
        model="; ".join(filter(None, [few_in_words(model.few), in_words(scene, sizes)])),
        numbers=MarchNumbers(
            degree=max(degrees),
            degrees=degrees,
            strains=tuple("finite" if solid.is_finite else "small" for solid in solids),
            cells=sizes[0].cells,
            mesh_size=min(size.mesh_size for size in sizes),
            dt=steps.dt,
            courant=steps.courant,
            apart=apart,
            layers=steps.layers,
            linear_solver=linear_solver,
            normals="updated" if model.updated else "fixed",
            active_set=active_set,
            tolerance=solve.tolerance or METHODS[method].tolerance,
            max_iterations=solve.max_iterations or 200,
            contact_pairs=model.contact_count,
            unknowns=model.unknowns,
            estimate=bool(estimate.factors),
            resizing=estimate.factors,
            unresized=estimate.kept,
            whole=whole,
        ),
        memory_mib=memory_mib(sizes, linear_solver),
        seconds=cost(1.0) + estimate.seconds,
        reasons=reasons,
        findings=as_asked(scene, findings),
    )


def left_out(solid: Solid, body_mesh: Any) -> list[Finding]:
    """What of a body's mesh file is not used."""
    texts = () if body_mesh.source is None else body_mesh.source.unused
    return [Finding("mesh_file", "note", text, solid.name) for text in texts]


def is_curved(body_mesh: Any) -> bool:
    """Whether a mesh comes from a file with curved elements."""
    return body_mesh.source is not None and body_mesh.source.is_curved


def _meshed(
    scene: Scene, reasons: dict[str, str], findings: list[Finding]
) -> tuple[tuple[int, ...], "SolidsModel"]:
    """Degrees of the elements and the bodies with these (collective).

    How thin the walls of a mesh file are is known once it is read.
    """
    from impactfem.models.solids import solids_model  # noqa: PLC0415  (loads DOLFINx)

    def made(degrees: tuple[int, ...]) -> "SolidsModel":
        for solid, degree in zip(scene.solids, degrees, strict=True):
            check_before_meshing(solid, degree)
        return solids_model(scene, degrees, updated=scene.solve.normals == "updated")

    degrees = choose_degrees(scene, reasons, findings, {})
    model = made(degrees)
    filed = [part for part in model.parts if part.solid.shape is None]
    if walls := thin_walls((part, _edges(part)[1]) for part in filed):
        findings.clear()
        others = choose_degrees(scene, reasons, findings, walls)
        model = model if others == degrees else made(others)
        degrees = others
    return degrees, model


def _of_one_material(scene: Scene, model: "SolidsModel") -> Scene:
    """The scene with solids of the material whose waves ask for the least steps (collective)."""
    if all(part.solid.is_uniform for part in model.parts):
        return scene
    others = {part.solid.name: part.foreseen.fastest for part in model.parts}
    return replace(scene, bodies=tuple(others.get(body.name, body) for body in scene.bodies))


def _edges(part: "SolidPart") -> tuple[float, float]:
    """Shortest edge of the elements, and mean of the shortest of each [m] (collective)."""
    from impactfem.fem import MPI, cell_nodes  # noqa: PLC0415

    body_mesh = part.mesh
    mesh, dim = body_mesh.mesh, body_mesh.gdim
    corners = {"triangle": 3, "tetrahedron": 4, "quadrilateral": 4, "hexahedron": 8}[body_mesh.cell]
    points = mesh.geometry.x[:, :dim]
    own = mesh.topology.index_map(mesh.topology.dim).size_local
    cells = cell_nodes(mesh)[:own, :corners]
    first, second = np.triu_indices(corners, 1)
    lengths = np.linalg.norm(points[cells[:, first]] - points[cells[:, second]], axis=2)
    least = mesh.comm.allreduce(lengths.min(initial=np.inf), op=MPI.MIN)
    total = mesh.comm.allreduce(lengths.min(axis=1).sum() if len(cells) else 0.0)
    # Rounded, since sums depend on the number of ranks and the time step follows from the size.
    return float(least), float(f"{total / body_mesh.num_cells:.6g}")


def measured(part: "SolidPart") -> tuple[Size, tuple[float, ...]]:
    """Size of a discretised body and the edges of the box around it [m] (collective).

    The box is turned as the shape is.

    Raises:
        SceneError: Elements shall be larger than the body.
    """
    from impactfem.fem import MPI  # noqa: PLC0415

    solid, body_mesh = part.solid, part.mesh
    mesh, dim = body_mesh.mesh, body_mesh.gdim
    points = mesh.geometry.x[:, :dim]
    least, mean = _edges(part)
    if solid.shape is not None and solid.shape.angle:
        c, s = np.cos(solid.shape.angle), np.sin(solid.shape.angle)
        turned = np.eye(dim)
        turned[:2, :2] = [[c, -s], [s, c]]
        points = points @ turned
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
    mesh_size = solid.mesh_size or mean
    least = part.foreseen.least or least
    size = Size(body_mesh.num_nodes, dim, part.degree, kind, mesh_size, least)
    return size, tuple((high - low).tolist())
