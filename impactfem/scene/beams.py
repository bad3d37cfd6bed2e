"""Slender bodies: the rigid rod in the plane and the elastic beam, in the plane or in space."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.beam_loads import EndLoad
from impactfem.scene.beam_supports import ENDS, BeamSupport, check_supports, first_root
from impactfem.scene.body import JOINED, BodyKind, Solver
from impactfem.scene.damping import QUALITY, Damping, fill_damping, filled_keys, rayleigh_of
from impactfem.scene.flight import Flight
from impactfem.scene.formula import Formula
from impactfem.scene.given import FormulaOrSome, MaybeFormulas, MaybeTable, Tables
from impactfem.scene.inline import (
    FormulaOrFormulas,
    Formulas,
    InlineTable,
    ListOf,
    NumberOrVector,
    Vector,
)
from impactfem.scene.jets import motion_at
from impactfem.scene.joints import GROUND, Joint
from impactfem.scene.kinds import Choice, Integer, Name, Real
from impactfem.scene.obstacles.base import unit_vector
from impactfem.scene.rigid_keys import check_forces
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import NotAllowedError, show

if TYPE_CHECKING:
    from impactfem.scene.centerline import Curve

THEORIES = ("euler_bernoulli", "timoshenko")
STRAINS = ("small", "finite")
CONTACTS = ("ends", "along")
SHEAR_CORRECTION = 5.0 / 6.0
"""Share of a rectangular section that carries the shear force (Timoshenko)."""

# Height over length up to which the deflection of a theory is that of the body.
_THICKEST = {"euler_bernoulli": 0.2, "timoshenko": 0.5}
_MOST_BENT = 0.2  # height over the radius of a curved axis
_SAME = 1e-6  # relative difference of lengths of one axis
_INCLINATION = "angle of the axis to the x axis, from -pi to pi"


class Slender(BodyKind):
    """What rods and beams have in common: a straight axis at t = 0."""

    is_slender: ClassVar[bool] = True

    length: float
    center: Sequence[float]
    inclination: float

    @property
    def along(self) -> Floats:
        """Unit vector along the axis at t = 0."""
        return np.array([math.cos(self.inclination), math.sin(self.inclination)])

    def centreline(self) -> Floats:
        """Both ends of its axis at t = 0 [m], (2, dim)."""
        along = self.along
        return np.asarray(self.center) + 0.5 * self.length * np.array([-along, along])


@table('[[body]] with kind = "rod"')
class Rod(Slender):
    """A slender rigid rod that moves in the plane and touches obstacles with its ends.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    kind: ClassVar[str] = "rod"
    dim: ClassVar[int] = 2
    settles: ClassVar[bool] = True
    may_meet_nothing: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    dents: ClassVar[bool] = True
    round_ends: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    has_centre: ClassVar[bool] = True

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
    force: MaybeFormulas = key(
        Formulas(("t", "x", "y", "vx", "vy"), lengths=(2,)),
        "applied to the centre besides gravity", unit="N", default=None, absent="none",
    )  # fmt: skip
    moment: MaybeFormulas = key(
        Formulas(("t", "w"), lengths=(1,)), "applied, of the rotation w [rad/s]", unit="N m",
        default=None, absent="none",
    )  # fmt: skip

    def _check(self) -> None:
        _check_angle(self)
        if self.force or self.moment:
            values = zip(("x", "y", "vx", "vy"), (*self.center, *self.velocity), strict=True)
            check_forces(self, dict(values), {"w": self.angular_velocity})

    @property
    def solvers(self) -> tuple[Solver, Solver]:  # type: ignore[override]
        """What forces drive is marched."""
        driven = self.force or self.moment
        return ("march", "march") if driven else ("vibro", "vibro")

    def centre_velocity(self) -> Floats | None:
        """Velocity of its centre at t = 0 [m/s], (2,)."""
        return np.asarray(self.velocity, dtype=np.float64)

    def box(self) -> tuple[Floats, Floats]:
        """Half edges and centre [m] of a box around it in any rotation."""
        return np.full(2, self.length / 2 + self.radius), np.asarray(self.center, dtype=np.float64)

    @property
    def line_thickness(self) -> float:
        """Its diameter [m]."""
        return 2.0 * self.radius

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if forces act on it."""
        if self.force or self.moment:
            return None
        return Flight((self.length / 2 + self.radius,) * 2, self.center, self.velocity)


@table('[[body]] with kind = "beam"')
class Beam(Slender):
    """An elastic beam of rectangular section, free or held at its ends, in the plane or in space.

    Its axis touches obstacles, with both ends or with all nodes; other bodies meet it as if it were
    round, half its height around the axis. Displacements and rotations from
    the place at t = 0 are small, unless strain = "finite".

    Raises:
        SceneError: a value is missing or not allowed, the beam is too thick for its theory, its
            damping is given twice, or keys of the plane and of space are mixed.
    """

    kind: ClassVar[str] = "beam"
    may_meet_nothing: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    in_elements: ClassVar[bool] = True
    round_ends: ClassVar[bool] = False
    settles: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True

    name: str = key(Name(), "name of the beam in histories", default="beam")
    length: float = key(
        Real(above=0), "length", unit="m", default=None, absent="that of centerline"
    )
    height: float = key(
        Real(above=0), "height of the section, in the plane, or across width_axis", unit="m"
    )
    width: float = key(
        Real(above=0), "width of the section, across the plane or along width_axis", unit="m"
    )
    density: float = key(Real(above=0), "mass density", unit="kg/m^3")
    youngs_modulus: float = key(Real(above=0), "Young's modulus", unit="Pa")
    poisson_ratio: float = key(
        Real(above=-1, below=0.5),
        "Poisson's ratio, for the shear of a timoshenko beam",
        default=0.3,
    )
    theory: str = key(Choice(THEORIES), "bending without or with shear", default="euler_bernoulli")
    strain: str | None = key(
        Choice(STRAINS), "whether it may turn and bend as far as it likes; finite: at any angle",
        default=None, absent="small; finite, with a centerline",
    )  # fmt: skip
    elements: int = key(Integer(1, 1000), "number of elements along the beam", default=16)
    center: Sequence[float] = key(
        Vector(), "centre at t = 0; with a centerline the origin of that", unit="m"
    )
    centerline: MaybeFormulas = key(
        Formulas(("s",)), "a curved axis at t = 0, without stresses: from center, along the axes "
        "of the scene, s from 0 at the first to 1 at the last end; for beams of finite strain",
        unit="m", default=None, absent="straight",
    )  # fmt: skip
    inclination: float = key(
        Real(), f"{_INCLINATION}, at t = 0, in the plane", unit="rad", default=0.0
    )
    axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True), "from the first to the last end, in space", default=None,
        absent="along x",
    )  # fmt: skip
    width_axis: Sequence[float] | None = key(
        Vector((3,), nonzero=True), "across the axis, in space: where the width lies",
        default=None, absent="across z; of a beam along z, along y",
    )  # fmt: skip
    velocity: Sequence[float] | None = key(
        Vector(), "velocity of the centre at t = 0", unit="m/s", default=None, absent="at rest"
    )
    angular_velocity: float | Sequence[float] | None = key(
        NumberOrVector(), "at t = 0, in space along the axes of the scene", unit="rad/s",
        default=None, absent="none",
    )  # fmt: skip
    supports: Tables[BeamSupport] = key(
        ListOf(InlineTable((BeamSupport,))), "ends that are held", default=()
    )
    contact: str | None = key(
        Choice(CONTACTS), "what of the axis may touch obstacles", default=None,
        absent="ends; along, if an end is held",
    )  # fmt: skip
    damping_ratio: float | None = key(
        Real(at_least=0, below=1),
        "damping of the first bending mode over the critical one, by C = beta K; of ends on "
        "springs that of free ones",
        default=None,
        absent="0",
    )
    quality_factor: float | None = key(Real(above=0), QUALITY, default=None, absent="none")
    rayleigh_mass: float = key(
        Real(at_least=0), "damping by the mass: speeds fall at this rate", unit="1/s", default=0.0
    )
    rayleigh_stiffness: float = key(
        Real(at_least=0), "damping by the stiffness", unit="s", default=0.0
    )
    damping: MaybeTable[Damping] = key(
        InlineTable((Damping,)), "the same in one table", default=None, absent="none"
    )
    rayleigh: Sequence[float] | None = key(
        Vector((2,)),
        "alpha [1/s] and beta [s] of the damping C = alpha M + beta K; alpha brakes the fall too",
        default=None,
        absent="0",
    )
    load: FormulaOrSome = key(
        FormulaOrFormulas(("t", "x", "u")),
        "per length; a formula: across the axis, in the plane, positive along the axis turned by "
        "90 degrees (up, of a beam along x); a list: along the axes of the scene; x from the "
        "first end, u the displacement of the axis there along the same direction",
        unit="N/m", default=None, absent="none",
    )  # fmt: skip

    end_loads: Tables[EndLoad] = key(
        ListOf(InlineTable((EndLoad,))), "forces and moments on ends that are not held", default=()
    )

    def _check(self) -> None:
        _check_angle(self)
        self._check_dimension()
        self._check_curve()
        for index, pushed in enumerate(self.end_loads):
            for name, count in (("force", self.dim), ("moment", 2 * self.dim - 3)):
                given = getattr(pushed, name)
                if given is not None and len(given) != count:
                    text = f" has {len(given)} entries, in {self.dim} coordinates give {count}."
                    raise KeyedError(self.kind, f"end_loads[{index}].{name}", text)
        for index, support in enumerate(self.supports):
            if support.motion is not None and len(support.motion) != self.dim:
                text = (
                    f" has {len(support.motion)} entries, center has {self.dim}: give {self.dim}."
                )
                raise KeyedError(self.kind, f"supports[{index}].motion", text)
        check_supports(self.supports, self.kind)
        self._check_slenderness()
        self._check_damping()
        self._check_scales()

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return len(self.center)

    @property
    def touches_along(self) -> bool:
        """Whether all nodes of its axis may touch obstacles, not its ends alone."""
        return (self.contact or CONTACTS[bool(self.supports)]) == CONTACTS[1]

    @property
    def in_space(self) -> bool:
        """Whether it moves in space."""
        return self.dim == 3

    @property
    def solvers(self) -> tuple[Solver, Solver]:  # type: ignore[override]
        """Methods of few degrees of freedom take free beams in the plane."""
        marched = self.in_space or self.supports or self.is_finite
        return ("march", "march") if marched else ("vibro", "vibro")

    @property
    def has_coordinates(self) -> bool:  # type: ignore[override]
        """Methods of few degrees of freedom take beams that are held in the plane if asked for."""
        held = bool(self.supports) and not self.in_space and not self.moved_ends
        return held and not self.is_finite

    @property
    def is_finite(self) -> bool:
        """Whether it may turn and bend far."""
        return self.strain == "finite" or (self.strain is None and self.centerline is not None)

    @cached_property
    def curve(self) -> "Curve | None":
        """Its axis, if it is curved."""
        if self.centerline is None:
            return None
        from impactfem.scene.centerline import curve_of  # noqa: PLC0415  (few beams have one)

        wide = None if self.width_axis is None else np.asarray(self.width_axis, dtype=np.float64)
        try:
            return curve_of(self.centerline, self.center, self.elements, wide)
        except NotAllowedError as error:
            given = show([formula.plain for formula in self.centerline])
            raise KeyedError(self.kind, "centerline", f" = {given} is no axis: {error}.") from None

    @property
    def middle(self) -> Floats:
        """Centre of its axis [m], (dim,)."""
        return np.asarray(self.center if self.curve is None else self.curve.middle, dtype=float)

    def centreline(self) -> Floats:
        """Both ends of its axis at t = 0, or nodes along a curved one [m], (places, dim)."""
        return super().centreline() if self.curve is None else self.curve.nodes

    @property
    def node_places(self) -> Floats:
        """Its nodes at t = 0 [m], (elements + 1, dim)."""
        if self.curve is not None:
            return self.curve.nodes
        s = np.linspace(-0.5 * self.length, 0.5 * self.length, self.elements + 1)
        return np.asarray(self.center, dtype=np.float64) + s[:, None] * self.along

    @property
    def node_frames(self) -> Floats:
        """Unit vectors there along its axis, height and width, in columns, (nodes, 3, 3)."""
        if self.curve is not None:
            return self.curve.frames
        frame = np.eye(3)
        frame[: self.dim, : self.dim] = self.frame.T
        return np.tile(frame, (self.elements + 1, 1, 1))

    @property
    def small_strains(self) -> bool:  # type: ignore[override]
        """Unless it is of finite strain."""
        return not self.is_finite

    def with_elements(self, factor: float) -> Self:
        """The same with elements about so many times as long, at least one."""
        count = max(1, round(self.elements / factor))
        return replace(self, elements=count)

    @property
    def turns_far(self) -> bool:
        """Under finite strain."""
        return self.is_finite

    @property
    def loads(self) -> tuple[tuple[Floats, Formula], ...]:
        """Directions (dim,), of one across a curved axis (nodes, dim), and loads along them."""
        if self.load is None:
            return ()
        if isinstance(self.load, Formula):
            curve = self.curve
            return ((self.frame[1] if curve is None else curve.frames[:, :2, 1], self.load),)
        each = zip(np.eye(self.dim), self.load, strict=True)
        return tuple((along, load) for along, load in each if load.used or load())

    @property
    def pushes(self) -> tuple[tuple[int, int, Formula], ...]:
        """Forces and moments on ends: which end, component of six in space, and formula."""
        return tuple(
            (ENDS.index(pushed.end), first + k, formula)
            for pushed in self.end_loads
            for first, given in ((0, pushed.force), (6 - (2 * self.dim - 3), pushed.moment))
            for k, formula in enumerate(given or ())
            if formula.used or formula()
        )

    @property
    def is_loaded(self) -> bool:
        """Whether loads act on it."""
        return self.load is not None or bool(self.end_loads)

    @property
    def moved_ends(self) -> tuple[BeamSupport, ...]:
        """Supports that move."""
        return tuple(support for support in self.supports if support.motion is not None)

    @property
    def jointed_ends(self) -> tuple[BeamSupport, ...]:
        """Supports that are joints with the ground: they move, or let an end turn far in space."""
        hinged = self.is_finite and self.in_space
        return tuple(
            support
            for support in self.supports
            if support.motion is not None or (hinged and support.holds == (True, False))
        )

    @property
    def own_joints(self) -> tuple[Joint, ...]:
        """Joints by which ends are held, which may see the ground move."""
        found = []
        for support in self.jointed_ends:
            last = -ENDS.index(support.end)
            one, two = self.node_frames[last].T[-2:].tolist()
            turns: dict[str, Any] = {"kind": "fixed"}
            if not support.holds[1]:
                turns = {"kind": "revolute"}
                if self.in_space:  # free to bend, not to turn about its axis
                    turns = {"kind": "universal", "axis": one, "second_axis": two}
            place = self.centreline()[last].tolist()
            found.append(
                Joint(
                    name=f"{self.name}_{support.end}", between=(GROUND, self.name), point=place,
                    motion=support.motion, **turns,
                )
            )  # fmt: skip
        return tuple(found)

    def end_speeds(self) -> list[tuple[str, Floats]]:
        """Moved ends and their velocities at t = 0 [m/s], (dim,)."""
        return [
            (support.end, np.array([float(motion_at(f, 0.0).rate) for f in support.motion or ()]))
            for support in self.moved_ends
        ]

    @property
    def along(self) -> Floats:
        """Unit vector along the axis at t = 0, (dim,)."""
        return np.asarray(self.frame[0])

    @property
    def _axis(self) -> Floats:
        """Unit vector along the axis, in space."""
        return unit_vector(np.asarray(self.axis or (1.0, 0.0, 0.0), dtype=np.float64))

    @cached_property
    def frame(self) -> Floats:
        """Unit vectors along the axis, the height and the width, by rows: (dim, dim).

        Those of a curved axis are at its first end.
        """
        if self.curve is not None:
            return np.asarray(self.curve.frames[0].T[: self.dim, : self.dim])
        if not self.in_space:
            along = super().along
            return np.array([along, [-along[1], along[0]]])
        along = self._axis
        if self.width_axis is None:
            upright = abs(along[2]) > 1.0 - 1e-9
            wide = np.array([0.0, 1.0, 0.0]) if upright else np.cross(along, [0.0, 0.0, 1.0])
        else:
            wide = unit_vector(np.asarray(self.width_axis, dtype=np.float64))
        wide = unit_vector(wide - (wide @ along) * along)
        return np.array([along, np.cross(wide, along), wide]) + 0.0

    @property
    def rates(self) -> Floats:
        """Velocity [m/s] and angular velocity [rad/s] at t = 0, (3,), in space (6,)."""
        moving = np.zeros(self.dim) if self.velocity is None else self.velocity
        turns = 2 * self.dim - 3
        spin = np.zeros(turns) if self.angular_velocity is None else self.angular_velocity
        return np.concatenate([moving, np.atleast_1d(spin)]).astype(np.float64)

    def centre_velocity(self) -> Floats | None:
        """Velocity of its centre at t = 0 [m/s], (dim,); None if ends are held."""
        return None if self.supports else self.rates[: self.dim]

    def box(self) -> tuple[Floats, Floats]:
        """Half edges and centre [m] of a box around its axis in any rotation."""
        if self.curve is not None:
            far = np.linalg.norm(self.curve.nodes - self.middle, axis=1).max()
            return np.full(self.dim, far), self.middle
        return np.full(self.dim, self.length / 2), np.asarray(self.center, dtype=np.float64)

    def missed(self, place: Floats, part: str) -> str | None:  # noqa: ARG002  (it has none)
        """Joints hold a section along its axis, within its height."""
        if self.curve is not None:
            far = self.curve.nearest(np.asarray(place))[1] > 0.5 * self.height * (1.0 + JOINED)
            return "its centerline, within half its height" if far else None
        along = self.along
        away = place - np.asarray(self.center)
        far = abs(away @ along) > 0.5 * self.length * (1.0 + JOINED)
        across = float(np.linalg.norm(away - (away @ along) * along))
        off = across > 0.5 * self.height * (1.0 + JOINED)
        ends = " to ".join(show([round(x, 12) for x in end]) for end in self.centreline().tolist())
        return f"from {ends}, within half its height" if far or off else None

    @property
    def dents(self) -> bool:  # type: ignore[override]
        """Whether its contacts may have a stiffness: not where all of it may lie on something."""
        return not self.touches_along

    @property
    def line_thickness(self) -> float:
        """Its height [m]."""
        return self.height

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if damping brakes its fall, a load acts, or an end is held."""
        if self.rayleigh_damping[0] or self.supports or self.is_loaded or self.centerline:
            return None
        return Flight((self.length / 2,) * self.dim, self.center, tuple(self.rates[: self.dim]))

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
        """First angular frequency of the Euler-Bernoulli beam, springs left out [rad/s]."""
        thin = min(self.height, self.width) if self.in_space else self.height
        stiffness = self.youngs_modulus * thin**2 / (12.0 * self.density)
        return (first_root(self.supports) / self.length) ** 2 * math.sqrt(stiffness)

    @property
    def rayleigh_damping(self) -> tuple[float, float]:
        """(alpha [1/s], beta [s]) of C = alpha M + beta K."""
        if self.rayleigh is not None:
            return self.rayleigh[0], self.rayleigh[1]
        return rayleigh_of(self, self.first_frequency, held=bool(self.supports))

    @property
    def derived(self) -> tuple[str, ...]:
        """Keys that follow from others: scene files leave them out."""
        return filled_keys(self) if self.damping else ()

    def _check_dimension(self) -> None:
        """Refuse keys of the plane in space, and of space in the plane."""
        dim, turns = self.dim, 2 * self.dim - 3
        for name, plain in (("inclination", 3), ("axis", 2), ("width_axis", 2)):
            if dim == plain and getattr(self, name):
                other = "axis and width_axis" if dim == 3 else "inclination"
                text = f" = {show(getattr(self, name))} does not fit a center of {dim} entries: "
                raise KeyedError(self.kind, name, f"{text}give {other} there.")
        if isinstance(self.load, Formula) and dim == 3:
            text = (
                f" = {show(self.load.plain)}: it acts in the plane of a beam, of which there are "
            )
            raise KeyedError(self.kind, "load", f"{text}two in space; give a list of 3 formulas.")
        if isinstance(self.load, tuple) and len(self.load) != dim:
            text = f" has {len(self.load)} entries, center has {dim}: give {dim}."
            raise KeyedError(self.kind, "load", text)
        if self.velocity is not None and len(self.velocity) != dim:
            text = f" = {show(list(self.velocity))} has {len(self.velocity)} entries, center has "
            raise KeyedError(self.kind, "velocity", f"{text}{dim}: give {dim}.")
        if self.angular_velocity is not None and np.size(self.angular_velocity) != turns:
            spin, wanted = self.angular_velocity, "a number" if dim == 2 else "3 numbers"
            text = f" = {show(spin)} does not fit {dim} coordinates: give {wanted}."
            raise KeyedError(self.kind, "angular_velocity", text)
        if self.width_axis is not None:
            wide = unit_vector(np.asarray(self.width_axis, dtype=np.float64))
            if np.linalg.norm(np.cross(self._axis, wide)) < 1e-6:
                text = f" = {show(list(self.width_axis))} lies along axis: give one across it."
                raise KeyedError(self.kind, "width_axis", text)

    def _check_curve(self) -> None:
        """A curved axis says where it lies and how long it is."""
        if self.centerline is None:
            if cast("float | None", self.length) is None:
                text = " is missing: add it, give a number > 0 [m], or a centerline."
                raise KeyedError(self.kind, "length", text)
            return
        given = [formula.plain for formula in self.centerline]
        if len(given) != self.dim:
            text = f" has {len(given)} entries, center has {self.dim}: give {self.dim}."
            raise KeyedError(self.kind, "centerline", text)
        for name in ("axis", "inclination"):
            if getattr(self, name):
                text = f" = {show(getattr(self, name))} contradicts centerline: remove one of them."
                raise KeyedError(self.kind, name, text)
        if self.strain == STRAINS[0]:
            text = f' = "{self.strain}": elements of small strain have straight axes; with a '
            raise KeyedError(self.kind, "strain", f'{text}centerline give "finite", or none.')
        curve = cast("Curve", self.curve)
        if self.length is not None and abs(self.length - curve.length) > _SAME * curve.length:
            text = f" = {self.length:g} is not that of centerline, {curve.length:.10g}: remove it."
            raise KeyedError(self.kind, "length", text)
        object.__setattr__(self, "length", curve.length)
        for name in ("height", "width")[: self.dim - 1]:
            if (bent := getattr(self, name) * curve.bend) > _MOST_BENT:
                text = f" = {getattr(self, name):g} is {bent:.3g} of the least radius of "
                text += f"centerline, {1.0 / curve.bend:.4g}: sections of beams are small beside "
                text += f"it (at most {_MOST_BENT:g}); model it as a solid."
                raise KeyedError(self.kind, name, text)

    def _check_slenderness(self) -> None:
        limit = _THICKEST[self.theory]
        for name in ("height", "width")[: self.dim - 1]:
            size = getattr(self, name)
            slope = size / self.length
            if slope > limit:
                other = 'choose theory = "timoshenko" (up to 1/2), or ' * (limit < slope <= 0.5)
                raise KeyedError(
                    self.kind,
                    name,
                    f" = {size:g} is {slope:.3g} of the length = {self.length:g}, too thick for "
                    f'theory = "{self.theory}" (at most {limit:g}): {other}model it as a solid.',
                )

    def _check_damping(self) -> None:
        if self.damping or self.quality_factor or self.damping_ratio:
            fill_damping(self)
        if self.rayleigh is None:
            return
        names = "quality_factor", "damping_ratio", "rayleigh_mass", "rayleigh_stiffness"
        if other := next((name for name in names if getattr(self, name)), ""):
            text = f" = {show(list(self.rayleigh))} contradicts {other}: remove one of them."
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
