"""Forces and moments on ends of beams."""

from typing import ClassVar

from impactfem.scene.beam_supports import ENDS
from impactfem.scene.given import MaybeFormulas
from impactfem.scene.inline import Formulas
from impactfem.scene.kinds import Choice
from impactfem.scene.schema import KeyedError, key, table


@table("end_loads = [{ end = ... }]")
class EndLoad:
    """A force and a moment on an end of a beam, along the axes of the scene.

    Raises:
        SceneError: neither is given.
    """

    heading: ClassVar[str] = "end_load"

    end: str = key(Choice(ENDS), "which end: where the axis begins, or where it points")
    force: MaybeFormulas = key(
        Formulas(("t", "u")), "one formula for each axis; u the displacement of the end along it",
        unit="N", default=None, absent="none",
    )  # fmt: skip
    moment: MaybeFormulas = key(
        Formulas(("t",), lengths=(1, 3)), "about the end; in the plane one formula, about z",
        unit="N m", default=None, absent="none",
    )  # fmt: skip

    def _check(self) -> None:
        if self.force is None and self.moment is None:
            raise KeyedError(self.heading, "force", " is missing: give force, moment, or both.")
