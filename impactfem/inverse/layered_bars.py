"""Bars by space-time layers of equal height, with derivatives by reversed sweeps."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.bar_adjoints import Adjoints
from impactfem.inverse.bars import apart, differences
from impactfem.inverse.held_sets import HeldSets, Marks, check_one_bar, rebound_level
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.marching.schemes import SCHEMES
from impactfem.planning import Plan
from impactfem.result.bar_motion import BarMotion
from impactfem.runs.bars import layers_of_mesh
from impactfem.scene import Scene

_MANY = 10  # numbers for each unknown, each a sweep, that still take less than runs beside it


@dataclass(frozen=True)
class LayeredBars(HeldSets):
    """Runs of galerkin's equations as planned, whoever solves them: nodes and courant stay.

    Attributes:
        nodes: As shares of the length, (n,).
        step: Height of a layer, as a share of the time that a wave takes along the bar.
    """

    nodes: Floats
    step: float

    @classmethod
    def of(cls, chosen: Plan[Any], scene: Scene) -> "LayeredBars":
        """On the elements of a plan, or on the user's mesh.

        Raises:
            SceneError: There are several bars, or feedback at the far end.
            MeshError: The mesh has no layers of equal height.
        """
        check_one_bar(chosen)
        if scene.bar.end_damping:
            raise SceneError(
                'solve.method = "galerkin": its derivatives know no feedback at the far end; '
                'give "exact"'
            )
        if scene.mesh_path is not None:
            travel, dt, _ = layers_of_mesh(scene, "galerkin")
            return cls(chosen, travel / scene.bar.length, dt / scene.bar.transit_time)
        elements = chosen.numbers.elements or 1
        nodes = np.linspace(0.0, 1.0, elements + 1)
        return cls(chosen, nodes, (chosen.numbers.courant or 1.0) / elements)

    def finer(self) -> "LayeredBars":
        """On elements half as large."""
        count = len(self.nodes)
        halves = np.interp(np.arange(0.0, count - 0.75, 0.5), np.arange(count), self.nodes)
        return replace(self, nodes=halves, step=0.5 * self.step)

    def _dt(self, scene: Scene) -> float:
        return self.step * scene.bar.transit_time

    def _layers(self, scene: Scene) -> int:
        """So many that neighbours, whose layers are a little lower, last as long."""
        return math.ceil(scene.duration / self._dt(scene) - 1e-9) + 1

    def march(self, scene: Scene, marks: Marks | None) -> BarMotion:
        """The motion, layer by layer."""
        from impactfem.marching.march import Marching, march  # noqa: PLC0415  (Numba)

        numbers, bar = self.chosen.numbers, scene.bar
        layers = self._layers(scene) if marks is None else len(marks)
        marching = Marching(
            self._dt(scene), layers, gamma=numbers.gamma, tolerance=numbers.tolerance, marks=marks
        )
        travel = bar.length * self.nodes
        return march(bar, scene.axial_gravity, travel, SCHEMES["galerkin"], marching)

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives, with the active set of the run.

        By a reversed sweep for each number; by differences where numbers are many more than
        unknowns, of unknowns that change the layers, before a wall that gives way and from rest.
        """
        scene = changes.scene
        motion = self.march(scene, None)
        marks = self.marks(scene, motion)
        read = self.reader(changes, quantities, marks)
        outcome = self.told(scene, quantities.times, motion)
        numbers = quantities.read(outcome, scene)
        many = len(numbers) > _MANY * len(changes.values)
        # What changes an equilibrium changes the start too.
        if many or scene.bar.wall_stiffness is not None or scene.starts_at_rest:
            return differences(changes, read)
        travel = scene.bar.length * self.nodes
        adjoints = Adjoints(changes, quantities, motion, marks, travel, self._dt)
        found = adjoints.jacobian(outcome, rebound_level(motion))
        if found is None:
            return differences(changes, read)
        (below, above), known = found
        if not known.all():
            some = changes.some(~known)
            rest = differences(some, self.reader(some, quantities, marks))
            below[:, ~known], above[:, ~known] = rest.sides or (rest.jacobian, rest.jacobian)
        return Slopes.of_sides(numbers, below, above, kinked=apart([below, above]))
