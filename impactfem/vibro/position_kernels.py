"""Compiled steps of linear systems with few degrees of freedom, at position and velocity level.

At most one constraint acts in a step that is solved here. A step in which more would act is handed
back with the ``offset`` of its complementarity problem, and taken with the impulses ``given`` at
the next call: there is one active-set solver, and one code of a step. Nothing is allocated inside
the loops.

Arguments shared by both loops:

- span: (m, begin, end, last, every): the step to start with, the first step of the tables and the
  one after their last, the last level of the motion and the stride of its rows; dt: h.
- loads (steps, d) and walls (steps, columns): what depends on time, for the steps begin to end.
- stiff, damp (d, d), response (d, J), coupling = normals @ response (J, J): the step, divided by A.
- normals (J, d), offsets (J,), restitution (J,): the constraints.
- u, s (d,), gap, before (J,): the state at t_m, changed in place.
- episodes (J, 6): of each constraint that acts [since, speed before, impulse, speed after, steps
  since the last impact, last impulse].
- total (2 J,): impulse of all steps so far, and that of lasting contact; worst (1,): least gap.
- given (J,): impulses of step m from the solver, given[0] = nan for none; offset (J,): see above.
- rows: (positions, velocities, gaps, impulses (rows, 2 J)): filled at every
  ``every``-th level and the last.
- events (n, 5): room for [time, constraint, speed before, after, impulse]; none kept if n = 0.

Both return the step they stopped before, the number of events written, and whether that step waits
for the solver.
"""

import numpy as np

from impactfem.compiled import compiled

ROUNDING = 1e-12
"""Share of the terms of a gap below which it is no distance."""

_IMPACT = 2.0  # steps for which an impact acts at most
_SPIKE = 3.0  # growth of the impulse from one step to the next that is an impact
_TRACE = 1e-9  # share of the impulses that is no impact


@compiled
def single_impulse(offset, coupling, impulse):
    """Solve 0 <= P _|_ offset + coupling P >= 0 if at most one constraint acts; say if it was."""
    acting = -1
    for c in range(len(offset)):
        impulse[c] = 0.0
        if offset[c] < 0.0:
            if acting >= 0:
                return False
            acting = c
    if acting >= 0:
        size = -offset[acting] / coupling[acting, acting]
        for c in range(len(offset)):
            if c != acting and offset[c] + coupling[c, acting] * size < 0.0:
                return False
        impulse[acting] = size
    return True


@compiled
def lasts(c, impulse, episodes):
    """Whether an impulse of this step belongs to lasting contact, not to an impact.

    An impact acts for two steps at most. The impulse of lasting contact is that of the step before
    but for a share of the order of the step: one that is several times as large is an impact.
    """
    return 0.0 < impulse <= _SPIKE * episodes[c, 5] and episodes[c, 4] >= _IMPACT


@compiled
def note(c, impulse, time, speed, after, episodes, events, written):
    """Follow the impacts of a constraint; write each when it has ended.

    From the impulse of an impact that ends in lasting contact the share of that contact is taken
    away. What is left of a contact that begins without an impact is nothing.

    Args:
        c: The constraint.
        impulse: What acts in this step [N s].
        time: When an episode that starts now is dated.
        speed: Normal velocity before this step.
        after: Normal velocity after it.
        episodes: See the module.
        events: See the module.
        written: Events so far.

    Returns:
        Events written.
    """
    steps = episodes[c, 4]
    stays = lasts(c, impulse, episodes)
    if stays and steps == _IMPACT:
        left = episodes[c, 2] - _IMPACT * impulse
        episodes[c, 2] = left if left > _TRACE * episodes[c, 2] else 0.0
        episodes[c, 3] = after
    over = steps >= _IMPACT or (steps > 0.0 and impulse == 0.0)
    if over and episodes[c, 2] > 0.0:
        if events.shape[0] > 0:
            events[written, 0] = episodes[c, 0]
            events[written, 1] = c
            events[written, 2] = episodes[c, 1]
            events[written, 3] = episodes[c, 3]
            events[written, 4] = episodes[c, 2]
            written += 1
        episodes[c, 2] = 0.0
    if impulse == 0.0:
        episodes[c, 4] = 0.0
        return written
    if not stays:
        if over or steps == 0.0:
            steps = 0.0
            episodes[c, 0] = time
            episodes[c, 1] = speed
            episodes[c, 2] = 0.0
        episodes[c, 2] += impulse
        episodes[c, 3] = after
    episodes[c, 4] = steps + 1.0
    episodes[c, 5] = impulse
    return written


@compiled
def march_positions(
    span, dt, loads, walls, stiff, damp, response, coupling, normals, offsets, restitution,
    u, s, gap, before, episodes, total, worst, given, offset, rows, events,
):  # fmt: skip
    """Paoli's and Schatzman's scheme, in the change s = U^m - U^{m-1}.

        s_new = s + loads_m - stiff U - damp s + response P,   U_new = U + s_new,
        0 <= P _|_ gap(U_new) + e gap(U_old) >= 0.

    The columns of walls are b(t_{m+1}), and how much further gap(U_old) and gap(U) are for the law
    (`kicks.Kicks.shifts`); P / h is an impulse.
    """  # fmt: skip
    m, begin, end, last, every = span
    d, count = len(u), len(gap)
    new = np.empty(d)
    following = np.empty(count)
    impulse = np.zeros(count)
    written = 0
    while m < end:
        if 0 < events.shape[0] < written + count:
            return m, written, False
        k = m - begin
        for i in range(d):
            value = s[i] + loads[k, i]
            for j in range(d):
                value -= stiff[i, j] * u[j] + damp[i, j] * s[j]
            new[i] = value
        for c in range(count):
            place = offsets[c] - walls[k, c]
            for i in range(d):
                place += normals[c, i] * (u[i] + new[i])
            following[c] = place
            offset[c] = place + restitution[c] * (before[c] + walls[k, count + c])
        if not np.isnan(given[0]):
            for c in range(count):
                impulse[c] = given[c]
            given[0] = np.nan
        elif not single_impulse(offset, coupling, impulse):
            return m, written, True
        for c in range(count):
            if impulse[c] > 0.0:
                for i in range(d):
                    new[i] += response[i, c] * impulse[c]
                for other in range(count):
                    following[other] += coupling[other, c] * impulse[c]
        if m % every == 0 or m == last:
            row = (m + every - 1) // every
            for i in range(d):
                rows[0][row, i] = u[i]
                rows[1][row, i] = 0.5 * (s[i] + new[i]) / dt
            for c in range(count):
                rows[2][row, c] = gap[c]
                half = 0.5 * impulse[c] / dt
                stays = lasts(c, impulse[c] / dt, episodes)
                rows[3][row, c] = total[c] + half
                rows[3][row, count + c] = total[count + c] + (half if stays else 0.0)
        for c in range(count):
            total[c] += impulse[c] / dt
            if lasts(c, impulse[c] / dt, episodes):
                total[count + c] += impulse[c] / dt
            worst[0] = min(worst[0], gap[c])
            nearer = walls[k, 2 * count + c] - walls[k, count + c]
            speed = (gap[c] - before[c] + nearer) / dt
            after = (following[c] - gap[c]) / dt
            time = m * dt
            if speed < 0.0:
                time += min(max(gap[c] / -speed, -dt), dt)
            if impulse[c] == 0.0 and episodes[c, 4] != 0.0:
                episodes[c, 3] = after
            written = note(c, impulse[c] / dt, time, speed, after, episodes, events, written)
            before[c] = gap[c]
            gap[c] = following[c]
        for i in range(d):
            s[i] = new[i]
            u[i] += new[i]
        m += 1
    return m, written, False


@compiled
def march_velocities(
    span, dt, loads, walls, stiff, damp, response, coupling, normals, offsets, restitution,
    u, s, gap, before, episodes, total, worst, given, offset, rows, events, theta,  # noqa: ARG001  # both loops take the same
):  # fmt: skip
    """Moreau's and Jean's scheme, s = v: the impulses P act on velocities.

        v_new = v + loads_m - stiff u - damp v + response P,
        u_new = u + h v + h theta (v_new - v),
        0 <= P _|_ w_new + e w >= 0 where the gap at u + h v / 2 is <= 0,   w = J v - b'.

    Gaps up to `ROUNDING` of their terms count as 0. The columns of walls are b(t_m), b(t_m + h/2),
    b'(t_m) and b'(t_{m+1}); ``before`` is not used.
    """  # fmt: skip
    m, begin, end, last, every = span
    d, count = len(u), len(gap)
    new = np.empty(d)
    speed = np.empty(count)
    following = np.empty(count)
    impulse = np.zeros(count)
    written = 0
    while m < end:
        if 0 < events.shape[0] < written + count:
            return m, written, False
        k = m - begin
        for i in range(d):
            value = s[i] + loads[k, i]
            for j in range(d):
                value -= stiff[i, j] * u[j] + damp[i, j] * s[j]
            new[i] = value
        for c in range(count):
            place, along, along_new, size = offsets[c], 0.0, 0.0, abs(offsets[c])
            for i in range(d):
                place += normals[c, i] * u[i]
                size += abs(normals[c, i] * u[i])
                along += normals[c, i] * s[i]
                along_new += normals[c, i] * new[i]
            gap[c] = place - walls[k, c]
            speed[c] = along - walls[k, 2 * count + c]
            following[c] = along_new - walls[k, 3 * count + c]
            # What lies on a constraint stays closed, whatever rounding does to its place.
            closed = place + 0.5 * dt * along - walls[k, count + c] <= ROUNDING * size
            offset[c] = following[c] + restitution[c] * speed[c] if closed else np.inf
        if not np.isnan(given[0]):
            for c in range(count):
                impulse[c] = given[c]
            given[0] = np.nan
        elif not single_impulse(offset, coupling, impulse):
            return m, written, True
        for c in range(count):
            if impulse[c] > 0.0:
                for i in range(d):
                    new[i] += response[i, c] * impulse[c]
                for other in range(count):
                    following[other] += coupling[other, c] * impulse[c]
        if m % every == 0 or m == last:
            row = (m + every - 1) // every
            for i in range(d):
                rows[0][row, i] = u[i]
                rows[1][row, i] = s[i]
            for c in range(count):
                rows[2][row, c] = gap[c]
                rows[3][row, c] = total[c]
                rows[3][row, count + c] = total[count + c]
        for c in range(count):
            total[c] += impulse[c]
            if lasts(c, impulse[c], episodes):
                total[count + c] += impulse[c]
            worst[0] = min(worst[0], gap[c])
            time = m * dt
            if speed[c] < 0.0:
                time += min(max(gap[c] / -speed[c], 0.0), dt)
            written = note(c, impulse[c], time, speed[c], following[c], episodes, events, written)
        for i in range(d):
            u[i] += dt * (s[i] + theta * (new[i] - s[i]))
            s[i] = new[i]
        m += 1
    return m, written, False


@compiled
def march_members(
    kernel, begins, span, dt, tables, matrices, states, logs, handing, rows, extra,
):  # fmt: skip
    """Take the members of an ensemble through the steps of the tables, one after the other.

    Args:
        kernel: One of the loops above.
        begins: (member, m): where to go on.
        span: (begin, end, last, every), as above.
        dt: Time step.
        tables: loads, walls.
        matrices: stiff, damp, response, coupling, normals, offsets, restitution.
        states: u, s (n, d), gap, before (n, J).
        logs: episodes (n, J, 6), total (n, 2 J), worst (n, 1).
        handing: given, offset (J,).
        rows: (positions, velocities (n, rows, d), gaps (n, rows, J), impulses (n, rows, 2 J)).
        extra: Further arguments of the loop.

    Returns:
        The member and the step that wait for the solver; n if all are done.
    """
    member, m = begins
    begin, end, last, every = span
    nothing = np.empty((0, 5))
    while member < len(states[0]):
        m, _, waits = kernel(
            (m, begin, end, last, every), dt, *tables, *matrices,
            states[0][member], states[1][member], states[2][member], states[3][member],
            logs[0][member], logs[1][member], logs[2][member], *handing,
            (rows[0][member], rows[1][member], rows[2][member], rows[3][member]),
            nothing, *extra,
        )  # fmt: skip
        if waits:
            return member, m
        member += 1
        m = begin
    return member, m
