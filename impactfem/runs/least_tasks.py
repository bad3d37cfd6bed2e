"""Outputs of motors whose tasks miss least, by a cone program that Clarabel solves.

All is solved in coordinates whose inertia is 1, in shares of the largest acceleration asked for:
neither units nor lengths of links decide what is small.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.controllers import Foot
from impactfem.system.tree import import_for_robots

_LEAST = 1e-6  # weight of forces by mass beside the least of tasks: which of many, the least
_FREE = 1e-12  # the same of accelerations, where tasks leave some open
_RANK = 1e-9  # share below which a row of feet says nothing that others do not
_EXACT = 1e-12  # tolerances of the solver
_CLOSES = 1e-8  # what an answer may miss, as a share
_NEAREST = 1e-10  # the same of the cost, which is a square
_NONE = 1e3  # a limit so many times what is asked for is none: it would hide all others
_AT_LIMIT = 1e-6  # share of a limit by which an answer, found from within, stays off it


def import_clarabel() -> Any:
    """Import Clarabel; see `import_for_robots`."""
    return import_for_robots("Clarabel", 'controller: kind = "whole_body"')


@dataclass(frozen=True, kw_only=True)
class Sample:
    """What is to be solved at one sample, for n rates and f feet.

    Attributes:
        inertia: M, (n, n).
        bias: Forces by which rates stay, (n,).
        mass: Of all that moves [kg].
        rows, calm: J of feet, (3 f, n), and what J a is to be, (3 f,).
        tasks, wanted: J of tasks, (tasks, n), and what J a shall be, (tasks,).
        weights: Of their squares, (tasks,).
        motors: Rates that are driven.
        given: Accelerations that are given, by rate.
        limits: Least and largest output, infinite without.
        feet: That stand.
    """

    inertia: Floats
    bias: Floats
    mass: float
    rows: Floats
    calm: Floats
    tasks: Floats
    wanted: Floats
    weights: Floats
    motors: Sequence[int]
    given: Mapping[int, float]
    limits: tuple[float, float]
    feet: Sequence[Foot]

    def outputs(self) -> Floats:
        """Of motors, (motors,); none where nothing fulfils dynamics, feet, limits and cones."""
        n, k, given, motors = len(self.bias), len(self.rows), list(self.given), list(self.motors)
        by, root = 1.0 / np.sqrt(np.diag(self.inertia)), np.sqrt(self.mass)
        tasks, bias = self.tasks * by, by * self.bias
        each = self.weights * np.sum(tasks**2, axis=1)  # a task that nothing moves has none
        top, least = each.max(), each[each > 0.0].min(initial=each.max())
        slope = -(self.weights * self.wanted) @ tasks / (top or 1.0)
        right = np.concatenate([root * self.calm, list(self.given.values()) / by[given]])
        size = float(abs(np.concatenate([bias, slope, right])).max()) or 1.0

        # x: accelerations and forces of feet; force @ x + bias is what joints have to give.
        jacobian = root * self.rows * by
        force = np.hstack([by[:, None] * self.inertia * by, -jacobian.T])
        bias /= size
        stay = np.vstack([jacobian, np.eye(n)[given]])
        left, spans, ways = np.linalg.svd(stay, full_matrices=False)
        says = spans > _RANK * spans.max(initial=0.0)
        stay = np.hstack([spans[says, None] * ways[says], np.zeros((says.sum(), k))])
        passive = np.setdiff1d(np.arange(n), [*motors, *given])
        right = np.concatenate([-bias[passive], left[:, says].T @ right / size])
        # Of full rank, wherever it stands: dynamics and feet hold for all start + free @ y.
        left, spans, ways = np.linalg.svd(np.vstack([force[passive], stay]))
        start, free = ways[: len(spans)].T @ (left.T @ right / spans), ways[len(spans) :].T

        beside = least / top if top else 1.0
        whole = beside * np.diag(np.repeat([_FREE, _LEAST], [n, k]))
        whole[:n, :n] += tasks.T * self.weights @ tasks / (top or 1.0)
        slope = np.concatenate([slope / size, np.zeros(k)])
        rows, ends, cones = self._bounds(force[motors], bias[motors], by[motors] / size)
        y = _minimum(
            (free.T @ whole @ free, free.T @ (whole @ start + slope)),
            (rows @ free, ends - rows @ start), cones,
        )  # fmt: skip
        if y is None:
            return np.zeros(0)
        given_by = force[motors] @ (start + free @ y) + bias[motors]
        found: Floats = given_by * size / by[motors]
        for end in filter(np.isfinite, self.limits):
            found[abs(found - end) <= _AT_LIMIT * abs(end)] = end
        return found

    def _bounds(self, force: Floats, bias: Floats, by: Floats) -> tuple[Floats, Floats, list[Any]]:
        """Limits of outputs (force @ x + bias) / by, and cones: rows, ends, and their kinds."""
        clarabel = import_clarabel()
        blocks, ends, cones = [np.zeros((0, force.shape[1]))], [np.zeros(0)], list[Any]()
        for sign, limit in zip((-1.0, 1.0), self.limits, strict=True):
            end = sign * (by * limit - bias)
            if end.min(initial=_NONE) < _NONE:
                blocks.append(sign * force)
                ends.append(end)
                cones.append(clarabel.NonnegativeConeT(len(end)))
        for k, foot in enumerate(self.feet):  # |f - n (n f)| <= mu n f
            rows = np.zeros((4, force.shape[1]))
            at = slice(len(self.bias) + 3 * k, len(self.bias) + 3 * k + 3)
            rows[0, at] = -foot.friction * foot.up
            rows[1:, at] = np.outer(foot.up, foot.up) - np.eye(3)
            blocks.append(rows)
            ends.append(np.zeros(4))
            cones.append(clarabel.SecondOrderConeT(4))
        return np.concatenate(blocks), np.concatenate(ends), cones


def _minimum(
    cost: tuple[Floats, Floats], bounds: tuple[Floats, Floats], cones: list[Any]
) -> Floats | None:
    """The least y^T P y / 2 + q y with b - G y in cones; None without any."""
    from scipy.sparse import csc_matrix  # noqa: PLC0415  (slow to load)

    (p, q), (g, b), clarabel = cost, bounds, import_clarabel()
    settings = clarabel.DefaultSettings()
    settings.verbose, settings.max_threads = False, 1
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _EXACT
    solver = clarabel.DefaultSolver(csc_matrix(np.triu(p)), q, csc_matrix(g), b, cones, settings)
    answer = solver.solve()
    y, slack, dual = (np.asarray(each) for each in (answer.x, answer.s, answer.z))
    # Its last digits are often out of reach, whatever it calls that: the answer is judged here.
    # Slack and dual are within their cones by its iterates.
    off = abs(g @ y + slack - b).max(initial=0.0) / (1.0 + abs(y).max())
    terms = abs(p) @ abs(y) + abs(q) + abs(g.T) @ abs(dual)
    steep = abs(p @ y + q + g.T @ dual).max() / (terms.max() or 1.0)
    gap = slack @ dual
    return y if max(off, steep) <= _CLOSES and gap <= _NEAREST else None
