"""Shooting through impacts, against closed forms, own optima and another method's runs."""

import json

import numpy as np
import pytest
from scipy.optimize import minimize

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main
from impactfem.scene.signal import Signal

pytest.importorskip("casadi")

from impactfem.inverse import Impact
from impactfem.trajectory.problem import Problem
from impactfem.trajectory.scenes import trajectory
from impactfem.trajectory.struck import Struck

G = 9.81


def floor(e, name="floor"):
    return Impact(lambda _t, x, _u: x[0], lambda _t, x, _u: [x[0], -e * x[1]], name)


class TestDerivatives:
    def test_first_and_second_are_those_of_differences(self):
        """Of an interval with two impacts and a control that changes, by all that is given."""
        problem = Problem.of(
            lambda _t, x, u: [x[1], u[0] - G - 0.1 * x[1]], ["y", "v"], ["u"], (), 1.0, {}, {},
            running=lambda _t, x, u: u[0] ** 2 + x[0], impacts=(floor(0.6),),
        )  # fmt: skip
        flow, at = Struck(problem), np.array([0.2, 1.0, 0.1, 0.5, 1.5, 1.2])
        assert flow.events(at)[0] == (0, 0)
        first = np.asarray(flow.value(at, 1))
        second = np.asarray(flow.value(at, 2)).reshape(4, 6, 6, order="F")
        for order, found in ((0, first), (1, second)):
            for k, step in enumerate(1e-5 * np.eye(6)):
                ends = [np.asarray(flow.value(at + s * step, order)) for s in (1.0, -1.0)]
                slope = ((ends[0] - ends[1]) / 2e-5).reshape(found[..., k].shape)
                assert np.abs(found[..., k] - slope).max() < 1e-7 * np.abs(found).max()


def by_steps(v, steps, duration, e):
    """A ball by velocity-level steps: its height at the end, and what its steps have as slope."""
    dt, y, dy, dv = duration / steps, 1.0, 0.0, 1.0
    for _ in range(steps):
        free, factor = v - dt * G, 1.0
        if y + 0.5 * dt * v <= 0.0 and free < 0.0:
            factor = -e
        y, dy = y + 0.5 * dt * (v + factor * free), dy + 0.5 * dt * (1.0 + factor) * dv
        v, dv = factor * free, factor * dv
    return y, dy


def by_flights(v, duration, e):
    """The same from flight to flight."""
    y, t = 1.0, 0.0
    while True:
        hit = (v + np.sqrt(v * v + 2.0 * G * y)) / G
        if t + hit > duration:
            return y + v * (duration - t) - 0.5 * G * (duration - t) ** 2
        t, y, v = t + hit, 0.0, -e * (v - G * hit)


class TestTenImpacts:
    """With which speed does a ball begin that is at some height after ten impacts?"""

    DURATION, E, SPEED, GUESS = 5.6, 0.9, 0.5, 0.49

    def test_saltation_converges(self):
        found = impactfem.transcribe(
            lambda _t, x, _u: [x[1], -G], states=["y", "v"], duration=self.DURATION,
            start={"y": 1.0}, end={"y": by_flights(self.SPEED, self.DURATION, self.E)},
            impacts=[floor(self.E)], transcription="single_shooting", nodes=6,
            guess={"y": 1.0, "v": self.GUESS},
        )  # fmt: skip
        assert found.trusted
        assert len(found.impacts) == 10
        assert found.states["v"][0] == pytest.approx(self.SPEED, abs=1e-8)

    @pytest.mark.parametrize("steps", [1000, 8000])
    def test_derivatives_of_steps_do_not(self, steps):
        """Their slope is +.14 and +.05 where -.17 is right: the search swings between bounds."""
        wanted, v = by_flights(self.SPEED, self.DURATION, self.E), self.GUESS
        off = []
        for _ in range(15):
            y, slope = by_steps(v, steps, self.DURATION, self.E)
            off.append(abs(y - wanted))
            v = min(max(v - (y - wanted) / slope, 0.0), 1.0)
        assert min(off) > 1e-2


class TestTwoDiscs:
    """One is pushed so that the other, struck once, ends at 0 (Zhong, Han, Dey, Brikis 2023)."""

    RADIUS, SHARE, FIRST, SECOND = 0.2, 0.01, np.array([-1.0, -2.0]), np.array([-1.0, -1.0])

    def cost(self, unknown):
        """Least cost of a strike at some time along some direction.

        Along it the first disc goes d from rest to the speed v, across it w to any speed, so that
        int u^2 is 12 d^2/s^3 - 12 d v/s^2 + 4 v^2/s + 3 w^2/s^3; v is that of the least sum.
        """
        s, angle = unknown
        n = np.array([np.cos(angle), np.sin(angle)])
        away = self.SECOND - self.FIRST
        d, w, rest = away @ n - 2.0 * self.RADIUS, away[1] * n[0] - away[0] * n[1], 1.0 - s
        pull = 6.0 * self.SHARE * d / s**2 - rest * (self.SECOND @ n)
        v = pull / (rest**2 + 4.0 * self.SHARE / s)
        end = self.SECOND + rest * v * n
        pushed = 12 * d**2 / s**3 - 12 * d * v / s**2 + 4 * v**2 / s + 3 * w**2 / s**3
        return end @ end + self.SHARE * pushed

    def test_optimum(self):
        """Pushed up to the strike: no push afterwards moves the other disc."""

        def rate(_t, x, u):
            return [x[4], x[5], x[6], x[7], u[0] * x[8], u[1] * x[8], 0, 0, 0]

        def away(x):
            return x[2] - x[0], x[3] - x[1], np.sqrt((x[2] - x[0]) ** 2 + (x[3] - x[1]) ** 2)

        def jump(_t, x, _u):
            a, b, length = away(x)
            push = ((x[4] - x[6]) * a + (x[5] - x[7]) * b) / length**2
            return [*(x[k] for k in range(4)), x[4] - push * a, x[5] - push * b,
                    x[6] + push * a, x[7] + push * b, 0]  # fmt: skip

        strike = Impact(lambda _t, x, _u: away(x)[2] - 2.0 * self.RADIUS, jump, "discs")
        first = {"x1": -1, "y1": -2, "x2": -1, "y2": -1} | dict.fromkeys(["a", "b", "c", "d"], 0)
        found = impactfem.transcribe(
            rate, states=[*first, "pushed"], controls=["u", "v"], duration=1.0,
            start=first | {"pushed": 1}, final=lambda _t, x: x[2] ** 2 + x[3] ** 2,
            running=lambda _t, x, u: self.SHARE * (u[0] ** 2 + u[1] ** 2) * x[8],
            impacts=[strike], transcription="single_shooting", nodes=1, guess={"u": 0.8, "v": 5.5},
        )  # fmt: skip
        best = minimize(self.cost, [0.5, 0.9], method="Nelder-Mead",
                        options={"xatol": 1e-10, "fatol": 1e-14})  # fmt: skip
        assert found.trusted
        assert found.cost == pytest.approx(best.fun, rel=1e-9)  # 0.31141687
        assert found.impacts[0]["time"] == pytest.approx(best.x[0], rel=1e-6)


class TestJuggling:
    """A ball that a plate, which moves as A sin(w t + p), throws to the same apex each time.

    With the impact at y = A sin p and the speed v = g T/2 after it: A w cos p = v (1 - e)/(1 + e).
    Its multipliers have the product e^2 and the sum 1 + e^2 - (1 + e)^2 A w^2 sin(p)/g: it is
    stable for 0 < A w^2 sin p < 2 g (1 + e^2)/(1 + e)^2.
    """

    E, PERIOD = 0.7, 0.5

    def plate(self, bend):
        """Apex, amplitude and phase with which A w^2 sin p is a share of its limit."""
        w, v = 2.0 * np.pi / self.PERIOD, 0.5 * G * self.PERIOD
        limit = 2.0 * G * (1.0 + self.E**2) / (1.0 + self.E) ** 2
        height, fast = bend * limit / w**2, v * (1.0 - self.E) / (1.0 + self.E) / w
        return height + 0.5 * v**2 / G, np.hypot(height, fast), np.arctan2(height, fast)

    def found(self, bend):
        apex, size, phase = self.plate(bend)
        w = 2.0 * np.pi / self.PERIOD
        place = 0.5 * np.pi  # the apex is half a period from the impact

        def law(t, p):
            turn = w * (t - 0.5 * self.PERIOD) + p[1] * place
            return p[0] * np.sin(turn), w * p[0] * np.cos(turn)

        strike = Impact(
            lambda t, x, _u, p: x[0] - law(t, p)[0],
            lambda t, x, _u, p: [x[0], (1.0 + self.E) * law(t, p)[1] - self.E * x[1]], "plate",
        )  # fmt: skip
        found = impactfem.transcribe(
            lambda _t, x, _u, _p: [x[1], -G], states=["y", "v"], duration=self.PERIOD,
            parameters={"size": (0.0, 1.0), "turn": (0.0, 1.0)}, start={"y": apex, "v": 0.0},
            end={"y": apex, "v": 0.0}, impacts=[strike], transcription="single_shooting", nodes=1,
            guess={"size": 0.95 * size, "turn": 0.95 * phase / place},
        )  # fmt: skip
        assert found.trusted
        assert found.parameters["size"] == pytest.approx(size, rel=1e-8)
        assert found.parameters["turn"] * place == pytest.approx(phase, rel=1e-8)
        return found, law

    @pytest.mark.parametrize(("bend", "stable"), [(0.5, True), (1.05, False)])
    def test_twenty_hits(self, bend, stable):
        found, law = self.found(bend)
        size, turn = found.parameters.values()
        at = np.array([0.0, found.states["y"][0], 0.0, size, turn, self.PERIOD])
        slopes = np.asarray(Struck(found.problem).value(at, 1))[:2, 1:3]
        limit = 2.0 * (1.0 + self.E**2)
        wanted = [self.E**2, 1.0 + self.E**2 - bend * limit]
        assert [np.linalg.det(slopes), np.trace(slopes)] == pytest.approx(wanted, rel=1e-6)
        assert (np.abs(np.linalg.eigvals(slopes)).max() < 1.0) == stable
        moves = Signal(rest=lambda t: law(t, [size, turn])[0])
        system = impactfem.systems.GeneralizedSystem(
            mass=1.0, force=lambda *_: [-G], constraints=lambda u: u[:1], jacobian=[[1.0]],
            restitution=self.E, motion=[moves],
        )  # fmt: skip
        apex = found.states["y"][0]
        ball = impactfem.integrate(system, [apex * 1.02], [0.0], 20.5 * self.PERIOD)
        last = ball.position[ball.times > 19.0 * self.PERIOD].max()
        height = apex - law(0.5 * self.PERIOD, [size, turn])[0]
        assert (abs(last - apex) < 0.01 * height) == stable


def pendulum(**asked):
    """A bob of 1 kg on 1 m that strikes a stop at 1.2 rad and is asked to be at 0.9 rad then."""
    return {
        "title": "pendulum and stop", "duration": 1.0, "gravity": [0.0, -G],
        "body": [{"kind": "rigid", "name": "bob", "mass": 1.0, "inertia": 1e-3,
                  "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, -1.0]}}],
        "joint": [{"name": "hinge", "kind": "revolute", "between": ["ground", "bob"],
                   "point": [0.0, 0.0], "limits": [-3.0, 1.2], "restitution": 0.5}],
        "control": [{"name": "twist", "acts": "joint.hinge.motor", "kind": "linear", "start": 10.0,
                     "bounds": [-20.0, 20.0]}],
        "trajectory": {"transcription": "single_shooting", "nodes": 10, "refine": 1e-5,
                       "end": {"hinge.q": 0.9, "hinge.v": "free"}} | asked,
    }  # fmt: skip


class TestScenes:
    def test_pendulum_against_a_stop(self, tmp_path):
        scene = tmp_path / "scene.toml"
        scene.write_text(Scene.from_dict(pendulum()).to_toml())
        assert main(["trajectory", str(scene), "--out", str(tmp_path / "out")]) == 0
        told = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert told["resimulated_by"] == "event_driven"
        assert [each["of"] for each in told["impacts"]] == ["the upper limit of hinge"]
        assert told["resimulated_end_error"] < 1e-5**0.5

    @pytest.mark.parametrize("friction", [0.1, 1.0])
    def test_disc_thrown_on_a_floor_that_rubs(self, friction):
        """It slips, or grips: the end that is asked follows by `event_driven`."""
        found = trajectory(Scene.from_dict({
            "title": "disc", "duration": 0.8, "gravity": [0.0, -G],
            "body": [{"kind": "rigid", "name": "disc", "mass": 2.0, "velocity": [1.0, 0.0],
                      "angular_velocity": 4.0, "force": ["0", "0"],
                      "shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 1.0]}}],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                          "normal": [0.0, 1.0]}],
            "contact": [{"between": ["disc", "floor"], "restitution": 0.8,
                         "friction_coefficient": friction}],
            "control": [{"name": "push", "acts": "body.disc.force.x", "kind": "linear"}],
            "trajectory": {"transcription": "multiple_shooting", "nodes": 3,
                           "end": {"disc.x": 1.0, "disc.vx": "free"}},
        })).found  # fmt: skip
        assert found.trusted
        assert len(found.impacts) == 1
        assert found.resimulated_distance < 1e-8


class TestRefused:
    @pytest.mark.parametrize(
        ("height", "told"),
        [(0.08, "start: 0.02 inside .disc on floor"), (0.1, "accumulate in las")],
    )
    def test_disc_that_begins_inside_or_at_rest(self, height, told):
        with pytest.raises(SceneError, match=told):
            trajectory(Scene.from_dict({
                "title": "disc", "duration": 0.5, "gravity": [0.0, -G],
                "body": [{"kind": "rigid", "name": "disc", "mass": 2.0, "force": ["0", "0"],
                          "shape": {"kind": "disc", "radius": 0.1, "center": [0.0, height]}}],
                "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                              "normal": [0.0, 1.0]}],
                "contact": [{"between": ["disc", "floor"], "restitution": 0.8}],
                "control": [{"name": "push", "acts": "body.disc.force.x", "kind": "linear"}],
                "trajectory": {"transcription": "single_shooting", "nodes": 2,
                               "end": {"disc.x": 1.0}},
            }))  # fmt: skip

    def test_collocation(self):
        with pytest.raises(SceneError, match="does not go through impacts"):
            impactfem.transcribe(lambda _t, x, _u: [x[1], -G], states=["y", "v"], duration=1.0,
                                 impacts=[floor(0.5)])  # fmt: skip

    def test_impacts_that_accumulate(self):
        with pytest.raises(SceneError, match=r"guess: cannot be followed .* accumulate"):
            impactfem.transcribe(
                lambda _t, x, _u: [x[1], -G], states=["y", "v"], duration=5.0, nodes=2,
                start={"y": 1.0, "v": 0.0}, impacts=[floor(0.5)], transcription="single_shooting",
            )  # fmt: skip

    def test_jump_without_all_states(self):
        jump = Impact(lambda _t, x, _u: x[0], lambda _t, x, _u: [-x[1]], "wall")
        with pytest.raises(SceneError, match="jump of wall has 1 entries for 2 states"):
            impactfem.transcribe(lambda _t, x, _u: [x[1], -G], states=["y", "v"], duration=1.0,
                                 impacts=[jump], transcription="single_shooting")  # fmt: skip

    def test_end_that_no_motion_with_these_impacts_has(self):
        found = impactfem.transcribe(
            lambda _t, x, _u: [x[1], -G], states=["y", "v"], duration=1.0, nodes=2,
            start={"y": 1.0, "v": 0.0}, end={"y": 3.0}, impacts=[floor(0.5)],
            transcription="single_shooting",
        )  # fmt: skip
        assert not found.trusted
        assert "as often as the guess does (floor: 2)" in found.message
