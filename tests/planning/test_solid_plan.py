"""What the plan chooses for solids, and that it says why."""

import math

import pytest
from solid_scenes import DISC, FLOOR, FLOOR_3D, solid_scene

import impactfem
from impactfem.planning import MarchNumbers
from impactfem.planning.solid_elements import slenderness

FRAME = """Rectangle(1) = {0, 1, 0, 3, 2}; Rectangle(2) = {0.05, 1.05, 0, 2.9, 1.9};
BooleanDifference{ Surface{1}; Delete; }{ Surface{2}; Delete; }"""
LONG_BLOCK = {"kind": "block", "size": [1.0, 0.1], "corner": [0.0, 0.1]}
BALL = {"kind": "sphere", "center": [0.0, -0.4], "radius": 0.4}
STAIRS = {"kind": "polyline", "points": [[-2, 0], [0, 0], [0, -0.2], [2, -0.2]]}
FINE_SPOT = [{"point": [0.0, 0.02], "radius": 0.02, "size": 0.0008}]


@pytest.mark.parametrize(
    ("keys", "method", "degree", "reason"),
    [
        ({}, "explicit", 1, "cheaper"),
        ({"poisson_ratio": 0.49}, "massless", 2, "no lumped mass"),
        ({"poisson_ratio": 0.4999, "duration": 8.0}, "massless", 2, "no lumped mass"),
        ({"poisson_ratio": 0.4999, "cells": "hexahedron"}, "massless", 1, "explicit steps would"),
        ({"poisson_ratio": 0.4999, "model": "plane_stress"}, "explicit", 1, "cheaper"),
        ({"shape": LONG_BLOCK, "mesh_size": 0.05}, "massless", 2, "no lumped mass"),
        ({"degree": 2}, "massless", 2, "no lumped mass"),
        ({"refine": FINE_SPOT}, "massless", 1, "smallest elements"),
        ({"duration": 400.0}, "conserving", 1, "energy must be kept"),
        ({"solve": {"dt": 0.05}}, "massless", 1, "stable at any step"),
        ({"solve": {"courant": 2.0}}, "massless", 1, "stable at any step"),
        ({"solve": {"method": "newmark"}}, "newmark", 1, "as asked"),
        ({"solve": {"method": "explicit"}, "poisson_ratio": 0.49}, "explicit", 1, "as asked"),
    ],
)
def test_method_and_degree_follow_from_the_scene(keys, method, degree, reason):
    plan = impactfem.plan(solid_scene(**keys))
    assert isinstance(plan.numbers, MarchNumbers)
    assert (plan.method, plan.degree) == (method, degree)
    assert reason in plan.reasons["method"]
    assert plan.reasons["degree"]


def test_degree_names_what_is_stiff():
    assert "0.49" in impactfem.plan(solid_scene(poisson_ratio=0.49)).reasons["degree"]
    bending = impactfem.plan(solid_scene(shape=LONG_BLOCK, mesh_size=0.05))
    assert "10 times as long" in bending.reasons["degree"]
    asked = solid_scene(poisson_ratio=0.49, solve={"method": "explicit"})
    assert any("lock" in text for text in impactfem.plan(asked).warnings)


def filling(dt, duration=4.0):
    """The longest step up to one that fills the duration."""
    return pytest.approx(duration / math.ceil(duration / dt), rel=1e-12)


def test_slenderness_of_a_ring_is_that_of_its_wall():
    ring = {"kind": "ring", "inner_radius": 0.9, "radius": 1.0, "center": [0.0, 1.5]}
    assert slenderness(solid_scene(shape=ring).solid) == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("drawn", "dim", "size", "degree"),
    [
        (FRAME, 2, 0.2, 2),
        ("Rectangle(1) = {0, 1, 0, 3, 2};", 2, 0.2, 1),
        ("Rectangle(1) = {0, 1, 0, 3, 0.5};", 2, 0.2, 2),  # two elements across
        ("Rectangle(1) = {0, 1, 0, 3, 0.5};", 2, 0.1, 1),  # five
        ("Box(1) = {0, 1, 0, 2, 1, 0.1};", 3, 0.2, 2),
        ("Box(1) = {0, 1, 0, 2, 1, 1};", 3, 0.2, 1),
    ],
)  # fmt: skip
def test_thin_walls_of_a_mesh_file_get_quadratic_elements(tmp_path, drawn, dim, size, degree):
    (tmp_path / "body.geo").write_text(f'SetFactory("OpenCASCADE");\n{drawn}\n')
    keys = {"shape": None, "mesh": str(tmp_path / "body.geo"), "mesh_size": size}
    if dim == 3:
        keys |= {"obstacles": (FLOOR_3D,), "model": "3d", "velocity": [0.0, -1.0, 0.0]}
    plan = impactfem.plan(solid_scene(**keys))
    assert plan.degree == degree
    assert ("thick in the mean" in plan.reasons["degree"]) == (degree == 2)
    if degree == 2:
        asked = impactfem.plan(solid_scene(**keys, degree=1))
        assert [each.code for each in asked.findings].count("locking") == 1


def test_nearly_incompressible_bodies_march_with_waves_of_shear():
    plan = impactfem.plan(solid_scene(poisson_ratio=0.4999))
    assert plan.dt == filling(0.5 * 0.125 / math.sqrt(0.75 / 2.9998))
    assert "courant = .5" in plan.reasons["dt"]
    (text,) = (text for text in plan.warnings if "rayleigh_stiffness = " in text)
    damping = float(text.split("rayleigh_stiffness = ")[1].split()[0])
    damped = impactfem.plan(solid_scene(poisson_ratio=0.4999, rayleigh_stiffness=damping))
    assert not any("rayleigh" in text for text in damped.warnings)
    asked = impactfem.plan(solid_scene(poisson_ratio=0.4999, solve={"courant": 0.5}))
    assert 0.45 < asked.courant <= 0.5


def test_implicit_step_is_half_an_element_of_the_fastest_wave():
    scene = solid_scene(solve={"method": "massless"})
    plan = impactfem.plan(scene)
    # lambda + 2 mu = E (1 - nu) / ((1 + nu) (1 - 2 nu)), rho = 1.
    speed = math.sqrt(0.75 * 0.7 / (1.3 * 0.4))
    assert 0.45 < plan.courant <= 0.5
    assert plan.dt == filling(0.5 * 0.125 / speed)
    assert plan.layers * plan.dt == pytest.approx(4.0, rel=1e-15)


def test_explicit_step_is_a_share_of_the_stable_one_found_later():
    plan = impactfem.plan(solid_scene(solve={"method": "explicit"}))
    assert (plan.dt, plan.layers, plan.courant, plan.linear_solver) == (None, None, 0.9, "none")
    assert impactfem.plan(solid_scene(solve={"method": "galerkin"})).courant == 1.0


@pytest.mark.parametrize("method", ["explicit", "galerkin"])
@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"degree": 2}, 'degree = 2 .*method = "massless"'),
        ({"courant": 1.5}, "courant = 1.5 .*stability limit.*massless"),
    ],
)
def test_what_explicit_methods_cannot_do_is_refused_with_the_remedy(method, keys, message):
    solve = {"method": method} | {k: v for k, v in keys.items() if k == "courant"}
    body = {k: v for k, v in keys.items() if k == "degree"}
    with pytest.raises(impactfem.SceneError, match=message):
        impactfem.plan(solid_scene(solve=solve, **body))


def test_elements_that_no_memory_holds_are_refused_before_they_are_made():
    with pytest.raises(impactfem.SceneError, match=r"mesh_size.*GiB"):
        impactfem.plan(solid_scene(mesh_size=1e-6))


@pytest.mark.parametrize("method", ["newmark", "moreau_jean", "galerkin"])
def test_methods_that_ring_say_so(method):
    warnings = impactfem.plan(solid_scene(solve={"method": method})).warnings
    assert any(text.startswith(method) for text in warnings)
    assert not impactfem.plan(solid_scene()).warnings


def test_nodes_left_out_of_contact_are_counted():
    plan = impactfem.plan(solid_scene())
    said = [text for key, text in plan.reasons.items() if key.startswith("contact")]
    assert any("face away" in text for text in said)
    assert 0 < plan.contact_pairs < plan.unknowns // 2


def test_a_body_that_meets_nothing_is_warned_of():
    plan = impactfem.plan(solid_scene(velocity=[0.1, 0.0], duration=0.01))
    assert plan.contact_pairs == 0
    assert any("flies freely" in text for text in plan.warnings)


def test_a_turning_body_is_warned_of():
    plan = impactfem.plan(solid_scene(angular_velocity=1.0, strain="small"))
    (found,) = [entry for entry in plan.findings if entry.code == "model_rotation"]
    assert (found.severity, found.limit) == ("warning", 0.3)  # as asked


def turning(angle=1.0, **keys):
    """A disc that turns by some angle."""
    return solid_scene(angular_velocity=angle, duration=1.0, **keys)


@pytest.mark.parametrize("model", ["plane_strain", "plane_stress"])
def test_a_body_that_will_turn_far_takes_finite_strain(model):
    plan = impactfem.plan(turning(model=model))
    assert (plan.strains, plan.method, plan.normals) == (("finite",), "conserving", "updated")
    (why,) = [text for key, text in plan.reasons.items() if key.startswith("strain of ")]
    assert "will turn by about" in why
    assert 'strain = "small" keeps these in about' in why
    assert not [entry for entry in plan.findings if entry.code == "model_rotation"]


def test_a_soft_disc_that_friction_rolls_takes_finite_strain():
    """Its contact, wide as it is, does not hold it as a face would (.47 rad are measured)."""
    rub = [{"between": ["body", "floor"], "friction_coefficient": 0.3}]
    keys = {"velocity": [0.05, -0.05], "youngs_modulus": 1.0, "duration": 8.0}
    tables = solid_scene(**keys).to_dict() | {"contact": rub}
    plan = impactfem.plan(impactfem.Scene.from_dict(tables))
    assert plan.strains == ("finite",)
    (why,) = [text for key, text in plan.reasons.items() if key.startswith("strain of ")]
    assert "as it meets" in why


@pytest.mark.parametrize(
    "case",
    [
        turning(0.15),  # less than what would not be trusted
        turning(strain="small"),
        turning(solve={"method": "newmark"}),  # a method that has no finite strain
    ],
)
def test_a_body_that_turns_less_or_cannot_do_better_keeps_small_strain(case):
    plan = impactfem.plan(case)
    assert plan.strains == ("small",)
    (found,) = [entry for entry in plan.findings if entry.code == "model_rotation"]
    assert 'strain = "finite"' in found.remedy
    assert not [key for key in plan.reasons if key.startswith("strain of ")]


@pytest.mark.parametrize(("speed", "strain"), [(0.2, "finite"), (1.0, "small")])
def test_a_strain_that_the_linear_law_stands_takes_finite_strain(speed, strain):
    keys = {"shape": DISC | {"center": [0.0, 0.52]}, "velocity": [0.0, -speed]}
    assert impactfem.plan(solid_scene(**keys)).strains == (strain,)


def test_a_run_takes_the_strain_of_its_plan():
    result = impactfem.solve(turning(youngs_modulus=300.0, solve={"dt": 0.02, "estimate": False}))
    assert result.scene.solids[0].strain == "finite"
    assert result.scene.solids[0].material == "neo_hookean"
    assert abs(result.history["body.angle"].values[-1] - 1.0) < 3e-3
    assert result.summary["bodies"]["body"]["rotation_max"] > 0.9
    codes = {entry["code"] for entry in result.summary["verdict"]["findings"]}
    assert "model_rotation" not in codes


@pytest.mark.parametrize(
    ("obstacle", "keys", "normals"),
    [
        (FLOOR, {"velocity": [5.0, -0.1]}, "fixed"),  # a plane has one normal
        (BALL, {}, "fixed"),
        (BALL, {"velocity": [0.1, -0.1]}, "updated"),  # .4 m along it, ten times the limit
        (BALL, {"gravity": [0.1, 0.0]}, "updated"),
        (BALL | {"motion": ["0.1*t", "0"]}, {}, "updated"),
        (BALL | {"center": [0.0, -0.6]}, {"velocity": [0.0, -0.1]}, "updated"),  # .2 m away
        (BALL | {"radius": 40.0, "center": [0.0, -40.0]}, {"velocity": [0.1, -0.1]}, "fixed"),
        (STAIRS, {"velocity": [0.1, -0.1]}, "updated"),
    ],
)
def test_normals_follow_the_way_along_curved_obstacles(obstacle, keys, normals):
    plan = impactfem.plan(solid_scene(obstacles=(obstacle,), **keys))
    assert plan.normals == normals
    assert normals in plan.reasons["normals"]


def test_estimate_is_by_coarser_elements_or_by_finer_ones_where_these_cost_little(monkeypatch):
    assert impactfem.plan(solid_scene()).resizing == (2.0, 4.0)
    coarse = impactfem.plan(solid_scene(mesh_size=0.25))
    assert coarse.resizing == (0.5,)
    assert "fewer than 3" in coarse.reasons["estimate"]
    thin = {"name": "thin", "velocity": [0.0, 0.0], "mesh_size": 0.25}
    thin |= {"shape": {"kind": "block", "size": [4.0, 1.0], "corner": [5.0, 5.0]}}
    pair = solid_scene().to_dict()
    pair["body"].append(pair["body"][0] | thin)
    assert impactfem.plan(impactfem.Scene.from_dict(pair)).resizing == (0.5,)
    monkeypatch.setattr("impactfem.planning.estimates.WORTH", 1e-3)
    assert not impactfem.plan(solid_scene(mesh_size=0.25)).estimate
    # One thin body does not take the estimate from the others.
    plan = impactfem.plan(impactfem.Scene.from_dict(pair))
    assert (plan.resizing, plan.unresized) == ((2.0, 4.0), ("thin",))
    fine, alone = (impactfem.plan(solid_scene(solve={"estimate": e})) for e in (True, False))
    assert alone.seconds < fine.seconds < 3.0 * alone.seconds
    assert not impactfem.plan(solid_scene(solve={"estimate": False})).estimate
    assert impactfem.plan(solid_scene(mesh_size=0.25, solve={"estimate": True})).estimate


def test_linear_solver_follows_from_the_size_or_as_asked(monkeypatch):
    massless = {"method": "massless"}
    assert impactfem.plan(solid_scene(solve=massless)).linear_solver == "mumps"
    gamg = impactfem.plan(solid_scene(solve=massless | {"linear_solver": "gamg"}))
    assert gamg.linear_solver == "gamg"
    monkeypatch.setattr("impactfem.planning.solid_choices._DIRECT", {2: 100, 3: 100})
    assert impactfem.plan(solid_scene(solve=massless)).linear_solver == "gamg"


def test_planned_runs_keep_their_energy_and_tell_their_error():
    # Fast enough for several nodes to touch on this mesh: beyond small strains, and told so.
    deep = {"shape": DISC | {"center": [0.0, 0.52]}, "velocity": [0.0, -0.1]}
    summary = impactfem.solve(solid_scene(**deep)).summary
    found = summary["verdict"]["findings"]
    assert [f["code"] for f in found if f["severity"] == "fault"] == ["model_strain"]
    assert summary["status"] == "out_of_model"
    assert not summary["energy"]["grows"]
    assert summary["details"]["contact_nodes"] == summary["plan"]["contact_pairs"]
    assert "elements twice and four times as large" in summary["error"]["reference"]
    assert summary["error"]["displacement_max"] < summary["error"]["force_l1"] < 0.3


def test_estimated_error_is_of_the_size_of_that_against_a_finer_mesh():
    estimate = impactfem.solve(solid_scene(mesh_size=0.1)).summary["error"]
    study = impactfem.studies.work_precision(solid_scene(), ["explicit"], [10], 1)
    true = study.rows[0]
    for name in ("displacement_max", "displacement_l2", "force_l1"):
        assert 0.5 <= estimate[name] / getattr(true, name) <= 10.0


def test_negative_control_ends_as_unstable():
    summary = impactfem.solve(solid_scene(solve={"method": "newmark", "dt": 0.05})).summary
    assert summary["status"] == "unstable"
    assert summary["energy"]["grows"]


def test_scene_as_used_plans_the_same():
    for solve in ({}, {"method": "massless", "dt": 0.05}, {"method": "conserving"}):
        scene = solid_scene(solve=solve | {"estimate": False})
        result = impactfem.solve(scene)
        again = impactfem.plan(result.scene)
        assert again.method == result.summary["method"]
        assert (again.dt, again.courant) == pytest.approx(
            (result.summary["plan"]["dt"], result.summary["plan"]["courant"])
        )


@pytest.mark.parallel([2, 4])
def test_all_ranks_plan_the_same():
    from mpi4py import MPI
    from pytest_mpi import parallel_assert

    plans = MPI.COMM_WORLD.allgather(impactfem.plan(solid_scene()).as_dict())
    parallel_assert(all(plan == plans[0] for plan in plans))


def test_stray_obstacles_do_not_hide_that_one_floor_is_enough():
    far = FLOOR | {"name": "ceiling", "point": [0.0, 9.0], "normal": [0.0, -1.0]}
    both = impactfem.plan(solid_scene(obstacles=(FLOOR, far)))
    assert both.contact_pairs == impactfem.plan(solid_scene()).contact_pairs


def test_slender_blocks_are_offered_the_step_of_their_bending(monkeypatch):
    """A clamped steel strip: first frequency 1.8751^2 / (2 pi) sqrt(E t^2 / (12 rho L^4))."""
    monkeypatch.setattr("impactfem.sizing.free_mib", lambda: 1e6)
    keys = {
        "shape": {"kind": "block", "size": [0.1, 0.002], "corner": [0.0, 0.001]},
        "mesh_size": 0.001, "density": 7800.0, "youngs_modulus": 2e11,
        "supports": [{"surface": "left", "kind": "fixed"}], "velocity": [0.0, -1.0],
    }  # fmt: skip
    frequency = 1.8751**2 / (2 * math.pi) * math.sqrt(2e11 * 0.002**2 / (12 * 7800.0 * 0.1**4))
    reasons = impactfem.plan(solid_scene(**keys)).reasons
    assert f"bending period {1 / frequency:.3g} s" in reasons["offer dt"]
    assert "offer dt" not in impactfem.plan(solid_scene(**keys, solve={"dt": 1e-6})).reasons
    assert "offer dt" not in impactfem.plan(solid_scene()).reasons


@pytest.mark.parametrize(("nu", "degree", "told"), [(0.48, 2, 1), (0.48, 1, 0), (0.42, 2, 0)])
def test_cells_with_too_few_pressures_are_told(nu, degree, told):
    keys = {"cells": "hexahedron", "degree": degree, "poisson_ratio": nu, "mesh_size": 0.25}
    block = {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.1]}
    plan = impactfem.plan(solid_scene(shape=block, material="neo_hookean", **keys))
    assert sum("one pressure each" in entry.text for entry in plan.findings) == told
