"""With which nodes a solid can touch the obstacles of its scene within the duration."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.contact.reach import Reach, reach
from impactfem.contact.surfaces import ContactNodes, contact_nodes
from impactfem.errors import SceneError
from impactfem.fem import MPI
from impactfem.scene import Scene, Solid
from impactfem.scene.apartness import may_be_struck
from impactfem.scene.pairing import surfaces_on

if TYPE_CHECKING:
    from impactfem.models.solids import SolidPart


def reach_of(part: "SolidPart") -> Reach:
    """Bound of the way of a solid within the duration of its scene (collective)."""
    scene, solid = part.scene, part.solid
    speeds = np.linalg.norm(part.system.velocity.reshape(-1, solid.dim), axis=1)
    speed = part.comm.allreduce(float(speeds.max(initial=0.0)), op=MPI.MAX)
    driven = _driven(scene, solid, part.obstacles)
    if driven is None and may_be_struck(scene, solid.name):
        driven = "other bodies that strike it"
    gravity = scene.vector_gravity
    return reach(
        speed, gravity.times, gravity.values, part.obstacles, scene.duration, driven=driven,
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


def contact_of(part: "SolidPart") -> ContactNodes:
    """Nodes of a solid that can touch obstacles, at least one (collective).

    Those that joints hold leave these.

    Raises:
        SceneError: The solid is inside an obstacle at t = 0, or a surface is unknown.
    """
    solid, system, obstacles = part.solid, part.system, part.obstacles
    cuts = [support.surface for support in solid.all_supports if support.mirrors]
    if solid.is_axisymmetric:
        cuts.append("axis")
    return contact_nodes(
        part.comm, part.outside, obstacles, system.numbers, system.supports.lasting, part.begun,
        part.reach, name=solid.name, surfaces=surfaces_of(part.scene, solid, obstacles),
        symmetry=cuts, axisymmetric=solid.is_axisymmetric, joined=part.joined,
        turns=solid.is_finite or any(obstacle.rotation for obstacle in obstacles),
    )  # fmt: skip


def _driven(scene: Scene, solid: Solid, obstacles: Sequence[Any]) -> str | None:
    """What moves a solid besides its own speed and gravity; None if nothing does."""
    why = {
        "an obstacle that turns": any(obstacle.rotation for obstacle in obstacles),
        "moving supports": any(s.moves or s.until is not None for s in solid.supports),
        "residual stress": solid.has_residual_stress,
        "tractions or pressures": bool(solid.tractions or solid.pressures),
        "an initial displacement": any(each.plain != 0.0 for each in solid.displacement),
        "joints": any(solid.name in joint.bodies for joint in scene.couplings),
        "a static start": scene.starts_at_rest,
    }
    return next((name for name, moves in why.items() if moves), None)
