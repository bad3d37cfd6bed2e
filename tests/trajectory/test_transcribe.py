"""Trajectories against closed forms, their orders, and what is refused or said not to be."""

import math
import re

import numpy as np
import pytest

import impactfem
from impactfem import SceneError
from impactfem.trajectory.nlp import Answer

pytest.importorskip("casadi")


def moved(**changed):
    """A block that is moved by 1 m in 1 s, from rest to rest, with least int u^2: u = 6 - 12 t."""
    asked = {
        "states": ["x", "v"], "controls": ["u"], "duration": 1.0,
        "start": {"x": 0.0, "v": 0.0}, "end": {"x": 1.0, "v": 0.0},
        "running": lambda _t, _x, u: u[0] ** 2,
    } | changed  # fmt: skip
    return impactfem.transcribe(lambda _t, x, u: [x[1], u[0]], **asked)


def quickest(**changed):
    """The same with |u| <= 1 in least time, 2 s."""
    asked = {"controls": {"u": (-1.0, 1.0)}, "running": None, "duration": (0.1, 100.0)}
    return moved(**(asked | {"final": lambda t, _x: t} | changed))


def swung_up(transcription, nodes, **changed):
    """Kelly's pole of .3 kg and .5 m on a cart of 1 kg that turns over in 2 s."""
    heavy, light, length, g = 1.0, 0.3, 0.5, 9.81

    def rate(_t, x, u):
        s, c, push, spin = np.sin(x[1]), np.cos(x[1]), u[0], x[3]
        mass = heavy + light * s**2
        cart = (length * light * s * spin**2 + push + light * g * c * s) / mass
        pole = -(length * light * c * s * spin**2 + push * c + (heavy + light) * g * s)
        return [x[2], spin, cart, pole / (length * mass)]

    rest = {"v": 0.0, "spin": 0.0}
    return impactfem.transcribe(
        rate, states={"x": (-2.0, 2.0), "angle": None, "v": None, "spin": None},
        controls={"u": (-20.0, 20.0)}, duration=2.0, start={"x": 0.0, "angle": 0.0} | rest,
        end={"x": 1.0, "angle": np.pi} | rest, running=lambda _t, _x, u: u[0] ** 2,
        transcription=transcription, nodes=nodes, **changed,
    )  # fmt: skip


class TestBlock:
    # With N constant controls J = 12/(1 - 1/N^2).
    @pytest.mark.parametrize(
        ("transcription", "nodes", "cost"),
        [
            ("trapezoid", 10, 12.461059), ("trapezoid", 20, 12.116622),
            ("trapezoid", 40, 12.029510), ("hermite_simpson", 4, 12.0),
            ("multiple_shooting", 4, 12.0), ("single_shooting", 4, 12.0),
            ("midpoint", 10, 12.0 / 0.99), ("euler", 10, 12.0 / 0.99),
        ],
    )  # fmt: skip
    def test_least_effort(self, transcription, nodes, cost):
        found = moved(transcription=transcription, nodes=nodes)
        assert found.trusted
        assert found.cost == pytest.approx(cost, abs=1e-6)
        assert found.kkt_residual < 1e-8

    def test_control_and_motion_are_those_of_the_closed_form(self):
        found = moved(nodes=5)
        t = np.linspace(0.0, 0.99, 7)
        assert found.control(t)[:, 0] == pytest.approx(6 - 12 * t)
        assert found.states["x"] == pytest.approx(3 * found.times**2 - 2 * found.times**3)
        assert found.resimulated_distance < 1e-12

    def test_end_that_a_coarse_control_misses_is_stated(self):
        """The trapezoid's control, followed: each interval misses h^3 u'/12 of x."""
        found = moved(transcription="trapezoid", nodes=10)
        change = found.controls["u"][-1] - found.controls["u"][0]
        assert found.end_errors["x"] == pytest.approx(abs(change) * 0.1**2 / 12, rel=1e-6)
        assert moved(transcription="trapezoid", nodes=3).doubts

    @pytest.mark.parametrize(("mass", "length", "time"), [(1e-9, 1e-6, 1e-3), (1e6, 1e3, 1e-2)])
    def test_units_do_not_matter(self, mass, length, time):
        found = impactfem.transcribe(
            lambda _t, x, u: [x[1], u[0] / mass], states=["x", "v"], controls=["u"],
            duration=time, start={"x": 0, "v": 0}, end={"x": length, "v": 0},
            running=lambda _t, _x, u: u[0] ** 2, nodes=4,
        )  # fmt: skip
        assert found.cost == pytest.approx(12 * (mass * length) ** 2 / time**3, rel=1e-9)


class TestLeastTime:
    def test_bang_bang(self):
        found = quickest()
        assert found.duration == pytest.approx(2.0, abs=1e-7)
        assert found.control([0.5, 1.5])[:, 0] == pytest.approx([1.0, -1.0], abs=1e-6)

    def test_brachistochrone(self):
        found = impactfem.transcribe(
            lambda _t, x, u: [x[2] * np.sin(u[0]), x[2] * np.cos(u[0]), 9.81 * np.cos(u[0])],
            states={"x": (0, 3), "y": (0, 3), "v": (0, 20)}, controls={"angle": (0, np.pi)},
            duration=(0.1, 10), start={"x": 0, "y": 0, "v": 0}, end={"x": 2, "y": 2},
            final=lambda t, _x: t, nodes=20,
        )  # fmt: skip
        assert found.cost == pytest.approx(0.8243386694, abs=1e-8)

    def test_a_parameter_is_found(self):
        """A quarter of a period in 1 s: k = (pi/2)^2."""
        found = impactfem.transcribe(
            lambda _t, x, _u, p: [x[1], -p[0] * x[0]], states=["x", "v"], duration=1.0,
            parameters={"k": (0.1, 10.0)}, start={"x": 1.0, "v": 0.0}, end={"x": 0.0},
        )  # fmt: skip
        assert found.parameters["k"] == pytest.approx(np.pi**2 / 4, rel=1e-6)


class TestCartPole:
    def test_orders(self):
        """Trapezoids from above by N^-2, Hermite and Simpson by N^-4, to one limit."""
        limit = 58.8076675
        rough = [swung_up("trapezoid", n).cost - limit for n in (25, 50)]
        assert rough[1] > 0
        assert math.log2(rough[0] / rough[1]) == pytest.approx(1.9, abs=0.1)
        fine = [limit - swung_up("hermite_simpson", n).cost for n in (25, 50)]
        assert fine[1] == pytest.approx(2.5e-5, rel=0.1)
        assert fine[0] / fine[1] > 16

    def test_refinement_holds_the_end(self):
        found = swung_up("hermite_simpson", 25, refine=1e-6)
        assert found.trusted
        assert found.rounds[0] == 25
        assert found.defect_max <= 1e-6
        assert found.resimulated_end_error < 1e-3
        assert found.resimulated_cost == pytest.approx(found.cost, rel=1e-4)
        again = swung_up("trapezoid", 25, guess=found)
        assert again.cost == pytest.approx(60.03552, abs=1e-4)


def test_block_pushed_with_dry_friction():
    """Relaxed complementarity tends to u = 2 mu g (1 - s/Ts), J = (4/3) (mu g)^2 Ts, from below.

    Controls are push, friction against either way, and the slip's size; its error is of order one
    in the intervals, since friction is free at the nodes where the block rests.
    """
    grip = 0.5 * 9.81
    time = np.sqrt(6.0 / grip)

    def share(nodes, eps):
        found = impactfem.transcribe(
            lambda _t, x, u: [x[1], u[0] - u[1] + u[2]], states=["x", "v"],
            controls={"push": (0, 40), "ahead": (0, 20), "back": (0, 20), "slip": (0, 20)},
            duration=time, start={"x": 0, "v": 0}, end={"x": 1, "v": 0},
            running=lambda _t, _x, u: u[0] ** 2, transcription="trapezoid", nodes=nodes,
            path=lambda _t, x, u: [
                u[1] + u[2] - grip, x[1] - u[3], -x[1] - u[3], u[1] * (u[3] - x[1]) - eps,
                u[2] * (u[3] + x[1]) - eps, (grip - u[1] - u[2]) * u[3] - eps,
            ],
            guess={"v": [0, 1.5 / time, 0], "slip": [0, 1.5 / time, 0], "push": grip,
                   "ahead": grip},
        )  # fmt: skip
        assert found.status == "converged"
        return found.cost / (4 / 3 * grip**2 * time)

    few, more = share(20, 1e-4), share(40, 1e-4)
    assert share(20, 1e-2) < few < more < 1.0
    assert 2.0 * more - few == pytest.approx(1.0, abs=0.01)


class TestCannotBe:
    def test_time_too_short(self):
        found = quickest(duration=1.5)
        assert found.status == "infeasible"
        assert not found.trusted
        assert "shortest duration that was found is 2 s" in found.message

    def test_path_that_is_in_the_way(self):
        found = moved(path=lambda _t, x, _u: [x[0] - 0.5], nodes=10)
        assert found.status == "infeasible"
        assert "path[0]" in found.message

    def test_motion_that_ends_before(self):
        """The rate x^2 grows endless at t = 1."""
        found = impactfem.transcribe(
            lambda _t, x, _u: [x[0] ** 2], states=["x"], duration=2.0, start={"x": 1.0},
            transcription="single_shooting",
        )  # fmt: skip
        assert not found.trusted

    @pytest.mark.parametrize(
        ("changed", "told"),
        [
            ({"start": {"x": 2.0}, "states": {"x": (0, 1), "v": None}}, "start.x: 2.0 lies out"),
            ({"states": {"x": (1, 0), "v": None}}, "states.x: 1 to 0 holds no number"),
            ({"start": {"y": 0.0}}, "start.y: there is no such state; states: x, v"),
            ({"states": ["x", "v", "w"]}, "has 2 entries for 3 states"),
            ({"running": lambda _t, _x, u: math.sin(u[0])}, "running: cannot be made"),
            ({"running": lambda _t, _x, u: max(0, u[0])}, "numpy.sin, not math.sin"),
            ({"transcription": "rk"}, '"rk" is not known; give one of euler, midpoint'),
            ({"duration": 0.0}, "duration: 0.0 is no span of time"),
            ({"nodes": 0}, "nodes: 0 is no number"),
            ({"guess": {"w": 1.0}}, "guess.w: there is no such name"),
        ],
    )  # fmt: skip
    def test_refused(self, changed, told):
        with pytest.raises(SceneError, match=re.escape(told)):
            moved(**changed)


def test_answers_that_ipopt_only_accepts_say_so():
    """As at degenerate rows; which they are differs from one version of Ipopt to the next."""
    for said, words in (
        ("Solve_Succeeded", "Solve_Succeeded"),
        ("Solved_To_Acceptable_Level", "acceptable level (optimality 0.0022), as where"),
    ):
        answer = Answer(np.zeros(1), 1.0, 2.2e-3, 0.0, "", 64, said)
        assert answer.status == "converged"
        assert words in answer.in_words
