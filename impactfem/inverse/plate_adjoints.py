"""Derivatives of a run of one plate by its steps backwards; see `impactfem.inverse.solid_adjoints`.

Its coordinates are deflections and slopes, those without mass in equilibrium with the rest; its
loads are pressures at the vertices. Stiffness and mass of its triangles are changed by whatever
makes these, its thickness at the vertices also by half of it what gaps are.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import TYPE_CHECKING, Any, cast, override

import numpy as np

from impactfem import fem
from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.contact_spells import Pair
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.solid_adjoints import Adjoints, Start, materials
from impactfem.inverse.solid_readings import Kept, Numbers, Part
from impactfem.inverse.steps import Changes
from impactfem.marching.layers import MaterialSums
from impactfem.marching.plate import PlateMidpoint
from impactfem.marching.reversed_march import Reading
from impactfem.marching.rows import Level
from impactfem.scene import Plate, Scene
from impactfem.system.kirchhoff import DOFS
from impactfem.system.loads import FormulaValues
from impactfem.system.plate_making import thicknesses
from impactfem.system.plate_slopes import PlateSlopes, plate_numbers

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

    _loading = ("pressures",)

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
    def _loads(self, scene: Scene, there: Any = None) -> Floats:
        """Pressures at the vertices in all layers [Pa], one after the other."""
        levels = np.arange(self._march.layers, dtype=np.float64)
        begin, end = self._spans(self._march.interior.dt * levels)
        points, (plate,) = self._plate.mesh.points, scene.bodies
        found = [np.zeros((self._march.layers, 0))]
        for load in cast("Plate", plate).pressures:
            values = FormulaValues(
                load.acting, f"pressure on the {load.face}", points, fem.MPI.COMM_SELF
            )
            found.append(values.means(begin, end))
        return np.hstack(found)

    @override
    def _summed(self, values: Floats) -> Floats:
        """Each rank holds all of the plate."""
        return values

    @override
    def _sums(self) -> Sequence[MaterialSums]:
        return [PlateSlopes(self._plate)]

    @override
    def _whole(self, each: Iterable[Floats]) -> Floats:
        """Each rank holds all of the plate."""
        (one,) = each
        return one

    @override
    def _material(self, scene: Scene, nodes: Any = None) -> Floats:
        (plate,) = scene.bodies
        return plate_numbers(cast("Plate", plate), self._plate.mesh, shears=self._plate.shears)

    @override
    def _made(self, by: Floats, numbers: Floats) -> Floats:
        """Of stiffness, mass and rotary inertia, (3, cells)."""
        each = by * numbers
        return np.vstack([each[:-2].sum(axis=0), each[-2:]])

    @override
    def _cell_spans(self) -> tuple[Floats, Floats]:
        mesh = self._plate.mesh
        x = mesh.points[mesh.cells, 0]
        return x.min(axis=1), x.max(axis=1)

    @property
    @override
    def _gap_spans(self) -> dict[str, tuple[Floats, Floats]]:
        if self._base is None:
            return {}
        x = self._of_gaps(self._plate.mesh.points[self._plate.touch, 0])
        return {"x": (x, x)}

    def _of_gaps(self, values: Floats) -> Floats:
        """Values of the vertices that may touch (touching,) at the gaps, (gaps,)."""
        normal = self._plate.plate.frame[1][2]
        return np.asarray(self._march.gaps.relative(np.outer(values, normal)) @ normal)

    @override
    def _started(self, scene: Scene) -> Start:
        """Gaps of planes are less by half of the thickness."""
        (plate,) = scene.bodies
        if self._base is None:
            return self._start
        thickness = thicknesses(cast("Plate", plate), self._plate.mesh)
        more = 0.5 * (thickness - self._plate.thickness)[self._plate.touch]
        return replace(self._start, gap=self._start.gap - self._of_gaps(more))

    @override
    def _check_material(self, solid: Any, other: Any) -> None:
        """See `Adjoints._check_material`."""
        if self._base is None:
            raise SceneError("its material is another")
        if solid.damping_ratio or solid.quality_factor:
            raise SceneError("its damping is another")
        if solid.theory_beside(self._scene.bodies) != other.theory_beside(self._scene.bodies):
            raise SceneError("its theory is another")
        thicker = solid.thickness != other.thickness or solid.layers != other.layers
        if (solid.density != other.density or thicker) and self._numbers.levels:
            raise SceneError("its potential begins elsewhere")

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
            if entry.name in materials(plate):
                self._check_material(plate, other)
                moved = cast("Plate", plate).displacement
                begun |= not (moved.is_constant and float(moved()) == 0.0)
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
        state, strains = self._kept.state(level), kind == "elastic"
        pulled, momentum = self._energies_by(*state)
        none = np.zeros_like(pulled)
        self._nodes(*((pulled, none) if strains else (none, momentum)), level, weight)
        own = state[0 if strains else 1]
        self._products(level, 0.5 * weight * own, own, stiff=strains)

    @override
    def _heavier(self, order: int, body: int, axis: int, level: int, weight: float) -> None:
        if self.into is None:
            return
        bodies, into = self._interior.bodies, cast("PlateSlopes", self.into[body])
        center, axes = bodies.plate.frame
        moved = self._kept.state(level)[order]
        mean = self._history[level, body, 3 + 3 * (1 - order) + axis] / bodies.masses[0]
        if not order:
            moved = moved - self._kept.state(0)[0]
            into.weigh_vertices(weight * (center[axis] + bodies.mesh.points @ axes[:2, axis]))
            mean += bodies.centers[0][axis]
        into.weigh(weight * axes[2, axis] * moved)
        into.weigh_whole(-weight * mean)

    @override
    def _fixed(self, body: int, axis: int) -> bool:
        return False
