"""Plates whose edges move: an accelerated base is a gravity the other way."""

import numpy as np
import pytest
from moving_scenes import check_restart

import impactfem
from impactfem.errors import SceneError

PLATE = {"kind": "plate", "name": "plate", "thickness": 0.01, "density": 1000.0,
         "youngs_modulus": 1e8, "poisson_ratio": 0.3, "mesh_size": 0.25,
         "outline": {"kind": "rectangle", "size": [1.0, 0.8]}}  # fmt: skip
EDGES = ("left", "right", "bottom", "top")


def scene(motion=None, gravity=0.0, duration=0.04, kind="clamped", edges=EDGES, **more):
    moved = {} if motion is None else {"motion": motion}
    body = PLATE | {"supports": [{"edge": e, "kind": kind, **moved} for e in edges]}
    probe = {"name": "p", "body": "plate", "point": [0.0, 0.0, 0.0]}
    tables = {name: more.pop(name) for name in list(more) if name in {"obstacle", "start"}}
    table = {"title": "moved", "duration": duration, "gravity": [0.0, 0.0, gravity],
             "body": [body | more], "probe": [probe], "output": {"fields": []},
             "solve": {"dt": 5e-4, "estimate": False}}  # fmt: skip
    return impactfem.Scene.from_dict(table | tables)


@pytest.mark.parametrize(
    "more",
    [{"theory": "kirchhoff"}, {"theory": "reissner_mindlin", "damping": {"stiffness": 1e-3}},
     {"membrane": "von_karman", "theory": "kirchhoff"},
     {"theory": "kirchhoff", "edges": ("left",)}],
)  # fmt: skip
def test_an_accelerated_base_is_a_gravity(more):
    """Of 30 m/s^2, to rounding; without damping the work of the edges is all that energies gain."""
    moved = impactfem.solve(scene("15*t**2", **more)).history
    held = impactfem.solve(scene(gravity=-30.0, **more)).history
    base = 15.0 * moved["time"].values ** 2
    size = np.abs(held["p.uz"].values).max()
    assert size > 1e-3
    assert moved["p.uz"].values - base == pytest.approx(held["p.uz"].values, abs=1e-7 * size)
    energy = moved["kinetic_energy"].values.max()
    lost = moved["dissipated_energy"].values
    if "damping" in more:
        also = held["dissipated_energy"].values
        assert lost == pytest.approx(also, abs=1e-8 * energy)
        assert lost[-1] > 1e-3 * energy
    else:
        assert np.abs(lost).max() < 1e-9 * energy


@pytest.mark.parametrize("membrane", ["none", "von_karman"])
def test_weight_is_a_pressure(membrane):
    """Of rho t g: the inertia of slopes weighed, too, as moments of t^2 / 12 L^2 of the load."""
    more = {"theory": "reissner_mindlin", "thickness": 0.05, "membrane": membrane}
    body = scene(**more).bodies[0]
    load = {"face": "top", "value": body.density * 0.05 * 30.0}
    weighed, pressed = (
        impactfem.solve(each).history
        for each in (scene(gravity=-30.0, **more), scene(pressures=[load], **more))
    )
    for name in ("p.uz", "elastic_energy", "total_energy"):
        size = np.abs(pressed["p.uz" if name == "p.uz" else "elastic_energy"].values).max()
        assert size > 0.0
        assert weighed[name].values == pytest.approx(pressed[name].values, abs=1e-9 * size)


def test_edges_that_move_begin_at_rest_or_in_equilibrium(tmp_path, monkeypatch):
    """A motion of three formulas; restarts to the bit; a start at rest follows the edges."""
    moved = ["0", "0", "0.01*cos(20*t)"]
    given = scene(moved, start="static", theory="kirchhoff")
    found = impactfem.solve(given).history
    assert found["p.uz"].values[0] == pytest.approx(0.01, rel=1e-9)
    with pytest.raises(SceneError, match=r"supports\[0\].motion.*jumps from 0 to 0.01"):
        scene(moved)
    short = scene("0.01*sin(20*t)**2", theory="kirchhoff", duration=0.01)
    check_restart(short.with_settings({"output.checkpoint": 4}), 9, tmp_path, monkeypatch)


def test_a_plate_that_shakes_strikes_a_stop():
    """Its middle stays above what is there, and energy grows by the work of its edges alone."""
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0, -0.008],
             "normal": [0.0, 0.0, 1.0]}  # fmt: skip
    given = scene("-0.01*sin(40*t)**2", theory="kirchhoff", obstacle=[floor])
    found = impactfem.solve(given).history
    assert found["contact_force"].values.max() > 0.0
    assert found["p.uz"].values.min() > -0.0031
    lost = found["dissipated_energy"].values
    assert np.abs(lost).max() < 1e-4 * found["kinetic_energy"].values.max()


def test_motions_that_no_edge_has_are_refused():
    """In the plane, of edges that nothing holds, and of corners that two edges share."""
    with pytest.raises(SceneError, match="plates move along their normal alone"):
        scene(["t", "0", "0"])
    with pytest.raises(SceneError, match=r"motion moves an edge that is free"):
        scene("t", kind="free")
    given = scene("t**2").to_dict()
    given["body"][0]["supports"][0].pop("motion")
    with pytest.raises(SceneError, match="shares a corner with one that does not move alike"):
        impactfem.solve(impactfem.Scene.from_dict(given))
