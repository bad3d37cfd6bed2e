"""Flights of bodies as rigid ones, up to their first contacts with obstacles and other bodies.

A body flies by its velocity, gravity and its loads, or is carried by its supports.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from impactfem.arrays import Floats
from impactfem.contact.boundary import Boundary, everywhere
from impactfem.contact.distance import signed_distance
from impactfem.fem import MPI
from impactfem.planning.drives import Drives, carried, flown
from impactfem.result.shapes import as_vectors
from impactfem.scene import Scene, Solid
from impactfem.scene.pairing import body_pairs, friction_of, obstacles_of
from impactfem.system.elastic import ElasticSystem

_SAMPLES = 64  # times at which bodies are looked at on their way


@dataclass(frozen=True)
class Flyer:
    """A solid as a rigid body, in three coordinates also if it is plane.

    Attributes:
        solid: The body.
        free: Whether nothing holds it.
        mass: [kg]; infinite if it is held.
        inverse: Inverse inertia, 0 where cuts or the model let nothing turn [1/(kg m^2)], (3, 3).
        centre: Of mass, at t = 0 [m], (3,).
        spin: At t = 0 [rad/s], (3,).
        drives: How it moves until it meets something.
        points: Places of what may touch, at t = 0 [m], (points, 3).
        normals: Its outward normals, by area [m^2], (points, 3).
        flat: How flat the outside is there: 1 on a face, less at edges, (points,).
        wave_speed: Of long waves, sqrt(E / rho) [m/s].
        impedance: Density times wave speed [kg/(m^2 s)].
    """

    solid: Solid
    free: bool
    mass: float
    inverse: Floats
    centre: Floats
    spin: Floats
    drives: Drives
    points: Floats
    normals: Floats
    flat: Floats
    wave_speed: float
    impedance: float

    @property
    def name(self) -> str:
        """Of the body."""
        return self.solid.name

    @property
    def size(self) -> float:
        """Largest extent [m]."""
        return float(np.ptp(self.points, axis=0).max())


@dataclass(frozen=True)
class Blow:
    """The first contact of a body.

    Attributes:
        time: [s].
        arms: Places that touch, from the centre of mass [m], (touching, 3).
        weights: How much each counts, (touching,).
        normal: Of what it meets, towards the body, (3,).
        speed: At which it comes, along the normal [m/s].
        along: Speed of the contact across the normal [m/s], (3,).
        clearance: Of the node that touches next [m].
        friction: Coefficient.
        met: What it meets, in words.
        other: The body that it meets; None for an obstacle.
    """

    time: float
    arms: Floats
    weights: Floats
    normal: Floats
    speed: float
    along: Floats
    clearance: float
    friction: float
    met: str
    other: Flyer | None

    def share(self, body: Flyer) -> float:
        """Of the speed that goes into the body as strain."""
        if self.other is None:
            return 1.0
        return self.other.impedance / (self.other.impedance + body.impedance)

    @property
    def give(self) -> float:
        """Inverse mass that gives way on the other side [1/kg]."""
        return 0.0 if self.other is None else 1.0 / self.other.mass


def flyer(scene: Scene, solid: Solid, system: ElasticSystem, outside: Boundary) -> Flyer:
    """A solid as a rigid body (collective).

    Args:
        scene: The scene.
        solid: The solid.
        system: Its matrices.
        outside: Its faces.
    """
    planes = dict(system.supports.planes)
    # What lets go at once flies; where and how fast one is that lets go later is not known.
    held = any(not support.mirrors and support.until != 0.0 for support in solid.supports)
    lets_go = any(support.until in scene.ends for support in solid.supports)
    mass, centre = system.total_mass, system.center_of_mass
    arm = as_vectors(system.positions - centre)
    own = np.einsum("k,ki,kj->ij", system.node_mass, arm, arm)
    second = np.asarray(system.comm.allreduce(own, op=MPI.SUM))
    inertia = np.trace(second) * np.eye(3) - second
    turns = [axis for axis in range(3) if not set(planes) - {axis}]
    if solid.dim == 2:
        turns = [] if planes or solid.is_axisymmetric else [2]
    inverse = np.zeros((3, 3))
    if turns and not held:
        inverse[np.ix_(turns, turns)] = np.linalg.inv(inertia[np.ix_(turns, turns)])
    moved = everywhere(
        system.comm, outside.numbers, system.numbers, system.displacement.reshape(-1, solid.dim)
    )
    normals = np.zeros_like(outside.points)
    np.add.at(normals, outside.faces, outside.shares)
    areas = outside.total(outside.areas, np.ones(len(outside.faces), dtype=bool))
    touching = np.ones(len(outside.points), dtype=bool)
    if solid.contact_surfaces is not None:
        touching = outside.touched(outside.on(solid.contact_surfaces))
    speed = math.sqrt(solid.youngs_modulus / solid.density)
    rates = np.atleast_1d(np.asarray(solid.angular_velocity, dtype=np.float64))
    spin = np.array([0.0, 0.0, rates[0]]) if len(rates) == 1 else rates
    spin = spin * inverse.any(axis=1)
    velocity = as_vectors(system.mean(system.velocity))
    return Flyer(
        solid=solid,
        free=not held,
        mass=math.inf if held else mass,
        inverse=inverse,
        centre=as_vectors(centre),
        spin=spin,
        drives=carried(scene, system, known=not lets_go)
        if held
        else flown(scene, solid, system, inverse, (velocity, spin)),
        points=as_vectors(outside.points + moved)[touching],
        normals=as_vectors(normals)[touching],
        flat=(np.linalg.norm(normals, axis=1) / np.maximum(areas, 1e-300))[touching],
        wave_speed=speed,
        impedance=solid.density * speed,
    )


def first_blow(scene: Scene, body: Flyer, flyers: Sequence[Flyer]) -> Blow | None:
    """First contact of a body with an obstacle or another body; None without or if not known."""
    if not body.free or not body.drives.known:
        return None
    found = (blow for blow in _blows(scene, body, flyers) if blow is not None)
    return min(found, key=lambda blow: blow.time, default=None)


def _blows(scene: Scene, body: Flyer, flyers: Sequence[Flyer]) -> Iterator[Blow | None]:
    """First contacts of a body with each obstacle and each other body whose way is known."""
    dim = len(scene.vector_gravity.values[0])
    for obstacle in obstacles_of(scene, body.name):

        def near(t: float, obstacle: Any = obstacle) -> tuple[Floats, Floats]:
            gap, normal = signed_distance(obstacle, (body.points + body.drives.at(t))[:, :dim], t)
            return gap, as_vectors(normal)

        friction = friction_of(scene, body.name, obstacle.name)
        yield _blow(scene, body, near, friction, obstacle.name)
    pairs = [{one[0], two[0]} for one, two in body_pairs(scene)]
    for other in flyers:
        if other is body or {body.name, other.name} not in pairs or not other.drives.known:
            continue
        tree = cKDTree(other.points)

        def close(t: float, other: Flyer = other, tree: cKDTree = tree) -> tuple[Floats, Floats]:
            places = body.points + body.drives.at(t) - other.drives.at(t)
            return _between(places, body, other, tree)

        friction = friction_of(scene, body.name, other.name)
        yield _blow(scene, body, close, friction, other.name, other)


def _between(places: Floats, body: Flyer, other: Flyer, tree: Any) -> tuple[Floats, Floats]:
    """Distance of a body's points from the other body, and its normal, from the nearest points."""
    distance, nearest = tree.query(places)
    flatter = body.flat > other.flat[nearest]
    normal = np.where(flatter[:, None], -body.normals, other.normals[nearest])
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    apart = places - other.points[nearest]
    along = np.einsum("ij,ij->i", apart, normal)
    beside = np.sqrt(np.maximum(distance**2 - along**2, 0.0))
    facing = np.einsum("ij,ij->i", body.normals, other.normals[nearest]) < 0.0
    facing &= beside < 0.6 * spacing(other.points)
    return np.where(facing, along, distance), normal


def spacing(points: Floats) -> float:
    """Typical distance of neighbours [m]."""
    return float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))


def _blow(
    scene: Scene, body: Flyer, near: Callable[[float], tuple[Floats, Floats]], friction: float,
    met: str, other: Flyer | None = None,
) -> Blow | None:  # fmt: skip
    """The contact at the first time at which a gap is closed; None if it stays open."""
    times = np.linspace(0.0, scene.duration, _SAMPLES)
    open_until = 0.0
    for time in times:
        if near(time)[0].min() <= 1e-6 * body.size:
            break
        open_until = time
    else:
        return None
    low, high = open_until, time
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if near(middle)[0].min() <= 0.0 else (middle, high)
    time = high
    gap, normals = near(time)
    first = int(np.argmin(gap))
    # Speeds from places a little earlier, or later at the start: obstacles may move.
    small = 1e-3 * scene.duration / _SAMPLES
    before = max(0.0, time - small)
    speed = float(near(before)[0][first] - near(before + small)[0][first]) / small
    share = 1.0 if other is None else other.impedance / (other.impedance + body.impedance)
    depth = max(1e-3, max(0.0, speed) * share / body.wave_speed) * body.size
    weights = np.maximum(0.0, depth - (gap - gap[first])) * np.linalg.norm(body.normals, axis=1)
    touching = weights > 0.0
    weights = weights[touching]
    normal = weights @ normals[touching]
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    arms = (body.points - body.centre)[touching]
    middle_arm = weights @ arms / weights.sum()

    def speed_at(flying: Flyer, arm: Floats) -> Floats:
        drives, steps = flying.drives, (before + small, before)
        velocity, spin = ((f(steps[0]) - f(steps[1])) / small for f in (drives.at, drives.turned))
        return velocity + np.cross(spin, arm)

    slip = speed_at(body, middle_arm)
    if other is not None:
        place = middle_arm + body.centre + body.drives.at(time)
        slip -= speed_at(other, place - other.centre - other.drives.at(time))
    along = slip - (slip @ normal) * normal
    clearance = float(np.partition(gap, 1)[1] - gap[first]) if len(gap) > 1 else math.inf
    return Blow(
        time, arms, weights, normal, max(0.0, speed), along, clearance, friction, met, other
    )
