"""Orthotropic solids: turned patches, moduli at an angle, wave speeds, and equal constants."""

from types import SimpleNamespace

import numpy as np
import pytest
from pytest_mpi import parallel_assert

import impactfem
from impactfem import Scene, SceneError
from impactfem.fem import MPI
from impactfem.models import solids as models
from impactfem.models.solids import solids_model

WOOD = {
    "e1": 10.0, "e2": 1.0, "e3": 0.6, "nu12": 0.4, "nu13": 0.3, "nu23": 0.35,
    "g12": 0.8, "g13": 0.5, "g23": 0.2,
}  # fmt: skip
ALIKE = {
    "e1": 1.0, "e2": 1.0, "e3": 1.0, "nu12": 0.3, "nu13": 0.3, "nu23": 0.3,
    "g12": 1 / 2.6, "g13": 1 / 2.6, "g23": 1 / 2.6,
}  # fmt: skip
TURN = np.pi / 6
AXIS = [1.0, -2.0, 0.5]


def block(model="plane_stress", **own):
    size = [2.0, 1.0, 0.7][: 3 if model == "3d" else 2]
    return {
        "name": "part", "kind": "solid", "model": model, "density": 2.0, "degree": 1,
        "shape": {"kind": "block", "size": size}, "mesh_size": 0.5, "strain": "small",
    } | own  # fmt: skip


def scene(*bodies, duration=1.0, solve=None, **more):
    return Scene.from_dict(
        {
            "title": "wood", "duration": duration, "body": list(bodies),
            "solve": {"estimate": False} | (solve or {}), "output": {"fields": []},
        } | more
    )  # fmt: skip


def part_of(model, law, **own):
    return solids_model(scene(block(model, orthotropic=law, **own)), (1,)).parts[0]


def compliance(law):
    """Of direct stresses and the shear in the plane, along the axes (4, 4)."""
    found = np.diag([1 / law["e1"], 1 / law["e2"], 1 / law["e3"], 1 / law["g12"]])
    for i, j, ratio, one in ((0, 1, "nu12", "e1"), (0, 2, "nu13", "e1"), (1, 2, "nu23", "e2")):
        found[i, j] = found[j, i] = -law[ratio] / law[one]
    return found


@pytest.mark.parallel(1)
@pytest.mark.parametrize("model", ["plane_stress", "plane_strain", "3d"])
def test_patches_turned_by_30_degrees_have_the_energy_of_the_closed_form(model):
    """And nothing pulls at the nodes inside, where the strain is the same everywhere."""
    law = WOOD | {"angle": TURN}
    part = part_of(model, law, cells="hexahedron")
    strain = np.array([[1e-3, 4e-4, 0.0], [4e-4, -7e-4, 0.0], [0.0, 0.0, 0.0]])
    dim = part.solid.dim
    moved = part.system.positions @ strain[:dim, :dim]
    c, s = np.cos(TURN), np.sin(TURN)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    own = turn.T @ strain @ turn
    along = np.array([own[0, 0], own[1, 1], 0.0, 2 * own[0, 1]])
    if model == "plane_stress":
        keep = [0, 1, 3]
        stiff, along = np.linalg.inv(compliance(WOOD)[np.ix_(keep, keep)]), along[keep]
    else:
        stiff = np.linalg.inv(compliance(WOOD))
    known = 0.5 * along @ stiff @ along * (1.4 if model == "3d" else 2.0)
    system = part.system
    assert system.elastic_energy(moved.ravel()) == pytest.approx(known, rel=1e-12)
    forces = system.stiffness.createVecRight()
    source = forces.duplicate()
    source.setArray(moved.ravel())
    system.stiffness.mult(source, forces)
    size = system.positions.max(axis=0)
    inner = ((system.positions > 0) & (system.positions < size)).all(axis=1)
    pulled = forces.getArray().reshape(-1, dim)
    assert np.abs(pulled[inner]).max(initial=0.0) <= 1e-12 * np.abs(pulled).max()


@pytest.mark.parallel(1)
@pytest.mark.parametrize("angle", [0.0, 0.5, 1.2])
def test_the_modulus_at_an_angle_is_that_of_the_turned_compliance(angle):
    """A bar pulled along x, as stress and as strain; the stress is uniform however it shears."""
    pull, law = 1e-3, WOOD | {"angle": angle}
    given = block(
        orthotropic=law, cells="hexahedron",
        supports=[{"surface": "left", "kind": "motion", "value": ["0", ""]}],
        tractions=[{"surface": "right", "value": [pull, 0.0]}],
    )  # fmt: skip
    system = solids_model(scene(given), (1,)).parts[0].system
    c, s = np.cos(angle), np.sin(angle)
    one = c**4 / 10.0 + s**4 / 1.0 + (1 / 0.8 - 2 * 0.4 / 10.0) * c**2 * s**2
    strain = np.zeros((2, 2))
    strain[0, 0] = pull * one
    carried = pull * np.array([c * c, s * s, -c * s])  # the stress along the axes
    e = compliance(WOOD)[np.ix_([0, 1, 3], [0, 1, 3])] @ carried
    strain[1, 1] = s * s * e[0] + c * c * e[1] + c * s * e[2]
    strain[0, 1] = strain[1, 0] = c * s * (e[0] - e[1]) + 0.5 * (c * c - s * s) * e[2]
    assert s * s * e[1] + c * c * e[0] - c * s * e[2] == pytest.approx(pull * one, rel=1e-12)
    # Turned so that u_x = e_xx x only: the support is kept.
    turn = np.array([[0.0, -strain[0, 1]], [strain[0, 1], 0.0]])
    moved = (system.positions @ (strain + turn).T).ravel()
    forces = system.stiffness.createVecRight()
    source = forces.duplicate()
    source.setArray(np.where(system.constrained, 0.0, moved))
    system.stiffness.mult(source, forces)
    left = forces.getArray() - system.load(0.0)
    assert np.abs(moved[system.constrained]).max() <= 1e-15
    assert np.abs(left[~system.constrained]).max() <= 1e-12 * pull


@pytest.mark.parallel(1)
@pytest.mark.parametrize(("angle", "stiff"), [(0.0, 10.0), (np.pi / 2, 1.0)])
def test_waves_run_along_each_axis_at_its_own_speed(angle, stiff):
    """A front through a strip of plane stress with no Poisson's ratio: sqrt(E / rho)."""
    law = {"e1": 10.0, "e2": 1.0, "nu12": 0.0, "g12": 1.0, "angle": angle}
    speed = np.sqrt(stiff / 2.0)
    strip = block(
        orthotropic=law, cells="hexahedron", mesh_size=0.05, velocity=[-1e-3, 0.0],
        shape={"kind": "block", "size": [2.0, 0.05], "corner": [0.0, 0.0]},
        contact_surfaces=["left"],
    )  # fmt: skip
    wall = {"name": "wall", "kind": "half_space", "point": [0, 0], "normal": [1, 0]}
    probe = [{"name": "far", "body": "part", "point": [1.0, 0.0], "quantities": ["velocity"]}]
    solve = {"method": "galerkin", "courant": 1.0}
    given = scene(strip, obstacle=[wall], probe=probe, duration=1.6 / speed, solve=solve)
    assert given.solid.p_wave_speed == pytest.approx(np.sqrt(5.0), rel=1e-12)
    history = impactfem.solve(given).history
    moving = history["far.vx"].values
    arrival = history["time"].values[np.argmax(moving > -0.5e-3)]
    assert arrival * speed == pytest.approx(1.0, abs=0.06)


@pytest.mark.parallel(1)
@pytest.mark.parametrize("model", ["plane_stress", "plane_strain", "axisymmetric", "3d"])
def test_what_is_alike_in_all_directions_is_isotropic(model):
    """Stiffness, stress, and the speeds that steps follow, however it is turned."""
    turned = {"orientation": {"axis": AXIS, "angle": 0.7}} if model == "3d" else {"angle": 0.7}
    one = part_of(model, ALIKE | turned)
    same = {"youngs_modulus": 1.0, "poisson_ratio": 0.3}
    two = solids_model(scene(block(model, **same)), (1,)).parts[0]
    moved = np.random.default_rng(0).normal(size=len(one.system.displacement))
    energy = two.system.elastic_energy(moved)
    assert one.system.elastic_energy(moved) == pytest.approx(energy, rel=1e-12)
    fields = (part.system.fields.at(1e-3 * moved)["von_mises"] for part in (one, two))
    np.testing.assert_allclose(*fields, rtol=1e-10)
    assert one.solid.p_wave_speed == pytest.approx(two.solid.p_wave_speed, rel=1e-12)
    assert one.solid.youngs_modulus == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parallel(1)
def test_an_orientation_in_space_carries_the_axes():
    """Axis 1 along y, 2 along z, 3 along x: moduli as they stand there."""
    third = {"quaternion": [0.5, 0.5, 0.5, 0.5]}
    solid = part_of("3d", WOOD | {"orientation": third}).solid
    own = np.linalg.inv(solid.orthotropic.stiffness)
    known = [1 / 0.6, 1 / 10.0, 1 / 1.0, 1 / 0.5, 1 / 0.8, 1 / 0.2]
    np.testing.assert_allclose(np.diag(own), known, rtol=1e-12)


@pytest.mark.parallel(1)
def test_groups_may_be_orthotropic_beside_rubber(tmp_path):
    """The rubber keeps its volume in the mean, as beside a group that is isotropic."""
    (tmp_path / "two.geo").write_text(TWO)
    rubber, energies = {"youngs_modulus": 0.1, "poisson_ratio": 0.49}, []
    for law in ({"orthotropic": ALIKE | {"angle": TURN}},
                {"youngs_modulus": 1.0, "poisson_ratio": 0.3}):  # fmt: skip
        given = block(
            "plane_strain", mesh=str(tmp_path / "two.geo"),
            materials={"wood": law, "rubber": rubber},
        )  # fmt: skip
        given = {key: value for key, value in given.items() if key not in {"shape", "mesh_size"}}
        part = solids_model(scene(given), (1,)).parts[0]
        moved = np.random.default_rng(1).normal(size=len(part.system.displacement))
        energies.append(part.system.elastic_energy(moved))
        assert part.foreseen.fastest.p_wave_speed == pytest.approx(0.820, abs=1e-3)
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)


TWO = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 1, 1}; Rectangle(2) = {1, 0, 0, 1, 1}; Coherence;
Transfinite Curve {:} = 3; Transfinite Surface {1, 2}; Recombine Surface {1, 2};
Physical Surface("wood") = {1}; Physical Surface("rubber") = {2};
"""


@pytest.mark.parallel(1)
def test_stress_at_a_probe_is_that_of_the_law():
    stretch = [{"surface": "left", "kind": "fixed"}]
    given = block(
        "plane_strain", orthotropic=WOOD | {"angle": TURN}, supports=stretch,
        displacement=["1e-3*x", "2e-4*x"],
    )  # fmt: skip
    probe = [{"name": "in", "body": "part", "point": [1.0, 0.5], "quantities": ["stress"]}]
    history = impactfem.solve(scene(given, probe=probe, duration=1e-3)).history
    solid = scene(given).solid
    known = solid.orthotropic.stiffness[:4] @ [1e-3, 0.0, 0.0, 2e-4, 0.0, 0.0]
    found = [history[f"in.{name}"].values[0] for name in ("sxx", "syy", "szz", "sxy")]
    np.testing.assert_allclose(found, known, rtol=1e-10)


@pytest.mark.parallel([1, 2])
def test_ranks_agree(monkeypatch):
    """Ranks that share a body and ranks that each have all of it."""

    def energy():
        part = part_of("3d", WOOD | {"orientation": {"axis": AXIS, "angle": 1.0}})
        return part.system.elastic_energy(np.sin(3.0 * part.system.positions).ravel())

    shared = energy()
    own = SimpleNamespace(COMM_WORLD=MPI.COMM_SELF, MAX=MPI.MAX, SUM=MPI.SUM)
    with monkeypatch.context() as patch:
        patch.setattr(models, "MPI", own)
        forget()
        whole = energy()
    forget()
    parallel_assert(abs(shared - whole) <= 1e-12 * whole)


def forget():
    """Have the next model meshed anew."""
    models._model.cache_clear()
    models._parts.cache_clear()


@pytest.mark.parallel(1)
@pytest.mark.parametrize(
    ("law", "own", "words"),
    [
        (WOOD | {"nu12": 3.5}, {}, r"orthotropic.nu12 = 3.5 is no Poisson's ratio of e1 = 10"),
        (WOOD | {"nu12": 3.0, "nu23": 1.2}, {}, "orthotropic.nu12 = 3, nu13 = 0.3 and nu23 = 1.2"),
        ({"e1": 1.0, "e2": 1.0, "nu12": 0.1, "g12": 1.0}, {"model": "plane_strain"},
         'orthotropic.e3 is missing: model = "plane_strain"'),
        (WOOD, {"youngs_modulus": 1.0}, "youngs_modulus = 1.0 does not go with orthotropic"),
        (WOOD, {"material": "neo_hookean"}, 'material = "neo_hookean" is alike in all'),
        (WOOD | {"orientation": {"axis": AXIS, "angle": 1.0}}, {}, "orthotropic.orientation turns"),
        (WOOD | {"angle": 1.0, "orientation": {"angle": 1.0}}, {}, "angle = 1, and orientation"),
    ],
)  # fmt: skip
def test_what_is_no_material_is_refused_by_key(law, own, words):
    with pytest.raises(SceneError, match=words):
        scene(block(orthotropic=law, **own))
