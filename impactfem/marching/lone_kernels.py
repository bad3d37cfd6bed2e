"""Compiled march of one rigid body beside planes at rest, of many members one after the other.

A step is that of `impactfem.marching.rigid` with the law of contact of
`impactfem.marching.rubbing_march`, from the same parts. Arguments that functions share:

- body: (mass [kg], inertia, inverse (3, 3) along its axes, whether it is `Rigid.free`).
- places: what can touch, each of one plane: (arms along the axes of the body (C, 3), radius,
  rolling radius (C,), shares of rims (C, 2), axis of rims (3,), whether there are rims, plane (C,),
  how far they reach from the centre (J,)); see `impactfem.system.rigid.Rigid`.
- planes: (directions, the normal first (J, dim, 3), points (J, 3)).
- laws: (friction, restitution, tangential restitution (n, J), rounding level of places (n,)).
- states: (centre (n, 3), angle or quaternion (n, 1 or 4), velocity, spin along the axes of the body
  (n, 3), forces of the step before along the directions of planes (n, C, dim), lowest directions
  of rims (n, J, 3)); changed in place.
- logs: (normal impulses so far (n, J), least gap so far (n,)).
- handing: (matrix (C dim, C dim), offset (C, dim), friction (C,)) of forces that are hard to
  find, and those to begin with (C, dim), in whose place those are put that were found elsewhere;
  its first entry is NaN for none.
- rows: (places, velocities (n, rows, 2 and more), gaps, impulses (n, rows, J)).
"""

import numpy as np

from impactfem.compiled import compiled, threaded
from impactfem.contact.cone_kernels import newton_cones, proximal_cones, without_traces
from impactfem.marching.rigid_kernels import frames, turned_further
from impactfem.marching.turn_kernels import cross, turn
from impactfem.system.rim_kernels import NEAR, add_along_rim, lowest_direction

DONE, WAITS, TURNS = 0, 1, 2
"""Why a march has stopped: at its end, for forces from elsewhere, or it turns too far in a step."""

_MOST_SYSTEMS = 10000  # linear ones; methods stop far earlier


@compiled
def reached(rotation, places, planes, lowest):
    """Arms of all places in space [m], (C, 3)."""
    arms, _, _, shares, axis, rims, of, _ = places
    found = np.empty_like(arms)
    for c in range(len(arms)):
        for k in range(3):
            found[c, k] = (
                rotation[k, 0] * arms[c, 0]
                + rotation[k, 1] * arms[c, 1]
                + rotation[k, 2] * arms[c, 2]
            )
    if rims:
        along, last = rotation @ axis, -1
        down = along
        for c in range(len(arms)):
            if of[c] != last:
                last = of[c]
                down = lowest_direction(along, planes[0][last, 0], lowest[last], NEAR)
            add_along_rim(found[c], along, down, shares[c])
    return found


@compiled
def look_down(rotation, places, planes, known, near):
    """Lowest directions of rims by those known before, (J, 3)."""
    along, found = rotation @ places[4], np.empty_like(known)
    for j in range(len(known)):
        found[j] = lowest_direction(along, planes[0][j, 0], known[j], near)
    return found


@compiled
def apart(centre, ends, places, planes):
    """Gaps of all places [m], (C,)."""
    radius, of, found = places[1], places[6], np.empty(len(ends))
    directions, points = planes
    for c in range(len(ends)):
        j, total = of[c], 0.0
        for k in range(3):
            total += (centre[k] + ends[c, k] - points[j, k]) * directions[j, 0, k]
        found[c] = total - radius[c]
    return found


@compiled
def _least(gaps, of, planes):
    """Least gaps to planes [m], (J,)."""
    found = np.full(planes, np.inf)
    for c in range(len(gaps)):
        found[of[c]] = min(found[of[c]], gaps[c])
    return found


@compiled
def starts(places, planes, states):
    """What members begin with: lowest directions, gaps, and how far and fast places are.

    Returns:
        Gaps (n, J) [m], largest coordinate [m] and speed [m/s] of a place, (n,) each.
    """
    members, of = len(states[0]), places[6]
    gaps = np.empty((members, len(planes[1])))
    size, speed = np.zeros(members), np.zeros(members)
    for i in range(members):
        rotation = frames(states[1][i : i + 1])[0]
        if places[5]:
            states[5][i] = look_down(rotation, places, planes, states[5][i], -1.0)
        ends, centre = reached(rotation, places, planes, states[5][i]), states[0][i]
        gaps[i] = _least(apart(centre, ends, places, planes), of, len(gaps[i]))
        whirl = rotation @ states[3][i]
        for c in range(len(ends)):
            moved = cross(whirl, ends[c])
            for k in range(3):
                size[i] = max(size[i], abs(centre[k] + ends[c, k]))
                speed[i] = max(speed[i], abs(states[2][i, k] + moved[k]))
    return gaps, size, speed


@compiled
def _reached(acting, count, gaps, places, planes, tolerance, motion, dt):
    """Add what touches to what acts, where that arrives; see `impactfem.marching.impacts.reached`.

    Args:
        gaps: Of all places before the layer [m], (C,).
        tolerance: Rounding level of places [m].

    Others are those of `_problem`; ``acting`` is changed in place, and how many act is returned.
    """
    of, directions = places[6], planes[0]
    first, speed, whirl, last, speed_ahead, whirl_ahead, _, _ = motion
    before, slow, off = np.empty(len(of)), np.empty(len(of)), np.empty(3)
    takes, arrives = np.zeros(len(of), dtype=np.bool_), False
    takes[acting[:count]] = True
    for c in range(len(of)):
        normal = directions[of[c], 0]
        for k in range(3):
            off[k] = -places[2][c] * normal[k]
        one = speed + cross(whirl, first[c] + off)
        two = speed_ahead + cross(whirl_ahead, last[c] + off)
        before[c], change = 0.0, 0.0
        for k in range(3):
            before[c] += normal[k] * one[k]
            change += normal[k] * (two[k] - one[k])
        slow[c] = max(abs(change), tolerance / dt)
        arrives = arrives or (takes[c] and before[c] < -slow[c])
    if not arrives:
        return count
    count = 0
    for c in range(len(of)):
        if takes[c] or (gaps[c] <= tolerance and before[c] <= slow[c]):
            acting[count] = c
            count += 1
    return count


@compiled
def _problem(acting, count, body, places, planes, law, motion, dt):
    """The law of contact and friction of what acts: matrix, offset, friction, arms.

    Args:
        acting, count: Places, and how many.
        law: Coefficients as `laws` has them, of this member: (J,) each, and the rounding level.
        motion: Rotation and arms at the start, with velocity and spin in space; the same at the
            end without forces; arms amid the layer and the inverse inertia there.
    """
    rolling, of, directions = places[2], places[6], planes[0]
    dim, mass = directions.shape[1], body[0]
    friction, restitution, rebound, tolerance = law
    first, speed, whirl, last, speed_ahead, whirl_ahead, amid, freedom = motion
    half, arrives = 0.5 * dt, False
    offset, mu, arms = np.empty((count, dim)), np.empty(count), np.empty((count, 3))
    turns, answers = np.empty((count * dim, 3)), np.empty((count * dim, 3))
    before, after, off = np.empty(3), np.empty(3), np.empty(3)
    for i in range(count):
        c = acting[i]
        j = of[c]
        mu[i] = friction[j]
        for k in range(3):
            off[k] = -rolling[c] * directions[j, 0, k]
            arms[i, k] = amid[c, k] + off[k]
            before[k], after[k] = first[c, k] + off[k], last[c, k] + off[k]
        before, after = speed + cross(whirl, before), speed_ahead + cross(whirl_ahead, after)
        for d in range(dim):
            one, two = 0.0, 0.0
            for k in range(3):
                one += directions[j, d, k] * before[k]
                two += directions[j, d, k] * after[k]
            if d == 0:
                lively = 1.0 if one > 0.0 else restitution[j]
                arrives = one < -max(abs(two - one), tolerance / dt)
            else:
                lively = rebound[j] if arrives else 0.0
            offset[i, d] = half * (two + lively * one)
            turns[i * dim + d] = cross(arms[i], directions[j, d])
            answers[i * dim + d] = freedom @ turns[i * dim + d]
    matrix = np.empty((count * dim, count * dim))
    for a in range(count * dim):
        one = directions[of[acting[a // dim]], a % dim]
        for b in range(a, count * dim):
            two = directions[of[acting[b // dim]], b % dim]
            total = 0.0
            for k in range(3):
                total += one[k] * two[k] / mass + turns[a, k] * answers[b, k]
            matrix[a, b] = matrix[b, a] = half * dt * total
    return matrix, offset, mu, arms


@compiled
def _forces(matrix, offset, mu, start, tolerance):
    """Forces in the cones (count, dim), from some to begin with, and whether they were found."""
    count, dim = offset.shape
    own, none, scale = np.arange(count), np.zeros(count), np.empty((count, dim))
    for i in range(count):
        across = 0.0
        for d in range(1, dim):
            across += matrix[i * dim + d, i * dim + d]
        scale[i] = across / (dim - 1)
        scale[i, 0] = matrix[i * dim, i * dim]
    law = matrix, offset, mu, own, none, none, scale, start, tolerance
    found, missed, total = newton_cones(*law, _MOST_SYSTEMS)
    if missed > 1.0:
        found, missed, _ = proximal_cones(*law, _MOST_SYSTEMS - total)
    return without_traces(matrix, offset, own, none, found), missed <= 1.0


@compiled
def _keep(rows, member, row, states, rotation, gaps, total):
    """Fill in a row of a member."""
    centre, angles, speed = states[0][member], states[1][member], states[2][member]
    whirl = rotation @ states[3][member]
    dim = 2 if len(angles) == 1 else 3
    own, moving = rows[0][member, row], rows[1][member, row]
    own[:dim], moving[:dim] = centre[:dim], speed[:dim]
    own[dim:] = angles
    moving[dim:] = whirl[2 * (3 - dim) :]
    rows[2][member, row], rows[3][member, row] = gaps, total


@threaded
def march_members(
    begins, beyond, span, dt, pulls, body, places, planes, laws, states, logs, handing, rows
):
    """Take the members from one on and up to another through all steps, one after the other.

    Args:
        begins: Member and step where to go on.
        beyond: Member to stop before.
        span: (number of steps, stride of the rows).
        dt: [s].
        pulls: Gravity of each step [m/s^2], (1 or more, 3).

    Returns:
        The member and step that it has stopped before, and why.
    """
    member, m = begins
    steps, every = span
    mass, inertia, inverse, free = body
    of, reach, points = places[6], places[7], planes[1]
    dim, nothing, known = planes[0].shape[1], np.zeros(3), handing[3]
    acting, ahead = np.empty(len(of), dtype=np.int64), np.empty(3)
    new, half = np.empty(3), np.empty(3)
    end, middle, freedom = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    rotation = frames(states[1][member : member + 1])[0]
    while member < beyond:
        centre, speed, spin = states[0][member], states[2][member], states[3][member]
        pushed, lowest, total = states[4][member], states[5][member], logs[0][member]
        law = laws[0][member], laws[1][member], laws[2][member], laws[3][member]
        if m % every == 0 or m == steps:
            ends = reached(rotation, places, planes, lowest)
            gaps = _least(apart(centre, ends, places, planes), of, len(points))
            _keep(rows, member, (m + every - 1) // every, states, rotation, gaps, total)
        if m == steps:
            member, m = member + 1, 0
            if member < beyond:
                rotation = frames(states[1][member : member + 1])[0]
            continue
        pull = pulls[min(m, len(pulls) - 1)]
        for k in range(3):
            ahead[k] = speed[k] + dt * (mass * pull[k]) / mass
        turned = new, half, end, middle, freedom
        if not turn(inertia, inverse, rotation, spin, nothing, dt, False, free, *turned):
            return member, m, TURNS
        there = centre + 0.5 * dt * (speed + ahead)
        down = look_down(end, places, planes, lowest, -1.0) if places[5] else lowest
        near, count = False, 0
        for j in range(len(points)):
            distance = 0.0
            for k in range(3):
                distance += (there[k] - points[j, k]) * planes[0][j, 0, k]
            near = near or distance <= reach[j]
        if near:
            last = reached(end, places, planes, down)
            gaps = apart(there, last, places, planes)
            for c in range(len(of)):
                if gaps[c] <= 0.0 and (pushed[c, 0] > 0.0 or gaps[c] < -law[3]):
                    acting[count] = c
                    count += 1
        if not count:
            pushed[:] = 0.0
        else:
            first = reached(rotation, places, planes, down)
            amid = reached(middle, places, planes, down)
            motion = first, speed, rotation @ spin, last, ahead, end @ new, amid, freedom
            shut = apart(centre, first, places, planes)
            count = _reached(acting, count, shut, places, planes, law[3], motion, dt)
            matrix, offset, mu, arms = _problem(
                acting, count, body, places, planes, law, motion, dt
            )
            before = np.empty((count, dim))
            for i in range(count):
                before[i] = pushed[acting[i]]
            if np.isnan(known[0, 0]):
                force, found = _forces(matrix, offset, mu, before, law[3])
            else:
                force, found = known[:count].copy(), True
                known[0, 0] = np.nan
            if not found:
                size = count * dim
                handing[0][:size, :size], handing[1][:count] = matrix, offset
                handing[2][:count], handing[2][count:] = mu, np.nan
                known[:count] = before
                return member, m, WAITS
            push, moment = np.zeros(3), np.zeros(3)
            pushed[:] = 0.0
            for i in range(count):
                j, whole = of[acting[i]], np.zeros(3)
                for d in range(dim):
                    for k in range(3):
                        whole[k] += force[i, d] * planes[0][j, d, k]
                push += whole
                moment += cross(arms[i], whole)
                total[j] += dt * force[i, 0]
                pushed[acting[i]] = force[i]
            if force.any():
                for k in range(3):
                    ahead[k] = speed[k] + (dt * (mass * pull[k]) + dt * push[k]) / mass
                if not turn(
                    inertia, inverse, rotation, spin, dt * moment, dt, False, free, *turned
                ):
                    return member, m, TURNS
        way = 0.5 * dt * (spin + new)
        for k in range(3):
            centre[k] += 0.5 * dt * (speed[k] + ahead[k])
            speed[k], spin[k] = ahead[k], new[k]
        lowest[:] = down
        angles = states[1][member : member + 1]
        angles[:] = turned_further(angles, half.reshape(1, 3), way.reshape(1, 3))
        rotation = frames(angles)[0]
        if near:
            ends = reached(rotation, places, planes, lowest)
            least = apart(centre, ends, places, planes).min()
            logs[1][member] = min(logs[1][member], least)
        m += 1
    return member, 0, DONE
