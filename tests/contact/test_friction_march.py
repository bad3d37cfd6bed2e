"""Masses and springs with friction, marched by the layers of the schemes: closed forms, energy."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impactfem.contact.friction_solver import Solving
from impactfem.contact.layer_law import Layer, solve_layer
from impactfem.contact.speed_law import Halfway

_TOLERANCE = 1e-14
_GRAVITY = 9.81


def at_speed(free, speed, response, place, friction, dt):
    """Nodes with mass only, without restitution."""
    rows = np.ones(len(free), dtype=bool)
    halfway = Halfway(rows, 0.5 * dt * speed, ~rows)
    before, static = (np.zeros_like(place), place), np.zeros_like(response)
    layer = Layer(free, response, static, before, friction, halfway=halfway)
    return solve_layer(layer, "middle", Solving.to(1e-15))


class March:
    """Midpoint or leapfrog layers of K u with contact dofs that have no mass, or have it.

    Args:
        stiffness: K, shape (n, n).
        mass: Lumped masses, shape (n,), 0 for contact dofs without mass.
        rows: Contact dofs, normal first, shape (pairs, dim).
        height: Of the contact nodes above the ground.
        mu: Friction coefficient.
        dt: Time step.
        displacement, velocity, load: Shape (n,).
        force: Contact forces at t = 0, shape (pairs, dim).
        rule: Of `solve_layer`, or "velocity".
    """

    def __init__(self, stiffness, mass, rows, height, mu, dt, displacement, velocity, load,
                 force=None, rule="conserving"):  # fmt: skip
        self.stiffness, self.mass, self.rows, self.height = stiffness, mass, rows, height
        self.dt, self.load, self.rule = dt, load, rule
        self.mu = np.full(len(rows), mu)
        self.contact, self.inside = rows.ravel(), np.flatnonzero(mass > 0.0)
        self.massless = not mass[self.contact].any()
        self.displacement, self.velocity = displacement.copy(), velocity.copy()
        size = rows.size
        self.compliance = np.zeros((size, size))
        if self.massless:
            block = stiffness[np.ix_(self.contact, self.contact)]
            self.compliance = np.linalg.inv(block)
            self.pull = stiffness[np.ix_(self.contact, self.inside)]
        units = np.zeros((len(mass), size))
        units[self.contact, np.arange(size)] = 1.0
        self.inverse = np.linalg.inv(stiffness + np.diag(4.0 / dt**2 * mass))
        response = np.array([self.surface(2.0 * self.inverse @ b, 0.0) for b in units.T])
        self.response = 0.5 * (response + response.T)
        self.force = np.zeros(rows.shape) if force is None else force
        self.place = self.free_place() + self.times(self.compliance, self.force)
        self.heat = 0.0
        self.put()

    @staticmethod
    def times(matrix, values):
        return (matrix @ values.ravel()).reshape(values.shape)

    def surface(self, displacement, loaded=1.0):
        """Contact dofs, in equilibrium without contact forces if they have no mass."""
        if not self.massless:
            return displacement[self.contact]
        load = loaded * self.load[self.contact]
        return self.compliance @ (load - self.pull @ displacement[self.inside])

    def free_place(self):
        place = self.surface(self.displacement).reshape(self.rows.shape).copy()
        place[:, 0] += self.height
        return place

    def put(self):
        if self.massless:
            self.displacement[self.contact] = self.place.ravel()
            self.displacement[self.rows[:, 0]] -= self.height

    def energy(self):
        u, v = self.displacement, self.velocity
        return 0.5 * v @ (self.mass * v) + 0.5 * u @ self.stiffness @ u - self.load @ u

    def layer(self):
        """One midpoint layer; returns its contact and the slips."""
        dt, before = self.dt, self.displacement.copy()
        motion = 4.0 / dt**2 * before + 2.0 / dt * self.velocity
        self.displacement = 2.0 * self.inverse @ (self.load + self.mass * motion) - before
        free, place = self.free_place(), self.place
        if self.rule == "velocity":
            speed = 2.0 / dt * (free - place) - self.velocity[self.rows]
            found = at_speed(free, speed, self.response, place, self.mu, dt)
        else:
            state = self.force, place
            layer = Layer(free, self.response, self.compliance, state, self.mu)
            found = solve_layer(layer, self.rule, Solving.to(_TOLERANCE))
        push = np.zeros(len(self.mass))
        push[self.contact] = found.force.ravel()
        self.displacement += 2.0 * self.inverse @ push
        moved = self.displacement - before
        self.velocity[self.inside] *= -1.0
        self.velocity[self.inside] += 2.0 / dt * moved[self.inside]
        self.force, self.place = found.multiplier, found.place
        self.put()
        self.heat -= found.work.sum()
        return found, (found.place - place)[:, 1:]


def lattice(shape, massless=True):
    """A block of unit masses, springs along edges and face diagonals; lowest plane in contact."""
    points = np.array(list(product(*(range(count) for count in shape))), dtype=float)
    count, dim = points.shape
    stiffness = np.zeros((count * dim, count * dim))
    for i in range(count):
        for j in range(i):
            way = points[i] - points[j]
            length = np.linalg.norm(way)
            if length < 1.5:
                stretch = np.zeros((count, dim))
                stretch[i], stretch[j] = way / length, -way / length
                stiffness += np.outer(stretch, stretch) / length
    low = np.flatnonzero(points[:, -1] == 0.0)
    mass = np.ones((count, dim))
    if massless:
        mass[low] = 0.0
    rows = low[:, None] * dim + np.array([dim - 1, *range(dim - 1)])
    return points, stiffness, mass.ravel(), rows


def thrown(shape, mu, velocity, spin=0.0, rule="conserving", dt=0.2):
    points, stiffness, mass, rows = lattice(shape, massless=rule in ("conserving", "dissipative"))
    speed = np.tile(np.asarray(velocity, dtype=float), (len(points), 1))
    speed[:, 0] += spin * points[:, -1]
    load = np.zeros(points.shape)
    load[:, -1] = -0.002
    return March(
        stiffness, mass, rows, 0.2, mu, dt, np.zeros(len(mass)), speed.ravel() * (mass > 0.0),
        load.ravel(), rule=rule,
    )  # fmt: skip


def block(dim, mu, slope, dt, tension, velocity=0.0, direction=None):
    """A mass on a massless foot, pressed on an incline; ``tension`` is the foot's drag at t = 0."""
    mass, stiffness, push = 2.0, 3e3, np.zeros(dim)
    push[: dim - 1] = np.eye(dim - 1)[0] if direction is None else direction
    spring = np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), stiffness * np.eye(dim))
    rows = dim + np.array([[dim - 1, *range(dim - 1)]])
    weight = mass * _GRAVITY * np.cos(slope)
    load = np.zeros(2 * dim)
    load[:dim] = mass * _GRAVITY * np.sin(slope) * push
    load[dim - 1] = -weight
    displacement = np.zeros(2 * dim)
    displacement[:dim] = tension / stiffness * push
    displacement[dim - 1] = -weight / stiffness
    speed = np.zeros(2 * dim)
    speed[:dim] = velocity * push
    force = np.array([[weight, *(-tension * push[: dim - 1])]])
    masses = np.repeat([mass, 0.0], dim)
    march = March(spring, masses, rows, 0.0, mu, dt, displacement, speed, load, force)
    return march, push, weight


@pytest.mark.parametrize("margin", [1e-2, 1e-6])
def test_block_sticks_on_a_slope_below_the_friction_angle(margin):
    slope = np.arctan(0.5)
    march, push, _ = block(2, 0.5 * (1.0 + margin), slope, 1e-2, 2.0 * _GRAVITY * np.sin(slope))
    start = march.displacement.copy()
    for _ in range(200):
        march.layer()
    assert march.displacement == pytest.approx(start, abs=1e-12)
    assert march.force[0, 1:] == pytest.approx(-2.0 * _GRAVITY * np.sin(slope) * push[:1])
    assert march.heat == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("margin", [1e-2, 1e-6])
@pytest.mark.parametrize("dim", [2, 3])
def test_block_slides_with_the_right_acceleration(margin, dim):
    """A foot that slips drags with mu times the weight: the mass is accelerated evenly."""
    slope, mu = np.arctan(0.5), 0.5 * (1.0 - margin)
    drag = mu * 2.0 * _GRAVITY * np.cos(slope)
    along = np.array([0.6, 0.8])[: dim - 1] if dim == 3 else np.ones(1)
    march, _, weight = block(dim, mu, slope, 1e-2, drag, direction=along)
    start = march.displacement[: dim - 1].copy()
    for _ in range(200):
        march.layer()
    way = 0.5 * _GRAVITY * (np.sin(slope) - mu * np.cos(slope)) * 2.0**2
    assert march.displacement[: dim - 1] - start == pytest.approx(way * along, abs=1e-10)
    assert march.place[0, 1:] == pytest.approx(way * along, abs=1e-10)
    assert march.heat == pytest.approx(mu * weight * way, abs=1e-9)


@pytest.mark.parametrize("dt", [1e-2, 2.5e-3])
def test_sliding_block_stops_after_the_right_distance(dt):
    mu, speed = 0.3, 1.0
    march, _, weight = block(2, mu, 0.0, dt, mu * 2.0 * _GRAVITY, velocity=speed)
    start = march.energy()
    path = 0.0
    for _ in range(int(speed / (mu * _GRAVITY * dt)) + 300):
        _, slip = march.layer()
        path += float(np.abs(slip).sum())
    # The speed of the last layer, at most mu g dt, may be counted wrongly for a layer or two; then
    # the mass swings on the foot, which stays.
    expected, last = speed**2 / (2.0 * mu * _GRAVITY), 2.0 * mu * _GRAVITY * dt**2
    assert march.place[0, 1] == pytest.approx(expected, abs=last)
    assert march.heat == pytest.approx(mu * weight * path, abs=mu * weight * last)
    assert march.energy() + march.heat == pytest.approx(start, abs=1e-10)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.0, 6.28))
def test_no_direction_is_preferred(angle):
    """A block on a slope that falls at any angle to the axes slides straight down."""
    along = np.array([np.cos(angle), np.sin(angle)])
    slope, mu = 0.4, 0.2
    march, _, _ = block(3, mu, slope, 1e-2, 0.0, direction=along)
    for _ in range(40):
        march.layer()
    way = march.place[0, 1:]
    length = np.linalg.norm(way)
    assert length > 0.1
    assert way / length == pytest.approx(along, abs=1e-10)


@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from([(4, 3), (3, 3, 2)]), st.floats(0.05, 1.5), st.floats(-0.15, 0.15),
    st.floats(-0.03, 0.03),
)  # fmt: skip
def test_a_thrown_block_loses_the_frictional_work_and_nothing_else(shape, mu, across, spin):
    velocity = [across, *([0.5 * across] * (len(shape) - 2)), -0.1]
    march = thrown(shape, mu, velocity, spin)
    start, touched = march.energy(), False
    for _ in range(120):
        before, heat = march.energy(), march.heat
        found, _ = march.layer()
        assert march.heat >= heat
        assert march.energy() - before == pytest.approx(heat - march.heat, abs=1e-13)
        assert found.place[:, 0].min() >= -1e-12
        assert found.force[:, 0].min() >= 0.0
        drag = np.linalg.norm(found.force[:, 1:], axis=1)
        assert (drag <= mu * found.force[:, 0] + 1e-12).all()
        touched |= bool(found.force.any())
    assert touched
    assert march.energy() + march.heat == pytest.approx(start, abs=1e-12)


def test_dissipative_rule_gives_no_energy_over_many_impacts():
    march = thrown((4, 3), 0.4, [0.1, -0.1], 0.02, rule="dissipative")
    start = march.energy()
    for _ in range(600):
        before, heat = march.energy(), march.heat
        march.layer()
        assert march.energy() - before <= heat - march.heat + 1e-13
    assert march.heat > 0.05 * start


def test_the_block_turned_by_a_right_angle_moves_alike():
    one, two = (
        thrown((3, 3, 2), 0.4, velocity) for velocity in ([0.1, 0.03, -0.1], [0.03, 0.1, -0.1])
    )
    for _ in range(100):
        one.layer()
        two.layer()
    assert one.heat > 1e-3
    swapped = two.displacement.reshape(3, 3, 2, 3).transpose(1, 0, 2, 3)[..., [1, 0, 2]]
    assert one.displacement == pytest.approx(swapped.ravel(), abs=1e-10)


@pytest.mark.parametrize("rule", ["middle", "velocity"])
def test_friction_takes_energy_from_contact_nodes_with_mass(rule):
    march = thrown((4, 3), 0.4, [0.1, -0.1], rule=rule)
    for _ in range(300):
        before = march.energy()
        place = march.place
        found, slip = march.layer()
        drag = np.linalg.norm(found.force[:, 1:], axis=1)
        assert (drag <= 0.4 * found.force[:, 0] + 1e-12).all()
        normal = float(found.force[:, 0] @ (found.place - place)[:, 0])
        assert march.energy() - before - normal == pytest.approx(found.work.sum(), abs=1e-12)
        if rule == "middle":
            speed = np.linalg.norm(slip, axis=1)
            assert found.work == pytest.approx(-0.4 * found.force[:, 0] * speed, abs=1e-12)
    assert march.heat > 0.01


def explicit(march, layers, *, from_now):
    """Leapfrog layers of a march: tangential multipliers, and the worst error of the balance."""
    i, c, dt = march.inside, march.contact, march.dt
    push = march.stiffness[np.ix_(i, c)] @ march.compliance
    inverse = 1.0 / march.mass[i]
    response = push.T @ (dt**2 * inverse[:, None] * push)
    condensed = march.stiffness[np.ix_(i, i)] - push @ march.pull
    load = march.load[i] - push @ march.load[c]
    u, step = march.displacement[i].copy(), dt * march.velocity[i]
    older, old = np.zeros(march.rows.shape), np.zeros(march.rows.shape)
    place_older, place = march.place, march.place
    forces, error, given, energy = [], 0.0, 0.0, None
    for layer in range(layers):
        share = 0.5 if layer == 0 else 1.0
        free = u + step + share * dt**2 * inverse * (load - condensed @ u)
        march.displacement[i] = free
        law = Layer(
            march.free_place(), share * response, march.compliance, (older, place_older), march.mu,
            held=place[:, 1:] if from_now else None,
        )  # fmt: skip
        found = solve_layer(law, "conserving", Solving.to(_TOLERANCE))
        end = free - share * dt**2 * inverse * (push @ found.force.ravel())
        step = end - u
        older, old = old, found.multiplier
        place_older, place = place, found.place
        stored = sum((f * march.times(march.compliance, f)).sum() for f in (older, old))
        now = (
            0.5 * step @ (march.mass[i] * step) / dt**2 + 0.5 * u @ condensed @ end
            - 0.5 * load @ (u + end) + 0.25 * stored
        )  # fmt: skip
        work = 0.5 * found.work.sum()
        if energy is not None:
            error, given = max(error, abs(now - energy - work)), max(given, work)
        energy, u = now, end
        forces.append(old[:, 1:].copy())
    return np.array(forces), error, given


@pytest.mark.parametrize("mu", [0.3, 1.0])
def test_explicit_layers_keep_the_balance_and_do_not_alternate(mu):
    """Slip counted from the level before last would let even and odd levels stick apart."""
    rough = {}
    for from_now in (True, False):
        march = thrown((5, 4), mu, [0.06, -0.1], dt=0.25)
        forces, error, given = explicit(march, 250, from_now=from_now)
        assert error <= 1e-13
        assert given <= (1e-4 if from_now else 0.0)  # of 0.1 [J]
        bends = np.abs(forces[2:] - 2.0 * forces[1:-1] + forces[:-2]).sum()
        rough[from_now] = bends / np.abs(forces).sum()
    assert rough[True] < 0.6 * rough[False]
