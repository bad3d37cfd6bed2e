"""Systems of the bodies of a scene that have no mesh: one function for each kind."""

from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Bar, Beam, Mechanism, Plate, Point, RigidBody, Rod, Scene, SpringNet
from impactfem.system.beam_load import BeamForces, BeamLoad
from impactfem.system.beam_parts import beam_parts
from impactfem.system.few import ElasticBar, FewBodies, Lumped
from impactfem.system.flexible_beam import flexible_beam
from impactfem.system.frequency import highest_frequency
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.mechanism import mechanism_system
from impactfem.system.net import net_system
from impactfem.system.plate_making import plate_system
from impactfem.system.points import free_points
from impactfem.system.rigid import in_space, rigid_rod, rigid_systems

_SAMPLES = 5040  # along a bar
_OF_BENDING = 5.0  # a beam's modes up to about the second are followed like a vibration
_OF_TRANSIT = 5.0  # rad: a wave is through a bar after 100 of 20 steps in a radian


def few_bodies(scene: Scene) -> tuple[FewBodies, ...]:
    """Systems of the bodies of a scene that have no mesh: points first, as one.

    Raises:
        SceneError: A spring has no direction.
    """
    own = {type(body): _of_own for body in scene.bodies if hasattr(body, "system")}
    makers = {**_MAKERS, **own}
    kinds = list(makers)
    bodies = sorted(
        (body for body in scene.bodies if _kind(body) in kinds), key=lambda b: kinds.index(_kind(b))
    )
    found: list[FewBodies] = []
    for kind, alike in groupby(bodies, _kind):
        found += makers[kind](scene, list(alike))
    return tuple(found)


def _kind(body: Any) -> type[Any]:
    """Its class; masses that bodies carry are points."""
    return Point if isinstance(body, Point) else type(body)


def _of_own(_: Scene, bodies: Sequence[Any]) -> list[FewBodies]:
    """Of bodies that say it themselves, as those of extensions do."""
    return [body.system() for body in bodies]


def _of_points(scene: Scene, points: Sequence[Point]) -> Lumped:
    dim, count = points[0].dim, len(points)
    # On an axis the forces around a ball have no sum across it.
    ways = [0.0, 1.0] if any(solid.is_axisymmetric for solid in scene.solids) else np.ones(dim)
    moving = np.diag(np.tile(ways, count))
    free = free_points(points)
    position = np.concatenate([p.position for p in points]).astype(float)
    masses = tuple(p.mass for p in points)
    radius = np.array([p.radius for p in points])
    velocity = np.concatenate([p.velocity or () for p in points]).astype(float)

    def section(body: int, _: Floats) -> tuple[Floats, Floats]:
        rows = np.zeros((6, count * dim))
        rows[:dim, body * dim : (body + 1) * dim] = np.eye(dim)
        return in_space(position[body * dim : (body + 1) * dim]), rows

    return Lumped(
        names=tuple(p.name for p in points),
        masses=masses,
        centers=position.reshape(count, dim),
        speeds=velocity.reshape(count, dim),
        rate=lambda: highest_frequency(free.system, position, velocity),
        system=free.system,
        weights=np.concatenate([m * np.eye(dim) for m in masses]),
        moments=np.zeros((count * dim, dim * (dim - 1) // 2)),
        inertias=(0.0,) * count,
        angles=(0.0,) * count,
        owner=np.repeat(np.arange(count), dim),
        position=position,
        velocity=velocity,
        places=lambda q: q.reshape(count, dim).copy(),
        jacobian=lambda _: moving,
        turning=False,
        radius=radius,
        shell=radius,
        touching=np.ones(count, dtype=bool),
        body=np.arange(count),
        lines=_NO_LINES,
        ends={},
        elastic=free.elastic,
        load=free.load,
        section=section,
        words="a point" if count == 1 else f"{count} points",
    )


def _of_beam(beam: Beam) -> Lumped:
    parts, dim = beam_parts(beam), beam.dim
    count, size = len(parts.nodes), len(parts.mass)
    load = BeamLoad.of(parts)
    none = np.zeros(size)
    dead = none if load is None or not load.is_dead else load.mean(0.0, 0.0, none)
    system: GeneralizedSystem = LinearSystem(
        mass=parts.mass, stiffness=parts.stiffness, damping=parts.damping, load=dead.tolist(),
        normals=np.zeros((0, size)), offsets=np.zeros(0),
    )  # fmt: skip
    if load is not None and not load.is_dead:
        forces = BeamForces(load, parts.stiffness, parts.damping, none)
        system = GeneralizedSystem(mass=parts.mass, force=forces)
    weights, velocity = parts.momenta[:, :dim], parts.velocity

    def section(_: int, place: Floats) -> tuple[Floats, Floats]:
        s = float((place[:dim] - beam.center) @ beam.along)
        s = min(max(s, parts.nodes[0]), parts.nodes[-1])
        return in_space(np.asarray(beam.center) + s * beam.along), parts.section(s)

    held = "held" if beam.supports else "free"
    return Lumped(
        names=(beam.name,),
        masses=(beam.mass,),
        centers=np.array([beam.center], dtype=float),
        speeds=(weights.T @ velocity)[None] / beam.mass,
        # No step has to follow the fastest of a beam.
        rate=lambda: _OF_BENDING * beam.first_frequency,
        ends={},
        system=system,
        weights=weights,
        moments=parts.momenta[:, dim:],
        inertias=(float(parts.inertia[-1, -1]),),
        angles=(beam.inclination,),
        owner=np.zeros(size, dtype=np.int64),
        position=np.zeros(size),
        velocity=velocity,
        places=parts.places,
        jacobian=lambda _: parts.jacobian,
        turning=False,
        radius=np.full(count, 0.5 * beam.height),
        shell=np.zeros(count),
        touching=parts.touching,
        body=np.zeros(count, dtype=np.int64),
        lines=np.stack([np.arange(count - 1), np.arange(1, count)], axis=1),
        elastic=parts.elastic,
        load=None if load is None else load.mean,
        words=f"a {held} beam of {beam.elements} elements",
        beam=parts,
        section=section,
    )


def _of_bar(bar: Bar) -> ElasticBar:
    origin, axis = bar.frame
    ends = np.array([0.0, bar.length])
    moved, speed = (
        np.asarray(formula(x=ends) + np.zeros(2))
        for formula in (bar.initial_displacement, bar.initial_velocity)
    )
    free = bar.far_end == "free"
    speed *= [1.0, float(free)]
    middle, mean = _means(bar)
    return ElasticBar(
        names=(bar.name,),
        masses=(bar.mass,),
        centers=(origin + (0.5 * bar.length + middle) * axis)[None],
        speeds=(mean * axis)[None],
        inertias=(0.0,),
        angles=(0.0,),
        position=moved,
        velocity=speed,
        places=lambda u: np.asarray(origin + (ends + u)[:, None] * axis),
        radius=np.zeros(2),
        shell=np.zeros(2),
        touching=np.array([True, free]),
        body=np.zeros(2, dtype=np.int64),
        lines=_NO_LINES,
        ends={"": np.array([0])} | ({"far_end": np.array([1])} if free else {}),
        rate=lambda: _OF_TRANSIT / bar.transit_time,
        words=f"a bar {'clamped at its far end' if not free else 'followed by its waves'}",
        bar=bar,
        axis=axis,
        origin=origin,
    )


def _means(bar: Bar) -> tuple[float, float]:
    """Mean displacement [m] and velocity [m/s] of a bar at t = 0."""
    x = bar.length * np.linspace(0.0, 1.0, _SAMPLES + 1)
    each = (bar.initial_displacement, bar.initial_velocity)
    moved, speed = (np.asarray(formula(x=x) + np.zeros_like(x)) for formula in each)
    return float(np.mean(0.5 * (moved[1:] + moved[:-1]))), float(np.mean(speed))


_NO_LINES = np.zeros((0, 2), dtype=np.int64)

_MAKERS: Mapping[type, Callable[[Scene, list[Any]], Sequence[FewBodies]]] = {
    Point: lambda scene, points: [_of_points(scene, points)],
    Rod: lambda _, rods: list(map(rigid_rod, rods)),
    Beam: lambda _, beams: [flexible_beam(b) if b.is_finite else _of_beam(b) for b in beams],
    RigidBody: rigid_systems,
    Mechanism: lambda scene, bodies: [mechanism_system(scene, body) for body in bodies],
    SpringNet: lambda scene, nets: [net_system(scene, net) for net in nets],
    Plate: lambda scene, plates: [plate_system(scene, plate) for plate in plates],
    Bar: lambda _, bars: list(map(_of_bar, bars)),
}
"""Systems of bodies of one kind: the place to add a body without a mesh."""
