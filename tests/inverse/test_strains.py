"""Initial strains of a bar, read from the force with which its end rests on a wall."""

import numpy as np

import impactfem
from impactfem import Scene

COUNT = 40


def pressed(shape, **asked):
    """A bar that is pushed against the wall that it touches, strained in pieces."""
    return Scene.from_dict({
        "title": "strains", "duration": 1.0,
        "body": [{"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
                  "displacement": "shape*x", "velocity": -0.5}],
        "obstacle": [{"kind": "wall"}],
        "control": [{"name": "shape", "along": "x", "kind": "linear", "pieces": COUNT,
                     "until": 1.0, "start": shape}],
        "solve": {"method": "galerkin", "elements": COUNT},
        "output": {"report": False, "pictures": False, "fields": [], "every": 1}, **asked,
    })  # fmt: skip


def test_the_force_tells_the_strain_of_each_element():
    x = np.linspace(0.0, 1.0, COUNT + 1)
    strain = 0.05 * np.sin(np.random.default_rng(1).permutation(COUNT).astype(float))
    u = np.concatenate([[0.0], np.cumsum(strain) / COUNT])
    shape = np.concatenate([[0.0], u[1:] / x[1:]])
    history = impactfem.solve(pressed(shape.tolist())).history
    force = history["contact_force"].values[1:]
    np.testing.assert_allclose(force, 0.5 - strain, atol=1e-12)  # l = -v0 + S0
