"""Bodies of a scene: the elastic bar."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from impactfem.scene.formula import Formula
from impactfem.scene.kinds import Choice, FormulaOf, Name, Real, show
from impactfem.scene.schema import KeyFault, check_fields, key, table

# Divisible by 2 to 10 and 12: a formula with a pole at a simple fraction of the length is found out.
SAMPLES = 5040


@table('[[body]], kind = "bar"')
@dataclass(frozen=True, kw_only=True)
class Bar:
    """A straight elastic bar that moves along its axis and meets the wall with its near end.

    Material points x in [0, L] are measured from the near end; the displacement u(t, x) is measured from the
    wall: u(0, x) = gap + displacement(x), and contact means u(t, 0) = 0. Velocities towards the wall are negative.
    Numbers given for `velocity` and `displacement` are stored as Formula.

    Raises:
        SceneError: a value is missing or not allowed, or the bar would start inside the wall or inside out.
    """

    kind: ClassVar[str] = "bar"

    name: str = key(Name(), "name of the bar in histories", default="bar")
    length: float = key(Real(above=0), "length L of the bar", unit="m")
    density: float = key(Real(above=0), "mass density", unit="kg/m^3")
    youngs_modulus: float = key(Real(above=0), "Young's modulus", unit="Pa")
    area: float = key(Real(above=0), "area of the cross-section", unit="m^2", default=1.0)
    far_end: str = key(
        Choice(("free", "clamped")), "the end away from the wall is free or held", default="free"
    )
    gap: float = key(
        Real(at_least=0), "distance of the near end from the wall at t = 0", unit="m", default=0.0
    )
    velocity: Formula = key(
        FormulaOf(("x",)), "velocity at t = 0, negative towards the wall", unit="m/s", default=0.0
    )
    displacement: Formula = key(
        FormulaOf(("x",)), "displacement at t = 0, added to the gap", unit="m", default=0.0
    )

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        self._check_derived()
        self._check_initial_state()

    @property
    def wave_speed(self) -> float:
        """Speed of elastic waves c = sqrt(E / rho) [m/s]."""
        return math.sqrt(self.youngs_modulus / self.density)

    @property
    def transit_time(self) -> float:
        """Time L / c that a wave needs from one end to the other [s]."""
        return self.length / self.wave_speed

    @property
    def mass(self) -> float:
        """Mass rho A L [kg]."""
        return self.density * self.area * self.length

    @property
    def initial_displacement(self) -> Formula:
        """u(0, x) = gap + displacement(x) [m]."""
        return self.displacement.plus(self.gap)

    @property
    def initial_velocity(self) -> Formula:
        """u_t(0, x) [m/s]."""
        return self.velocity

    def _check_derived(self) -> None:
        ratio = self.youngs_modulus / self.density
        if not (math.isfinite(ratio) and ratio > 0 and 0 < self.transit_time < math.inf):
            raise KeyFault(
                self.kind,
                "youngs_modulus",
                f" = {self.youngs_modulus} with density = {self.density} and length = {self.length} gives no usable "
                "wave speed sqrt(E / rho): give values in SI units.",
            )
        if not 0 < self.mass < math.inf:
            raise KeyFault(
                self.kind,
                "area",
                f" = {self.area} with density = {self.density} and length = {self.length} gives the mass "
                f"{self.mass}: give values in SI units.",
            )

    def _check_initial_state(self) -> None:
        x = np.linspace(0.0, self.length, SAMPLES + 1)
        for name in ("velocity", "displacement"):
            formula: Formula = getattr(self, name)
            values = formula(x=x)
            bad = np.flatnonzero(~np.isfinite(values))
            if bad.size:
                raise KeyFault(
                    self.kind,
                    name,
                    f" = {show(formula)} has no finite value ({values[bad[0]]}) at x = {x[bad[0]]:.6g}: "
                    f"change the formula so that it is finite on 0 <= x <= {self.length:g}.",
                )
        u = self.displacement(x=x)
        if self.gap + u[0] < 0:
            raise KeyFault(
                self.kind,
                "displacement",
                f" = {show(self.displacement)} puts the near end inside the wall: gap + displacement(0) = "
                f"{self.gap + u[0]:.6g} < 0; increase gap = {self.gap:g} by at least {-(self.gap + u[0]):.6g}.",
            )
        with np.errstate(over="ignore", invalid="ignore"):
            strain = np.diff(u) / np.diff(x)
        worst = int(np.argmin(strain))
        if not strain[worst] > -1:
            raise KeyFault(
                self.kind,
                "displacement",
                f" = {show(self.displacement)} turns the bar inside out: its strain is {strain[worst]:.6g} near "
                f"x = {x[worst]:.6g}, it must be > -1; reduce the displacement or smooth its jumps.",
            )
