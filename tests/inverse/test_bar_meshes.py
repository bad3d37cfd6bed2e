"""Derivatives of bars on meshes that all runs keep: solve.mesh, and triangles of dg."""

import numpy as np
import pytest

from impactfem import Scene
from impactfem.errors import MeshError, SceneError
from impactfem.inverse.varied import Varied

UNIT = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0, "velocity": -0.5}
GAP = {"name": "H", "key": "body.bar.gap", "bounds": [0.1, 1.0]}
DG = {"method": "dg", "fitted": False}


def mesh(path, elements, layers, duration=4.0):
    """Writes right triangles with so many layers, as Gmsh divides a line."""
    path.write_text(
        f"Point(1) = {{0, 0, 0}}; Point(2) = {{{duration}, 0, 0}}; Point(3) = {{{duration}, 1, 0}};"
        "Point(4) = {0, 1, 0}; Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {4, 3};"
        f"Line(4) = {{1, 4}}; Transfinite Curve {{1, 3}} = {layers};"
        f"Transfinite Curve {{2, 4}} = {elements + 1}; Curve Loop(1) = {{1, 2, -3, -4}};"
        'Plane Surface(1) = {1}; Transfinite Surface {1}; Physical Surface("bar") = {1};'
        'Physical Curve("wall") = {1}; Physical Curve("end") = {2}; Physical Curve("far") = {3};'
        'Physical Curve("start") = {4};'
    )
    return str(path)


def varied(folder, gap, elements=10, solve=None, **tables):
    """The impulse of the founding bar, J = int (p - p*)^2 dt / (2 h) at the times of layers."""
    times = np.linspace(0.0, 4.0, 4 * elements + 1)
    lines = [f"{t!r},{min(max(0.5 * (t - 1.0), 0.0), 1.0)!r}" for t in times.tolist()]
    (folder / "impulse.csv").write_text("\n".join(["time,value", *lines]))
    return Varied.of(Scene.from_dict({
        "title": "founding", "duration": 4.0, "body": [UNIT | {"gap": gap}],
        "obstacle": [{"kind": "wall"}], "parameter": [GAP],
        "measure": [{"name": "p", "of": "impulse.bar.wall", "data": "impulse.csv"}],
        "solve": {"elements": elements} | DG if solve is None else solve,
        "output": {"report": False, "pictures": False, "fields": []}, **tables,
    }, folder))  # fmt: skip


def slopes(asked, elements):
    """The derivative of J below and above, and their mean."""
    told = asked.jacobian(asked.start)
    by = 2.0 / elements * asked.quantities.slope(told.numbers)
    return np.array([by @ each for each in (*(told.sides or ()), told.jacobian)])[:, 0]


def check_sets_are_kept(asked):
    """Against central differences of runs with the sets of the start."""
    runs, at, times = asked.runs, asked.start, asked.quantities.times
    scene = asked.at(at)
    marks = runs.marks(scene, runs.march(scene, None))
    found = asked.jacobian(at).jacobian

    def read(values):
        moved = asked.at(values)
        return asked.quantities.read(runs.outcome(moved, times, marks), moved)

    way = np.random.default_rng(0).standard_normal(len(at))
    far, near = ((read(at + h * way) - read(at - h * way)) / (2.0 * h) for h in (2e-5, 1e-5))
    right = (4.0 * near - far) / 3.0
    np.testing.assert_allclose(found @ way, right, atol=1e-8 * np.abs(right).max())


@pytest.mark.parametrize("method", ["galerkin", "monolithic"])
def test_a_mesh_of_equal_layers_is_that_of_elements(tmp_path, method):
    # Exactly .38; the impact is on a layer: .1 / elements less and more on the sides.
    solve = {"method": method, "mesh": mesh(tmp_path / "a.geo", 10, 41)}
    found = slopes(varied(tmp_path, 0.6, solve=solve), 10)
    assert found == pytest.approx([0.39, 0.37, 0.38], abs=1e-8)


def test_dg_comes_to_the_exact_derivative(tmp_path):
    # .37885, .37914, .37951, .37974 with 10, 20, 40, 80 elements on the triangles of Gmsh 4.15,
    # .37885, .37894, .37954, .37973 on those of 4.13: halving once tells of the mesh too.
    coarse, fine = (slopes(varied(tmp_path, 0.6, n), n)[-1] for n in (10, 40))
    assert abs(fine - 0.38) < min(6e-4, 0.5 * abs(coarse - 0.38))


def test_unequal_layers_keep_their_sets(tmp_path):
    path = mesh(tmp_path / "a.geo", 12, "78 Using Progression 1.01")
    asked = varied(tmp_path, 0.61, 12, {"method": "monolithic", "mesh": path},
                   parameter=[GAP, {"name": "E", "key": "body.bar.youngs_modulus"}])  # fmt: skip
    check_sets_are_kept(asked)
    found = slopes(asked, 12)[-1]
    assert found == pytest.approx(4 * 0.11 - 0.11**2 / 0.5, abs=0.9 / 12)
    with pytest.raises(MeshError, match="galerkin needs equal ones"):
        varied(tmp_path, 0.61, 12, {"method": "galerkin", "mesh": path})


@pytest.mark.parametrize("start", [0.0, 0.1])
def test_dg_keeps_its_sets_under_a_driven_end(tmp_path, start):
    asked = varied(tmp_path, 0.61, 5, gravity=0.1, control=[
        {"name": "push", "acts": "body.bar.far_end_force", "pieces": 3, "until": 3.0,
         "start": start}],
        parameter=[GAP, {"name": "E", "key": "body.bar.youngs_modulus"}])  # fmt: skip
    check_sets_are_kept(asked)


@pytest.mark.parametrize(("solve", "text"), [
    ({"method": "dg", "elements": 5, "fitted": True}, "solve.fitted: .*fitted = false.*exact"),
    (DG | {"accuracy": 1e-2}, r"solve.accuracy = 0.01: .*solve.elements.*exact"),
])  # fmt: skip
def test_meshes_that_follow_the_motion_are_refused(tmp_path, solve, text):
    with pytest.raises(SceneError, match=text):
        varied(tmp_path, 0.6, solve=solve)


def test_times_that_are_lines_of_the_mesh_are_no_parameters_of_dg(tmp_path):
    asked = varied(tmp_path, 0.6, 5, gravity=[[0.0, 0.1], [0.5, 0.0]],
                   parameter=[{"name": "off", "key": "gravity.1.0"}])  # fmt: skip
    with pytest.raises(SceneError, match=r'off: .*solve.method = "dg".*"exact"'):
        asked.jacobian(asked.start)
