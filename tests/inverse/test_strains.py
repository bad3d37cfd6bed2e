"""Initial strains of a bar, read from the force with which its end rests on a wall."""

import numpy as np

import impactfem
from impactfem import Scene

COUNT = 40


def pressed(shape, folder=None, **asked):
    """A bar that is pushed against the wall that it touches, strained in pieces."""
    return Scene.from_dict({
        "title": "strains", "duration": 1.0,
        "body": [{"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
                  "displacement": "shape*x", "velocity": -0.5}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "shape", "along": "x", "kind": "linear",
                     "pieces": COUNT - 1, "from": 1 / COUNT, "until": 1.0, "start": shape}],
        "solve": {"method": "galerkin", "elements": COUNT},
        "output": {"report": False, "pictures": False, "fields": [], "every": 1}, **asked,
    }, folder)  # fmt: skip


X = np.linspace(0.0, 1.0, COUNT + 1)[1:]
STRAIN = 0.01 * np.sin(np.random.default_rng(1).permutation(COUNT).astype(float))
FORCE = 0.5 - STRAIN  # l = -v0 + S0


def test_the_force_tells_the_strain_of_each_element():
    shape = np.cumsum(STRAIN) / COUNT / X
    history = impactfem.solve(pressed(shape.tolist())).history
    np.testing.assert_allclose(history["contact_force"].values[1:], FORCE, atol=1e-12)


def test_strains_are_identified_by_the_force(tmp_path):
    table = np.column_stack([(np.arange(COUNT) + 0.5) / COUNT, FORCE])  # amid each step
    lines = [f"{t!r},{value!r}" for t, value in table.tolist()]
    (tmp_path / "force.csv").write_text("\n".join(["time,value", *lines]))
    measure = {"name": "f", "of": "contact_force", "data": "force.csv", "sigma": 1e-3}
    found = impactfem.identify(pressed(0.0, tmp_path, measure=[measure]))
    assert found.status == "converged"
    shape = np.array([each.value for each in found.parameters.values()])
    strain = COUNT * np.diff(shape * X, prepend=0.0)
    np.testing.assert_allclose(strain, STRAIN, atol=1e-12)
