"""Inverse kinematics: positions of joints for which a frame of a mechanism is at a place.

With the error e = target - x(q) and J = dx/dq an iterate changes q by

    gradient             a J^T e, with a that makes |e| least along it to first order
    jacobian_transpose   a J^T e, a given
    gauss_newton         J^+ e
    damped               J^T (J J^T + a)^-1 e

and moves what would leave its limits onto them. Source: Buss, Introduction to inverse kinematics
with Jacobian transpose, pseudoinverse and damped least squares methods (2004).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError
from impactfem.scene import Mechanism, Place
from impactfem.scene.values import show
from impactfem.system.link_shapes import named
from impactfem.system.tree import Tree

TOLERANCE = 1e-10  # of the place [m]
_MOST = 20_000
_FACTORS = {"jacobian_transpose": 0.3, "damped": 0.01}
_STILL, _LOOKS = 1e-9, 50  # share by which so many iterates have to come nearer
_NEAREST = 200  # iterates of what looks for the nearest place


@dataclass(frozen=True)
class Found:
    """How a place was looked for.

    Attributes:
        method: Its name; what it did not find, Levenberg's and Marquardt's goes on with.
        iterations: Number of iterates of the first.
        residual: Distance that is left [m].
        q: Coordinates, of the nearest place if there is no solution.
        place: Where the frame then is [m], (3,).
    """

    method: str
    iterations: int
    residual: float
    q: Floats
    place: Floats

    @property
    def solved(self) -> bool:
        """Whether the place was reached."""
        return self.residual <= TOLERANCE

    def check(self, body: Mechanism, tree: Tree) -> None:
        """Refuse a start that was not found.

        Raises:
            ConvergenceError: With the nearest one.
        """
        if self.solved or body.place is None:
            return
        there = ", ".join(f"{value:.6g}" for value in self.place)
        each = (f"{name} = {tree.position(self.q, name):.6g}" for name in tree.single)
        raise ConvergenceError(
            f"{body.name}.place: {body.place.frame} does not reach target = "
            f"{show(list(body.place.target))} by {body.place.method} in {self.iterations} "
            f"iterations: the nearest place that was found is [{there}], {self.residual:.4g} m "
            f"off, with {', '.join(each)}; give that, another method, or joints to begin from"
        )


def place_frame(
    body: Mechanism, place: Place, tree: Tree, start: Floats, held: Sequence[int] = ()
) -> Found:
    """Find joint positions; a free base stays, and so do joints by their rates in `held`.

    Raises:
        KeyedError: There is no such frame.
    """
    if place.frame not in tree.frames():
        raise named(body.kind, "place.frame", place.frame, tree.frames(), "frame")
    target = np.asarray(place.target, dtype=np.float64)
    factor = place.factor or _FACTORS.get(place.method, 0.0)
    step = _STEPS[place.method]
    space = _Space(tree, place.frame, target, held)
    q, count, best = start, 0, (np.inf, start)
    error, jacobian = space.look(q)
    last = np.inf
    while (size := float(np.linalg.norm(error))) > TOLERANCE and count < _MOST:
        best = min(best, (size, q), key=lambda pair: pair[0])
        if count % _LOOKS == 0:
            if best[0] > (1.0 - _STILL) * last:
                break
            last = best[0]
        q = space.moved(q, error, jacobian, partial(step, factor=factor))
        error, jacobian = space.look(q)
        count += 1
    method = place.method
    if size > TOLERANCE:
        (q, size), method = space.nearest(best[1]), f"{method}, then levenberg_marquardt"
    return Found(method, count, size, q, tree.frame(q, place.frame)[0])


def _gradient(error: Floats, jacobian: Floats, factor: float) -> Floats:  # noqa: ARG001
    way = jacobian.T @ error
    moved = jacobian @ way
    square = float(moved @ moved)
    return np.asarray(way * (float(moved @ error) / square if square > 0.0 else 0.0))


_STEPS: Mapping[str, Callable[..., Floats]] = {
    "gradient": _gradient,
    "jacobian_transpose": lambda error, jacobian, factor: factor * jacobian.T @ error,
    "gauss_newton": lambda error, jacobian, factor: np.linalg.lstsq(jacobian, error)[0],  # noqa: ARG005
    "damped": lambda error, jacobian, factor: (
        jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + factor * np.eye(3), error)
    ),
}


class _Space:
    """Joint positions within their limits, and where they put a frame."""

    def __init__(self, tree: Tree, frame: str, target: Floats, held: Sequence[int]) -> None:
        self._tree, self._frame, self._target = tree, frame, target
        self._lower, self._upper = tree.limits()
        self._single = np.zeros(tree.rates, dtype=bool)
        self._single[list(tree.single.values())] = True
        self._single[list(held)] = False

    def look(self, q: Floats) -> tuple[Floats, Floats]:
        """Error (3,) and Jacobian of the joints, (3, v)."""
        place, _, jacobian = self._tree.frame(q, self._frame)
        return self._target - place, jacobian[:3] * self._single

    def moved(
        self, q: Floats, error: Floats, jacobian: Floats, step: Callable[[Floats, Floats], Floats]
    ) -> Floats:
        """The next iterate: what leaves its limits is held, and the others are asked again."""
        position = np.zeros(self._tree.rates)
        for name, at in self._tree.single.items():
            position[at] = self._tree.position(q, name)
        free = self._single.copy()
        for _ in range(self._tree.rates + 1):
            way = np.where(free, step(error, jacobian * free), 0.0)
            low, high = position <= self._lower, position >= self._upper
            out = free & ((low & (way < 0.0)) | (high & (way > 0.0)))
            if not out.any():
                break
            free &= ~out
        found = q.copy()
        for name, at in self._tree.single.items():
            there = min(max(position[at] + way[at], self._lower[at]), self._upper[at])
            self._tree.put(found, name, there)
        return found

    def nearest(self, q: Floats) -> tuple[Floats, float]:
        """Coordinates near some with the least error, by Levenberg's and Marquardt's method."""
        error, jacobian = self.look(q)
        size, damping = float(np.linalg.norm(error)), 1e-3
        for _ in range(_NEAREST):
            step = partial(_STEPS["damped"], factor=damping)
            there = self.moved(q, error, jacobian, step)
            new, its = self.look(there)
            if (left := float(np.linalg.norm(new))) < size:
                q, error, jacobian, size = there, new, its, left
                damping = max(0.3 * damping, 1e-12)
            else:
                damping *= 4.0
            if size <= TOLERANCE or damping > 1e12:
                break
        return q, size
