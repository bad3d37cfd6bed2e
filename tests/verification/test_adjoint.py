"""The adjoint of the founding scheme, by its assembled system, is the gradient by sweeps."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

import impactfem
from impactfem import Scene
from impactfem.scene.loads import PiecewiseConstant

ELEMENTS, GAP, T = 20, 0.613, 4.0
LAYERS = int(T * ELEMENTS)


def adjoint():
    """dJ/dgap and dJ/dv0 of J = sum (p - p*)^2 / 2 at the levels, by one transposed solve."""
    from impactfem.fem import MPI
    from impactfem.mesh.spacetime import layered_mesh
    from impactfem.spacetime.galerkin import _equations
    from impactfem.spacetime.system import CoupledSystem, paired_load

    space = layered_mesh(MPI.COMM_SELF, ELEMENTS, LAYERS, 1.0)

    def equations(gap, speed):
        bar = impactfem.Bar(
            length=1.0, density=1.0, youngs_modulus=1.0, gap=gap, velocity=speed
        )  # fmt: skip
        return _equations(space, bar, PiecewiseConstant((0.0,), (0.0,)))

    here = equations(GAP, -0.5)
    system = CoupledSystem(here)
    active = np.zeros(LAYERS, dtype=bool)
    for _ in range(20):
        gap, multiplier = system.solve(active)
        update = multiplier + gap < np.where(active, 0.0, -1e-12)
        if (update == active).all():
            break
        active = update
    matrix = csr_matrix(system._matrix.getValuesCSR()[::-1], shape=system._matrix.getSize())
    dt, places = 1.0 / ELEMENTS, system._multiplier[here.numbering.multipliers]
    pressed = -dt * np.cumsum(multiplier)
    times = dt * np.arange(1, LAYERS + 1)
    wrong = pressed - np.clip(0.5 * (times - 1.0), 0.0, 1.0)
    slope = np.zeros(matrix.shape[0])  # dJ/dz: an impulse counts all multipliers before it
    slope[places] = -dt * np.cumsum(wrong[::-1])[::-1]
    weights = splu(matrix.T.tocsc()).solve(slope)
    found = []
    for step in ((1e-3, 0.0), (0.0, 1e-3)):  # loads are linear in both
        change = paired_load(equations(GAP + step[0], -0.5 + step[1])) - paired_load(here)
        found.append(weights[system._node] @ change / 1e-3)
    system.destroy()
    return 0.5 * wrong @ wrong, found


@pytest.mark.parametrize("method", ["galerkin", "monolithic"])
def test_sweeps_with_the_active_set_are_the_adjoint(tmp_path, method):
    times = np.linspace(0.0, T, LAYERS + 1)
    aim = np.clip(0.5 * (times - 1.0), 0.0, 1.0)
    lines = [f"{t!r},{p!r}" for t, p in zip(times.tolist(), aim.tolist(), strict=True)]
    (tmp_path / "p.csv").write_text("\n".join(["time,value", *lines]))
    found = impactfem.gradient(Scene.from_dict({
        "title": "founding", "duration": T,
        "body": [{"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
                  "gap": GAP, "velocity": -0.5}],
        "obstacle": [{"kind": "wall"}],
        "parameter": [{"name": "H", "key": "body.bar.gap"},
                      {"name": "v", "key": "body.bar.velocity"}],
        "measure": [{"name": "p", "of": "impulse.bar.wall", "data": "p.csv"}],
        "solve": {"method": method, "elements": ELEMENTS},
        "output": {"report": False, "pictures": False, "fields": []},
    }, tmp_path))  # fmt: skip
    objective, slopes = adjoint()
    assert found.objective == pytest.approx(objective, rel=1e-12)
    assert list(found.gradient.values()) == pytest.approx(slopes, rel=1e-8)
    assert found.check.rate == pytest.approx(2.0, abs=1e-3)
