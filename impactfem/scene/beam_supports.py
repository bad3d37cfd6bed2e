"""How the ends of beams are held."""

import math
from collections.abc import Sequence
from typing import ClassVar

from impactfem.scene.boundary import check_sprung
from impactfem.scene.given import MaybeFormulas
from impactfem.scene.inline import Formulas
from impactfem.scene.kinds import Choice, Real
from impactfem.scene.schema import KeyedError, key, table

ENDS = ("first", "last")
# Whether the end stays where it is, its section keeps its direction, and springs hold it.
HOLDS = {
    "clamped": (True, True, False),
    "simply_supported": (True, False, False),
    "free": (False, False, False),
    "elastic": (False, False, True),
}
# Roots of the characteristic equations of the Euler-Bernoulli beam, by what both ends hold.
_FIRST_ROOTS = {
    ((False, False), (False, False)): 4.730040744862704,
    ((False, False), (True, True)): 1.875104068711961,
    ((False, False), (True, False)): 3.926602312047919,
    ((True, False), (True, False)): math.pi,
    ((True, False), (True, True)): 3.926602312047919,
    ((True, True), (True, True)): 4.730040744862704,
}


@table("supports = [{ end = ... }]")
class BeamSupport:
    """How an end of a beam is held.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "support"

    end: str = key(Choice(ENDS), "which end: where the axis begins, or where it points")
    kind: str = key(
        Choice(tuple(HOLDS)),
        "clamped: neither moves nor turns; simply_supported: does not move, nor turn about the "
        "axis; free; elastic: on springs in all directions",
    )
    stiffness: float = key(
        Real(at_least=0), "of an elastic one to displacement", unit="N/m", default=0.0
    )
    rotational_stiffness: float = key(
        Real(at_least=0), "of an elastic one to rotation", unit="N m", default=0.0
    )
    motion: MaybeFormulas = key(
        Formulas(("t",)), "displacement of a clamped or simply supported end along the axes of the "
        "scene, by a joint BEAM_END, whose columns tell the force that it takes",
        unit="m", default=None, absent="none",
    )  # fmt: skip

    def _check(self) -> None:
        check_sprung(self, "end", sprung=HOLDS[self.kind][2])
        if self.motion is not None and not self.holds[0]:
            text = f' moves an end that is {self.kind}: give kind = "clamped" or '
            raise KeyedError(self.heading, "motion", f'{text}"simply_supported", or remove it.')

    @property
    def holds(self) -> tuple[bool, bool]:
        """Whether the end is where it is to be, and whether its section keeps its direction."""
        return HOLDS[self.kind][:2]

    @property
    def fixes(self) -> tuple[bool, bool]:
        """The same of what has no motion of its own; what has is held by a joint."""
        return self.holds if self.motion is None else (False, False)


def check_supports(supports: Sequence[BeamSupport], kind: str) -> None:
    """Refuse two of one end."""
    for index, support in enumerate(supports):
        if any(support.end == other.end for other in supports[:index]):
            text = f' = "{support.end}" is held twice: give each end one support.'
            raise KeyedError(kind, f"supports[{index}].end", text)


def first_root(supports: Sequence[BeamSupport]) -> float:
    """Of the lowest bending mode: (beta L) with omega = (beta L / L)^2 sqrt(EI / rho A).

    Springs count as free ends.
    """
    held = {support.end: support.holds for support in supports}
    first, last = sorted(held.get(end, (False, False)) for end in ENDS)
    return _FIRST_ROOTS[first, last]
