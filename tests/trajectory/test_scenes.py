"""[trajectory] of scenes: bodies in symbols, files, exit codes, what is refused."""

import csv
import json

import numpy as np
import pytest

from impactfem import Scene, SceneError
from impactfem.cli import main

pytest.importorskip("casadi")

from impactfem.trajectory.bodies import symbolic
from impactfem.trajectory.scenes import trajectory
from impactfem.trajectory.symbols import loaded

LIMIT = 58.8076675  # of the cart and pole, see test_transcribe.py


def block(**asked):
    """A block that is moved from rest to rest."""
    push = {"name": "push", "acts": "body.block.force.x", "pieces": 10}
    wanted = {"transcription": "trapezoid", "nodes": 10, "end": {"block.x": 1.0}} | asked
    return {
        "title": "block", "duration": 1.0, "control": [push], "trajectory": wanted,
        "body": [{"kind": "point", "name": "block", "mass": 1.0, "position": [0.0],
                  "force": ["0"]}],
    }  # fmt: skip


def cart(pole=1e-12, **asked):
    """A pole that hangs on a cart, as rigid bodies and joints."""
    wanted = {
        "nodes": 50, "end": {"cart.x": 1.0, "pole.angle": np.pi},
        "bounds": {"cart.x": [-2.0, 2.0]}, "path": ["pole.angle - 4"],
        "cost": [{"term": "effort", "of": "push"}],
    } | asked  # fmt: skip
    return {
        "title": "cart and pole", "duration": 2.0, "gravity": [0.0, -9.81],
        "body": [
            {"kind": "rigid", "name": "cart", "mass": 1.0, "force": ["0", "0"],
             "shape": {"kind": "block", "size": [0.4, 0.2], "corner": [-0.2, -0.1]}},
            {"kind": "rigid", "name": "pole", "mass": 0.3, "inertia": pole,
             "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, -0.5]}},
        ],
        "joint": [
            {"name": "slide", "kind": "prismatic", "between": ["ground", "cart"],
             "point": [0.0, 0.0], "axis": [1.0, 0.0]},
            {"name": "hinge", "kind": "revolute", "between": ["cart", "pole"],
             "point": [0.0, 0.0]},
        ],
        "control": [{"name": "push", "acts": "body.cart.force.x", "bounds": [-20.0, 20.0],
                     "pieces": 40}],
        "trajectory": wanted,
    }  # fmt: skip


def found(tables):
    return trajectory(Scene.from_dict(tables)).found


class TestAnswers:
    def test_block_by_trapezoids(self):
        planned = trajectory(Scene.from_dict(block()))
        assert planned.found.cost == pytest.approx(12.461059, abs=1e-6)
        assert planned.rests == ("block.vx",)

    def test_cart_and_pole_as_rigid_bodies(self):
        """Fourth order to the limit of the equations written by hand."""
        assert found(cart()).cost == pytest.approx(LIMIT - 2.5e-5, abs=3e-6)

    def test_end_that_is_left_free_costs_less(self):
        free = block(end={"block.x": 1.0, "block.vx": "free"}, transcription="hermite_simpson")
        assert found(free).cost == pytest.approx(3.0, rel=1e-9)  # u = 3 (1 - t)

    def test_least_time(self):
        tables = block(duration=[0.1, 10.0], cost=[{"term": "time"}], transcription="euler")
        tables["control"][0]["bounds"] = [-1.0, 1.0]
        answer = found(tables | {"duration": 5.0})
        assert answer.duration == pytest.approx(2.0, rel=1e-7)

    def test_motor_that_swings_a_pendulum_from_a_named_start(self):
        """q'' = u: a bob in weightlessness, 12 (m l^2 angle)^2/T^3."""
        tables = cart(transcription="hermite_simpson", nodes=4, start={"hinge.q": 0.5},
                      end={"hinge.q": 1.5}, bounds={}, path=[], cost=[])  # fmt: skip
        tables["body"], tables["gravity"] = tables["body"][1:], [0.0, 0.0]
        tables["joint"] = [tables["joint"][1] | {"between": ["pole", "ground"]}]
        tables["control"] = [{"name": "twist", "acts": "joint.hinge.motor"}]
        assert found(tables).cost == pytest.approx(12.0 * (0.3 * 0.5**2) ** 2 / 8.0, rel=1e-9)

    def test_place_that_follows_from_an_angle(self):
        """The bob shall be at x = 0.3: its angle from the vertical is asin 0.6."""
        tables = cart(end={"pole.x": 0.3, "hinge.v": 0.0, "pole.vx": "free"}, bounds={}, cost=[],
                      path=["-hinge.q", "hinge.q - 1"], nodes=20)  # fmt: skip
        tables["body"], tables["gravity"] = tables["body"][1:], [0.0, 0.0]
        tables["joint"] = [tables["joint"][1] | {"between": ["ground", "pole"]}]
        tables["control"] = [{"name": "twist", "acts": "joint.hinge.motor"}]
        answer = found(tables)
        assert answer.trusted
        assert answer.states["hinge.q"][-1] == pytest.approx(np.arcsin(0.6), rel=1e-8)

    def test_contact_stays_open(self):
        """A wall that stands where the block would go through: least effort touches and leaves."""
        tables = block(start={"block.x": 0.0, "block.vx": 1.0}, nodes=20, end={"block.x": 0.0},
                       transcription="hermite_simpson")  # fmt: skip
        wall = {"kind": "half_space", "name": "wall", "point": [0.1], "normal": [-1.0]}
        tables["obstacle"] = [wall]
        answer = found(tables)
        assert answer.states["block.x"].max() <= 0.1 + 1e-8


def test_equations_are_those_of_a_double_pendulum():
    """Angles from the vertical a, b: cos(a - b) b'' + 2 a'' + ..., m = l = 1."""
    tables = cart(pole=1e-12)
    place = [[np.sin(2.0), -np.cos(2.0)], [np.sin(2.0) + np.sin(1.0), -np.cos(2.0) - np.cos(1.0)]]
    tables["body"] = [
        {"kind": "rigid", "name": name, "mass": 1.0, "inertia": 1e-13,
         "shape": {"kind": "disc", "radius": 0.1, "center": at}}
        for name, at in zip(("a", "b"), place, strict=True)
    ]  # fmt: skip
    tables["joint"] = [
        {"name": "one", "kind": "revolute", "between": ["ground", "a"], "point": [0.0, 0.0],
         "motor": "0"},
        {"name": "two", "kind": "revolute", "between": ["b", "a"], "point": place[0]},
    ]  # fmt: skip
    tables["control"] = [{"name": "twist", "acts": "joint.one.motor"}]
    tables["trajectory"] = {"end": {"one.q": 1.0}}
    known = symbolic(Scene.from_dict(tables))
    tree = known.tree
    rate = loaded().Function("rate", [tree.t, tree.q, tree.v, known.controls], [known.rate])
    spins = np.array([0.7, -0.4])  # of the angles; two.q counts from b to a
    given = [0.0, [0.0, 0.0], [spins[0], spins[0] - spins[1]], [0.3]]
    first, second = np.asarray(rate(*given), dtype=float).ravel()
    c, s = np.cos(1.0), np.sin(1.0)
    right = [0.3 - s * spins[1] ** 2 - 2 * 9.81 * np.sin(2.0), s * spins[0] ** 2 - 9.81 * s]
    wanted = np.linalg.solve([[2.0, c], [c, 1.0]], right)
    assert [first, first - second] == pytest.approx(wanted.tolist(), rel=1e-9)


class TestCommand:
    def test_files_and_codes(self, tmp_path, capsys):
        scene = tmp_path / "block.toml"
        scene.write_text(Scene.from_dict(block(refine=1e-3)).to_toml())
        assert main(["trajectory", str(scene), "--out", str(tmp_path / "out")]) == 0
        told = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert {"status", "cost", "kkt_residual", "defect_max", "resimulated_distance",
                "resimulated_end_error", "seconds", "nodes"} <= set(told)  # fmt: skip
        assert told["status"] == "converged"
        assert told["nodes"] > 10
        for name in ("trajectory.csv", "resimulated/history.csv"):
            with (tmp_path / "out" / name).open() as file:
                rows = list(csv.DictReader(file))
            assert float(rows[-1]["time"]) == 1.0
            assert float(rows[-1]["block.x"]) == pytest.approx(1.0, abs=2e-2)
        # A run of the scene, by a scheme that knows nothing of the search, ends as what follows.
        assert told["resimulated_by"] == "moreau_jean"
        apart = told["resimulated_end_error"] - told["followed_end_error"]
        assert abs(apart) < 10 * told["resimulated_unsure"] < 1e-3
        settings = ["--set", "trajectory.nodes=3"]
        assert main(["trajectory", str(scene), *settings, "--out", str(tmp_path / "few")]) == 0
        assert "intervals 3, then" in capsys.readouterr().out

    def test_a_wall_between_nodes_is_met(self, tmp_path, capsys):
        """The search keeps off it at nodes; the run meets it between them, and says so."""
        tables = block(start={"block.vx": 1.0}, nodes=20, end={"block.x": 0.0},
                       transcription="hermite_simpson")  # fmt: skip
        tables["body"][0]["velocity"] = [1.0]
        wall = {"kind": "half_space", "name": "wall", "point": [0.1], "normal": [-1.0]}
        scene = tmp_path / "block.toml"
        scene.write_text(Scene.from_dict(tables | {"obstacle": [wall]}).to_toml())
        assert main(["trajectory", str(scene), "--out", str(tmp_path / "out")]) == 3
        assert "it meets block.wall at t = 0.25 s" in capsys.readouterr().err
        told = json.loads((tmp_path / "out" / "summary.json").read_text())
        assert told["resimulated_by"] == "event_driven"
        assert told["followed_end_error"] < 1e-9
        assert told["resimulated_end_error"] > 1e-2

    def test_a_time_too_short_ends_with_3(self, tmp_path, capsys):
        tables = block(duration=1.5, cost=[{"term": "time"}], transcription="hermite_simpson")
        tables["control"][0]["bounds"] = [-1.0, 1.0]
        scene = tmp_path / "block.toml"
        scene.write_text(Scene.from_dict(tables).to_toml())
        assert main(["trajectory", str(scene), "--out", str(tmp_path / "out")]) == 3
        assert "the shortest duration that was found is 2 s" in capsys.readouterr().err


class TestRefused:
    @pytest.mark.parametrize(
        ("asked", "told"),
        [
            ({"end": {"block.z": 1.0}}, "trajectory.end.block.z: there is no such column"),
            ({"end": {}}, "end is missing"),
            ({"bounds": {"block.x": [0.2, 2.0]}}, "start.block.x: .* lies outside"),
            ({"bounds": {"block.x": [2.0, 0.2]}}, "its first number is larger"),
            ({"path": ["block.w - 1"]}, "there is no such column"),
            ({"cost": [{"term": "effort", "of": "pull"}]}, "there is no such control"),
            ({"cost": [{"term": "effort"}]}, "of is missing"),
            ({"transcription": "rk4"}, "hermite_simpson"),
        ],
    )
    def test_keys(self, asked, told):
        with pytest.raises(SceneError, match=told):
            found(block(**asked))
