"""Bars on any triangles of space-time; derivatives by differences with the active set kept.

The mesh of the start is kept in seconds and shares of the length: impacts pass it as parameters
change, and what is read stays on it.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, MeshError, SceneError
from impactfem.inverse.held_sets import HeldSets, Marks, check_one_bar
from impactfem.inverse.layered_bars import LayeredBars
from impactfem.inverse.quantities import Quantities
from impactfem.inverse.steps import Changes, Slopes
from impactfem.planning import Plan
from impactfem.result.bar_motion import BarMotion, Effort
from impactfem.runs.bars import discontinuous_settings, monolithic_mesh, monolithic_settings
from impactfem.scene import Scene

if TYPE_CHECKING:
    from impactfem.mesh.spacetime import SpaceTimeMesh
    from impactfem.spacetime.discontinuous import DiscontinuousSettings


_BESIDE = 1e-4  # share of an unknown over which is looked whether times move
_SAME = 1e-9  # share of the duration by which times may differ that are the same


@dataclass(frozen=True)
class MonolithicBars(HeldSets):
    """Runs of the founding equations on a user's mesh.

    Attributes:
        start: The scene that the mesh is made for.
        space: The mesh, whose time is that of the last run.
        times: First coordinates of its nodes in the start's own time, (nodes,).
    """

    start: Scene
    space: "SpaceTimeMesh"
    times: Floats

    @classmethod
    def of(cls, chosen: Plan[Any], scene: Scene) -> HeldSets:
        """By layers where those have one height, of which a sweep has the same solution."""
        try:
            return LayeredBars.of(chosen, scene)
        except MeshError:
            space = monolithic_mesh(scene)
            return cls(chosen, scene, space, space.mesh.geometry.x[:, 0].copy())

    def march(self, scene: Scene, marks: Marks | None) -> BarMotion:
        """The motion, by one system for the whole interval.

        Raises:
            ConvergenceError: Its active set does not settle.
        """
        from impactfem.spacetime.galerkin import solve_galerkin  # noqa: PLC0415  (DOLFINx)

        settings = replace(monolithic_settings(self.chosen), active_set="pdas")
        space = self._timed(self.start.bar.transit_time / scene.bar.transit_time)
        motion = solve_galerkin(space, scene.bar, scene.axial_gravity, settings, marks=marks)
        if not motion.effort.converged:
            raise ConvergenceError(f"solve.mesh: {motion.effort.message}")
        return motion

    def _timed(self, share: float) -> "SpaceTimeMesh":
        """The mesh in the time of another run; one object, since files are slow to read.

        Raises:
            SceneError: Solutions on it grow.
        """
        from impactfem.spacetime.stability import refuse_growth  # noqa: PLC0415  (DOLFINx)

        layout, path = self.space.layout, self.start.mesh_path
        self.space.mesh.geometry.x[:, 0] = share * self.times
        times = None if layout.times is None else share * layout.times
        space = replace(self.space, layout=replace(layout, times=times))
        if path is not None and share != 1.0:
            try:
                refuse_growth(space, path)
            except MeshError as error:  # no neighbour, as others that cannot be
                raise SceneError(str(error)) from error
        return space

    def finer(self) -> HeldSets:
        """On uniform layers half as high as the elements are long."""
        elements = 2 * (len(self.march(self.start, None).positions) - 1)
        return LayeredBars(self.chosen, np.linspace(0.0, 1.0, elements + 1), 1.0 / elements)


@dataclass(frozen=True)
class DiscontinuousBars(HeldSets):
    """Runs of the discontinuous Galerkin method.

    Attributes:
        start: The scene that the mesh is made for.
        settings: Numbers of the method.
        points: Nodes of the mesh (t [s], x / L), (nodes, 2).
        cells: Nodes of each triangle, (cells, 3).
    """

    start: Scene
    settings: "DiscontinuousSettings"
    points: Floats
    cells: NDArray[np.int64]

    @classmethod
    def of(cls, chosen: Plan[Any], scene: Scene) -> "DiscontinuousBars":
        """On the mesh of a plan, or the user's.

        Raises:
            SceneError: There are several bars, or the mesh would follow the motion.
        """
        from impactfem.fem import MPI  # noqa: PLC0415  (loads slowly)
        from impactfem.spacetime.discontinuous import first_mesh  # noqa: PLC0415

        check_one_bar(chosen)
        remedy = 'or take solve.method = "exact"'
        if chosen.numbers.fitted:
            raise SceneError(
                "solve.fitted: a fitted mesh has lines where impacts are, which parameters move, "
                f"so that runs beside have other equations; set fitted = false, {remedy}"
            )
        if scene.solve.accuracy is not None:
            raise SceneError(
                f"solve.accuracy = {scene.solve.accuracy:g}: its mesh is refined where the motion "
                "of each run needs it, so that runs beside have other equations; give "
                f"solve.elements instead, {remedy}"
            )
        bar, settings = scene.bar, discontinuous_settings(scene, chosen)
        duration = scene.duration / bar.transit_time
        mesh = first_mesh(MPI.COMM_WORLD, bar, scene.axial_gravity, duration, settings)
        return cls(chosen, scene, settings, mesh.points * [bar.transit_time, 1.0], mesh.cells)

    def march(self, scene: Scene, marks: Marks | None) -> BarMotion:
        """The motion, by sweeps along the waves."""
        from impactfem.mesh.unstructured import Triangulation  # noqa: PLC0415  (DOLFINx)
        from impactfem.spacetime.motion import motion_of_waves  # noqa: PLC0415
        from impactfem.spacetime.reflections import BarWaves  # noqa: PLC0415
        from impactfem.spacetime.sweep import DECIDE  # noqa: PLC0415

        settings, bar, gravity = self.settings, scene.bar, scene.axial_gravity
        mesh = Triangulation(self.points / [bar.transit_time, 1.0], self.cells)
        problem = BarWaves.of_bar(mesh, settings.degree, bar, gravity)
        if marks is None:
            marks = np.full(len(problem.active), DECIDE, dtype=np.int8)
        problem.solve(marks, settings.tolerance * problem.scale)
        return motion_of_waves(problem, Effort(), bar, gravity, settings.elements, 1)

    def jacobian(self, changes: Changes, quantities: Quantities) -> Slopes:
        """Numbers of a run and their derivatives, with the active set of the run.

        Raises:
            SceneError: An unknown moves a time at which a load jumps: points at which loads are
                read lie on one side of it, so that nothing would follow.
        """
        lines = self._lines(changes.scene)
        for k, name in enumerate(changes.names):
            for beside in changes.neighbours(k, _BESIDE, self._lines)[0]:
                moved = len(lines) == len(beside)  # else two pieces have become equal, or unequal
                if (
                    moved
                    and np.abs(beside - lines).max(initial=0.0) > _SAME * changes.scene.duration
                ):
                    raise SceneError(
                        f'{name}: moves a time at which a load changes, which solve.method = "dg" '
                        'does not follow; use solve.method = "exact"'
                    )
        return super().jacobian(changes, quantities)

    def _lines(self, scene: Scene) -> Floats:
        """Times at which loads change [s]."""
        from impactfem.spacetime.discontinuous import switches  # noqa: PLC0415  (DOLFINx)

        return switches(scene.bar, scene.axial_gravity, scene.duration)

    def finer(self) -> HeldSets:
        """There is none to ask for: its bars have exact solutions."""
        return self
