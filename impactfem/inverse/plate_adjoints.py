"""Derivatives of a run of one plate by its steps backwards; see `impactfem.inverse.solid_adjoints`.

Its coordinates are deflections and slopes, those without mass in equilibrium with the rest; its
loads are pressures at the vertices. What changes stiffness, mass or the start is found by runs
beside the run.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any, cast, override

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.contact_spells import Pair
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.solid_adjoints import Adjoints, Start
from impactfem.inverse.solid_readings import Kept, Numbers, Part
from impactfem.inverse.steps import Changes
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.reversed_march import Reading
from impactfem.marching.rows import Level
from impactfem.scene import Plate, Scene
from impactfem.system.kirchhoff import DOFS
from impactfem.system.loads import FormulaValues

if TYPE_CHECKING:
    from impactfem.inverse.solids import SolidRuns
    from impactfem.runs.solids import Ready
    from impactfem.system.plate import PlateSystem


@dataclass
class PlateKept(Kept):
    """What a march keeps of coordinates and rates."""

    @override
    def seen(self, level: Level) -> tuple[Floats, Floats]:
        interior = cast("PlateMidpoint", self.trail.march.interior)
        return interior.coordinates.copy(), interior.rates.copy()


class PlateAdjoints(Adjoints):
    """Derivatives of the numbers of a run; arguments as of `Adjoints`."""

    def __init__(
        self, runs: "SolidRuns", changes: Changes, quantities: Quantities, ready: "Ready",
        kept: Kept, pairs: Mapping[str, Pair],
    ) -> None:  # fmt: skip
        super().__init__(runs, changes, quantities, ready, kept, pairs)
        self._plate = cast("PlateMidpoint", self._march.interior).bodies

    @override
    def _numbers_of(self, *given: Any) -> Numbers:
        return PlateNumbers(*given)

    @override
    def _start_of(self, ready: "Ready") -> Start:
        start, interior = Start.of(ready), cast("PlateMidpoint", ready.seen.march.interior)
        return replace(start, place=interior.coordinates.copy(), velocity=interior.rates.copy())

    @override
    def _carried(self, load: Floats) -> Floats:
        """By pressures at the vertices, one after the other."""
        own = self._plate
        pushed = own.mesh.shares @ (own.transfer @ own.deflection(load))
        return np.concatenate([np.zeros(0), *(sign * pushed for sign, _ in own.loads)])

    @override
    def _loads(self, scene: Scene) -> Floats:
        """Pressures at the vertices in all layers [Pa], one after the other."""
        levels = np.arange(self._march.layers, dtype=np.float64)
        begin, end = self._spans(self._march.interior.dt * levels)
        points, (plate,) = self._plate.mesh.points, scene.bodies
        found = [np.zeros((self._march.layers, 0))]
        for load in cast("Plate", plate).pressures:
            values = FormulaValues(
                load.value, f"pressure on the {load.face}", points, fem.MPI.COMM_SELF
            )
            found.append(values.means(begin, end))
        return np.hstack(found)

    @override
    def _summed(self, values: Floats) -> Floats:
        """Each rank holds all of the plate."""
        return values

    @override
    def _alike(self, scene: Scene) -> bool:
        begun = scene.obstacles != self._scene.obstacles
        (plate,), (other,) = scene.bodies, self._scene.bodies
        for entry in fields(plate):
            one, two = getattr(plate, entry.name), getattr(other, entry.name)
            if one == two or not entry.init:
                continue
            if entry.name == "pressures" and [p.face for p in one] == [p.face for p in two]:
                continue
            if entry.name != "velocity":
                raise SceneError(f"{entry.name} is another")
            begun = True
        self._check_beside(scene, moved=False)  # its potential counts from its start
        return begun


class PlateNumbers(Numbers):
    """What the numbers of a run read; arguments as of `Numbers`."""

    @property
    def _interior(self) -> PlateMidpoint:
        return cast("PlateMidpoint", self._march.interior)

    @override
    def _probe(self, name: str, of: str) -> Part | None:
        bodies: PlateSystem = self._interior.bodies
        probe = next((each for each in self._scene.probes if each.name == name), None)
        if probe is None or of not in {f"{kind}{axis}" for kind in "uv" for axis in "xyz"}:
            return super()._probe(name, of)
        nodes, shares, _ = self._interior.shown.located(0, np.array(probe.point, dtype=np.float64))
        count = len(bodies.mesh.points)
        at = np.bincount(nodes % count, shares, count)
        at *= bodies.plate.frame[1][2]["xyz".index(of[1])]
        none = np.zeros(self._interior.dofs)
        if of[0] == "u":
            return partial(self._nodes, bodies.basis[::DOFS].T @ at, none)
        return partial(self._nodes, none, bodies.basis[::DOFS].T @ (bodies.transfer.T @ at))

    @override
    def _nodes(self, moved: Floats, moving: Floats, level: int, weight: float) -> None:
        """Coordinates and rates, by weights (d,) each."""
        place, rate = weight * moved, weight * moving
        pressed = self._march.gaps.relative(self._interior.pressed_by(place))
        multiplier = np.einsum("ij,ij->i", self._march.normals, pressed)

        def add(reading: Reading) -> None:
            reading.place += place
            reading.rate += rate
            reading.multiplier += multiplier

        self._put(level, add)

    @override
    def _energy(self, kind: str, level: int, weight: float) -> None:
        pulled, momentum = self._energies_by(*self._kept.state(level))
        none = np.zeros_like(pulled)
        each = (none, momentum) if kind == "kinetic" else (pulled, none)
        self._nodes(*each, level, weight)

    @override
    def _fixed(self, body: int, axis: int) -> bool:
        return False
