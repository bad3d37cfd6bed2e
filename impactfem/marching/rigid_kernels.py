"""Compiled parts of layers of many rigid bodies: what turns, moves with them and pushes them.

Places are listed body after body, each with the number of its body.
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.marching.turn_kernels import turn
from impactfem.system.vector_kernels import across, by, dot


@compiled
def turn_all(inertia, inverse, rotations, spins, impulses, dt, chosen, straight, free):
    """The rotations of a layer of some bodies; see `impactfem.marching.turn_kernels.turn`.

    Args:
        inertia, inverse: J [kg m^2] of all bodies and its inverse, (bodies, 3, 3).
        rotations: At the start, (bodies, 3, 3).
        spins: [rad/s], (bodies, 3).
        impulses: Of moments in space [N m s], (bodies, 3).
        dt: [s].
        chosen: Which bodies, (some,).
        straight: See `turn`.
        free: See `turn`, (bodies,).

    Returns:
        What `turn` writes, with an axis of the chosen bodies before, and which were found.
    """
    count = len(chosen)
    new, half = np.empty((count, 3)), np.empty((count, 3))
    end, middle = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    freedom, found = np.empty((count, 3, 3)), np.empty(count, dtype=np.bool_)
    for i in range(count):
        k = chosen[i]
        found[i] = turn(
            inertia[k], inverse[k], rotations[k], spins[k], impulses[k], dt, straight,
            free[k], new[i], half[i], end[i], middle[i], freedom[i],
        )  # fmt: skip
    return new, half, end, middle, freedom, found


@compiled
def frames(angles):
    """Rotations (bodies, 3, 3) by angles (bodies, 1) or unit quaternions (bodies, 4)."""
    found = np.zeros((len(angles), 3, 3))
    for k in range(len(angles)):
        if angles.shape[1] == 1:
            c, s = np.cos(angles[k, 0]), np.sin(angles[k, 0])
            found[k, 0, 0], found[k, 0, 1], found[k, 1, 0], found[k, 1, 1] = c, -s, s, c
            found[k, 2, 2] = 1.0
            continue
        w, x, y, z = angles[k]
        found[k, 0, 0] = 1.0 - 2.0 * (y * y + z * z)
        found[k, 0, 1] = 2.0 * (x * y - w * z)
        found[k, 0, 2] = 2.0 * (x * z + w * y)
        found[k, 1, 0] = 2.0 * (x * y + w * z)
        found[k, 1, 1] = 1.0 - 2.0 * (x * x + z * z)
        found[k, 1, 2] = 2.0 * (y * z - w * x)
        found[k, 2, 0] = 2.0 * (x * z - w * y)
        found[k, 2, 1] = 2.0 * (y * z + w * x)
        found[k, 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return found


@compiled
def turned_further(angles, halves, ways):
    """Angles or unit quaternions turned about axes of the bodies by 2 atan |half|, (bodies, 3).

    Angles are counted over whole turns: `ways` tell them, mean spins times the step (bodies, 3).
    """
    found = np.empty_like(angles)
    for k in range(len(angles)):
        a, b, c = halves[k]
        if angles.shape[1] == 1:
            turn_ = 2.0 * np.arctan(c)
            whole = 2.0 * np.pi * np.round((ways[k, 2] - turn_) / (2.0 * np.pi))
            found[k, 0] = angles[k, 0] + (turn_ + whole)
            continue
        w, x, y, z = angles[k]
        found[k, 0] = w - x * a - y * b - z * c
        found[k, 1] = w * a + x + y * c - z * b
        found[k, 2] = w * b + y + z * a - x * c
        found[k, 3] = w * c + z + x * b - y * a
        found[k] /= np.sqrt((found[k] * found[k]).sum())
    return found


@compiled
def turned(rotations, of, arms):
    """Arms (places, 3) along the axes of bodies, in space."""
    found = np.empty_like(arms)
    for i in range(len(arms)):
        turn_, (x, y, z) = rotations[of[i]], arms[i]
        for j in range(3):
            found[i, j] = turn_[j, 0] * x + turn_[j, 1] * y + turn_[j, 2] * z
    return found


@compiled
def carried(speeds, spins, of, arms, dim):
    """What moves with bodies at arms (places, 3): speeds + spins x arms, (several, places, dim).

    Args:
        speeds, spins: In space, (several, bodies, 3).
        of: Body of each place, (places,).
        arms: In space.
        dim: Components that are asked for.
    """
    found = np.empty((len(speeds), len(of), dim))
    for s in range(len(speeds)):
        for i in range(len(of)):
            v, (a, b, c), (x, y, z) = speeds[s, of[i]], spins[s, of[i]], arms[i]
            found[s, i, 0] = v[0] + b * z - c * y
            found[s, i, 1] = v[1] + c * x - a * z
            if dim == 3:
                found[s, i, 2] = v[2] + a * y - b * x
    return found


@compiled
def gathered(forces, of, arms, count):
    """Forces and moments on bodies, (several, bodies, 6), by forces (several, places, dim)."""
    found = np.zeros((len(forces), count, 6))
    for s in range(len(forces)):
        for i in range(len(of)):
            f, g = forces[s, i, 0], forces[s, i, 1]
            h = forces[s, i, 2] if forces.shape[2] == 3 else 0.0
            if f == 0.0 and g == 0.0 and h == 0.0:
                continue
            own, (x, y, z) = found[s, of[i]], arms[i]
            own[0] += f
            own[1] += g
            own[2] += h
            own[3] += y * h - z * g
            own[4] += z * f - x * h
            own[5] += x * g - y * f
    return found


@compiled
def summed(mass, inertia, moved, speed, spin, rotated, dim):
    """Kinetic energy, momenta and attitude of bodies; see `impactfem.marching.rigid_sums.sums_of`.

    Returns:
        (bodies,); momentum, first moment of mass and angular momentum, (bodies, 2 dim + 1 or 3);
        moments of inertia that turn with them and about axes, (bodies, 2 dim dim). Only the polar
        factor of the first is asked for: of a rod the moments of mass would not have one.
    """
    count, turns = len(mass), dim * (dim - 1) // 2
    energy, vectors = np.empty(count), np.empty((count, 2 * dim + turns))
    attitude = np.zeros((count, 2, dim, dim))
    for k in range(count):
        own, along = rotated[k], by(inertia[k], spin[k])
        energy[k] = 0.5 * (mass[k] * dot(speed[k], speed[k]) + dot(spin[k], along))
        angular = by(own, along)
        for i in range(dim):
            vectors[k, i], vectors[k, dim + i] = mass[k] * speed[k, i], mass[k] * moved[k, i]
        for i in range(turns):
            vectors[k, 2 * dim + i] = angular[3 - turns + i]
        j = inertia[k]
        size = j[2, 2] if dim == 2 else j[0, 0] + j[1, 1] + j[2, 2]
        for i in range(dim):
            row = across(j, own[i])
            attitude[k, 1, i, i] = 0.5 * size
            for m in range(dim):
                attitude[k, 0, i, m] = size * own[i, m]
                if dim == 3:
                    attitude[k, 1, i, m] -= dot(row, own[m])
    return energy, vectors, attitude.reshape(count, -1)


@compiled
def root_entries(of, arms, light, freedoms, dim):
    """Entries of the roots of answers, row by row, and their columns.

    A place moves by coordinates of its body, whose answer to their forces is 1: the centre's
    divided by the root of the mass, turns by the lower triangular root L of the freedom.

    Args:
        of: Body of each place, (places,).
        arms: In space [m], (places, 3).
        light: Inverse roots of masses, (bodies,).
        freedoms: Inverse moments of inertia, (bodies, 3, 3).
        dim: Dimension.
    """
    turns = dim * (dim - 1) // 2
    values = np.empty((len(of), dim, 1 + turns))
    columns = np.empty((len(of), dim, 1 + turns), dtype=np.int32)
    lower = np.zeros((len(freedoms), 3, 3))
    for k in range(len(freedoms)):
        own, a = lower[k], freedoms[k]
        if dim == 2:
            own[2, 2] = np.sqrt(a[2, 2])
            continue
        own[0, 0] = np.sqrt(a[0, 0])
        own[1, 0], own[2, 0] = a[1, 0] / own[0, 0], a[2, 0] / own[0, 0]
        own[1, 1] = np.sqrt(a[1, 1] - own[1, 0] ** 2)
        own[2, 1] = (a[2, 1] - own[2, 0] * own[1, 0]) / own[1, 1]
        own[2, 2] = np.sqrt(a[2, 2] - own[2, 0] ** 2 - own[2, 1] ** 2)
    for i in range(len(of)):
        own, (x, y, z), first = lower[of[i]], arms[i], of[i] * (dim + turns)
        for j in range(dim):
            values[i, j, 0], columns[i, j, 0] = light[of[i]], first + j
        for t in range(turns):
            a, b, c = own[0, 3 - turns + t], own[1, 3 - turns + t], own[2, 3 - turns + t]
            values[i, 0, 1 + t] = b * z - c * y
            values[i, 1, 1 + t] = c * x - a * z
            if dim == 3:
                values[i, 2, 1 + t] = a * y - b * x
            for j in range(dim):
                columns[i, j, 1 + t] = first + dim + t
    return values.ravel(), columns.ravel()
