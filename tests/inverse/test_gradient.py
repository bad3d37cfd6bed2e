"""Gradients of scenes: against closed forms, by the command, and what is refused or doubted."""

import json

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main
from impactfem.inverse.varied import Varied
from impactfem.vibro import tangents

G = 9.81


def ball(*tables, duration=0.9, **point):
    """A ball that falls on a floor, with tables of what is asked."""
    body = {"kind": "point", "name": "ball", "mass": 2.0, "position": [0.0, 1.0]} | point
    return {
        "title": "ball", "duration": duration, "gravity": [0.0, -G], "body": [body],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "contact": [{"between": ["ball", "floor"], "restitution": 0.8}],
        "output": {"report": False, "pictures": False, "fields": []},
    } | dict(tables)  # fmt: skip


H0 = {"name": "h0", "key": "body.ball.position.1"}
E = {"name": "e", "key": "contact.0.restitution"}
HEIGHT = {"name": "height", "of": "ball.y"}
VALUE = {"minimise": [{"term": "value", "of": "height"}]}


def asked(parameters, measures=(HEIGHT,), objective=VALUE):
    return ("parameter", list(parameters)), ("measure", list(measures)), ("objective", objective)


def test_a_height_after_an_impact():
    found = impactfem.gradient(Scene.from_dict(ball(*asked([H0, E]))))
    fall = np.sqrt(2.0 / G)
    assert found.objective == pytest.approx(
        0.8 * G * fall * (0.9 - fall) - 0.5 * G * (0.9 - fall) ** 2
    )
    assert found.gradient["h0"] == pytest.approx(0.98785200, abs=1e-8)
    assert found.gradient["e"] == pytest.approx(G * fall * (0.9 - fall), rel=1e-9)
    assert found.trusted
    assert found.check.rate == pytest.approx(2.0, abs=0.1)


def test_a_ball_at_rest_says_since_when():
    """It rests from sqrt(2 h/g) (1 + e)/(1 - e) on: its duration of contact is the rest."""
    measure = {"name": "m", "of": "duration.ball.floor"}
    objective = {"minimise": [{"term": "value", "of": "m"}]}
    scene = Scene.from_dict(ball(*asked([H0], [measure], objective), duration=6.0))
    found = impactfem.gradient(scene)
    rest = np.sqrt(2.0 / G) * 1.8 / 0.2
    assert found.objective == pytest.approx(6.0 - rest, rel=1e-6)
    assert found.gradient["h0"] == pytest.approx(-0.5 * rest, rel=1e-5)


@pytest.mark.parametrize("force", [None, ["0", "-1e-9*vy"]])
def test_the_impulse_of_what_stays_on_the_floor(force):
    """m (v + g t) in all, of which what is hit falls as what is pressed grows."""
    measures = [{"name": "p", "of": "impulse.ball.floor"}]
    parameters = [{"name": "v", "key": "body.ball.velocity.1"}, H0]
    objective = {"minimise": [{"term": "value", "of": "p"}, {"term": "speed", "body": "ball"}]}
    point = {"velocity": [0.0, -1.0], "position": [0.0, 1.0]} | ({"force": force} if force else {})
    data = ball(*asked(parameters, measures, objective), **point)
    data["contact"][0]["restitution"] = 0.0
    data["body"][0]["mass"] = 2.0
    varied = Varied.of(Scene.from_dict(data))
    q, jacobian, *_ = varied.jacobian(varied.start)
    assert q[0] == pytest.approx(2.0 * (1.0 + G * 0.9), rel=1e-8)
    assert jacobian[0] == pytest.approx([-2.0, 0.0], abs=1e-7)


def test_when_a_load_jumps():
    """From x'' = 1 + t up to a, then -1, against a closed form, with an impact behind it."""
    body = {"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0],
            "force": ["where(t < a, 1 + t, -1)"]}  # fmt: skip
    data = ball(*asked([{"name": "a", "start": 0.5}], [{"name": "height", "of": "ball.x"}]))
    data |= {"duration": 2.5, "body": [body], "gravity": [0.0]}
    data["obstacle"][0] |= {"point": [0.3], "normal": [-1.0]}

    def place(a, t=2.5, wall=0.3):
        speed, at = a + a**2 / 2, a**2 / 2 + a**3 / 6  # at the jump
        hit = a + speed - np.sqrt(speed**2 - 2.0 * (wall - at))
        left = -0.8 * (speed - (hit - a))
        return wall + left * (t - hit) - 0.5 * (t - hit) ** 2

    found = impactfem.gradient(Scene.from_dict(data))
    assert found.objective == pytest.approx(place(0.5), rel=1e-9)
    far, near = ((place(0.5 + h) - place(0.5 - h)) / (2.0 * h) for h in (1e-4, 5e-5))
    assert found.gradient["a"] == pytest.approx((4.0 * near - far) / 3.0, rel=1e-9)
    assert found.trusted


def test_all_terms_by_the_mass():
    """Impulse, energy, speed: what a mass changes, and what it does not."""
    for term, right in (
        ({"term": "terminal_energy"}, G * 0.64),
        ({"term": "speed", "body": "ball"}, 0.0),
        ({"term": "value", "of": "p"}, 1.8 * np.sqrt(2.0 * G)),
    ):
        measures = [{"name": "p", "of": "impulse.ball.floor"}]
        parameters = [{"name": "m", "key": "body.ball.mass"}]
        scene = Scene.from_dict(ball(*asked(parameters, measures, {"minimise": [term]})))
        found = impactfem.gradient(scene)
        assert found.gradient["m"] == pytest.approx(right, rel=1e-9, abs=1e-9)


def test_a_name_in_a_formula():
    """A drag c in the force, and a rebound speed: against differences of runs."""
    measure = {"name": "height", "of": "rebound_speed.ball"}
    parameters = [{"name": "c", "start": 0.05}]

    def made(c):
        tables = asked([parameters[0] | {"start": c}], [measure])
        return Scene.from_dict(
            ball(*tables, force=["0", "-c*vy*abs(vy)"]) | {"solve": {"tolerance": 1e-12}}
        )

    found = impactfem.gradient(made(0.05))
    near = [impactfem.gradient(made(0.05 + h)).objective for h in (1e-3, -1e-3, 5e-4, -5e-4)]
    right = (8.0 * (near[2] - near[3]) - (near[0] - near[1])) / 6e-3
    assert found.gradient["c"] == pytest.approx(right, rel=1e-8)


def founding(*tables, gap=0.5):
    bar = {"kind": "bar", "name": "bar", "length": 1.0, "area": 1.0, "density": 1.0,
           "youngs_modulus": 1.0, "gap": gap, "velocity": -0.5}  # fmt: skip
    return {
        "title": "bar", "duration": 3.5, "body": [bar], "solve": {"method": "exact"},
        "obstacle": [{"kind": "wall", "name": "wall"}],
        "output": {"report": False, "pictures": False, "fields": []},
    } | dict(tables)  # fmt: skip


def test_the_impulse_of_a_bar():
    """It is 2 v rho A c l/c while the contact is within the run, 2 rho A v L in all."""
    parameters = [
        {"name": "v", "key": "body.bar.velocity"}, {"name": "rho", "key": "body.bar.density"}
    ]  # fmt: skip
    tables = asked(parameters, [{"name": "height", "of": "impulse.bar.wall"}])
    found = impactfem.gradient(Scene.from_dict(founding(*tables)))
    assert found.objective == pytest.approx(1.0, rel=1e-12)
    assert found.gradient["v"] == pytest.approx(-2.0, rel=1e-7)
    assert found.gradient["rho"] == pytest.approx(1.0, rel=1e-7)
    assert found.trusted


def test_a_kink_is_told_with_both_sides():
    """Where the contact ends with the run, slopes of the impulse by the gap are 0 and -1 N s/m."""
    tables = asked(
        [{"name": "H", "key": "body.bar.gap"}], [{"name": "height", "of": "impulse.bar.wall"}]
    )
    scene = founding(*tables) | {"duration": 3.0}
    found = impactfem.gradient(Scene.from_dict(scene))
    assert found.doubts
    assert not found.trusted
    assert found.gradient["H"] == pytest.approx(-0.5, abs=1e-6)


def test_the_command_and_a_wrong_term(tmp_path, monkeypatch, capsys):
    """A derivative that forgets the change of the time of an impact ends with 3."""
    path = tmp_path / "ball.toml"
    path.write_text(Scene.from_dict(ball(*asked([H0, E]))).to_toml(), encoding="utf-8")
    assert main(["gradient", str(path), "--out", str(tmp_path / "g")]) == 0
    told = json.loads((tmp_path / "g/gradient.json").read_text(encoding="utf-8"))
    assert told["gradient"]["h0"] == pytest.approx(0.987852, abs=1e-8)
    assert told["check"]["taylor_rate"] > 1.9
    monkeypatch.setattr(tangents._Run, "_late", lambda *_: np.zeros(2))
    assert main(["gradient", str(path), "--out", str(tmp_path / "w")]) == 3
    told = json.loads((tmp_path / "w/gradient.json").read_text(encoding="utf-8"))
    assert told["check"]["taylor_rate"] < 1.2
    assert "do not trust this gradient" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        (asked([{"name": "h", "key": "body.ball.positio.1"}]), r"parameter\[0\]\.key.*positio"),
        (asked([{"name": "h", "key": "body.ball.position.2"}]), r"parameter\[0\]\.key.*0 to 1"),
        (asked([{"name": "h", "key": "body.ball.name"}]), r"parameter\[0\]\.key.*number"),
        (asked([{"name": "h", "key": "body.ball.mas"}]), r"parameter\[0\]\.key.*mass"),
        (asked([E | {"bounds": [0.0, 0.5]}]), r"parameter\[0\]\.bounds.*excludes"),
        (asked([{"name": "x", "start": 1.0}]), r"parameter\[0\]\.name.*formula"),
        (asked([{"name": "c"}]), r"parameter\[0\]\.start is missing"),
        (asked([E, E]), r"parameter\[1\]\.name"),
        (asked([H0], [HEIGHT | {"of": "bal.y"}]), r"measure\[0\]\.of.*ball\.y"),
        (asked([H0], [HEIGHT | {"unit": "mm"}]), r"measure\[0\]\.unit.*convert"),
        (asked([H0], [HEIGHT | {"at": 2.0}]), r"measure\[0\]\.at.*after the end"),
        (asked([{"name": "m", "key": "body.ball.mass"}]), r"parameter\[0\]\.key.*moves nothing"),
        (asked([H0], objective={"minimise": [{"term": "misfit", "of": "height"}]}), "neither data"),
        (asked([H0], objective={"minimise": [{"term": "value"}]}), r"minimise\[0\]\.of is missing"),
        (asked([H0], objective={"minimise": [{"term": "speed", "body": "bal"}]}), r"\.body.*ball"),
        (asked([]), "nothing may vary"),
    ],
)  # fmt: skip
def test_bad_input_is_named(tables, words):
    with pytest.raises(SceneError, match=words):
        impactfem.gradient(Scene.from_dict(ball(*tables)))


def test_methods_without_right_gradients_are_refused():
    for method in ("moreau_jean", "paoli_schatzman"):
        scene = Scene.from_dict(ball(*asked([H0])) | {"solve": {"method": method}})
        with pytest.raises(SceneError, match="event_driven"):
            impactfem.gradient(scene)
    speed = {"name": "v", "key": "body.bar.velocity"}
    bar = founding(*asked([speed], [{"name": "height", "of": "impulse.bar.wall"}]))
    scene = Scene.from_dict(bar | {"solve": {"method": "newmark"}})
    with pytest.raises(SceneError, match="exact"):
        impactfem.gradient(scene)


def test_a_parameter_and_the_scene_say_one_number():
    scene = Scene.from_dict(ball(*asked([H0 | {"start": 1.5}, {"name": "c", "start": 0.1}]),
                                 force=["0", "-c*vy"]))  # fmt: skip
    assert scene.points[0].position == (0.0, 1.5)
    moved = scene.with_settings({"body.ball.position": [0.0, 2.0], "parameter.c.start": 0.2})
    assert moved.parameters[0].start == 2.0
    assert moved.points[0].force[1](vy=1.0) == -0.2
    assert scene.points[0].force[1](vy=1.0) == -0.1
    assert scene.points[0].force[1] != moved.points[0].force[1]
    assert Scene.from_dict(moved.to_dict()) == moved


def test_a_restitution_of_1_has_a_derivative_from_below():
    scene = ball(*asked([E])) | {"contact": [{"between": ["ball", "floor"], "restitution": 1.0}]}
    found = impactfem.gradient(Scene.from_dict(scene))
    fall = np.sqrt(2.0 / G)
    assert found.gradient["e"] == pytest.approx(G * fall * (0.9 - fall), rel=1e-7)


def test_a_rod_that_clatters_against_differences():
    # Seven impacts of both ends; runs of their own, central differences over two steps.
    names = {"h": "center.1", "a": "inclination", "v": "velocity.0"}
    scene = Scene.from_dict({
        "title": "rod", "duration": 0.8, "gravity": [0.0, -G],
        "body": [{"kind": "rod", "name": "rod", "mass": 1.0, "length": 0.6,
                  "center": [0.0, 0.8], "inclination": 0.6, "velocity": [0.5, 0.0]}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "contact": [{"between": ["rod", "floor"], "restitution": 0.5}],
        "parameter": [{"name": n, "key": f"body.rod.{k}"} for n, k in names.items()] + [E],
        "measure": [{"name": k, "of": f"rod.{k}"} for k in ("x", "y", "angle")],
        "objective": {"minimise": [{"term": "value", "of": k} for k in ("x", "y", "angle")]},
        "solve": {"method": "event_driven"}, "output": {"report": False, "pictures": False},
    })  # fmt: skip
    assert len(impactfem.solve(scene).impacts.time) == 7
    varied = Varied.of(scene)
    found = varied.jacobian(varied.start)
    assert not found.doubts
    for k, way in enumerate(np.eye(4)):
        near, far = (
            (varied.numbers(varied.start + h * way) - varied.numbers(varied.start - h * way))
            / (2.0 * h)
            for h in (5e-4, 1e-3)
        )
        np.testing.assert_allclose(found.jacobian[:, k], (4.0 * near - far) / 3.0, atol=1e-8)


def test_a_parameter_hides_no_variable_of_a_formula():
    """Which of both was meant would be a guess: a motor's q is its joint's coordinate."""
    shape = {"kind": "block", "size": [1.0, 0.1], "corner": [0.0, 0.0]}
    arm = {"kind": "rigid", "name": "arm", "density": 1000.0, "shape": shape}
    joint = {"kind": "revolute", "between": ["ground", "arm"], "point": [0.0, 0.05]}
    with pytest.raises(SceneError, match=r"joint\[0\].motor.*'q' is a variable here.*another"):
        Scene.from_dict({
            "title": "arm", "duration": 1.0, "gravity": [0.0, -G], "body": [arm],
            "joint": [joint | {"motor": "-3*q"}], "parameter": [{"name": "q", "start": 1.0}],
        })  # fmt: skip


def test_the_time_of_a_first_touch_has_a_derivative():
    """sqrt(2 h/g) of a ball, H / v of a bar; what does not touch is named."""
    first = {"minimise": [{"term": "time", "until": "ball.floor"}]}
    found = impactfem.gradient(Scene.from_dict(ball(*asked([H0], [], first))))
    fall = np.sqrt(2.0 / G)
    assert found.objective == pytest.approx(fall, rel=1e-10)
    assert found.gradient["h0"] == pytest.approx(0.5 * fall, rel=1e-8)
    with pytest.raises(SceneError, match=r'"ball.floor" does not touch'):
        impactfem.gradient(Scene.from_dict(ball(*asked([H0], [], first), duration=0.3)))
    wrong = {"minimise": [{"term": "time", "until": "ball.wall"}]}
    with pytest.raises(SceneError, match=r'until = "ball.wall": there is ball.floor'):
        impactfem.gradient(Scene.from_dict(ball(*asked([H0], [], wrong))))
    bar = {"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
           "gap": 0.5, "velocity": -0.4}  # fmt: skip
    found = impactfem.gradient(Scene.from_dict({
        "title": "bar", "duration": 3.0, "body": [bar], "obstacle": [{"kind": "wall"}],
        "parameter": [{"name": "H", "key": "body.bar.gap"}],
        "objective": {"minimise": [{"term": "time", "until": "bar.wall"}]},
    }))  # fmt: skip
    assert (found.objective, found.gradient["H"]) == pytest.approx((1.25, 2.5), rel=1e-8)


def test_the_least_time_in_which_a_switch_closes():
    """The largest push all the way (bang, without a need to stop)."""
    scene = ball(*asked([], [], {"minimise": [{"term": "time", "until": "ball.floor"}]}))
    scene["control"] = [{"name": "push", "acts": "body.ball.force.1", "pieces": 3,
                         "bounds": [-20.0, 20.0]}]  # fmt: skip
    scene["body"][0]["force"] = ["0", "0"]
    found = impactfem.optimise(Scene.from_dict(scene))
    falls = np.sqrt(2.0 / (G + 10.0))  # 20 N on 2 kg
    assert found.objective["final"] == pytest.approx(falls, rel=1e-8)
    assert found.trusted
