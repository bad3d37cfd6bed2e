"""Springs and dampers between points and places."""

from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Point, Spring


class SpringForce:
    """One spring with its damper.

    With rest length 0 it is linear in all directions. On a line it is linear too, as long as its
    ends do not pass each other. Else its force k (l - l0) + c l' acts along the line of its ends.

    Args:
        spring: The spring.
        index: Number of the point that has it.
        other: Number of the point at its other end; None for a place.
        points: All points.
    """

    def __init__(
        self, spring: Spring, index: int, other: int | None, points: Sequence[Point]
    ) -> None:
        dim = points[index].dim
        self._spring = spring
        self._own = slice(index * dim, (index + 1) * dim)
        self._other = None if other is None else slice(other * dim, (other + 1) * dim)
        self._anchor = np.asarray(spring.anchor or (0.0,) * dim, dtype=float)
        self.is_linear: bool = spring.rest_length == 0.0 or dim == 1
        away = np.asarray(points[index].position) - (
            self._anchor if other is None else np.asarray(points[other].position)
        )
        # On a line: the place where it is at rest, on the side where the point starts.
        self._rest = spring.rest_length * np.sign(away) if dim == 1 else np.zeros(dim)

    def add_to(self, stiffness: Floats, damping: Floats, load: Floats) -> None:
        """Add a linear spring to K [N/m], C [N s/m] (d, d) and the loads p [N] (d,)."""
        for matrix, value in ((stiffness, self._spring.stiffness), (damping, self._spring.damping)):
            ends = [self._own] if self._other is None else [self._own, self._other]
            for one in ends:
                for two in ends:
                    sign = 1.0 if one == two else -1.0
                    matrix[one, two] += sign * value * np.eye(len(self._rest))
        pull = self._spring.stiffness * self._rest
        if self._other is None:
            load[self._own] += pull + self._spring.stiffness * self._anchor
        else:
            load[self._own] += pull
            load[self._other] -= pull

    def push(self, force: Floats, u: Floats, v: Floats) -> None:
        """Add the force of the spring [N] to (d,)."""
        arm, speed = self._arm(u), v[self._own].copy()
        if self._other is not None:
            speed -= v[self._other]
        if self.is_linear:
            pull = -self._spring.stiffness * (arm - self._rest) - self._spring.damping * speed
        else:
            length = max(float(np.linalg.norm(arm)), np.finfo(float).tiny)
            along = arm / length
            stretch = length - self._spring.rest_length
            size = self._spring.stiffness * stretch + self._spring.damping * float(along @ speed)
            pull = -size * along
        force[self._own] += pull
        if self._other is not None:
            force[self._other] -= pull

    def energy(self, u: Floats) -> float:
        """Elastic energy [J]."""
        arm = self._arm(u)
        if self.is_linear:
            return 0.5 * self._spring.stiffness * float(np.sum((arm - self._rest) ** 2))
        stretch = float(np.linalg.norm(arm)) - self._spring.rest_length
        return 0.5 * self._spring.stiffness * stretch**2

    def _arm(self, u: Floats) -> Floats:
        end = self._anchor if self._other is None else u[self._other]
        arm: Floats = u[self._own] - end
        return arm
