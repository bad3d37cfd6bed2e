"""Bodies of few degrees of freedom, without their contacts: what one march needs of them.

Points, rods and beams are given by M q'' = f(t, q, q') + W g with coordinates q, gravity g and
W = M R for unit motions R along the axes, and by contact nodes at places x(q) with the Jacobian
H = dx / dq. W^T q' is the momentum, W^T q the first moment of mass, whatever the coordinates.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.scene import Beam, Point, Rod, Scene
from impactfem.system.beam import FreeBeam, free_beam
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.points import free_points

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


@dataclass(frozen=True)
class FewBodies:
    """Bodies that share a system; points do, since springs may join them.

    Attributes:
        names: Of the bodies.
        masses: [kg].
        centers: Centres of mass at t = 0 [m], shape (bodies, dim).
        system: M, f without gravity; no constraints.
        weights: W, shape (d, dim).
        moments: The same for angular momenta about the bodies' centres, shape (d, 1) or (d, 3).
        inertias: Of the bodies about their centres [kg m^2]; 0 of what does not turn.
        angles: Of their axes at t = 0 [rad].
        owner: Body of each coordinate, shape (d,).
        position, velocity: q [m, rad] and q' at t = 0, shape (d,).
        places: x(q) of the contact nodes [m], (nodes, dim).
        jacobian: H(q), shape (nodes * dim, d).
        turning: Whether H depends on q.
        radius: Of the contact nodes as balls, among themselves and with solids [m], (nodes,).
        shell: The same with obstacles [m].
        touching: Which nodes meet obstacles, (nodes,).
        body: Body of each contact node, (nodes,).
        lines: Contact nodes joined by straight axes, shape (lines, 2).
        elastic: Elastic energy of q [J].
        load: Forces that do work besides gravity, springs and inertia, (t, q, q') -> (d,); None
            without any.
        words: What they are, in words.
        beam: The beam, None for other bodies.
    """

    names: tuple[str, ...]
    masses: tuple[float, ...]
    centers: Floats
    system: GeneralizedSystem
    weights: Floats
    moments: Floats
    inertias: tuple[float, ...]
    angles: tuple[float, ...]
    owner: Integers
    position: Floats
    velocity: Floats
    places: Callable[[Floats], Floats]
    jacobian: Callable[[Floats], Floats]
    turning: bool
    radius: Floats
    shell: Floats
    touching: Booleans
    body: Integers
    lines: Integers
    elastic: Callable[[Floats], float]
    load: Callable[[float, Floats, Floats], Floats] | None
    words: str
    beam: FreeBeam | None = None

    @property
    def dim(self) -> int:
        """Dimension of space."""
        return int(self.weights.shape[1])

    def nodes_of(self, body: int) -> Integers:
        """Contact nodes of one of the bodies."""
        return np.flatnonzero(self.body == body)

    def lines_of(self, body: int) -> Integers:
        """Lines of one of the bodies, by places among its own nodes, (lines, 2)."""
        own = self.nodes_of(body)
        mine = self.lines[np.isin(self.lines[:, 0], own)]
        return np.searchsorted(own, mine)


def few_bodies(scene: Scene) -> tuple[FewBodies, ...]:
    """Systems of the points, rods and beams of a scene: the points first, as one.

    Raises:
        SceneError: A spring has no direction.
    """
    found = [_of_points(scene.points)] if scene.points else []
    slender = (body for body in scene.bodies if body.kind in _SLENDER)
    return (*found, *(_SLENDER[body.kind](body) for body in slender))


def _of_points(points: Sequence[Point]) -> FewBodies:
    dim, count = points[0].dim, len(points)
    free = free_points(points)
    position = np.concatenate([p.position for p in points]).astype(float)
    masses = tuple(p.mass for p in points)
    radius = np.array([p.radius for p in points])
    return FewBodies(
        names=tuple(p.name for p in points),
        masses=masses,
        centers=position.reshape(count, dim),
        system=free.system,
        weights=np.concatenate([m * np.eye(dim) for m in masses]),
        moments=np.zeros((count * dim, dim * (dim - 1) // 2)),
        inertias=(0.0,) * count,
        angles=(0.0,) * count,
        owner=np.repeat(np.arange(count), dim),
        position=position,
        velocity=np.concatenate([p.velocity or () for p in points]).astype(float),
        places=lambda q: q.reshape(count, dim).copy(),
        jacobian=lambda _: np.eye(count * dim),
        turning=False,
        radius=radius,
        shell=radius,
        touching=np.ones(count, dtype=bool),
        body=np.arange(count),
        lines=np.zeros((0, 2), dtype=np.int64),
        elastic=free.elastic,
        load=free.load,
        words="a point" if count == 1 else f"{count} points",
    )


def _of_rod(rod: Rod) -> FewBodies:
    arms = 0.5 * rod.length * np.array([-1.0, 1.0])
    inertia = rod.mass * rod.length**2 / 12.0
    system = LinearSystem(
        mass=np.array([rod.mass, rod.mass, inertia]), normals=np.zeros((0, 3)),
        offsets=np.zeros(0), names=("x", "y", "theta"),
    )  # fmt: skip

    def places(q: Floats) -> Floats:
        return np.asarray(q[:2] + arms[:, None] * np.array([np.cos(q[2]), np.sin(q[2])]))

    def jacobian(q: Floats) -> Floats:
        turn = arms[:, None] * np.array([-np.sin(q[2]), np.cos(q[2])])
        return np.concatenate([np.column_stack([np.eye(2), turn[k]]) for k in (0, 1)])

    return FewBodies(
        names=(rod.name,),
        masses=(rod.mass,),
        centers=np.array([rod.center], dtype=float),
        system=system,
        weights=rod.mass * np.eye(3)[:, :2],
        moments=inertia * np.eye(3)[:, 2:],
        inertias=(inertia,),
        angles=(rod.inclination,),
        owner=np.zeros(3, dtype=np.int64),
        position=np.array([*rod.center, rod.inclination], dtype=float),
        velocity=np.array([*rod.velocity, rod.angular_velocity], dtype=float),
        places=places,
        jacobian=jacobian,
        turning=True,
        radius=np.full(2, rod.radius),
        shell=np.full(2, rod.radius),
        touching=np.ones(2, dtype=bool),
        body=np.zeros(2, dtype=np.int64),
        lines=np.array([[0, 1]]),
        elastic=lambda _: 0.0,
        load=None,
        words="a rigid rod",
    )


def _of_beam(beam: Beam) -> FewBodies:
    free = free_beam(beam)
    matrices, (along, across) = free.matrices, free.axes
    count, size = len(matrices.nodes), len(matrices.mass)
    system = LinearSystem(
        mass=matrices.mass, stiffness=matrices.stiffness, damping=free.damping,
        normals=np.zeros((0, size)), offsets=np.zeros(0),
    )  # fmt: skip
    jacobian = np.zeros((count, 2, size))
    jacobian[np.arange(count), :, 3 * np.arange(count)] = along
    jacobian[np.arange(count), :, 3 * np.arange(count) + 1] = across
    flat = jacobian.reshape(2 * count, size)
    position, velocity = free.start
    touching = np.full(count, beam.contact == "along")
    touching[[0, -1]] = True
    return FewBodies(
        names=(beam.name,),
        masses=(beam.mass,),
        centers=np.array([beam.center], dtype=float),
        system=system,
        weights=matrices.mass @ free.rigid_modes[:, :2],
        moments=matrices.mass @ free.rigid_modes[:, 2:],
        inertias=(float(free.rigid_mass[2, 2]),),
        angles=(beam.inclination,),
        owner=np.zeros(size, dtype=np.int64),
        position=position,
        velocity=velocity,
        places=free.points,
        jacobian=lambda _: flat,
        turning=False,
        radius=np.full(count, 0.5 * beam.height),
        shell=np.zeros(count),
        touching=touching,
        body=np.zeros(count, dtype=np.int64),
        lines=np.stack([np.arange(count - 1), np.arange(1, count)], axis=1),
        elastic=lambda q: 0.5 * float(q @ (matrices.stiffness @ q)),
        load=None,
        words=f"a free beam of {beam.elements} elements",
        beam=free,
    )


_SLENDER: Mapping[str, Callable[[Any], FewBodies]] = {"beam": _of_beam, "rod": _of_rod}
