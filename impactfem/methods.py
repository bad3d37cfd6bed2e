"""The solution methods by name: what they are, what they solve, and where their limits lie."""

from dataclasses import dataclass
from typing import Literal

BAR, SOLID, BOTH = frozenset({"bar"}), frozenset({"solid"}), frozenset({"bar", "solid"})
VIBRO = frozenset({"point", "rod", "beam"})
RIGID, SPRINGS = frozenset({"rigid"}), frozenset({"springs"})


DISPERSIVE = (3.0, 2.0 / 3.0)
"""`Method.error` of schemes that disperse waves, as galerkin below courant 1: the rate 2/3 is that
of second order at a jump of velocity."""


@dataclass(frozen=True)
class Method:
    """A method as data.

    Attributes:
        text: What it is and where its limits lie, in words.
        stable: Whether it is stable only up to courant 1 ("limited") or at any ("always").
        plannable: Whether the plan may choose it.
        mixes: Whether it takes bodies of different kinds together, with friction.
        bodies: Kinds of bodies it solves: "bar", "solid", "point", "rod", "beam", "rigid",
            "springs".
        exact: Whether it has neither mesh nor iterations, nor errors but those of rounding.
        layered: Whether it has time levels, on which events may fall; else triangles.
        assembled: Whether all layers are one linear system, which PETSc's solvers take.
        windowed: Whether one active-set loop can solve several layers.
        finite: Whether it takes bodies under finite strain.
        locates: Whether impacts are located one by one, so that they can share in turns, and the
            time step is that of the output.
        rubs: Whether it takes friction of one rigid body in the plane without the march.
        grows: Whether energy grows at its impacts.
        lively: Whether it may gain energy with restitution near 1.
        spring_walls: Whether it knows the spring of a wall that a bar meets.
        tolerance: Relative rounding level of the active set, if none is given.
        own: Keys of ``[solve]`` that belong to it alone.
        error: For bars, constant and rate of the largest relative displacement error seen for
            events between layers: error <= constant * contacts / elements^rate
            (benchmarks/error_constants.py).
    """

    text: str
    stable: Literal["limited", "always"] = "always"
    plannable: bool = True
    mixes: bool = False
    bodies: frozenset[str] = BAR
    error: tuple[float, float] = DISPERSIVE
    exact: bool = False
    layered: bool = True
    assembled: bool = False
    windowed: bool = False
    finite: bool = False
    locates: bool = False
    rubs: bool = False
    grows: bool = False
    lively: bool = False
    spring_walls: bool = False
    tolerance: float = 1e-13
    own: tuple[str, ...] = ()


METHODS: dict[str, Method] = {
    "galerkin": Method(
        "space-time P1 Petrov-Galerkin swept step by step or in windows with a primal-dual "
        "active set; exact at the nodes at courant 1 when impacts fall on time levels; first order "
        "in h off this mesh, where an impact costs energy of order h and a release can give back "
        "more (up to 0.4 % with 17 elements in 1500 random bars); courant < 1 rings, courant > 1 "
        "is refused; solids: the same form step by step (beta 0, lumped mass) with mass on the "
        "contact nodes, whose force rings",
        stable="limited",
        bodies=BOTH,
        error=(4.0, 1.0),
        windowed=True,
        spring_walls=True,
    ),
    "conserving": Method(
        "bars: the two waves are carried and reflected in closed form and kept as one straight "
        "line a time step with their mean and mean square: energy and momentum to rounding over "
        "any horizon at any courant number, first order in h off the time levels, exact on them; "
        "solids: midpoint rule, massless contact nodes and a discrete gradient, energy to rounding "
        "with fixed normals and pairs that follow",
        finite=True,
        mixes=True,
        bodies=BOTH,
        error=(1.0, 1.0),
    ),
    "dg": Method(
        "discontinuous P0, P1, P2 in space-time, upwind, on any triangles; diffuses jumps on "
        "unfitted meshes; with fitted = true the events and their characteristics become mesh "
        "lines and the error falls to rounding (up to 10 contacts: 8e-12 in 150 random scenes)",
        layered=False,
        windowed=True,
        tolerance=1e-10,
        own=("degree", "fitted"),
    ),
    "exact": Method(
        "characteristics of a homogeneous bar; exact for piecewise linear initial data, thousands "
        "of bounces in a fraction of a second",
        exact=True,
        tolerance=1e-10,
    ),
    "monolithic": Method(
        "the founding computation: galerkin on a Gmsh mesh as one space-time system by DOLFINx and "
        "MUMPS, one active set for the whole interval, or PETSc's SNES VI; an independent check of "
        "the swept galerkin at higher cost",
        stable="limited",
        error=(4.0, 1.0),
        assembled=True,
        spring_walls=True,
        tolerance=1e-10,
    ),
    "newmark": Method(
        "NEGATIVE CONTROL: Newmark 1/4 with contact imposed on positions; energy grows at every "
        "impact (of a bar 190-fold in seven) and the force rings; never chosen by the plan",
        plannable=False,
        grows=True,
        bodies=BOTH,
    ),
    "massless": Method(
        "Newmark 1/4 with the mass of contact nodes moved to their neighbours: the force follows "
        "from the elastic state and does not ring; energy does not grow; stable at any courant "
        "number",
        finite=True,
        mixes=True,
        bodies=SOLID,
    ),
    "explicit": Method(
        "central differences with lumped mass and massless contact nodes: no system to solve but "
        "that of the contact; stable up to courant 1 only",
        finite=True,
        mixes=True,
        stable="limited",
        bodies=SOLID,
    ),
    "moreau_jean": Method(
        "theta method 1/2 with impact on velocities (Moreau and Jean): energy never grows, "
        "nodes penetrate by a fraction of a step's displacement; in solids the force rings with "
        "the step; points, rods, beams and rigid bodies: any restitution, first order in dt, "
        "impacts are not located",
        mixes=True,
        bodies=SOLID | VIBRO | RIGID | SPRINGS,
    ),
    "event_driven": Method(
        "flights between impacts that are located one by one: exact to rounding where the free "
        "motion is linear, by an integrator of order 8 elsewhere; lasting contact by "
        "complementarity; cost grows with the number of impacts; of rigid bodies one alone among "
        "half-spaces",
        bodies=VIBRO | RIGID,
        locates=True,
        rubs=True,
        own=("stick_speed",),
    ),
    "paoli_schatzman": Method(
        "position-level scheme: one projection a step, restitution built in, needs no detection "
        "and passes accumulations of impacts; first order in dt; of rigid bodies one alone among "
        "half-spaces",
        bodies=VIBRO | RIGID,
        lively=True,
    ),
    "energy_momentum": Method(
        "discrete gradient of mean values: energy of smooth motions, and momenta of coordinates "
        "that it does not depend on, to rounding over any horizon; second order, of impacts first; "
        "dense systems in Python",
        bodies=VIBRO,
    ),
    **{
        name: Method(f"TEACHING CONTROL: {text}", plannable=False, bodies=VIBRO)
        for name, text in (
            ("explicit_euler", "first order; amplitudes of vibrations grow in every step"),
            ("implicit_euler", "first order; stable at any step, but it damps what vibrates"),
            (
                "symplectic_euler",
                "first order; energy is bounded up to h omega = 2, where it breaks down",
            ),
            (
                "midpoint",
                "second order; linear vibrations keep their energy at any step, the period grows",
            ),
            ("trapezoid", "second order; of linear systems the midpoint rule in other clothes"),
            (
                "rk4",
                "fourth order, of Kutta; stable up to h omega = 2.828; loses energy slowly",
            ),
        )
    },
}
"""Methods by name; `impactfem.extend` adds others."""


def is_exact(name: str | None) -> bool:
    """Whether a method is the exact solution; not if none is named."""
    return name is not None and METHODS[name].exact


def is_explicit(name: str | None) -> bool:
    """Whether a method solves solids with a lumped mass, up to a stability limit."""
    return name is not None and METHODS[name].stable == "limited" and METHODS[name].bodies >= SOLID
