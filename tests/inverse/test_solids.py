"""Gradients of solids by time steps: identities that any right one has, and what is refused."""

import numpy as np
import pytest
from pytest_mpi import parallel_assert

import impactfem
from impactfem import Scene, SceneError
from impactfem.inverse.steps import Changes
from impactfem.inverse.varied import Varied

PLAIN = {"report": False, "pictures": False, "fields": []}
SHAPE = {"kind": "disc", "radius": 0.05, "center": [0.0, 0.052]}
DISC = {
    "kind": "solid",
    "name": "disc",
    "model": "plane_strain",
    "shape": SHAPE,
    "mesh_size": 0.016,
    "density": 1100.0,
    "youngs_modulus": 1.5e6,
    "poisson_ratio": 0.3,
}
FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
VARIED = {"v": "body.disc.velocity.1", "E": "body.disc.youngs_modulus", "rho": "body.disc.density"}


def thrown(*names, of="rebound_speed.disc", body=(), solve=(), **more):
    """A disc thrown at a rigid plane, with some of its numbers as parameters."""
    return Scene.from_dict({
        "title": "thrown", "duration": 0.012,
        "body": [DISC | {"velocity": [0.0, -1.003]} | dict(body)], "obstacle": [FLOOR],
        "parameter": [{"name": name, "key": VARIED[name]} for name in names],
        "measure": [{"name": "told", "of": of}],
        "objective": {"minimise": [{"term": "value", "of": "told"}]},
        "solve": {"method": "massless", "dt": 2e-4} | dict(solve), "output": PLAIN,
    } | more)  # fmt: skip


def test_speeds_are_homogeneous_in_those_of_waves_and_of_the_throw():
    # Steps know E and density by E/density only; J(a v, a c) = a J but for the length of steps.
    found = impactfem.gradient(thrown("v", "E", "rho"))
    slope = found.gradient
    assert found.check.rate == pytest.approx(2.0, abs=0.1)
    assert found.trusted
    by_modulus = 1.5e6 * slope["E"]
    assert 1100.0 * slope["rho"] == pytest.approx(-by_modulus, abs=1e-10)
    euler = 2.0 * by_modulus - 1.003 * slope["v"]
    assert euler == pytest.approx(found.objective, rel=0.04)  # of steps of .2 ms


def test_a_contact_that_lasts_has_no_rebound():
    with pytest.raises(SceneError, match=r"rebound_speed.disc.*yet where it ends.*duration"):
        impactfem.gradient(thrown("v", duration=0.006))


@pytest.mark.parametrize("method", ["galerkin", "moreau_jean"])
def test_methods_with_mass_on_contact_nodes_have_no_gradient(method):
    with pytest.raises(SceneError, match=r'no derivatives that are right.*"massless"'):
        impactfem.gradient(thrown("v", solve={"method": method, "dt": None}))


def shaped(shape, *keys, model="plane_strain", method="conserving", **body):
    """A body thrown at a plane, some numbers of which are parameters."""
    along = [0.0, 1.0, 0.0][: len(shape.get("center", "xy"))]
    return thrown(
        obstacle=[FLOOR | {"point": [0.0] * len(along), "normal": along}],
        body={"shape": shape, "model": model, "velocity": [0.0, -1.003], **body},
        parameter=[{"name": key.replace(".", "_"), "key": f"body.disc.{key}"} for key in keys],
        measure=[{"name": "told", "of": "disc.vy"},
                 {"name": "pushed", "of": "impulse.disc.floor", "at": 0.005},
                 {"name": "lasted", "of": "duration.disc.floor"}],
        objective={"minimise": [{"term": "vibration_energy"}, {"term": "mass", "body": "disc"},
                                {"term": "peak_force", "pair": "disc.floor"}]},
        solve={"method": method} | ({"dt": None} if method == "explicit" else {}),
    )  # fmt: skip


def is_that_of_runs(scene):
    """Whether steps backwards are differences of runs along one way in which all changes."""
    (slopes, known), varied = backwards(scene)
    way = np.random.default_rng(1).standard_normal(len(known)) * varied.scales
    ends = [varied.numbers(varied.start + sign * 1e-6 * way) for sign in (1.0, -1.0)]
    wanted = (ends[0] - ends[1]) / 2e-6
    room = 1e-6 * np.abs(wanted) + 1e-7 * np.abs(ends[0])
    return bool(known.all() and (np.abs(slopes @ way - wanted) <= room).all())


ALONG = {"e1": 2e6, "e2": 1e6, "e3": 1.2e6, "nu12": 0.2, "nu13": 0.25, "nu23": 0.3,
         "g12": 0.5e6, "g13": 0.4e6, "g23": 0.6e6}  # fmt: skip
WHOLE = {"youngs_modulus": None, "poisson_ratio": None, "orthotropic": ALONG}


@pytest.mark.parametrize("method", ["massless", "conserving", "explicit"])
def test_lengths_of_shapes_backwards(method):
    block = {"kind": "block", "size": [0.09, 0.05], "corner": [0.0, 0.014], "angle": 0.3}
    pressed = {"pressures": [{"surface": "top", "value": 900.0}], "rayleigh_stiffness": 1e-5}
    scene = shaped(block, "shape.size.0", "shape.size.1", "shape.angle", "thickness",
                   method=method, density="1100*(1 + 4*y)", **pressed)  # fmt: skip
    assert is_that_of_runs(scene)


@pytest.mark.parametrize(
    ("shape", "keys", "more"),
    [
        ({"kind": "ring", "radius": 0.05, "inner_radius": 0.03, "center": [0.0, 0.0513]},
         ("shape.radius", "shape.inner_radius"), {}),
        ({"kind": "cylinder", "radius": 0.05, "height": 0.04, "center": [0.0, 0.0013]},
         ("shape.radius", "shape.height"), {"model": "axisymmetric"}),
        ({"kind": "disc", "radius": 0.05, "center": [0.0, 0.0513]}, ("shape.radius",),
         {"poisson_ratio": 0.48, "degree": 2, "element": "mean_dilatation", "mesh_size": 0.03}),
        ({"kind": "disc", "radius": 0.05, "center": [0.0, 0.0513]},
         ("orthotropic.e1", "orthotropic.e3", "orthotropic.angle", "orthotropic.nu12", "density"),
         {"model": "plane_stress", **WHOLE, "orthotropic": ALONG | {"angle": 0.3}}),
        ({"kind": "sphere", "radius": 0.05, "center": [0.0, 0.0513]},
         ("orthotropic.e3", "orthotropic.g12", "shape.radius"), {"model": "axisymmetric", **WHOLE}),
        ({"kind": "sphere", "radius": 0.05, "center": [0.0, 0.0513, 0.0], "symmetry": ["x", "z"]},
         ("orthotropic.e1", "orthotropic.g23", "shape.radius"),
         {"model": "3d", "mesh_size": 0.03, "velocity": [0.0, -1.003, 0.0], **WHOLE}),
    ],
)  # fmt: skip
def test_shapes_and_directions_backwards(shape, keys, more):
    assert is_that_of_runs(shaped(shape, *keys, **more))


def test_meshes_of_files_are_moved_and_turned(tmp_path):
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addRectangle(-0.04, -0.02, 0.0, 0.08, 0.04)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(2, [1], 4, name="rubber")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.02)
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "part.msh"))
    finally:
        gmsh.finalize()
    body = {"shape": None, "mesh_size": None, "mesh": str(tmp_path / "part.msh"),
            "position": [0.0, 0.0322], "orientation": {"angle": 0.3}}  # fmt: skip
    keys = {"up": "body.disc.position.1", "turn": "body.disc.orientation.angle"}
    scene = thrown(
        body=body, parameter=[{"name": name, "key": key} for name, key in keys.items()]
        + [{"name": "floor", "key": "obstacle.floor.point.1", "bounds": [-0.05, 0.05]}],
        measure=[{"name": "told", "of": "impulse.disc.floor", "at": 0.005}],
        objective={"minimise": [{"term": "vibration_energy"}]},
        solve={"method": "conserving", "normals": "fixed"},
    )  # fmt: skip
    assert is_that_of_runs(scene)
    slopes = backwards(scene)[0][0]
    assert (np.abs(slopes[:, :2]) > 1e-3).all()
    assert slopes[:, 0] == pytest.approx(-slopes[:, 2], rel=1e-6)  # only the distance counts


@pytest.mark.parallel(2)
def test_a_body_of_twice_the_size_takes_twice_as_long():
    # Momentum and time scale by lengths: what a gradient by all of them and the step says of J.
    def scene(dt):
        made = shaped({"kind": "disc", "radius": 0.05, "center": [0.0, 0.0513]}, "shape.radius",
                      "shape.center.1").to_dict()  # fmt: skip
        made["measure"] = made["measure"][::2]  # the impulse is asked for at a time
        made["objective"] = {"minimise": [{"term": "peak_force", "pair": "disc.floor"}]}
        return Scene.from_dict(made | {"solve": {"method": "conserving", "dt": dt}})

    steps = {sign: Varied.of(scene(2e-4 * (1.0 + sign * 1e-5))) for sign in (-1, 0, 1)}
    (slopes, known), _ = backwards(scene(2e-4))
    low, q, high = (each.numbers(each.start) for each in steps.values())
    along = slopes @ np.array([0.05, 0.0513]) + (high - low) / 2e-5
    parallel_assert(bool(known.all()))
    parallel_assert(np.allclose(along, np.array([0.0, 1.0, 1.0]) * q, rtol=1e-4, atol=1e-5))


def test_slopes_of_wrinkles_are_doubted():
    # The rebound speed of a disc knows no radius, its impulse goes with the square of it.
    told = {}
    for of, at in (("impulse.disc.floor", 0.011), ("rebound_speed.disc", 0.012)):
        data = shaped({"kind": "disc", "radius": 0.05, "center": [0.0, 0.0513]}, "shape.radius",
                      ).to_dict()  # fmt: skip
        data["measure"] = [{"name": "told", "of": of, "at": at}]
        data["objective"] = {"minimise": [{"term": "value", "of": "told"}]}
        data["solve"] = {"method": "conserving", "dt": 2e-4}
        told[of] = impactfem.gradient(Scene.from_dict(data))
    good, wrinkled = told.values()
    assert good.trusted
    assert 0.05 * good.gradient["shape_radius"] == pytest.approx(2.0 * good.objective, rel=0.01)
    assert wrinkled.check.passed
    assert not wrinkled.trusted
    assert "change by (derivatives tell) objective" in wrinkled.doubts[0]


def test_shapes_keep_their_kind_and_elements():
    scene = thrown("v")
    runs = Varied.of(scene).runs
    ring = {"kind": "ring", "radius": 0.05, "inner_radius": 0.03, "center": [0.0, 0.052]}
    for changes, said in (
        ({"shape": ring}, "shape of disc: its kind, cuts and surfaces are disc"),
        ({"mesh_size": 0.017}, "mesh_size: gradients keep the elements of the start"),
    ):
        data = scene.to_dict()
        data["body"][0] |= changes
        with pytest.raises(SceneError, match=said):
            runs.ready(Scene.from_dict(data))


def driven(method, pieces=7):
    """The disc under a control of tractions; its plane, throw and material vary, and the control.

    Its stiffness is a profile of 20 pieces.
    """
    data = thrown("v", solve={"method": method}).to_dict()
    body = data["body"][0]
    body |= {"rayleigh_stiffness": 1e-5, "youngs_modulus": "1.5e6*(1 + profile)",
             "density": "1100*(1 + graded*y)"}  # fmt: skip
    body["tractions"] = [{"surface": "rim", "value": ["push", "2*push"]}]
    keys = {"y": "obstacle.floor.point.1", "nu": "body.disc.poisson_ratio",
            "thick": "body.disc.thickness"}  # fmt: skip
    data["parameter"] += [{"name": name, "key": key} for name, key in keys.items()]
    data["parameter"].append({"name": "graded", "start": 5.0})
    data["control"] = [
        {"name": "push", "pieces": pieces, "start": [100.0 * np.sin(k) for k in range(pieces)]},
        {"name": "profile", "along": "x", "until": 0.045, "pieces": 20, "start": 0.1},
    ]
    data["probe"] = [{"name": "tip", "body": "disc", "point": [0.0, 0.003],
                      "quantities": ["displacement", "velocity"]}]  # fmt: skip
    told = {"tip": ("tip.uy", 0.006), "rate": ("tip.vy", 0.0062),
            "strained": ("elastic_energy", 0.0052), "moved": ("kinetic_energy", 0.0053),
            "height": ("disc.y", 0.004), "force": ("force.disc.floor", 0.004),
            "pushed": ("impulse.disc.floor", 0.007)}  # fmt: skip
    data["measure"] += [{"name": n, "of": of, "at": at} for n, (of, at) in told.items()]
    data["measure"].append({"name": "lasted", "of": "duration.disc.floor"})
    terms = [{"term": "speed", "body": "disc"}, {"term": "effort", "of": "push"},
             {"term": "peak_force", "pair": "disc.floor"}, {"term": "vibration_energy"},
             {"term": "terminal_energy"}, {"term": "mass", "body": "disc"}]  # fmt: skip
    data["objective"] = {"minimise": terms}
    if method == "explicit":
        data["solve"].pop("dt")
    return Scene.from_dict(data)


def backwards(scene):
    """Derivatives by the steps backwards alone, and the scene that varies."""
    varied = Varied.of(scene)
    at, names = varied.start, tuple(each.name for each in varied.unknowns)
    changes = Changes(varied.at, at, np.abs(at) + 1e-2 * varied.scales, names)
    _, found, weak = varied.runs._backwards(changes, varied.quantities)
    assert found is not None
    assert not weak
    return found, varied


@pytest.mark.parametrize("method", ["massless", "conserving", "explicit"])
def test_steps_backwards_are_differences_of_runs(method):
    # Of all numbers along one direction in which all unknowns change; sets stay within the step.
    (slopes, known), varied = backwards(driven(method))
    assert known.all()
    way = np.random.default_rng(1).standard_normal(len(known)) * varied.scales
    way[1] *= 1e-3
    h = 1e-6
    ends = [varied.numbers(varied.start + sign * h * way) for sign in (1.0, -1.0)]
    wanted = (ends[0] - ends[1]) / (2.0 * h)
    # Runs round to some 1e-13 of their numbers, which h makes 1e-7.
    room = 1e-6 * np.abs(wanted) + 1e-7 * np.abs(ends[0])
    assert (np.abs(slopes @ way - wanted) <= room).all()


def test_a_probe_reads_another_point_of_a_body_that_begins_elsewhere():
    # Its place is that of t = 0: what it reads of a disc that spins and begins higher is lower.
    scene = thrown(
        body={"velocity": [0.0, 0.0], "angular_velocity": 2.0, "displacement": ["0", "h"]},
        parameter=[{"name": "h", "start": 0.01},
                   {"name": "w", "key": "body.disc.angular_velocity"}],
        measure=[{"name": "told", "of": "tip.vx", "at": 0.0}], duration=1e-3,
        probe=[{"name": "tip", "body": "disc", "point": [0.0, 0.08], "quantities": ["velocity"]}],
    )  # fmt: skip
    slope = impactfem.gradient(scene).gradient
    assert slope["h"] == pytest.approx(2.0, rel=1e-6)  # vx = -w (y - h - c)
    assert slope["w"] == pytest.approx(-0.018, rel=1e-6)


def relaxing(*times):
    """A law with a term for each time [s]."""
    terms = [{"modulus": 5e5, "time": time} for time in times]
    return {"viscoelastic": {"kind": "maxwell", "terms": terms}}


@pytest.mark.parametrize("times", [{}, {"a": [1e-3], "b": [5e-5, 8e-3]}])
def test_two_discs_backwards(times):
    disc = {name: value for name, value in DISC.items() if name != "shape"} | {"mesh_size": 0.02}
    place = {"a": [-0.0485, 0.0], "b": [0.05, 0.03]}
    bodies = [
        disc | {"name": name, "shape": SHAPE | {"center": at}, "velocity": [float(name == "a"), 0]}
        | (relaxing(*times[name]) if times else {})
        for name, at in place.items()
    ]  # fmt: skip
    (slopes, known), varied = backwards(Scene.from_dict({
        "title": "two", "duration": 0.012, "body": bodies,
        "parameter": [{"name": "vx", "key": "body.a.velocity.0"},
                      {"name": "vy", "key": "body.a.velocity.1"}],
        "measure": [{"name": "hit", "of": "b.vx"}, {"name": "x", "of": "b.x"},
                    {"name": "y", "of": "b.y"}, {"name": "s", "of": "core.sxx", "at": 0.0093}],
        "probe": [{"name": "core", "body": "b", "point": [0.05, 0.03], "quantities": ["stress"]}],
        "objective": {"minimise": [{"term": "speed", "body": "a"}]},
        "solve": {"method": "massless", "dt": 3e-4, "normals": "fixed"}, "output": PLAIN,
    }))  # fmt: skip
    assert known.all()
    for k in range(2):
        way = 1e-5 * np.eye(2)[k]
        wanted = varied.numbers(varied.start + way) - varied.numbers(varied.start - way)
        np.testing.assert_allclose(slopes[:, k], wanted / 2e-5, rtol=1e-6, atol=1e-8)


@pytest.mark.parallel([1, 2])
def test_a_strained_disc_that_relaxes_backwards():
    # A term far shorter than a step, and one that lasts; loads move what has no mass, too.
    told = {"pushed": "impulse.disc.floor", "e": "elastic_energy"}
    scene = thrown(
        body=relaxing(5e-5, 8e-3) | {
            "velocity": [0.0, -1.003],
            "displacement": ["0.01*bulge*x", "0.02*bulge*y"], "rayleigh_stiffness": 1e-5,
            "tractions": [{"surface": "rim", "value": ["push", "0.3*push"]}]},
        control=[{"name": "push", "pieces": 3, "start": 500.0}],
        measure=[{"name": name, "of": of, "at": 0.0071} for name, of in told.items()],
        objective={"minimise": [{"term": "vibration_energy"}, {"term": "peak_force",
                                "pair": "disc.floor"}]},
        parameter=[{"name": "v", "key": VARIED["v"]}, {"name": "bulge", "start": 0.3}],
        solve={"method": "conserving"}, duration=0.008,
    )  # fmt: skip
    parallel_assert(is_that_of_runs(scene))


def tailed(duration, start=1.0, **more):
    """Half of a strip of a profile before a heavy tail, thrown at a wall by its light end.

    Its thickness is a factor of density and stiffness.
    """
    profile = "(where(x < 0.16, profile, 3))"
    shape = {"kind": "block", "size": [0.2, 0.01], "corner": [0.0003, 0.0], "symmetry": ["y"]}
    return Scene.from_dict({
        "title": "tailed", "duration": duration,
        "body": [{"kind": "solid", "name": "strip", "model": "plane_stress", "shape": shape,
                  "mesh_size": 0.008, "cells": "hexahedron", "thickness": 0.01,
                  "density": f"1100*{profile}", "youngs_modulus": f"1.5e6*{profile}",
                  "poisson_ratio": 0.3, "velocity": [-0.5, 0.0]}],
        "obstacle": [FLOOR | {"normal": [1.0, 0.0]}],
        "control": [{"name": "profile", "along": "x", "until": 0.16, "pieces": 20, "start": start,
                     "bounds": [0.2, 3.0]}],
        "objective": {"minimise": [{"term": "vibration_energy"}]} | more,
        "solve": {"method": "massless", "dt": 1.3e-4}, "output": PLAIN,
    })  # fmt: skip


@pytest.mark.parallel([1, 2])
def test_a_profile_of_twenty_pieces_backwards(monkeypatch):
    from impactfem.marching import reversed_march

    monkeypatch.setattr(reversed_march, "_IN_MEMORY", 0)  # states go to a file
    mass = {"minimise": [{"term": "vibration_energy"}, {"term": "mass", "body": "strip"}]}
    (slopes, known), varied = backwards(tailed(0.004, (1.0 + 0.3 * np.sin(range(20))), **mass))
    parallel_assert(bool(known.all()))
    way = np.random.default_rng(1).standard_normal(20)
    ends = [varied.numbers(varied.start + sign * 1e-6 * way) for sign in (1.0, -1.0)]
    wanted = (ends[0] - ends[1]) / 2e-6
    room = 1e-6 * np.abs(wanted) + 1e-7 * np.abs(ends[0])
    parallel_assert(bool((np.abs(slopes @ way - wanted) <= room).all()))


@pytest.mark.slow
def test_a_strip_that_keeps_less_vibration_at_the_same_mass():
    mass = 1100.0 * 0.01 * 0.01 * (0.16 + 3 * 0.04)  # as it is
    limits = {"constraints": [{"term": "mass", "body": "strip", "max": mass}]}
    scene = tailed(0.015, max_iterations=4, solver="slsqp", **limits)
    found = impactfem.optimise(scene).as_dict()
    assert found["constraints"][0] <= mass * (1.0 + 1e-6)
    assert found["objective"]["final"] < 0.4 * found["objective"]["initial"]


def test_a_modulus_that_varies_takes_steps_without_a_limit_by_waves():
    free = {"method": None, "dt": None}
    varied = {name: Varied.of(thrown(name, solve=free)).chosen.method for name in ("v", "E")}
    assert varied == {"v": "explicit", "E": "massless"}
    course = [{"name": "course", "along": "x", "until": 0.05, "pieces": 3, "start": 0.1}]
    graded = {"youngs_modulus": "1.5e6*(1 + course)"}
    scene = thrown("v", solve=free, control=course, body=graded)
    assert Varied.of(scene).chosen.method == "massless"


def test_the_speed_of_a_body_at_rest_has_a_kink_that_is_told():
    control = {"name": "push", "acts": "body.disc.traction.rim.x", "pieces": 3, "until": 5e-4}
    fastest = {"minimise": [{"term": "speed", "body": "disc", "at": 5e-4, "weight": -1.0}]}
    resting = {"velocity": [0.0, 0.0]}
    scene = thrown(body=resting, control=[control], objective=fastest, measure=[], duration=1e-3)
    found = impactfem.gradient(scene)
    assert not found.trusted
    assert found.check.rate == pytest.approx(1.0, abs=0.1)
    assert set(found.gradient.values()) == {0.0}
