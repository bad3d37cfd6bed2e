"""Trajectories through contact: by complementarity, and in a known order of contacts."""

# ruff: noqa: ARG001, ARG005 - functions take time, states and controls

import json
import re

import numpy as np
import pytest

import impactfem
from impactfem import Scene, SceneError
from impactfem.cli import main

pytest.importorskip("casadi")

from impactfem.trajectory.scenes import trajectory

MU, G = 0.3, 9.81
SPAN = np.sqrt(6.0 / (MU * G))  # of a block that friction brakes, 1 m from rest to rest
LEAST = 4.0 / 3.0 * (MU * G) ** 2 * SPAN


def ball(*, restitution=0.0, friction=0.0, force=("0", "0"), acts="x", velocity=(0.0, 0.0),
         height=0.0, lasts=SPAN, **asked):  # fmt: skip
    """A point above a floor, pushed along one or two axes."""
    law = {"between": ["ball", "floor"], "restitution": restitution}
    return {
        "title": "ball", "duration": lasts, "gravity": [0.0, -G],
        "body": [{"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, height],
                  "velocity": list(velocity), "force": list(force)}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "contact": [law | ({"friction_coefficient": friction} if friction else {})],
        "control": [{"name": f"push_{axis}", "acts": f"body.ball.force.{axis}"} for axis in acts],
        "trajectory": {"end": {"ball.x": 1.0}} | asked,
    }  # fmt: skip


def planned(tables):
    return trajectory(Scene.from_dict(tables))


class TestComplementarity:
    def test_pushed_block(self):
        """u = 2 mu g (1 - s/Ts), J = 4/3 (mu g)^2 Ts; implicit Euler costs a little more."""

        def pairs(t, x, u):
            return [x[1] + u[2], MU * G - u[1], u[2], MU * G + u[1]]

        found = impactfem.transcribe(
            lambda t, x, u: [x[1], u[0] - u[1]], states=["x", "v"], controls=["u", "f", "w"],
            duration=SPAN, start={"x": 0.0, "v": 0.0}, end={"x": 1.0, "v": 0.0},
            running=lambda t, x, u: u[0] ** 2, pairs=pairs, transcription="contact_implicit",
            nodes=20,
        )  # fmt: skip
        assert found.trusted
        assert found.cost / LEAST == pytest.approx(1.00490, abs=1e-5)  # N = 10: 1.022, 80: 1.0010
        assert found.summary["eps"] == 1e-7
        v, f = found.states["v"][1:], found.controls["f"][:-1]
        moves = v > 1e-3
        assert f[moves] == pytest.approx(MU * G, rel=1e-5)
        # The scene, whose normal forces are found too, costs the same.
        block = ball(friction=MU, transcription="contact_implicit", nodes=20)
        scene = planned(block).found
        assert scene.cost == pytest.approx(found.cost, rel=1e-5)
        assert scene.controls["ball.floor.force"][:-1] == pytest.approx(G, rel=1e-5)
        assert scene.follower == "event_driven"
        assert scene.resimulated_end_error < 1e-4

    def test_mesh_is_refined_next_to_the_answer(self):
        found = planned(ball(friction=MU, transcription="contact_implicit", nodes=8, refine=0.03,
                             end={"ball.x": 1.0})).found  # fmt: skip
        assert found.doubts == ()
        assert found.rounds[0] == 8 < found.nodes
        assert found.defect_max <= 0.03

    def test_what_lands_stays(self):
        """A ball that falls onto the floor without rebound, moved along it: J = 12 d^2/T^3."""
        found = planned(ball(height=0.2, lasts=1.0, transcription="contact_implicit", nodes=20,
                             end={"ball.x": 1.0, "ball.y": "free"})).found  # fmt: skip
        assert found.states["ball.y"][-1] == pytest.approx(0.0, abs=1e-6)
        assert found.cost == pytest.approx(12.0, rel=0.02)
        assert found.resimulated_end_error < 0.03


class TestPhases:
    def test_bounce_to_a_place(self):
        """Falls 1 m, rises to e^2: T = sqrt(2/g) (1 + e), moved along meanwhile: J = 12/T^3."""
        found = planned(ball(
            restitution=0.8, height=1.0, transcription="hybrid", nodes=4, duration=[0.1, 2.0],
            modes=["flight", "ball.floor", "flight"], end={"ball.x": 1.0, "ball.vy": 0.0},
        )).found  # fmt: skip
        lasts = np.sqrt(2.0 / G) * 1.8
        assert found.trusted
        assert found.duration == pytest.approx(lasts, rel=1e-9)
        assert found.cost == pytest.approx(12.0 / lasts**3, rel=1e-9)
        assert found.summary["true_order"] == ["flight", "ball.floor", "flight"]
        assert found.resimulated_distance < 1e-8

    @pytest.mark.parametrize("back", [1.0, -1.0])
    @pytest.mark.parametrize("rests", [False, True])
    @pytest.mark.parametrize("wide", [0.0, 0.4])
    def test_block_slips(self, back, rests, wide):
        """Pushed from rest to rest: u = 2 mu g (1 - s/Ts), whatever its corners carry of it."""
        slips = "ball.floor_slip" if back > 0.0 else "ball.floor_slip_back"
        modes = ["stance", slips, "stance"] if rests else [slips]
        tables = ball(friction=MU, transcription="hybrid", modes=modes, nodes=2,
                      duration=[0.1, 2.0] if rests else SPAN, end={"ball.x": back})  # fmt: skip
        if wide:
            tables["body"] = [box(wide, 0.2)]
        found = planned(tables).found
        assert found.doubts == ()
        assert found.summary["true_order"] == [name.replace("stance", "ball.floor")
                                               for name in modes]  # fmt: skip
        assert found.cost == pytest.approx(LEAST, rel=1e-7)
        inside = found.times if rests else found.times[:-1]
        begins = found.summary["lasts"][0] if rests else 0.0
        pushed = (inside > begins + 1e-3) & (inside < begins + SPAN - 1e-3)
        wanted = 2.0 * MU * G * (1.0 - (inside[pushed] - begins) / SPAN)
        assert found.control(inside[pushed])[:, 0] == pytest.approx(back * wanted, rel=1e-6)

    def test_box_tips(self):
        """Over a corner that sticks, as what follows does; its waiting costs nothing."""
        tables = ball(friction=0.8, transcription="hybrid", modes=["stance", "ball.floor#3"],
                      nodes=6, duration=[0.1, 1.5],
                      end={"ball.angle": -0.2, "ball.spin": "free"})  # fmt: skip
        tables["body"] = [box(0.2, 0.6)]
        found = planned(tables).found
        assert found.doubts == ()
        assert found.summary["true_order"] == ["ball.floor", "ball.floor#3"]
        assert found.resimulated_end_error < 1e-3

    def test_slip_the_other_way(self):
        """No push makes it slip backwards to a place in front of it; without time it is told."""
        tables = ball(friction=MU, transcription="hybrid", modes=["stance_slip_back"], nodes=2)
        assert planned(tables).found.status == "infeasible"

    def test_wheel_rolls(self):
        """By a moment, with the inertia of m + I/R^2: J = 12 (R (m + I/R^2))^2."""
        tables = ball(lasts=1.0, friction=0.8, transcription="hybrid", modes=["stance"], nodes=2)
        shape = {"kind": "disc", "radius": 0.2, "center": [0.0, 0.2]}
        tables["body"] = [{"kind": "rigid", "name": "ball", "mass": 2.0, "inertia": 0.04,
                           "shape": shape, "moment": ["0"]}]  # fmt: skip
        tables["control"][0]["acts"] = "body.ball.moment.0"
        found = planned(tables).found
        assert found.doubts == ()
        assert found.cost == pytest.approx(12.0 * (0.2 * 3.0) ** 2, rel=1e-9)
        assert found.resimulated_distance < 1e-8

    @pytest.mark.parametrize(
        ("modes", "restitution", "floor"),
        [(["stance"], 0.0, "0.1*t**2"),
         (["flight", "ball.floor", "flight"], 0.8, "0.05*sin(10*t)")],
    )  # fmt: skip
    def test_floor_that_moves(self, modes, restitution, floor):
        """It lifts what stands on it, and throws what bounces: what follows is the same."""
        tables = ball(transcription="hybrid", modes=modes, nodes=4, duration=[0.1, 1.0], lasts=1.0,
                      restitution=restitution, height=0.2 if restitution else 0.0,
                      end={"ball.x": 1.0, "ball.vy": 0.0 if restitution else "free"})  # fmt: skip
        tables["obstacle"][0]["motion"] = ["0", floor]
        found = planned(tables).found
        assert found.doubts == ()
        assert found.resimulated_distance < 1e-8

    def test_jump_from_a_stand(self):
        """A foot of .1 kg below a body of 1 kg leaves the floor once, and what follows agrees."""
        found = planned(hopper(["stance", "flight"], 200.0, nodes=8)).found
        assert found.doubts == ()
        assert found.summary["true_order"] == ["foot.floor", "flight"]
        assert found.kkt_residual < 1e-6

    @pytest.mark.parametrize("says", ["stays", "sticks", "slips"])
    def test_order_that_does_not_happen(self, tmp_path, capsys, says):
        """The command ends with 3 and says what happens instead.

        A foot jumps on a coarse mesh: the floor's force is 0 at nodes, and would pull between: it
        lets go. A force that shakes faster than nodes and halves of intervals see makes slip what
        was to stick, and brings to rest what was to slip.
        """
        shakes = {"friction": MU, "transcription": "hybrid", "nodes": 2, "lasts": 1.0}
        tables, order = {
            "stays": (hopper(["stance", "flight"], 1000.0, nodes=12),
                      ["foot.floor", "flight", "foot.floor", "flight"]),
            "sticks": (ball(**shakes, modes=["stance"], force=("3.2*sin(4*pi*t)", "0"),
                            end={"ball.x": 0.0}),
                       ["ball.floor", "ball.floor_slip", "ball.floor", "ball.floor_slip_back"]),
            "slips": (ball(**shakes, modes=["stance_slip"], velocity=(0.3, 0.0),
                           force=("-4*sin(4*pi*t)", "0"),
                           end={"ball.x": 0.2, "ball.vx": "free"}),
                      ["ball.floor_slip", "ball.floor", "ball.floor_slip", "ball.floor"]),
        }[says]  # fmt: skip
        scene = tmp_path / "scene.toml"
        scene.write_text(Scene.from_dict(tables).to_toml())
        assert main(["trajectory", str(scene), "--out", str(tmp_path / "out")]) == 3
        told = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert told["status"] == "converged"
        assert told["true_order"][:4] == order
        assert told["true_order"] != told["modes"]
        happens, asked = " > ".join(order), " > ".join(told["modes"])
        text = capsys.readouterr().err
        assert f"contacts close and open in another order than modes say: {happens}" in text
        assert f"instead of {asked}; give that order" in text
        assert len(text) < 700

    @pytest.mark.parametrize("speed", [0.2, 1.0])
    def test_friction_holds_what_lands_within_its_cone(self, speed):
        """Thrown down at 2 m/s: mu times that stops .6 m/s at once, and no more."""
        tables = ball(friction=MU, velocity=[speed, -2.0], height=0.1, transcription="hybrid",
                      modes=["flight", "stance"], nodes=2, lasts=0.5,
                      end={"ball.vx": 0.0, "ball.x": "free"})  # fmt: skip
        tables["control"][0]["bounds"] = [-0.01, 0.01]
        found = planned(tables).found
        if speed < MU * 2.0:
            assert found.doubts == ()
            assert found.states["ball.x"][-1] == pytest.approx(speed * found.summary["lasts"][0],
                                                               abs=1e-3)  # fmt: skip
        else:
            assert found.status == "infeasible"
            assert "farthest off is the impact of ball.floor sticks" in found.doubts[0]


def box(width, height):
    """A block on the floor, that a force may push at its centre."""
    shape = {"kind": "block", "size": [width, height], "corner": [-width / 2, 0.0]}
    return {"kind": "rigid", "name": "ball", "mass": 1.0, "shape": shape, "force": ["0", "0"]}


def hopper(modes, stiffness, **asked):
    """A body on a rail, with a foot on a sprung leg below."""
    disc = {"kind": "disc", "radius": 0.05}
    along = {"kind": "prismatic", "axis": [0.0, 1.0]}
    return {
        "title": "hopper", "duration": 1.5, "gravity": [0.0, -G],
        "body": [{"kind": "rigid", "name": "body", "mass": 1.0, "inertia": 0.01,
                  "shape": disc | {"center": [0.0, 1.0]}},
                 {"kind": "rigid", "name": "foot", "mass": 0.1, "inertia": 0.001,
                  "shape": disc | {"center": [0.0, 0.05]}}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
        "joint": [along | {"name": "rail", "between": ["ground", "body"], "point": [0.0, 1.0]},
                  along | {"name": "leg", "between": ["foot", "body"], "point": [0.0, 0.5],
                           "stiffness": stiffness, "damping": 5.0, "motor": "0"}],
        "contact": [{"between": ["foot", "floor"], "restitution": 0.0}],
        "control": [{"name": "push", "acts": "joint.leg.motor", "bounds": [-300.0, 300.0]}],
        "trajectory": {"transcription": "hybrid", "modes": modes, "duration": [0.2, 1.5],
                       "start": {"rail.q": -G / stiffness, "leg.q": -G / stiffness},
                       "end": {"rail.q": 0.3, "leg.q": "free", "leg.v": "free"}} | asked,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"transcription": "hybrid"}, "modes is missing: give the order of contacts"),
        ({"modes": ["flight"]}, "belongs to transcription"),
        ({"transcription": "hybrid", "modes": ["fly"]}, 'no contact "fly"; give "flight"'),
        ({"transcription": "hybrid", "modes": ["flight", "flight"]}, "does not follow"),
        ({"transcription": "hybrid", "modes": ["stance"], "height": 0.1},
         "the gap of ball on floor is 0.1 m at the start"),
        ({"transcription": "hybrid", "modes": ["flight", "stance"], "restitution": 0.5,
          "height": 0.1}, "one that rebounds is followed by"),
        ({"transcription": "hybrid", "modes": ["stance"], "velocity": [0.0, -1.0]},
         "a contact closes or opens with 1 m/s at the start"),
        ({"transcription": "hybrid", "modes": ["stance"], "velocity": [2.0, 0.0],
          "friction": 0.3}, "a contact slips with 2 m/s at the start"),
        ({"transcription": "hybrid", "modes": ["stance_slip"]}, "nothing rubs there"),
        ({"transcription": "hybrid", "modes": ["flight", "stance_slip"], "restitution": 0.5,
          "height": 0.1, "friction": 0.3}, "it rebounds (restitution > 0) at once"),
        ({"transcription": "contact_implicit", "restitution": 0.5},
         "knows impacts without rebound, and ball on floor has restitution = 0.5"),
    ],
)  # fmt: skip
def test_refused(asked, message):
    with pytest.raises(SceneError, match=re.escape(message)):
        planned(ball(**asked))


def test_what_cannot_be_is_named():
    """Down by gravity alone: it does not come up to 2 m after a bounce."""
    found = planned(ball(restitution=0.8, height=1.0, transcription="hybrid", nodes=2,
                         duration=[0.1, 2.0], modes=["flight", "ball.floor", "flight"],
                         end={"ball.x": 1.0, "ball.y": 2.0, "ball.vy": "free"})).found  # fmt: skip
    assert found.status == "infeasible"
    assert "no motion was found with contacts in the order" in found.doubts[0]
    assert "farthest off is" in found.doubts[0]
