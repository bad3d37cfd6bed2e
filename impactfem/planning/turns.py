"""How far bodies will turn and be strained: rigid bodies up to their first contact, then one blow.

A body flies as a rigid one until it first meets an obstacle or another body. There it takes the
impulse of a rigid impact that gives back all speed, at the middle of what touches: a normal one,
which turns the body if its line misses the centre of mass, and that of friction until it sticks.
What weight presses on after that rubs on. The body then turns for the rest of the duration. Its
strain is that of a wave, speed over wave speed, several times as much at a curved contact. All this
is right to a factor of about 2: enough to tell which scenes are none for small strains.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from impactfem.contact.boundary import Boundary, everywhere
from impactfem.contact.distance import signed_distance
from impactfem.fem import MPI
from impactfem.findings import Finding
from impactfem.planning.model_limits import rotation_findings, strain_findings
from impactfem.scene import Scene, Solid
from impactfem.scene.pairing import body_pairs, friction_of, obstacles_of
from impactfem.system.elastic import ElasticSystem

Floats = NDArray[np.float64]

_SAMPLES = 64  # times at which bodies are looked at on their way
_FLAT, _CURVED = 1.2, 3.0
"""Strain of 1 % of the volume over speed / wave speed, where a face or a curve meets (measured)."""

_WIDE = 0.5
"""Share of a body's width from which what touches is a face."""


@dataclass(frozen=True)
class Flyer:
    """A solid as a rigid body, in three coordinates also if it is plane.

    Attributes:
        name: Of the body.
        free: Whether nothing holds or drives it: then its way is known.
        mass: [kg]; infinite if it is held.
        inverse: Inverse inertia, 0 where cuts or the model let nothing turn [1/(kg m^2)], (3, 3).
        centre: Of mass, at t = 0 [m], (3,).
        velocity: Of the centre of mass, at t = 0 [m/s], (3,).
        spin: At t = 0 [rad/s], (3,).
        points: Places of the outside at t = 0 [m], (points, 3).
        normals: Its outward normals, by area [m^2], (points, 3).
        flat: How flat the outside is there: 1 on a face, less at edges, (points,).
        wave_speed: Of long waves, sqrt(E / rho) [m/s].
        impedance: Density times wave speed [kg/(m^2 s)].
    """

    name: str
    free: bool
    mass: float
    inverse: Floats
    centre: Floats
    velocity: Floats
    spin: Floats
    points: Floats
    normals: Floats
    flat: Floats
    wave_speed: float
    impedance: float

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
        other: Inverse mass that gives way on the other side [1/kg].
        friction: Coefficient.
        share: Of the speed that goes into this body as strain.
        met: What it meets, in words.
    """

    time: float
    arms: Floats
    weights: Floats
    normal: Floats
    speed: float
    along: Floats
    other: float
    friction: float
    share: float
    met: str


def turn_findings(
    scene: Scene, parts: Sequence[tuple[Solid, ElasticSystem, Boundary]]
) -> list[Finding]:
    """What bodies will turn and be strained beyond small strains (collective).

    Args:
        scene: The scene.
        parts: The solids with their matrices and outsides.
    """
    flyers = [_flyer(*part) for part in parts]
    way = _fall(scene)
    found: list[Finding] = []
    for flyer in flyers:
        blow = _first(_blows(scene, flyer, flyers, way)) if flyer.free else None
        gravity = _gravity(scene, 0.0 if blow is None else blow.time)
        spun = float(np.linalg.norm(flyer.spin)) * scene.duration if flyer.inverse.any() else 0.0
        turned = 0.0 if blow is None else _turned(flyer, blow, scene.duration, gravity)
        why = "as it spins" if spun >= turned or blow is None else f"as it meets {blow.met}"
        found += rotation_findings(flyer.name, math.atan(spun + turned), why)
        if blow is not None:
            strain = _strain(flyer, blow)
            why = f"as it meets {blow.met} at {blow.speed:.3g} m/s"
            found += strain_findings(flyer.name, strain, why)
    return found


def _flyer(solid: Solid, system: ElasticSystem, outside: Boundary) -> Flyer:
    """A solid as a rigid body (collective)."""
    planes = dict(system.supports.planes)
    held = any(support.kind != "symmetry" for support in solid.supports)
    driven = bool(held or solid.tractions or solid.pressures)
    mass, centre = system.total_mass, system.center_of_mass
    arm = _in_space(system.positions - centre)
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
    speed = math.sqrt(solid.youngs_modulus / solid.density)
    spin = np.atleast_1d(np.asarray(solid.angular_velocity, dtype=np.float64))
    velocity = system.mean(system.velocity)
    return Flyer(
        name=solid.name,
        free=not driven,
        mass=math.inf if held else mass,
        inverse=inverse,
        centre=_in_space(centre[None])[0],
        velocity=_in_space(velocity[None])[0] * (not held),
        spin=np.array([0.0, 0.0, spin[0]]) if len(spin) == 1 else spin,
        points=_in_space(outside.points + moved),
        normals=_in_space(normals),
        flat=np.linalg.norm(normals, axis=1) / np.maximum(areas, 1e-300),
        wave_speed=speed,
        impedance=solid.density * speed,
    )


def _in_space(vectors: Floats) -> Floats:
    """Vectors with a third component."""
    found = np.zeros((len(vectors), 3))
    found[:, : vectors.shape[1]] = vectors
    return found


def _gravity(scene: Scene, time: float) -> Floats:
    pull = np.asarray(scene.vector_gravity.at(time), dtype=np.float64)
    found: Floats = _in_space(pull[None])[0]
    return found


def _fall(scene: Scene) -> Callable[[float], Floats]:
    """Way of a body at rest by gravity up to a time [m]."""
    times = np.linspace(0.0, scene.duration, 8 * _SAMPLES + 1)
    pull = np.array([_gravity(scene, t) for t in times])
    step = times[1]
    speed = np.cumsum(np.vstack([np.zeros(3), 0.5 * step * (pull[1:] + pull[:-1])]), axis=0)
    way = np.cumsum(np.vstack([np.zeros(3), 0.5 * step * (speed[1:] + speed[:-1])]), axis=0)
    return lambda t: np.array([np.interp(t, times, column) for column in way.T])


def _blows(
    scene: Scene, body: Flyer, flyers: Sequence[Flyer], fall: Callable[[float], Floats]
) -> Iterator[Blow | None]:
    """First contacts of a body with each obstacle and each other body."""
    dim = len(scene.vector_gravity.values[0])
    for obstacle in obstacles_of(scene, body.name):

        def near(t: float, obstacle: Any = obstacle) -> tuple[Floats, Floats]:
            places = body.points + body.velocity * t + fall(t)
            gap, normal = signed_distance(obstacle, places[:, :dim], t)
            return gap, _in_space(normal)

        friction = friction_of(scene, body.name, obstacle.name)
        yield _blow(scene, body, near, 0.0, friction, 1.0, obstacle.name, fall)
    pairs = [{one[0], two[0]} for one, two in body_pairs(scene)]
    for other in flyers:
        if other is body or {body.name, other.name} not in pairs:
            continue
        tree = cKDTree(other.points)

        def close(t: float, other: Flyer = other, tree: cKDTree = tree) -> tuple[Floats, Floats]:
            falls = float(body.free) - float(other.free)
            places = body.points + (body.velocity - other.velocity) * t + falls * fall(t)
            return _between(places, body, other, tree)

        friction = friction_of(scene, body.name, other.name)
        share = other.impedance / (other.impedance + body.impedance)
        give = 1.0 / other.mass
        yield _blow(scene, body, close, give, friction, share, other.name, fall, other)


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
    facing &= beside < 0.6 * _spacing(other.points)
    return np.where(facing, along, distance), normal


def _spacing(points: Floats) -> float:
    """Typical distance of neighbours [m]."""
    return float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))


def _first(blows: Iterator[Blow | None]) -> Blow | None:
    return min((b for b in blows if b is not None), key=lambda b: b.time, default=None)


def _blow(
    scene: Scene, body: Flyer, near: Callable[[float], tuple[Floats, Floats]], other: float,
    friction: float, share: float, met: str, fall: Callable[[float], Floats],
    partner: Flyer | None = None,
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
    depth = max(1e-3, max(0.0, speed) * share / body.wave_speed) * body.size
    weights = np.maximum(0.0, depth - (gap - gap[first])) * np.linalg.norm(body.normals, axis=1)
    touching = weights > 0.0
    weights = weights[touching]
    normal = weights @ normals[touching]
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    arms = (body.points - body.centre)[touching]
    velocity = body.velocity + (fall(before + small) - fall(before)) / small
    middle_arm = weights @ arms / weights.sum()
    slip = velocity + np.cross(body.spin, middle_arm)
    if partner is not None:
        place = middle_arm + body.centre + body.velocity * time + fall(time)
        there = partner.centre + partner.velocity * time + partner.free * fall(time)
        slip -= partner.velocity + np.cross(partner.spin, place - there)
        slip -= partner.free * (fall(before + small) - fall(before)) / small
    along = slip - (slip @ normal) * normal
    return Blow(time, arms, weights, normal, max(0.0, speed), along, other, friction, share, met)


def _turned(body: Flyer, blow: Blow, duration: float, gravity: Floats) -> float:
    """How far a body turns after its first contact [rad]."""
    left = max(0.0, duration - blow.time)
    normal, weights = blow.normal, blow.weights / blow.weights.sum()
    across = blow.arms - np.outer(blow.arms @ normal, normal)
    middle = weights @ across
    # The middle of what touches is known to half the distance of neighbours.
    length = float(np.linalg.norm(middle))
    middle *= max(0.0, length - 0.5 * _spacing(body.points)) / max(length, 1e-300)
    turn = body.inverse @ np.cross(middle, normal)
    give = 1.0 / body.mass + blow.other + float(np.cross(turn, middle) @ normal)
    impulse = 2.0 * blow.speed / give
    angle = float(np.linalg.norm(turn)) * impulse * left
    slip = float(np.linalg.norm(blow.along))
    if blow.friction <= 0.0 or slip <= 1e-9 * body.wave_speed:
        return angle
    forward = blow.along / slip
    height = -float(weights @ (blow.arms @ normal))
    # Pressure that moves forward holds against tipping, as far as the face reaches.
    foot = max(0.0, float((across @ forward).max()))
    lever = max(0.0, blow.friction * height - foot) / blow.friction
    turn = body.inverse @ np.cross(-height * normal, -forward)
    sticks = slip / (1.0 / body.mass + blow.other + height * float(np.linalg.norm(turn)))
    pressed = max(0.0, -float(gravity @ normal)) * body.mass
    rate = float(np.linalg.norm(turn)) * lever / max(height, 1e-300)
    start, growth = min(blow.friction * impulse, sticks), blow.friction * pressed
    until = left if growth <= 0.0 else min(left, (sticks - start) / growth)
    grown = start * until + 0.5 * growth * until**2
    return angle + rate * (grown + (start + growth * until) * (left - until))


def _strain(body: Flyer, blow: Blow) -> float:
    """Strain that 1 % of the volume exceeds, about."""
    across = blow.arms - np.outer(blow.arms @ blow.normal, blow.normal)
    points = body.points - np.outer(body.points @ blow.normal, blow.normal)
    wide = np.ptp(across, axis=0).max() > _WIDE * np.ptp(points, axis=0).max()
    return (_FLAT if wide else _CURVED) * blow.share * blow.speed / body.wave_speed
