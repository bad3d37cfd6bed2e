"""Slender bodies that fall in the plane: the rigid rod and the elastic beam."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from impactfem.scene.body import JOINED, BodyKind, Floats
from impactfem.scene.flight import Flight
from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Choice, Integer, Name, Real
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.values import show

THEORIES = ("euler_bernoulli", "timoshenko")
CONTACTS = ("ends", "along")
SHEAR_CORRECTION = 5.0 / 6.0
"""Share of a rectangular section that carries the shear force (Timoshenko)."""

# Height over length up to which the deflection of a theory is that of the body.
_THICKEST = {"euler_bernoulli": 0.2, "timoshenko": 0.5}
_INCLINATION = "angle of the axis to the x axis, from -pi to pi"


class Slender(BodyKind):
    """What rods and beams have in common: a straight axis in the plane at t = 0."""

    dim: ClassVar[int] = 2
    meets_edges: ClassVar[bool] = True

    length: float
    center: Sequence[float]
    inclination: float
    velocity: Sequence[float]

    def centre_velocity(self) -> Floats:
        """Velocity of its centre at t = 0 [m/s], (2,)."""
        return np.asarray(self.velocity, dtype=np.float64)

    def centreline(self) -> Floats:
        """Both ends of its axis at t = 0 [m], (2, 2)."""
        along = np.array([math.cos(self.inclination), math.sin(self.inclination)])
        return np.asarray(self.center) + 0.5 * self.length * np.array([-along, along])


@table('[[body]] with kind = "rod"')
@dataclass(frozen=True, kw_only=True)
class Rod(Slender):
    """A slender rigid rod that moves in the plane and touches obstacles with its ends.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    kind: ClassVar[str] = "rod"
    dents: ClassVar[bool] = True
    round_ends: ClassVar[bool] = True

    name: str = key(Name(), "name of the rod in histories", default="rod")
    mass: float = key(Real(above=0), "mass", unit="kg")
    length: float = key(Real(above=0), "length between the centres of its ends", unit="m")
    center: Sequence[float] = key(Vector((2,)), "centre at t = 0", unit="m")
    inclination: float = key(Real(), f"{_INCLINATION}, at t = 0", unit="rad", default=0.0)
    velocity: Sequence[float] = key(
        Vector((2,)), "velocity of the centre at t = 0", unit="m/s", default=(0.0, 0.0)
    )
    angular_velocity: float = key(Real(), "rotation at t = 0", unit="rad/s", default=0.0)
    radius: float = key(Real(at_least=0), "radius of the rounded ends", unit="m", default=0.0)

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        _check_angle(self)

    def box(self) -> tuple[Floats, Floats]:
        """Half edges and centre [m] of a box around it in any rotation."""
        return np.full(2, self.length / 2 + self.radius), np.asarray(self.center, dtype=np.float64)

    @property
    def line_thickness(self) -> float:
        """Its diameter [m]."""
        return 2.0 * self.radius

    @property
    def flight(self) -> Flight:
        """How it flies."""
        return Flight((self.length / 2 + self.radius,) * 2, self.center, self.velocity)


@table('[[body]] with kind = "beam"')
@dataclass(frozen=True, kw_only=True)
class Beam(Slender):
    """A free elastic beam of rectangular section that falls in the plane.

    Its axis touches obstacles, with both ends or with all nodes. Displacements and rotations from
    the place at t = 0 are small.

    Raises:
        SceneError: a value is missing or not allowed, the beam is too thick for its theory, or its
            damping is given twice.
    """

    kind: ClassVar[str] = "beam"
    round_ends: ClassVar[bool] = False
    takes_joints: ClassVar[bool] = True

    name: str = key(Name(), "name of the beam in histories", default="beam")
    length: float = key(Real(above=0), "length", unit="m")
    height: float = key(Real(above=0), "height of the section, in the plane", unit="m")
    width: float = key(Real(above=0), "width of the section, across the plane", unit="m")
    density: float = key(Real(above=0), "mass density", unit="kg/m^3")
    youngs_modulus: float = key(Real(above=0), "Young's modulus", unit="Pa")
    poisson_ratio: float = key(
        Real(above=-1, below=0.5),
        "Poisson's ratio, for the shear of a timoshenko beam",
        default=0.3,
    )
    theory: str = key(Choice(THEORIES), "bending without or with shear", default="euler_bernoulli")
    elements: int = key(Integer(1, 1000), "number of elements along the beam", default=16)
    center: Sequence[float] = key(Vector((2,)), "centre at t = 0", unit="m")
    inclination: float = key(Real(), f"{_INCLINATION}, at t = 0", unit="rad", default=0.0)
    velocity: Sequence[float] = key(
        Vector((2,)), "velocity of the centre at t = 0", unit="m/s", default=(0.0, 0.0)
    )
    angular_velocity: float = key(Real(), "rotation at t = 0", unit="rad/s", default=0.0)
    contact: str = key(Choice(CONTACTS), "what of the axis may touch", default="ends")
    damping_ratio: float | None = key(
        Real(at_least=0, below=1),
        "damping of the first bending mode over the critical one, by C = beta K",
        default=None,
        absent="0",
    )
    rayleigh: Sequence[float] | None = key(
        Vector((2,)),
        "alpha [1/s] and beta [s] of the damping C = alpha M + beta K; alpha brakes the fall too",
        default=None,
        absent="0",
    )

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        _check_angle(self)
        self._check_slenderness()
        self._check_damping()
        self._check_scales()

    def box(self) -> tuple[Floats, Floats]:
        """Half edges and centre [m] of a box around its axis in any rotation."""
        return np.full(2, self.length / 2), np.asarray(self.center, dtype=np.float64)

    def missed(self, place: Floats) -> str | None:
        """Joints hold a section along its axis, within its height."""
        along = np.array([math.cos(self.inclination), math.sin(self.inclination)])
        away = place - np.asarray(self.center)
        far = abs(away @ along) > 0.5 * self.length * (1.0 + JOINED)
        off = abs(away @ [-along[1], along[0]]) > 0.5 * self.height * (1.0 + JOINED)
        ends = " to ".join(show([round(x, 12) for x in end]) for end in self.centreline().tolist())
        return f"from {ends}, within half its height" if far or off else None

    @property
    def dents(self) -> bool:  # type: ignore[override]
        """Whether its contacts may have a stiffness: not where all of it may lie on something."""
        return self.contact == CONTACTS[0]

    @property
    def line_thickness(self) -> float:
        """Its height [m]."""
        return self.height

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if damping brakes its fall."""
        if self.rayleigh_damping[0]:
            return None
        return Flight((self.length / 2,) * 2, self.center, self.velocity)

    @property
    def area(self) -> float:
        """Area of the section [m^2]."""
        return self.height * self.width

    @property
    def second_moment(self) -> float:
        """Second moment of area I = width height^3 / 12 [m^4]."""
        return self.width * self.height**3 / 12.0

    @property
    def mass(self) -> float:
        """Mass rho A L [kg]."""
        return self.density * self.area * self.length

    @property
    def shear_stiffness(self) -> float:
        """Kappa G A with kappa = 5/6 [N]."""
        shear_modulus = 0.5 * self.youngs_modulus / (1.0 + self.poisson_ratio)
        return SHEAR_CORRECTION * shear_modulus * self.area

    @property
    def first_frequency(self) -> float:
        """First free-free angular frequency of the Euler-Bernoulli beam [rad/s]."""
        stiffness = self.youngs_modulus * self.second_moment / (self.density * self.area)
        return (4.730040744862704 / self.length) ** 2 * math.sqrt(stiffness)

    @property
    def rayleigh_damping(self) -> tuple[float, float]:
        """(alpha [1/s], beta [s]) of C = alpha M + beta K."""
        if self.rayleigh is not None:
            return self.rayleigh[0], self.rayleigh[1]
        return 0.0, 2.0 * (self.damping_ratio or 0.0) / self.first_frequency

    def _check_slenderness(self) -> None:
        limit, slope = _THICKEST[self.theory], self.height / self.length
        if slope > limit:
            other = 'choose theory = "timoshenko" (up to 1/2), or ' * (limit < slope <= 0.5)
            raise KeyedError(
                self.kind,
                "height",
                f" = {self.height:g} is {slope:.3g} of the length = {self.length:g}, too thick for "
                f'theory = "{self.theory}" (at most {limit:g}): {other}model it as a solid.',
            )

    def _check_damping(self) -> None:
        if self.rayleigh is None:
            return
        if self.damping_ratio is not None:
            text = f" = {show(list(self.rayleigh))} contradicts damping_ratio: remove one of them."
            raise KeyedError(self.kind, "rayleigh", text)
        if min(self.rayleigh) < 0:
            text = f" = {show(list(self.rayleigh))} feeds energy: give numbers >= 0."
            raise KeyedError(self.kind, "rayleigh", text)

    def _check_scales(self) -> None:
        """Refuse values, each fine alone, whose products overflow or vanish."""
        ratio = self.youngs_modulus / self.density
        if not (0 < self.mass < math.inf and self.second_moment > 0 and 0 < ratio < math.inf):
            text = f" = {show(self.youngs_modulus)} with the density and sizes gives no usable beam"
            raise KeyedError(self.kind, "youngs_modulus", f"{text}: give SI units.")
        if not 0 < self.first_frequency < math.inf:
            text = f" = {show(self.length)} gives the frequency {self.first_frequency}"
            raise KeyedError(self.kind, "length", f"{text}: give SI units.")


def _check_angle(body: Rod | Beam) -> None:
    """Refuse degrees."""
    if abs(body.inclination) > math.pi + 1e-12:
        text = f" = {show(body.inclination)} is not between -pi and pi: give radians"
        degrees = f" ({math.radians(body.inclination):.6g} if degrees were meant)"
        raise KeyedError(body.kind, "inclination", f"{text}{degrees}.")
