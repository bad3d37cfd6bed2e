"""Points of a scene as one system: linear where forces are affine and obstacles flat."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import PiecewiseConstant, PiecewiseVector, Point, Scene, Spring
from impactfem.scene.affine import affine_parts
from impactfem.scene.breaks import Break
from impactfem.scene.means import StepMean, stops_of
from impactfem.scene.points import COORDINATES
from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.system.point_gaps import Gap, make_gap
from impactfem.system.point_springs import SpringForce


@dataclass(frozen=True)
class PointsSystem:
    """Points as a system.

    Attributes:
        system: Coordinates: x, y, z of the first point, of the second, ...
        labels: Names of the constraints, as "ball on floor".
        elastic: Energy of the springs as a function of u [J].
        conservative: Whether a potential is known: no force depends on time or on other than
            linear functions of positions, and no obstacle moves. Dampers are allowed.
    """

    system: GeneralizedSystem
    labels: tuple[str, ...]
    elastic: Callable[[Floats], float]
    conservative: bool


@dataclass(frozen=True)
class FreePoints:
    """Points without gravity and contacts.

    Attributes:
        system: As of `PointsSystem`, without constraints.
        elastic: Energy of the springs as a function of u [J].
        load: Mean forces by formula, (start, end, u, v) -> (d,) [N]; None without any.
    """

    system: GeneralizedSystem
    elastic: Callable[[Floats], float]
    load: Callable[[float, float, Floats, Floats], Floats] | None


def free_points(points: Sequence[Point]) -> FreePoints:
    """Make the system of points that nothing touches.

    Raises:
        SceneError: A spring has no direction.
    """
    dim = points[0].dim
    springs = _springs(points)
    loads = _Loads(points, PiecewiseVector((0.0,), ((0.0,) * dim,)))
    mass = np.repeat([p.mass for p in points], dim)

    def elastic(u: Floats) -> float:
        return sum(spring.energy(u) for spring in springs)

    formulas = any(p.force is not None for p in points)
    load = loads.mean if formulas else None
    if loads.is_affine and all(spring.is_linear for spring in springs):
        stiffness, damping, pull = _linear_part(loads, springs)
        system: GeneralizedSystem = LinearSystem(
            mass=mass, stiffness=stiffness, damping=damping, normals=np.zeros((0, len(mass))),
            load=_signals(loads, pull), offsets=np.zeros(0),
        )  # fmt: skip
        return FreePoints(system, elastic, load)
    system = GeneralizedSystem(
        mass=mass, force=_Forces(loads, springs), constraints=lambda _: np.zeros(0)
    )
    return FreePoints(system, elastic, load)


def points_system(scene: Scene) -> PointsSystem:
    """Make the system of the points of a scene.

    Raises:
        SceneError: A point starts inside an obstacle or another point.
    """
    points = scene.points
    names = [f"{p.name}.{letter}" for p in points for letter in COORDINATES[: scene.dim]]
    pairs = contact_pairs(scene)
    gaps = [make_gap(points, scene, pair) for pair, _ in pairs]
    labels = tuple(f"{one} on {two}" for (one, two), _ in pairs)
    _check_gaps(points, gaps, labels)
    restitution = [e for _, e in pairs]
    springs = _springs(points)
    loads = _Loads(points, scene.vector_gravity)
    mass = np.repeat([p.mass for p in points], scene.dim)
    flat = all(gap.normal is not None for gap in gaps)
    straight = all(spring.is_linear for spring in springs)
    motion = [gap.motion for gap in gaps]
    still = all(signal.is_zero for signal in motion) and loads.is_conservative

    def elastic(u: Floats) -> float:
        return sum(spring.energy(u) for spring in springs)

    def potential(_: float, u: Floats) -> float:
        return elastic(u) + (loads.potential(u) if still else 0.0)

    if flat and straight and loads.is_affine:
        stiffness, damping, pull = _linear_part(loads, springs)
        system: GeneralizedSystem = LinearSystem(
            mass=mass,
            stiffness=stiffness,
            damping=damping,
            load=_signals(loads, pull),
            normals=np.array([gap.normal for gap in gaps]),
            offsets=np.array([gap.offset for gap in gaps]),
            restitution=restitution,
            motion=motion,
            potential=potential,
            names=names,
        )
        return PointsSystem(system, labels, elastic, still)

    system = GeneralizedSystem(
        mass=mass,
        force=_Forces(loads, springs),
        constraints=lambda u: np.array([gap.distance(np.asarray(u)) for gap in gaps]),
        jacobian=lambda u: np.array([gap.gradient(u) for gap in gaps]),
        restitution=restitution,
        motion=motion,
        potential=potential,
        names=names,
    )
    return PointsSystem(system, labels, elastic, still)


def _linear_part(loads: "_Loads", springs: Sequence[SpringForce]) -> tuple[Floats, Floats, Floats]:
    """Stiffness, damping (d, d) and constant pull (d,) of affine loads and linear springs."""
    stiffness, damping = loads.stiffness.copy(), loads.damping.copy()
    pull = np.zeros(len(stiffness))
    for spring in springs:
        spring.add_to(stiffness, damping, pull)
    return stiffness, damping, pull


def _signals(loads: "_Loads", pull: Floats) -> list[Signal]:
    return [s.plus(Signal(float(p))) for s, p in zip(loads.signals, pull, strict=True)]


@dataclass(frozen=True)
class _Forces:
    """All forces as a function of time, place and velocity."""

    loads: "_Loads"
    springs: Sequence[SpringForce]

    def __call__(self, t: float, u: Floats, v: Floats) -> Floats:
        return self.mean(t, t, u, v)

    def stops(self, end: float) -> list[Break]:
        """Where they change, up to an end [s]."""
        return self.loads.stops(end)

    def mean(self, start: float, end: float, u: Floats, v: Floats) -> Floats:
        """Their means from one time to another."""
        total = self.loads.mean(start, end, u, v)
        for spring in self.springs:
            spring.push(total, u, v)
        return total


def contact_pairs(scene: Scene) -> list[tuple[tuple[str, str], float]]:
    """Pairs of names, a body first, and their restitution; all with all obstacles if none given."""
    bodies = {body.name for body in scene.bodies}
    if scene.contacts:
        pairs = []
        for contact in scene.laws.each:
            one, two = contact.between
            pairs.append(((one, two) if one in bodies else (two, one), contact.restitution))
        return pairs
    return [((b.name, o.name), 0.0) for b in scene.bodies for o in scene.obstacles]


def start_state(scene: Scene) -> tuple[Floats, Floats]:
    """Positions [m] and velocities [m/s] of the points at t = 0, each (points * dim,)."""
    points = scene.points
    position = np.concatenate([p.position for p in points]).astype(float)
    return position, np.concatenate([p.velocity or () for p in points]).astype(float)


def _springs(points: Sequence[Point]) -> list[SpringForce]:
    place = {p.name: index for index, p in enumerate(points)}
    found = []
    for index, point in enumerate(points):
        for spring in point.springs:
            other = None if spring.to is None else place[spring.to]
            _check_spring(point, spring, None if other is None else points[other])
            found.append(SpringForce(spring, index, other, points))
    return found


def _check_spring(point: Point, spring: Spring, other: Point | None) -> None:
    end = spring.anchor if other is None else other.position
    if spring.rest_length > 0.0 and np.array_equal(point.position, end or ()):
        raise SceneError(
            f"body {point.name}: a spring of rest_length = {spring.rest_length:g} has both ends at "
            f"{list(point.position)}, so that it has no direction; move an end or set rest_length 0"
        )


def _check_gaps(points: Sequence[Point], gaps: Sequence[Gap], labels: Sequence[str]) -> None:
    start = np.concatenate([p.position for p in points]).astype(float)
    for gap, label in zip(gaps, labels, strict=True):
        depth = gap.distance(start) - float(gap.motion(0.0))
        if depth < -1e-12 * max(float(np.abs(start).max()), abs(gap.offset), gap.reach):
            raise SceneError(
                f"{label}: they overlap by {-depth:.6g} m at t = 0; move one of them, or make the "
                "radius smaller"
            )


class _Loads:
    """Gravity and forces by formula."""

    def __init__(self, points: Sequence[Point], gravity: PiecewiseVector) -> None:
        self._points, self._gravity = points, gravity
        self._means = [tuple(map(StepMean, p.force or ())) for p in points]
        dim = points[0].dim
        size = dim * len(points)
        self.stiffness, self.damping = np.zeros((size, size)), np.zeros((size, size))
        self.signals = [_weight(p.mass, gravity, axis) for p in points for axis in range(dim)]
        self.is_affine = True
        for index, point in enumerate(points):
            for axis, formula in enumerate(point.force or ()):
                row = index * dim + axis
                parts = affine_parts(formula, point.state)
                if parts is None:
                    self.is_affine = False
                    continue
                columns = slice(index * dim, (index + 1) * dim)
                self.stiffness[row, columns] -= parts[0][:dim]
                self.damping[row, columns] -= parts[0][dim:]
                # What is no harmonic keeps its formula, whose means and breaks are known.
                left = formula.fixed(**dict.fromkeys(point.state, 0.0))
                signal = Signal(formulas=((1.0, left),)) if parts[1].rest else parts[1]
                self.signals[row] = self.signals[row].plus(signal)
        symmetric = np.array_equal(self.stiffness, self.stiffness.T)
        constant = all(signal.is_constant for signal in self.signals)
        self.is_conservative = self.is_affine and symmetric and constant

    def stops(self, end: float) -> list[Break]:
        """Where forces change, up to an end [s], as the states at the start have them."""
        found = [Break.at(time) for time in self._gravity.times[1:] if time < end]
        for point in self._points:
            still = point.position, point.velocity or (0.0,) * point.dim
            known = dict(zip(point.state, (*still[0], *still[1]), strict=True))
            for formula in point.force or ():
                found += stops_of(formula.fixed(**known), end)
        return found

    def potential(self, u: Floats) -> float:
        """Potential energy [J] of conservative loads."""
        constant = np.array([signal.constant for signal in self.signals])
        return float(0.5 * u @ (self.stiffness @ u) - constant @ u)

    def mean(self, start: float, end: float, u: Floats, v: Floats) -> Floats:
        """Mean forces from one time to another, at a state [N], shape (d,)."""
        dim = self._points[0].dim
        pull = np.asarray(self._gravity.mean(start, end), dtype=float)
        total = np.concatenate([p.mass * pull for p in self._points])
        for index, (point, means) in enumerate(zip(self._points, self._means, strict=True)):
            own = slice(index * dim, (index + 1) * dim)
            state = dict(zip(point.state, u[own].tolist() + v[own].tolist(), strict=True))
            for axis, mean in enumerate(means):
                total[index * dim + axis] += mean(start, end, **state)
        return total


def _weight(mass: float, gravity: PiecewiseVector, axis: int) -> Signal:
    weights = tuple(mass * vector[axis] for vector in gravity.values)
    if gravity.is_constant:
        return Signal(weights[0])
    return Signal(rest=PiecewiseConstant(gravity.times, weights))
