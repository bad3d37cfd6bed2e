"""Compiled time loops of a chain with one contact; nothing is allocated inside them.

All quantities are per rho A. A layer costs a few passes over the nodes. Arrays of results are
filled from row ``first`` on, so that a window of layers can be solved again with another set.
"""

import math

import numpy as np
from numpy.typing import NDArray

from impactfem.compiled import compiled

Floats = NDArray[np.float64]

DECIDE = -1
"""Mark of a layer in which the loop itself decides whether contact is active."""


@compiled
def factor(diagonal, beside):
    """Factor a symmetric positive definite tridiagonal matrix as L D L^T, in place of its copy.

    Args:
        diagonal: Shape (n,).
        beside: Off-diagonal, shape (n - 1,).

    Returns:
        1/D (n,) and the subdiagonal of L (n - 1,).
    """
    n = len(diagonal)
    inverse = np.empty(n)
    lower = np.empty(max(n - 1, 0))
    inverse[0] = 1.0 / diagonal[0]
    for j in range(1, n):
        lower[j - 1] = beside[j - 1] * inverse[j - 1]
        inverse[j] = 1.0 / (diagonal[j] - lower[j - 1] * beside[j - 1])
    return inverse, lower


@compiled
def substitute(inverse, lower, x):
    """Solve with the factors of `factor`; x is the right-hand side and becomes the solution."""
    n = len(inverse)
    for j in range(1, n):
        x[j] -= lower[j - 1] * x[j - 1]
    x[n - 1] *= inverse[n - 1]
    for j in range(n - 2, -1, -1):
        x[j] = x[j] * inverse[j] - lower[j] * x[j + 1]


@compiled
def two_step(
    mass, stiffness, dt, clamped, velocity, loads,
    now, step, push, first, last, marks,
    kept, displacement, rate, gap, multiplier, kinetic, elastic, mean,
):  # fmt: skip
    """March the layers first ... last - 1 of the Petrov-Galerkin recursion.

        M (u^{m+1} - 2 u^m + u^{m-1})
            = dt^2 (f_m - K u^m) - dt^2 (lambda_m + lambda_{m+1}) / 2 e_0

    which is P1 on right triangles with lumped mass. The row of test node 0 has half of everything
    and dt M v0. In each layer lambda_{m+1} is the one unknown of a scalar complementarity problem
    with u^{m+1}_0 (mark DECIDE), or the set is given (mark 0 or 1). Deciding needs no tolerance: a
    multiplier of the size of rounding does not matter.

    Args:
        mass, stiffness: Of the chain.
        dt: Time step [s].
        clamped: Whether the last node is held.
        velocity: Initial velocity [m/s]; used if first = 0.
        loads: Gravity of each row [m/s^2].
        now: u^first, shape (nodes,); becomes u^last.
        step: u^first - u^{first-1}; becomes that of the last layer. Summing steps keeps rounding
            errors to one per layer, where 2 u^m - u^{m-1} would let them grow with its square.
        push: lambda_first.
        first, last: Layers.
        marks: Set of each layer of this call, (last - first,).
        kept: Levels at which fields are stored, increasing.
        displacement, rate: Fields at those levels, filled.
        gap, multiplier, kinetic, elastic, mean: Filled rows first + 1 ... last (multiplier: from
            first on).

    Returns:
        lambda of the last layer.
    """
    n = len(mass)
    old = np.empty(n)
    total = mass.sum()
    response = 0.5 * dt * dt / mass[0]  # of u_0 to -lambda
    slot = 0
    while slot < len(kept) and kept[slot] <= first:
        slot += 1
    for m in range(first, last):
        half, ongoing = (0.5, 0.0) if m == 0 else (1.0, 1.0)
        pull = 0.0
        for j in range(n):
            ahead = stiffness[j] * (now[j + 1] - now[j]) if j < n - 1 else 0.0
            change = half * dt * dt * ((ahead - pull) / mass[j] - loads[m])
            if m == 0:
                change += dt * velocity[j]
            old[j] = step[j]
            step[j] = step[j] * ongoing + change
            pull = ahead
        step[0] -= push * response
        free = now[0] + step[0]
        mark = marks[m - first]
        active = free < 0.0 if mark == DECIDE else mark == 1
        push = 0.0
        if active:
            push = free / response
            step[0] = -now[0]
        if clamped:
            step[n - 1] = 0.0
        # E = v (M - dt^2 K / 4) v / 2 + w K w / 2, v and w of the layer.
        moving = 0.0
        strained = 0.0
        spread = 0.0
        moment = 0.0
        for j in range(n):
            moving += mass[j] * step[j] * step[j]
            moment += mass[j] * (now[j] + step[j])
            if j < n - 1:
                turn = step[j + 1] - step[j]
                w = now[j + 1] - now[j] + 0.5 * turn
                strained += stiffness[j] * w * w
                spread += stiffness[j] * turn * turn
        moving /= dt * dt
        kinetic[m + 1] = 0.5 * (moving - 0.25 * spread)
        elastic[m + 1] = 0.5 * strained
        multiplier[m] = push
        mean[m + 1] = moment / total
        # The velocity at a level is the mean of its two layers: stored when the second is known.
        if slot > 0 and kept[slot - 1] == m and m > 0:
            for j in range(n):
                rate[slot - 1, j] = 0.5 * (step[j] + old[j]) / dt
        for j in range(n):
            now[j] += step[j]
        gap[m + 1] = now[0]
        if slot < len(kept) and kept[slot] == m + 1:
            for j in range(n):
                displacement[slot, j] = now[j]
                rate[slot, j] = step[j] / dt
            slot += 1
    return push


@compiled
def _step_of_contact_node(a, drift, compliance, k):
    """Solve x = drift - s DV(a, x), V(x) = k min(x, 0)^2 / 2, DV(a, x) = (V(x) - V(a)) / (x - a).

    The left side minus the right increases with x, so there is one solution; in each case it is
    the root of a linear or quadratic equation.

    Args:
        a: Position at the start of the step [m].
        drift: Position at its end without the potential [m].
        compliance: s [s^2/m].
        k: Stiffness of the element at the wall [m/s^2].

    Returns:
        DV(a, x) <= 0.
    """
    s = compliance
    if a > 0.0:
        if drift >= 0.0:
            return 0.0
        # x < 0: (x - drift) (x - a) + s k x^2 / 2 = 0, the smaller root.
        two = 1.0 + 0.5 * s * k
        one = drift + a
        x = 2.0 * drift * a / (one + math.sqrt(one * one - 4.0 * two * drift * a))
        if one < 0.0:
            x = (one - math.sqrt(one * one - 4.0 * two * drift * a)) / (2.0 * two)
        return (drift - x) / s
    # a <= 0 and x <= 0: DV = k (a + x) / 2.
    x = (drift - 0.5 * s * k * a) / (1.0 + 0.5 * s * k)
    if x <= 0.0:
        return 0.5 * k * (a + x)
    # x > 0: (x - drift) (x - a) = s k a^2 / 2, the larger root.
    one = drift + a
    x = 0.5 * (one + math.sqrt((drift - a) * (drift - a) + 2.0 * s * k * a * a))
    return -0.5 * k * a * a / (x - a) if x > a else 0.0


@compiled
def measure(mass, stiffness, u, v, row, total, gap, kinetic, elastic, mean, momentum):
    """Gap, energies, mean displacement and velocity of a state (u, v), filled into a row."""
    n = len(mass)
    moving = 0.0
    moment = 0.0
    speed = 0.0
    strained = 0.0
    for j in range(n):
        moving += mass[j] * v[j] * v[j]
        moment += mass[j] * u[j]
        speed += mass[j] * v[j]
        if j < n - 1:
            d = u[j + 1] - u[j]
            strained += stiffness[j] * d * d
    gap[row] = u[0]
    kinetic[row] = 0.5 * moving
    elastic[row] = 0.5 * strained
    mean[row] = moment / total
    momentum[row] = speed / total


@compiled
def conserving(
    mass, stiffness, dt, clamped, loads, u, v, layers,
    kept, displacement, rate, gap, multiplier, kinetic, elastic, mean, momentum,
):  # fmt: skip
    """March by the midpoint rule with a massless contact node and a discrete gradient.

    The mass of node 0 is moved to node 1. Minimised over the massless node, the elastic energy of
    the first element is V(u_1) = k min(u_1, 0)^2 / 2, a potential of node 1, and

        M (v^{m+1} - v^m) / dt = -K (u^m + u^{m+1}) / 2 - p M - DV(u_1^m, u_1^{m+1}) e_1,
        (u^{m+1} - u^m) / dt = (v^m + v^{m+1}) / 2

    keeps the energy exactly whatever dt is (Gonzalez, J. Nonlinear Sci. 6 (1996) 449-467; massless
    node: Khenous, Laborde, Renard, Eur. J. Mech. A 27 (2008) 918-932). The contact force is DV.

    Args:
        mass, stiffness: Of the chain; node 0's mass is moved here.
        dt: Time step [s].
        clamped: Whether the last node is held.
        loads: Mean gravity of each layer [m/s^2].
        u, v: Initial state of all nodes; overwritten by the final one.
        layers: Number of layers.
        kept, displacement, rate, gap, multiplier, kinetic, elastic, mean, momentum: Filled.
    """
    n = len(mass)
    heavy = mass.copy()
    heavy[1] += heavy[0]
    heavy[0] = 0.0
    total = mass.sum()
    k = stiffness[0]
    stop = n - 1 if clamped else n  # nodes 1 ... stop - 1 move by themselves
    size = stop - 1
    diagonal = np.empty(size)
    beside = np.empty(max(size - 1, 0))
    for j in range(1, stop):
        left = stiffness[j - 1] if j > 1 else 0.0
        right = stiffness[j] if j < n - 1 else 0.0
        diagonal[j - 1] = 2.0 * heavy[j] / (dt * dt) + 0.5 * (left + right)
        if j < stop - 1:
            beside[j - 1] = -0.5 * stiffness[j]
    inverse, lower = factor(diagonal, beside)
    response = np.zeros(size)
    response[0] = 1.0
    substitute(inverse, lower, response)
    step = np.empty(size)
    # Row 0 belongs to the discrete state too: the massless node rests at its minimum.
    u[0] = max(u[1], 0.0)
    v[0] = v[1] if u[1] > 0.0 else 0.0
    measure(heavy, stiffness, u, v, 0, total, gap, kinetic, elastic, mean, momentum)
    slot = 0
    while slot < len(kept) and kept[slot] <= 0:
        slot += 1
    for m in range(layers):
        for j in range(1, stop):
            right = stiffness[j] * (u[j + 1] - u[j]) if j < n - 1 else 0.0
            left = stiffness[j - 1] * (u[j] - u[j - 1]) if j > 1 else 0.0
            step[j - 1] = 2.0 * heavy[j] * v[j] / dt + right - left - heavy[j] * loads[m]
        substitute(inverse, lower, step)
        push = _step_of_contact_node(u[1], u[1] + step[0], response[0], k)
        for j in range(1, stop):
            d = step[j - 1] - push * response[j - 1]
            u[j] += d
            v[j] = 2.0 * d / dt - v[j]
        u[0] = max(u[1], 0.0)
        v[0] = v[1] if u[1] > 0.0 else 0.0
        multiplier[m] = push
        measure(heavy, stiffness, u, v, m + 1, total, gap, kinetic, elastic, mean, momentum)
        if slot < len(kept) and kept[slot] == m + 1:
            for j in range(n):
                displacement[slot, j] = u[j]
                rate[slot, j] = v[j]
            slot += 1
