"""A rigid body among half-spaces at rest in coordinates: centre and angle, or unit quaternion.

With the rotation R(q), the normal n and the level l of a half-space, the gap of a corner or centre
of a ball with the arm a from the centre x and the radius r is

    phi = n . (x + R(q) a) - l - r.

In space velocities are those of the centre, and spins along the axes of the body.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.scene import RigidBody, Scene
from impactfem.scene.pairing import law_of
from impactfem.scene.rigid_keys import rotation
from impactfem.system.generalized import GeneralizedSystem

if TYPE_CHECKING:
    from impactfem.scene.obstacles import HalfSpace


@dataclass(frozen=True)
class RigidPlace:
    """How a rigid body is placed by its coordinates; complex ones are taken, too.

    Attributes:
        body: The body.
        dim: Number of coordinates of the scene.
    """

    body: RigidBody
    dim: int

    def turn(self, u: Any) -> Any:
        """Rotation, (dim, dim)."""
        if self.dim == 3:
            return rotation(u[3:])
        c, s = np.cos(u[2]), np.sin(u[2])
        return np.array([[c, -s], [s, c]])

    def turning(self, u: Floats) -> Floats:
        """Its derivatives by angle or quaternion, (1 or 4, dim, dim)."""
        if self.dim == 2:
            c, s = np.cos(u[2]), np.sin(u[2])
            return np.array([[[-s, -c], [c, -s]]])
        w, x, y, z = u[3:]
        return 2.0 * np.array(
            [
                [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]],
                [[0.0, y, z], [y, -2.0 * x, -w], [z, w, -2.0 * x]],
                [[-2.0 * y, x, w], [x, 0.0, z], [-w, z, -2.0 * y]],
                [[-2.0 * z, -w, x], [w, -2.0 * z, y], [x, y, 0.0]],
            ]
        )

    def places(self, u: Any, arms: Floats) -> Any:
        """Where arms from the centre are [m], (..., arms, dim), for coordinates (..., n)."""
        flat = u.reshape(-1, u.shape[-1])
        found = np.array([each[: self.dim] + arms @ self.turn(each).T for each in flat])
        return found.reshape(*u.shape[:-1], len(arms), self.dim)

    def rates(self, u: Floats, v: ArrayLike) -> Floats:
        """Rates of centre and quaternion."""
        q, v = u[3:], np.asarray(v)
        spin = [[-q[1:] @ v[3:]], q[0] * v[3:] + np.cross(q[1:], v[3:])]
        return np.concatenate([v[:3], 0.5 * np.concatenate(spin)])

    @property
    def start(self) -> tuple[Floats, Floats]:
        """Coordinates and velocities at t = 0."""
        body, v = self.body, self.body.start_velocity
        if self.dim == 2:
            return np.array([*body.center, body.angle]), v
        spin = rotation(body.quaternion).T @ v[3:]
        return np.concatenate([body.center, body.quaternion]), np.concatenate([v[:3], spin])


def rigid_in_coordinates(
    scene: Scene, body: RigidBody, names: list[str], restitution: list[float]
) -> GeneralizedSystem:
    """Make the system of a body, for each half-space the constraints of all its corners.

    Args:
        scene: The scene.
        body: The body.
        names: Of the half-spaces.
        restitution: Of each.
    """
    place, dim, form = RigidPlace(body, body.dim), body.dim, body.form
    planes = {o.name: cast("HalfSpace", o) for o in scene.rigid_obstacles}
    laws = [law_of(scene, body.name, name) for name in names]
    towards = [planes[name].normal for name in names]
    normals: Floats = np.array(towards, dtype=np.float64).reshape(-1, dim)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    beside = [planes[name].point for name in names]
    points: Floats = np.array(beside, dtype=np.float64).reshape(-1, dim)
    count = len(form.nodes)
    arms, radius = (
        np.tile(form.nodes - body.center, (len(names), 1)),
        np.tile(form.radius, len(names)),
    )
    levels = np.repeat(np.sum(normals * points, axis=1), count) + radius
    rows = np.repeat(normals, count, axis=0)
    mass, inertia = body.total_mass, body.moments
    weight = mass * np.asarray(scene.vector_gravity.values[0], dtype=float)
    pull = np.concatenate([weight, np.zeros(body.turns)])

    def gaps(u: Floats) -> Floats:
        return np.asarray(np.einsum("ji,ji->j", rows, u[:dim] + arms @ place.turn(u).T) - levels)

    def gradient(u: Floats) -> Floats:
        turned = np.einsum("ji,kil,jl->jk", rows, place.turning(u), arms)
        return np.concatenate([rows, turned], axis=1)

    def force(_t: float, _u: Floats, v: Floats) -> Floats:
        if dim == 2:
            return pull
        return np.concatenate([weight, np.cross(inertia @ v[3:], v[3:])])

    def slip(u: Floats) -> Floats:
        along = np.stack([rows[:, 1], -rows[:, 0]], axis=1)
        reach = arms @ place.turn(u).T - radius[:, None] * rows
        lever = reach[:, 0] * along[:, 1] - reach[:, 1] * along[:, 0]
        return np.column_stack([along, lever])

    turned = ("angle",) if dim == 2 else ("qw", "qx", "qy", "qz")
    each = {
        name: np.repeat([getattr(law, name) if law else 0.0 for law in laws], count)
        for name in ("friction_coefficient", "sticking", "tangential_restitution")
    }
    return GeneralizedSystem(
        mass=np.block([
            [mass * np.eye(dim), np.zeros((dim, body.turns))],
            [np.zeros((body.turns, dim)), inertia],
        ]),
        force=force,
        constraints=gaps,
        jacobian=gradient,
        restitution=np.repeat(restitution, count).tolist(),
        friction=each["friction_coefficient"].tolist(),
        static_friction=each["sticking"].tolist(),
        tangential_restitution=each["tangential_restitution"].tolist(),
        slip=slip if dim == 2 else None,
        potential=lambda _, u: -float(weight @ (u[:dim] - body.center)),
        names=("x", "y", "z")[:dim] + turned,
        rates=None if dim == 2 else place.rates,
        coordinates=None if dim == 2 else 7,
        unit_vectors=() if dim == 2 else [range(3, 7)],
    )  # fmt: skip
