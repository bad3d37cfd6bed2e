"""Bodies without meshes as a run sees them, whatever steps them, and what shows them."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.findings import Finding
from impactfem.result.shapes import LINE, Shape
from impactfem.system.closest import closest_shares, distances
from impactfem.system.few import FewBodies

_NEAR = 1e-9  # share of a body's size by which a probe may lie off its axis


class Marched(ABC):
    """Bodies of one kind, as they are marched.

    Attributes:
        bodies: What moves.
        dt: Time step [s].
        shown: What files, pictures, probes and watches see of them.
    """

    bodies: FewBodies
    dt: float
    shown: "Shown[Any]"

    @property
    def stepper(self) -> Any:
        """What steps it: itself, or what steps other bodies with it."""
        return self

    @classmethod  # noqa: B027  (most are stepped alone)
    def step_together(cls, alike: Sequence["Marched"]) -> None:
        """Let bodies of this kind that nothing joins be stepped at once, where that is faster."""

    @property
    @abstractmethod
    def coordinates(self) -> Floats:
        """Q now, shape (d,)."""

    @property
    @abstractmethod
    def surface_displacement(self) -> Floats:
        """Of the contact nodes since t = 0 [m], (count, dim)."""

    @property
    @abstractmethod
    def surface_velocity(self) -> Floats:
        """Of the contact nodes [m/s], (count, dim)."""

    def apply(self, body: int, force: Floats, moment: Floats) -> bool:  # noqa: ARG002  (of others)
        """Hold a force (dim,) [N] and moment (turns,) [N m] from outside on a body's centre.

        Until it is given another one; whether it can.
        """
        return False

    def told(self) -> dict[str, dict[str, float]]:
        """Figures of a level besides those of bodies, by first and last part of their columns."""
        return {}

    def findings(self) -> Iterator[Finding]:
        """What was seen of limits of its model."""
        yield from ()


class Shown[M: Marched]:
    """What there is to see of bodies that touch with their contact nodes, joined by axes.

    Attributes:
        measure: What a depth of what contact nodes do not guard is compared with.
        components: Of fields that `motion` gives besides those of all bodies, by name.
    """

    measure = "length"
    components: Mapping[str, int] = {}

    def __init__(self, march: M) -> None:
        """Look at bodies where they are at t = 0."""
        self._march = march
        self._start = march.bodies.places(march.bodies.position)

    @property
    def _bodies(self) -> FewBodies:
        return self._march.bodies

    def shape(self, body: int) -> tuple[Floats, Floats, Integers]:
        """What a body looks like at rest: places [m], radii [m], and nodes joined by lines."""
        own, bodies = self._bodies.nodes_of(body), self._bodies
        return self._start[own], bodies.radius[own], bodies.lines_of(body)

    def drawn(self, body: int, name: str) -> Shape:
        """The same for files and pictures: balls, and axes between nodes."""
        places, radius, lines = self.shape(body)
        if len(lines):
            return Shape(name, places, lines, LINE, radius)
        return Shape.vertices(name, places, radius)

    def material(self, body: int) -> Floats:
        """Places of the same nodes as probes are given, shape (nodes, dim)."""
        return self.shape(body)[0]

    def located(self, body: int, point: Floats) -> tuple[Integers, Floats, bool]:
        """Nodes of a body near a place (dim,) as of `material`, their weights, if it is inside."""
        _, radius, lines = self.shape(body)
        places = self.material(body)
        simplices = lines if len(lines) else np.zeros((1, 1), dtype=np.int64)
        shares = closest_shares(point[None], places[simplices])
        _, away = distances(point[None], places[simplices], shares)
        at = int(np.argmin(away[0]))
        room = float(radius[simplices[at]].max()) + _NEAR * float(np.ptp(places) or 1.0)
        return simplices[at], shares[0, at], bool(away[0, at] <= room)

    def motion(self, body: int) -> dict[str, Floats]:
        """Fields of a body at these nodes now: displacement [m], velocity [m/s], (nodes, dim)."""
        own = self._bodies.nodes_of(body)
        return {
            "displacement": self._march.surface_displacement[own],
            "velocity": self._march.surface_velocity[own],
        }

    def acting(self, body: int, forces: Floats) -> Floats:
        """Contact forces [N] on these nodes by those on all contact nodes, (nodes, dim) each."""
        return np.asarray(forces[self._bodies.nodes_of(body)])

    def stress(self, body: int) -> Floats:  # noqa: ARG002  (of bars)
        """Axial stress at these nodes [Pa], (nodes,); NaN if it is not known."""
        return np.full(1, np.nan)

    # ---- where obstacles may pass unseen -------------------------------------------------------

    def unguarded(self, lines: Integers) -> tuple[Floats, float]:
        """Where obstacles may pass between contact nodes now, and how near they may come.

        Args:
            lines: Contact nodes joined by axes, (lines, 2).

        Returns:
            Corners of lines or triangles [m], (several, corners, dim), and a distance [m].
        """
        return self._bodies.places(self._march.coordinates)[lines], 0.0

    @property
    def nodes_sink(self) -> bool:
        """Whether contact nodes sink in as their law has it; deeper between them is none of it."""
        return False

    def unguarded_in_words(self, lines: Integers) -> tuple[float, str, str]:
        """Size [m] that a depth is compared with, what lies so deep, and what helps."""
        nodes = self._bodies.places(self._bodies.position)[lines]
        length = float(np.linalg.norm(nodes[:, 1] - nodes[:, 0], axis=1).sum())
        remedy = 'model it as a solid, or as a beam with contact = "along"'
        return length, "the axis of {name} lies", remedy
