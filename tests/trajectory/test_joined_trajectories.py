"""Trajectories of closed loops, and of joints with dry friction."""

import re

import numpy as np
import pytest

from impactfem import Scene, SceneError, solve
from impactfem.trajectory.running import run_again
from impactfem.trajectory.scenes import trajectory

pytest.importorskip("casadi")

FRICTION, G = 2.943, 9.81
SPAN = np.sqrt(6.0 / FRICTION)  # of 1 kg that friction brakes, 1 m from rest to rest
LEAST = 4.0 / 3.0 * FRICTION**2 * SPAN


def planned(tables):
    return trajectory(Scene.from_dict(tables))


def parallelogram(dim, **asked):
    """Two cranks of .5 m at 1 rad and a rod between them, moved by one crank."""

    def there(*numbers):
        return list(numbers[:dim])

    def body(name, x, y, mass, moment):
        shape = {"kind": "disc" if dim == 2 else "sphere", "radius": 0.02,
                 "center": there(x, y, 0.0)}  # fmt: skip
        inertia = moment if dim == 2 else np.diag([moment, 2.0 * moment, moment]).tolist()
        return {"kind": "rigid", "name": name, "mass": mass, "inertia": inertia, "shape": shape}

    def hinge(name, one, two, x, y):
        axis = {} if dim == 2 else {"axis": [0.0, 0.0, 1.0]}
        return {"name": name, "kind": "revolute", "between": [one, two],
                "point": there(x, y, 0.0)} | axis  # fmt: skip

    c, s, wide = 0.5 * np.cos(1.0), 0.5 * np.sin(1.0), 0.8
    return {
        "title": "parallelogram", "duration": 1.0,
        "body": [body("left", c / 2, s / 2, 1.0, 0.03), body("rod", c + wide / 2, s, 2.0, 0.1),
                 body("right", wide + c / 2, s / 2, 1.0, 0.03)],
        "joint": [hinge("crank", "ground", "left", 0.0, 0.0) | {"motor": "0"},
                  hinge("one", "left", "rod", c, s), hinge("pivot", "ground", "right", wide, 0.0),
                  hinge("last", "rod", "right", wide + c, s)],
        "control": [{"name": "twist", "acts": "joint.crank.motor"}],
        "trajectory": {"nodes": 10, "end": {"crank.q": 0.8}} | asked,
    }  # fmt: skip


class TestLoops:
    @pytest.mark.parametrize("dim", [2, 3])
    def test_parallelogram(self, dim):
        """12 I^2 q^2/T^3 with I of both cranks, and of the rod that they carry.

        In space three of the five rows of the joint that closes it say nothing new.
        """
        inertia = 2.0 * (0.03 + 0.25**2) + 2.0 * 0.5**2
        found = planned(parallelogram(dim)).found
        assert found.trusted
        assert found.cost == pytest.approx(12.0 * inertia**2 * 0.8**2, rel=1e-9)
        assert found.states["pivot.q"][-1] == pytest.approx(0.8, abs=1e-9)

    @pytest.mark.parametrize("size", [1.0, 1e-3])
    def test_slider_crank(self, size):
        """The slider is where the crank's angle says, by geometry, in m or in mm."""
        tables = slider_crank(size)
        answer = planned(tables)
        found, low, high = answer.found, *slider(0.9, size)
        assert found.trusted
        turned = 0.9 + found.states["main.q"]
        wanted = slider(turned, size)[1] - high
        assert found.states["guide.q"] == pytest.approx(wanted, abs=1e-5 * size)
        assert low < high

    def test_a_run_of_the_scene_is_the_same(self):
        """By steps, which hold the loop to rounding and know nothing of the search."""
        answer = planned(parallelogram(2, nodes=3))
        ran = run_again(answer, solve)
        assert ran.method == "moreau_jean"
        # Of second order: a halved step leaves a third of what it changes.
        assert ran.end_error == pytest.approx(ran.unsure / 3.0, rel=0.1)
        assert ran.end_error < 1e-3

    @pytest.mark.parametrize(
        ("change", "told"),
        [
            ({"start": {"crank.q": 0.1}}, "joint.last closes a loop, which such a start opens"),
            ({"start": {"crank.v": [0.0, 1.0]}}, "joint.last closes a loop, which such a start"),
            ({"transcription": "hybrid", "modes": ["flight"]},
             "joint.last closes a loop, which event_driven does not know"),
        ],
    )  # fmt: skip
    def test_refused(self, change, told):
        with pytest.raises(SceneError, match=re.escape(told)):
            planned(parallelogram(2, **change))

    def test_nothing_that_moves(self):
        tables = parallelogram(2)
        tables["joint"][-1]["kind"] = "fixed"
        with pytest.raises(SceneError, match="they hold all bodies"):
            planned(tables)

    def test_what_acts_where_it_closes(self):
        tables = parallelogram(2)
        tables["joint"][-1]["damping"] = 1.0
        with pytest.raises(SceneError, match=re.escape("joint.last.damping: it closes a loop")):
            planned(tables)


def slider(angle, size):
    """Of a crank of .2 and a rod of .5: its height at the pin, and where the slider is."""
    low = 0.2 * size * np.sin(angle)
    return low, 0.2 * size * np.cos(angle) + np.sqrt((0.5 * size) ** 2 - low**2)


def slider_crank(size):
    low, far = slider(0.9, size)
    near = 0.2 * size * np.cos(0.9)

    def body(name, x, y, mass, moment):
        shape = {"kind": "disc", "radius": 0.02 * size, "center": [x, y]}
        return {"kind": "rigid", "name": name, "mass": mass * size**3,
                "inertia": moment * size**5, "shape": shape}  # fmt: skip

    def joint(name, kind, one, two, x, y, **more):
        return {"name": name, "kind": kind, "between": [one, two], "point": [x, y]} | more

    return {
        "title": "slider and crank", "duration": 1.0, "gravity": [0.0, -G * size],
        "body": [body("crank", near / 2, low / 2, 1.0, 0.01),
                 body("rod", (near + far) / 2, low / 2, 0.6, 0.02),
                 body("piston", far, 0.0, 1.5, 0.01)],
        "joint": [joint("main", "revolute", "ground", "crank", 0.0, 0.0, motor="0"),
                  joint("pin", "revolute", "crank", "rod", near, low),
                  joint("guide", "prismatic", "ground", "piston", far, 0.0, axis=[1.0, 0.0],
                        damping=2.0 * size**3),
                  joint("bolt", "revolute", "rod", "piston", far, 0.0)],
        "control": [{"name": "twist", "acts": "joint.main.motor"}],
        "trajectory": {"nodes": 20, "end": {"guide.q": -0.15 * size}},
    }  # fmt: skip


def rail(friction=FRICTION, size=1.0, **asked):
    """A block of 1 kg on a rail that rubs."""
    shape = {"kind": "block", "size": [0.2 * size] * 2, "corner": [-0.1 * size] * 2}
    return {
        "title": "rail", "duration": SPAN,
        "body": [{"kind": "rigid", "name": "block", "mass": 1.0, "shape": shape}],
        "joint": [{"name": "rail", "kind": "prismatic", "between": ["ground", "block"],
                   "point": [0.0, 0.0], "axis": [1.0, 0.0], "friction": friction * size,
                   "motor": "0"}],
        "control": [{"name": "push", "acts": "joint.rail.motor"}],
        "trajectory": {"end": {"rail.q": size}} | asked,
    }  # fmt: skip


class TestFriction:
    """Pushed from rest to rest: u = 2 F (1 - s/T), J = 4/3 F^2 T."""

    @pytest.mark.parametrize(("size", "way"), [(1.0, 1), (1.0, -1), (1e-6, 1)])
    def test_where_the_rate_keeps_its_sign(self, size, way):
        bounds = sorted([0.0, way * 10.0 * size])
        answer = planned(rail(size=size, nodes=4, bounds={"rail.v": bounds},
                              end={"rail.q": way * size}))  # fmt: skip
        assert answer.found.trusted
        assert answer.found.cost == pytest.approx(LEAST * size**2, rel=1e-9)
        begins = answer.found.control([0.0]).item()
        assert begins == pytest.approx(2.0 * way * FRICTION * size, rel=1e-6)

    def test_by_complementarity(self):
        """As the same friction of a block on a floor; see test_contact_modes.py."""
        answer = planned(rail(transcription="contact_implicit", nodes=20))
        found = answer.found
        assert found.cost / LEAST == pytest.approx(1.00490, abs=1e-5)
        moves = found.states["rail.v"][1:] > 1e-3
        assert found.controls["rail.friction"][:-1][moves] == pytest.approx(FRICTION, rel=1e-5)
        # What follows is that of a run of the scene, whose joint rubs by a law of its own.
        ran = run_again(answer, solve)
        assert ran.method == "moreau_jean"
        assert ran.end_error < 1e-4

    def test_what_holds_still_by_friction(self):
        """A load of half the friction is held for nothing; more than it costs what is above."""
        for load, cost in ((0.5, 0.0), (1.5, 0.5**2 * FRICTION**2)):
            tables = rail(transcription="contact_implicit", nodes=10, duration=1.0,
                          end={"rail.q": 0.0})  # fmt: skip
            tables["body"][0]["force"] = [str(load * FRICTION), "0"]
            assert planned(tables).found.cost == pytest.approx(cost, rel=1e-4, abs=1e-4)

    @pytest.mark.parametrize("bounds", [{}, {"rail.v": [-1.0, 1.0]}])
    def test_rates_of_any_sign_are_refused(self, bounds):
        with pytest.raises(SceneError, match=r"joint\.rail\.friction = 2\.943: turns with the s"):
            planned(rail(bounds=bounds))
