"""What a run says of contact forces that the equations of motion do not determine."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain, combinations
from typing import Any

import numpy as np
from scipy.optimize import linprog

from impactfem.arrays import Floats, Integers
from impactfem.contact.friction_kernels import sweep_cones
from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solutions import MOST_PAIRS, all_solutions, dependent, jams
from impactfem.contact.rooted import full
from impactfem.findings import Finding

_MOST = 60  # pairs up to which dependent forces are looked for
_TAKEN = ("the contact opens", "an impulse that ends the slip", "slip under the larger force")
_NUMBERS = 13
_PAIRS_OF = 12  # pushing pairs up to which normal forces are taken from two at once, not from one
_MOVED, _SWEEPS = 1e-6, 2000  # share of the velocities that is a change; sweeps that look for it
_RANK = 1e-9  # as of `impactfem.contact.friction_solutions`
_NARROW = 1e-6  # of a force, between whose limits it counts as determined


class Determinacy:
    """Looks at the contact problems of layers; see `impactfem.contact.friction_solutions`.

    Attributes:
        seen: What it has found as numbers: dimension of the dependent forces, time, pair, its
            force and the limits between which it may lie, contacts that push; layers in which
            friction jams, time, pair, solutions, and which of `_TAKEN` was taken; whether other
            shares of normal forces let something slip.
    """

    def __init__(self) -> None:
        """Begin without findings."""
        self.seen: Floats = np.zeros(_NUMBERS)
        self._pattern: bytes = b""

    def look(
        self,
        time: float,
        rows: Integers,
        pair_of: Callable[[], Integers],
        problem: ConeProblem,
        force: Floats,
        slip: Floats | None = None,
    ) -> None:
        """Look at a layer.

        Args:
            time: Its end [s].
            rows: Numbers of the gaps.
            pair_of: Tells which pair of the scene each gap is of now.
            problem: Their law, in velocities.
            force: What was found, (pairs, dim).
            slip: Velocities along the tangents at its start, (pairs, dim - 1); None: no friction.
        """
        if slip is not None:
            self._look_at_friction(time, rows, pair_of, problem, force, slip)
        pushes = force[:, 0] > 0.0
        if not 1 < int(pushes.sum()) <= _MOST:
            return
        held = np.linalg.norm(force[:, 1:], axis=1) < problem.friction * force[:, 0] * (1 - 1e-9)
        pattern = rows.tobytes() + pushes.tobytes() + held.tobytes()
        if pattern == self._pattern:
            return
        self._pattern = pattern
        basis = dependent(problem, force)
        if basis.shape[1] > self.seen[0]:
            most, low, high = _limits(problem, force, basis)
            own = force[most, 0]
            pair, count = pair_of()[rows[most]], pushes.sum()
            self.seen[:7] = basis.shape[1], time, pair, own, low, high, count
            self.seen[12] = max(self.seen[12], float(_hangs_on_shares(problem, force)))

    def look_at_normal(
        self, time: float, rows: Integers, pair_of: Callable[[], Integers], response: Floats,
        force: Floats,
    ) -> None:  # fmt: skip
        """Look at a layer without friction, by its answers [m/N], (pairs, pairs)."""
        count = len(rows)
        matrix = np.zeros((count, 2, count, 2))
        matrix[:, 0, :, 0] = response
        matrix[np.arange(count), 1, np.arange(count), 1] = np.diag(response)
        none, flat = np.zeros(count), matrix.reshape(2 * count, 2 * count)
        problem = ConeProblem(flat, np.zeros((count, 2)), none, none)
        self.look(time, rows, pair_of, problem, np.column_stack([force, none]))

    def _look_at_friction(
        self, time: float, rows: Integers, pair_of: Callable[[], Integers], problem: ConeProblem,
        force: Floats, slip: Floats,
    ) -> None:  # fmt: skip
        bad = np.flatnonzero(jams(problem.matrix, problem.friction, slip))
        count, at = 0, -1
        if len(bad):
            at = int(bad[0])
            count = 0 if problem.offset[at, 0] < 0.0 else 2
        elif len(rows) <= MOST_PAIRS and force.shape[1] == 2 and _may_jam(problem):
            found = len(all_solutions(problem))
            at, count = (int(np.argmax(force[:, 0])), found) if found > 1 else (-1, 1)
        if at < 0:
            return
        pushed = force[at, 0] > 0.0
        answer = problem.answers(force)[at]
        ended = np.abs(answer[1:]).max() <= 1e-6 * max(np.abs(problem.offset).max(), 1e-300)
        taken = 0 if not pushed else 1 if ended else 2
        self.seen[7] += 1
        if self.seen[7] == 1:
            self.seen[8:12] = time, pair_of()[rows[at]], count, taken

    def figures(self, names: Sequence[str]) -> Mapping[str, Any]:
        """What it has found, for the details of a run.

        Args:
            names: Of the pairs of the scene.
        """
        found: dict[str, Any] = {}
        if self.seen[0]:
            dimension, time, gap, force, low, high, contacts = self.seen[:7].tolist()
            found["overconstrained"] = {
                "dimension": int(dimension), "time": time, "contacts": int(contacts),
                "pair": names[int(gap)], "normal_force": force, "limits": [low, high],
                "motion_determined": not self.seen[12],
            }  # fmt: skip
        if self.seen[7]:
            layers, time, gap, solutions, taken = self.seen[7:12].tolist()
            found["friction_nonunique"] = {
                "solutions": int(solutions), "taken": _TAKEN[int(taken)], "time": time,
                "pair": names[int(gap)], "layers": int(layers),
            }  # fmt: skip
        return found

    def findings(self, names: Sequence[str]) -> tuple[Finding, ...]:
        """The same in words."""
        found, known = [], self.figures(names)
        if told := known.get("overconstrained"):
            low, high = told["limits"]
            which = "their friction, not normal forces (to 1e-6 of these)"
            if high - low > _NARROW * high:
                which = f"a normal force of {told['normal_force']:.6g} N of {told['pair']} may be "
                which += f"any from {low:.6g} to {high:.6g} N"
            text = (
                f"forces of {told['contacts']} contacts are not determined by the motion from t = "
                f"{told['time']:.6g} s on, in {told['dimension']} dimensions: {which}; "
            )
            if told["motion_determined"]:
                text += (
                    "motions are determined, and so are sum and moment of the forces on each body"
                )
                remedy = "compare sums of forces only"
            else:
                text += "other shares of them let something slip; taken were those with which as "
                text += "little as can be slips, the least"
                remedy = "model what carries the shares as elastic if they matter"
            found.append(
                Finding(
                    "overconstrained", "note", text, told["pair"], float(told["dimension"]),
                    remedy=remedy,
                )
            )  # fmt: skip
        if told := known.get("friction_nonunique"):
            number = told["solutions"]
            how = f"allows {number} forces" if number else "allows no bounded force"
            text = (
                f"friction jams {told['pair']} at t = {told['time']:.6g} s (Painleve): it {how}; "
                f"taken was: {told['taken']}; so in {told['layers']} time steps"
            )
            remedy = "use a smaller friction_coefficient, or model the body as elastic"
            found.append(
                Finding(
                    "friction_nonunique", "warning", text, told["pair"], float(number),
                    remedy=remedy,
                )
            )  # fmt: skip
        return tuple(found)


def _may_jam(problem: ConeProblem) -> bool:
    """Whether friction of some contact can act as much along its normal as its pressure does."""
    own = problem.own()
    return bool((problem.friction * np.linalg.norm(own[:, 0, 1:], axis=1) >= own[:, 0, 0]).any())


def _hangs_on_shares(problem: ConeProblem, force: Floats) -> bool:
    """Whether normal forces that press alike, shared otherwise, let something slip that does not.

    Friction is found again with the bounds of normal forces as small in single pairs, and in two of
    few, as those that press the bodies alike can be.
    """
    dim = force.shape[1]
    at = np.flatnonzero(force[:, 0] > 0.0)
    if not problem.pushes.all() or not problem.friction[at].any():
        return False
    matrix = np.ascontiguousarray(full(problem.matrix))
    own, ways = np.linalg.eigh(matrix[np.ix_(at * dim, at * dim)])
    free = ways[:, own <= _RANK * own[-1]]
    if not free.shape[1]:
        return False
    whole, answer = float(force[at, 0].max()), problem.answers(force)
    law = problem.friction, problem.masters, problem.spins, problem.base
    size = np.abs(problem.offset).max() + np.abs(answer).max()
    most = 2 if len(at) <= _PAIRS_OF else 1
    for some in chain.from_iterable(combinations(range(len(at)), k + 1) for k in range(most)):
        taken = free[list(some)].sum(axis=0)
        if not np.abs(taken).max() > _RANK:
            continue
        found = linprog(taken, -free, force[at, 0] / whole, bounds=(None, None))
        if found.status:
            continue
        bound, moved = np.zeros(len(force)), force.copy()
        bound[at] = np.maximum(force[at, 0] + whole * (free @ found.x), 0.0)
        sweep_cones(matrix, problem.offset, *law, bound, moved, False, _SWEEPS, 1e-12 * whole)
        if np.abs(problem.answers(moved) - answer).max() > _MOVED * size:
            return True
    return False


def _limits(problem: ConeProblem, force: Floats, basis: Floats) -> tuple[int, float, float]:
    """The pair whose normal force is the least determined, and between what it may lie [N].

    Forces stay in their cones, in space in squares within: the limits can be reached.
    """
    pairs, dim = force.shape
    largest = float(np.abs(force).max())
    changes = basis.reshape(pairs, dim, -1)
    most = int(np.argmax(np.linalg.norm(changes[:, 0], axis=1)))
    root = np.sqrt(dim - 1)
    rows, room = [-changes[:, 0]], [force[:, 0]]
    for k in range(1, dim):
        for sign in (1.0, -1.0):
            rows.append(sign * root * changes[:, k] - problem.friction[:, None] * changes[:, 0])
            inside = problem.friction * force[:, 0] - sign * root * force[:, k]
            room.append(np.maximum(inside, 0.0))
    low, high = force[most, 0], force[most, 0]
    for sign in (1.0, -1.0):
        found = linprog(
            sign * changes[most, 0], np.vstack(rows), np.concatenate(room) / largest,
            bounds=(None, None),
        )  # fmt: skip
        if found.status == 0:
            end = force[most, 0] + largest * sign * found.fun
            low, high = min(low, end), max(high, end)
        else:
            low, high = (low, np.inf) if sign < 0.0 else (0.0, high)
    return most, float(low), float(high)
