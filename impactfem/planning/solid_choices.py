"""Choices for a solid: method, time step, linear solver; each with its reason."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from impactfem.errors import SceneError
from impactfem.findings import Finding, warning
from impactfem.methods import METHODS, is_explicit
from impactfem.planning.solid_costs import (
    Size,
    count_layers,
    explicit_step,
    explicit_work,
    implicit_work,
    leading_speed,
    on_samples,
)
from impactfem.planning.solid_elements import SLENDER, slenderness
from impactfem.planning.time_data import Datum, parts_following
from impactfem.scene import Scene
from impactfem.scene.shapes import Block
from impactfem.scene.solids import Solid

COURANT = 0.5
"""c_p dt / h of implicit methods where nothing else is asked for."""

_USUAL, _SHARE = 0.9, {"galerkin": 1.0}  # of the stable step
_FINITE_SHARE = 0.6  # the same under finite strain, where squeezed cells are stiffer
_FAR = 10.0  # times the step of a usual mesh, beyond which a step is unstable for certain
_LONG = 100.0  # transits of a wave from which energy must be kept to rounding
_DIRECT = {2: 1_000_000, 3: 200_000}  # unknowns up to which a factorisation is cheapest

_WARNINGS: Mapping[str, str] = {
    "newmark": (
        "newmark is a negative control: its energy grows at every impact and its force rings; "
        'method = "massless" does neither'
    ),
    "moreau_jean": (
        "moreau_jean: the contact force is a row of impulses that depends on the step, and nodes "
        'penetrate; method = "massless" gives a smooth force'
    ),
    "galerkin": (
        'galerkin: method = "explicit" costs the same and its force does not ring; this one rings '
        "unless the mesh is structured and courant is 1"
    ),
}


_STEPS_OF_BENDING = 2000  # large bounces of the MEMS switch: 1 % to half of this step
_WORTH_OFFERING = 3.0


@dataclass(frozen=True)
class Steps:
    """The time step as far as it is known before the run; see `MarchNumbers`."""

    dt: float | None
    courant: float | None
    layers: int | None

    def of_layers(self, duration: float, layers: int) -> "Steps":
        """Steps that make so many layers of a duration [s]."""
        dt = duration / layers
        courant = None if self.courant is None or not self.dt else self.courant * dt / self.dt
        return Steps(dt, courant, layers)


def choose_method(
    scene: Scene,
    solids: Sequence[Solid],
    sizes: Sequence[Size],
    largest: Sequence[float],
    reasons: dict[str, str],
) -> str:
    """As asked, else the cheapest that keeps what the duration asks for.

    Args:
        scene: The scene.
        solids: Its solids, each of the one material whose waves ask for the least steps.
        sizes: How large each discretised solid is.
        largest: Largest extent of each [m].
        reasons: Gets the reason.
    """
    if scene.solve.method is not None:
        reasons["method"] = "as asked"
        return scene.solve.method
    duration = scene.duration
    transits = max(
        duration * leading_speed(solid) / extent
        for solid, extent in zip(solids, largest, strict=True)
    )
    if scene.iterated:
        reasons["method"] = f"{scene.iterated}: it keeps energy and momenta to rounding"
    elif scene.gives_way:
        reasons["method"] = "what the stiffness of contacts takes it gives back, to rounding"
    elif transits > _LONG:
        reasons["method"] = (
            f"{transits:.3g} transits of a wave: over so many contacts energy must be kept to "
            "rounding"
        )
    if "method" in reasons:
        return "conserving"
    implicit_only = _implicit_only(scene, sizes)
    if implicit_only:
        reasons["method"] = implicit_only
        return "massless"
    explicit = explicit_work(solids, sizes, duration)
    implicit = implicit_work(solids, sizes, duration, scene.solve.courant or COURANT)
    costs = (
        f"about {explicit:.2g} products with the stiffness, against {implicit:.2g} implicitly "
        f"(its factorisation included)"
    )
    if scene.solve.dt is not None or (scene.solve.courant or 0.0) > 1.0:
        key = "dt" if scene.solve.dt is not None else "courant"
        reasons["method"] = f"solve.{key} is given: stable at any step"
        return "massless"
    if explicit <= implicit:
        reasons["method"] = f"explicit steps are cheaper: {costs}"
        return "explicit"
    even = all(size.least > 0.5 * size.mesh_size for size in sizes)
    small = "" if even else ", for the smallest elements set its step"
    if max(solid.rayleigh_stiffness for solid in solids) > explicit_step(solids, sizes):
        small = ", for damping by the stiffness shortens its step"
    reasons["method"] = f"explicit steps would take {costs}{small}"
    return "massless"


def _implicit_only(scene: Scene, sizes: Sequence[Size]) -> str:
    """Why steps must be implicit, or nothing."""
    if len(scene.solids) < len(scene.bodies):
        return f"{scene.why_marched}: bodies without meshes take implicit steps, which do not ring"
    if scene.couplings:
        return "what joints hold takes implicit steps, whose length is free"
    if any(solid.relaxing for solid in scene.solids):
        return "Maxwell terms relax in implicit steps"
    if max(size.degree for size in sizes) == 2:
        return "elements of degree 2 have no lumped mass, so an implicit method"
    return ""


def choose_steps(
    scene: Scene, method: str, sizes: Sequence[Size], reasons: dict[str, str]
) -> Steps:
    """Time step and number of layers, the same for all solids.

    A step that is not asked for is shortened so that the time steps fill the duration.

    Raises:
        SceneError: The step is beyond the stability limit.
    """
    solve, solids = scene.solve, scene.solids
    pairs = list(zip(solids, sizes, strict=True))
    if solve.dt is not None:
        reasons["dt"] = "as asked"
        for solid, size in pairs:
            refuse_unstable(solve.dt, method, solid, size)
        layers = count_layers(scene.duration, solve.dt)
        if layers * solve.dt > scene.duration * (1.0 + 1e-9):
            reasons["layers"] = (
                f"the last time step ends at {layers * solve.dt:g} s, the first end past the "
                "duration"
            )
        number = max(solid.p_wave_speed * solve.dt / size.mesh_size for solid, size in pairs)
        return Steps(solve.dt, None if is_explicit(method) else number, layers)
    if is_explicit(method):
        return Steps(None, _explicit_share(scene, method, reasons), None)
    dt = min(
        solve.courant * size.mesh_size / solid.p_wave_speed if solve.courant
        else COURANT * size.mesh_size / leading_speed(solid)
        for solid, size in pairs
    )  # fmt: skip
    if solve.courant:
        reasons["dt"] = "courant as asked"
    elif any(solid.keeps_volume for solid in solids):
        reasons["dt"] = (
            "waves of shear cross an element in two steps; those of pressure are not followed "
            "one by one: if they matter (flat faces that strike), use solve.courant = .5"
        )
    else:
        reasons["dt"] = (
            "courant = .5: the fastest waves cross an element in two steps, accurate without "
            "cost of stability"
        )
    if len(pairs) > 1:
        reasons["dt"] += "; by the body that asks for the least step"
    reasons["dt"] += ", or a little less, so that the time steps fill the duration"
    layers = count_layers(scene.duration, min(dt, scene.duration))
    if len(pairs) == len(scene.bodies) == 1 and solve.courant is None:
        _offer_bending_step(scene, layers, reasons)
    dt = scene.duration / layers
    number = max(solid.p_wave_speed * dt / size.mesh_size for solid, size in pairs)
    return Steps(dt, number, layers)


def _explicit_share(scene: Scene, method: str, reasons: dict[str, str]) -> float:
    """Share of the stable step that explicit steps take.

    Raises:
        SceneError: It is beyond 1.
    """
    finite = any(solid.is_finite for solid in scene.solids)
    asked = scene.solve.courant
    share = asked or (_FINITE_SHARE if finite else _SHARE.get(method, _USUAL))
    if share > 1.0 + 1e-9:
        raise SceneError(
            f"solve.courant = {share:g} is beyond the stability limit of {method}, where "
            "courant is the fraction of the stable step 2 / omega_max; use courant <= 1, or "
            'method = "massless", which is stable at any'
        )
    how = "courant as asked" if asked else f"{share:g}"
    reasons["dt"] = f"{how}: fraction of the stable step 2 / omega_max, found when the run starts"
    if finite and not asked:
        reasons["dt"] += "; squeezed cells are stiffer than those at rest"
    return share


def shortened(steps: Steps, scene: Scene, limit: float, reasons: dict[str, str]) -> Steps:
    """Steps that follow what vibrates in bodies without meshes, too.

    Args:
        steps: Of the solids, implicit.
        scene: The scene; a step that it gives stays.
        limit: Longest step of the others [s].
        reasons: Gets the reason.
    """
    if steps.dt is None or steps.dt <= limit or scene.solve.dt is not None:
        return steps
    reasons["dt"] = "1/20 of a radian of the fastest vibration of the points, rods and beams"
    return steps.of_layers(scene.duration, count_layers(scene.duration, limit))


def following(
    steps: Steps, scene: Scene, data: Sequence[Datum], stable: float, reasons: dict[str, str]
) -> Steps:
    """Steps that follow loads, supports and obstacles that change in time, where a few more do.

    Args:
        steps: As chosen.
        scene: The scene; a step or Courant number that it gives stays.
        data: What changes in time.
        stable: Longest explicit step, about [s].
        reasons: Gets the reason.
    """
    if scene.solve.dt is not None or scene.solve.courant is not None:
        return _sampled(steps, scene, reasons)
    step = steps.dt or (steps.courant or 1.0) * stable
    layers = steps.layers or count_layers(scene.duration, step)
    parts = parts_following(data, scene.duration, layers, reasons)
    courant = None if steps.courant is None else steps.courant / parts
    if steps.dt is None or steps.layers is None:
        return replace(steps, courant=courant)
    return _sampled(Steps(steps.dt / parts, courant, steps.layers * parts), scene, reasons)


def _sampled(steps: Steps, scene: Scene, reasons: dict[str, str]) -> Steps:
    """Steps that end with the samples of controllers; explicit ones are, once they are known."""
    if steps.layers is None or not (scene.sampled or scene.ends):
        return steps
    return steps.of_layers(scene.duration, on_samples(scene, steps.layers, reasons))


def refuse_unstable(dt: float, method: str, solid: Solid, size: Size) -> None:
    """Refuse steps that no mesh of this size bears; the limit itself is found when a run starts.

    Raises:
        SceneError: The step is far beyond the stability limit.
    """
    natural = explicit_step([solid], [size])
    if is_explicit(method) and dt > _FAR * natural:
        raise SceneError(
            f"solve.dt = {dt:g} is beyond the stability limit of method {method} on the mesh of "
            f"body {solid.name}, about {natural:.1g} s; use a smaller solve.dt, leave it out, or "
            'method = "massless", which is stable at any'
        )


def _offer_bending_step(scene: Scene, layers: int, reasons: dict[str, str]) -> None:
    """Offer a larger step to slender blocks, whose bending is far slower than their waves.

    The first bending frequency of a beam is (beta L)^2 sqrt(E I / (rho A L^4)) with beta L = 1.8751
    clamped at one end and 4.7300 free.
    """
    solid, ratio = scene.solid, slenderness(scene.solid)
    if ratio is None or ratio < SLENDER or not isinstance(solid.shape, Block):
        return
    length, thickness = max(solid.shape.size), min(solid.shape.size)
    stiffness = math.sqrt(solid.youngs_modulus / (12.0 * solid.density)) * thickness / length**2
    period = 2.0 * math.pi / ((1.8751 if solid.supports else 4.7300) ** 2 * stiffness)
    dt = period / _STEPS_OF_BENDING
    if dt * layers > _WORTH_OFFERING * scene.duration:
        reasons["offer dt"] = (
            f"if it bends more than it is struck end-on: dt = {dt:.2g} is 1/{_STEPS_OF_BENDING} of "
            f"the first bending period {period:.3g} s and takes {scene.duration / dt:.3g} time "
            f"steps instead of {layers}; waves through the thickness are then not followed"
        )


def choose_linear_solver(
    scene: Scene, method: str, sizes: Sequence[Size], reasons: dict[str, str]
) -> str:
    """A factorisation as long as it is cheap; none where there is no system to solve."""
    asked = scene.solve.linear_solver
    if is_explicit(method):
        reasons["linear_solver"] = f"{method} solves no system" + (
            "; solve.linear_solver is not used" if asked else ""
        )
        return "none"
    if asked is not None:
        reasons["linear_solver"] = "as asked"
        return asked
    size = max(sizes, key=lambda size: size.unknowns)  # each body has factors of its own
    finite = any(solid.is_finite for solid in scene.solids)
    limit = _DIRECT[size.dim]
    if size.unknowns <= limit:
        reasons["linear_solver"] = (
            f"one factorisation serves {'a step' if finite else 'all time steps'}: {size.unknowns} "
            f"unknowns are at most {limit:.3g}"
        )
        return "mumps"
    reasons["linear_solver"] = (
        f"{size.unknowns} unknowns are more than the {limit:.3g} up to which factors are small"
    )
    return "gamg"


def fitting_solver(chosen: str, unknowns: int, dim: int) -> str:
    """What solves single systems of a body: as the plan has it, or by size where it has none."""
    if chosen != "none":
        return chosen
    return "mumps" if unknowns <= _DIRECT[dim] else "gamg"


def method_findings(method: str, courant: float | None) -> list[Finding]:
    """What the user should know of a method before trusting its answer."""
    text = _WARNINGS.get(method)
    if text is None:
        return []
    below = METHODS[method].stable == "limited" and courant is not None and courant < 1.0 - 1e-9
    text = f"{text} (here courant = {courant:g})" if below else text
    return [warning("control_method", text)]
