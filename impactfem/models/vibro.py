"""What a scene of points, a rod or a beam is as a system: shared by plan and run."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.errors import SceneError
from impactfem.models.key import SceneKey
from impactfem.result.history import BodyMotion
from impactfem.result.shapes import TETRAHEDRON, TRIANGLE, Shape
from impactfem.scene import Beam, PiecewiseVector, Point, RigidBody, Rod, Scene
from impactfem.scene.pairing import pair_name
from impactfem.system.beam import FreeBeam, free_beam
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.points import contact_pairs, points_system, start_state
from impactfem.system.rigid_coordinates import RigidPlace, rigid_in_coordinates
from impactfem.system.rod import rod_system
from impactfem.system.start_checks import check_start

Bodies = Callable[[Floats, Floats], Mapping[str, BodyMotion]]


@dataclass(frozen=True)
class VibroModel:
    """A scene as a system.

    Attributes:
        system: The system.
        position: u at t = 0, shape (d,).
        velocity: u' at t = 0, shape (d,).
        labels: Names of the constraints, as "ball on floor".
        pairs: Names of the pairs of the scene.
        pair_of: Which of them each constraint belongs to, shape (J,).
        masses: Mass of each body [kg], in the order of `bodies`.
        bodies: Centres of mass and their velocities, from positions and velocities (rows, d).
        elastic: Elastic energy [J] of u (d,).
        conservative: Whether the potential energy is known; then energy may not grow.
        words: What it is, in words.
        shapes: The bodies in files and pictures, as they are at t = 0.
        places: Where the nodes of the shapes are [m], (..., nodes, dim), from positions (..., d).
        beam: The beam, None for other bodies.
        inertia: Of the body about its centre of mass along its axes [kg m^2], (3, 3); 0 for points.
        dim: Number of coordinates of the scene.
    """

    system: GeneralizedSystem
    position: Floats
    velocity: Floats
    labels: tuple[str, ...]
    pairs: tuple[str, ...]
    pair_of: Integers
    masses: tuple[float, ...]
    bodies: Bodies
    elastic: Callable[[Floats], float]
    conservative: bool
    words: str
    shapes: tuple[Shape, ...]
    places: Callable[[Any], Any]
    beam: FreeBeam | None = None
    inertia: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    dim: int = 2

    @property
    def turning(self) -> float | list[list[float]]:
        """The inertia as figures have it: about z in the plane, in space all of it."""
        return float(self.inertia[2, 2]) if self.dim == 2 else self.inertia.tolist()

    @property
    def is_exact(self) -> bool:
        """Whether the free motion is linear with loads that can be followed exactly."""
        return isinstance(self.system, LinearSystem) and self.system.is_exact


def vibro_model(scene: Scene) -> VibroModel:
    """Make the system of a scene; the last one is kept for plan and run to share.

    Raises:
        SceneError: The start cannot work, as a body inside an obstacle.
    """
    return _model(SceneKey(scene))


@lru_cache(maxsize=1)
def _model(key: SceneKey) -> VibroModel:
    scene = key.scene
    (kind,) = {body.kind for body in scene.bodies}
    model = _MODELS[kind](scene, *scene.bodies)
    check_start(model.system, model.position, model.velocity)
    return model


def _of_points(scene: Scene, *points: Point) -> VibroModel:
    found = points_system(scene)
    position, velocity = start_state(scene)
    dim = scene.dim

    def bodies(u: Floats, v: Floats) -> dict[str, BodyMotion]:
        columns = {p.name: slice(k * dim, (k + 1) * dim) for k, p in enumerate(points)}
        return {n: BodyMotion(_in_space(u[:, c]), _in_space(v[:, c])) for n, c in columns.items()}

    count = "a point" if len(points) == 1 else f"{len(points)} points"
    linear = isinstance(found.system, LinearSystem)
    kind = "linear free motion, flat constraints" if linear else "nonlinear"
    return VibroModel(
        found.system,
        position,
        velocity,
        found.labels,
        *_pairs(scene, 1),
        tuple(p.mass for p in points),
        bodies,
        found.elastic,
        found.conservative,
        f"{count} in {dim}D, {_count(len(found.labels), 'constraint')}, {kind}",
        tuple(Shape.vertices(p.name, [p.position], p.radius) for p in points),
        lambda u: u.reshape(*u.shape[:-1], len(points), dim),
        dim=dim,
    )


def _of_rod(scene: Scene, rod: Rod) -> VibroModel:
    planes, restitution, names = _planes(scene)
    system = rod_system(
        rod.mass,
        rod.length,
        planes,
        _gravity(scene),
        np.repeat(restitution, 2).tolist(),
        rod.radius,
    )
    labels = [f"{rod.name} {end} on {name}" for name in names for end in ("first end", "last end")]
    position = np.array([*rod.center, rod.inclination])
    velocity = np.array([*rod.velocity, rod.angular_velocity])

    def bodies(u: Floats, v: Floats) -> dict[str, BodyMotion]:
        place, speed = _in_space(u[:, :2]), _in_space(v[:, :2])
        return {rod.name: BodyMotion(place, speed, u[:, 2:3], v[:, 2:3])}

    ends = 0.5 * rod.length * np.array([-1.0, 1.0])

    def places(u: Floats) -> Floats:
        along = np.stack([np.cos(u[..., 2]), np.sin(u[..., 2])], axis=-1)
        return np.asarray(u[..., None, :2] + ends[:, None] * along[..., None, :])

    _refuse_overlap(system, position, labels, places(position))
    words = f"a rigid rod in the plane, {_count(len(labels), 'constraint')}, nonlinear"
    return VibroModel(
        system, position, velocity, tuple(labels), *_pairs(scene, 2), (rod.mass,), bodies, _none,
        True, words, (Shape.line(rod.name, places(position), rod.radius),), places,
        inertia=_about_z(rod.mass * rod.length**2 / 12.0),
    )  # fmt: skip


def _of_beam(scene: Scene, beam: Beam) -> VibroModel:
    planes, restitution, names = _planes(scene)
    free = free_beam(beam)
    nodes = len(free.touching)
    system = free.system(planes, _gravity(scene), np.repeat(restitution, nodes).tolist())
    last = len(free.matrices.nodes) - 1
    ends = {} if beam.touches_along else {0: "first end", last: "last end"}
    places = [ends.get(k, f"node {k}") for k in free.touching.tolist()]
    labels = [f"{beam.name} {place} on {name}" for name in names for place in places]
    position, velocity = free.start
    _refuse_overlap(system, position, labels, free.points(position))
    center = np.asarray(beam.center, dtype=float)

    def bodies(u: Floats, v: Floats) -> dict[str, BodyMotion]:
        rigid, rates = free.rigid_part(u), free.rigid_part(v)
        place, speed = _in_space(rigid[:, :2] + center), _in_space(rates[:, :2])
        return {beam.name: BodyMotion(place, speed, rigid[:, 2:] + beam.inclination, rates[:, 2:])}

    theory = {"euler_bernoulli": "Euler-Bernoulli", "timoshenko": "Timoshenko"}[beam.theory]
    held, linear = "held" if beam.supports else "free", isinstance(system, LinearSystem)
    words = (
        f"a {held} {theory} beam of {beam.elements} elements in the plane, small displacements, "
    )
    words += f"{_count(len(labels), 'constraint')}, {'' if linear else 'non'}linear free motion"
    return VibroModel(
        system, position, velocity, tuple(labels), *_pairs(scene, nodes), (beam.mass,), bodies,
        free.elastic, linear, words,
        (Shape.line(beam.name, free.points(position), 0.5 * beam.height),), free.points, free,
        inertia=_about_z(float(free.rigid_mass[2, 2])),
    )  # fmt: skip


def _of_rigid(scene: Scene, body: RigidBody) -> VibroModel:
    pairs, place = contact_pairs(scene), RigidPlace(body, body.dim)
    names, each, turns = [pair[1] for pair, _ in pairs], len(body.form.nodes), body.turns
    _gravity(scene)
    system = rigid_in_coordinates(scene, body, names, [e for _, e in pairs])
    corners = [f" corner {k}" for k in range(each)] if each > 1 else [""]
    labels = [f"{body.name}{corner} on {name}" for name in names for corner in corners]
    position, velocity = place.start
    dim, arms = body.dim, body.form.points - body.center
    _refuse_overlap(system, position, labels, place.places(position, arms))

    def bodies(u: Floats, v: Floats) -> dict[str, BodyMotion]:
        speed, spin = _in_space(v[:, :dim]), v[:, dim:]
        if dim == 3:
            spin = np.array([place.turn(q) @ w for q, w in zip(u, spin, strict=True)])
        return {body.name: BodyMotion(_in_space(u[:, :dim]), speed, u[:, dim:], spin)}

    words = f"a rigid {body.figure} in {dim}D, {_count(len(labels), 'constraint')}, nonlinear"
    kind = TRIANGLE if dim == 2 else TETRAHEDRON
    shape = Shape(body.name, place.places(position, arms), body.form.cells, kind)
    inertia = np.zeros((3, 3))
    inertia[3 - turns :, 3 - turns :] = body.moments
    return VibroModel(
        system, position, velocity, tuple(labels), *_pairs(scene, each), (body.total_mass,), bodies,
        _none, True, words, (shape,), lambda u: place.places(u, arms), inertia=inertia, dim=dim,
    )  # fmt: skip


_MODELS: Mapping[str, Callable[..., VibroModel]] = {
    "beam": _of_beam,
    "point": _of_points,
    "rigid": _of_rigid,
    "rod": _of_rod,
}


def _pairs(scene: Scene, each: int) -> tuple[tuple[str, ...], Integers]:
    """Names of the pairs, and which of them each constraint belongs to, so many of a pair."""
    names = tuple(pair_name(scene, *pair) for pair, _ in contact_pairs(scene))
    return names, np.repeat(np.arange(len(names)), each)


def _planes(scene: Scene) -> tuple[list[Any], list[float], list[str]]:
    """Half-spaces that the body may meet, with their restitution and names."""
    pairs = contact_pairs(scene)
    by_name = {o.name: o for o in scene.rigid_obstacles}
    names = [pair[1] for pair, _ in pairs]
    return [by_name[name] for name in names], [e for _, e in pairs], names


def _gravity(scene: Scene) -> tuple[float, ...]:
    gravity: PiecewiseVector = scene.vector_gravity
    if not gravity.is_constant:
        raise SceneError(
            f"gravity changes at t = {gravity.times[1]:g} s: rods, beams and bodies in "
            "coordinates take constant gravity; give one vector"
        )
    return gravity.values[0]


def _refuse_overlap(
    system: GeneralizedSystem, position: Floats, labels: list[str], places: Floats
) -> None:
    """Refuse a start inside an obstacle, but for rounding of ``places`` [m]."""
    gap = system.gap(0.0, position)
    worst = int(np.argmin(gap))
    if gap[worst] < -1e-12 * float(np.abs(places).max()):
        raise SceneError(f"{labels[worst]}: it is {-gap[worst]:.6g} m inside at t = 0; move it")


def _in_space(values: Floats) -> Floats:
    """Coordinates (rows, dim) with zeros up to three."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def _about_z(moment: float) -> Floats:
    return np.diag([0.0, 0.0, moment])


def _none(_: Floats) -> float:
    return 0.0


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"
