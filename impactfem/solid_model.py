"""The model of a solid in a scene: mesh, contact nodes and, when needed, the assembled system."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.contact.reach import reach
from impactfem.contact.surfaces import ContactNodes, contact_nodes
from impactfem.fem import MPI
from impactfem.mesh.body import BodyMesh, build_body_mesh
from impactfem.scene import PiecewiseVector, Scene, Solid
from impactfem.system.elastic import ElasticSystem, elastic_system


@dataclass(frozen=True)
class SolidModel:
    """A solid, meshed and distributed over the ranks.

    Attributes:
        comm: MPI communicator.
        scene: A scene with this model; its solver and output settings may be those of another run.
        degree: Degree of the elements.
        mesh: The mesh.
    """

    comm: Any
    scene: Scene
    degree: int
    mesh: BodyMesh

    @property
    def solid(self) -> Solid:
        """The body."""
        return self.scene.solid

    @property
    def gravity(self) -> PiecewiseVector:
        """Gravity of the scene [m/s^2]."""
        gravity = self.scene.gravity
        if isinstance(gravity, PiecewiseVector):
            return gravity
        return PiecewiseVector((0.0,), ((0.0,) * self.solid.dim,))

    @cached_property
    def system(self) -> ElasticSystem:
        """Mass, stiffness, supports and loads (collective at the first use)."""
        return elastic_system(self.solid, self.gravity, self.mesh)

    @cached_property
    def contact(self) -> ContactNodes:
        """Nodes that can touch an obstacle within the duration (collective at the first use)."""
        solid, system, gravity = self.solid, self.system, self.gravity
        speed = np.linalg.norm(system.velocity.reshape(-1, solid.dim), axis=1).max(initial=0.0)
        driven = None
        if solid.all_supports and any(support.kind == "motion" for support in solid.supports):
            driven = "moving supports"
        elif solid.tractions or solid.pressures:
            driven = "tractions or pressures"
        elif np.any([formula.plain != 0.0 for formula in solid.displacement]):
            driven = "an initial displacement"
        bound = reach(
            self.comm.allreduce(float(speed), op=MPI.MAX), gravity.times, gravity.values,
            self.scene.obstacles, self.scene.duration, driven=driven,
        )  # fmt: skip
        cuts = [s.surface for s in solid.all_supports if s.kind == "symmetry"]
        if solid.is_axisymmetric:
            cuts.append("axis")
        return contact_nodes(
            self.mesh, self.scene.obstacles, system.numbers, system.constrained,
            system.displacement, bound, name=solid.name, surfaces=solid.contact_surfaces,
            symmetry=[name for name in cuts if name in self.mesh.surfaces],
            thickness=solid.thickness, axisymmetric=solid.is_axisymmetric,
        )  # fmt: skip


def solid_model(scene: Scene, degree: int) -> SolidModel:
    """Mesh the solid of a scene (collective); the last model is kept for plan and run to share.

    Raises:
        MeshError: The mesh cannot be made, or does not fit the scene.
        MissingDependencyError: DOLFINx or Gmsh is not installed.
    """
    return _model(Key(scene), degree)


class Key:
    """A scene by what shapes its model: solver and output settings may change."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        parts = scene.to_dict()
        self._text = repr([scene.folder, *(parts[k] for k in sorted(set(parts) - _NOT_MODEL))])

    def __hash__(self) -> int:
        return hash(self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Key) and self._text == other._text


_NOT_MODEL = {"title", "solve", "output"}


@lru_cache(maxsize=1)
def _model(key: Key, degree: int) -> SolidModel:
    scene = key.scene
    mesh = build_body_mesh(MPI.COMM_WORLD, scene.solid, degree, scene.folder or Path())
    return SolidModel(MPI.COMM_WORLD, scene, degree, mesh)
