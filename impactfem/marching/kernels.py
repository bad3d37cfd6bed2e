"""Compiled time loops of a chain with one contact; nothing is allocated inside them.

All quantities are per rho A. A layer costs a few passes over the nodes. Arrays of results are
filled from row ``first`` on, so that a window of layers can be solved again with another set.
"""

import numpy as np

from impactfem.compiled import compiled

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
    mass, stiffness, element_mass, spring, dt, clamped, velocity, loads, forces, pushes, ways,
    damper, now, step, push, speeds, first, last, marks,
    kept, displacement, rate, gap, far, multiplier, kinetic, elastic, mean, work,
):  # fmt: skip
    """March the layers first ... last - 1 of the Petrov-Galerkin recursion.

        M (u^{m+1} - 2 u^m + u^{m-1})
            = dt^2 (f_m - K u^m) - dt^2 (lambda_m + lambda_{m+1}) / 2 e_0

    which is P1 on right triangles with lumped mass. The row of test node 0 has half of everything
    and dt M v0. In each layer lambda_{m+1} is the one unknown of a scalar complementarity problem
    with u^{m+1}_0 (mark DECIDE), or the set is given (mark 0 or 1). Deciding needs no tolerance: a
    multiplier of the size of rounding does not matter.

    Args:
        mass, stiffness, element_mass: Of the chain.
        spring: Stiffness of the wall over rho A [m/s^2], 0 of a rigid one. Contact then is lambda =
            spring (u^m_0 + u^{m+1}_0) / 2 < 0: the mean over the layer of u - lambda / spring = 0.
        dt: Time step [s].
        clamped: Whether the last node is held.
        velocity: Initial velocity [m/s]; used if first = 0.
        loads: Gravity of each row [m/s^2].
        forces: Of the load on each node in each layer [m^2/s^2], as `node_loads` has them.
        pushes: Force on the last node in each row [m^2/s^2].
        ways: Of the last node in each layer, where it is held [m].
        damper: Of the last node over rho A [m/s]: its force is that by the speed of each row, the
            central difference; the first row has that of its layer.
        now: u^first, shape (nodes,); becomes u^last.
        step: u^first - u^{first-1}; becomes that of the last layer. Summing steps keeps rounding
            errors to one per layer, where 2 u^m - u^{m-1} would let them grow with its square.
        push: lambda_first.
        speeds: Velocity of each element at the level ``first`` [m/s]; becomes that at ``last``.
            Empty: energies are those of layers, else of levels (`impactfem.system.fronts`).
        first, last: Layers.
        marks: Set of each layer of this call, (last - first,).
        kept: Levels at which fields are stored, increasing.
        displacement, rate: Fields at those levels, filled.
        gap, far, multiplier, kinetic, elastic, mean, work: Filled rows first + 1 ... last
            (multiplier: from first on); far: of the last two nodes; work: of the load.

    Returns:
        lambda of the last layer.
    """
    n = len(mass)
    old = np.empty(n)
    total = mass.sum()
    response = 0.5 * dt * dt / mass[0]  # of u_0 to -lambda
    levels, loaded = len(speeds) > 0, len(forces) > 0
    slot = 0
    while slot < len(kept) and kept[slot] <= first:
        slot += 1
    for m in range(first, last):
        own, past = min(m, len(forces) - 1), max(min(m, len(forces)) - 1, 0)
        half, ongoing = (0.5, 0.0) if m == 0 else (1.0, 1.0)
        pull = 0.0
        for j in range(n):
            ahead = stiffness[j] * (now[j + 1] - now[j]) if j < n - 1 else 0.0
            change = half * dt * dt * ((ahead - pull) / mass[j] - loads[m])
            if j == n - 1:
                change += half * dt * dt * pushes[m] / mass[j]
            if loaded:
                force = 0.5 * (forces[past, j] + forces[own, j])
                change += half * dt * dt * force / mass[j]
            if m == 0:
                change += dt * velocity[j]
            old[j] = step[j]
            step[j] = step[j] * ongoing + change
            pull = ahead
        if damper > 0.0:
            held = 0.5 * dt * damper / mass[n - 1]
            step[n - 1] = (step[n - 1] - held * ongoing * old[n - 1]) / (1.0 + held)
        step[0] -= push * response
        free = now[0] + step[0]
        mark = marks[m - first]
        reach = free if spring == 0.0 else 0.5 * (now[0] + free)
        active = reach < 0.0 if mark == DECIDE else mark == 1
        push = 0.0
        if active and spring > 0.0:
            push = spring * reach / (1.0 + 0.5 * spring * response)
            step[0] -= push * response
        elif active:
            push = free / response
            step[0] = -now[0]
        if clamped:
            step[n - 1] = ways[m]
        done = 0.0
        if loaded:
            for j in range(n):
                if levels:
                    done += forces[own, j] * step[j]
                else:  # between the middles of layers
                    done += 0.25 * (forces[past, j] + forces[own, j]) * (step[j] + old[j])
        work[m + 1] = work[m] + done
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
        if levels:
            kinetic[m + 1], elastic[m + 1] = 0.0, 0.0
            for j in range(n - 1):
                speeds[j] = (step[j] + step[j + 1]) / dt - speeds[j]
                d = now[j + 1] + step[j + 1] - now[j] - step[j]
                kinetic[m + 1] += 0.5 * element_mass[j] * speeds[j] * speeds[j]
                elastic[m + 1] += 0.5 * stiffness[j] * d * d
        multiplier[m] = push
        mean[m + 1] = moment / total
        # The velocity at a level is the mean of its two layers: stored when the second is known.
        if slot > 0 and kept[slot - 1] == m and m > 0:
            for j in range(n):
                rate[slot - 1, j] = 0.5 * (step[j] + old[j]) / dt
        for j in range(n):
            now[j] += step[j]
        gap[m + 1] = now[0]
        far[m + 1, 0], far[m + 1, 1] = now[n - 2], now[n - 1]
        if slot < len(kept) and kept[slot] == m + 1:
            for j in range(n):
                displacement[slot, j] = now[j]
                rate[slot, j] = step[j] / dt
            slot += 1
    return push


@compiled
def two_step_reversed(
    mass, stiffness, dt, clamped, forces, pushes, u, multiplier, marks, last, of_u, of_multiplier,
    of_mass, of_stiffness, of_velocity, of_loads, of_forces, of_pushes, of_ways,
):  # fmt: skip
    """Derivatives of a number by what `two_step` is given, from those by what it tells.

    The same order reversed, with its active set: one transposed solve of all its layers.

    Args:
        mass, stiffness, dt, clamped, forces, pushes: As given to it.
        u: u^m, (layers + 1, nodes).
        multiplier: lambda of each layer.
        marks: Set of each layer, 0 or 1.
        last: Level after which nothing counts.
        of_u: Derivative by each u^m, likewise; becomes that by u^0 in its row 0, the others are
            used up.
        of_multiplier: Derivative by lambda of each layer; likewise used up.
        of_mass, of_stiffness, of_velocity, of_loads, of_forces, of_pushes, of_ways: Added to.
    """
    n = len(mass)
    step = np.zeros(n)  # by the step of a layer
    inner = np.empty(n)
    response = 0.5 * dt * dt / mass[0]
    of_response = 0.0
    loaded = len(forces) > 0
    for m in range(last - 1, -1, -1):
        own, past = min(m, len(forces) - 1), max(min(m, len(forces)) - 1, 0)
        half, ongoing = (0.5, 0.0) if m == 0 else (1.0, 1.0)
        for j in range(n):
            step[j] += of_u[m + 1, j]
            of_u[m, j] += of_u[m + 1, j]
        if clamped:
            of_ways[m] += step[n - 1]
            step[n - 1] = 0.0
        if marks[m] == 1:
            of_u[m, 0] -= step[0]
            step[0] = of_multiplier[m] / response
            of_u[m, 0] += step[0]
            of_response -= step[0] * multiplier[m]
        if m > 0:
            of_multiplier[m - 1] -= response * step[0]
            of_response -= multiplier[m - 1] * step[0]
        pull = 0.0
        for j in range(n):
            ahead = stiffness[j] * (u[m, j + 1] - u[m, j]) if j < n - 1 else 0.0
            force = ahead - pull
            pull = ahead
            given = half * dt * dt * step[j]
            inner[j] = given / mass[j]
            of_loads[m] -= given
            if j == n - 1:
                force += pushes[m]
                of_pushes[m] += inner[j]
            if loaded:
                force += 0.5 * (forces[past, j] + forces[own, j])
                of_forces[past, j] += 0.5 * inner[j]
                of_forces[own, j] += 0.5 * inner[j]
            of_mass[j] -= inner[j] * force / mass[j]
            if m == 0:
                of_velocity[j] += dt * step[j]
            step[j] *= ongoing
        for j in range(n - 1):
            turn = inner[j] - inner[j + 1]
            of_stiffness[j] += turn * (u[m, j + 1] - u[m, j])
            of_u[m, j + 1] += stiffness[j] * turn
            of_u[m, j] -= stiffness[j] * turn
    of_mass[0] -= of_response * response / mass[0]


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
