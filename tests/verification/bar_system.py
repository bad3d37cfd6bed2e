"""The elastic bar with its near end before a rigid wall, as a system of few degrees of freedom.

u_tt = c^2 u_xx - p on 0 < x < L by P1 elements: M u'' + K u = -p M 1 with the one constraint
u_0 >= 0, u(t, x) measured from the wall as in `impactfem.scene.Bar`. Mass and stiffness are those
of the bar, rho A and E A included.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from impactfem.errors import SceneError
from impactfem.scene.bodies import Bar
from impactfem.system.generalized import LinearSystem

Floats = NDArray[np.float64]
BarMass = Literal["lumped", "consistent"]


def bar_matrices(length: float, elements: int, *, lumped: bool) -> tuple[Floats, Floats]:
    """Mass per rho A [m] and stiffness per E A [1/m] of P1 elements, shape (n + 1, n + 1)."""
    h = length / elements
    mass, stiffness = np.zeros((2, elements + 1, elements + 1))
    local = np.eye(2) / 2.0 if lumped else np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
    for k in range(elements):
        mass[k : k + 2, k : k + 2] += h * local
        stiffness[k : k + 2, k : k + 2] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / h
    return mass, stiffness


def bar_system(
    bar: Bar,
    elements: int,
    *,
    mass: BarMass = "lumped",
    gravity: float = 0.0,
    restitution: float = 0.0,
) -> LinearSystem:
    """Discretise a bar in space; its free nodes are the coordinates [m].

    Args:
        bar: The bar; a clamped far end is no coordinate (held at its place at t = 0).
        elements: Number n of equal elements.
        mass: "lumped" or "consistent".
        gravity: Acceleration p towards the wall [m/s^2].
        restitution: Newton's e of the node at the near end. It has the mass rho A h / 2 (lumped),
            so its losses vanish with h.

    Raises:
        SceneError: A value is not allowed.
    """
    if elements < 1:
        raise SceneError(f"bar: elements = {elements} is not allowed: give 1 or more")
    if mass not in ("lumped", "consistent"):
        raise SceneError(f'bar: mass = {mass!r} is not allowed: give "lumped" or "consistent"')
    matrix, stiffness = bar_matrices(bar.length, elements, lumped=mass == "lumped")
    matrix *= bar.density * bar.area
    stiffness *= bar.youngs_modulus * bar.area
    load = -gravity * matrix.sum(axis=1)
    if bar.far_end == "clamped":
        held = float(bar.initial_displacement(x=bar.length))
        load -= held * stiffness[:, -1]
        matrix, stiffness, load = matrix[:-1, :-1], stiffness[:-1, :-1], load[:-1]
    size = len(load)
    return LinearSystem(
        mass=matrix,
        stiffness=stiffness,
        load=load.tolist(),
        normals=np.eye(1, size),
        offsets=np.zeros(1),
        restitution=restitution,
        names=tuple(f"u[{i}]" for i in range(size)),
    )


def bar_start(bar: Bar, elements: int) -> tuple[Floats, Floats]:
    """Displacement [m] and velocity [m/s] of the coordinates at t = 0."""
    count = elements + 1 if bar.far_end == "free" else elements
    x = np.linspace(0.0, bar.length, elements + 1)[:count]
    return (
        bar.initial_displacement(x=x) + np.zeros(count),
        bar.initial_velocity(x=x) + np.zeros(count),
    )
