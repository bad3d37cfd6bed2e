"""The solution methods of bars by name: what they are, and where their limits lie."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Family = Literal["marching", "monolithic", "dg", "exact"]


@dataclass(frozen=True)
class Method:
    """A method as data.

    Attributes:
        family: Which solver runs it: "marching" (compiled layers), "monolithic" (one space-time
            system), "dg" (discontinuous in space-time) or "exact".
        text: What it is and where its limits lie, in words.
        stable: Whether it is stable only up to courant 1 ("limited") or at any ("always").
        plannable: Whether the plan may choose it.
        error: Constant and rate of the largest relative displacement error seen for events between
            layers: error <= constant * contacts / elements^rate (benchmarks/error_constants.py).
            The rate 2/3 is that of schemes of second order at a jump of velocity.
    """

    family: Family
    text: str
    stable: Literal["limited", "always"] = "always"
    plannable: bool = True
    error: tuple[float, float] = (3.0, 2.0 / 3.0)


METHODS: Mapping[str, Method] = {
    "galerkin": Method(
        "marching",
        "space-time P1 Petrov-Galerkin swept layer by layer or in windows with a primal-dual "
        "active set; exact at the nodes at courant 1 when impacts fall on layers; first order in h "
        "off this mesh, where an impact costs energy of order h and a release can give back more "
        "(up to 0.4 % with 17 elements in 1500 random bars); courant < 1 rings, courant > 1 is "
        "refused",
        stable="limited",
        error=(4.0, 1.0),
    ),
    "conserving": Method(
        "marching",
        "midpoint rule, massless contact node, discrete gradient of the contact energy: keeps "
        "energy to rounding over any horizon at any courant number; force free of growing "
        "oscillations, peak at impact about 4/3 of the exact one, first order in the mean",
    ),
    "dg": Method(
        "dg",
        "discontinuous P0, P1, P2 in space-time, upwind, on any triangles; diffuses jumps on "
        "unfitted meshes; with fitted = true the events and their characteristics become mesh "
        "lines and the error falls to rounding (up to 10 contacts: 8e-12 in 150 random scenes)",
    ),
    "exact": Method(
        "exact",
        "characteristics of a homogeneous bar; exact for piecewise linear initial data, thousands "
        "of bounces in a fraction of a second",
    ),
    "monolithic": Method(
        "monolithic",
        "the founding computation: galerkin on a Gmsh mesh as one space-time system by DOLFINx and "
        "MUMPS, one active set for the whole interval, or PETSc's SNES VI; an independent check of "
        "the swept galerkin at higher cost",
        stable="limited",
        error=(4.0, 1.0),
    ),
    "newmark": Method(
        "marching",
        "NEGATIVE CONTROL: Newmark 1/4 with contact imposed on positions; energy grows at every "
        "impact (190-fold in seven) and the force rings; never chosen by the plan",
        plannable=False,
    ),
}
"""Methods by name."""
