"""Probes of a scene: places whose motion is kept in the history."""

from collections.abc import Iterable, Sequence
from typing import ClassVar

from impactfem.errors import SceneError
from impactfem.scene.inline import Vector
from impactfem.scene.kinds import Choices, Name
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

MAX_PROBES = 100
MOVES = ("displacement", "velocity")
"""What is known of every body."""
STRAINS = (*MOVES, "stress")
"""What is known of bodies with stresses at every place."""


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
        "place of the body's material at t = 0; of a bar [x] from its near end",
        unit="m",
    )
    quantities: Sequence[str] = key(
        Choices(STRAINS), "what is kept; stress of solids and bars", default=MOVES
    )

    def _check(self) -> None:
        if not self.quantities:
            raise KeyedError(self.heading, "quantities", " = [] keeps nothing: name one or more.")


def outside(index: int, probe: Probe, near: Iterable[float]) -> SceneError:
    """The error of a probe that is outside its body.

    Args:
        index: Its place in the scene.
        probe: The probe.
        near: A place of the body near it [m].
    """
    place = ", ".join(f"{value:.6g}" for value in near)
    return SceneError(
        f"probe[{index}].point = {show(list(probe.point))} is outside the body "
        f"{show(probe.body)}: the nearest point that is known is [{place}]; give a place in it"
    )
