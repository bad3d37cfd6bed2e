"""What balls and points make of plates that they strike: dents, and forces that follow elements."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from impactfem.findings import Finding, warning
from impactfem.scene import Scene
from impactfem.scene.apartness import Apartness
from impactfem.scene.pairing import law_of, named_body_pairs

if TYPE_CHECKING:
    from impactfem.models.solids import SolidsModel
    from impactfem.scene.contacts import Contact
    from impactfem.system.few import FewBodies
    from impactfem.system.plate import PlateSystem

_DENTED = 3.0  # Zener's number beyond which balls stay on large plates, dents or not
_BRAKED = 1.0 / 3.0
"""Elements by the radius of plate that weighs as a ball, up to which these do not decide.

Of the first speed a ball's is off by 0.19 to 0.46, 0.21, 0.09, 0.01 on elements of 1, 1/2, 1/3, 1/4
of that, at the time in which it is braked.
"""
_RINGS = 5.0
"""Times in which bending waves cross an element, h^2 sqrt(rho t / D), over which forces are means.

The first element that is struck takes a ball's speed by itself, throws it off and is caught up:
single forces are 1.7 to 3.5 times those of a plate without end, on any elements; means over as
long are 0.5 to 11 % too large on those of 1/3 to 1/8 of the radius.
"""
_RISES = 0.9
"""The same in the time in which the force of a dent grows: its peak is 4 to 11 % off, about 30 % at
0.45 (Zener's number 1 and 3)."""
_OF_DENT, _OF_WAVES = 1.47, 3.0  # that time by dent and speed on a rigid plate, and on a soft one


@dataclass(frozen=True)
class _Strike:
    """A ball or a point that may meet a plate.

    Attributes:
        plate, ball: Their names.
        at, k: Their places in `few` and `other`.
        few, other: The kinds that they are among.
        speed: At which they may meet [m/s].
        law: Of their contact if that has a stiffness, else None.
    """

    plate: str
    ball: str
    few: "PlateSystem"
    other: "FewBodies"
    at: int
    k: int
    speed: float
    law: "Contact | None"

    @property
    def mass(self) -> float:
        """Of the ball [kg]."""
        return self.other.masses[self.k]

    @property
    def radius(self) -> float:
        """Of the ball [m]."""
        return float(self.other.radius[self.other.nodes_of(self.k)].max())

    @property
    def width(self) -> float:
        """Of the elements that it meets [m]: on the line of both velocities at t = 0."""
        way = self.other.speeds[self.k] - self.few.speeds[self.at]
        return self.few.width_at(self.other.centers[self.k], way)


def falling(scene: Scene) -> float:
    """Speed that gravity may give within the run [m/s]."""
    return scene.duration * float(np.abs(scene.vector_gravity.values).max(initial=0.0))


def struck_findings(model: "SolidsModel") -> list[Finding]:
    """What is left out where balls strike plates, and what elements do not resolve."""
    return [*_dents(model), *_peaks(model)]


def _dents(model: "SolidsModel") -> list[Finding]:
    """Balls that plates are too stiff for, whose dents are left out."""
    found = []
    for strike in _strikes(model):
        give = strike.few.give(strike.mass, strike.radius, strike.speed)
        if 0.0 < give < _DENTED and strike.law is None:
            ball, struck = strike.ball, strike.plate
            text = f"{ball} would dent {struck} about as much as that gives way (Zener's "
            text += f"number {give:.2g}), which is left out: forces and times of their "
            text += "contact belong to the mesh, and the rebound is too slow"
            remedy = "give [[contact]] stiffness: by Hertz 4/3 E* sqrt(radius) with "
            remedy += "stiffness_exponent = 1.5, where 1/E* is the sum of (1 - nu^2)/E of both"
            found.append(warning("impact_law", text, struck, remedy))
    return found


def _peaks(model: "SolidsModel") -> list[Finding]:
    """Balls and points that strike plates of too large elements, which brake them by themselves.

    With the mass m a ball is braked within m / 8 sqrt(D rho t), in which bending waves get as far
    as about the radius a of the plate that weighs as it, m = pi a^2 rho t.
    """
    found = []
    for strike in _blows(model):
        width, weighing = strike.width, strike.few.weighing(strike.mass)
        ball, struck, enough = strike.ball, strike.plate, _BRAKED * weighing
        text = f"{ball} strikes elements of {struck} that are {width:.2g} m wide, "
        if strike.law is None:
            text += f"while as much of it as {ball} weighs has a radius of {weighing:.2g} m: the "
            text += f"largest force and the speed of {ball} after belong to the mesh"
        else:
            rise = _rise(strike, strike.law)
            enough = strike.few.crossed(rise / _RISES)
            text += f"which bending waves cross in {strike.few.crossing(width):.2g} s, while their "
            text += f"force grows within {rise:.2g} s: its peak belongs to the mesh"
        if width > enough:
            remedy = f"take elements below {enough:.2g} m there"
            subject = f"{ball}.{struck}"
            found.append(Finding("force_peak", "warning", text, subject, width, enough, remedy))
    return found


def _rise(strike: _Strike, law: "Contact") -> float:
    """About how long the force of a spring of a contact grows [s].

    On a rigid plate half of the contact (see `dent_times`); where waves take the speed
    before, until its force is that of waves. By Hertz beside Zener's equation at most 40 % less,
    with his lambda from 0.3 to 10.
    """
    power, stiffness = law.stiffness_exponent, law.stiffness or 0.0
    dent = (0.5 * (power + 1.0) * strike.mass * strike.speed**2 / stiffness) ** (1 / (power + 1))
    held = (strike.few.impedance_at_point * strike.speed / stiffness) ** (1.0 / power)
    return float(1.0 / (strike.speed / (_OF_DENT * dent) + strike.speed / (_OF_WAVES * held)))


def ringing(model: "SolidsModel") -> float:
    """Time [s] over which forces of balls on plates are means; 0 if none strikes one."""
    hard = (strike for strike in _blows(model) if strike.law is None)
    return max((_RINGS * each.few.crossing(each.width) for each in hard), default=0.0)


def _strikes(model: "SolidsModel") -> Iterator[_Strike]:
    """Balls and other bodies that may meet plates."""
    from impactfem.system.plate import PlateSystem  # noqa: PLC0415  (loads DOLFINx)

    if not any(isinstance(few, PlateSystem) for few in model.few):
        return
    scene, fall = model.scene, falling(model.scene)
    apart = Apartness.of(scene)
    known = {name: (few, k) for few in model.few for k, name in enumerate(few.names)}
    for _, *sides in named_body_pairs(scene):
        names = [name for name, _ in sides if name in known]
        if len(set(names)) < 2 or not apart.meet(*names):
            continue
        for struck, ball in names, names[::-1]:
            (plate, at), (other, k) = known[struck], known[ball]
            if not isinstance(plate, PlateSystem):
                continue
            speed = fall + float(np.linalg.norm(plate.speeds[at] - other.speeds[k]))
            law = law_of(scene, struck, ball)
            soft = law if law is not None and law.stiffness is not None else None
            yield _Strike(struck, ball, plate, other, at, k, speed, soft)


def _blows(model: "SolidsModel") -> Iterator[_Strike]:
    """Those of balls and points on single places of what bends, not of drums."""
    for strike in _strikes(model):
        alone = len(strike.other.nodes_of(strike.k)) == 1 and strike.speed > 0.0
        patched = strike.few.plate.patch_radius is not None
        if alone and not patched and not strike.few.is_taut(strike.width):
            yield strike
