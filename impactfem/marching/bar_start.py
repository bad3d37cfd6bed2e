"""A bar at rest: what its weight leaves unbalanced, and what forces on its ends do to it.

Unknown are the displacements of the ends that are free; between them, with the weight f per length,

    u(x) = u(0) + (u(L) - u(0)) x / L + f x (L - x) / (2 E A).
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from impactfem.arrays import Floats
from impactfem.marching.few_start import FewAtRest
from impactfem.scene.bodies import Bar
from impactfem.scene.formula import Formula

if TYPE_CHECKING:
    from impactfem.marching.wave_bar import WaveBar


class BarAtRest(FewAtRest):
    """A bar; see `impactfem.marching.resting.Resting`."""

    _march: "WaveBar"  # type: ignore[assignment]

    def __init__(self, march: "WaveBar") -> None:
        """Take it where it is."""
        bar = march.bodies.bar
        self._ends = 1 if bar.far_end == "clamped" else 2
        self._stiff = bar.section * bar.wave_speed**2 / bar.length
        pull = float(march.gravity(0.0, 0.0) @ march.bodies.axis)
        self._weight = bar.section * pull  # per length
        self._moved = march.coordinates.copy()  # ends as they are given
        super().__init__(march)  # type: ignore[arg-type]

    def _here(self, march: "WaveBar") -> Floats:  # type: ignore[override]
        return march.coordinates[: self._ends].copy()

    def _weighed(self) -> tuple[Floats, Floats, Floats]:
        bodies = self._march.bodies
        half = 0.5 * bodies.masses[0] * np.ones((self._ends, 1))
        turns = bodies.dim * (bodies.dim - 1) // 2
        return np.diag(half[:, 0]), half * bodies.axis, np.zeros((self._ends, turns))

    def _jacobian(self, place: Floats) -> Floats:  # noqa: ARG002  (it does not turn)
        return np.asarray(np.kron(np.eye(2), self._march.bodies.axis[:, None])[:, : self._ends])

    def _follows(self) -> bool:
        return False

    def _stiffness(self, place: Floats) -> Floats:  # noqa: ARG002  (it is linear)
        return np.asarray(
            self._stiff * np.array([[1.0, -1.0], [-1.0, 1.0]])[: self._ends, : self._ends]
        )

    def contact(self, place: Floats) -> Floats:
        """Displacements of the ends [m], (2, dim)."""
        return self._march.displaced(self._both(place))

    def residual(self, place: Floats) -> Floats:
        """Loads less internal forces at t = 0, without contact."""
        near, far = self._both(place)
        pulled = self._stiff * (far - near) * np.array([1.0, -1.0])
        return np.asarray(0.5 * self._weight * self._march.bodies.bar.length + pulled)[: self._ends]

    def turned(self, place: Floats) -> Floats:  # noqa: ARG002  (it does not turn)
        """Nothing."""
        dim = self._march.bodies.dim
        return np.zeros(dim * (dim - 1) // 2)

    def settle(self, place: Floats) -> Floats:
        """Begin at a place; mass times the way there [kg m], (dim,)."""
        bodies, bar = self._march.bodies, self._march.bodies.bar
        near, far = self._both(place).tolist()
        bend = -0.5 * self._weight / (self._stiff * bar.length)
        slope = (far - near) / bar.length - bend * bar.length
        way = self._march.put(np.array([near, far]), _bent(bar, slope, bend))
        return np.asarray(bodies.masses[0] * way * bodies.axis)

    def _both(self, place: Floats) -> Floats:
        """Displacements of both ends [m], (2,)."""
        both = self._moved.copy()
        both[: self._ends] = self._q + place
        return both


def _bent(bar: Bar, slope: float, bend: float) -> Bar:
    """The bar with a displacement without what moves it as a whole."""
    text = f"({slope!r})*x + ({bend!r})*x**2"
    return replace(bar, gap=0.0, displacement=Formula(text) if slope or bend else 0.0)
