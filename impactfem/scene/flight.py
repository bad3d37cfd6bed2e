"""How a body flies that nothing turns, loads or holds."""

from collections.abc import Sequence
from typing import NamedTuple


class Flight(NamedTuple):
    """A box around a body in any rotation that it may take, and its velocity at t = 0.

    Attributes:
        half: Half its edges [m], (dim,).
        center: Its centre at t = 0 [m], (dim,).
        velocity: [m/s], (dim,).
    """

    half: Sequence[float]
    center: Sequence[float]
    velocity: Sequence[float]
