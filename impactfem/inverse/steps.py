"""Parameter values beside those of a run, for differences."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Scene

CENTRAL = (np.array([1.0, -1.0]), np.array([0.5, -0.5]))
FORWARD = (np.array([0.0, 1.0, 2.0]), np.array([-1.5, 2.0, -0.5]))
"""Offsets and weights of differences of second order, in steps."""


class Slopes(NamedTuple):
    """The numbers of a run and their derivatives.

    Attributes:
        numbers: q, (n,).
        jacobian: dq/dp, (n, P).
        doubts: Why there may be no derivatives here, in words.
        margin: Change of the parameters, as a share of their sizes, at which an impact passes a
            time that is looked at: there derivatives jump.
        sides: Derivatives below and above the parameters, (n, P) each, where they differ; the
            jacobian is then their mean.
    """

    numbers: Floats
    jacobian: Floats
    doubts: list[str]
    margin: float = float("inf")
    sides: tuple[Floats, Floats] | None = None

    @classmethod
    def of_sides(cls, numbers: Floats, below: Floats, above: Floats, *, kinked: bool) -> "Slopes":
        """Those on both sides, which are told where they differ, or else their mean alone."""
        mean = 0.5 * (below + above)
        return cls(numbers, mean, [], 0.0, (below, above)) if kinked else cls(numbers, mean, [])


@dataclass(frozen=True)
class Changes:
    """A place and its neighbours.

    Attributes:
        at: Makes the scene of parameter values.
        values: The parameters (P,).
        scales: Their sizes (P,).
        names: As they are shown.
    """

    at: Callable[[Floats], Scene]
    values: Floats
    scales: Floats
    names: tuple[str, ...]

    @cached_property
    def scene(self) -> Scene:
        """The scene itself."""
        return self.at(self.values)

    def some(self, which: NDArray[np.bool_]) -> "Changes":
        """The same place, of which only some parameters may change, (P,)."""

        def at(values: Floats) -> Scene:
            changed = self.values.copy()
            changed[which] = values
            return self.at(changed)

        names = tuple(name for name, kept in zip(self.names, which, strict=True) if kept)
        return Changes(at, self.values[which], self.scales[which], names)

    def moved(self, k: int, offset: float) -> Scene:
        """The scene with one parameter changed."""
        values = self.values.copy()
        values[k] += offset
        return self.at(values)

    def neighbours[T](
        self, k: int, share: float, make: Callable[[Scene], T]
    ) -> tuple[list[T], Floats, Floats]:
        """Neighbours along a parameter, on both sides where there are scenes, else on one.

        Args:
            k: The parameter.
            share: Step, as a share of its size.
            make: Makes what is wanted of a scene; may refuse it.

        Returns:
            What was made, offsets of the parameter, weights of its derivative.

        Raises:
            SceneError: There are scenes on neither side.
        """
        step, refused = share * self.scales[k], None
        for sign, (places, weights) in ((1.0, CENTRAL), (1.0, FORWARD), (-1.0, FORWARD)):
            try:
                made = [make(self.moved(k, sign * step * place)) for place in places]
            except SceneError as error:
                refused = refused or error
                continue
            return made, sign * step * places, weights / (sign * step)
        raise refused or SceneError("parameter: no neighbours")
