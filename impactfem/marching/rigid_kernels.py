"""Compiled parts of layers of many rigid bodies: what turns, moves with them and pushes them.

Places are listed body after body, each with the number of its body.
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.marching.turn_kernels import turn
from impactfem.system.rim_kernels import NEAR, add_along_rim, lowest_direction
from impactfem.system.vector_kernels import across, by, dot, plus, put


@compiled
def settled(bodies, rotations, speeds, spins, impulses, dt, chosen, straight, ahead):
    """Rates and rotations at the end of a step of some bodies, by impulses in it, written.

    Args:
        bodies: Masses (bodies, 1) [kg], inertia J [kg m^2] and its inverse, (bodies, 3, 3), and
            `turn`'s free, (bodies,).
        rotations: At the start, (bodies, 3, 3).
        speeds, spins: There [m/s], along the axes of the bodies [rad/s], (bodies, 3).
        impulses: Of forces [N s] and of moments in space [N m s], (bodies, 3) each.
        dt: [s].
        chosen: Which bodies, (some,).
        straight: See `impactfem.marching.turn_kernels.turn`.
        ahead: Speeds and spins at the end, and halves, ends, middles and freedoms of `turn`.

    Returns:
        The first body whose rotation was not found, -1 without any.
    """
    mass, inertia, inverse, free = bodies
    speed, spin, half, end, middle, freedom = ahead
    for k in chosen:
        found = turn(
            inertia[k], inverse[k], rotations[k], spins[k], impulses[1][k], dt, straight,
            free[k], spin[k], half[k], end[k], middle[k], freedom[k],
        )  # fmt: skip
        if not found:
            return k
        for c in range(3):
            speed[k, c] = speeds[k, c] + impulses[0][k, c] / mass[k, 0]
    return -1


@compiled
def placed(rotations, centres, of, arms, beyond, start):
    """Arms (places, 3) along the axes of bodies in space, and displacements (places, dim).

    Args:
        rotations, centres: Of the bodies, (bodies, 3, 3) and (bodies, 3).
        of: Body of each place, (places,).
        arms: (places, 3).
        beyond: What is added to the arms in space, (places, 3).
        start: Where places were at t = 0, (places, dim).
    """
    bare = turned(rotations, of, arms)
    found = np.empty(start.shape)
    for i in range(len(of)):
        for c in range(start.shape[1]):
            found[i, c] = centres[of[i], c] + (bare[i, c] + beyond[i, c]) - start[i, c]
    return bare, found


@compiled
def around(rotations, of, rims, normals, lowest):
    """The part of the arms of places that is along rims [m], in space, (places, 3).

    Args:
        rotations: Of the bodies, (bodies, 3, 3).
        of: Body of each place, (places,).
        rims: Axes (places, 3) and shares (places, 2) of `impactfem.system.rigid.Rims`; or of none.
        normals, lowest: Of what places may touch, and directions to their lowest, (places, 3).
    """
    axes, shares = rims
    found = np.zeros(lowest.shape)
    for i in range(len(axes)):
        if shares[i, 0] != 0.0 or shares[i, 1] != 0.0:
            axis = by(rotations[of[i]], axes[i])
            down = lowest_direction(axis, normals[i], lowest[i], NEAR)
            add_along_rim(found[i], axis, down, shares[i])
    return found


@compiled
def looked_at(turns, centres, rates, half, of, arms, rims, offset, start):
    """Where places are at the end of a step, and where forces act.

    Args:
        turns: Rotations at the start of the step, amid it and at its end, (bodies, 3, 3) each.
        centres: At its start, (bodies, 3).
        rates: Velocities at both ends, (bodies, 3) each.
        half: Half the step [s].
        of, arms, start: As of `placed`.
        rims: Those of `around`, and its normals and lowest.
        offset: From nodes to where they touch, (places, 3).

    Returns:
        Arms in space amid it and at its end but for rims, where forces act, displacements at the
        end, arms along rims at the start, and lowest directions now.
    """
    first, middles, ends = turns
    circles, normals, lowest = rims
    begun, down = around(first, of, circles, normals, lowest), lowest.copy()
    for i in range(len(circles[0])):
        if circles[1][i, 0] != 0.0 or circles[1][i, 1] != 0.0:
            axis = by(ends[of[i]], circles[0][i])
            down[i] = lowest_direction(axis, normals[i], lowest[i], -1.0)
    there = np.empty_like(centres)
    for k in range(len(centres)):
        for c in range(3):
            there[k, c] = centres[k, c] + half * (rates[0][k, c] + rates[1][k, c])
    ended, found = placed(ends, there, of, arms, around(ends, of, circles, normals, down), start)
    amid, acting = turned(middles, of, arms), around(middles, of, circles, normals, down)
    for i in range(len(of)):
        for c in range(3):
            acting[i, c] = amid[i, c] + acting[i, c] + offset[i, c]
    return amid, ended, acting, found, begun, down


@compiled
def flown(bodies, rotations, centres, speeds, spins, force, moment, dt, straight, places):
    """A step of all bodies by forces and moments that stay, (bodies, 3) each.

    Args:
        bodies, straight: As of `settled`.
        rotations, centres, speeds, spins: At its start.
        force, moment: [N], [N m].
        dt: [s].
        places: What `looked_at` takes of these: of, arms, rims, offset, start.

    Returns:
        What `settled` tells, what it writes, and what `looked_at` tells.
    """
    shape, none = rotations.shape, np.zeros(speeds.shape)
    speed, spin, half = speeds.copy(), spins.copy(), np.zeros(speeds.shape)
    end, middle, freedom = np.empty(shape), np.empty(shape), np.empty(shape)
    ahead, impulses = (speed, spin, half, end, middle, freedom), (dt * force, dt * moment)
    every, given = np.arange(len(speeds)), (rotations, speeds, spins)
    lost = settled(bodies, *given, impulses, dt, every, straight, ahead)
    turns = rotations, middle, end
    looks = looked_at(turns, centres, (speeds, speed), 0.5 * dt, *places)
    return lost, ahead, none, none.copy(), looks


@compiled
def touched_at(turns, rates, dt, far, of, rims, known, begun, amid, rolling, following, dim):
    """Where places touch in a step, and ways that surfaces go there besides them.

    Args:
        turns, rims, of: As of `looked_at`.
        rates: Spins at both ends.
        dt: [s].
        far: As of `whirls`.
        known: Normals of what places touch now, (places, dim).
        begun, amid: As `looked_at` told them.
        rolling, following: As of `rolled_to`.
        dim: Components that are asked for.

    Returns:
        From nodes to where they touch, arms there, (places, 3) each; ways, (places, dim); the
        normals, (places, 3).
    """
    first, middles, ends = turns
    circles, normals, lowest = rims
    spins = whirls(first, rates[0], ends, rates[1], far)
    beyond = around(middles, of, circles, normals, lowest)
    offset, acting = rolled_to(known, rolling, following, amid, beyond)
    none, count = np.zeros((1, *spins.shape)), len(of)
    ways = carried(none, dt * spins.reshape(none.shape), of, beyond + offset, dim)[0]
    now = normals
    if len(circles[0]):
        now = np.zeros((count, 3))
        now[:, : known.shape[1]] = known
        moved = around(ends, of, circles, now, lowest)
        for i in range(count):
            for c in range(dim):
                ways[i, c] -= moved[i, c] - begun[i, c]
    return offset, acting, ways, now


@compiled
def arrived(centres, angles, speeds, spins, halves, dt, of, arms, rims, start):
    """Centres and angles at the end of a step (`gone_on`), rotations there, and what is `placed`.

    Args:
        centres, angles, speeds, spins, halves, dt: As of `gone_on`.
        of, arms, start: As of `placed`.
        rims: As of `looked_at`.
    """
    there, now = gone_on(centres, angles, speeds, spins, halves, dt)
    turns = frames(now)
    beyond = around(turns, of, *rims)
    bare, found = placed(turns, there, of, arms, beyond, start)
    return there, now, turns, bare, found


@compiled
def velocities_of(rotations, rates, of, arms, rims, offset, dim):
    """Of places with arms in space on bodies that spin about their axes, (places, dim).

    Args:
        rotations: Of the bodies, (bodies, 3, 3).
        rates: Velocities and spins along their axes, (bodies, 3) each.
        of, rims: As of `looked_at`.
        arms, offset: In space, those along rims are between them, (places, 3).
        dim: Components that are asked for.
    """
    found, beyond = np.empty((len(of), dim)), around(rotations, of, *rims)
    speeds, spins = rates
    for i in range(len(of)):
        k = of[i]
        a, b, c = by(rotations[k], spins[k])
        x = arms[i, 0] + beyond[i, 0] + offset[i, 0]
        y = arms[i, 1] + beyond[i, 1] + offset[i, 1]
        z = arms[i, 2] + beyond[i, 2] + offset[i, 2]
        found[i, 0] = speeds[k, 0] + (b * z - c * y)
        found[i, 1] = speeds[k, 1] + (c * x - a * z)
        if dim == 3:
            found[i, 2] = speeds[k, 2] + (a * y - b * x)
    return found


@compiled
def struck(forces, of, arms, dt, pushed, moved):
    """Add impulses and their moments, (bodies, 3) each, of forces (places, dim) in a step.

    Returns:
        The bodies that forces act on.
    """
    whole = gathered(forces.reshape(1, *forces.shape), of, arms, len(pushed))[0]
    acts = np.zeros(len(pushed), dtype=np.bool_)
    for k in range(len(pushed)):
        for c in range(3):
            pushed[k, c] += dt * whole[k, c]
            moved[k, c] += dt * whole[k, 3 + c]
            acts[k] = acts[k] or whole[k, c] != 0.0 or whole[k, 3 + c] != 0.0
    return np.flatnonzero(acts)


@compiled
def gone_on(centres, angles, speeds, spins, halves, dt):
    """Centres and angles at the end of a step; see `turned_further`.

    Args:
        centres, angles: At its start.
        speeds, spins: At both ends, (bodies, 3) each.
        halves: Of the rotation, (bodies, 3).
        dt: [s].
    """
    there, ways = np.empty_like(centres), np.empty_like(centres)
    for k in range(len(centres)):
        for c in range(3):
            there[k, c] = centres[k, c] + dt * (0.5 * (speeds[0][k, c] + speeds[1][k, c]))
            ways[k, c] = 0.5 * dt * (spins[0][k, c] + spins[1][k, c])
    return there, turned_further(angles, halves, ways)


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
def spun(arms, dim):
    """Velocities at arms in space (places, 3) by unit spins, (turns, places, dim)."""
    found = np.zeros((dim * (dim - 1) // 2, len(arms), dim))
    for i in range(len(arms)):
        x, y, z = arms[i]
        if dim == 2:
            found[0, i, 0], found[0, i, 1] = -y, x
            continue
        found[0, i, 1], found[0, i, 2] = -z, y
        found[1, i, 0], found[1, i, 2] = z, -x
        found[2, i, 0], found[2, i, 1] = -y, x
    return found


@compiled
def whirls(rotations, spins, ends, spins_ahead, far):
    """Mean spins of a step in space, (bodies, 3).

    Args:
        rotations, spins: At its start, along the axes of the bodies.
        ends, spins_ahead: At its end.
        far: Spin from which on the mean is that of both ends in space [rad/s]; inf: none is.
    """
    found = np.empty_like(spins)
    for k in range(len(spins)):
        a, b = spins[k], spins_ahead[k]
        mean = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2]))
        put(by(rotations[k], mean), 1.0, found[k])
        if far < np.inf:
            whole = plus(by(rotations[k], a), 1.0, by(ends[k], b))
            if 0.5 * np.sqrt(dot(whole, whole)) >= far:
                put(whole, 0.5, found[k])
    return found


@compiled
def rolled_to(normals, roll, following, amid, beyond):
    """From nodes to where they touch, and the arms there, (places, 3) each.

    Args:
        normals: Of their gaps, (places, dim).
        roll: Radii about which they roll [m], (places, 1).
        following: What follows nodes in space [m], (places, 3).
        amid, beyond: Arms amid the step, and what is added to them.
    """
    offset, acting = following.copy(), np.empty_like(amid)
    for i in range(len(normals)):
        for c in range(normals.shape[1]):
            offset[i, c] -= roll[i, 0] * normals[i, c]
        for c in range(3):
            acting[i, c] = amid[i, c] + beyond[i, c] + offset[i, c]
    return offset, acting


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
def summed(mass, inertia, moved, speed, spin, rotated, work, dim):
    """Sums of bodies as `impactfem.marching.layers.SumsTable` has them.

    Args:
        mass: [kg], (bodies, 1).
        inertia: Along their axes [kg m^2], (bodies, 3, 3).
        moved: Displacements of the centres [m], (bodies, 3).
        speed, spin: [m/s], along their axes [rad/s], (bodies, 3).
        rotated: Rotations, (bodies, 3, 3).
        work: Of loads in the layer [J], (bodies,).
        dim: Dimension of space.

    Returns:
        The sums, (bodies, 3 + 2 dim + 1 or 3); moments of inertia that turn with them and about
        axes, (bodies, 2, dim, dim). Only the polar factor of the first is asked for: of a rod the
        moments of mass would not have one.
    """
    count, turns = len(mass), dim * (dim - 1) // 2
    found = np.zeros((count, 3 + 2 * dim + turns))
    attitude = np.zeros((count, 2, dim, dim))
    for k in range(count):
        own, along = rotated[k], by(inertia[k], spin[k])
        found[k, 0] = 0.5 * (mass[k, 0] * dot(speed[k], speed[k]) + dot(spin[k], along))
        found[k, 2] = work[k]
        angular = by(own, along)
        for i in range(dim):
            found[k, 3 + i] = mass[k, 0] * speed[k, i]
            found[k, 3 + dim + i] = mass[k, 0] * moved[k, i]
        for i in range(turns):
            found[k, 3 + 2 * dim + i] = angular[3 - turns + i]
        j = inertia[k]
        size = j[2, 2] if dim == 2 else j[0, 0] + j[1, 1] + j[2, 2]
        for i in range(dim):
            row = across(j, own[i])
            attitude[k, 1, i, i] = 0.5 * size
            for m in range(dim):
                attitude[k, 0, i, m] = size * own[i, m]
                if dim == 3:
                    attitude[k, 1, i, m] -= dot(row, own[m])
    return found, attitude


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
