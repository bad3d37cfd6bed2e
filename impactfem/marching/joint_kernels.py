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
from impactfem.marching.turn_kernels import cayley, cross, inverted, skew
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
                turning = end[body] @ axes[t, side]
                other = end[bodies[t, 1 - side]] @ axes[t, 1 - side]
            else:
                turning, other = end[body] @ arms[t, side], gradient[t, side, :3].copy()
            found[body] += size * (np.outer(turning, other) - (turning @ other) * np.eye(3))
    return found


@compiled
def joined(
    kinds, rows, bodies, arms, axes, across, shares, offsets,
    laws, start, spins, impulses, given, before, moments, elastic, dt, sizes, redundant,
):  # fmt: skip
    """The layer of bodies under impulses of others and those of their joints.

    Newton's iterates in spins and impulses: arms turn with bodies, whose inertia may be small.

    Args:
        kinds, bodies, arms, axes, across: Of the terms; see `impactfem.system.joint_kernels`.
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
    for c in range(len(couples)):
        body = couples[c, 0]
        if couples[c, 1] != body:
            continue
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
    for iterates in range(1, _MOST + 1):  # noqa: B007  (told at the end)
        for body in range(1, count):
            half = 0.25 * dt * (spins[1][body] + whirls[body])
            if not half @ half < _LARGEST * _LARGEST:
                state = FAST
                break
            halves[body] = half
            ends[body] = start[1][body] @ cayley(half)
            middles[body] = 0.5 * (start[1][body] + ends[body])
            turned[body] = 2.0 * (start[1][body] @ half)
            places[body] = start[0][body] + 0.5 * dt * (spins[0][body] + speeds[body])
        if state == FAST:
            break
        at_end = values(kinds, bodies, arms, axes, across, places, ends, before)
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
                pushed[bodies[t, side]] += size * gradient[t, side, :3]
                whirled[bodies[t, side]] += size * gradient[t, side, 3:]
        bent = _bent(kinds, rows, bodies, gradient, shares, acting, arms, axes, ends, count)
        # Changes of speeds and spins without others of impulses, and by unit moments.
        late, free = np.zeros((count, 3)), np.zeros((count, 6))
        answers, bending = np.zeros((count, 3, 3)), compliance.copy()
        for body in range(1, count):
            half = halves[body]
            by_spin = (np.eye(3) + skew(half)) * (0.5 * dt / (1.0 + half @ half))
            turning = start[1][body] @ by_spin
            if inverse_mass[body] == 0.0:  # a station
                steps[body] = spins[0][body] + impulses[0][body] - speeds[body]
                # Along its axes at the start of the layer.
                spun = start[1][body].T @ impulses[1][body]
                late[body] = spins[1][body] + spun - whirls[body]
                for c in range(len(couples)):
                    if couples[c, 0] == body:
                        other = couples[c, 1]
                        wrench = np.concatenate((pushed[other], whirled[other]))
                        steps[body] += compliance[c, :3] @ wrench
                        own = compliance[c, 3:] @ wrench
                        late[body] += start[1][body].T @ own
                        rolled = turning @ start[1][body].T
                        bending[c, 3:] = (2.0 / dt) * rolled @ compliance[c, 3:]
                free[body, :3] = 0.5 * dt * steps[body]
                free[body, 3:] = turning @ late[body]
                continue
            own = start[1][body].T @ whirled[body]
            mean = inertia[body] @ (spins[1][body] + whirls[body]) * 0.5
            off = inertia[body] @ (whirls[body] - spins[1][body])
            off += 2.0 * cross(half, mean) + cross(half, own) - own
            tangent = inertia[body] + skew(half) @ inertia[body]
            tangent -= 0.5 * dt * skew(mean + 0.5 * own)
            by_moment = (np.eye(3) - skew(half)) @ start[1][body].T
            tangent -= by_moment @ bent[body] @ (start[1][body] @ by_spin)
            inner = inverted(tangent)
            late[body] = -(inner @ off)
            answers[body] = inner @ by_moment
            freedoms[body] = turning @ answers[body] * (2.0 / dt)
            lag = spins[0][body] + inverse_mass[body] * pushed[body] - speeds[body]
            steps[body] = lag
            free[body, :3], free[body, 3:] = 0.5 * dt * lag, turning @ late[body]
        missing = laws[:, 0] * missing + laws[:, 1] * acting + laws[:, 2]
        scaled, last = (
            gradient.copy(),
            at_gradients(kinds, bodies, arms, axes, places, ends, at_end),
        )
        for t in range(terms):
            scaled[t] *= shares[t]
            last[t] *= shares[t]
            ahead = 0.0
            for side in range(2):
                ahead += last[t, side] @ free[bodies[t, side]]
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
        for body in range(1, count):
            speeds[body] += steps[body]
            whirls[body] += late[body]
        for t in range(terms):
            size = change[rows[t]] * shares[t]
            for side in range(2):
                body = bodies[t, side]
                if body:
                    speeds[body] -= size * inverse_mass[body] * gradient[t, side, :3]
                    whirls[body] -= size * (answers[body] @ gradient[t, side, 3:])
                    pushed[body] -= size * gradient[t, side, :3]
                    whirled[body] -= size * gradient[t, side, 3:]
        moved = 0.0  # twice the energy of the change
        for c in range(len(couples)):
            one, two = couples[c]
            found = compliance[c] @ np.concatenate((pushed[two], whirled[two]))
            speeds[one] += found[:3]
            spun = found[3:].copy()
            whirls[one] += start[1][one].T @ spun
            moved += found[:3] @ pushed[one] + spun @ whirled[one]
        for body in range(1, count):
            if inverse_mass[body] == 0.0:
                continue
            way, whirl = speeds[body] - last_speeds[body], whirls[body] - last_whirls[body]
            moved += (way @ way) / inverse_mass[body] + whirl @ inertia[body] @ whirl
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
        if left <= _SETTLED * whole or (
            left >= 0.5 * least and (left <= _FINE * whole or off_by <= 1.0)
        ):
            state = FOUND
            break
        least = min(least, left)
    return (
        state, acting, speeds, whirls, halves, ends, middles, freedoms, at_end, gradient, iterates
    )  # fmt: skip
