"""What drawings need to know of a body without a mesh, whatever it is."""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable


@runtime_checkable
class Ball(Protocol):
    """A body that is a ball, or a point."""

    @property
    def name(self) -> str:
        """Of the body."""

    @property
    def position(self) -> Sequence[float]:
        """Of its centre at t = 0 [m]."""

    @property
    def velocity(self) -> Sequence[float] | None:
        """At t = 0 [m/s]."""

    @property
    def radius(self) -> float:
        """[m], 0 of a point."""

    @property
    def springs(self) -> Sequence[Any]:
        """What pulls it."""
