"""Compiled time loop of a row of bars with contact between end nodes."""

import numpy as np

from impactfem.compiled import compiled


@compiled
def two_step_row(
    mass, stiffness, dt, clamped, velocity, ends, near, far, reach, now, layers,
    kept, displacement, rate, gap, force, kinetic, elastic, mean,
):  # fmt: skip
    """March the Petrov-Galerkin recursion of all bars, with node-to-node contact.

        M (u^{m+1} - 2 u^m + u^{m-1}) = -dt^2 K u^m + dt^2 (F_m + F_{m+1}) / 2 (e_near - e_far)

    Test node 0 has half of everything and dt M v0. In each layer F_{m+1} >= 0 and the gap at
    t_{m+1} are complementary; end nodes belong to one pair each, so that every pair is a scalar
    problem, solved in closed form.

    Args:
        mass: Of all nodes, bar after bar [kg], shape (nodes,).
        stiffness: E A / h of the element that follows a node [N/m], 0 at the last one of a bar.
        dt: Time step [s].
        clamped: Whether the last node of all is held.
        velocity: Initial velocity [m/s], shape (nodes,).
        ends: First node of each bar, and the number of nodes, shape (bars + 1,).
        near: Node behind the gap of each pair, shape (pairs,).
        far: Node before it, -1 for the wall.
        reach: Place of the far node beyond its displacement: length of its bar [m], 0 of a wall.
        now: Displacement at t = 0 [m]; becomes the final one.
        layers: Number of layers.
        kept: Levels at which fields are stored, increasing.
        displacement, rate: Fields at those levels, filled.
        gap: [m], (layers + 1, pairs), filled from row 1 on.
        force: [N], (layers, pairs), filled.
        kinetic, elastic: [J], (layers + 1, bars), filled from row 1 on.
        mean: Displacement of the centre of mass [m], (layers + 1, bars), filled from row 1 on.
    """
    n = len(mass)
    pairs = len(near)
    step = np.zeros(n)
    old = np.zeros(n)
    push = np.zeros(pairs)
    slot = 0
    while slot < len(kept) and kept[slot] <= 0:
        slot += 1
    for m in range(layers):
        half, ongoing = (0.5, 0.0) if m == 0 else (1.0, 1.0)
        pull = 0.0
        for j in range(n):
            ahead = stiffness[j] * (now[j + 1] - now[j]) if stiffness[j] > 0.0 else 0.0
            change = half * dt * dt * (ahead - pull) / mass[j]
            if m == 0:
                change += dt * velocity[j]
            old[j] = step[j]
            step[j] = step[j] * ongoing + change
            pull = ahead
        for c in range(pairs):
            a, b = far[c], near[c]
            towards = 0.5 * dt * dt / mass[b]
            away = 0.5 * dt * dt / mass[a] if a >= 0 else 0.0
            step[b] += push[c] * towards
            place = reach[c]
            if a >= 0:
                step[a] -= push[c] * away
                place += now[a] + step[a]
            free = now[b] + step[b] - place
            push[c] = 0.0
            if free < 0.0:
                push[c] = -free / (towards + away)
                step[b] += push[c] * towards
                if a >= 0:
                    step[a] -= push[c] * away
            gap[m + 1, c] = max(free, 0.0)
            force[m, c] = push[c]
        if clamped:
            step[n - 1] = 0.0
        # E = v (M - dt^2 K / 4) v / 2 + w K w / 2, v and w of the layer.
        for k in range(len(ends) - 1):
            moving = 0.0
            strained = 0.0
            spread = 0.0
            moment = 0.0
            total = 0.0
            for j in range(ends[k], ends[k + 1]):
                moving += mass[j] * step[j] * step[j]
                moment += mass[j] * (now[j] + step[j])
                total += mass[j]
                if stiffness[j] > 0.0:
                    turn = step[j + 1] - step[j]
                    w = now[j + 1] - now[j] + 0.5 * turn
                    strained += stiffness[j] * w * w
                    spread += stiffness[j] * turn * turn
            kinetic[m + 1, k] = 0.5 * (moving / (dt * dt) - 0.25 * spread)
            elastic[m + 1, k] = 0.5 * strained
            mean[m + 1, k] = moment / total
        # The velocity at a level is the mean of its two layers: stored when the second is known.
        if slot > 0 and kept[slot - 1] == m and m > 0:
            for j in range(n):
                rate[slot - 1, j] = 0.5 * (step[j] + old[j]) / dt
        for j in range(n):
            now[j] += step[j]
        if slot < len(kept) and kept[slot] == m + 1:
            for j in range(n):
                displacement[slot, j] = now[j]
                rate[slot, j] = step[j] / dt
            slot += 1
