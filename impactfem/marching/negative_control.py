"""What goes wrong without care: Newmark's rule with contact imposed on positions."""

import numpy as np

from impactfem.compiled import compiled
from impactfem.marching.kernels import factor, measure, substitute


@compiled
def newmark(
    mass, stiffness, dt, clamped, loads, tolerance, u, v, layers,
    kept, displacement, rate, gap, multiplier, kinetic, elastic, mean, momentum,
):  # fmt: skip
    """Newmark's average acceleration with u_0 >= 0 imposed on positions: a negative control.

    Contact forces act through the acceleration and are not consistent with an impulse: energy is
    not bounded. Arguments as in `conserving`.
    """
    n = len(mass)
    diagonal = mass.copy()
    beside = np.empty(n - 1)
    weight = 0.25 * dt * dt
    for j in range(n - 1):
        diagonal[j] += weight * stiffness[j]
        diagonal[j + 1] += weight * stiffness[j]
        beside[j] = -weight * stiffness[j]
    if clamped:
        diagonal[n - 1] = 1.0
        beside[n - 2] = 0.0
    inverse, lower = factor(diagonal, beside)
    response = np.zeros(n)
    response[0] = 1.0
    substitute(inverse, lower, response)
    total = mass.sum()
    a = np.empty(n)
    new = np.empty(n)
    predicted = np.empty(n)
    pull = 0.0
    for j in range(n):
        ahead = stiffness[j] * (u[j + 1] - u[j]) if j < n - 1 else 0.0
        a[j] = (ahead - pull) / mass[j] - loads[0]
        pull = ahead
    if u[0] <= 0.0 and a[0] < 0.0:
        a[0] = 0.0
    if clamped:
        a[n - 1] = 0.0
    slot = 0
    while slot < len(kept) and kept[slot] <= 0:
        slot += 1
    for m in range(layers):
        for j in range(n):
            predicted[j] = u[j] + dt * v[j] + weight * a[j]
        pull = 0.0
        for j in range(n):
            ahead = stiffness[j] * (predicted[j + 1] - predicted[j]) if j < n - 1 else 0.0
            new[j] = ahead - pull - mass[j] * loads[m]
            pull = ahead
        if clamped:
            new[n - 1] = 0.0
        substitute(inverse, lower, new)
        push = 0.0
        position = predicted[0] + weight * new[0]
        if position < -tolerance:
            push = position / (weight * response[0])
            for j in range(n):
                new[j] -= push * response[j]
        for j in range(n):
            u[j] = predicted[j] + weight * new[j]
            v[j] += 0.5 * dt * (a[j] + new[j])
            a[j] = new[j]
        if push < 0.0:
            u[0] = 0.0
        multiplier[m] = push
        measure(mass, stiffness, u, v, m + 1, total, gap, kinetic, elastic, mean, momentum)
        if slot < len(kept) and kept[slot] == m + 1:
            for j in range(n):
                displacement[slot, j] = u[j]
                rate[slot, j] = v[j]
            slot += 1
