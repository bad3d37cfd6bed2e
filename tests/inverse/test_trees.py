"""Gradients of bodies and joints that runs take by steps: closed forms, and what is refused."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.inverse.trees import TreeRuns
from impactfem.inverse.varied import Varied
from impactfem.trajectory.contacts import _TreeSystem

pytest.importorskip("casadi")

ABOUT = 1.0 * 0.5**2 + 0.05  # inertia about the hinge
ROOM = 1.2


def swung(motor="push", restitution=0.5, measures=None, duration=1.0, **more):
    """A weightless bob that a motor turns against a stop."""
    measured = measures or {"q": ("hinge.q", duration)}
    return {
        "title": "bob", "duration": duration, "gravity": [0.0, 0.0],
        "body": [{"kind": "rigid", "name": "bob", "mass": 1.0, "inertia": 0.05,
                  "shape": {"kind": "disc", "radius": 0.1, "center": [0.5, 0.0]}}],
        "joint": [{"name": "hinge", "kind": "revolute", "between": ["ground", "bob"],
                   "point": [0.0, 0.0], "limits": [-1.0, ROOM], "restitution": restitution,
                   "motor": motor}],
        "parameter": [
            {"name": "push", "start": 1.5},
            {"name": "e", "key": "joint.hinge.restitution"},
            {"name": "room", "key": "joint.hinge.limits.1"},
            {"name": "m", "key": "body.bob.mass"},
        ],
        "measure": [{"name": n, "of": of, "at": at} for n, (of, at) in measured.items()],
        "objective": {"minimise": [{"term": "value", "of": next(iter(measured))}]},
    } | more  # fmt: skip


def differences(function, at):
    steps = 1e-6 * np.maximum(np.abs(at), 1e-3)
    return [
        (function(*(at + h * one)) - function(*(at - h * one))) / (2.0 * h)
        for h, one in zip(steps, np.eye(len(at)), strict=True)
    ]


def slopes(tables, names):
    found = impactfem.gradient(Scene.from_dict(tables))
    assert found.method == "event_driven"
    assert not found.doubts
    assert found.check.rate is None or found.check.rate > 1.9  # None: it is linear
    return found, [found.gradient[name] for name in names]


class TestClosedForms:
    def test_bob_that_bounces_off_a_stop(self):
        def place(push, e, room, m):
            pull = push / (m * 0.5**2 + 0.05)
            rest = 1.0 - np.sqrt(2.0 * room / pull)
            return room - e * np.sqrt(2.0 * pull * room) * rest + 0.5 * pull * rest**2

        found, slope = slopes(swung(), ("push", "e", "room", "m"))
        at = np.array([1.5, 0.5, ROOM, 1.0])
        assert found.objective == pytest.approx(place(*at), rel=1e-9)
        assert slope == pytest.approx(differences(place, at), rel=1e-6)

    def test_bob_that_is_pressed_on_a_stop(self):
        """The stop takes all that the motor gave until it turns; then it leaves from rest."""
        tables = swung(
            "where(t < 1.2, push, -push)", 0.0,
            {"p": ("impulse.hinge", 1.5), "q": ("hinge.q", 1.5)}, 1.5,
        )  # fmt: skip
        tables["parameter"] = [tables["parameter"][k] for k in (0, 2)]
        found, slope = slopes(tables, ("push", "room"))
        assert found.objective == pytest.approx(1.5 * 1.2, rel=1e-8)
        assert slope == pytest.approx([1.2, 0.0], abs=1e-7)
        left = found.measures["q"]["gradient"]
        assert left["push"][0] == pytest.approx(-0.5 * 0.3**2 / ABOUT, rel=1e-6)
        assert left["room"][0] == pytest.approx(1.0, rel=1e-6)

    def test_point_that_slides_off_a_disc(self):
        """It leaves where cos = c = (v^2 + 2 g R)/(3 g R), and has sqrt(g R c) c across."""
        tables = {
            "title": "hill", "duration": 1.2, "gravity": [0.0, -9.81],
            "body": [
                {"kind": "point", "name": "p", "mass": 1.0, "position": [0.0, 1.0],
                 "velocity": [0.8, 0.0]},
                {"kind": "rigid", "name": "hill", "mass": 1.0,
                 "shape": {"kind": "disc", "radius": 1.0, "center": [0.0, 0.0]}},
            ],
            "joint": [{"name": "held", "kind": "fixed", "between": ["ground", "hill"],
                       "point": [0.0, 0.0]}],
            "contact": [{"between": ["p", "hill"]}],
            "parameter": [{"name": "v", "key": "body.p.velocity.0"}],
            "measure": [{"name": "across", "of": "p.vx", "at": 1.2}],
            "objective": {"minimise": [{"term": "value", "of": "across"}]},
        }  # fmt: skip
        found, slope = slopes(tables, ("v",))
        c = (0.8**2 + 2.0 * 9.81) / (3.0 * 9.81)
        assert found.objective == pytest.approx(np.sqrt(9.81 * c) * c, rel=1e-8)
        bend = 2.0 * 0.8 / (3.0 * 9.81)
        assert slope == pytest.approx([1.5 * np.sqrt(9.81 * c) * bend], rel=1e-6)

    def test_discs_that_rub_as_they_collide(self):
        """Slipping: the impulse across is the share mu of that along, n turns with the places."""

        def place(speed, e, mu, aside):
            away = np.array([0.5, aside])
            c = away @ [1.0, 0.0]
            way = c - np.sqrt(c**2 - away @ away + 0.2**2)  # until it touches
            n = (away - [way, 0.0]) / 0.2
            across = np.array([-n[1], n[0]])
            push = 0.5 * (1.0 + e) * speed * n[0]
            slip = speed * across[0]
            velocity = push * n + mu * push * np.sign(slip) * across
            return aside + velocity[1] * (1.0 - way / speed)

        disc = {"kind": "rigid", "mass": 1.0}
        tables = {
            "title": "discs", "duration": 1.0, "gravity": [0.0, 0.0],
            "body": [
                disc | {"name": name, "velocity": [speed, 0.0],
                        "shape": {"kind": "disc", "radius": 0.1, "center": at}}
                for name, speed, at in (("a", 1.0, [0.0, 0.0]), ("b", 0.0, [0.5, 0.12]))
            ],
            "contact": [{"between": ["a", "b"], "restitution": 0.7, "friction_coefficient": 0.05}],
            "parameter": [
                {"name": "v", "key": "body.a.velocity.0"},
                {"name": "e", "key": "contact.0.restitution"},
                {"name": "mu", "key": "contact.0.friction_coefficient"},
                {"name": "y", "key": "body.b.shape.center.1"},
            ],
            "measure": [{"name": "place", "of": "b.y", "at": 1.0}],
            "objective": {"minimise": [{"term": "value", "of": "place"}]},
        }  # fmt: skip
        found, slope = slopes(tables, ("v", "e", "mu", "y"))
        at = np.array([1.0, 0.7, 0.05, 0.12])
        assert found.objective == pytest.approx(place(*at), rel=1e-9)
        assert slope == pytest.approx(differences(place, at), rel=1e-6)

    def test_slider_of_a_robot_file(self, tmp_path):
        """It strikes its limit and stays: impulse sqrt(2 m push room) + push (T - t)."""
        pytest.importorskip("pinocchio")
        (tmp_path / "slider.xml").write_text(
            '<mujoco><worldbody><body name="b"><joint name="slide" type="slide" axis="1 0 0" '
            'range="-1 .4" limited="true"/><inertial mass="2" pos="0 0 0" diaginertia=".1 .1 .1"/>'
            "</body></worldbody></mujoco>"
        )
        scene = Scene.from_dict({
            "title": "slider", "duration": 1.0, "gravity": [0.0, 0.0, 0.0],
            "body": [{"kind": "mechanism", "name": "m", "file": "slider.xml",
                      "joints": {"slide": {"motor": "push"}}}],
            "parameter": [{"name": "push", "start": 3.0}],
            "measure": [{"name": "p", "of": "impulse.m.slide", "at": 1.0}],
            "objective": {"minimise": [{"term": "value", "of": "p"}]},
        }, base=tmp_path)  # fmt: skip
        found = impactfem.gradient(scene)
        late = np.sqrt(0.8 * 2.0 / 3.0)
        assert found.objective == pytest.approx(3.0, rel=1e-7)  # all that the motor gave
        assert found.gradient["push"] == pytest.approx(1.0, rel=1e-6)
        assert late < 1.0


@pytest.mark.slow
def test_a_body_that_turns_freely_in_space():
    """Two measures of a spin that a moment changes by push (1 - cos t) / I, I by the mass."""
    inertia, share = 2.0 / 12.0 * (0.2**2 + 0.3**2), 1.0 - np.cos(1.0)
    scene = Scene.from_dict({
        "title": "box", "duration": 1.0, "gravity": [0.0, 0.0, -9.81],
        "body": [{"kind": "rigid", "name": "box", "mass": 2.0, "velocity": [1.0, 0.0, 4.9],
                  "shape": {"kind": "block", "size": [0.2, 0.3, 0.4]},
                  "angular_velocity": [0.0, 0.0, 1.0], "moment": ["0", "0", "push * sin(t)"]}],
        "parameter": [{"name": "push", "start": 0.3}, {"name": "m", "key": "body.box.mass"}],
        "measure": [{"name": "w", "of": "box.wz", "at": 1.0},
                    {"name": "q", "of": "box.qz", "at": 1.0}],
        "objective": {"minimise": [{"term": "value", "of": "w"}, {"term": "value", "of": "q"}]},
    })  # fmt: skip
    turned = 1.0 - np.sin(1.0)  # of the moment, twice over time

    def told(push, m):
        rate = push / (inertia * m / 2.0)
        return 1.0 + rate * share + np.sin(0.5 * (1.0 + rate * turned))

    found = impactfem.gradient(scene)
    at = np.array([0.3, 2.0])
    assert found.objective == pytest.approx(told(*at), rel=1e-9)
    slope = [found.gradient[name] for name in ("push", "m")]
    assert slope == pytest.approx(differences(told, at), rel=1e-6)
    history = TreeRuns(None).outcome(scene, np.array([0.0, 1.0])).history
    units = [history[f"box.{name}"].attrs["units"] for name in ("x", "vx", "qw", "wx")]
    assert units == ["m", "m/s", "1", "rad/s"]


def test_restitution_and_damping_from_a_record():
    """Told again from angles."""
    joint = {"damping": 0.1, "stiffness": 0.5}
    truth = swung("1.5", 0.6, duration=1.2)
    truth["joint"][0] |= joint
    truth["parameter"] = [
        {"name": name, "key": f"joint.hinge.{key}", "bounds": [0.0, 1.0]}
        for name, key in (("e", "restitution"), ("c", "damping"))
    ]
    times = np.linspace(0.2, 1.2, 4)
    truth["measure"] = [{"name": f"q{k}", "of": "hinge.q", "at": float(t), "value": 0.0}
                        for k, t in enumerate(times)]  # fmt: skip
    truth.pop("objective")
    told = impactfem.gradient(Scene.from_dict(truth)).measures
    for each in truth["measure"]:
        each |= {"value": told[each["name"]]["values"][0], "sigma": 1e-3}
    truth["joint"][0] |= {"restitution": 0.45, "damping": 0.2}
    found = impactfem.identify(Scene.from_dict(truth))
    assert found.parameters["e"].value == pytest.approx(0.6, abs=1e-6)
    assert found.parameters["c"].value == pytest.approx(0.1, abs=1e-6)


def test_nothing_that_may_be_touched():
    """A bob on a free hinge, turned by a moment p: q = p t^2 / (2 (I + m r^2))."""
    free = swung()
    free["joint"][0] |= {"motor": "p"}
    del free["joint"][0]["limits"], free["joint"][0]["restitution"]
    free["parameter"] = [{"name": "p", "start": 0.1}]
    found = impactfem.gradient(Scene.from_dict(free))
    assert found.trusted
    assert found.gradient["p"] == pytest.approx(0.5 / ABOUT, rel=1e-9)


class TestRefused:
    def test_steps_have_no_slopes(self):
        with pytest.raises(SceneError, match="no derivatives that are right: use no method"):
            impactfem.gradient(Scene.from_dict(swung(solve={"method": "moreau_jean"})))

    def test_contacts_without_a_right_gradient(self):
        tables = swung()
        tables["body"] += [
            {"kind": "rigid", "name": name, "mass": 1.0,
             "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [x, 2.0]}}
            for name, x in (("one", 1.0), ("two", 2.0))
        ]  # fmt: skip
        with pytest.raises(SceneError, match=r"contact .*: has no right gradient"):
            impactfem.gradient(Scene.from_dict(tables))


def test_neighbours_by_controls_fly_at_once_as_they_do_alone(monkeypatch):
    """Forces and mass are one function of all, restitution and limits count at impacts alone."""
    course = {"name": "push", "pieces": 2, "start": [1.5, 1.0]}
    kept = swung()["parameter"][1:3]
    line = {"name": "more", "kind": "linear", "pieces": 1, "start": [0.0, 0.4]}
    scene = Scene.from_dict(swung("push + more", parameter=kept, control=[course, line]))
    together = Varied.of(scene)
    found = together.jacobian(together.start).jacobian
    assert np.abs(found[0]).min() > 1e-3  # all of them count
    monkeypatch.setattr(_TreeSystem, "kin", None)
    alone = Varied.of(scene)
    np.testing.assert_allclose(found, alone.jacobian(alone.start).jacobian, rtol=1e-8, atol=1e-9)
