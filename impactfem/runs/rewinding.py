"""States of a march, to which it can go back or on: bit by bit the same steps follow."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.runs.observed import Observed


@dataclass(frozen=True)
class State:
    """All that the next step of a simulation needs, of this rank; made by `Simulation.state`.

    Attributes:
        layer: Number of steps done.
        inside: Of the bodies.
        memory: Of contact and of bodies without meshes.
        asked: Contact nodes whose answers are known.
        seen: What was looked at.
        rows: What the steps have left, by name.
        pushed: Whether forces from outside have acted.
    """

    layer: int
    inside: Mapping[str, Any]
    memory: Mapping[str, Any]
    asked: Any
    seen: Mapping[str, float | str]
    rows: Mapping[str, Floats]
    pushed: bool = False

    @classmethod
    def of(cls, seen: Observed, *, pushed: bool = False) -> "State":
        """That of a march and of what has looked at it (collective)."""
        march = seen.march
        if seen.touching is not None:
            seen.touching.sum_up()
        rows = {e.name: getattr(march.rows, e.name)[: march.layer + 1] for e in fields(march.rows)}
        return cls(
            march.layer,
            _copied(march.interior.state()),
            _copied(march.memory()),
            np.array(march.asked),
            seen.state(),
            _copied(rows),
            pushed,
        )

    def fits(self, seen: Observed) -> bool:
        """Whether it is one of this march."""
        march = seen.march
        rows = {e.name: getattr(march.rows, e.name)[:1] for e in fields(march.rows)}
        own = [rows, march.memory(), march.interior.state()]
        given = [{n: v[:1] for n, v in self.rows.items()}, self.memory, self.inside]
        return self.layer <= march.layers and [*map(_shapes, own)] == [*map(_shapes, given)]

    def restore(self, seen: Observed) -> None:
        """Have the march go on from it."""
        march = seen.march
        if seen.touching is not None:
            seen.touching.seen.clear()
        for entry in fields(march.rows):
            values = getattr(march.rows, entry.name)
            values[: self.layer + 1] = self.rows[entry.name]
            values[self.layer + 1 :] = 0
        march.restore(_copied(self.inside), _copied(self.memory), self.asked, self.layer)
        seen.restore(dict(self.seen))


def _copied(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: np.array(value) for name, value in values.items()}


def _shapes(values: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
    return {name: np.shape(value) for name, value in values.items()}
