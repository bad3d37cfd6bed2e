"""The event-driven method against closed forms and against other coordinates."""

import math

import numpy as np
import pytest
import vibro_forms

from impactfem.errors import ConvergenceError, SceneError
from impactfem.exact import vibro
from impactfem.planning import plan
from impactfem.scene import Scene
from impactfem.scene.signal import Signal
from impactfem.shipped import find_scene
from impactfem.starting import starters
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events

G = 9.81


def ball(e, *, general=False, motion=None):
    if general:
        return GeneralizedSystem(
            mass=1.0, force=lambda *_: [-G], constraints=lambda u: u, restitution=e,
            potential=lambda _, u: G * float(u[0]), motion=motion,
        )  # fmt: skip
    return LinearSystem(
        mass=1.0, normals=[[1.0]], offsets=[0.0], load=[-G], restitution=e, motion=motion
    )


def line(masses, e, load=None):
    """Masses above one another on a floor."""
    n = len(masses)
    normals = np.eye(n) - np.eye(n, k=-1)
    return LinearSystem(mass=masses, normals=normals, offsets=np.zeros(n), load=load, restitution=e)


@pytest.mark.parametrize("general", [False, True])
def test_zeno_ball_stops_on_time_and_rests(general):
    exact = vibro.ZenoBall(1.0, 0.8, G)
    run = integrate_events(ball(0.8, general=general), [1.0], [0.0], 6.0, EventSettings(rows=60))
    start, end, _ = run.effort.details["sticking"][0]
    assert start == pytest.approx(exact.stopping_time, abs=1e-11)
    assert end == 6.0
    speeds = vibro_forms.rebound_speeds(exact, len(run.impacts))
    assert run.impacts.after == pytest.approx(speeds, rel=1e-5, abs=1e-12)
    assert run.impacts.time[:40] == pytest.approx(vibro_forms.impact_times(exact, 40), abs=1e-12)
    assert abs(run.position[-1, 0]) + abs(run.velocity[-1, 0]) <= 1e-15
    assert run.contact_force[-1] == pytest.approx(G, rel=1e-12)
    # What the floor gave is what gravity took.
    assert run.impulse.sum() == pytest.approx(6.0 * G, rel=1e-12)
    assert run.peak == pytest.approx(G, rel=1e-12)
    assert run.effort.details["impacts"] == len(run.impacts)


@pytest.mark.parametrize("stick", [1e-2, 1e-4, 1e-6])
def test_the_stopping_time_does_not_depend_on_the_threshold(stick):
    settings = EventSettings(rows=10, stick_speed=stick)
    run = integrate_events(ball(0.8), [1.0], [0.0], 6.0, settings)
    details = run.effort.details
    assert details["sticking"][0][0] == pytest.approx(4.063712768871578, abs=1e-12)
    assert details["stick_speed"] == stick
    assert 0.0 < details["stuck_at_speed"] <= stick
    assert details["energy_dropped"] == pytest.approx(0.5 * details["stuck_at_speed"] ** 2)


def test_energy_of_1e5_elastic_impacts():
    flight = 2.0 * math.sqrt(2.0 / G)
    run = integrate_events(ball(1.0), [1.0], [0.0], 1e5 * flight, EventSettings(rows=1000))
    assert len(run.impacts) == 100_000
    assert np.abs(run.total / G - 1.0).max() <= 1e-10
    swing = LinearSystem(mass=1.0, stiffness=1.0, normals=[[1.0]], offsets=[0.5], restitution=1.0)
    period = vibro.grazing_impact(0.5)[1]
    run = integrate_events(swing, [1.0], [0.0], (1e5 + 0.25) * period, EventSettings(rows=1000))
    assert len(run.impacts) == 100_000
    assert np.abs(run.total / 0.5 - 1.0).max() <= 1e-10


@pytest.mark.parametrize("depth", [0.5, 0.1, 1e-2, 1e-6])
def test_grazing_speed_and_period(depth):
    wall = LinearSystem(
        mass=1.0, stiffness=1.0, normals=[[1.0]], offsets=[1.0 - depth], restitution=1.0
    )
    speed, period = vibro.grazing_impact(depth)
    run = integrate_events(wall, [1.0], [0.0], 10.2 * period, EventSettings(rows=10))
    assert len(run.impacts) == 10
    # The offset 1 - d is rounded by eps/2: speed^2 = 2d is uncertain by eps, the speed by eps/4d.
    slack = 1e-12 + 10 * 2.0**-52 / (4.0 * depth)
    assert -run.impacts.before == pytest.approx(speed, rel=slack)
    assert run.impacts.time == pytest.approx(period * (np.arange(10) + 0.5), rel=1e-9)


def test_a_wall_that_is_just_not_reached_is_not_hit():
    free = LinearSystem(
        mass=1.0, stiffness=1.0, normals=[[1.0]], offsets=[1.0 + 1e-12], restitution=1.0
    )
    run = integrate_events(free, [1.0], [0.0], 20.0, EventSettings(rows=20))
    assert len(run.impacts) == 0
    assert run.position[:, 0] == pytest.approx(np.cos(run.times), abs=1e-13)


def test_stiff_linear_motion_is_exact():
    # Two masses, a damper and a harmonic load, against complex amplitudes of the steady motion.
    mass, stiffness = np.diag([1.0, 2.0]), np.array([[3e4, -1e4], [-1e4, 1e4]])
    damping, w = 1e-3 * stiffness + 0.1 * mass, 37.0
    load = np.array([0.0, 5.0])
    amplitude = np.linalg.solve(stiffness - w * w * mass + 1j * w * damping, load)
    system = LinearSystem(
        mass=mass, stiffness=stiffness, damping=damping, normals=[[1.0, 0.0]], offsets=[1.0],
        load=[Signal(), Signal(harmonics=((w, 5.0, 0.0),))],
    )  # fmt: skip
    start = amplitude.real, (1j * w * amplitude).real
    run = integrate_events(system, *start, 20.0, EventSettings(rows=200))
    exact = (amplitude * np.exp(1j * w * run.times[:, None])).real
    assert np.abs(run.position - exact).max() <= 1e-12 * np.abs(exact).max()


@pytest.mark.parametrize("angle", [math.pi / 2, math.pi / 3, 2 * math.pi / 5])
def test_corner_sends_back_as_the_unfolded_ray(angle):
    normals = [[0.0, 1.0], [math.sin(angle), -math.cos(angle)]]
    corner = LinearSystem(mass=[1.0, 1.0], normals=normals, offsets=[0.0, 0.0], restitution=1.0)
    psi = 0.5 * angle + math.pi + 0.1
    v = np.array([math.cos(psi), math.sin(psi)])
    side = np.array([-v[1], v[0]])
    for offset in (-0.2, -1e-3, -1e-9, 1e-9, 1e-3, 0.2):
        start = -v + offset * side
        run = integrate_events(corner, start, v, 5.0, EventSettings(rows=5))
        exact = vibro.elastic_corner(angle, v, int(run.impacts.constraint[0]))
        assert run.velocity[-1] == pytest.approx(exact.velocity, abs=1e-12)
        assert len(run.impacts) == exact.hits
        assert run.impacts.constraint[0] == (1 if offset < 0.0 else 0)


@pytest.mark.parametrize("angle", [math.pi / 3, math.pi / 2, 2.2])
def test_anelastic_corner_follows_moreau(angle):
    normals = [[0.0, 1.0], [math.sin(angle), -math.cos(angle)]]
    corner = LinearSystem(mass=[1.0, 1.0], normals=normals, offsets=[0.0, 0.0], restitution=0.0)
    psi = 0.5 * angle + math.pi + 0.1
    v = np.array([math.cos(psi), math.sin(psi)])
    start = -v + 0.2 * np.array([-v[1], v[0]])
    run = integrate_events(corner, start, v, 5.0, EventSettings(rows=500))
    slide, after = vibro_forms.anelastic_corner(angle, v, 0)
    first = run.times > run.impacts.time[0] + 0.02
    assert run.velocity[first][0] == pytest.approx(slide, abs=1e-12)
    assert run.velocity[-1] == pytest.approx(after, abs=1e-12)


@pytest.mark.parametrize(("law", "e", "after"), [
    ("simultaneous", 1.0, (-1 / 3, 2 / 3, 2 / 3)),
    ("sequential", 1.0, (0.0, 0.0, 1.0)),
    ("simultaneous", 0.0, (1 / 3, 1 / 3, 1 / 3)),
])  # fmt: skip
def test_cradle_of_three(law, e, after):
    cradle = LinearSystem(
        mass=[1.0, 1.0, 1.0], normals=[[-1, 1, 0], [0, -1, 1]], offsets=[0.0, 0.0], restitution=e
    )
    settings = EventSettings(rows=10, impact_law=law)
    run = integrate_events(cradle, [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], 2.0, settings)
    assert run.velocity[-1] == pytest.approx(after, abs=1e-14)
    assert run.impacts.time == pytest.approx(1.0, abs=1e-15)


def test_two_body_impacts_begin_with_the_fastest_approach():
    """Three beads that close on the middle one at 1 and 2 m/s: the order decides who leaves how."""
    beads = LinearSystem(
        mass=[1.0, 2.0, 1.0], normals=[[-1, 1, 0], [0, -1, 1]], offsets=[0.0, 0.0], restitution=1.0
    )
    settings = EventSettings(rows=3, impact_law="sequential")
    # Masses 1 and 2 by hand: the right pair at 2 m/s first, then the left one at 1 + 4/3 m/s.
    places, speeds, after = np.array([[-1.0, 0.0, 2.0], [1.0, 0.0, -2.0], [-19 / 9, 2 / 9, 2 / 3]])
    for side in (1, -1):  # seen in a mirror, too
        start = side * places[::side], side * speeds[::side]
        run = integrate_events(beads, *start, 1.5, settings)
        assert run.velocity[-1] == pytest.approx(side * after[::side], abs=1e-13)


@pytest.mark.parametrize("k", range(7))
@pytest.mark.parametrize("heavy_step", [1, 2])
def test_stack_of_unequal_masses(k, heavy_step):
    masses = [1.0, 10.0**k, 10.0 ** (heavy_step * k)]
    stack = line(masses, 0.3, [-G * m for m in masses])
    weight = G * sum(masses)
    rest = integrate_events(stack, [0.0] * 3, [0.0] * 3, 1.0, EventSettings(rows=5))
    above = [weight, G * sum(masses[1:]), G * masses[2]]
    assert rest.contact_force[1:] == pytest.approx(np.tile(above, (5, 1)), rel=1e-8)
    assert np.abs(rest.position).max() <= 1e-12
    dropped = integrate_events(stack, [0.0, 0.1, 0.2], [0.0] * 3, 4.0, EventSettings(rows=5))
    assert dropped.contact_force[-1, 0] == pytest.approx(weight, rel=1e-8)
    assert dropped.gap.min() >= -1e-12


@pytest.mark.parametrize("general", [False, True])
def test_impacts_that_accumulate_in_a_corner_end_at_one_place(general):
    # In a narrow corner with e = 0.1 the impacts by turns never end, but their times converge, and
    # with them the normal speeds: the point sits in the vertex, pressed by its weight.
    angle, e = 0.15, 0.1
    normals = np.array([[0.0, 1.0], [math.sin(angle), -math.cos(angle)]])
    corner = LinearSystem(
        mass=[1.0, 1.0], normals=normals, offsets=[0.0, 0.0], load=[-1.0, 0.0], restitution=e
    )
    if general:
        corner = GeneralizedSystem(
            mass=[1.0, 1.0], force=corner.force, constraints=lambda u: normals @ u, restitution=e
        )
    start = [math.cos(0.4 * angle), math.sin(0.4 * angle)]
    run = integrate_events(corner, start, [-1.0, -0.3], 3.0, EventSettings(rows=30))
    assert np.abs(run.position[-1]).max() <= 1e-7
    assert np.abs(run.velocity[-1]).max() <= 1e-7
    assert run.contact_force[-1] @ normals == pytest.approx([1.0, 0.0], rel=1e-9, abs=1e-9)
    assert run.gap.min() >= -1e-12


@pytest.mark.parametrize("general", [False, True])
def test_ball_leaves_a_table_that_falls_away(general):
    amplitude, w = 0.3, 2.0 * math.pi
    table = [Signal(harmonics=((w, 0.0, amplitude),))]
    system = ball(0.5, general=general, motion=table)
    run = integrate_events(system, [0.0], [amplitude * w], 0.5, EventSettings(rows=50))
    leaving = math.asin(G / (amplitude * w * w)) / w
    start, end, _ = run.effort.details["sticking"][0]
    assert start == 0.0
    assert end == pytest.approx(leaving, abs=1e-9)
    # Until then it follows the table, pressed by m (g - A w^2 sin wt); the rows hold means.
    held = run.times <= leaving
    assert held.sum() > 5
    assert run.position[held, 0] == pytest.approx(amplitude * np.sin(w * run.times[held]), abs=1e-9)
    impulse = G * run.times + amplitude * w * (np.cos(w * run.times) - 1.0)
    force = np.diff(impulse) / np.diff(run.times)
    assert run.contact_force[1:][held[1:], 0] == pytest.approx(force[held[1:]], abs=1e-8)


def test_period_one_on_the_table_is_stable_up_to_its_exact_flip():
    e, w = 0.8, 10.0
    flip = vibro_forms.table_flip(e)
    for gamma, stable in ((0.999 * flip, True), (1.001 * flip, False)):
        amplitude = 0.5 * gamma * G / (w * w * (1.0 + e))
        phase = math.acos(vibro_forms.table_existence(e) / gamma)
        table = [Signal(harmonics=((w, amplitude * math.sin(phase), amplitude * math.cos(phase)),))]
        speed = G * math.pi / w * (1.0 + 1e-3)
        start = [amplitude * math.sin(phase)]
        run = integrate_events(
            ball(e, motion=table), start, [speed], 1e5 / w, EventSettings(rows=1)
        )
        flights = np.diff(run.impacts.time[-20:]) * w / (2.0 * math.pi)
        assert (np.abs(flights - 1.0).max() < 1e-6) is np.bool_(stable)


def test_circle_conserves_energy_and_angular_momentum():
    circle = GeneralizedSystem(
        mass=[2.0, 2.0], force=lambda *_: [0.0, 0.0], restitution=1.0,
        constraints=[lambda u: 1.0 - np.sqrt(u[0] ** 2 + u[1] ** 2)],
    )  # fmt: skip
    run = integrate_events(circle, [0.3, 0.1], [0.5, 0.9], 50.0, EventSettings(rows=50))
    spin = run.position[:, 0] * run.velocity[:, 1] - run.position[:, 1] * run.velocity[:, 0]
    speed = math.hypot(0.5, 0.9)
    distance = abs(spin[0]) / speed
    chord = 2.0 * math.sqrt(1.0 - distance**2) / speed
    assert np.diff(run.impacts.time) == pytest.approx(chord, rel=1e-9)
    assert run.kinetic == pytest.approx(run.kinetic[0], rel=1e-10)
    assert spin == pytest.approx(spin[0], rel=1e-10)


def test_bead_leaves_the_inside_of_a_circle():
    circle = GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda *_: [0.0, -G], restitution=0.0,
        constraints=[lambda u: 1.0 - np.sqrt(u[0] ** 2 + u[1] ** 2)],
        potential=lambda _, u: G * float(u[1]),
    )  # fmt: skip
    speed = 6.5
    run = integrate_events(circle, [0.0, -1.0], [speed, 0.0], 0.6, EventSettings(rows=6000))
    height = (speed**2 - 2.0 * G) / (3.0 * G)  # where v^2 = g y
    leaving = run.effort.details["sticking"][0][1]
    assert np.interp(leaving, run.times, run.position[:, 1]) == pytest.approx(height, abs=1e-7)
    assert run.total == pytest.approx(run.total[0], rel=1e-8)
    assert run.gap.min() >= -1e-8


def test_mass_that_depends_on_position():
    # A free particle in polar and in Cartesian coordinates between two lines.
    polar = GeneralizedSystem(
        dofs=2, restitution=[0.7, 0.9], mass=lambda q: [1.0, q[0] ** 2],
        force=lambda _, q, p: [q[0] * p[1] ** 2, -2.0 * q[0] * p[0] * p[1]],
        constraints=[lambda q: 2.0 - q[0] * np.cos(q[1]), lambda q: q[0] * np.sin(q[1]) - 0.2],
    )  # fmt: skip
    plane = LinearSystem(
        mass=[1.0, 1.0], normals=[[-1.0, 0.0], [0.0, 1.0]], offsets=[2.0, -0.2],
        restitution=[0.7, 0.9],
    )  # fmt: skip
    r, angle, v = 1.0, 0.8, np.array([0.9, -0.4])
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    rate = turn @ v
    settings = EventSettings(rows=60)
    one = integrate_events(polar, [r, angle], [rate[0], rate[1] / r], 3.0, settings)
    two = integrate_events(plane, r * turn[0], v, 3.0, settings)
    q = one.position
    there = np.stack([q[:, 0] * np.cos(q[:, 1]), q[:, 0] * np.sin(q[:, 1])], axis=1)
    assert len(one.impacts) == len(two.impacts) == 2
    assert one.impacts.time == pytest.approx(two.impacts.time, abs=1e-8)
    assert there == pytest.approx(two.position, abs=1e-8)


def test_signals_of_unknown_form_are_integrated():
    w, amplitude = 7.0, 0.1
    known = [Signal(0.05, harmonics=((w, 0.0, amplitude),))]
    opaque = [Signal(rest=lambda t: 0.05 + amplitude * np.sin(w * t))]
    settings = EventSettings(rows=20, stick_speed=1e-4)
    runs = [
        integrate_events(ball(0.6, motion=m), [1.0], [0.0], 2.0, settings) for m in (known, opaque)
    ]
    assert len(runs[0].impacts) == len(runs[1].impacts) >= 10
    # The rate of the table comes from differences, to about 1e-9.
    assert runs[1].impacts.time == pytest.approx(runs[0].impacts.time, abs=1e-7)
    assert runs[1].position == pytest.approx(runs[0].position, abs=1e-7)


def test_limits_and_errors_are_named():
    with pytest.raises(ConvergenceError, match="larger stick_speed or max_impacts"):
        integrate_events(ball(1.0), [1.0], [0.0], 100.0, EventSettings(max_impacts=10))
    blown = LinearSystem(mass=1.0, damping=-400.0, normals=[[1.0]], offsets=[1.0])
    with pytest.raises(ConvergenceError, match="not finite at t ="):
        integrate_events(blown, [1.0], [1.0], 10.0)
    press = LinearSystem(
        mass=1.0, normals=[[1.0], [-1.0]], offsets=[0.0, 1.0], motion=[Signal(), Signal(slope=1.0)]
    )
    with pytest.raises(ConvergenceError, match=r"at t = 1 .* do they leave room"):
        integrate_events(press, [0.5], [-0.1], 10.0)
    with pytest.raises(SceneError, match="duration = -1"):
        integrate_events(ball(1.0), [1.0], [0.0], -1.0)
    with pytest.raises(SceneError, match="outside constraint 0"):
        integrate_events(ball(1.0), [-1.0], [0.0], 1.0)
    for wrong in ({"rows": 0}, {"impact_law": "other"}, {"stick_speed": -1.0}, {"rtol": 0.0},
                  {"max_impacts": 0}, {"keep_impacts": -1}):  # fmt: skip
        with pytest.raises(SceneError, match=next(iter(wrong))):
            EventSettings(**wrong)


def test_only_the_last_impacts_are_kept_on_request():
    every = integrate_events(ball(1.0), [1.0], [0.0], 50.0, EventSettings(rows=5))
    some = integrate_events(ball(1.0), [1.0], [0.0], 50.0, EventSettings(rows=5, keep_impacts=7))
    assert len(some.impacts) == 7
    assert (some.impacts.time == every.impacts.time[-7:]).all()
    assert some.effort.details["impacts"] == len(every.impacts)


def test_more_vibrations_than_can_be_followed_are_refused():
    scene = Scene.from_toml(find_scene("dropped_beam")).with_settings(
        {"solve.method": "event_driven"}
    )
    plan(scene)
    with pytest.raises(SceneError, match=r"duration = 1e\+20 s is .* periods of the fast"):
        plan(scene.with_settings({"duration": 1e20, "solve.dt": 1e18}))


def test_a_rod_that_rests_for_ever_is_refused():
    """Of 1e30 s each step was as short as rounding let it be."""
    rod = Scene.from_toml(starters()["rod"])
    with pytest.raises(SceneError, match=r"duration = 1e\+30 s is .* falls by its size"):
        plan(rod.with_settings({"duration": 1e30}))
