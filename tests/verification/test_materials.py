"""Solids of several materials, or of one that varies: against rows of bars and themselves."""

import re

import numpy as np
import pytest
from pytest_mpi import parallel_assert

import impactfem
from impactfem import Scene, SceneError
from impactfem.errors import MeshError
from impactfem.models.solids import solids_model

SPEED = 1e-3
NEAR, FAR = {"density": 1.0, "youngs_modulus": 1.0}, {"density": 2.0, "youngs_modulus": 8.0}
BOTH = {"near": NEAR, "far": FAR}
WHERE = {
    "density": "where(x < 0.5, 1, 2)", "youngs_modulus": "where(x < 0.5, 1, 8)",
}  # fmt: skip
# Waves take the same time through the cells of both layers, whose impedances are 1 to 4.
STRIP = """
Point(1) = {{0, 0, 0}}; Point(2) = {{0.5, 0, 0}}; Point(3) = {{1.5, 0, 0}};
Point(4) = {{0, 0.25, 0}}; Point(5) = {{0.5, 0.25, 0}}; Point(6) = {{1.5, 0.25, 0}};
Line(1) = {{1, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 6}}; Line(4) = {{6, 5}};
Line(5) = {{5, 4}}; Line(6) = {{4, 1}}; Line(7) = {{2, 5}};
Curve Loop(1) = {{1, 7, 5, 6}}; Plane Surface(1) = {{1}};
Curve Loop(2) = {{2, 3, 4, -7}}; Plane Surface(2) = {{2}};
Transfinite Curve {{1, 5, 2, 4}} = {n} + 1; Transfinite Curve {{3, 6, 7}} = 2;
Transfinite Surface {{1, 2}}; Recombine Surface {{1, 2}};
Physical Curve("left") = {{6}}; Physical Curve("right") = {{3}};
"""
GROUPS = 'Physical Surface("near") = {1}; Physical Surface("far") = {2};'
WALL = {"name": "wall", "kind": "half_space", "point": [0, 0], "normal": [1, 0]}


def strip(folder, elements=8, *, groups=GROUPS, materials=BOTH, solve=None, duration=3.0, **body):
    path = folder / f"strip{len(groups)}.geo"
    path.write_text(STRIP.format(n=elements) + groups)
    solid = {
        "name": "strip", "kind": "solid", "model": "plane_strain", "mesh": str(path), "degree": 1,
        "poisson_ratio": 0.0, "velocity": [-SPEED, 0.0], "contact_surfaces": ["left"],
        "strain": "small",
    } | ({"materials": materials} if materials else {}) | body  # fmt: skip
    return Scene.from_dict(
        {
            "title": "layers", "duration": duration, "body": [solid], "obstacle": [WALL],
            "solve": {"estimate": False} | (solve or {}), "output": {"fields": []},
        }
    )  # fmt: skip


@pytest.fixture(scope="module")
def exact():
    """Force of the exact row of both bars, which stay in touch, on the wall."""
    bar = {"kind": "bar", "area": 0.25, "velocity": -SPEED}
    bars = [
        {"name": "near", "length": 0.5} | NEAR | bar,
        {"name": "far", "length": 1.0, "gap": 0.5} | FAR | bar,
    ]
    wall = {"name": "wall", "kind": "wall"}
    scene = {"title": "row", "duration": 3.0, "body": bars, "obstacle": [wall]}
    history = impactfem.solve(Scene.from_dict(scene)).history
    times, force = (history[name].values for name in ("time", "force.near.wall"))
    assert (history["force.near.far"].values[(times > 0.51) & (times < 3.0)] > 0.0).all()
    return times, force


def apart(result, exact):
    """Mean difference of the force on the wall, over its mean."""
    times, force = (result.history[name].values for name in ("time", "contact_force"))
    known = np.interp(times, *exact)
    return float(np.abs(force - known)[1:].mean() / known.mean())


@pytest.mark.parallel(1)
def test_two_layers_are_the_exact_row_of_bars(tmp_path, exact):
    """Of galerkin at courant 1 to rounding; massless falls by 1.6 when elements are halved."""
    scene = strip(tmp_path, solve={"method": "galerkin", "dt": 1 / 16})
    result = impactfem.solve(scene)
    assert apart(result, exact) <= 1e-9
    assert result.summary["bodies"]["strip"]["mass"] == pytest.approx(0.625, rel=1e-12)
    momentum = result.history["momentum.x"].values[0]
    assert momentum == pytest.approx(-0.625 * SPEED, rel=1e-12)
    errors = []
    for elements in (8, 16, 32):
        implicit = {"method": "massless", "dt": 0.5 / elements}
        errors.append(apart(impactfem.solve(strip(tmp_path, elements, solve=implicit)), exact))
    assert errors[2] <= 0.04
    assert errors[0] / errors[1] > 1.5 < errors[1] / errors[2]


@pytest.mark.parallel(1)
@pytest.mark.parametrize("method", ["explicit", "conserving"])
def test_a_formula_in_steps_is_groups(tmp_path, method):
    given = strip(tmp_path, solve={"method": method}, strain="finite", duration=1.5)
    said = strip(
        tmp_path, solve={"method": method}, strain="finite", duration=1.5, materials=None,
        groups='Physical Surface("body") = {1, 2};', **WHERE,
    )  # fmt: skip
    one, two = (impactfem.solve(scene).history for scene in (given, said))
    assert len(one["time"]) == len(two["time"])
    for name in ("strip.x", "contact_force", "total_energy"):
        values = one[name].values
        assert np.abs(values - two[name].values).max() <= 1e-11 * np.abs(values).max()


@pytest.mark.parallel(1)
def test_a_static_start_pulls_all_layers_alike(tmp_path):
    """Both layers have the stress of the traction, each its own strain."""
    pull = 1e-4
    scene = strip(
        tmp_path, velocity=[0.0, 0.0], duration=0.2, solve={"method": "massless"},
        contact_surfaces=["right"], supports=[{"surface": "left", "kind": "fixed"}],
        tractions=[{"surface": "right", "value": [pull, 0.0]}],
    )  # fmt: skip
    places = {"a": 0.2, "b": 1.2}
    probes = [{"name": k, "body": "strip", "point": [x, 0.1], "quantities": ["stress",
               "displacement"]} for k, x in places.items()]  # fmt: skip
    known = scene.to_dict() | {"start": "static", "probe": probes}
    history = impactfem.solve(Scene.from_dict(known)).history
    for name in places:
        assert np.abs(history[f"{name}.sxx"].values - pull).max() <= 1e-12 * pull * 1e3
    moved = history["b.ux"].values[-1]
    assert moved == pytest.approx(pull * (0.5 / 1.0 + 0.7 / 8.0), rel=1e-9)


@pytest.mark.parallel(1)
def test_stresses_of_small_and_finite_strain_are_one_where_strains_are_tiny(tmp_path):
    """In motion, of two groups, at any step: apart by strains. Contact moves mass otherwise."""
    pull = 1e-7
    probes = [{"name": name, "body": "strip", "point": [x, 0.1], "quantities": ["stress"]}
              for name, x in (("near", 0.3), ("far", 0.8))]  # fmt: skip
    both = []
    for strain in ("small", "finite"):
        scene = strip(
            tmp_path, 4, velocity=[0.0, 0.0], solve={"method": "conserving", "dt": 0.2},
            strain=strain, poisson_ratio=0.3, contact_surfaces=None,
            supports=[{"surface": "left", "kind": "fixed"}],
            tractions=[{"surface": "right", "value": [pull, 0.0]}],
        )  # fmt: skip
        given = scene.to_dict() | {"probe": probes, "obstacle": []}
        both.append(impactfem.solve(Scene.from_dict(given)).history)
    for name in ("near.sxx", "near.syy", "far.sxx", "far.szz"):
        size = np.abs(both[0][name].values).max()
        assert size > 0.01 * pull
        assert np.abs(both[1][name].values - both[0][name].values).max() < 100.0 * pull * size


def part_of(folder, **body):
    scene = strip(folder, 4, strain="finite", **body)
    return solids_model(scene, (body.get("degree", 1),)).parts[0]


@pytest.mark.parallel(1)
def test_laws_of_groups_are_the_same_in_kernels_and_forms(tmp_path):
    from impactfem.system.element_forces import ElementForces
    from impactfem.system.finite_strain import FiniteStrain

    laws = {"near": NEAR | {"material": "neo_hookean", "poisson_ratio": 0.3}, "far": FAR}
    part = part_of(tmp_path, materials=laws)
    system = part.system
    assert part.solid.law == "neo_hookean"
    forms = FiniteStrain(system.nodes, part.solid, system.following)
    kernels = ElementForces(system.nodes, part.solid)
    place = 0.02 * np.random.default_rng(1).normal(size=len(system.displacement))
    kernels.put(place)
    forces, energy, _ = kernels.forces()
    assert np.abs(forces - forms.force(place, place)).max() <= 1e-13 * np.abs(forces).max() * 10
    assert energy == pytest.approx(forms.energy(place), rel=1e-12)


@pytest.mark.parallel(1)
@pytest.mark.parametrize("rubber", [0.3, 0.499])
def test_forces_of_a_step_do_the_work_of_the_energy_in_each_law(tmp_path, rubber):
    """Where only one group keeps its volume in the mean, and the other has no lambda at all."""
    from impactfem.system.finite_strain import FiniteStrain

    laws = {"near": NEAR | {"material": "neo_hookean", "poisson_ratio": rubber}, "far": FAR}
    part = part_of(tmp_path, materials=laws, cells="hexahedron")
    system = part.system
    forms = FiniteStrain(system.nodes, part.solid, system.following)
    draw = np.random.default_rng(2)
    before, after = (0.02 * draw.normal(size=len(system.displacement)) for _ in range(2))
    work = float(forms.force(before, after) @ (after - before))
    change = forms.energy(after) - forms.energy(before)
    assert work == pytest.approx(change, abs=1e-12 * forms.energy(after))
    # The stiffness of small strains is the tangent where nothing is moved.
    tiny = 1e-6 * before
    linear = system.elastic_energy(tiny)
    assert forms.energy(tiny) == pytest.approx(linear, rel=1e-4)


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("materials", "groups", "words"),
    [
        ({"near": NEAR}, GROUPS, "in body.materials 'far' has no material"),
        (BOTH | {"core": NEAR}, GROUPS, "2 groups of elements.*'core' is none of them"),
        (None, GROUPS, "body.materials = { near = { ... }, far = { ... } }"),
        (BOTH, "", "holds no group of elements"),
        (BOTH, GROUPS + 'Physical Surface("core") = {1};', "'core' has no material"),
        (
            BOTH | {"core": NEAR},
            GROUPS + 'Physical Surface("core") = {1};',
            "groups 'near' and 'core' share elements",
        ),
    ],
)
def test_groups_without_material_are_refused_with_their_names(tmp_path, materials, groups, words):
    own = {} if materials else NEAR
    scene = strip(tmp_path, materials=materials, groups=groups, **own)
    with pytest.raises(MeshError, match=re.sub(r"([{}])", r"\\\1", words)):
        impactfem.plan(scene)


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"materials": {"near": {"density": 1.0}}}, r"materials.near.youngs_modulus is missing"),
        ({"materials": {"near": NEAR | {"c10": 1.0}}}, r"materials.near.c10 = 1.0 belongs to"),
        ({"materials": {"near": NEAR | {"density": -1}}}, r"materials.near.density = -1"),
        ({"materials": {"near": NEAR | {"e": 1.0}}}, r"materials.near.e = 1.0 is not a known key"),
        (NEAR | {"density": "1 + z"}, r"density = \"1 \+ z\" does not fit model"),
        ({"materials": BOTH, "mesh": None, "shape": {"kind": "disc", "radius": 1.0},
          "mesh_size": 0.1}, r"materials belong to physical groups of a mesh file"),
    ],
)  # fmt: skip
def test_materials_that_are_none_are_refused_by_key(tmp_path, given, words):
    with pytest.raises(SceneError, match=words):
        strip(tmp_path, **({"materials": None} | given))


@pytest.mark.parallel(1)
def test_a_formula_that_is_not_positive_is_refused(tmp_path):
    own = NEAR | {"youngs_modulus": "1 - x"}
    scene = strip(tmp_path, groups="", materials=None, **own)
    with pytest.raises(SceneError, match=r"youngs_modulus = '1 - x' is .* at \(1"):
        impactfem.plan(scene)


@pytest.mark.parallel(1)
def test_poissons_ratio_may_be_a_formula(tmp_path):
    """As groups have it; nearly incompressible elements have to be asked for."""
    own = {"groups": 'Physical Surface("body") = {1, 2};', "materials": None, **NEAR}
    laws = {"near": NEAR | {"poisson_ratio": 0.2}, "far": NEAR | {"poisson_ratio": 0.4}}
    energies = []
    for body in ({"materials": laws}, own | {"poisson_ratio": "where(x < 0.5, 0.2, 0.4)"}):
        part = solids_model(strip(tmp_path, 4, **body), (1,)).parts[0]
        moved = np.sin(3.0 * part.system.positions + [[1.0, 2.0]]).ravel()
        energies.append(part.system.elastic_energy(moved))
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)
    for formula, words in (
        ("where(x < 0.5, 0.3, 0.48)", 'poisson_ratio exceeds 0.45.*"mean_dilatation"'),
        ("0.3 + x", "poisson_ratio = '0.3 \\+ x' is .* between -1 and 0.5"),
    ):
        with pytest.raises(SceneError, match=words):
            impactfem.plan(strip(tmp_path, **(own | {"poisson_ratio": formula})))


@pytest.mark.parallel([1, 2])
def test_all_ranks_see_the_groups(tmp_path):
    folder = impactfem.fem.MPI.COMM_WORLD.bcast(tmp_path, root=0)
    graded = {"near": NEAR | {"youngs_modulus": "1 + x*y"}, "far": FAR}
    part = solids_model(strip(folder, materials=graded), (1,)).parts[0]
    system = part.system
    moved = np.sin(3.0 * system.positions).ravel()
    energy = system.elastic_energy(moved)
    told = part.foreseen
    parallel_assert(abs(system.total_mass - 0.625) <= 1e-13)
    parallel_assert(abs(energy - 12.865866567724504) <= 1e-12 * energy)
    parallel_assert(told.least == 0.0625)


def test_residual_stress_of_one_material_is_shared_by_all(tmp_path):
    """Held at both ends: s + E1 e1 = E2 e2 and L1 e1 + L2 e2 = 0, to the order of s / E."""
    shrunk = {"near": NEAR | {"residual_stress": [1e-6, 0, 0]}, "far": FAR}
    held = [{"surface": side, "kind": "fixed"} for side in ("left", "right")]
    made = strip(
        tmp_path, materials=shrunk, supports=held, duration=0.1, velocity=[0.0, 0.0], strain=None,
        solve={"dt": 0.1, "method": "conserving"},
    ).given()  # fmt: skip
    places = {"near": 0.23, "far": 1.2, "seam": 0.5}
    made["probe"] = [
        {"name": name, "body": "strip", "point": [x, 0.1], "quantities": ["displacement", "stress"]}
        for name, x in places.items()
    ]
    history = impactfem.solve(Scene.from_dict(made | {"start": "static", "obstacle": []})).history
    assert history["seam.ux"].values[0] == pytest.approx(-1e-7, rel=1e-5)
    for name in ("near", "far"):
        assert history[f"{name}.sxx"].values[0] == pytest.approx(0.8e-6, rel=1e-5)
