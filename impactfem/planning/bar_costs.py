"""What the solution of a bar costs: unknowns, contact pairs, memory and time, before it is made."""

from dataclasses import dataclass
from pathlib import Path

from impactfem.methods import Method
from impactfem.scene import Scene
from impactfem.sizing import (
    DEFAULT_ELEMENTS,
    Grid,
    discontinuous_cost,
    marching_cost,
    monolithic_cost,
)

# Triangles with edges of about h in a unit square over 1 / h^2: of equilateral ones
# 4 / sqrt(3) = 2.31; measured 2.31 to 2.73, the most with many fronts on coarse meshes.
_TRIANGLES = 2.35


@dataclass(frozen=True)
class Cost:
    """What a solution takes; None where only the run decides.

    Attributes:
        unknowns: Values computed; with dg on meshes made in the run to two digits.
        contact_pairs: Complementarity pairs.
        memory_mib: Peak memory [MiB].
        seconds: Time [s] on a 2-core machine.
    """

    unknowns: int | None = None
    contact_pairs: int | None = None
    memory_mib: float | None = None
    seconds: float | None = None


def cost_of_bar(scene: Scene, method: Method, grid: Grid, degree: int, passes: int) -> Cost:
    """Count or estimate; a space-time mesh of the user is read for it.

    Args:
        scene: Scene of one bar.
        method: Method chosen.
        grid: Elements and layers; empty with a mesh file.
        degree: Polynomial degree of method dg.
        passes: Linear solves expected of one active-set loop.

    Raises:
        MeshError: The mesh file cannot be used.
        SceneError: It needs more memory than the machine has.
    """
    every = scene.output.stride
    if method.exact:
        return Cost(0, None, *marching_cost(grid, every, 20))
    if not method.layered:
        if scene.solve.accuracy is not None:  # refined until it is reached
            return Cost()
        triangles, pairs = _triangles(scene, grid)
        unknowns = triangles * (degree + 1) * (degree + 2)
        return Cost(unknowns, pairs, *discontinuous_cost(triangles, unknowns))
    if scene.mesh_path is not None:
        nodes, _, pairs = _counts(scene, scene.mesh_path)
        # A file without layers is refused by the marching methods, when they run.
        grid = Grid(max(1, nodes // (pairs + 1) - 1), pairs)
    elif grid.elements and grid.layers:
        nodes, pairs = (grid.layers + 1) * (grid.elements + 1), grid.layers
    else:
        return Cost()
    unknowns = nodes + pairs
    if method.assembled:
        return Cost(unknowns, pairs, *monolithic_cost(unknowns, passes))
    return Cost(unknowns, pairs, *marching_cost(grid, every, passes))


def _triangles(scene: Scene, grid: Grid) -> tuple[int, int]:
    """Triangles and edges of the wall of method dg: counted in the file, else estimated."""
    if scene.mesh_path is not None:
        _, triangles, pairs = _counts(scene, scene.mesh_path)
        return triangles, pairs
    elements, transits = grid.elements or DEFAULT_ELEMENTS, scene.duration / scene.bar.transit_time
    return round(float(f"{_TRIANGLES * elements**2 * transits:.2g}")), round(elements * transits)


def _counts(scene: Scene, path: Path) -> tuple[int, int, int]:
    """Nodes, triangles and edges of the wall of the user's mesh, the same on every rank.

    Raises:
        MeshError: The file cannot be used.
    """
    from impactfem.fem import MPI  # noqa: PLC0415  (loads slowly, and few scenes bring a mesh)
    from impactfem.mesh.files import read_mesh  # noqa: PLC0415

    bar = scene.bar
    space = read_mesh(MPI.COMM_SELF, path, bar.length, scene.duration, bar.wave_speed)
    topology = space.mesh.topology
    nodes, triangles = (topology.index_map(dim).size_global for dim in (0, 2))
    return nodes, triangles, len(space.facets("wall"))
