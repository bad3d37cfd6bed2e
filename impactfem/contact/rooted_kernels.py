"""Compiled sweeps for the contact forces of many bodies, by the roots of their answers."""

import numpy as np

from impactfem.compiled import compiled, fused

_ROUNDING = 1e-13  # share of the largest displacement that counts as zero
_CLOSER = 0.3  # by which sweeps go on where changes as small as what is asked were not enough
_SWEEPS, _ASKED = 200, 3000  # at most, and for what is asked
_LOCAL = 2  # alternations between the normal and the tangential force of a contact
_SAME = 1e-3  # share of the change that counts at which they end
_MOMENTUM, _GROWS = 0.9, 1.2  # share of the last step that is added, but where steps grow so much


@compiled
def own_of(ends, columns, values, pairs, dim):
    """Answers R_j R_j^T of pairs to their own forces, (pairs, dim, dim).

    Args:
        ends, columns, values: R as SciPy has sparse rows, columns of a row in rising order.
        pairs: Their number.
        dim: Rows of each.
    """
    found = np.zeros((pairs, dim, dim))
    for j in range(pairs):
        for a in range(dim):
            for b in range(a, dim):
                k, last = ends[j * dim + a], ends[j * dim + a + 1]
                m, end = ends[j * dim + b], ends[j * dim + b + 1]
                total = 0.0
                while k < last and m < end:
                    if columns[k] == columns[m]:
                        total += values[k] * values[m]
                        k += 1
                        m += 1
                    elif columns[k] < columns[m]:
                        k += 1
                    else:
                        m += 1
                found[j, a, b] = found[j, b, a] = total
    return found


@compiled
def islands_among(ends, columns, pairs, dim, size):
    """The island of each pair that moves others, numbered by their first pairs, (pairs,).

    Args:
        ends, columns: R as SciPy has sparse rows; what acts on a body moves all of it.
        pairs: Their number.
        dim: Rows of each.
        size: Number of coordinates.
    """
    above = np.arange(pairs + size)
    for j in range(pairs):
        for k in range(ends[j * dim], ends[(j + 1) * dim]):
            one, two = j, pairs + columns[k]
            while above[one] != one:
                above[one] = above[above[one]]
                one = above[one]
            while above[two] != two:
                above[two] = above[above[two]]
                two = above[two]
            above[max(one, two)] = min(one, two)
    found, number, count = np.empty(pairs, dtype=np.int64), np.full(pairs + size, -1), 0
    for j in range(pairs):
        one = j
        while above[one] != one:
            one = above[one]
        if number[one] < 0:
            number[one] = count
            count += 1
        found[j] = number[one]
    return found


@compiled
def squares_of(ends, values):
    """Sums of the squares of rows, (rows,): the diagonal of R R^T; arguments as of `own_of`."""
    found = np.zeros(len(ends) - 1)
    for i in range(len(ends) - 1):
        for k in range(ends[i], ends[i + 1]):
            found[i] += values[k] * values[k]
    return found


@compiled
def full_of(ends, columns, values, size):
    """R R^T of sparse rows, (rows, rows)."""
    count, spread = len(ends) - 1, np.zeros(size)
    found = np.empty((count, count))
    for i in range(count):
        for k in range(ends[i], ends[i + 1]):
            spread[columns[k]] = values[k]
        for j in range(i + 1):
            total = 0.0
            for k in range(ends[j], ends[j + 1]):
                total += spread[columns[k]] * values[k]
            found[i, j] = found[j, i] = total
        for k in range(ends[i], ends[i + 1]):
            spread[columns[k]] = 0.0
    return found


@compiled
def gathered_roots(ends, columns, values, pairs, dim):
    """R pair by pair: what each moves, and how much by its three components.

    Args:
        ends, columns, values: R as SciPy has sparse rows.
        pairs: Their number.
        dim: Rows of each; in the plane the third component moves nothing.

    Returns:
        Where each pair begins, (pairs + 1,), coordinates, and values, (entries, 3).
    """
    starts = np.zeros(pairs + 1, dtype=np.int64)
    places = np.empty(len(values), dtype=np.int64)
    found = np.zeros((len(values), 3))
    for j in range(pairs):
        first, last = starts[j], starts[j]
        for c in range(dim):
            for k in range(ends[j * dim + c], ends[j * dim + c + 1]):
                m = first + k - ends[j * dim + c]  # where it is if rows of a pair are alike
                if m >= last or places[m] != columns[k]:
                    m = first
                    while m < last and places[m] != columns[k]:
                        m += 1
                    if m == last:
                        places[m] = columns[k]
                        last += 1
                found[m, c] += values[k]
        starts[j + 1] = last
    return starts, places[: starts[pairs]].copy(), found[: starts[pairs]].copy()


@fused
def sweep_roots(
    starts, places, roots, own, offset, friction, base, force, motion, sweeps, share, least
):
    """Block Gauss-Seidel for forces in their cones, A = R R^T: v = R^T x is kept up to date.

    A sweep begins where the one before has come and a share of its step further, within the cones
    (heavy ball): of 400 contacts five to ten times fewer sweeps are needed so. Forces have three
    components, of which the last one is 0 in the plane.

    Args:
        starts, places, roots: See `gathered_roots`.
        own: R_j R_j^T of each pair, (pairs, 3, 3).
        offset: o, (pairs, 3), the normal component first.
        friction, base: See `impactfem.contact.friction_newton.ConeProblem`.
        force: x to begin with, (pairs, 3); changed.
        motion: v, (coordinates,); changed.
        sweeps: Limit.
        share: Ends where no force changes by more than this share of the largest,
        least: or by more than this [N], (pairs,).

    Returns:
        Sweeps made, and whether it has ended.
    """
    pairs = len(offset)
    largest = np.abs(force).max() if pairs else 0.0
    last, before_motion, step, before = force.copy(), motion.copy(), np.inf, 0.0
    # Inverses: of the normal's own answer, and of a bound between the largest eigenvalue of the
    # tangential part and twice that.
    soft = np.empty((pairs, 2))
    for j in range(pairs):
        block = own[j]
        steep = max(abs(block[1, 1]) + abs(block[1, 2]), abs(block[2, 2]) + abs(block[1, 2]))
        soft[j, 0], soft[j, 1] = 1.0 / block[0, 0], 1.0 / steep
    for sweep in range(sweeps):
        settled, size, before, step = True, 0.0, step, 0.0
        for j in range(pairs):
            a, b, c = offset[j, 0], offset[j, 1], offset[j, 2]
            for k in range(starts[j], starts[j + 1]):
                moved = motion[places[k]]
                a += roots[k, 0] * moved
                b += roots[k, 1] * moved
                c += roots[k, 2] * moved
            block, mu, given = own[j], friction[j], base[j]
            first, flat = soft[j, 0], soft[j, 1]
            f, g, h = force[j, 0], force[j, 1], force[j, 2]
            counts = max(share * largest, least[j])
            for _ in range(_LOCAL):
                pushed = max(0.0, f - a * first)
                change = pushed - f
                f = pushed
                a += block[0, 0] * change
                b += block[1, 0] * change
                c += block[2, 0] * change
                bound = mu * (given + f)
                x, y = g - b * flat, h - c * flat
                length = x * x + y * y
                if length > bound * bound:
                    shrink = bound / np.sqrt(length)
                    x *= shrink
                    y *= shrink
                x -= g
                y -= h
                g += x
                h += y
                a += block[0, 1] * x + block[0, 2] * y
                b += block[1, 1] * x + block[1, 2] * y
                c += block[2, 1] * x + block[2, 2] * y
                if max(abs(change), abs(x), abs(y)) <= _SAME * counts:
                    break
            x, y, z = f - force[j, 0], g - force[j, 1], h - force[j, 2]
            force[j, 0], force[j, 1], force[j, 2] = f, g, h
            settled = settled and max(abs(x), abs(y), abs(z)) <= counts
            step += x * x + y * y + z * z
            size = max(size, abs(f), abs(g), abs(h))
            for k in range(starts[j], starts[j + 1]):
                motion[places[k]] += roots[k, 0] * x + roots[k, 1] * y + roots[k, 2] * z
        largest = size
        if settled:
            return sweep + 1, True
        further = _MOMENTUM if step <= _GROWS * _GROWS * before and sweep < sweeps - 1 else 0.0
        if further == 0.0:
            last[:] = force
            before_motion[:] = motion
            continue
        # All go on along their way, and those that leave their cones are put back.
        for k in range(len(motion)):
            moved = motion[k]
            motion[k] += further * (moved - before_motion[k])
            before_motion[k] = moved
        for j in range(pairs):
            f, g, h = force[j, 0], force[j, 1], force[j, 2]
            p = f + further * (f - last[j, 0])
            q, r = g + further * (g - last[j, 1]), h + further * (h - last[j, 2])
            last[j, 0], last[j, 1], last[j, 2] = f, g, h
            f, g, h = max(p, 0.0), q, r
            bound, length = friction[j] * (base[j] + f), g * g + h * h
            if length > bound * bound:
                shrink = bound / np.sqrt(length)
                g *= shrink
                h *= shrink
            force[j, 0], force[j, 1], force[j, 2] = f, g, h
            if f != p or g != q or h != r:
                x, y, z = f - p, g - q, h - r
                for k in range(starts[j], starts[j + 1]):
                    motion[places[k]] += roots[k, 0] * x + roots[k, 1] * y + roots[k, 2] * z
    return sweeps, False


@compiled
def missed_of(gathered, offset, friction, base, scale, force, motion, tolerance):
    """Errors of the law [N], (pairs,), and what of each is rounding [N], (pairs,).

    Args:
        gathered, offset, friction, base, force: As of `sweep_roots`.
        scale: Answers of normal and of tangential forces to themselves [m/N], (pairs, 2).
        motion: v, (coordinates,).
        tolerance: Rounding level of displacements [m].
    """
    starts, places, roots = gathered
    worst, least, spread = np.empty(len(force)), np.empty(len(force)), 0.0
    for j in range(len(force)):
        a, b, c = offset[j, 0], offset[j, 1], offset[j, 2]
        spread = max(spread, abs(a), abs(b), abs(c))
        for k in range(starts[j], starts[j + 1]):
            moved = motion[places[k]]
            a += roots[k, 0] * moved
            b += roots[k, 1] * moved
            c += roots[k, 2] * moved
        f, g, h = force[j, 0], force[j, 1], force[j, 2]
        along, flat = scale[j, 0], scale[j, 1]
        spread = max(spread, abs(a), abs(b), abs(c), abs(along * f), abs(flat * g), abs(flat * h))
        x, y = g - b / flat, h - c / flat
        length, bound = np.sqrt(x * x + y * y), friction[j] * (base[j] + max(f, 0.0))
        share = bound / length if length > bound else 1.0
        normal = f - max(f - a / along, 0.0)
        worst[j] = max(abs(normal), abs(g - share * x), abs(h - share * y))
        least[j] = min(along, flat)
    unit = max(tolerance, _ROUNDING * spread)
    for j in range(len(force)):
        least[j] = unit / least[j]
    return worst, least


@compiled
def motion_of(gathered, force, size):
    """What forces (pairs, 3) move: R^T x, (coordinates,)."""
    starts, places, roots = gathered
    found = np.zeros(size)
    for j in range(len(force)):
        for k in range(starts[j], starts[j + 1]):
            for c in range(3):
                found[places[k]] += roots[k, c] * force[j, c]
    return found


@compiled
def swept_forces(gathered, size, own, offset, friction, base, scale, force, tolerance, asked):
    """Forces by sweeps from some forces, which are changed.

    Args:
        gathered: See `gathered_roots`.
        size: Number of coordinates.
        own, offset, friction, base, force: As of `sweep_roots`.
        scale, tolerance: As of `missed_of`.
        asked: Largest error as a share of the largest force; 0: rounding.

    Returns:
        Of which pairs forces are not found, (pairs,), and the largest error as such a share.
    """
    share, left, none = asked, _ASKED if asked > 0.0 else _SWEEPS, len(force) == 0
    wrong, least = np.zeros(len(force), dtype=np.bool_), np.empty(len(force))
    for j in range(len(force)):
        least[j] = 0.1 * tolerance / min(scale[j, 0], scale[j, 1])
    while True:
        motion = motion_of(gathered, force, size)
        done, settled = sweep_roots(
            *gathered, own, offset, friction, base, force, motion, left, share, least
        )
        left -= done
        motion = motion_of(gathered, force, size)
        law = friction, base, scale, force, motion, tolerance
        worst, rounding = missed_of(gathered, offset, *law)
        largest, any_wrong = 0.0 if none else np.abs(force).max(), False
        for j in range(len(force)):
            wrong[j] = worst[j] > max(asked * largest, rounding[j])
            any_wrong = any_wrong or wrong[j]
        if not any_wrong or left <= 0 or (settled and share == 0.0):
            return wrong, 0.0 if none else worst.max() / (largest if largest > 0.0 else 1.0)
        share *= _CLOSER
