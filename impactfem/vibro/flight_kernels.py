"""Compiled flights of linear systems: Taylor polynomials, their first roots, and single impacts.

The state z = (u, v, 1, t, cos w_k t, sin w_k t) obeys z' = A z. In a substep of length h it is the
polynomial z(tau) = sum of T_k z tau^k, T_k = (A h)^k / k!, 0 <= tau <= 1, so that gaps, contact
forces and their integrals are polynomials too, and events are roots of polynomials.
"""

import math

import numpy as np

from impactfem.compiled import compiled

DONE, EVENT, FULL, BROKEN = 0, 1, 2, 3
"""The end is reached; an event to be treated outside; the table of impacts is full; not finite."""

EPS = 2.0**-52
_SMALL = 4  # from more coordinates on, whole substeps use the summed series
_SAMPLES = 16  # of a substep, for the largest force
_MAX_STEPS = 400  # safe steps to a root; a double root needs about 60


@compiled
def first_root(c, order, size, end):
    """First root in [0, end] at which the polynomial sum of c_k s^k falls; -1.0 if there is none.

    No root is missed: from a point where p > 0 one steps to the root of the parabola that bounds p
    from below, p + p' s - m s^2 / 2, with -m <= p'' on all of [0, end]. Near a simple root this
    is Newton's method from one side.

    Args:
        c: Coefficients, shape (n,).
        order: Known multiplicity of the root at 0, which is left out: 0, 1 or 2.
        size: Size of the terms that were added up in c_order, for its rounding.
        end: End of the interval, > 0.
    """
    last = len(c) - 1
    bend = 2.0 * c[order + 2]
    power = 1.0
    for k in range(3, last - order + 1):
        power *= end
        bend += k * (k - 1) * min(c[order + k], 0.0) * power
    s = 0.0
    for _ in range(_MAX_STEPS):
        p = c[last]
        dp = 0.0
        terms = abs(c[last])
        for k in range(last - 1, order - 1, -1):
            dp = dp * s + p
            p = p * s + c[k]
            terms = terms * s + abs(c[k])
        if p <= 4.0 * EPS * (size + terms):
            if dp <= 0.0:
                return s
            p = 0.0
        if bend >= 0.0:
            if dp >= 0.0:
                return -1.0
            step = -p / dp
        else:
            root = math.sqrt(dp * dp - 2.0 * bend * p)
            step = (dp + root) / -bend if dp >= 0.0 else 2.0 * p / (root - dp)
        if s + step > end:
            return -1.0
        if step <= EPS * s or step == 0.0:
            if dp <= 0.0:
                return s
            step = 2.0 * EPS * end
        s += step
    return s


@compiled
def taylor(powers, z, s, rows, out):
    """First rows of z(s) = sum of T_k z s^k; powers has shape (terms, n, n)."""
    last = len(powers) - 1
    n = len(z)
    for i in range(rows):
        y = 0.0
        for k in range(last, 0, -1):
            term = 0.0
            for m in range(n):
                term += powers[k, i, m] * z[m]
            y = (y + term) * s
        out[i] = y + z[i]


@compiled
def apply(matrix, z, rows, out):
    """First rows of matrix z."""
    for i in range(rows):
        value = 0.0
        for m in range(len(z)):
            value += matrix[i, m] * z[m]
        out[i] = value


@compiled
def refresh(z, first, time, waves):
    """Set the entries 1, t, cos w t, sin w t of z, which begin at ``first``."""
    z[first] = 1.0
    z[first + 1] = time
    for k in range(len(waves)):
        z[first + 2 + 2 * k] = math.cos(waves[k] * time)
        z[first + 3 + 2 * k] = math.sin(waves[k] * time)


@compiled
def integrate_forces(c, closed, start, end, h, force):
    """Add the integral of the contact forces, sum of c_k s^k, over h (start, end)."""
    for i in range(len(closed)):
        total = 0.0
        for k in range(c.shape[1] - 1, -1, -1):
            total += c[i, k] * (end ** (k + 1) - start ** (k + 1)) / (k + 1)
        force[closed[i]] += h * total


@compiled
def largest_sum(c, end):
    """Largest value in [0, end] of the sum of polynomials with rows c, by samples and parabolas.

    Polynomials of a substep turn by about a radian at most: 17 samples leave 1e-6 of its size.
    """
    values = np.empty(_SAMPLES + 1)
    for m in range(_SAMPLES + 1):
        s = end * m / _SAMPLES
        total = 0.0
        for i in range(len(c)):
            value = 0.0
            for k in range(c.shape[1] - 1, -1, -1):
                value = value * s + c[i, k]
            total += value
        values[m] = total
    most = values.max()
    top = values.argmax()
    if 0 < top < _SAMPLES:
        rise = 0.5 * (values[top + 1] - values[top - 1])
        bend = values[top + 1] - 2.0 * values[top] + values[top - 1]
        if bend < 0.0:
            most -= 0.5 * rise * rise / bend
    return most


@compiled
def by_turns(matrix, speed, restitution, noise, limit):
    """Impacts one after the other, the fastest approach first, until none approaches.

    Args:
        matrix: G M^-1 G^T (n, n).
        speed: Normal speeds (n,); changed.
        restitution: e (n,).
        noise: Rounding of these speeds (n,); changed: at least that of the impulses.
        limit: Number of impacts.

    Returns:
        Impulses (n,), and whether the impacts came to an end.
    """
    total = np.zeros(len(speed))
    moved = np.zeros(len(speed))
    for _ in range(limit):
        worst = np.argmin(speed + noise)
        if speed[worst] >= -noise[worst]:
            return total, True
        impulse = -(1.0 + restitution[worst]) * speed[worst] / matrix[worst, worst]
        total[worst] += impulse
        for i in range(len(speed)):
            speed[i] += impulse * matrix[i, worst]
            moved[i] += abs(impulse * matrix[i, worst])
            noise[i] = max(noise[i], 32.0 * EPS * moved[i])
    return total, False


@compiled
def fly(
    powers, whole, gaps, rates, forces, doubt, h, waves, closed, ignored, order,
    answers, response, restitution, stick, relative,
    z, clock, counts, duration, times, position, velocity, impulse, lasting, table, who,
):  # fmt: skip
    """Fly until the end or an event that is not the impact of one constraint alone.

    Args:
        powers, whole: T_k (terms, n, n); the first 2d rows of their sum (2d, n).
        gaps, rates: Rows of the gaps times T_k (terms, J, n); of the normal velocities (J, n).
        forces, doubt: Rows of the contact forces of the closed constraints times T_k
            (terms, S, n); rows of the size of their rounding, for |z| (S, n).
        h, waves: Substep [s]; frequencies w_k.
        closed, ignored: Closed constraints (S,); which constraints are not watched (J,).
        order: Multiplicity of the root of each gap at the present time (J,); changed.
        answers, response: M^-1 G^T (d, J); diagonal of G M^-1 G^T (J,).
        restitution: e (J,).
        stick, relative: Speed [m/s] and share of the largest impact speed, at or below which a
            rebound is left to the caller.
        z: State (n,); changed.
        clock: Time, largest impact speed, largest sum of the forces of lasting contact (3,);
            changed.
        counts: Next row of output, impacts in the table, substeps (3,); changed.
        duration, times: End and times of the output rows.
        position, velocity: Output (rows, d), (rows, d).
        impulse, lasting: Impulses of impacts and integrals of contact forces (rows, J).
        table: Impacts (time, constraint, before, after, impulse) (capacity, 5).
        who: Gets the constraint of the event, or S of a force: -1 - its place in closed.

    Returns:
        DONE, EVENT, FULL or BROKEN.
    """
    terms, n = powers.shape[0], powers.shape[1]
    d, num = position.shape[1], gaps.shape[1]
    c = np.empty(terms)
    fc = np.empty((len(closed), terms))
    new = np.empty(n)
    rows = len(times)
    while True:
        t = clock[0]
        refresh(z, 2 * d, t, waves)
        best = min(1.0, (duration - t) / h)
        last = best < 1.0 or t + h >= duration
        event, pressed = -1, -1
        for j in range(num):
            if ignored[j] or best <= 0.0:
                continue
            for k in range(terms):
                value = 0.0
                for m in range(n):
                    value += gaps[k, j, m] * z[m]
                c[k] = value
            p = order[j]
            if p == 1 and c[1] < 0.0:
                p = 0
            size = 0.0
            for m in range(n):
                size += abs(gaps[p, j, m] * z[m])
            if p == 0 and c[0] <= 4.0 * EPS * size and c[1] > 0.0:
                p = 1
                size = 0.0
                for m in range(n):
                    size += abs(gaps[1, j, m] * z[m])
            s = first_root(c, p, size, best)
            if s >= 0.0 and (s < best or event < 0):
                best, event = s, j
        for i in range(len(closed)):
            for k in range(terms):
                value = 0.0
                for m in range(n):
                    value += forces[k, i, m] * z[m]
                fc[i, k] = value
                c[k] = value
            size = 0.0
            for m in range(n):
                size += doubt[i, m] * abs(z[m])
            c[0] += size
            s = first_root(c, 0, 0.0, best) if best > 0.0 and size > 0.0 else -1.0
            if s >= 0.0 and (s < best or event < 0):
                best, event, pressed = s, 0, i
        now = t + best * h
        if event < 0 and last:
            now = duration
        if len(closed) and best > 0.0:
            clock[2] = max(clock[2], largest_sum(fc, best))
        start = 0.0
        row = counts[0]
        while row < rows and (times[row] < now or (event < 0 and last)):
            s = min(max((times[row] - t) / h, 0.0), best)
            taylor(powers, z, s, 2 * d, new)
            for i in range(d):
                position[row, i] = new[i]
                velocity[row, i] = new[d + i]
            integrate_forces(fc, closed, start, s, h, lasting[row])
            start = s
            row += 1
        counts[0] = row
        if row < rows:
            integrate_forces(fc, closed, start, best, h, lasting[row])
        if best == 1.0 and d > _SMALL:
            apply(whole, z, 2 * d, new)
        else:
            taylor(powers, z, best, 2 * d, new)
        size = 0.0
        for i in range(2 * d):
            z[i] = new[i]
            size += abs(new[i])
        clock[0] = now
        counts[2] += 1
        if not size < math.inf:
            return BROKEN
        if event < 0:
            if last:
                return DONE
            if best > 0.0:
                order[:] = 0
            continue
        refresh(z, 2 * d, now, waves)
        who[0] = -1 - pressed if pressed >= 0 else event
        if pressed >= 0 or len(closed):
            return EVENT
        gap, speed = 0.0, 0.0
        for j in range(num):
            value, size = 0.0, 0.0
            for m in range(n):
                value += gaps[0, j, m] * z[m]
                size += 16.0 * abs(gaps[0, j, m] * z[m]) + now * abs(rates[j, m] * z[m])
            if j == event:
                gap = value
                for m in range(n):
                    speed += rates[j, m] * z[m]
            elif value <= 4.0 * EPS * size:  # rounding of the state and of the time
                return EVENT
        fastest = max(clock[1], -speed)
        after = -restitution[event] * speed
        if after <= max(stick, relative * fastest):
            return EVENT
        if counts[1] >= len(table):
            order[:] = 0
            return FULL
        clock[1] = fastest
        push = (after - speed) / response[event]
        for i in range(d):
            z[i] -= answers[i, event] * gap / response[event]
            z[d + i] += answers[i, event] * push
        row = counts[1]
        table[row, 0] = now
        table[row, 1] = event
        table[row, 2] = speed
        table[row, 3] = after
        table[row, 4] = push
        counts[1] = row + 1
        if counts[0] < rows:
            impulse[counts[0], event] += push
        order[:] = 0
        order[event] = 1
