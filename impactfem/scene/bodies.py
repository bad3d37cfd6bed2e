"""Bodies of a scene: the elastic bar."""

import math
import sys
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from typing import ClassVar, override

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, Solver, beside
from impactfem.scene.breaks import Break, find_breaks
from impactfem.scene.formula import Formula
from impactfem.scene.given import AFormula, Given
from impactfem.scene.inline import Vector
from impactfem.scene.jets import motion_at
from impactfem.scene.kinds import Choice, FormulaOf, Name, Real, RealOrFormula
from impactfem.scene.means import cuts_of
from impactfem.scene.probes import STRAINS
from impactfem.scene.profile import Profile
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import LEAST, show

# Divisible by 2 to 10: a formula with a pole at a simple fraction of the length is found out.
SAMPLES = 5040
PROPERTIES = ("density", "youngs_modulus", "area")
"""Keys that may vary along a bar."""


@table('[[body]] with kind = "bar"')
class Bar(BodyKind):
    """A straight elastic bar that moves along its axis and meets the wall with its near end.

    Material points x in [0, L] are measured from the near end, the displacement u(t, x) from the
    wall: u(0, x) = gap + displacement(x), and contact means u(t, 0) = 0. Velocities towards the
    wall are negative. Beside bodies in the plane or in space it lies along `axis` from `point` and
    is guided: it moves along its axis only. Numbers given for `velocity` and `displacement` are
    stored as `Formula`.

    Raises:
        SceneError: a value is missing or not allowed, or the bar starts inside the wall or has a
            strain of -1 or less somewhere.
    """

    kind: ClassVar[str] = "bar"
    solvers: ClassVar[tuple[Solver, Solver]] = ("bar", "bar_row")
    may_meet_nothing: ClassVar[bool] = True
    marches_alone: ClassVar[bool] = False
    round_ends: ClassVar[bool] = False
    dents: ClassVar[bool] = True
    probed: ClassVar[tuple[str, ...]] = STRAINS
    waves: ClassVar[bool] = True
    in_elements: ClassVar[bool] = True
    small_strains: ClassVar[bool] = False  # linear at any strain
    settles: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    meets_alike: ClassVar[bool] = True
    staggers: ClassVar[bool] = False
    settings: ClassVar[tuple[str, ...]] = ("elements",)
    takes_joints: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    joined_by_surface: ClassVar[bool] = True
    parts_in_joints: ClassVar[str] = "far_end"
    whole_side: ClassVar[tuple[str, ...]] = ("",)

    name: str = key(Name(), "name of the bar in histories", default="bar")
    length: float = key(Real(above=0), "length L of the bar", unit="m")
    density: Given[float | Formula, str] = key(RealOrFormula(("x",)), "mass density", unit="kg/m^3")
    youngs_modulus: Given[float | Formula, str] = key(
        RealOrFormula(("x",)), "Young's modulus", unit="Pa"
    )
    area: Given[float | Formula, str] = key(
        RealOrFormula(("x",)), "area of the cross-section", unit="m^2", default=1.0
    )
    far_end: str = key(
        Choice(("free", "clamped")), "whether the end away from the wall is held", default="free"
    )
    gap: float = key(
        Real(at_least=0), "distance of the near end from the wall at t = 0", unit="m", default=0.0
    )
    velocity: AFormula = key(
        FormulaOf(("x",)), "velocity at t = 0, negative towards the wall", unit="m/s", default=0.0
    )
    displacement: AFormula = key(
        FormulaOf(("x",)), "displacement at t = 0, added to the gap", unit="m", default=0.0
    )
    far_end_force: AFormula = key(
        FormulaOf(("t", "v")), "force on the far end along the axis, away from the wall; it may "
        "fall with the velocity v of that end", unit="N", default=0.0,
    )  # fmt: skip
    load: AFormula = key(
        FormulaOf(("t", "x")), "force along the bar per length, away from the wall", unit="N/m",
        default=0.0,
    )  # fmt: skip
    far_end_displacement: AFormula = key(
        FormulaOf(("t",)),
        "motion that the far end is given along the axis, from its place at t = 0; holds it",
        unit="m",
        default=0.0,
    )
    point: Sequence[float] | None = key(
        Vector((2, 3)),
        "beside bodies in the plane or in space: where the near end is without displacement",
        unit="m",
        default=None,
        absent="the bar lies on the x axis, its near end at gap",
    )
    axis: Sequence[float] | None = key(
        Vector((2, 3), nonzero=True),
        "direction from the near end to the far one, of any length; with point",
        default=None,
        absent="the x axis",
    )
    wall_stiffness: float | None = field(default=None, compare=False, repr=False)
    """Of the wall that it meets [N/m], which the scene's contact tells; None: it is rigid."""

    def _check(self) -> None:
        self._check_far_end()
        self._check_place()
        x = np.linspace(0.0, self.length, SAMPLES + 1)
        self._check_profile(x)
        self._check_scales(x)
        self._check_finite("velocity", x)
        self._check_finite("displacement", x)
        self._check_near_end()
        self._check_strain(x)

    @property
    def dim(self) -> int:
        """Number of coordinates of the scenes it is in."""
        return 1 if self.point is None else len(self.point)

    @property
    def surface_names(self) -> tuple[str, ...]:
        """Ends that may meet others besides the near one, which its bare name stands for."""
        return ("far_end",) if self.far_end == "free" else ()

    def missed(self, place: Floats, part: str) -> str | None:
        """Joints hold its ends where they are."""
        own = self.centreline()[-1 if part else 0]
        return f"at {show([round(x, 12) for x in own.tolist()])}" if beside(place, own) else None

    @property
    def frame(self) -> tuple[Floats, Floats]:
        """Place of the near end without displacement [m] and unit vector along it, (dim,) each."""
        if self.point is None or self.axis is None:
            return np.zeros(1), np.ones(1)
        axis = np.asarray(self.axis, dtype=np.float64)
        return np.asarray(self.point, dtype=np.float64), axis / np.linalg.norm(axis)

    @property
    def is_plain(self) -> bool:
        """Whether nothing drives or loads it, and it is the same along itself."""
        return self.is_uniform and not (self.is_loaded or self.is_driven)

    @override
    def check_beside(self, bodies: Sequence[BodyKind]) -> None:
        here = "are other bodies" if len(bodies) > 1 else "is more than that, or none"
        self.check_plain(f"here {here}: {{}}")

    def check_plain(self, remedy: str) -> None:
        """Refuse what only a bar knows that is alone before a wall.

        Args:
            remedy: What to do, with a place for how to do without.

        Raises:
            KeyedError: naming the key.
        """
        for name in ("load", "far_end_force", "far_end_displacement"):
            if getattr(self, name).plain != 0.0:
                why = "drives a bar that is alone before a wall, " + remedy.format("remove it")
                raise self._fail(name, f"{why}.")
        for name in PROPERTIES:
            if not self.is_uniform and isinstance(getattr(self, name), Formula):
                why = "is for a bar that is alone before a wall, " + remedy.format("give a number")
                raise self._fail(name, f"{why}.")

    def centre_velocity(self) -> Floats | None:
        """Velocity at t = 0 [m/s], (dim,); None if it varies along the bar."""
        if not self.velocity.is_constant:
            return None
        return np.asarray(float(self.velocity(x=0.0)) * self.frame[1])

    def centreline(self) -> Floats:
        """Both ends at t = 0 [m], (2, dim)."""
        origin, axis = self.frame
        x = np.array([0.0, self.length])
        places: Floats = origin + (x + self.initial_displacement(x=x))[:, None] * axis
        return places

    @cached_property
    def is_uniform(self) -> bool:
        """Whether density, modulus and area are the same along the bar."""
        return all(self._formula(name).is_constant for name in PROPERTIES)

    @property
    def is_loaded(self) -> bool:
        """Whether a load acts along it."""
        return bool(self.load.plain != 0.0)

    @property
    def jumps(self) -> Floats:
        """Shares of the transit time at which the impedance jumps or bends."""
        return np.zeros(0) if self.profile is None else self.profile.jumps()

    @property
    def has_two_waves(self) -> bool:
        """Whether two waves run through it and keep their shapes, so that its motion is known."""
        return self.is_uniform and not self.is_loaded and self.wall_stiffness is None

    @property
    def wall_spring(self) -> float:
        """Stiffness of its wall over rho A [m/s^2]; 0 of a rigid one."""
        return (self.wall_stiffness or 0.0) / self.section

    def at(self, name: str, x: Floats) -> Floats:
        """Density, Young's modulus or area at some places."""
        return np.asarray(self._formula(name)(x=x))

    def _formula(self, name: str) -> Formula:
        given = getattr(self, name)
        return given if isinstance(given, Formula) else Formula(repr(given))

    def _number(self, name: str) -> float:
        given = getattr(self, name)
        return float(given(x=0.0)) if isinstance(given, Formula) else given

    @cached_property
    def profile(self) -> Profile | None:
        """How mass and travel time are distributed along it; None: evenly."""
        if self.is_uniform:
            return None
        density, modulus, area = map(self._formula, PROPERTIES)
        return Profile.of(self.length, density, modulus, area)

    def places(self, travel: Floats) -> Floats:
        """Places in the bar [m] by the travel time to them, as a share of L/c times L [m]."""
        return travel if self.profile is None else self.profile.places(travel)

    def weights(self, travel: Floats) -> Floats:
        """Impedance of each element over the mean M c / L, between nodes given as in `places`."""
        if self.profile is None:
            return np.ones(len(travel) - 1)
        return self.profile.weights(travel)

    def moments(self, travel: Floats) -> Floats:
        """First moment of the mass of each element about the near end [kg m], as `weights`."""
        if self.profile is None:
            return np.asarray(0.5 * self.section * np.diff(travel**2))
        return self.profile.moments(travel)

    @cached_property
    def wave_speed(self) -> float:
        """Speed of elastic waves c = sqrt(E / rho) [m/s]; where it varies, L / transit time."""
        if self.profile is None:
            return math.sqrt(self._number("youngs_modulus") / self._number("density"))
        if "t" not in self.profile.slowness.used:
            return 1.0 / float(self.profile.slowness())
        return self.length / self.profile.transit_time

    @property
    def transit_time(self) -> float:
        """Time L / c that a wave needs from one end to the other [s]."""
        return self.length / self.wave_speed

    @property
    def is_driven(self) -> bool:
        """Whether a force or a motion drives the far end."""
        return any(each.plain != 0.0 for each in (self.far_end_force, self.far_end_displacement))

    def end_speed(self, t: Floats) -> Floats:
        """What the far end gives to waves, F / (rho A c) or its own speed, at some times [m/s]."""
        if self.far_end == "clamped":
            return np.asarray(motion_at(self.far_end_displacement, t).rate) + np.zeros_like(t)
        force = self.end_force(t=t) / (self.impedance + self.end_damping)
        return np.asarray(force) + np.zeros_like(t)

    @cached_property
    def end_force(self) -> Formula:
        """Force on the far end without what its velocity adds, in t [N]."""
        return self.far_end_force.fixed(v=0.0)

    @cached_property
    def end_damping(self) -> float:
        """Of the far end: by how much the force falls with its velocity [N s/m]."""
        if "v" not in self.far_end_force.used:
            return 0.0
        from impactfem.scene.affine import affine_parts  # noqa: PLC0415  (rare)

        found = affine_parts(self.far_end_force, ("v",))
        if found is None or found[0][0] > 0.0:
            why = "does not fall in proportion to v: give a force of t less a number times v"
            raise self._fail("far_end_force", f"{why}.")
        return -found[0][0]

    @property
    def _drive(self) -> Formula:
        held = self.far_end == "clamped"
        return self.far_end_displacement if held else self.end_force

    def end_breaks(self, end: float) -> list[Break]:
        """Where that jumps or bends, up to a time [s], in order."""
        return [at for at in find_breaks(self._drive, end) if 0.0 < at.after < end]

    def end_cuts(self, end: float) -> list[Break]:
        """Where it has to be cut so that samples miss nothing, up to a time [s], in order."""
        inside = (at for at in cuts_of(self._drive, end) if 0.0 < at.after < end)
        return sorted(inside, key=lambda at: at.after)

    @cached_property
    def section(self) -> float:
        """Mass per length rho A [kg/m], M / L where it varies."""
        if self.profile is None:
            return self._number("density") * self._number("area")
        return self.profile.mass / self.length

    @property
    def impedance(self) -> float:
        """Force over speed rho A c of a wave [N s/m], M c / L where it varies."""
        return self.section * self.wave_speed

    @property
    def mass(self) -> float:
        """Mass rho A L [kg]."""
        return self.section * self.length

    @property
    def center(self) -> float:
        """Place of the centre of mass in the bar [m]."""
        return 0.5 * self.length if self.profile is None else self.profile.center

    @property
    def initial_displacement(self) -> Formula:
        """u(0, x) = gap + displacement(x) [m]."""
        return self.displacement.plus(self.gap)

    @property
    def initial_velocity(self) -> Formula:
        """u_t(0, x) [m/s]."""
        return self.velocity

    def _fail(self, name: str, text: str) -> KeyedError:
        value = getattr(self, name)
        return KeyedError(self.kind, name, f" = {show(value)} {text}")

    def _check_far_end(self) -> None:
        """A motion holds the far end; refuse a force on an end that is held."""
        if self.far_end_displacement.plain != 0.0:
            object.__setattr__(self, "far_end", "clamped")
        if self.far_end == "clamped" and self.far_end_force.plain != 0.0:
            why = "acts on a far end that is held: remove it, or far_end and far_end_displacement."
            raise self._fail("far_end_force", why)
        self.end_damping  # noqa: B018  (as it is read)

    def _check_place(self) -> None:
        """Refuse a place in space that is half given, or given twice."""
        if (self.point is None) != (self.axis is None):
            given, missing = ("axis", "point") if self.point is None else ("point", "axis")
            raise self._fail(given, f"needs {missing}: give both, or none.")
        if self.point is None or self.axis is None:
            return
        if len(self.axis) != len(self.point):
            raise self._fail("axis", f"has {len(self.axis)} entries: give {len(self.point)}.")
        if self.gap:
            raise self._fail("gap", "is the place on the x axis, but point is given: remove gap.")

    def _check_profile(self, x: Floats) -> None:
        """Refuse formulas of properties that are not positive somewhere."""
        for name in PROPERTIES:
            values = self.at(name, x)
            bad = np.flatnonzero(~((values >= LEAST) & np.isfinite(values)))
            if bad.size:
                place = f"{values[bad[0]]:.6g} at x = {x[bad[0]]:.6g}"
                text = f"is {place}: give one that is finite and > 0 for 0 <= x <= {self.length:g}."
                raise self._fail(name, text)

    def _check_scales(self, x: Floats) -> None:
        """Refuse values, each fine alone, whose wave speed or mass overflows."""
        given = f"density = {show(self.density)}, length = {self.length}"
        with np.errstate(over="ignore", under="ignore"):
            modulus, density = (float(self.at(name, x[0])) for name in PROPERTIES[1::-1])
            ratio = float(np.float64(modulus) / density)
        spacing = self.length / SAMPLES
        if spacing < sys.float_info.min:
            raise self._fail("length", "is too small to be computed with: give the length in m.")
        if not 0 < ratio < math.inf or not 0 < self.transit_time < math.inf:
            why = f"with {given} gives no usable wave speed sqrt(E / rho): give SI units."
            raise self._fail("youngs_modulus", why)
        if not 0 < self.mass < math.inf:
            raise self._fail("area", f"with {given} gives the mass {self.mass}: give SI units.")

    def _check_finite(self, name: str, x: np.ndarray) -> None:
        formula: Formula = getattr(self, name)
        values = formula(x=x) + (self.gap if name == "displacement" else 0.0)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            place = f"({values[bad[0]]}) at x = {x[bad[0]]:.6g}"
            raise self._fail(
                name,
                f"has no finite value {place}: give one finite for 0 <= x <= {self.length:g}.",
            )

    def _check_near_end(self) -> None:
        start = self.gap + float(self.displacement(x=0.0))
        if start < 0 and self.wall_stiffness is None:
            raise self._fail(
                "displacement",
                f"puts the near end inside the wall: gap + displacement(0) = {start:.6g} < 0; "
                f"increase gap = {self.gap:g} by {-start:.6g}.",
            )

    def _check_strain(self, x: np.ndarray) -> None:
        with np.errstate(over="ignore"):
            strain = np.diff(self.displacement(x=x)) / np.diff(x)
        # The differences of displacement = "-x" differ from -1 by rounding.
        bad = np.flatnonzero(strain <= -1 + 1e-9)
        if bad.size:
            raise self._fail(
                "displacement",
                f"turns the bar inside out: its strain near x = {x[bad[0]]:.6g} is "
                f"{strain[bad[0]]:.6g}, it must be > -1; reduce the displacement or its jumps.",
            )
