"""Compiled Newton's steps for contact forces in their cones; see `contact.friction_newton`."""

import numpy as np

from impactfem.compiled import compiled
from impactfem.contact.friction_kernels import islands_of

_ROUNDING = 1e-13  # share of the largest displacement that counts as zero
_DIGITS = 4.5e-16  # share of it that sums of a few terms are rounded by
_NEAR, _IN_VAIN = 20.0, 5  # times that from which on one step that gains nothing ends, else some
_STEPS = 25  # of Newton from one start; the method needs 3 to 8 where it converges
_SHORTER = (1.0, 0.5, 0.25)  # shares of a step, of which the best is taken
_DEPENDENT = 1e-14  # pivots of matrices with a diagonal of about 1 that count as zero
_NEARLY = 1e-9  # those below which pairs are taken to depend on each other at first
_HELD = 1e-5  # what is added to their diagonal there
_CORRECTED, _LEFT, _ENOUGH = 4, 1e-9, 0.1  # solutions for that, and the shares that may be left
_TINY = np.finfo(np.float64).tiny
_FIRST, _MOST = 0.1, 10.0  # compliances of proximal steps, as shares of those that forces have
_FALLS, _GROWS = 0.25, 2.0  # after a step that Newton's method has found, and another one
_PROXIMAL = 60
_PARTED = 1e-9  # share of what parts cones and forces by which it may miss doing so


@compiled
def newton_cones(matrix, offset, friction, master, spinning, base, scale, start, tolerance, limit):
    """Newton's steps from some forces.

    Args:
        matrix, offset, friction, master, spinning, base: See
            `impactfem.contact.friction_newton.ConeProblem`.
        scale: The numbers a of each component [m/N], (pairs, dim).
        start: Forces [N], (pairs, dim).
        tolerance: Rounding level of displacements [m].
        limit: Of linear systems.

    Returns:
        The best forces, their error in units of the tolerance, and linear systems solved.
    """
    law = matrix, offset, friction, master, spinning, base, scale
    pairs, dim = start.shape
    push = master == np.arange(pairs)
    force = start.copy()
    best, following = force, force
    least, step, most = np.inf, 0, min(_STEPS, limit)
    answer, error, missed, rounding = missed_by(law, force, tolerance)
    dependent, vain = False, 0
    for step in range(most + 1):
        if not np.isfinite(missed):
            break
        # Below the tolerance steps go on while they gain: the energy asks for the last digit, and
        # far from it a contact with hardly a force may ask for some steps.
        vain = vain + 1 if missed > 0.5 * least else 0
        if least <= 1.0 and vain > (0 if least <= _NEAR * rounding else _IN_VAIN):
            return best, least, step
        if missed < least:
            best, least = force, missed
        if missed <= rounding or step == most:
            break
        moving = _derivative(law, force, answer)
        way, dependent = _solved(moving, error.copy().reshape(-1), dependent)
        found = np.inf
        for share in _SHORTER:
            trial = force - share * way.reshape(pairs, dim)
            for j in range(pairs):
                if push[j] and not trial[j, 0] > 0.0:
                    trial[j, 0] = 0.0
            after, further, amount, rounding = missed_by(law, trial, tolerance)
            if amount < found:
                found, following, error, answer = amount, trial, further, after
            if found < missed:
                break
        if not np.isfinite(found):
            break
        force, missed = following, found
    return best, least, step


@compiled
def proximal_cones(
    matrix, offset, friction, master, spinning, base, scale, start, tolerance, limit
):
    """Steps with a compliance of every force by itself that leaves nothing at a solution.

    See `impactfem.contact.friction_solver`; arguments and what is returned as of `newton_cones`.
    """
    law = matrix, offset, friction, master, spinning, base, scale
    pairs, dim = start.shape
    force, best, softer, nearer = start, start, matrix.copy(), offset.copy()
    share, least, total = _FIRST, np.inf, 0
    for _ in range(_PROXIMAL):
        for j in range(pairs):
            for c in range(dim):
                own = share * matrix[j * dim + c, j * dim + c]
                softer[j * dim + c, j * dim + c] = matrix[j * dim + c, j * dim + c] + own
                nearer[j, c] = offset[j, c] - own * force[j, c]
        found, left, systems = newton_cones(
            softer, nearer, friction, master, spinning, base, (1.0 + share) * scale, force,
            tolerance, limit - total,
        )  # fmt: skip
        total += max(1, systems)
        if total >= limit or share > _MOST:
            break
        if left > 1.0:
            share *= _GROWS
            continue
        force, share = found, share * _FALLS
        missed = missed_by(law, force, tolerance)[2]
        if missed < least:
            best, least = force, missed
        if missed <= 1.0:
            break
    return best, least, total


@compiled
def without_traces(matrix, offset, master, base, force):
    """No force, not even by rounding, where a pair is open; of `newton_cones`' arguments."""
    pairs, dim = force.shape
    found, is_open = force.copy(), np.zeros(pairs, dtype=np.bool_)
    for j in range(pairs):
        if master[j] != j:
            continue
        place = offset[j, 0]
        for k in range(pairs):
            for c in range(dim):
                place += matrix[j * dim, k * dim + c] * force[k, c]
        if force[j, 0] <= place / matrix[j * dim, j * dim]:
            found[j, 0] = 0.0
            is_open[j] = True
    for j in range(pairs):
        if is_open[master[j]] and base[j] <= 0.0:
            found[j, 1:] = 0.0
            if master[j] != j:
                found[j, 0] = 0.0
    return found


@compiled
def missed_by(law, force, tolerance):
    """Answers (w, s) to forces, errors of the law [N], (pairs, dim) each, and the largest error.

    That is in units of the tolerance, and so is what of it may be rounding of the answers.
    """
    matrix, offset, friction, master, spinning, base, scale = law
    pairs, dim = force.shape
    answer, error = np.empty((pairs, dim)), np.empty((pairs, dim))
    flat, spread = force.copy().reshape(-1), 0.0
    for j in range(pairs):
        for c in range(dim):
            total, size = offset[j, c], 0.0
            spread = max(spread, abs(offset[j, c]))
            row = matrix[j * dim + c]
            for k in range(pairs * dim):
                if flat[k] != 0.0:
                    total += row[k] * flat[k]
                    size += abs(row[k] * flat[k])
            answer[j, c] = total
            spread = max(spread, size)
    worst, finite = 0.0, True
    for j in range(pairs):
        pressing = base[j] + max(force[master[j], 0], 0.0)
        trial, most = force[j] - answer[j] / scale[j], spinning[j] * pressing
        if master[j] == j:
            wanted = max(trial[0], 0.0)
        else:
            wanted = min(max(trial[0], -most), most)
        error[j, 0] = force[j, 0] - wanted
        length, bound = np.sqrt((trial[1:] * trial[1:]).sum()), friction[j] * pressing
        share = bound / length if length > bound else 1.0
        error[j, 1:] = force[j, 1:] - share * trial[1:]
        for c in range(dim):
            amount = abs(error[j, c] * scale[j, c])
            finite = finite and np.isfinite(amount)
            worst = max(worst, amount)
    if not finite:
        worst = np.nan
    unit = max(tolerance, _ROUNDING * spread, _TINY)
    return answer, error, worst / unit, _DIGITS * spread / unit


@compiled
def _derivative(law, force, answer):
    """Derivative of the errors by the forces, (pairs dim, pairs dim)."""
    matrix, _, friction, master, spinning, base, scale = law
    pairs, dim = force.shape
    jacobian = np.zeros((pairs * dim, pairs * dim))
    for j in range(pairs):
        first, own = j * dim, master[j]
        pressing = base[j] + max(force[own, 0], 0.0)
        trial, most = force[j] - answer[j] / scale[j], spinning[j] * pressing
        push = own == j
        if (push and trial[0] > 0.0) or (not push and most > 0.0 and abs(trial[0]) <= most):
            jacobian[first] = matrix[first] / scale[j, 0]
        else:
            jacobian[first, first] = 1.0
            if not push:
                jacobian[first, own * dim] -= spinning[j] * np.sign(trial[0])
        length, bound = np.sqrt((trial[1:] * trial[1:]).sum()), friction[j] * pressing
        if length <= bound and bound > 0.0:
            for c in range(1, dim):
                jacobian[first + c] = matrix[first + c] / scale[j, c]
            continue
        some = length if length > 0.0 else 1.0
        for c in range(1, dim):
            along = trial[c] / some
            for d in range(1, dim):
                turn = bound / some * ((1.0 if c == d else 0.0) - along * trial[d] / some)
                jacobian[first + c] += turn / scale[j, d] * matrix[first + d]
                jacobian[first + c, first + d] += (1.0 if c == d else 0.0) - turn
            jacobian[first + c, own * dim] -= friction[j] * along
    return jacobian


@compiled
def _solved(matrix, right, dependent):
    """The solution, about the least one where pairs depend on each other, and whether they do.

    Then a little is added to the diagonal, and corrected for; what depends moves by rounding only.
    That is done at once where they are said to be dependent.
    """
    if not dependent:
        fine, factors, order = _factored(matrix, _NEARLY)
        if fine:
            return _substituted(factors, order, right), False
    held = matrix.copy()
    for k in range(len(right)):
        held[k, k] += _HELD
    fine, factors, order = _factored(held, _DEPENDENT)
    found, left, most = np.zeros(len(right)), right, np.abs(right).max()
    for _ in range(_CORRECTED if fine else 0):
        found = found + _substituted(factors, order, left)
        left = right - matrix @ found
        if np.abs(left).max() <= _LEFT * most:
            break
    if fine and np.abs(left).max() <= _ENOUGH * most:
        return found, True
    fine, factors, order = _factored(matrix, _DEPENDENT)
    if fine:
        return _substituted(factors, order, right), False
    return least_solution(matrix, right), True


@compiled
def _factored(matrix, least):
    """Whether rows of a matrix with a diagonal of about 1 are independent, and its factors.

    These are triangular ones below and above the diagonal, and the order of their rows. Pivots are
    zero up to some least one.
    """
    left, count = matrix.copy(), len(matrix)
    order = np.arange(count)
    for k in range(count):
        best = k
        for i in range(k + 1, count):
            if abs(left[i, k]) > abs(left[best, k]):
                best = i
        if not abs(left[best, k]) > least:
            return False, left, order
        if best != k:
            for j in range(count):
                left[k, j], left[best, j] = left[best, j], left[k, j]
            order[k], order[best] = order[best], order[k]
        _take_off(left, k)
    return True, left, order


@compiled
def _take_off(left, k):
    """Take multiples of row k off all rows below, in place, and keep their numbers in column k."""
    for i in range(k + 1, len(left)):
        share = left[i, k] / left[k, k]
        left[i, k] = share
        if share != 0.0:
            for j in range(k + 1, len(left)):
                left[i, j] -= share * left[k, j]


@compiled
def _substituted(factors, order, right):
    """The solution by `_factored`."""
    found, count = right[order], len(right)
    for i in range(1, count):
        total = found[i]
        for k in range(i):
            total -= factors[i, k] * found[k]
        found[i] = total
    for k in range(count - 1, -1, -1):
        total = found[k]
        for j in range(k + 1, count):
            total -= factors[k, j] * found[j]
        found[k] = total / factors[k, k]
    return found


@compiled
def least_solution(matrix, right):
    """The solution of least length where rows of a square matrix depend on each other.

    Elimination with complete pivots shows the rank; what moves nothing is taken off the solution.
    """
    found, left = right.copy(), matrix.copy()
    count, rank = len(right), 0
    order = np.arange(count)
    for k in range(count):
        largest, row, column = 0.0, k, k
        for i in range(k, count):
            for j in range(k, count):
                if abs(left[i, j]) > largest:
                    largest, row, column = abs(left[i, j]), i, j
        if not largest > _DEPENDENT:
            break
        rank = k + 1
        for j in range(count):
            left[k, j], left[row, j] = left[row, j], left[k, j]
        found[k], found[row] = found[row], found[k]
        for i in range(count):
            left[i, k], left[i, column] = left[i, column], left[i, k]
        order[k], order[column] = order[column], order[k]
        _take_off(left, k)
        for i in range(k + 1, count):
            found[i] -= left[i, k] * found[k]
    free = count - rank
    basis = np.zeros((free + 1, count))  # what moves nothing, and a solution
    for f in range(free):
        basis[f, rank + f] = 1.0
    basis[free, :rank] = found[:rank]
    for f in range(free + 1):
        for k in range(rank - 1, -1, -1):
            total = basis[f, k]
            for j in range(k + 1, rank):
                total -= left[k, j] * basis[f, j]
            if f < free:
                total -= left[k, rank + f]
            basis[f, k] = total / left[k, k]
    null, some = basis[:free], basis[free].copy()
    _, factors, rows = _factored(null @ null.T, _DEPENDENT)
    share = _substituted(factors, rows, null @ some)
    least = some - share @ null
    solution = np.empty(count)
    solution[order] = least
    return solution


@compiled
def in_cones(ways, least, bounds, slack, most):
    """The forces next to 0 that do as some do and lie in their cones, by Dykstra's projections.

    Args:
        ways: What motions tell of the forces: orthonormal combinations of them, (pairs dim, ways).
        least: The least forces that do so, (pairs, dim).
        bounds: Largest tangential forces over normal ones, (pairs,).
        slack: Share of these by which they may miss it: the last step takes for ever.
        most: Limit of projections.

    Returns:
        Whether they were found, and the last ones.

    What projections lead apart tends to a combination y of the ways that parts the cones from all
    forces that do as some do: y . x >= 0 of every x in them, y . least < 0. Then there are none.
    """
    pairs, dim = least.shape
    force, beyond, largest = least.copy(), np.zeros((pairs, dim)), np.abs(least).max()
    for _ in range(most):
        inside, near = True, force + beyond
        for j in range(pairs):
            rub = np.sqrt((force[j, 1:] * force[j, 1:]).sum())
            inside = (
                inside and force[j, 0] >= 0.0 and rub <= (1.0 + slack) * bounds[j] * force[j, 0]
            )
            push, mu = near[j, 0], bounds[j]
            rub = np.sqrt((near[j, 1:] * near[j, 1:]).sum())
            if rub > mu * push:  # on the cone, or at its tip
                along = max(0.0, (push + mu * rub) / (1.0 + mu * mu))
                near[j, 0] = along
                near[j, 1:] *= mu * along / rub if rub > 0.0 else 0.0
        if inside:
            return True, force
        beyond += force - near
        flat = (near - least).reshape(-1)
        off = (ways @ (ways.T @ flat)).reshape(pairs, dim)
        force, far = near - off, np.abs(off).max()
        parts = far > slack * largest and (off * least).sum() < -0.5 * (off * off).sum()
        for j in range(pairs):
            rub = np.sqrt((off[j, 1:] * off[j, 1:]).sum())
            parts = parts and off[j, 0] >= bounds[j] * rub - _PARTED * far
        if parts:
            break
    return False, force


@compiled
def stuck_forces(matrix, offset, friction, scale, shares, most):
    """The least forces with which nothing slips; see `impactfem.contact.friction_solutions.stuck`.

    Args:
        matrix, offset, friction, scale: As of `newton_cones`.
        shares: Of the largest eigenvalue that counts as none, of the largest force that is
            rounding, and how far within the cones forces are looked for.
        most: Limit of projections.

    Returns:
        Whether they were found, and the forces, (pairs, dim).
    """
    pairs, dim = offset.shape
    rank, rounding, within = shares
    size = (1.0 / np.sqrt(np.maximum(scale, _TINY))).reshape(-1)
    alike, right = np.empty_like(matrix), -(size * offset.copy().reshape(-1))
    for i in range(len(size)):
        for k in range(len(size)):
            alike[i, k] = matrix[i, k] * (size[i] * size[k])
    shut = np.ones(pairs, dtype=np.bool_)
    found = np.zeros((pairs, dim))
    while shut.any():
        chosen = np.flatnonzero(shut)
        at = (dim * chosen.reshape(-1, 1) + np.arange(dim)).reshape(-1)
        part, bounds = np.empty((len(at), len(at))), np.empty(len(chosen))
        for i in range(len(at)):
            for k in range(len(at)):
                part[i, k] = alike[at[i], at[k]]
        for j in range(len(chosen)):
            first = dim * chosen[j]
            bounds[j] = (1.0 - within) * friction[chosen[j]] * size[first] / size[first + dim - 1]
        own, every = np.linalg.eigh(part)
        counts = own > rank * own[-1]
        if shut.all() and counts.all():
            break
        ways = np.ascontiguousarray(every[:, counts])
        force = (ways @ ((ways.T @ right[at]) / own[counts])).reshape(-1, dim)
        fine, held = in_cones(ways, force, bounds, 0.5 * within, most)
        if fine:
            for j in range(len(chosen)):
                for c in range(dim):
                    found[chosen[j], c] = size[dim * chosen[j] + c] * held[j, c]
            return True, found
        least, pulls = -rounding * np.abs(force).max(), False
        for j in range(len(chosen)):
            if force[j, 0] < least:
                shut[chosen[j]], pulls = False, True
        if not pulls:
            break
    return False, found


@compiled
def few_cones(matrix, offset, friction, base, start, tolerance, limit, shares, most):
    """Forces of few pairs without moments, island by island, by Newton's steps alone.

    Args:
        matrix, offset, friction, base, start, tolerance, limit: As of `newton_cones`.
        shares: As of `stuck_forces`, and of the largest answer below which nothing yields.
        most: See there.

    Returns:
        Whether they were found, the forces (pairs, dim), and linear systems solved.
    """
    pairs, dim = start.shape
    rank, rounding, within, held = shares
    force, total, scale = np.zeros((pairs, dim)), 0, np.empty((pairs, dim))
    largest = 0.0
    for j in range(pairs):
        across = 0.0
        for c in range(dim):
            own = matrix[j * dim + c, j * dim + c]
            largest = max(largest, own)
            across += own if c else 0.0
        scale[j] = across / (dim - 1)
        scale[j, 0] = matrix[j * dim, j * dim]
    for k in range(pairs * dim):
        if matrix[k, k] <= held * largest:
            return False, force, total
    island = islands_of(matrix, np.arange(pairs), dim)
    for number in range(pairs):
        chosen = np.flatnonzero(island == number)
        count = len(chosen)
        if not count:
            break
        at = (dim * chosen.reshape(-1, 1) + np.arange(dim)).reshape(-1)
        part = np.empty((count * dim, count * dim))
        for i in range(count * dim):
            for k in range(count * dim):
                part[i, k] = matrix[at[i], at[k]]
        own, none, near = np.arange(count), np.zeros(count), start[chosen]
        law = part, offset[chosen], friction[chosen], own, none, base[chosen], scale[chosen]
        if count > 1 and not law[5].any():
            fine, found = stuck_forces(part, law[1], law[2], law[6], (rank, rounding, within), most)
            if fine:
                near = found
        found, missed, systems = newton_cones(*law, near, tolerance, limit)
        if missed > 1.0:
            return False, force, total
        force[chosen] = without_traces(part, law[1], own, law[5], found)
        total = max(total, systems)
    return True, force, total
