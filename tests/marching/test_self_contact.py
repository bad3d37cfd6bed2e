"""A body that strikes itself: energy, momenta, no penetration."""

import numpy as np
import pytest
from moving_scenes import differences, folding, stopping

import impactfem
from impactfem.errors import SceneError


@pytest.mark.slow
@pytest.mark.parametrize(("method", "friction"), [("conserving", 0.0), ("massless", 0.3)])
def test_a_ring_that_strikes_itself_keeps_all_momenta(method, friction):
    result = impactfem.solve(folding(method, friction))
    force, energy, rubbed, spun, x, y, gap, turned = (
        result.history[name].values
        for name in (
            "force.ring.ring", "total_energy", "friction_work", "angular_momentum", "momentum.x",
            "momentum.y", "gap.ring.ring", "moment.ring.ring",
        )
    )  # fmt: skip
    assert force.max() > 1000.0
    assert force[-1] == 0.0  # it has opened again
    own = result.summary["bodies"]["ring"]["mass"] * 1.0  # kg m/s at 1 m/s
    assert max(np.ptp(x), np.ptp(y)) <= 1e-11 * own
    assert np.ptp(spun) <= 1e-11 * abs(spun[0])
    kept = (energy - rubbed) / energy[0]
    assert np.diff(kept).max() <= 1e-12
    if method == "conserving":
        assert np.ptp(kept) <= 1e-10
    assert (rubbed[-1] < -1e-3 * energy[0]) == (friction > 0.0)
    assert np.nanmin(gap) >= -5e-4 * 0.1
    assert np.abs(turned).max() <= 1e-3 * force.max() * 0.05  # of its own forces
    assert not any(
        found["code"] == "penetration" for found in result.summary["verdict"]["findings"]
    )


@pytest.mark.slow
def test_explicit_steps_fold_a_ring_as_implicit_ones_do():
    """On elements that resolve its wall: the impulse to 1 %, momenta to rounding."""
    found = []
    for method, step in (("explicit", {}), ("conserving", {"dt": 1e-4})):
        table = folding(method, 0.0).to_dict()
        table["body"][0]["mesh_size"] = 0.0025
        table["solve"].pop("dt")
        table["solve"] |= step
        history = impactfem.solve(impactfem.Scene.from_dict(table)).history
        force = history["force.ring.ring"].values
        found.append(float(np.trapezoid(force, history["time"].values)))
        spun, energy = history["angular_momentum"].values, history["total_energy"].values
        assert np.ptp(spun) <= 1e-11 * abs(spun[0])
        assert np.ptp(energy) <= 1e-3 * energy[0]
        assert np.nanmin(history["gap.ring.ring"].values) >= -1e-3 * 0.1
    assert found[0] == pytest.approx(found[1], rel=0.01)


@pytest.mark.slow
def test_without_a_law_it_passes_through_itself_and_says_so():
    body = folding().to_dict()
    floor = {"kind": "half_space", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
    alone = {key: value for key, value in body.items() if key != "contact"}
    result = impactfem.solve(impactfem.Scene.from_dict(alone | {"obstacle": [floor]}))
    (found,) = (
        found for found in result.summary["verdict"]["findings"] if found["code"] == "penetration"
    )
    assert "contact of a body with itself was not asked for" in found["text"]
    assert found["remedy"] == 'give [[contact]] between = ["ring", "ring"]'
    assert result.summary["verdict"]["level"] == "do_not_trust"


@pytest.mark.slow
@pytest.mark.parametrize(("method", "layers"), [("conserving", (40, 58)), ("explicit", (120, 200))])
def test_a_continued_run_equals_the_whole_one(tmp_path, monkeypatch, method, layers):
    """Far from contact, and in it."""
    case = folding(method, solve={"method": method, "estimate": False, "dt": 2e-4})
    if method == "explicit":
        case = case.with_settings({"solve.dt": 5e-5}).with_settings({"duration": 0.011})
    whole = impactfem.solve(case)
    for layer in layers:
        with stopping(monkeypatch, layer):
            impactfem.solve(case, checkpoints=tmp_path)
        again = impactfem.solve(case, checkpoints=tmp_path, restart=tmp_path)
        assert differences(whole, again) == {}


def test_the_plan_takes_finite_strain_where_a_body_may_meet_itself():
    table = folding().to_dict()
    table["body"][0] |= {"strain": None, "material": "linear"}
    table["body"][0].pop("strain")
    plan = impactfem.plan(impactfem.Scene.from_dict(table))
    assert plan.numbers.strains == ("finite",)
    assert "ring meets itself" in plan.reasons["contact ring and ring"]


@pytest.mark.parametrize(
    ("change", "parts"),
    [
        (
            {"strain": "small", "material": "linear", "method": "explicit"},
            ["ring meets itself", 'give strain = "finite"'],
        ),
    ],
)
def test_what_cannot_meet_itself_is_refused(change, parts):
    table = folding().to_dict()
    table["solve"] = {"method": change.pop("method")}
    table["body"][0] |= change
    with pytest.raises(SceneError) as error:
        impactfem.Scene.from_dict(table)
    for part in parts:
        assert part in str(error.value)


ARMS = """
w = 0.01; h = 0.05; g = 0.0005; b = 0.01;
Point(1) = {-g/2 - w, 0, 0}; Point(2) = {-g/2, 0, 0}; Point(3) = {g/2, 0, 0};
Point(4) = {g/2 + w, 0, 0}; Point(5) = {-g/2 - w, b, 0}; Point(6) = {-g/2, b, 0};
Point(7) = {g/2, b, 0}; Point(8) = {g/2 + w, b, 0}; Point(9) = {-g/2 - w, b + h, 0};
Point(10) = {-g/2, b + h, 0}; Point(11) = {g/2, b + h, 0}; Point(12) = {g/2 + w, b + h, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {5, 6}; Line(5) = {6, 7};
Line(6) = {7, 8}; Line(7) = {9, 10}; Line(8) = {11, 12}; Line(9) = {1, 5}; Line(10) = {2, 6};
Line(11) = {3, 7}; Line(12) = {4, 8}; Line(13) = {5, 9}; Line(14) = {6, 10};
Line(15) = {7, 11}; Line(16) = {8, 12};
Curve Loop(1) = {1, 10, -4, -9}; Plane Surface(1) = {1};
Curve Loop(2) = {2, 11, -5, -10}; Plane Surface(2) = {2};
Curve Loop(3) = {3, 12, -6, -11}; Plane Surface(3) = {3};
Curve Loop(4) = {4, 14, -7, -13}; Plane Surface(4) = {4};
Curve Loop(5) = {6, 16, -8, -15}; Plane Surface(5) = {5};
Transfinite Curve {1, 3, 4, 6, 7, 8} = 3; Transfinite Curve {2, 5} = 2;
Transfinite Curve {9, 10, 11, 12} = 3; Transfinite Curve {13, 14, 15, 16} = 11;
Transfinite Surface {1:5}; Recombine Surface {1:5};
Physical Surface("arms") = {1:5}; Physical Curve("foot") = {1, 2, 3};
Physical Curve("left") = {14}; Physical Curve("right") = {15};
"""


@pytest.mark.slow
def test_arms_of_small_strain_that_clap_do_what_those_of_finite_strain_do(tmp_path):
    """Strains stay below some percent, and both meet amid: that is the plane of symmetry."""
    (tmp_path / "arms.geo").write_text(ARMS)
    found = []
    for strain in ("small", "finite"):
        body = {
            "kind": "solid", "name": "arms", "model": "plane_strain", "mesh": "arms.geo",
            "density": 1000.0, "youngs_modulus": 1e8, "poisson_ratio": 0.3, "strain": strain,
            "velocity": ["-2*where(x > 0, 1, -1)*where(y > 0.01, y - 0.01, 0)/0.05", "0"],
            "supports": [{"surface": "foot", "kind": "fixed"}],
        }  # fmt: skip
        scene = {
            "title": "clap", "duration": 4.5e-4, "body": [body],
            "contact": [{"between": ["arms/left", "arms/right"]}],
            "solve": {"dt": 1.5e-5, "estimate": False}, "output": {"fields": []},
            "probe": [{"name": "tip", "body": "arms", "point": [-2.5e-4, 0.06]}],
        }  # fmt: skip
        history = impactfem.solve(impactfem.Scene.from_dict(scene, base=tmp_path)).history
        energy = history["total_energy"].values
        assert np.ptp(energy) < 1e-10 * energy[0]
        impulse = history["contact_force"].values[1:] @ np.diff(history["time"].values)
        assert history["tip.ux"].values.max() < 2.5e-4 + 1e-5  # half the gap, in the mean of faces
        found.append([impulse, history["contact_force"].values.max()])
    assert found[0][0] > 0.1
    assert found[0] == pytest.approx(found[1], rel=0.02)
