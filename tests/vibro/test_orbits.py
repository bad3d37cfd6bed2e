"""Periodic motions of systems that flow and jump: walkers, hoppers, what is refused."""

# ruff: noqa: ARG001, ARG005 - functions of phases take all parameters

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import impactfem
from impactfem.errors import ConvergenceError, SceneError
from impactfem.systems import HybridSystem, Phase

SIMPLEST = [0.2, -0.2, 0.4, -0.016]  # near the long gait at a slope of .009


def simplest():
    """Garcia, Chatterjee, Ruina, Coleman: point feet, unit legs, all mass in the hip; g = 1."""

    def rate(x, slope):
        turn = np.sin(x[0] - slope)
        swing = turn + np.sin(x[2]) * (x[1] ** 2 - np.cos(x[0] - slope))
        return [x[1], turn, x[3], swing]

    def strike(x, slope):
        c = np.cos(2.0 * x[0])
        return [-x[0], c * x[1], -2.0 * x[0], c * (1.0 - c) * x[1]]

    step = Phase(rate, lambda x, slope: 2.0 * x[0] - x[2], strike, when=lambda x, slope: x[0] < 0.0)
    return HybridSystem([step], names=["theta", "theta'", "phi", "phi'"])


def returned(angle, spin, slope):
    """The next start of a step, by SciPy alone."""

    def rate(_, x):
        turn = np.sin(x[0] - slope)
        swing = turn + np.sin(x[2]) * (x[1] ** 2 - np.cos(x[0] - slope))
        return [x[1], turn, x[3], swing]

    def met(_, x):  # lines of the legs agree in between: looked at once the leg has passed
        return 2.0 * x[0] - x[2] if x[0] < -0.5 * angle else 1.0

    met.terminal, met.direction = True, -1.0
    c = np.cos(2.0 * angle)
    start = [angle, spin, 2.0 * angle, (1.0 - c) * spin]
    run = solve_ivp(rate, (0, 9), start, "DOP853", events=met, rtol=1e-13, atol=1e-16)
    end = run.y_events[0][0]
    # The root of the dense output is made better by one step of Newton's method.
    late = (2.0 * end[0] - end[2]) / (2.0 * end[1] - end[3])
    end = solve_ivp(
        rate, (0, run.t_events[0][0] - late), start, "DOP853", rtol=1e-13,
        atol=1e-16,
    ).y[:, -1]  # fmt: skip
    return np.array([-end[0], np.cos(2.0 * end[0]) * end[1]])


def slope_of_return(angle, spin, slope, h=2e-4):
    """By differences of order 6."""
    weights = np.array([45.0, -9.0, 1.0]) / 60.0
    columns = []
    for way in (np.array([1.0, 0.0]), np.array([0.0, 1.0])):
        ahead = [returned(*(np.array([angle, spin]) + k * h * way), slope) for k in (1, 2, 3)]
        behind = [returned(*(np.array([angle, spin]) - k * h * way), slope) for k in (1, 2, 3)]
        columns.append(weights @ (np.array(ahead) - behind) / h)
    return np.array(columns).T


class TestSimplestWalker:
    def test_gait_and_multipliers(self):
        """Garcia et al. print the gait; multipliers agree with differences of SciPy's motion."""
        orbit = impactfem.systems.periodic_orbit(simplest(), SIMPLEST, {"slope": 0.009})
        wanted = [0.200310900544287, -0.199832473004977]
        assert orbit.start[:2] == pytest.approx(wanted, abs=1e-11)
        apart = np.linalg.eigvals(slope_of_return(*orbit.start[:2], 0.009))
        assert sorted(orbit.multipliers[:2], key=np.imag) == pytest.approx(
            sorted(apart, key=np.imag), abs=1e-8
        )
        assert orbit.multipliers[2] == pytest.approx(0.0, abs=1e-8)
        assert orbit.stable
        assert orbit.doubt < 1e-10
        # The monodromy has the same ones, and 1 along the motion.
        whole = np.linalg.eigvals(orbit.monodromy)
        assert np.abs(whole - 1.0).min() < 1e-10
        assert np.abs(whole - orbit.multipliers[0]).min() < 1e-10

    def test_period_doubles(self):
        """Near .0151, where SciPy's return map has the multiplier -1 too."""
        start = [0.2368, -0.2316, 0.4736, -0.0255]
        orbit = impactfem.systems.periodic_orbit(simplest(), start, {"slope": 0.015}, longest=9.0)
        found = orbit.critical("slope", 0.0152)
        assert found.parameters["slope"] == pytest.approx(0.0150884379411, abs=1e-12)
        one = slope_of_return(*found.start[:2], found.parameters["slope"])
        assert np.linalg.eigvals(one).min() == pytest.approx(-1.0, abs=1e-8)
        # Not the short gait, which is as near.
        assert orbit.at(slope=0.016).start[0] == pytest.approx(0.24173856, abs=1e-8)
        with pytest.raises(SceneError, match="no real multiplier passes -1"):
            orbit.critical("slope", 0.01505)

    @pytest.mark.parametrize(("share", "time"), [(0.97096, 3.8121), (0.94398, np.pi)])
    def test_gaits_as_the_slope_goes_to_0(self, share, time):
        """theta = share * slope^(1/3); the next term is of the size of slope^(2/3)."""
        angle = share * 1e-6 ** (1.0 / 3.0)
        start = [angle, -angle / np.tanh(0.5 * time), 2.0 * angle, 0.0]
        orbit = impactfem.systems.periodic_orbit(simplest(), start, {"slope": 1e-6}, longest=9.0)
        assert orbit.start[0] == pytest.approx(angle, rel=2e-4)
        assert orbit.period == pytest.approx(time, rel=2e-4)


HIP, LEG, LOW, HIGH, G = 10.0, 5.0, 0.5, 0.5, 9.81  # masses [kg]; the leg's from foot and hip [m]


def compass():
    """Goswami, Espiau, Keramane: legs of 1 m with masses, in the angles of both legs."""
    long = LOW + HIGH
    one, two, both = LEG * (LOW**2 + long**2) + HIP * long**2, LEG * HIGH**2, LEG * long * HIGH

    def rate(x, slope):
        c, s = both * np.cos(x[0] - x[1]), both * np.sin(x[0] - x[1])
        right = [
            s * x[3] ** 2 + (LEG * LOW + (HIP + LEG) * long) * G * np.sin(x[0]),
            -s * x[2] ** 2 - LEG * HIGH * G * np.sin(x[1]),
        ]
        return np.concatenate([x[2:], np.linalg.solve([[one, -c], [-c, two]], right)])

    def moves(stance, swing):
        """Of the masses of stance leg, hip and swing leg, by the rates of both angles."""
        across = [np.array([np.cos(a), -np.sin(a)]) for a in (stance, swing)]
        zero = np.zeros(2)
        return [np.stack([LOW * across[0], zero], axis=1),
                np.stack([long * across[0], zero], axis=1),
                np.stack([long * across[0], -HIGH * across[1]], axis=1)]  # fmt: skip

    def strike(x, slope):
        before = [each @ x[2:] for each in moves(x[0], x[1])]
        after = moves(x[1], x[0])[::-1]  # legs change their parts
        mass = sum(m * a.T @ a for m, a in zip((LEG, HIP, LEG), after, strict=True))
        push = sum(m * a.T @ b for m, a, b in zip((LEG, HIP, LEG), after, before, strict=True))
        return np.concatenate([[x[1], x[0]], np.linalg.solve(mass, push)])

    step = Phase(
        rate, lambda x, slope: 2.0 * slope - x[0] - x[1], strike,
        when=lambda x, slope: x[0] > slope,
    )  # fmt: skip
    return HybridSystem([step], names=["stance", "swing", "stance'", "swing'"])


def compass_by_hand(start, slope):
    """A step of the same walker in the coordinates of its hip and legs, feet held by forces."""
    long = LOW + HIGH

    def parts(q):
        """Jacobians of masses and feet (hip x, hip y, angles), and their rates' parts."""
        legs = [np.array([np.sin(a), np.cos(a)]) for a in q[2:]]
        turns = [np.array([np.cos(a), -np.sin(a)]) for a in q[2:]]

        def at(leg, down):
            j = np.zeros((2, 4))
            j[:, :2], j[:, 2 + leg] = np.eye(2), -down * turns[leg]
            return j, down * legs[leg]  # acceleration at rest of angles: down * legs * rate^2

        hip = np.eye(2, 4), np.zeros(2)
        return (
            [(LEG, *at(0, HIGH), 2), (HIP, *hip, 2), (LEG, *at(1, HIGH), 3)],
            at(0, long),
            at(1, long),
        )

    def mass(masses):
        return sum(m * j.T @ j for m, j, *_ in masses)

    def held(matrix, right, rows, values):
        whole = np.block([[matrix, rows.T], [rows, np.zeros((2, 2))]])
        return np.linalg.solve(whole, np.concatenate([right, values]))[:4]

    def rate(_, y):
        q, v = y[:4], y[4:]
        masses, (rows, drift), _ = parts(q)
        right = sum(m * j.T @ (np.array([0.0, -G]) - d * v[k] ** 2) for m, j, d, k in masses)
        return np.concatenate([v, held(mass(masses), right, rows, -drift * v[2] ** 2)])

    def met(_, y):
        return y[2] + y[3] - 2.0 * slope if y[2] > slope else -1.0

    met.terminal, met.direction = True, 1.0
    angles, spins = np.array(start[:2]), np.array(start[2:])
    y = np.concatenate([
        long * np.array([np.sin(angles[0]), np.cos(angles[0])]), angles,
        long * np.array([np.cos(angles[0]), -np.sin(angles[0])]) * spins[0], spins,
    ])  # fmt: skip
    run = solve_ivp(rate, (0, 5), y, "DOP853", events=met, rtol=1e-12, atol=1e-13)
    end = run.y_events[0][0]
    masses, _, (rows, _) = parts(end[:4])
    spins = held(mass(masses), mass(masses) @ end[4:], rows, np.zeros(2))[2:]
    return run.t_events[0][0], np.array([end[3], end[2], spins[1], spins[0]])


def test_compass_with_masses():
    """Against the same step by forces that hold feet; it walks at 3 degrees, and limps at 4.5."""
    slope = np.deg2rad(3.0)
    start = [-0.2187, 0.3234, 1.0918, 0.377]
    orbit = impactfem.systems.periodic_orbit(compass(), start, {"slope": slope}, longest=5.0)
    time, end = compass_by_hand(orbit.start, slope)
    assert time == pytest.approx(orbit.period, rel=1e-8)
    assert end == pytest.approx(orbit.start, abs=1e-8)
    assert orbit.stable


class TestHoppers:
    """A mass of 1 kg on a leg without mass, a spring of 1000 N/m, 1 m long."""

    def test_in_place(self):
        """Flight is a parabola, stance a sine about m g / k."""

        flight = Phase(lambda x: [x[1], -G], lambda x: x[0] - 1.0, name="flight")
        stance = Phase(
            lambda x: [x[1], 1000.0 * (1.0 - x[0]) - G], lambda x: 1.0 - x[0], name="stance"
        )
        hopper = HybridSystem([flight, stance], names=["height", "speed"])
        speed = np.sqrt(2.0 * G * 0.2)
        fall, rest = hopper.follow([1.0, speed])
        assert fall.end == pytest.approx(2.0 * speed / G, rel=1e-12)
        beat = np.sqrt(1000.0)
        wanted = 2.0 / beat * (np.pi - np.arctan(beat * speed / G))
        assert rest.end - rest.begin == pytest.approx(wanted, rel=1e-12)
        lowest = rest.course(0.5 * (rest.begin + rest.end))[0]
        peak = G + np.sqrt(G**2 + 1000.0 * speed**2)
        assert 1000.0 * (1.0 - lowest) == pytest.approx(peak, rel=1e-10)
        # Every height is periodic: what closes nearest is one, with the multiplier 1.
        orbit = impactfem.systems.periodic_orbit(hopper, [1.0, speed])
        assert orbit.multipliers == pytest.approx([1.0], abs=1e-10)
        assert orbit.start == pytest.approx([1.0, speed], abs=1e-10)

    def test_raibert_pushed(self):
        """Ten hops after a push by 10 % speed and apex are within 1 % of what is set.

        Raibert's three parts: a thrust of the leg at its shortest sets the height; the foot lands
        ahead by half a stance's way, and by the error of the speed; a hip holds the body upright.
        """
        orbit = impactfem.systems.periodic_orbit(
            raibert(), HOPPING, {"speed": 1.0795, "thrust": 0.02658}
        )
        speed, apex = orbit.start[3], orbit.states(0.0)[0, 1] + orbit.start[4] ** 2 / (2.0 * G)
        assert [speed, apex] == pytest.approx([1.0, 1.2], rel=2e-3)
        assert orbit.stable
        assert orbit.doubt < 1e-9
        start = orbit.start.copy()
        start[[3, 4]] *= 1.1, np.sqrt(0.9 * 1.2 - 1.0) / np.sqrt(0.2)  # 10 % faster and lower
        start[2] = 0.1  # rad, of the body
        ends = raibert().follow(start, 10, orbit.parameters)[-1].after
        apexes = ends[1] + ends[4] ** 2 / (2.0 * G)
        assert [ends[3], apexes] == pytest.approx([1.0, 1.2], rel=0.01)
        assert abs(ends[2]) < 1e-3


HOPPING = [0.0, 1.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.11]


def raibert():
    """A body of 1 kg and .05 kg m^2 on a leg; states as names say."""

    def ahead(x, speed):
        return 0.5 * x[3] * x[7] + 0.1 * (x[3] - speed)  # by the last stance's time

    def leg(x):
        along = x[0] - x[6]
        length = np.sqrt(along**2 + x[1] ** 2)
        return along, length, (along * x[3] + x[1] * x[4]) / length

    def stance(x, thrust):
        along, length, rate = leg(x)
        push = 1000.0 * (1.0 + thrust - length) - 8.0 * rate
        hip = -60.0 * x[2] - 2.5 * x[5]
        across = -hip / length**2  # of the foot's force, by which the leg without mass turns none
        pushes = push * along / length - across * x[1], push * x[1] / length + across * along
        return [x[3], x[4], x[5], pushes[0], pushes[1] - G, hip / 0.05, 0.0, 1.0]

    def lands(x, speed, thrust):
        return np.array([0.0 * x[0], *x[1:6], ahead(x, speed), 0.0 * x[0]])

    phases = [
        Phase(lambda x, speed, thrust: [*x[3:6], 0.0, -G, 0.0, 0.0, 0.0],
              lambda x, speed, thrust: x[1] - np.sqrt(1.0 - ahead(x, speed) ** 2), lands,
              when=lambda x, speed, thrust: x[4] < 0.0, name="flight"),
        Phase(lambda x, speed, thrust: stance(x, 0.0), lambda x, speed, thrust: -leg(x)[2],
              name="landing"),
        Phase(lambda x, speed, thrust: stance(x, thrust),
              lambda x, speed, thrust: 1.0 + thrust - leg(x)[1], name="thrust"),
    ]  # fmt: skip
    return HybridSystem(phases, ["x", "z", "turn", "vx", "vz", "spin", "foot", "stance"])


@pytest.mark.parametrize(
    ("changed", "kind", "message"),
    [
        ({"start": [0.0]}, SceneError, "is no state; give 2 finite numbers (height, speed)"),
        ({"cycles": 0}, SceneError, "cycles: 0 is no number of cycles"),
        ({"rate": lambda x: [x[1]]}, SceneError, "rate of fall: has shape (1,) for 2 states"),
        ({"event": lambda x: x}, SceneError, "event of fall: has 2 entries; give one number"),
        ({"event": lambda x: -x[0]}, ConvergenceError, "turn the sign of event round"),
        ({"event": lambda x: x[0] + 900.0 + 0.0 * x[1], "longest": 2.0}, ConvergenceError,
         "fall: lasts 2 s without coming to its event"),
        ({"jump": lambda x: [x[0], 1.0 - 1.1 * x[1]]}, ConvergenceError,
         "no periodic motion was found near the start"),
    ],
)  # fmt: skip
def test_refused(changed, kind, message):
    asked = {"start": [0.0, 2.0], "rate": lambda x: [x[1], -G], "event": lambda x: x[0],
             "jump": lambda x: [x[0], -0.8 * x[1] + 0.5]} | changed  # fmt: skip
    phase = Phase(asked["rate"], asked["event"], asked["jump"], name="fall")
    given = {key: asked[key] for key in ("cycles", "longest") if key in asked}
    with pytest.raises(kind, match=message.replace("(", r"\(").replace(")", r"\)")):
        impactfem.systems.periodic_orbit(
            HybridSystem([phase], ["height", "speed"]), asked["start"], **given
        )
