"""Compiled flights, impacts and lasting contact of a linear system with one constraint.

The same rules as in `event_contacts`, without a return to Python at each lasting contact: a ball
that chatters on a vibrating table comes to rest in each period.
"""

import math

from impactfem.compiled import compiled
from impactfem.vibro.flight_kernels import EPS, EVENT, FULL, fly

STALLED = 4
"""Events do not move on in time."""

_MAX_STALL = 1000


@compiled
def fly_alone(
    free_powers, free_whole, free_gaps, free_doubts, free_h,
    held_powers, held_whole, held_gaps, held_h, forces, doubt,
    rates, waves, none, one, watched, unwatched, order,
    answers, response, restitution, stick, relative,
    z, clock, counts, duration, times, position, velocity, impulse, lasting, table, who,
    mode, spells, drops,
):  # fmt: skip
    """Fly, hit, rest and be released until the end.

    Args:
        free_powers, free_whole, free_gaps, free_h: The free flight: see `fly`.
        free_doubts: Rows of the rounding of the coefficients of the gap, for |z| (terms, 1, n).
        held_powers, held_whole, held_gaps, held_h, forces, doubt: That along the constraint.
        rates, waves, answers, response, restitution, stick, relative: See `fly`.
        none, one, watched, unwatched: Empty (0,), [0] and [False], [True] (1,): constants.
        order, z, clock, counts, duration, times, position, velocity, impulse, lasting, table,
            who: See `fly`.
        mode: 1 in lasting contact, else 0 (1,); changed.
        spells: Start and end of the first lasting contacts [s] (kept, 2); changed.
        drops: Largest speed dropped, energy dropped [J], number of lasting contacts (3,); changed.

    Returns:
        DONE, FULL, BROKEN or STALLED.
    """
    d = position.shape[1]
    n = len(z)
    stalled, last = 0, -1.0
    while True:
        if mode[0] == 0:
            status = fly(
                free_powers, free_whole, free_gaps, rates, forces[:, :0], doubt[:0], free_h,
                waves, none, watched, order, answers, response, restitution, stick, relative, z,
                clock, counts, duration, times, position, velocity, impulse, lasting, table, who,
            )  # fmt: skip
        else:
            status = fly(
                held_powers, held_whole, held_gaps, rates, forces, doubt, held_h, waves, one,
                unwatched, order, answers, response, restitution, stick, relative, z, clock,
                counts, duration, times, position, velocity, impulse, lasting, table, who,
            )  # fmt: skip
        if status != EVENT:
            return status
        stalled = stalled + 1 if clock[0] == last else 0
        last = clock[0]
        if stalled > _MAX_STALL:
            return STALLED
        gap, speed, noise = 0.0, 0.0, 0.0
        for m in range(n):
            gap += free_gaps[0, 0, m] * z[m]
            speed += rates[0, m] * z[m]
            noise += 64.0 * EPS * abs(rates[0, m] * z[m])
        kept = int(drops[2]) - 1
        if mode[0] == 1:  # the contact force has vanished
            for i in range(d):
                z[i] -= answers[i, 0] * gap / response[0]
                z[d + i] -= answers[i, 0] * speed / response[0]
            if kept < len(spells):
                spells[kept, 1] = max(clock[0], spells[kept, 0])
            mode[0] = 0
            order[0] = 2
            continue
        after = speed
        if speed < -noise:
            if counts[1] >= len(table):
                order[0] = 0
                return FULL
            after = -restitution[0] * speed
            push = (after - speed) / response[0]
            clock[1] = max(clock[1], -speed)
            row = counts[1]
            table[row, 0] = clock[0]
            table[row, 1] = 0.0
            table[row, 2] = speed
            table[row, 3] = after
            table[row, 4] = push
            counts[1] = row + 1
            if counts[0] < len(times):
                impulse[counts[0], 0] += push
        for i in range(d):
            z[i] -= answers[i, 0] * gap / response[0]
            z[d + i] += answers[i, 0] * (after - speed) / response[0]
        slow = abs(after) <= max(noise, stick, relative * clock[1])
        # What no rate of the gap decides stays closed; see `event_choice`.
        pull, first = 0.0, 2
        while slow and first < len(free_gaps):
            pull, rounding = 0.0, 0.0
            for m in range(n):
                pull += free_gaps[first, 0, m] * z[m]
                rounding += 0.5 * free_doubts[first, 0, m] * abs(z[m])
            if abs(pull) > rounding:
                break
            pull = 0.0
            first += 1
        if slow and pull <= 0.0:
            for i in range(d):
                z[d + i] -= answers[i, 0] * after / response[0]
            if after > 0.0 and speed < -noise and counts[0] < len(times):
                impulse[counts[0], 0] -= after / response[0]  # the last rebound does not happen
            drops[0] = max(drops[0], abs(after))
            drops[1] += 0.5 * after * after / response[0]
            drops[2] += 1.0
            tail = 0.0  # time that the dropped rebounds would still take
            if after > 0.0 and pull < 0.0 and first == 2 and restitution[0] < 1.0:
                rate = 2.0 * pull / (free_h * free_h)
                tail = 2.0 * after / (-rate * (1.0 - restitution[0]))
            if kept + 1 < len(spells):
                spells[kept + 1, 0] = clock[0] + tail
                spells[kept + 1, 1] = math.nan
            mode[0] = 1
        else:
            order[0] = 1 if after > noise else first
