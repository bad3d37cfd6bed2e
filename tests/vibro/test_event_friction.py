"""Events with friction against closed forms: stick, slip, reversal, impacts, paradoxes."""

import itertools
import warnings

import numpy as np
import pytest
from scipy.integrate import quad

import impactfem
from impactfem import SceneError
from impactfem.errors import ConvergenceError

G = 9.81


def on_slope(mu, slope, **more):
    """A block of 2 kg; u along and off the slope."""
    down = np.array([np.sin(slope), np.cos(slope)])
    return impactfem.systems.GeneralizedSystem(
        mass=[2.0, 2.0], force=lambda *_: -2.0 * G * down, constraints=lambda u: u[1:],
        friction=mu, slip=lambda _: [[1.0, 0.0]],
        potential=lambda _, u: 2.0 * G * float(down @ u), **more,
    )  # fmt: skip


def rolling(mu, share, **more):
    """A ball, disc or hoop of 1 kg and R = .1 m with inertia share R^2: x, y, angle."""
    return impactfem.systems.GeneralizedSystem(
        mass=[1.0, 1.0, share * 0.01], force=lambda *_: [0.0, -G, 0.0],
        constraints=lambda u: u[1:2] - 0.1, friction=mu, slip=lambda _: [[1.0, 0.0, 0.1]], **more,
    )  # fmt: skip


def rod(mu, load=G, **more):
    """A rod of 1 kg and 1 m that touches with one end: centre x, y, angle."""
    return impactfem.systems.GeneralizedSystem(
        mass=[1.0, 1.0, 1.0 / 12.0], force=lambda *_: [0.0, -load, 0.0],
        constraints=lambda u: u[1:2] - 0.5 * np.sin(u[2:3]), friction=mu,
        slip=lambda u: [[1.0, 0.0, 0.5 * np.sin(u[2])]], **more,
    )  # fmt: skip


@pytest.mark.parametrize(("mu", "slope", "stays"), [(0.5, 0.3, True), (0.2, 0.5, False)])
def test_block_thrown_uphill_stops_and_stays_or_slides_back(mu, slope, stays):
    motion = impactfem.integrate(on_slope(mu, slope), [0.0, 0.0], [3.0, 0.0], 2.0)
    stop = 3.0 / (G * (np.sin(slope) + mu * np.cos(slope)))
    way, left = 1.5 * stop, 2.0 - stop
    back = 0.0 if stays else G * (np.sin(slope) - mu * np.cos(slope))
    assert motion.position[-1] == pytest.approx([way - 0.5 * back * left**2, 0.0], abs=1e-9)
    assert motion.velocity[-1] == pytest.approx([-back * left, 0.0], abs=1e-9)
    assert motion.contact_force[1:, 0] == pytest.approx(2.0 * G * np.cos(slope), rel=1e-9)
    changed = motion.effort.details["friction_changes"]
    assert [what for _, _, what in changed] == ["slides", "sticks" if stays else "slides"]
    assert changed[1][0] == pytest.approx(stop, abs=1e-10)
    lost = motion.total[0] - motion.total[-1]
    assert motion.effort.details["friction_work"] == pytest.approx(-lost, rel=1e-8)


def on_feet(mu, slope):
    """A block on two feet a metre apart, its centre .2 m above; a slope by time."""
    arms = np.array([[-0.5, -0.2], [0.5, -0.2]])

    def feet(u):
        c, s = np.cos(u[2]), np.sin(u[2])
        return c * arms[:, 1] + s * arms[:, 0]

    return impactfem.systems.GeneralizedSystem(
        mass=[2.0, 2.0, 0.1], friction=mu, slip=lambda u: [[1.0, 0.0, -y] for y in feet(u)],
        force=lambda t, *_: [-2.0 * G * np.sin(slope(t)), -2.0 * G * np.cos(slope(t)), 0.0],
        constraints=lambda u: u[1] + feet(u),
    )  # fmt: skip


@pytest.mark.parametrize("mu", [0.2, 1.0])
def test_block_on_two_feet_that_is_tilted_slips_at_the_angle_of_friction(mu):
    limit = np.arctan(mu) / 0.4
    block = on_feet(mu, lambda t: 0.4 * t)
    motion = impactfem.integrate(block, [0.0, 0.2, 0.0], [0.0] * 3, 1.1 * limit, rows=20)
    changes = motion.effort.details["friction_changes"]
    assert [what for _, _, what in changes] == ["sticks", "sticks", "slides", "slides"]
    assert [t for t, _, _ in changes[2:]] == pytest.approx([limit, limit], abs=1e-9)


@pytest.mark.parametrize(
    ("mu", "slope", "speed"), [(0.5, 0.3, 3.0), (0.5, 0.5, 2.0), (0.5, -0.2, 1.0), (0.5, 0.45, 0.0)]
)
def test_block_on_two_feet_stops_and_stays_or_slides_back(mu, slope, speed):
    """Feet that stick leave open how they share the push: equal shares would slip at .45 rad."""
    block = on_feet(mu, lambda _: slope)
    motion = impactfem.integrate(block, [0.0, 0.2, 0.0], [speed, 0.0, 0.0], 1.0, rows=20)
    stop = speed / (G * (np.sin(slope) + mu * np.cos(slope)))
    stays = abs(np.tan(slope)) < mu
    back = 0.0 if stays else G * (np.sin(slope) - mu * np.cos(slope)) * (1.0 - stop) ** 2
    way = 0.5 * (speed * stop - back)
    assert motion.position[-1] == pytest.approx([way, 0.2, 0.0], abs=1e-11)
    changed = motion.effort.details["friction_changes"]
    assert [what for _, _, what in changed[-2:]] == ["sticks" if stays else "slides"] * 2
    assert [t for t, _, _ in changed[-2:]] == pytest.approx([stop, stop], abs=1e-10)
    lever = 0.2 * np.tan(slope) if stays else 0.2 * mu * np.sign(slope)
    assert (motion.contact_force[-1] @ [-0.5, 0.5]) / motion.contact_force[-1].sum() == (
        pytest.approx(-lever, abs=1e-9)
    )
    assert "friction_nonunique" not in motion.effort.details


@pytest.mark.parametrize(("over", "slides"), [(-1e-6, False), (1e-6, True)])
def test_incline_holds_up_to_the_angle_of_friction(over, slides):
    motion = impactfem.integrate(on_slope(0.3, np.arctan(0.3 + over)), [0.0, 0.0], [0.0, 0.0], 1.0)
    assert (abs(motion.velocity[-1, 0]) > 1e-8) == slides


def test_stick_slip_on_a_belt_has_its_period():
    """Relative to the belt; sticks for 2 D / v, slips for (2 pi - 2 atan(D w / v)) / w."""
    static, kinetic, load, stiffness, speed = 0.6, 0.3, 10.0, 50.0, 0.2
    belt = impactfem.systems.GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda t, u, _: [-stiffness * (u[0] + speed * t), -load],
        constraints=lambda u: u[1:], friction=kinetic, static_friction=static,
        slip=lambda _: [[1.0, 0.0]],
    )  # fmt: skip
    reach, omega = (static - kinetic) * load / stiffness, np.sqrt(stiffness)
    whole = (2.0 * np.pi - 2.0 * np.arctan(reach * omega / speed)) / omega + 2.0 * reach / speed
    motion = impactfem.integrate(belt, [0.0, 0.0], [0.0, 0.0], 4.0 * whole, rows=50)
    slips = [t for t, _, what in motion.effort.details["friction_changes"] if what == "slides"]
    assert slips[0] == pytest.approx(static * load / stiffness / speed, abs=1e-9)
    assert np.diff(slips) == pytest.approx(whole, abs=1e-8)


@pytest.mark.parametrize(
    ("share", "when", "way"),
    [(0.4, 0.4368720, 1.1233851), (0.5, 0.5096840, 1.2742100), (1.0, 0.7645260, 1.7201835)],
)
def test_ball_disc_and_hoop_slide_then_roll(share, when, way):
    system = rolling(0.2, share)
    motion = impactfem.integrate(system, [0.0, 0.1, 0.0], [3.0, 0.0, 0.0], 1.0, rows=20)
    (_, _, slides), (time, _, rolls) = motion.effort.details["friction_changes"]
    assert (slides, rolls) == ("slides", "sticks")
    assert time == pytest.approx(when, abs=5e-8)
    end = motion.velocity[-1]
    assert end[0] == pytest.approx(3.0 / (1.0 + share), abs=1e-9)
    assert motion.position[-1, 0] - end[0] * (1.0 - time) == pytest.approx(way, abs=5e-8)


def test_rod_dropped_at_45_degrees():
    start = [0.0, np.sqrt(0.125), 0.25 * np.pi], [0.0, -1.0, 0.0]
    after = impactfem.integrate(rod(0.3, 0.0), *start, 1e-9, rows=1).velocity[-1]
    assert after[:2] - [0.0, -1.0] == pytest.approx([0.1463415, 0.4878049], abs=5e-8)
    assert after[2] == pytest.approx(-1.4487066, abs=5e-8)
    assert after[0] + np.sqrt(0.125) * after[2] == pytest.approx(-0.3658537, abs=5e-8)
    smooth = impactfem.integrate(rod(0.0, 0.0), *start, 1e-9, rows=1)
    assert smooth.impacts.impulse == pytest.approx([0.4], abs=1e-12)


def painleve(degrees, spin=0.0, way=1.0):
    """A rod at this angle whose end slides along x with 1 m/s."""
    angle = np.radians(degrees)
    u = [0.0, 0.5 * np.sin(angle), angle]
    v = [way - 0.5 * np.sin(angle) * spin, 0.5 * np.cos(angle) * spin, spin]
    return impactfem.integrate(rod(1.5), u, v, 1e-3, rows=1)


def test_painleve_rod_has_no_solution_only_between_its_angles():
    """1 + 3 cos^2 < 4.5 sin cos for mu = 1.5: tan = (4.5 -+ sqrt 4.25) / 2."""
    ends = np.degrees(np.arctan((4.5 + np.array([-1.0, 1.0]) * np.sqrt(4.25)) / 2.0))
    assert ends == pytest.approx([50.641598, 73.048469], abs=1e-6)
    inwards = np.array([1e-3, -1e-3])
    for inside, outside in zip(ends + inwards, ends - inwards, strict=True):
        for degrees, way in ((inside, 1.0), (outside, 1.0), (inside, -1.0)):
            if degrees == inside and way < 0.0:  # the end leans ahead
                with pytest.raises(ConvergenceError, match="Painleve"):
                    painleve(degrees, way=way)
            else:
                assert painleve(degrees, way=way).is_finite


def test_painleve_rod_that_spins_has_two_solutions_which_is_said():
    """Free, the end lifts: g < r spin^2 sin; pressed, friction turns the rod into the floor."""
    with pytest.warns(impactfem.ImpactWarning, match="2 motions"):
        motion = painleve(60.0, spin=8.0, way=-1.0)
    several = motion.effort.details["friction_nonunique"]
    assert several["solutions"] == 2
    assert several["taken"] == "0 slides"


def test_superball_through_three_bounces():
    ball = rolling(100.0, 0.4, restitution=1.0, tangential_restitution=1.0)
    motion = impactfem.integrate(ball, [0.0, 1.1, 0.0], [1.0, 0.0, 7.0], 2.5, rows=10)
    turn = np.array([[3.0, -4.0], [-10.0, -3.0]]) / 7.0
    states = [np.array([1.0, 0.7])]
    for _ in range(3):
        states.append(turn @ states[-1])
    fall = np.sqrt(2.0 / G)
    spans = [fall, 2.0 * fall, 2.0 * fall, 2.5 - 5.0 * fall]
    assert motion.impacts.time == pytest.approx(np.cumsum(spans[:3]), abs=1e-9)
    end = states[-1]
    assert motion.velocity[-1, [0, 2]] == pytest.approx([end[0], end[1] / 0.1], abs=1e-8)
    way = sum(span * state[0] for span, state in zip(spans, states, strict=True))
    assert motion.position[-1, 0] == pytest.approx(way, abs=1e-8)
    assert np.ptp(motion.kinetic + G * motion.position[:, 1]) < 1e-8


@pytest.mark.parametrize(
    ("first", "reach", "mass"), [(0.05, 1.0, 1.0), (0.15, 1.0, 1.0), (0.1, 100.0, 1e6)]
)
def test_rocking_block_has_housners_times_and_amplitudes(first, reach, mass):
    """Half diagonal at .2 rad: speeds fall by 1 - 3/2 sin^2 alpha at each impact, of any size."""
    alpha, square = 0.2, 0.75 * G / reach
    half = reach * np.array([np.sin(alpha), np.cos(alpha)])

    def corners(u):
        arms = np.array([[-half[0], half[0]], [-half[1], -half[1]]])
        return np.cos(u[2]) * arms[1] + np.sin(u[2]) * arms[0], (
            np.cos(u[2]) * arms[0] - np.sin(u[2]) * arms[1]
        )

    block = impactfem.systems.GeneralizedSystem(
        mass=mass * np.array([1.0, 1.0, reach**2 / 3.0]), force=lambda *_: [0.0, -mass * G, 0.0],
        constraints=lambda u: u[1] + corners(u)[0], friction=5.0,
        slip=lambda u: [[1.0, 0.0, -y] for y in corners(u)[0]],
        jacobian=lambda u: [[0.0, 1.0, x] for x in corners(u)[1]],
    )  # fmt: skip
    low = corners([0.0, 0.0, first])
    start = [-low[1][0], -low[0][0], first]

    def quarter(angle):
        def rate(s):
            rise = np.sin(alpha - angle + 0.5 * s * s) * np.sinc(0.5 * s * s / np.pi)
            return 2.0 / np.sqrt(2.0 * square * rise)

        return quad(rate, 0.0, np.sqrt(angle), epsabs=1e-13, epsrel=1e-13)[0]

    ratio, amplitudes = 1.0 - 1.5 * np.sin(alpha) ** 2, [first]
    assert ratio == pytest.approx(0.9407957, abs=5e-8)
    for _ in range(5):
        energy = (np.cos(alpha - amplitudes[-1]) - np.cos(alpha)) * ratio**2
        amplitudes.append(alpha - np.arccos(np.cos(alpha) + energy))
    times = np.cumsum([quarter(first), *(2.0 * quarter(a) for a in amplitudes[1:])])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", impactfem.ImpactWarning)
        motion = impactfem.integrate(block, start, [0.0] * 3, times[-1] + 1e-3, rows=60)
    changes = motion.effort.details["friction_changes"]
    found = [t for t, _, what in changes if what == "opens"]
    # Flights are integrated to 1e-10 of the motion, which each swing hands on to the next.
    np.testing.assert_allclose(found, times, rtol=5e-10)
    # Amplitudes by the energy of each swing: m g R (cos(alpha - a) - cos alpha).
    energy = motion.kinetic / mass + G * (motion.position[:, 1] - half[1])
    for a, (begin, end) in zip(amplitudes[1:], itertools.pairwise(found), strict=True):
        rows = (motion.times > begin) & (motion.times < end)
        top = G * reach * (np.cos(alpha - a) - np.cos(alpha))
        assert energy[rows] == pytest.approx(top, rel=1e-8)


def test_bounces_with_friction_come_to_an_end():
    """Tangential speed falls by mu (1 + e) v at each impact, all in all by mu (v0 + g t)."""
    motion = impactfem.integrate(
        on_slope(0.1, 0.0, restitution=0.5), [0.0, 0.5], [2.0, 0.0], 1.5, rows=30
    )
    first = np.sqrt(1.0 / G)
    resting = first + 2.0 * first  # e / (1 - e) = 1: twice the fall
    assert motion.velocity[-1, 0] == pytest.approx(2.0 - 0.1 * G * 1.5, abs=1e-6)
    assert motion.effort.details["sticking"][0][0] == pytest.approx(resting, abs=1e-6)


def test_what_events_with_friction_refuse():
    both = impactfem.systems.GeneralizedSystem(
        mass=[1.0] * 3, force=lambda *_: [0.0, 0.0, -1.0], constraints=lambda u: u[2:],
        friction=0.1, slip=lambda _: np.eye(3)[None, :2],
    )  # fmt: skip
    with pytest.raises(SceneError, match=r"two tangents.*moreau_jean"):
        impactfem.integrate(both, [0.0] * 3, [1.0, 0.0, 0.0], 1.0)
    with pytest.raises(SceneError, match="impact_law"):
        impactfem.integrate(on_slope(0.1, 0.0), [0, 0], [1, 0], 1.0, impact_law="sequential")
    with pytest.raises(SceneError, match=r"static_friction.*event_driven"):
        impactfem.integrate(
            on_slope(0.1, 0.0, static_friction=0.2), [0, 0], [1, 0], 1.0,
            method="moreau_jean", dt=0.1,
        )  # fmt: skip
    with pytest.raises(SceneError, match=r"static_friction = 0.05"):
        on_slope(0.1, 0.0, static_friction=0.05)
    with pytest.raises(SceneError, match="tangential_restitution = 2"):
        on_slope(0.1, 0.0, tangential_restitution=2.0)
