"""The plan of several solids that may strike each other."""

from impactfem.errors import SceneError
from impactfem.planning.estimates import choose_estimate
from impactfem.planning.sliding import choose_sliding, findings_of, told_pairs
from impactfem.planning.solid_choices import (
    COURANT,
    EXPLICIT,
    curved_file,
    refuse_unstable,
    stiff_elements,
)
from impactfem.planning.solid_costs import (
    Size,
    check_before_meshing,
    count_layers,
    explicit_step,
    explicit_work,
    implicit_work,
    leading_speed,
    memory_mib,
    seconds,
)
from impactfem.planning.solids import SolidPlan, in_words, is_curved, left_out, measured
from impactfem.planning.wholes import find_whole
from impactfem.scene import Scene, Solid

_ALONE = ", linear elastic, rigid obstacles without friction"


def plan_bodies(scene: Scene) -> SolidPlan:
    """Choose method and numbers for several solids (collective: they are meshed).

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
        MeshError: A mesh cannot be made.
    """
    from impactfem.models.bodies import bodies_model  # noqa: PLC0415  (loads DOLFINx)
    from impactfem.planning.damping import damping_findings  # noqa: PLC0415  (likewise)
    from impactfem.planning.turns import flight_findings  # noqa: PLC0415  (likewise)

    solve, solids = scene.solve, [body for body in scene.bodies if isinstance(body, Solid)]
    reasons: dict[str, str] = {}
    each_degree = degrees(scene, reasons)
    for solid, degree in zip(solids, each_degree, strict=True):
        check_before_meshing(solid, degree)
    model = bodies_model(scene, each_degree, updated=scene.solve.normals == "updated")
    if choose_sliding(model, reasons) and not model.updated:
        model = bodies_model(scene, each_degree, updated=True)
    found = [measured(p.solid, p.mesh, p.degree) for p in model.parts]
    sizes = [size for size, _ in found]
    method = _method(scene, solids, each_degree, sizes, reasons)
    if model.updated:
        exact, order = "energy exact", "energy right to first order in step and faces"
        reasons["method"] = reasons["method"].replace(exact, order)
    dt, courant = _step(scene, method, solids, sizes, reasons)
    layers = None if dt is None else count_layers(scene.duration, dt)
    solver = "none" if method in EXPLICIT else solve.linear_solver or "mumps"
    reasons |= told_pairs(model)
    for part in model.parts:
        if part.mesh.source is not None:
            reasons[f"mesh of {part.solid.name}"] = part.mesh.source.text
    fastest = min(explicit_step(s, size) for s, size in zip(solids, sizes, strict=True))
    count = layers or count_layers(scene.duration, fastest)
    damping = [
        finding
        for solid, (size, extents) in zip(solids, found, strict=True)
        for finding in damping_findings(method, solid, size, max(extents), dt or fastest)
    ]

    def cost(factor: float) -> float:
        return sum(
            seconds(size.scaled(factor), count / factor, 0, solver, model.comm.size)
            for size in sizes
        )

    estimate, more = choose_estimate(
        scene, solids, [min(extents) for _, extents in found],
        any(is_curved(part.mesh) for part in model.parts), cost, reasons,
    )  # fmt: skip
    flyers = [(part.solid, part.system, part.outside) for part in model.parts]
    return SolidPlan(
        method=method,
        model="; ".join(
            f"{s.name}: {in_words(s, z).removesuffix(_ALONE)}"
            for s, z in zip(solids, sizes, strict=True)
        )
        + "; linear elastic",
        degree=max(each_degree),
        cells=sizes[0].cells,
        mesh_size=min(size.mesh_size for size in sizes),
        dt=dt,
        courant=courant,
        layers=layers,
        linear_solver=solver,
        normals="updated" if model.updated else "fixed",
        active_set="pdas",
        tolerance=solve.tolerance or 1e-13,
        max_iterations=solve.max_iterations or 200,
        contact_pairs=model.contact_count,
        unknowns=model.unknowns,
        memory_mib=sum(memory_mib(size, solver) for size in sizes),
        seconds=cost(1.0) + more,
        estimate=estimate,
        whole=find_whole(scene, model.parts, reasons),
        reasons=reasons,
        findings=(
            *findings_of(model),
            *flight_findings(scene, flyers, dt),
            *damping,
            *(note for part in model.parts for note in left_out(part.solid, part.mesh)),
        ),
    )


def degrees(scene: Scene, reasons: dict[str, str] | None = None) -> list[int]:
    """Degree of the elements of each solid.

    Raises:
        SceneError: The method asked for has no elements of the degree asked for.
    """
    noted = {} if reasons is None else reasons
    return [_degree(scene, body, noted) for body in scene.bodies if isinstance(body, Solid)]


def _degree(scene: Scene, solid: Solid, reasons: dict[str, str]) -> int:
    explicit = scene.solve.method in EXPLICIT
    if solid.degree == 2 and explicit:
        raise SceneError(
            f"body {solid.name}: degree = 2 contradicts solve.method = {scene.solve.method!r}: its "
            "mass is lumped, which elements of degree 2 do not allow; use degree = 1, or method = "
            '"massless"'
        )
    if solid.degree is not None:
        return solid.degree
    stiff = "" if explicit else stiff_elements(solid) or curved_file(scene, solid)
    if stiff:
        reasons[f"degree of {solid.name}"] = stiff
    return 2 if stiff else 1


def _method(
    scene: Scene, solids: list[Solid], degrees: list[int], sizes: list[Size],
    reasons: dict[str, str],
) -> str:  # fmt: skip
    if scene.solve.method is not None:
        reasons["method"] = "as asked"
        return scene.solve.method
    if max(degrees) == 2 or scene.solve.dt is not None or (scene.solve.courant or 0.0) > 1.0:
        reasons["method"] = "stable at any step, for elements of any degree"
        return "massless"
    pairs, courant = list(zip(solids, sizes, strict=True)), scene.solve.courant or COURANT
    explicit = sum(explicit_work(*pair, scene.duration) for pair in pairs)
    implicit = sum(implicit_work(*pair, scene.duration, courant) for pair in pairs)
    if explicit > implicit and any(s.rayleigh_stiffness > explicit_step(s, z) for s, z in pairs):
        reasons["method"] = (
            f"damping by the stiffness shortens explicit steps: about {explicit:.2g} products with "
            f"it, against {implicit:.2g} implicitly"
        )
        return "massless"
    reasons["method"] = "no system to solve, energy exact"
    return "explicit"


def _step(
    scene: Scene, method: str, solids: list[Solid], sizes: list[Size], reasons: dict[str, str]
) -> tuple[float | None, float | None]:
    """Time step and courant number, as far as known before the run."""
    solve = scene.solve
    if solve.dt is not None:
        reasons["dt"] = "as asked"
        for solid, size in zip(solids, sizes, strict=True):
            refuse_unstable(solve.dt, method, solid, size)
        return solve.dt, None
    if method in EXPLICIT:
        share = solve.courant or (0.9 if method == "explicit" else 1.0)
        if share > 1.0 + 1e-9:
            raise SceneError(
                f"solve.courant = {share:g} is beyond the stability limit of {method}; use courant "
                '<= 1, or method = "massless", which is stable at any'
            )
        reasons["dt"] = f"{share:g} of the least stable step of the bodies"
        return None, share
    courant = solve.courant or COURANT
    pairs = zip(solids, sizes, strict=True)
    dt = min(courant * size.mesh_size / leading_speed(solid) for solid, size in pairs)
    reasons["dt"] = (
        f"courant = {courant:g} or a little less in the body that asks for the least step, so "
        "that the layers fill the duration"
    )
    return scene.duration / count_layers(scene.duration, dt), courant
