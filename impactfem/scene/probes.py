"""Probes of a scene: places whose motion is kept in the history."""

import math
from collections.abc import Iterable, Sequence
from typing import ClassVar

from impactfem.errors import SceneError
from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Choice, Choices, Name
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

MAX_PROBES = 100
MOVES = ("displacement", "velocity", "acceleration")
"""What is known of every body."""
STRAINS = (*MOVES, "stress")
"""What is known of bodies with stresses at every place."""
FILTERS = {f"CFC{number}": float(number) for number in (60, 180, 600, 1000)}
"""Frequency [Hz] of each channel frequency class of SAE J211."""


@table("[[probe]]")
class Probe:
    """A place of a body whose motion is kept in the history.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "probe"

    name: str = key(Name(), "name of the probe in columns such as NAME.ux")
    body: str = key(Name(), "name of the body")
    point: Sequence[float] = key(
        Vector((1, 2, 3)),
        "place of the body's material at t = 0, undeformed if that is found as an equilibrium; of "
        "a bar [x] from its near end",
        unit="m",
    )
    quantities: Sequence[str] = key(
        Choices(STRAINS),
        "what is kept; acceleration: mean over the step; stress of solids and bars",
        default=MOVES[:2],
    )
    filter: str | None = key(
        Choice(FILTERS),
        "channel frequency class of SAE J211 by which accelerations are filtered (default: none)",
        default=None,
    )

    @property
    def watched(self) -> tuple[str, ...]:
        """What a run has to look at: accelerations are made of velocities."""
        found = ("velocity" if name == "acceleration" else name for name in self.quantities)
        return tuple(dict.fromkeys(found))

    def _check(self) -> None:
        if not self.quantities:
            raise KeyedError(self.heading, "quantities", " = [] keeps nothing: name one or more.")
        if self.filter is not None and "acceleration" not in self.quantities:
            text = f' = {show(self.filter)} filters accelerations only: add "acceleration" to '
            raise KeyedError(self.heading, "filter", f"{text}quantities, or leave it out.")


def outside(index: int, probe: Probe, near: Iterable[float]) -> SceneError:
    """The error of a probe that is outside its body.

    Args:
        index: Its place in the scene.
        probe: The probe.
        near: A place of the body near it [m].
    """
    known = list(near)
    place = ", ".join(f"{value:.6g}" for value in known)
    return SceneError(
        f"probe[{index}].point = {show(list(probe.point))} is outside the body "
        f"{show(probe.body)}: the nearest point that is known is [{place}], "
        f"{math.dist(known, probe.point):.3g} m away; give a place in it"
    )
