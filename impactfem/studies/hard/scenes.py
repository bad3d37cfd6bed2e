"""Hard cases that are scenes solved once or a few times, and what must hold in them."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from impactfem.errors import ConvergenceError
from impactfem.methods import DISPERSIVE, METHODS
from impactfem.reference.bar import exact_bar
from impactfem.result import Fields, Result
from impactfem.scene import Bar, Scene, Solve, Wall
from impactfem.solving import solve
from impactfem.studies.hard.board import Case, Claim, Facts

ALL = ("galerkin", "conserving", "dg", "exact", "monolithic")
SWEPT = ("galerkin", "conserving")
LIMITED = frozenset({"galerkin", "monolithic"})
OFF_GRID = 0.5 + 2**0.5 / 100  # [m] a gap that is no fraction of the length

SIZES = {"dg": 16, "exact": 4, "monolithic": 20}

GROWTH = Claim("growth", 1e-6, "a rigid wall does no work, so energy is bounded by its start")
DRIFT = Claim("drift", 1e-9, "each layer's wave keeps its mean square at any step")
PENETRATION = Claim("penetration", 1e-9, "0 <= u at the wall")
PULL = Claim("pull", 1e-9, "lambda <= 0: a wall does not pull")
ROUNDING = Claim("displacement", 1e-9, "characteristics are exact to rounding")
EXACT_FORCE = Claim("force", 1e-9, "characteristics are exact to rounding")
BOUND = Claim("of bound", 1.0, "displacement error within C contacts / n^q of the method")


def bar_scene(duration: float, *, gravity: float = 0.0, **bar: Any) -> Scene:
    """A bar with unit data but for what is given."""
    data = {"length": 1.0, "density": 1.0, "youngs_modulus": 1.0, **bar}
    return Scene(
        title="hard case",
        duration=duration,
        gravity=gravity,
        bodies=[Bar(**data)],
        obstacles=[Wall()],
        solve=Solve(),
    )


def bound(method: str, elements: int, contacts: int, courant: float = 1.0) -> float:
    """Largest relative displacement error to expect of a method."""
    constant, rate = METHODS[method].error
    if method in LIMITED and courant < 1.0 - 1e-9:
        constant, rate = DISPERSIVE
    return float(constant * max(1, contacts) / elements**rate * max(1.0, courant))


def solved(method: str, scene: Scene, **settings: Any) -> Result:
    """The result at the size of the board, with at most some hundred levels kept.

    Raises:
        ConvergenceError: The active set did not settle.
    """
    keys = {"elements": SIZES.get(method, 40), **settings, "method": method}
    if method == "dg":
        keys.setdefault("fitted", False)  # the plan may fit the mesh; that has cases of its own
    if keys.get("mesh"):
        del keys["elements"]
    elif method == "exact":
        keys["elements"] = SIZES["exact"]  # only samples it
    scene = scene.with_settings({f"solve.{key}": value for key, value in keys.items()})
    bar = scene.bar
    layers = scene.duration / bar.transit_time * keys.get("elements", 16) / keys.get("courant", 1)
    result = solve(scene.with_settings({"output.every": max(1, int(layers) // 400)}))
    if result.summary["status"] == "not_converged":
        raise ConvergenceError(f"active set: {result.summary['active_set']['message']}")
    return result


def facts_of(result: Result) -> dict[str, float]:
    """Figures of a run, dimensionless."""
    summary, history = result.summary, result.history
    errors, gap = summary["error"], history["gap"].values
    moved = result.fields.displacement if isinstance(result.fields, Fields) else gap
    force = history["contact_force"].values
    peak = max(float(np.abs(force).max()), 1e-300)
    # The total may be next to zero: potentials have no natural origin.
    kinetic, total = history["kinetic_energy"].values, history["total_energy"].values
    start = float(kinetic[0] + history["elastic_energy"].values[0])
    drift = (total - total[0]) / max(abs(float(total[0])), start, 1e-300)
    facts = {
        "growth": max(0.0, float(drift.max())),
        "drift": float(np.abs(drift).max()),
        "loss": 0.0 - float(drift[-1]),
        "penetration": max(0.0, -float(gap.min())) / max(float(np.abs(moved).max()), 1e-300),
        "pull": max(0.0, -float(np.min(force))) / peak,
    }
    if errors:
        facts["displacement"] = _number(errors["displacement_max"])
        facts["force"] = _number(errors["force_l1"])
    return facts


def _number(value: float | None) -> float:
    """What is not finite is None in a summary."""
    return float("inf") if value is None else float(value)


def run(method: str, scene: Scene, settings: Mapping[str, Any], *, judged: bool = True) -> Facts:
    """Facts of a scene; ``judged`` adds the error as a share of the method's bound."""
    result = solved(method, scene, **settings)
    facts = facts_of(result)
    if judged and method != "exact" and "displacement" in facts:
        contacts = len(exact_bar(scene).contacts)
        elements = settings.get("elements", SIZES.get(method, 40))
        limit = bound(method, elements, contacts, settings.get("courant", 1.0))
        facts["of bound"] = facts["displacement"] / limit
    return facts


def claims(method: str, *, judged: bool = True) -> Sequence[Claim]:
    """What must hold in every scene."""
    common = [GROWTH, PENETRATION, PULL]
    if method == "exact":
        return [*common, ROUNDING, EXACT_FORCE]
    if method == "conserving":
        common.append(DRIFT)
    return [*common, BOUND] if judged else common


def _case(
    name: str, scene: Scene, methods: tuple[str, ...] = ALL, *,
    refusals: frozenset[str] = frozenset(), quick: bool = True, judged: bool = True,
    extra: Callable[[str], Sequence[Claim]] | None = None, **settings: Any,
) -> Case:  # fmt: skip
    return Case(
        name,
        lambda method: run(method, scene, settings, judged=judged),
        lambda method: [*claims(method, judged=judged), *(extra(method) if extra else ())],
        methods,
        refusals,
        quick,
    )


THROWN = bar_scene(5.0, gap=OFF_GRID, velocity=-0.5)
BOUNCES = {"length": 10.0, "youngs_modulus": 900.0, "gap": 5.0}
REST = "-0.1*(x - 0.5*x*x)"  # [m] equilibrium on the wall, p = 0.1


def _penetrating(method: str) -> Facts:
    """Refused when the scene is made, before any method."""
    return run(method, bar_scene(5.0, gap=-0.1, velocity=-0.5), {})


def _grazing(method: str) -> Facts:
    """Thrown up to the wall against gravity: it arrives with almost no speed, or turns before."""
    worst: dict[str, float] = {}
    for excess in (-1e-6, -1e-12, 0.0, 1e-12, 1e-6):
        scene = bar_scene(2.0, gravity=-1.0, gap=0.5, velocity=-(1.0 + excess))
        for name, value in facts_of(solved(method, scene)).items():
            # The force of a graze is next to none, and so is what its error is relative to.
            if name != "force":
                worst[name] = max(worst.get(name, 0.0), value)
    return worst


def _still(method: str) -> Sequence[Claim]:
    """A bar in equilibrium stays there."""
    limit = {"monolithic": 1.0 / 20**2}.get(method, 1e-9)
    why = "equilibrium lasts; loads of corners move it by O(h^2)"
    return [Claim("displacement", limit, why)]


_COURANT = tuple(
    _case(
        f"courant {courant:g}",
        THROWN,
        (*SWEPT, "monolithic") if courant > 1.0 else SWEPT,
        refusals=LIMITED if courant > 1.0 else frozenset(),
        courant=courant,
    )
    for courant in (0.1, 0.5, 0.9, 0.999, 1.001, 2.0)
)
_LONG = tuple(
    _case(
        f"750 bounces, T = 2000, courant {courant:g}",
        bar_scene(2000.0, gravity=10.0, **BOUNCES),
        ("galerkin", "conserving", "exact", "newmark") if courant == 1.0
        else ("galerkin", "conserving") if courant < 1.0
        else ("conserving",),
        judged=False,
        elements=20,
        courant=courant,
        quick=courant == 1.0,
    )
    for courant in (0.5, 1.0, 2.0)
)  # fmt: skip

OVERLAPPING = bar_scene(5.0, gravity=5.0, gap=0.5, velocity=-0.5)
_FITTED = tuple(
    _case(f"{name}, fitted mesh", scene, ("dg",), fitted=True, judged=False,
          extra=lambda _: [Claim("displacement", 1e-9, "exact between characteristics")])
    for name, scene in (
        ("impact between nodes", THROWN),
        ("waves and bounces overlap", OVERLAPPING),
        ("fall in a gravity field", bar_scene(4.0, gravity=0.1, gap=0.5, velocity=-0.5)),
    )
)  # fmt: skip

CASES: tuple[Case, ...] = (
    _case("impact between nodes", THROWN, (*ALL, "newmark")),
    *_COURANT,
    *_LONG,
    _case("seven bounces, T = 20", bar_scene(20.0, gravity=10.0, **BOUNCES), ("galerkin", "exact"),
          extra=lambda _: [Claim("displacement", 1e-9, "events on layers: exact at nodes")]),
    Case("grazing contact, v -> 0", _grazing,
         lambda m: [GROWTH, PENETRATION, PULL,
                    Claim("displacement", {"dg": 0.05}.get(m, 1e-2),
                          "a graze changes the motion as little as its speed")], ALL),
    _case("resting contact under gravity", bar_scene(10.0, gravity=0.1, displacement=REST), ALL,
          judged=False, extra=_still),
    *_FITTED,
    _case("in contact at t = 0", bar_scene(5.0, gap=0.0, velocity=-0.5)),
    Case("initial penetration", _penetrating, partial(claims), ALL, frozenset(ALL)),
    _case("v0 = 2 c", bar_scene(5.0, gap=OFF_GRID, velocity=-2.0)),
    _case("waves and bounces overlap: v0 + p tau < 2 p l", OVERLAPPING),
    _case("clamped, initial strain, 1000 periods",
          bar_scene(3000.0, far_end="clamped", displacement="(1 - x)/2"),
          ("galerkin", "conserving", "exact", "newmark"), judged=False, elements=20,
          extra=lambda m: [Claim("displacement", 1e-6, "events on layers: exact at nodes")]
          if m in SWEPT else []),
)  # fmt: skip
"""Hard cases that are scenes."""
