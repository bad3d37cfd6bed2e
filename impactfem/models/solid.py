"""The model of a solid in a scene: mesh, contact nodes and, when needed, the assembled system."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from impactfem.contact.boundary import Boundary, boundary
from impactfem.contact.surfaces import ContactNodes
from impactfem.fem import MPI
from impactfem.mesh.body import BodyMesh, build_body_mesh
from impactfem.models.key import SceneKey
from impactfem.models.solid_contact import contact_of, reach_of
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
        return self.scene.vector_gravity

    @cached_property
    def system(self) -> ElasticSystem:
        """Mass, stiffness, supports and loads (collective at the first use)."""
        return elastic_system(self.solid, self.gravity, self.mesh)

    @cached_property
    def outside(self) -> Boundary:
        """Its faces, on every rank (collective at the first use)."""
        solid = self.solid
        return boundary(self.mesh, thickness=solid.thickness, axisymmetric=solid.is_axisymmetric)

    @cached_property
    def contact(self) -> ContactNodes:
        """Nodes that can touch an obstacle within the duration (collective at the first use)."""
        solid, system, obstacles = self.solid, self.system, self.scene.obstacles
        bound = reach_of(self.comm, self.scene, solid, system, obstacles)
        return contact_of(self.comm, solid, system, self.outside, obstacles, bound)


def solid_model(scene: Scene, degree: int) -> SolidModel:
    """Mesh the solid of a scene (collective); the last model is kept for plan and run to share.

    Raises:
        MeshError: The mesh cannot be made, or does not fit the scene.
        MissingDependencyError: DOLFINx or Gmsh is not installed.
    """
    return _model(SceneKey(scene), degree)


@lru_cache(maxsize=1)
def _model(key: SceneKey, degree: int) -> SolidModel:
    scene = key.scene
    mesh = build_body_mesh(MPI.COMM_WORLD, scene.solid, degree, scene.folder or Path())
    return SolidModel(MPI.COMM_WORLD, scene, degree, mesh)
