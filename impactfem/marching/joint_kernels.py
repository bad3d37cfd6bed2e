"""A layer of rigid bodies that joints hold together, by an energy-momentum step.

Each row g of a joint acts along its discrete gradient (`impactfem.system.joint_kernels`) with an
impulse L on bodies that turn by Cayley's rotation of T = dt W_m, W_m the mean spin: as in
`turn_kernels`, with a straight T, on whose chords moments do the work of their forces. So L does
the work L (g_b - g_a) / dt: none where the row is a constraint that holds at both ends, to
rounding. Momentum and angular momentum are kept.

The rows of a layer are a g_b + b L + c = 0: (1, 0, 0) of a constraint, of a spring k with rest q0
and a damper d in a coordinate q (k/2 + d/dt, 1/dt, k (q_a/2 - q0) - d q_a/dt), of a given force f
(0, 1/dt, -f).

Stations of elastic bodies are places whose rates follow impulses linearly in a layer: they turn by
Cayley's rotation of the T that their spins make, so that joints do the same work on both sides.
"""

import numpy as np

from impactfem.compiled import compiled
from impactfem.marching.turn_kernels import inverted, turned_by
from impactfem.system.joint_kernels import (
    ANGLE,
    DOT,
    ROUNDING,
    at_gradients,
    delassus,
    gradients,
    solved,
    values,
)
from impactfem.system.vector_kernels import across, add, by, crossed, dot, less, plus, put

FOUND, FAST, UNSETTLED = range(3)
"""How a layer ended: found; a body turns too far; no solution."""

_MOST = 60  # iterates
_LARGEST = 1.0  # T / 2, of a turn by 1.6 rad in a layer
_SETTLED, _FINE = 2e-16, 1e-12  # changes of impulses that are but rounding, or no longer shrink


@compiled
def _bent(kinds, rows, bodies, gradient, shares, acting, arms, axes, end, count):
    """How moments on bodies change by their own turns at the end, (bodies, 3, 3).

    Arms and directions are means of both ends: half of what turns them. What a body does to the
    moment on another one is left out, as are changes of distances.

    Args:
        gradient: Of the terms amid the layer, (terms, 2, 6).
        acting: Impulses of the rows, (rows,).
        end: Rotations at the end, (bodies, 3, 3).
    """
    found = np.zeros((count, 3, 3))
    for t in range(len(kinds)):
        size = 0.5 * acting[rows[t]] * shares[t]
        if kinds[t] == ANGLE or size == 0.0:
            continue
        for side in range(2):
            body = bodies[t, side]
            if kinds[t] == DOT:
                # w x u on the second body, u x w on the first one: u and w turn.
                turning = by(end[body], axes[t, side])
                other = by(end[bodies[t, 1 - side]], axes[t, 1 - side])
            else:
                way = gradient[t, side]
                turning, other = by(end[body], arms[t, side]), (way[0], way[1], way[2])
            along = dot(turning, other)
            for i in range(3):
                for j in range(3):
                    found[body, i, j] += size * turning[i] * other[j]
                found[body, i, i] -= size * along
    return found


@compiled
def _times(one, two, found):
    """The product of two matrices (3, 3), written."""
    for i in range(3):
        for j in range(3):
            found[i, j] = one[i, 0] * two[0, j] + one[i, 1] * two[1, j] + one[i, 2] * two[2, j]


@compiled
def _tangent(inertia, half, bend, turning, by_moment, bent, found):
    """How what is off in a layer of a body's rotation changes with its spin, (3, 3); written.

    Args:
        inertia: (3, 3).
        half: T / 2.
        bend: dt / 2 (J W_m + own / 2), of which the vector product is taken off.
        turning: Half the way that the body turns by its spin, in space, (3, 3).
        by_moment: From impulses of moments in space, (3, 3).
        bent: See `_bent`, (3, 3).
    """
    inner = np.empty((3, 3))
    _times(bent, turning, inner)
    _times(by_moment, inner, found)
    for j in range(3):
        own = (inertia[0, j], inertia[1, j], inertia[2, j])
        along = crossed(half, own)
        for i in range(3):
            found[i, j] = own[i] + along[i] - found[i, j]
    found[0, 1] += bend[2]
    found[0, 2] -= bend[1]
    found[1, 0] -= bend[2]
    found[1, 2] += bend[0]
    found[2, 0] += bend[1]
    found[2, 1] -= bend[0]


@compiled
def joined(
    kinds, rows, bodies, arms, axes, sides, shares, offsets,
    laws, start, spins, impulses, given, before, moments, elastic, dt, sizes, redundant,
):  # fmt: skip
    """The layer of bodies under impulses of others and those of their joints.

    Newton's iterates in spins and impulses: arms turn with bodies, whose inertia may be small.

    Args:
        kinds, bodies, arms, axes, sides: Of the terms; see `impactfem.system.joint_kernels`.
        rows, shares: The row of each term, and its factor there, (terms,).
        offsets: Taken from the rows, (rows,).
        laws: a, b, c of the rows, (rows, 3).
        start: Places and rotations at the start, ((bodies, 3), (bodies, 3, 3)).
        spins: Velocities, and spins along the axes of the bodies, ((bodies, 3), (bodies, 3)).
        impulses: Given ones of forces and moments, ((bodies, 3), (bodies, 3)); of stations what
            velocities and spins in space change by without joints.
        given: Impulses of the rows to begin with, (rows,).
        before: Values of the terms at the start, (terms,).
        moments: Inverse masses (bodies,), 0 of stations, moments of inertia and their inverses
            (bodies, 3, 3).
        elastic: Couples of stations (couples, 2), and how the first moves by unit impulses on the
            second in the layer, (couples, 6, 6); see `impactfem.system.joint_kernels.delassus`.
        dt: [s].
        sizes: Rounding levels of the rows, (rows,).
        redundant: See `solved`.

    Returns:
        How it ended; impulses of the rows; velocities, spins, and T / 2 at the end along the axes
        of the bodies, (bodies, 3) each; rotations at the end and amid, and how turns follow
        impulses of moments, times 2 / dt, (bodies, 3, 3) each; values of the terms at the end;
        gradients of the terms; iterates.
    """
    inverse_mass, inertia, inverse = moments
    couples, compliance = elastic
    count, terms, most = len(start[0]), len(kinds), len(offsets)
    speeds, whirls, halves = spins[0].copy(), spins[1].copy(), np.zeros((count, 3))
    ends, middles, freedoms = start[1].copy(), start[1].copy(), np.zeros((count, 3, 3))
    places, turned, steps = start[0].copy(), np.zeros((count, 3)), np.zeros((count, 3))
    acting, at_end = given.copy(), before.copy()
    gradient = np.zeros((terms, 2, 6))
    state, least, iterates = UNSETTLED, np.inf, 0
    # Root of the energy of what moves and pushes: what impulses, made alike, are measured by.
    known = 0.0
    turns = np.zeros(count, dtype=np.bool_)  # stations that do
    for c in range(len(couples)):
        body = couples[c, 0]
        if couples[c, 1] != body:
            continue
        turns[body] = np.abs(compliance[c, 3:, 3:]).max() > 0.0
        for part in range(2):
            first = 3 * part
            whole = np.trace(compliance[c, first : first + 3, first : first + 3])
            for k in range(3):
                if compliance[c, k + first, k + first] > ROUNDING * whole:
                    rate = np.abs(spins[part][body, k]) + np.abs(impulses[part][body, k])
                    known += rate * rate / compliance[c, k + first, k + first]
        speeds[body] += impulses[0][body]
        whirls[body] += start[1][body].T @ impulses[1][body]
    for body in range(1, count):
        if inverse_mass[body] == 0.0:
            continue
        rate = np.abs(spins[0][body]) + np.abs(impulses[0][body]) * inverse_mass[body]
        known += (rate @ rate) / inverse_mass[body]
        own = start[1][body].T @ impulses[1][body]
        spun = np.abs(spins[1][body]) + np.abs(inverse[body] @ own)
        known += spun @ inertia[body] @ spun
        # Begins as if nothing held it.
        speeds[body] += inverse_mass[body] * impulses[0][body]
    known = np.sqrt(0.5 * dt * known)
    for iterates in range(1, _MOST + 1):
        for body in range(1, count):
            half = 0.25 * dt * (spins[1][body] + whirls[body])
            if not half @ half < _LARGEST * _LARGEST:
                state = FAST
                break
            halves[body] = half
            turned_by(start[1][body], half, ends[body])
            put(by(start[1][body], half), 2.0, turned[body])
            for i in range(3):
                places[body, i] = start[0][body, i] + 0.5 * dt * (
                    spins[0][body, i] + speeds[body, i]
                )
                for j in range(3):
                    middles[body, i, j] = 0.5 * (start[1][body, i, j] + ends[body, i, j])
        if state == FAST:
            break
        at_end = values(kinds, bodies, arms, axes, sides, places, ends, before)
        gradient = gradients(
            kinds, bodies, arms, axes, start, (places, ends), turned, before, at_end
        )
        pushed, whirled = impulses[0].copy(), impulses[1].copy()
        for body in range(1, count):
            if inverse_mass[body] == 0.0:
                pushed[body], whirled[body] = 0.0, 0.0
        missing = -offsets
        for t in range(terms):
            size = acting[rows[t]] * shares[t]
            missing[rows[t]] += shares[t] * at_end[t]
            for side in range(2):
                add(gradient[t, side, :3], size, pushed[bodies[t, side]])
                add(gradient[t, side, 3:], size, whirled[bodies[t, side]])
        bent = _bent(kinds, rows, bodies, gradient, shares, acting, arms, axes, ends, count)
        # Changes of speeds and spins without others of impulses, and by unit moments.
        late, free = np.zeros((count, 3)), np.zeros((count, 6))
        answers, bending = np.zeros((count, 3, 3)), compliance.copy()
        turning, by_moment, tangent = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
        for body in range(1, count):
            half, rotation = halves[body], start[1][body]
            share = 0.5 * dt / (1.0 + dot(half, half))
            for i in range(3):  # (1 + h) of its skew matrix, and r h = r x h
                row = (rotation[i, 0], rotation[i, 1], rotation[i, 2])
                put(plus(row, 1.0, crossed(row, half)), share, turning[i])
            if inverse_mass[body] == 0.0:  # a station
                steps[body] = spins[0][body] + impulses[0][body] - speeds[body]
                # Along its axes at the start of the layer.
                spun = start[1][body].T @ impulses[1][body]
                late[body] = spins[1][body] + spun - whirls[body]
                rolled = (2.0 / dt) * (turning @ start[1][body].T)
                for c in range(len(couples)):
                    if couples[c, 0] != body:
                        continue
                    other = couples[c, 1]
                    for i in range(3):
                        for k in range(3):
                            steps[body, i] += compliance[c, i, k] * pushed[other, k]
                            steps[body, i] += compliance[c, i, k + 3] * whirled[other, k]
                    if not turns[body]:
                        continue
                    wrench = np.concatenate((pushed[other], whirled[other]))
                    own = compliance[c, 3:] @ wrench
                    late[body] += start[1][body].T @ own
                    bending[c, 3:] = rolled @ compliance[c, 3:]
                free[body, :3] = 0.5 * dt * steps[body]
                free[body, 3:] = turning @ late[body]
                continue
            own = across(rotation, whirled[body])
            begun, after = spins[1][body], whirls[body]
            momenta = by(inertia[body], plus(begun, 1.0, after))  # J (W_a + W_b)
            off = plus(by(inertia[body], less(after, begun)), 1.0, crossed(half, momenta))
            off = less(plus(off, 1.0, crossed(half, own)), own)
            bend = plus((0.0, 0.0, 0.0), 0.25 * dt, plus(momenta, 1.0, own))
            for i in range(3):
                put(turning[i], 1.0 / share, by_moment[:, i])
            _tangent(inertia[body], half, bend, turning, by_moment, bent[body], tangent)
            inner = inverted(tangent)
            put(by(inner, off), -1.0, late[body])
            _times(inner, by_moment, answers[body])
            _times(turning, answers[body], freedoms[body])
            freedoms[body] *= 2.0 / dt
            lag = less(plus(spins[0][body], inverse_mass[body], pushed[body]), speeds[body])
            put(lag, 1.0, steps[body])
            put(lag, 0.5 * dt, free[body, :3])
            put(by(turning, late[body]), 1.0, free[body, 3:])
        missing = laws[:, 0] * missing + laws[:, 1] * acting + laws[:, 2]
        scaled, last = (
            gradient.copy(),
            at_gradients(kinds, bodies, arms, axes, places, ends, at_end),
        )
        for t in range(terms):
            ahead = 0.0
            for side in range(2):
                for k in range(6):
                    scaled[t, side, k] *= shares[t]
                    last[t, side, k] *= shares[t]
                    ahead += last[t, side, k] * free[bodies[t, side], k]
            missing[rows[t]] += laws[rows[t], 0] * ahead
        matrix = 0.5 * dt * delassus(
            rows, bodies, last, scaled, most, inverse_mass, freedoms, couples, bending
        )  # fmt: skip
        scale = np.empty(most)
        for r in range(most):
            scale[r] = 1.0 / np.sqrt(np.abs(matrix[r, r])) if matrix[r, r] != 0.0 else 1.0
            matrix[r] *= laws[r, 0]
            matrix[r, r] += laws[r, 1]
        change = solved(matrix, missing.reshape((most, 1)), scale, redundant)[:, 0]
        acting -= change
        last_speeds, last_whirls = speeds.copy(), whirls.copy()
        pushed, whirled = np.zeros((count, 3)), np.zeros((count, 3))  # by the change of impulses
        speeds += steps
        whirls += late
        for t in range(terms):
            size = change[rows[t]] * shares[t]
            for side in range(2):
                body = bodies[t, side]
                if body:
                    push, twist = gradient[t, side, :3], gradient[t, side, 3:]
                    add(push, -size * inverse_mass[body], speeds[body])
                    add(by(answers[body], twist), -size, whirls[body])
                    add(push, -size, pushed[body])
                    add(twist, -size, whirled[body])
        moved = 0.0  # twice the energy of the change
        for c in range(len(couples)):
            one, two = couples[c]
            for i in range(3):
                way = 0.0
                for k in range(3):
                    way += compliance[c, i, k] * pushed[two, k]
                    way += compliance[c, i, k + 3] * whirled[two, k]
                speeds[one, i] += way
                moved += way * pushed[one, i]
            if turns[one]:
                spun = compliance[c, 3:] @ np.concatenate((pushed[two], whirled[two]))
                whirls[one] += start[1][one].T @ spun
                moved += spun @ whirled[one]
        for body in range(1, count):
            if inverse_mass[body] == 0.0:
                continue
            way = less(speeds[body], last_speeds[body])
            whirl = less(whirls[body], last_whirls[body])
            moved += dot(way, way) / inverse_mass[body] + dot(whirl, by(inertia[body], whirl))
        left = max(np.abs(change / scale).max(), np.sqrt(0.5 * dt * moved))
        whole = max(known, np.abs(acting / scale).max())
        off_by = 0.0  # of constraints, by their rounding
        for r in range(most):
            if laws[r, 1] == 0.0:
                # Impulses on what is light between heavy bodies nearly cancel.
                room = laws[r, 0] * sizes[r] + ROUNDING * (np.abs(matrix[r]) @ np.abs(acting))
                off_by = max(off_by, np.abs(missing[r]) / room)
        if not np.isfinite(left):
            break
        # Impulses that were right from the first tell nothing of places, which follow from them.
        if (iterates > 1 and left <= _SETTLED * whole) or (
            left >= 0.5 * least and (left <= _FINE * whole or off_by <= 1.0)
        ):
            state = FOUND
            break
        least = min(least, left)
    return (
        state, acting, speeds, whirls, halves, ends, middles, freedoms, at_end, gradient, iterates
    )  # fmt: skip
