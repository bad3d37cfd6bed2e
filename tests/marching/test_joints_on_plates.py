"""Joints on regions of plates: screws, springs, masses, other bodies."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart
from scipy.optimize import brentq

import impactfem
from impactfem.errors import SceneError

SIDES = ("left", "right", "bottom", "top")
BOARD = {"kind": "plate", "name": "board", "thickness": 0.0016, "mesh_size": 0.005,
         "outline": {"kind": "rectangle", "size": [0.1, 0.06]}, "density": 1900.0,
         "youngs_modulus": 2e10, "poisson_ratio": 0.2}  # fmt: skip
SQUARE = {"kind": "plate", "name": "board", "thickness": 0.001, "mesh_size": 0.005,
          "outline": {"kind": "rectangle", "size": [0.1, 0.1]}, "density": 7800.0,
          "youngs_modulus": 2e11, "poisson_ratio": 0.3,
          "supports": [{"edge": edge, "kind": "simply_supported"} for edge in SIDES]}  # fmt: skip
RIGID = 2e11 * 0.001**3 / 12.0 / 0.91
BOX = {"kind": "rigid", "name": "box", "mass": 0.05, "velocity": [0.0, 0.0, -0.2],
       "shape": {"kind": "block", "size": [0.02, 0.02, 0.01],
                 "corner": [-0.01, -0.01, -0.011]}}  # fmt: skip
WALL = {"kind": "half_space", "name": "wall", "normal": [0.0, 0.0, 1.0],
        "point": [0.0, 0.0, -0.0115]}  # fmt: skip


def scene(bodies, joints, duration, dt, **more):
    table = {"title": "screws", "duration": duration, "gravity": [0.0] * 3, "body": bodies,
             "joint": joints, "solve": {"dt": dt, "estimate": False},
             "output": {"fields": []}}  # fmt: skip
    return impactfem.Scene.from_dict(table | more)


def run(*given, **more):
    return impactfem.solve(scene(*given, **more)).history


def screw(name, place, radius=0.008, **more):
    return {"name": name, "kind": "fixed", "between": ["ground", "board"], "point": place,
            "radius": radius} | more  # fmt: skip


def test_a_free_board_on_two_screws_hangs_by_its_weight():
    """Forces along the normal share the weight in the mean, nothing acts along the board."""
    joints = [screw("one", [-0.04, 0.0, 0.0]), screw("two", [0.04, 0.0, 0.0])]
    h = run([BOARD], joints, 0.04, 4e-5, gravity=[0.0, 0.0, -9.81])
    weight = 9.81 * 1900.0 * 0.1 * 0.06 * 0.0016
    middle = slice(1, None)
    both = h["one.force"].values[middle].mean() + h["two.force"].values[middle].mean()
    assert both == pytest.approx(weight, rel=0.01)
    energy = h["total_energy"].values
    assert np.ptp(energy) < 1e-10 * h["kinetic_energy"].values.max()


def test_a_spring_bends_a_square_by_its_compliance_at_the_middle():
    """F = k d / (1 + k c), c = .0116 a^2 / D of a force at the middle, from the start at rest."""
    k, c = 2e4, 0.01160 * 0.1**2 / RIGID
    joint = {"name": "pull", "kind": "distance", "between": ["ground", "board"], "stiffness": k,
             "points": [[0.0, 0.0, 0.1], [0.0, 0.0, 0.0]], "rest": 0.099,
             "radius": 0.008}  # fmt: skip
    h = run([SQUARE], [joint], 1e-3, 1e-4, start="static")
    force = k * 1e-3 / (1.0 + k * c)
    assert h["pull.force"].values == pytest.approx(force, rel=0.02)
    assert h["kinetic_energy"].values.max() < 1e-18


def test_a_mass_on_the_middle_of_a_square_lowers_its_first_frequency():
    """Sum of phi^2 / (M (w_mn^2 - w^2)) = 1 / (m w^2), simply supported, turns of a point none."""
    mass, own = 0.05, 7800.0 * 0.1**2 * 0.001
    odd = np.arange(1, 60, 2)
    squares = (np.pi / 0.1) ** 4 * (odd[:, None] ** 2 + odd**2) ** 2 * RIGID / (7800.0 * 0.001)

    def off(w):
        return 4.0 / own * (1.0 / (squares - w**2)).sum() - 1.0 / (mass * w**2)

    first = brentq(off, 0.05 * np.sqrt(squares[0, 0]), 0.999 * np.sqrt(squares[0, 0]))
    point = {"kind": "point", "name": "mass", "mass": mass, "position": [0.0, 0.0, 0.0]}
    hold = {"name": "glue", "kind": "ball", "between": ["board", "mass"], "point": [0.0, 0.0, 0.0],
            "radius": 0.004}  # fmt: skip
    duration = 2.0 * np.pi / first
    h = run(
        [SQUARE | {"mesh_size": 0.0025}, point],
        [hold],
        6.0 * duration,
        duration / 60,
        gravity=[0.0, 0.0, -9.81],
    )
    z, t = h["mass.z"].values - h["mass.z"].values.mean(), h["time"].values
    at = np.flatnonzero((z[1:] < 0.0) & (z[:-1] >= 0.0))
    down = t[at] - z[at] * (t[at + 1] - t[at]) / (z[at + 1] - z[at])
    assert np.diff(down).mean() == pytest.approx(duration, rel=0.01)


@pytest.mark.parametrize("turn", [0.0, 0.7], ids=["level", "askew"])
def test_a_box_under_a_board_strikes_and_gains_nothing(turn):
    """Momentum stays in flight; an impact with e = .5 takes energy; the same at an odd angle."""
    c, s = np.cos(turn), np.sin(turn)

    def turned(v):
        return [v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]]

    way = {"axis": [1.0, 0.0, 0.0], "angle": turn}
    middle = turned([0.0, 0.0, -0.006])
    shape = {"kind": "block", "size": [0.02, 0.02, 0.01],
             "corner": (np.array(middle) - [0.01, 0.01, 0.005]).tolist()}  # fmt: skip
    box = BOX | {"velocity": turned([0.0, 0.0, -0.2]), "orientation": way, "shape": shape}
    board = BOARD | {"velocity": -0.2, "normal": turned([0.0, 0.0, 1.0])}
    wall = WALL | {"normal": board["normal"], "point": turned(WALL["point"])}
    hold = screw("hold", [0.0, 0.0, 0.0], between=["box", "board"])
    h = run([board, box], [hold], 0.01, 2e-5, obstacle=[wall],
            contact=[{"between": ["box", "wall"], "restitution": 0.5}])  # fmt: skip
    energy = h["total_energy"].values
    struck = int(np.argmax(h["contact_impulse"].values > 0.0))
    momentum = h["momentum"].values if h["momentum"].values.ndim > 1 else h["momentum.z"].values
    assert np.ptp(momentum[: struck - 1], axis=0).max() < 1e-10
    assert np.diff(energy).max() < 1e-9 * energy[0]
    assert 0.2 * energy[0] < energy[-1] < 0.6 * energy[0]


def held():
    """A board on a box that falls, beside a screw to a ground that shakes."""
    joints = [screw("hold", [0.0, 0.0, 0.0], between=["box", "board"]),
              screw("shaken", [0.04, 0.0, 0.0],
                    motion=["0", "0", "1e-4*(1-cos(2000*t))"])]  # fmt: skip
    return scene([BOARD, BOX | {"velocity": [0.0] * 3}], joints, 0.01, 5e-5,
                 gravity=[0.0, 0.0, -9.81], obstacle=[WALL],
                 contact=[{"between": ["box", "wall"], "restitution": 0.5}],
                 output={"fields": [], "checkpoint": 50})  # fmt: skip


def test_restarts_go_on_to_the_bit(tmp_path, monkeypatch):
    check_restart(held(), 120, tmp_path, monkeypatch)


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(monkeypatch):
    check_ranks(held, monkeypatch, least=0.0)


@pytest.mark.parametrize(
    ("joints", "told"),
    [
        ([screw("s", [0.0, 0.0, 0.0], 1e-3)], "too few to tell how they turn"),
        ([screw("s", [0.0] * 3), screw("t", [0.009, 0.0, 0.0])], "nodes of board too"),
        ([screw("s", [0.0] * 3, motion=["t**2", "0", "0"])], "where it does not move"),
    ],
)
def test_what_cannot_be_held_is_refused(joints, told):
    with pytest.raises(SceneError) as error:
        impactfem.solve(scene([BOARD], joints, 1e-3, 1e-4))
    assert told in str(error.value)
