"""Both waves of a bar with contact: swept in turn, from reflection to reflection."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats
from impactfem.contact.active_set import ActiveSetResult, primal_dual_active_set
from impactfem.errors import ConvergenceError
from impactfem.mesh.unstructured import Triangulation
from impactfem.scene import Bar, PiecewiseConstant
from impactfem.spacetime import sweep
from impactfem.spacetime.waves import Edges, Field, Wave, wave_equations
from impactfem.system.ends import displacement_scale

_ROUNDING = 1e-15  # relative change of a wave that is not passed on
_AHEAD = 2.25  # a reflection at the wall and one at the far end, and what leaks ahead of them
_SPARE_ROUNDS = 200


@dataclass
class BarWaves:
    """The discrete problem of a bar on a triangulation, and its present solution.

    Attributes:
        field: The discontinuous polynomials.
        arriving: r = V + S, runs towards the wall.
        leaving: q = V - S.
        wall: Edges at x = 0.
        far: Edges at x = L.
        gap: u(0, 0) [m].
        reflection: 1 for a free far end, -1 for a clamped one.
        driven: What a driven far end adds to r at the Gauss points of its edges [m].
        scale: Size of the waves to which tolerances are relative [m].
        gaps: Gap at the end of each wall edge [m].
        multiplier: Mean of S = u_x on each wall edge, dimensionless x [m].
        active: Whether contact is active, shape (edges,).
        rounds: Reflection rounds of the last solution.
    """

    field: Field
    arriving: Wave
    leaving: Wave
    wall: Edges
    far: Edges
    gap: float
    reflection: float
    driven: Floats
    scale: float
    gaps: Floats
    multiplier: Floats
    active: Booleans
    rounds: int = 0

    @classmethod
    def of_bar(
        cls, mesh: Triangulation, degree: int, bar: Bar, gravity: PiecewiseConstant
    ) -> "BarWaves":
        """Assemble the problem of a bar."""
        space, arriving, leaving = wave_equations(mesh, degree, bar, gravity)
        wall = space.edges(1, 0.0, degree + 1)
        edges = len(wall.cells)
        far, transit = space.edges(1, 1.0, degree + 1), bar.transit_time
        return cls(
            field=space,
            arriving=arriving,
            leaving=leaving,
            wall=wall,
            far=far,
            gap=max(float(bar.initial_displacement(x=0.0)), 0.0),
            reflection=-1.0 if bar.far_end == "clamped" else 1.0,
            driven=2.0 * transit * bar.end_speed(transit * far.places),
            scale=displacement_scale(
                bar,
                gravity,
                np.linspace(0.0, bar.length, 101),
                transit * np.concatenate([[0.0], far.places.ravel(), [space.duration]]),
            ),
            gaps=np.empty(edges),
            multiplier=np.zeros(edges),
            active=np.zeros(edges, dtype=bool),
        )

    def solve(self, marks: NDArray[np.int8], tolerance: float) -> None:
        """Solve for given contact states of the wall edges, or decide them on the way.

        Each round sweeps r, reflects it at the wall, sweeps q and reflects it at the far end. Up
        to a small leak ahead of the waves, which decays from round to round, a round moves the
        time up to which everything is final by 2 L/c. Only what changes is recomputed.

        Args:
            marks: 1 active, 0 inactive or `sweep.DECIDE`, shape (edges,).
            tolerance: Rounding level of the gap [m].

        Raises:
            ConvergenceError: The rounds do not end.
        """
        small = _ROUNDING * self.scale
        end = self.field.duration
        horizon = min(_AHEAD, end)
        limit = int(end) + _SPARE_ROUNDS
        for self.rounds in range(1, limit + 1):
            self.arriving.sweep(horizon, small)
            self._reflect(marks, tolerance, small)
            self.leaving.sweep(horizon, small)
            back = self.returned
            changed = self.arriving.feed(self.far, back, small) & (self.far.begin < horizon)
            if changed.any():
                horizon = max(horizon, float(self.far.begin[np.argmax(changed)]) + _AHEAD)
            elif horizon >= end:
                return
            else:
                horizon += 1.0
            horizon = min(horizon, end)
        raise ConvergenceError(
            f"the waves on {len(self.field.first)} triangles do not settle within {limit} "
            "reflections; use more elements along the bar"
        )

    @property
    def returned(self) -> Floats:
        """What comes back from the far end, at the Gauss points of its edges [m]."""
        return self.reflection * self.far.trace(self.leaving.values) + self.driven

    def _reflect(self, marks: NDArray[np.int8], tolerance: float, small: float) -> None:
        """Decide contact from the arriving wave and let its reflection enter at the wall.

        Free: S* = 0 and q = r. Contact: V* closes what is left of the gap within the edge,
        S* = r - V* is the multiplier and q = V* - S*.
        """
        wall = self.wall
        arriving = wall.trace(self.arriving.values)
        total = np.sum(wall.weights * arriving, axis=1)
        speeds = np.empty(len(total))
        sweep.contact(
            total, wall.widths, self.gap, marks, tolerance, self.gaps, speeds, self.active
        )
        self.multiplier = np.where(self.active, total / wall.widths - speeds, 0.0)
        reflected = np.where(self.active[:, None], 2.0 * speeds[:, None] - arriving, arriving)
        self.leaving.feed(wall, reflected, small)

    def gap_at(self, times: Floats) -> Floats:
        """Gap at any dimensionless times [m]: the integral of V* along the wall."""
        wall = self.wall
        edge, share = wall.located(times)
        start = np.concatenate([[self.gap], self.gaps[:-1]])[edge]
        flight = start + wall.partial(wall.trace(self.arriving.values), edge, share)
        return np.asarray(np.where(self.active[edge], start * (1.0 - share), flight))

    def end_work(self, times: Floats) -> Floats:
        """Integral of V S along the far end up to dimensionless times [m^2]."""
        far, arrived = self.far, self.far.trace(self.leaving.values)
        power = 0.25 * (self.returned**2 - arrived**2)
        done = np.concatenate([[0.0], np.cumsum(np.sum(far.weights * power, axis=1))])
        edge, share = far.located(times)
        return done[edge] + far.partial(power, edge, share)

    def decide(self, tolerance: float) -> ActiveSetResult:
        """Decide contact edge by edge as the waves arrive: nothing is left to iterate."""
        marks = np.full(len(self.active), sweep.DECIDE, dtype=np.int8)
        self.solve(marks, tolerance)
        return ActiveSetResult(
            self.active, self.gaps, self.multiplier, 1, (), converged=True,
            message=f"decided edge by edge in {self.rounds} reflection rounds",
        )  # fmt: skip

    def iterate(self, gamma: float, tolerance: float, max_iterations: int) -> ActiveSetResult:
        """One primal-dual active set for all wall edges, from an empty set on."""

        def solve(active: Booleans) -> tuple[Floats, Floats]:
            self.solve(active.astype(np.int8), tolerance)
            return self.gaps.copy(), self.multiplier.copy()

        return primal_dual_active_set(
            solve, len(self.active), gamma=gamma, tolerance=tolerance,
            max_iterations=max_iterations,
        )  # fmt: skip
