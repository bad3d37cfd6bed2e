"""Strains of beams that turn far, and forces that do exactly the work of their energy.

A node has a place x and a frame R whose columns are the directions along the axis, the height and
the width. Of an element of length h between nodes 1 and 2, a with R_1^T R_2 = exp(psi n x),

    a = n sin(psi),   u = sin^2(psi / 2),   y = (R_1 + R_2)^T (x_2 - x_1) / (2 h)

are quadratic in places and frames, and no rigid motion changes them. An axis that is a helix
between its nodes, whose strains are the same all along, has with g = psi / sin(psi)

    curvatures and twist  g a / h,     chord along its frame  c = g y - p a (a . y),

p = (g - 1) / sin^2(psi). The shears are the last two of c, and the axis has become longer by

    |c| - 1 + (f_2 c_2)^2 / 10 + (f_3 c_3)^2 / 10,

of which the last two are the bow of an element that end forces bend, with f the share of bending in
what looks like shear. (With c_1 for |c| a pull above the stiffness of that shear would buckle the
beam.) Both g and p are taken as polynomials in u, so that all differences of
the energy over a step are products of means and differences, to rounding, and forces from them do
its work (the discrete gradient of O. Gonzalez, J. Nonlinear Sci. 6 (1996) 449-467, with nothing
to divide by). Frames turn by R_b - R_a = f x (R_a + R_b) / 2, Cayley's rotation: then forces and
moments are balanced at the mean places, and momentum and angular momentum stay too.

The shear of an element has the stiffness of bending by end forces in series,
1 / (1 / kappa G A + h^2 / 12 E I): at small strains its nodes move as those of the beam of
Timoshenko, or without the first of Euler and Bernoulli (R. H. MacNeal, Comput. Struct. 8 (1978)
175-183). Strains of chords and frames: J. C. Simo, Comput. Methods Appl. Mech. Eng. 49 (1985)
55-70; M. A. Crisfield, G. Jelenic, Proc. R. Soc. Lond. A 455 (1999) 1125-1147.

Derivatives are taken along imaginary steps, which are exact to rounding: numbers may be complex.
"""

import numpy as np

from impactfem.compiled import compiled

TERMS = 9
_G = np.cumprod(np.array([1.0, *(2.0 * n / (2.0 * n + 1.0) for n in range(1, TERMS + 1))]))
_P = 0.25 * np.cumsum(_G[1:])
_STEP = 1e-30  # imaginary step of derivatives
_NONE = float(np.finfo(float).tiny)


@compiled
def _values(coefficients, first, last):  # fmt: skip
    """A polynomial at two places, and its difference over theirs."""
    one, other, divided = 0.0 * first, 0.0 * first, 0.0 * first
    for k in range(len(coefficients) - 1, -1, -1):
        divided = divided * last + one
        one = one * first + coefficients[k]
        other = other * last + coefficients[k]
    return one, other, divided


@compiled
def invariants(rest, h, moved, turned, out):
    """A, y, u and a . y of an element, (8,), by displacements (2, 3) and frames (2, 3, 3)."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        found, other, along = 0j, 0j, 0j
        for m in range(3):
            found += turned[0, m, k] * turned[1, m, j]
            other += turned[0, m, j] * turned[1, m, k]
            chord = rest[m] + (moved[1, m] - moved[0, m]) / h
            along += 0.5 * (turned[0, m, i] + turned[1, m, i]) * chord
        out[i], out[3 + i] = 0.5 * (found - other), along
    trace = 0j
    for i in range(3):
        for m in range(3):
            trace += turned[0, m, i] * turned[1, m, i]
    out[6] = 0.25 * (3.0 - trace)
    out[7] = out[0] * out[3] + out[1] * out[4] + out[2] * out[5]


@compiled
def strains(state, bows, g, p, out):
    """C, strains and |c| of an element, (10,).

    Strains are how much longer the axis is, shears and g a, less those without stresses, which
    come after the three bows.
    """
    for i in range(3):
        out[i] = g * state[3 + i] - p * state[7] * state[i]
        out[6 + i] = g * state[i]
    out[9] = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2] + _NONE)
    out[3] = out[9] - 1.0
    for i in range(3):
        out[3] += bows[i] * out[i] * out[i]
    out[4], out[5] = out[1], out[2]
    for i in range(6):
        out[3 + i] -= bows[3 + i]


@compiled
def push(data, before, moved, turned, middle, amid, rate, given, work, out):
    """Forces and moments of an element on its nodes, (2, 6).

    Args:
        data: Of the element, rest, h, stretching, bending, bows, strains without stresses, (19,).
        before: Its invariants at the start of the step, (8,).
        moved, turned: Of its nodes at the end, (2, 3) and (2, 3, 3).
        middle, amid: The same amid the step.
        rate: Viscous time over the step, 0 at rest.
        given: Stresses (6,) instead of those of the strains, whose changes alone count; (0,): none.
        work: Room, (46,).
        out: Written.
    """
    rest, h, stretching, bending, bows = data[:3], data[3], data[4:7], data[7:10], data[10:19]
    state, one, two = work[:8], work[8:18], work[18:28]
    invariants(rest, h, moved, turned, state)
    g0, g1, dg = _values(_G, before[6] + 0.0 * state[6], state[6])
    p0, p1, dp = _values(_P, before[6] + 0.0 * state[6], state[6])
    strains(before + 0.0 * state, bows, g0, p0, one)
    strains(state, bows, g1, p1, two)
    g, p = 0.5 * (g0 + g1), 0.5 * (p0 + p1)
    size = one[9] + two[9]
    n, m, on_y, each = work[28:31], work[31:34], work[34:37], work[37:40]
    own = work[40:46]
    for i in range(3):
        mean = 0.5 * (one[3 + i] + two[3 + i]) + rate * (two[3 + i] - one[3 + i])
        own[i] = stretching[i] * mean
        mean = 0.5 * (one[6 + i] + two[6 + i]) + rate * (two[6 + i] - one[6 + i])
        own[3 + i] = bending[i] / h * mean
    for i in range(len(given)):
        own[i] += given[i] - own[i].real
    pull = own[0]
    for i in range(3):
        n[i] = 0.5 * (one[i] + two[i]) * pull * (2.0 / size + 2.0 * bows[i])
        if i:
            n[i] += own[i]
        m[i] = own[3 + i]
    s = 0.5 * (before[7] + state[7])
    along, twice, on_u = 0j, 0j, 0j
    for i in range(3):
        a, y = 0.5 * (before[i] + state[i]), 0.5 * (before[3 + i] + state[3 + i])
        along += n[i] * a
        twice += 0.5 * n[i] * (before[i] * before[7] + state[i] * state[7])
        on_u += dg * (m[i] * a + h * n[i] * y)
    on_u -= h * dp * twice
    for i in range(3):
        a, y = 0.5 * (before[i] + state[i]), 0.5 * (before[3 + i] + state[3 + i])
        on_y[i] = h * (g * n[i] - p * along * a)
        each[i] = 0.5 * (g * m[i] - h * p * (along * y + s * n[i]))  # on a, of both entries
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        force = 0.0 * s
        for q in range(3):
            force += (amid[0, i, q] + amid[1, i, q]) * on_y[q]
        force /= 2.0 * h
        out[0, i], out[1, i] = -force, force
        # Sum of each_qr (column r of R_2) x (column q of R_1) by the entries of R_1^T R_2.
        turning = 0.0 * s
        for q in range(3):
            turning += (
                -0.25 * on_u * (amid[1, j, q] * amid[0, k, q] - amid[1, k, q] * amid[0, j, q])
            )
            r, t = (q + 1) % 3, (q + 2) % 3
            turning += each[q] * (
                amid[1, j, r] * amid[0, k, t]
                - amid[1, k, r] * amid[0, j, t]
                - amid[1, j, t] * amid[0, k, r]
                + amid[1, k, t] * amid[0, j, r]
            )
        for side in range(2):
            moment = turning if side else -turning
            for q in range(3):
                cj = rest[j] + (middle[1, j] - middle[0, j]) / h
                ck = rest[k] + (middle[1, k] - middle[0, k]) / h
                moment += 0.5 * on_y[q] * (amid[side, j, q] * ck - amid[side, k, q] * cj)
            out[side, 3 + i] = moment


@compiled
def turn_by(turn, frame, out):
    """A frame (3, 3) turned by Cayley's rotation of a vector (3,)."""
    size = 1.0 + 0.25 * (turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2])
    for q in range(3):
        x, y, z = frame[0, q], frame[1, q], frame[2, q]
        a = turn[1] * z - turn[2] * y
        b = turn[2] * x - turn[0] * z
        c = turn[0] * y - turn[1] * x
        out[0, q] = x + (a + 0.5 * (turn[1] * c - turn[2] * b)) / size
        out[1, q] = y + (b + 0.5 * (turn[2] * a - turn[0] * c)) / size
        out[2, q] = z + (c + 0.5 * (turn[0] * b - turn[1] * a)) / size


@compiled
def _inertial(way, turned, mass, speed, inertia, spin, whirl, frame, span, alpha, out):
    """Forces and moments that a node's change of momenta takes, and damping by mass, (6,)."""
    for i in range(3):
        mean = way[i] / span
        out[i] = mass * (2.0 / span * (mean - speed[i]) + alpha * mean)
        out[3 + i] = -whirl[i] / span + 0.0 * way[i]
    for q in range(3):
        rate = (frame[0, q] * way[3] + frame[1, q] * way[4] + frame[2, q] * way[5]) / span
        own = inertia[q] * (2.0 * rate - spin[q]) / span
        for i in range(3):
            out[3 + i] += turned[i, q] * own + alpha * frame[i, q] * inertia[q] * rate


@compiled
def resistance(
    way, frames, rates, nodes, elements, sides, before, rest_frames, span, viscous, alpha, out,
    after,
):  # fmt: skip
    """What strains, springs and momenta take in a step, (nodes, 6), and frames at its end.

    Args:
        way: Displacements of the nodes in it and their turns, (nodes, 6).
        frames: Displacements and frames at its start.
        rates: Velocities, spins along the axes, angular momenta in space, (nodes, 3) each.
        nodes: Masses (nodes,), inertias (nodes, 3) and springs (nodes,).
        elements: Data of the elements, (elements, 19).
        sides: Their nodes, -1 of none, (elements, 2).
        before: Their invariants at its start, (elements, 8).
        rest_frames: Of the nodes at t = 0, which is how what holds them stays, (nodes, 3, 3).
        span: [s].
        viscous: [s].
        alpha: Damping by mass [1/s].
        out, after: Written.
    """
    moved, turned = frames
    speed, spin, whirl = rates
    mass, inertia, springs = nodes
    for node in range(len(way)):
        turn_by(way[node, 3:], turned[node], after[node])
        _inertial(
            way[node], after[node], mass[node], speed[node], inertia[node], spin[node],
            whirl[node], turned[node], span, alpha, out[node],
        )  # fmt: skip
        for i in range(3):
            out[node, i] += springs[node] * (moved[node, i] + 0.5 * way[node, i])
    work, own = np.zeros(46, np.complex128), np.empty((2, 6), np.complex128)
    here, there, middle, amid = _room()
    for e in range(len(elements)):
        rest = rest_frames[sides[e, 1]]
        for side in range(2):
            node = sides[e, side]
            _gather(node, moved, turned, way, after, rest, side, here, there, middle, amid)
        push(
            elements[e],
            before[e],
            here,
            there,
            middle,
            amid,
            viscous / span,
            np.zeros(0),
            work,
            own,
        )
        for side in range(2):
            if sides[e, side] >= 0:
                for i in range(6):
                    out[sides[e, side], i] += own[side, i].real


@compiled
def _room():
    """Displacements and frames of two nodes, at the end and amid.

    Complex also where they are real: compiling once more would take longer than that costs.
    """
    here = np.zeros((2, 3), np.complex128)
    there = np.zeros((2, 3, 3), np.complex128)
    return here, there, here.copy(), there.copy()


@compiled
def _gather(node, moved, turned, way, after, rest_frame, side, here, there, middle, amid):
    """A node at the end of the step and amid it."""
    for i in range(3):
        if node < 0:
            here[side, i], middle[side, i] = 0.0, 0.0
        else:
            here[side, i] = moved[node, i] + way[node, i]
            middle[side, i] = moved[node, i] + 0.5 * way[node, i]
        for q in range(3):
            if node < 0:
                there[side, i, q] = amid[side, i, q] = rest_frame[i, q]
            else:
                there[side, i, q] = after[node, i, q]
                amid[side, i, q] = 0.5 * (turned[node, i, q] + after[node, i, q])


@compiled
def tangent(
    way, frames, rates, nodes, elements, sides, before, rest_frames, span, viscous, alpha, after,
    stresses, blocks, beside,
):  # fmt: skip
    """Derivatives of `resistance` by the way, (nodes, 6, 6) and (2, nodes - 1, 6, 6).

    Those of neighbours are of the last node by the first one's way, and the other way. Stresses are
    as in `standing`.
    """
    moved, turned = frames
    speed, spin, whirl = rates
    mass, inertia, springs = nodes
    count = len(way)
    work, own = np.zeros(46, np.complex128), np.empty((2, 6), np.complex128)
    stepped, frame = np.empty(6, np.complex128), np.empty((3, 3), np.complex128)
    turns = np.empty((count, 6, 3, 3), np.complex128)
    here, there, middle, amid = _room()
    for node in range(count):
        for k in range(6):
            for i in range(6):
                stepped[i] = way[node, i]
            stepped[k] += 1j * _STEP
            turn_by(stepped[3:], turned[node], frame)
            turns[node, k] = frame
            _inertial(
                stepped, frame, mass[node], speed[node], inertia[node], spin[node], whirl[node],
                turned[node], span, alpha, own[0],
            )  # fmt: skip
            for i in range(6):
                blocks[node, i, k] = own[0, i].imag / _STEP
            if k < 3:
                blocks[node, k, k] += 0.5 * springs[node]
    for e in range(len(elements)):
        rest = rest_frames[sides[e, 1]]
        for side in range(2):
            _gather(
                sides[e, side], moved, turned, way, after, rest, side, here, there, middle,
                amid,
            )  # fmt: skip
        for side in range(2):
            node = sides[e, side]
            if node < 0:
                continue
            other = sides[e, 1 - side]
            for k in range(6):
                if k < 3:
                    here[side, k] += 1j * _STEP
                    middle[side, k] += 0.5j * _STEP
                else:
                    for i in range(3):
                        for q in range(3):
                            there[side, i, q] = turns[node, k, i, q]
                            amid[side, i, q] = 0.5 * (turned[node, i, q] + turns[node, k, i, q])
                push(
                    elements[e],
                    before[e],
                    here,
                    there,
                    middle,
                    amid,
                    viscous / span,
                    stresses[e],
                    work,
                    own,
                )
                for i in range(6):
                    blocks[node, i, k] += own[side, i].imag / _STEP
                    if other >= 0:
                        beside[side, e, i, k] = own[1 - side, i].imag / _STEP
                _gather(node, moved, turned, way, after, rest, side, here, there, middle, amid)


@compiled
def foreseen_in_step(
    way, change, frames, elements, sides, before, rest_frames, span, viscous, after, out
):  # fmt: skip
    """Mean stresses of the elements (elements, 6) in a step, and by a small change of its way."""
    moved, turned = frames
    work, own = np.zeros(46, np.complex128), np.empty((2, 6), np.complex128)
    turn, frame = np.empty(3, np.complex128), np.empty((3, 3), np.complex128)
    here, there, middle, amid = _room()
    for e in range(len(elements)):
        rest = rest_frames[sides[e, 1]]
        for side in range(2):
            node = sides[e, side]
            _gather(node, moved, turned, way, after, rest, side, here, there, middle, amid)
            if node < 0:
                continue
            for i in range(3):
                here[side, i] += 1j * _STEP * change[node, i]
                turn[i] = way[node, 3 + i] + 1j * _STEP * change[node, 3 + i]
            turn_by(turn, turned[node], frame)
            there[side] = frame
        push(
            elements[e],
            before[e],
            here,
            there,
            middle,
            amid,
            viscous / span,
            np.zeros(0),
            work,
            own,
        )
        for i in range(6):
            out[e, i] = work[40 + i].real + work[40 + i].imag / _STEP


@compiled
def banded(blocks, beside, free, out):
    """A matrix of nodes that know their neighbours, as LAPACK has bands; held rows are their own.

    Args:
        blocks, beside: See `tangent`.
        free: Which coordinates are, (6 nodes,).
        out: Zeros, written, (34, 6 nodes).
    """
    count = len(blocks)
    for node in range(count):
        for i in range(6):
            row = 6 * node + i
            if not free[row]:
                out[22, row] = 1.0
                continue
            for k in range(6):
                column = 6 * node + k
                if free[column]:
                    out[22 + row - column, column] = blocks[node, i, k]
                if node + 1 < count and free[column + 6]:
                    out[22 + row - column - 6, column + 6] = beside[1, node, i, k]
                if node > 0 and free[column - 6]:
                    out[22 + row - column + 6, column - 6] = beside[0, node - 1, i, k]


@compiled
def looked(data, sides, moved, turned, rest_frames, out):
    """Energies of the elements at a place; their invariants (elements, 8) are written.

    Returns:
        Strains of the elements: how much longer, shears, and twist and curvatures (elements, 6),
        and the sum of their energies [J].
    """
    here, there, middle, amid = _room()
    found, energy = np.empty((len(data), 6)), 0.0
    one, state = np.empty(10, np.complex128), np.empty(8, np.complex128)
    still = np.zeros((len(moved), 6))
    for e in range(len(data)):
        rest = rest_frames[sides[e, 1]]
        for side in range(2):
            _gather(
                sides[e, side], moved, turned, still, turned, rest, side, here, there, middle,
                amid,
            )  # fmt: skip
        h = data[e, 3]
        invariants(data[e, :3], h, here, there, state)
        g, _, _ = _values(_G, state[6], state[6])
        p, _, _ = _values(_P, state[6], state[6])
        strains(state, data[e, 10:19], g, p, one)
        for i in range(8):
            out[e, i] = state[i].real
        for i in range(3):
            found[e, i], found[e, 3 + i] = one[3 + i].real, one[6 + i].real / h
            energy += 0.5 * h * data[e, 4 + i] * found[e, i] ** 2
            energy += 0.5 * h * data[e, 7 + i] * found[e, 3 + i] ** 2
    return found, energy


@compiled
def standing(data, sides, springs, moved, turned, rest_frames, stresses, force, stiffness):
    """Forces at a place that stays (nodes, 6), and how they change there.

    Args:
        data, sides, springs, rest_frames: See `resistance`.
        moved, turned: Displacements and frames.
        stresses: With which what is turned by them stiffens, (elements, 6), or those of the strains
            (elements, 0). Thin beams come to rest in fewer iterates by what the last one foresaw
            (D. Magisano, L. Leonetti, G. Garcea, Comput. Methods Appl. Mech. Eng. 313 (2017)
            986-1005).
        force: Of the strains, written.
        stiffness: By displacements and small turns in space, zeros, written, (nodes, 6, nodes, 6).
    """
    still = np.zeros((len(moved), 6))
    here, there, middle, amid = _room()
    state, work = np.empty(8, np.complex128), np.zeros(46, np.complex128)
    own = np.empty((2, 6), np.complex128)
    force[:] = 0.0
    for node in range(len(moved)):
        for i in range(3):
            force[node, i] = springs[node] * moved[node, i]
            stiffness[node, i, node, i] += springs[node]
    for e in range(len(data)):
        rest = rest_frames[sides[e, 1]]
        for step in range(12):
            for side in range(2):
                _gather(
                    sides[e, side], moved, turned, still, turned, rest, side, here, there,
                    middle, amid,
                )  # fmt: skip
            side, k = step // 6, step % 6
            if k < 3:
                here[side, k] += 1j * _STEP
            else:
                i, j = (k - 2) % 3, (k - 1) % 3
                for q in range(3):
                    one, other = there[side, i, q], there[side, j, q]
                    there[side, i, q] = one - 1j * _STEP * other
                    there[side, j, q] = other + 1j * _STEP * one
            middle[:], amid[:] = here, there
            invariants(data[e, :3], data[e, 3], here, there, state)
            if step == 0:
                push(data[e], state, here, there, middle, amid, 0.0, np.zeros(0), work, own)
                for on in range(2):
                    if sides[e, on] >= 0:
                        for i in range(6):
                            force[sides[e, on], i] += own[on, i].real
            push(data[e], state, here, there, middle, amid, 0.0, stresses[e], work, own)
            for on in range(2):
                node, of = sides[e, on], sides[e, side]
                if node < 0:
                    continue
                if of >= 0:
                    for i in range(6):
                        stiffness[node, i, of, k] += own[on, i].imag / _STEP


@compiled
def foreseen(data, sides, moved, turned, rest_frames, change, out):
    """Stresses of the elements (elements, 6) at a place and by a small change (nodes, 6) there."""
    still = np.zeros((len(moved), 6))
    here, there, middle, amid = _room()
    one, state = np.empty(10, np.complex128), np.empty(8, np.complex128)
    for e in range(len(data)):
        rest = rest_frames[sides[e, 1]]
        for side in range(2):
            node = sides[e, side]
            _gather(node, moved, turned, still, turned, rest, side, here, there, middle, amid)
            if node < 0:
                continue
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                here[side, i] += 1j * _STEP * change[node, i]
                for q in range(3):
                    there[side, i, q] += (
                        1j * _STEP
                        * (change[node, 3 + j] * turned[node, k, q]
                           - change[node, 3 + k] * turned[node, j, q])
                    )  # fmt: skip
        invariants(data[e, :3], data[e, 3], here, there, state)
        g, _, _ = _values(_G, state[6], state[6])
        p, _, _ = _values(_P, state[6], state[6])
        strains(state, data[e, 10:19], g, p, one)
        for i in range(3):
            out[e, i] = data[e, 4 + i] * (one[3 + i].real + one[3 + i].imag / _STEP)
            out[e, 3 + i] = (
                data[e, 7 + i] / data[e, 3] * (one[6 + i].real + one[6 + i].imag / _STEP)
            )
