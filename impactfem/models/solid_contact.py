"""With which nodes a solid can touch the obstacles of its scene within the duration."""

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.contact.boundary import Boundary
from impactfem.contact.reach import Reach, reach
from impactfem.contact.surfaces import ContactNodes, contact_nodes
from impactfem.errors import SceneError
from impactfem.fem import MPI
from impactfem.scene import Scene, Solid
from impactfem.scene.pairing import named_body_pairs, surfaces_on
from impactfem.system.elastic import ElasticSystem

Floats = NDArray[np.float64]

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart

_GROWTH = 2.0  # of the ball around a body, as it deforms


class Neighbours:
    """Which solids of a scene may meet within its duration.

    Where nothing but gravity adds to the energy E of all bodies, no centre of mass is faster than
    (2 E / m)^(1/2), and gravity adds at most g (2 E sum(m))^(1/2) in a second. A body too far
    to be met changes nothing of the others then, neither their masses nor their steps.
    """

    def __init__(self, scene: Scene, parts: "Sequence[SolidPart]") -> None:
        """Of the solids of a scene, which may be meshed later."""
        self._scene, self._parts = scene, parts

    @cached_property
    def pairs(self) -> frozenset[frozenset[str]]:
        """Names of two solids that may meet, or of one that may meet itself (collective)."""
        every = named_body_pairs(self._scene)
        named = {frozenset((one, two)) for _, (one, _), (two, _) in every}
        return frozenset(pair for pair in named if len(pair) == 1 or not self._far(*pair))

    def of(self, name: str) -> bool:
        """Whether other bodies may strike one."""
        others = len(self._scene.bodies) - len(self._parts)
        return others > 0 or any(name in pair and len(pair) == 2 for pair in self.pairs)

    def _far(self, one: str, two: str) -> bool:
        ways = self._ways
        if not {one, two} <= ways.keys():
            return False
        (first, near), (second, far) = ways[one], ways[two]
        return float(np.linalg.norm(second - first)) > near + far

    @cached_property
    def _ways(self) -> dict[str, tuple[Floats, float]]:
        """Centre of each body [m] and how far from there it may be; none without a bound."""
        scene, parts = self._scene, self._parts
        if len(parts) < len(scene.bodies) or len(parts) == 1:
            return {}
        if any(_driven(scene, part.solid, part.obstacles) for part in parts) or any(
            obstacle.moves for obstacle in scene.obstacles
        ):
            return {}
        masses = np.array([part.system.total_mass for part in parts])
        speeds = np.array([_speed(part.comm, part.solid, part.system) for part in parts])
        pull = np.linalg.norm(np.atleast_2d(scene.vector_gravity.values), axis=1).max()
        # (2 E)^(1/2), which grows by `gain` in a second.
        root, gain = np.sqrt(masses @ speeds**2), pull * np.sqrt(masses.sum())
        ways = scene.duration * (root + 0.5 * gain * scene.duration) / np.sqrt(masses)
        found = {}
        for part, way in zip(parts, ways, strict=True):
            center = np.asarray(part.system.center_of_mass)
            around = float(np.linalg.norm(part.places - center, axis=1).max(initial=0.0))
            found[part.solid.name] = center, float(way) + _GROWTH * around
        return found


def _speed(comm: Any, solid: Solid, system: ElasticSystem) -> float:
    """Largest speed of a node at t = 0 [m/s] (collective)."""
    speeds = np.linalg.norm(system.velocity.reshape(-1, solid.dim), axis=1)
    return float(comm.allreduce(float(speeds.max(initial=0.0)), op=MPI.MAX))


def reach_of(part: "SolidPart") -> Reach:
    """Bound of the way of a solid within the duration of its scene (collective)."""
    scene, solid = part.scene, part.solid
    driven = _driven(scene, solid, part.obstacles)
    if driven is None and part.neighbours.of(solid.name):
        driven = "other bodies that strike it"
    gravity = scene.vector_gravity
    return reach(
        _speed(part.comm, solid, part.system), gravity.times, gravity.values, part.obstacles,
        scene.duration, driven=driven,
    )  # fmt: skip


def surfaces_of(scene: Scene, solid: Solid, obstacles: Sequence[Any]) -> Sequence[str] | None:
    """Surfaces of a solid that may touch its obstacles; None for all that can.

    Raises:
        SceneError: Contact laws name other surfaces for one obstacle than for another: each node is
            held off the nearest of all.
    """
    named = {
        tuple(sorted(name for name in surfaces_on(scene, solid.name, obstacle.name) or ("",)))
        for obstacle in obstacles
    }
    if len(named) > 1:
        first, second = (
            " and ".join(f"{solid.name}/{name}" if name else solid.name for name in names)
            for names in sorted(named)[:2]
        )
        raise SceneError(
            f"contact.between: {first} meets one obstacle and {second} another: name the same "
            f"surfaces of {solid.name} for all of its obstacles"
        )
    asked = next(iter(named), ("",))
    return solid.contact_surfaces if "" in asked else asked


def contact_of(
    comm: Any,
    scene: Scene,
    solid: Solid,
    system: ElasticSystem,
    outside: Boundary,
    obstacles: Sequence[Any],
    bound: Reach,
) -> ContactNodes:
    """Nodes of a solid that can touch obstacles, at least one (collective).

    Raises:
        SceneError: The solid is inside an obstacle at t = 0, or a surface is unknown.
    """
    cuts = [support.surface for support in solid.all_supports if support.mirrors]
    if solid.is_axisymmetric:
        cuts.append("axis")
    return contact_nodes(
        comm, outside, obstacles, system.numbers, system.constrained, system.displacement, bound,
        name=solid.name, surfaces=surfaces_of(scene, solid, obstacles),
        symmetry=cuts, axisymmetric=solid.is_axisymmetric,
        turns=solid.is_finite or any(obstacle.rotation for obstacle in obstacles),
    )  # fmt: skip


def _driven(scene: Scene, solid: Solid, obstacles: Sequence[Any]) -> str | None:
    """What moves a solid besides its own speed and gravity; None if nothing does."""
    why = {
        "an obstacle that turns": any(obstacle.rotation for obstacle in obstacles),
        "moving supports": any(support.moves for support in solid.supports),
        "tractions or pressures": bool(solid.tractions or solid.pressures),
        "an initial displacement": any(each.plain != 0.0 for each in solid.displacement),
        "joints": any(solid.name in joint.bodies for joint in scene.joints),
        "a static start": scene.starts_at_rest,
    }
    return next((name for name, moves in why.items() if moves), None)
