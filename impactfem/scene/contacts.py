"""Contact laws of a scene: which bodies meet, and what an impact leaves of their speed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeTable
from impactfem.scene.inline import InlineTable, ListOf
from impactfem.scene.kinds import Choice, Name, Real, SideName
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show


@dataclass(frozen=True)
class RestitutionLaw:
    """What an impact leaves of the speed with which bodies without waves approach.

    Attributes:
        of_speed: Gives Newton's e, 0 to 1, of several contacts at once by the speeds with which
            they close [m/s], > 0, and the ``restitution`` that the scene gives, (contacts,) each.
            It must depend on nothing else: restarts and ranks call it again.
        text: What it is, for reports; `impactfem.register` gives it.
    """

    of_speed: Callable[[Floats, Floats], Floats]
    text: str = ""


RESTITUTION_LAWS: dict[str, RestitutionLaw | None] = dict.fromkeys(("newton", "moreau", "poisson"))
"""How impacts share their impulses, see `docs/friction.md`; those of extensions by the speed."""

DAMPING_LAWS = ("kelvin_voigt", "hunt_crossley")
"""What resists indentation; see `impactfem.contact.dashpots`."""

_WITH_FRICTION = ("tangential_restitution", "rolling_resistance", "spinning_resistance")


@table("adhesion = { ... }")
class Adhesion:
    """What holds two bodies that have touched: a constant force up to energy / force apart.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "adhesion"

    force: float = key(Real(above=0), "pull-off force", unit="N")
    energy: float = key(Real(above=0), "what parting costs", unit="J")


@table("[[contact]]")
class Contact:
    """A pair that may meet: two bodies, a body and an obstacle, or a body and itself.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "contact"

    name: str | None = key(
        Name(),
        "name of the pair in columns such as `force.NAME`",
        default=None,
        absent="those of between, as ball.floor or ball_skin.floor",
    )
    between: Sequence[str] = key(
        ListOf(SideName(), at_least=2),
        "names of two bodies, or of a body and an obstacle; a surface of a solid as ball/skin; "
        "patterns, as grain_* and *, stand for all pairs that they match and no other law names; "
        "twice the same solid where it may meet itself",
    )
    restitution: float = key(
        Real(at_least=0),
        "Newton's coefficient of restitution, 0 to 1 (point, rod, beam, rigid)",
        default=0.0,
    )
    restitution_law: str | None = key(
        Choice(RESTITUTION_LAWS),
        "on what restitution acts: normal speeds (newton, moreau) or impulses (poisson, without "
        "friction); or a law of an extension, by the speed of approach",
        default=None,
        absent="moreau with friction, else newton",
    )
    stiffness: float | None = key(
        Real(above=0),
        "of what gives way where they touch, as a dent: force over indentation to the power of "
        "stiffness_exponent (point, rod, beam, bar, plate, ball of kind rigid, each corner of "
        "others on a half_space); of a layer on a face of a solid or a plate on an obstacle "
        "pressure instead",
        unit="N or Pa/m^stiffness_exponent",
        default=None,
        absent="nothing gives way",
    )
    stiffness_exponent: float = key(
        Real(at_least=1), "1 of a spring, 1.5 of a ball (Hertz)", default=1.0
    )
    damping: float = key(
        Real(at_least=0),
        "of what gives way, which never pulls: force over the speed of indentation, of layers "
        "pressure (Pa s/m); with hunt_crossley what multiplies that speed and the force of the "
        "stiffness (s/m)",
        unit="N s/m",
        default=0.0,
    )
    damping_law: str = key(
        Choice(DAMPING_LAWS),
        "a dashpot beside the spring (kelvin_voigt), or F = K d^p (1 + damping d')",
        default="kelvin_voigt",
    )
    adhesion: MaybeTable[Adhesion] = key(
        InlineTable((Adhesion,)),
        "force that parts what has touched, and the energy it costs (points, balls, ends of rods "
        "and beams)",
        default=None, absent="nothing holds",
    )  # fmt: skip
    friction_coefficient: float = key(Real(at_least=0), "Coulomb's coefficient", default=0.0)
    static_friction_coefficient: float | None = key(
        Real(at_least=0),
        "that of what does not slip yet (point, rigid)",
        default=None,
        absent="friction_coefficient",
    )
    tangential_restitution: float = key(
        Real(at_least=0),
        "fraction of the slip that an impact reverses, friction permitting, 0 to 1 (1: superball)",
        default=0.0,
    )
    rolling_resistance: float = key(
        Real(at_least=0),
        "moment that resists rolling over the normal force (what is round of rigid and robots)",
        unit="m",
        default=0.0,
    )
    spinning_resistance: float = key(
        Real(at_least=0),
        "the same about the normal, in space",
        unit="m",
        default=0.0,
    )

    @property
    def laws_of_mass(self) -> tuple[str, ...]:
        """Keys that are given of laws for bodies without waves."""
        keys = ("restitution", "restitution_law", "static_friction_coefficient", *_WITH_FRICTION)
        return tuple(name for name in keys if getattr(self, name))

    @property
    def by_speed(self) -> RestitutionLaw | None:
        """What tells restitution by the speed of approach; None: it is a number."""
        return RESTITUTION_LAWS.get(self.restitution_law or "")

    @property
    def is_newton(self) -> bool:
        """Whether impacts leave a fixed share of speeds, as all methods know it."""
        return not self.by_impulses and self.by_speed is None

    @property
    def by_impulses(self) -> bool:
        """Whether restitution is Poisson's."""
        return self.restitution_law == "poisson"

    @property
    def sticking(self) -> float:
        """Friction coefficient of what does not slip."""
        static = self.static_friction_coefficient
        return self.friction_coefficient if static is None else static

    def _check(self) -> None:
        if len(self.between) != 2:
            text = f" = {show(list(self.between))} has {len(self.between)} names: give two."
            raise KeyedError(self.heading, "between", text)
        for name in ("restitution", "tangential_restitution"):
            if (value := getattr(self, name)) > 1.0:
                text = f" = {show(value)} is not allowed: an impact would gain energy; "
                text += "give a number from 0 (no rebound) to 1 (no loss)."
                raise KeyedError(self.heading, name, text)
        if self.name is not None and any(set("*?") & set(side) for side in self.between):
            text = f" = {show(self.name)} would be that of several pairs: remove it."
            raise KeyedError(self.heading, "name", text)
        self._check_stiffness()
        self._check_friction()

    def _check_stiffness(self) -> None:
        if self.stiffness_exponent != 1.0 and self.stiffness is None:
            text = f" = {show(self.stiffness_exponent)} is that of stiffness: give it too."
            raise KeyedError(self.heading, "stiffness_exponent", text)
        if self.damping and self.stiffness is None:
            text = f" = {show(self.damping)} is that of a contact that gives way: give its "
            text += "stiffness too, or a restitution instead."
            raise KeyedError(self.heading, "damping", text)
        if self.damping_law != "kelvin_voigt" and not self.damping:
            text = f" = {show(self.damping_law)} is the law of damping: give that too."
            raise KeyedError(self.heading, "damping_law", text)
        by_speed = ("restitution_law",) if self.by_speed else ()
        for name in ("restitution", "tangential_restitution", *by_speed):
            if self.stiffness is not None and (value := getattr(self, name)):
                text = f" = {show(value)} is not available with stiffness, which gives back what "
                text += "it takes; remove one, or say by damping what it loses."
                raise KeyedError(self.heading, name, text)

    def _check_friction(self) -> None:
        rubs = bool(self.friction_coefficient)
        for name in _WITH_FRICTION:
            if (value := getattr(self, name)) and not rubs:
                text = f" = {show(value)} needs friction_coefficient: without friction nothing "
                text += "acts along the surface; give it (large where nothing slips)."
                raise KeyedError(self.heading, name, text)
        if self.sticking < self.friction_coefficient:
            text = f" = {show(self.sticking)} is smaller than friction_coefficient = "
            text += f"{show(self.friction_coefficient)}: what slips is held less; give as much or "
            raise KeyedError(self.heading, "static_friction_coefficient", f"{text}more.")
        if self.sticking and not rubs:
            text = f" = {show(self.sticking)} needs friction_coefficient, that of slip; give it."
            raise KeyedError(self.heading, "static_friction_coefficient", text)
        if rubs and self.restitution_law in {"newton", "poisson"}:
            text = f" = {show(self.restitution_law)} is not available with friction, where "
            text += "Moreau's law is taken; remove it."
            raise KeyedError(self.heading, "restitution_law", text)
