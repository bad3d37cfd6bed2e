"""Bodies that start at rest: closed forms, marches that stay so, motions that nothing holds."""

import numpy as np
import pytest
from moving_scenes import METHODS, check_restart

import impactfem
from impactfem.errors import SceneError
from impactfem.scene import Scene

FLOOR = {"name": "floor", "kind": "half_space", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
BLOCK = {"kind": "block", "size": [1.0, 0.5], "corner": [0.0, 0.0]}
DISC = {"kind": "disc", "radius": 0.5, "center": [0.0, 0.7]}
RHO, E, G = 1000.0, 1e7, 9.81
C = np.sqrt(E / RHO)
WEIGHT = RHO * G * 0.5  # of the block [N]


def scene(body, obstacles=(FLOOR,), gravity=(0.0, -G), duration=0.02, solve=None, **top):
    """A static start of one body or several."""
    keys = {
        "name": "block", "kind": "solid", "model": "plane_strain", "shape": BLOCK,
        "mesh_size": 0.125, "density": RHO, "youngs_modulus": E, "poisson_ratio": 0.3,
    }  # fmt: skip
    bodies = [keys | each for each in (body if isinstance(body, list) else [body])]
    return Scene.from_dict(
        {
            "title": "at rest", "duration": duration, "gravity": list(gravity), "start": "static",
            "body": bodies, "obstacle": [dict(each) for each in obstacles],
            "solve": {"method": "conserving", "estimate": False} | (solve or {}),
            "output": {"fields": []}, **top,
        }
    )  # fmt: skip


def column(result, name):
    return result.history[name].values


def told(result, subject):
    findings = result.summary["verdict"]["findings"]
    return [f for f in findings if f["code"] == "setting" and f["subject"] == subject]


@pytest.mark.parametrize("method", METHODS)
def test_a_block_on_a_floor_stays_at_rest(method):
    settings = {"method": method, "courant": 0.5}
    coarse, duration = {"mesh_size": 0.25}, 300 * 0.5 * 0.25 / C
    result = impactfem.solve(scene(coarse, duration=duration, solve=settings))
    assert result.summary["num_steps"] >= 300
    force, elastic = column(result, "contact_force"), column(result, "elastic_energy")
    np.testing.assert_allclose(force, WEIGHT, rtol=1e-9)
    assert column(result, "kinetic_energy").max() < 1e-18 * elastic[0]
    assert np.ptp(column(result, "total_energy")) < 1e-9 * elastic[0]
    assert np.abs(column(result, "gap")).max() < 1e-13
    start = result.summary["details"]["start"]
    assert start["kind"] == "static"
    assert start["residual"] < 1e-11
    assert start["passes"] <= 3
    assert start["contact_force"] == pytest.approx(WEIGHT, rel=1e-10)


@pytest.mark.parametrize("method", ["conserving", "explicit", "moreau_jean"])
def test_a_column_under_its_own_weight(method):
    tall = {"kind": "block", "size": [0.1, 1.0], "corner": [0.0, 0.0]}
    body = {"shape": tall, "mesh_size": 0.05, "poisson_ratio": 0.0}
    probe = {"name": "top", "body": "block", "point": [0.05, 1.0]}
    case = scene(body, solve={"method": method}, duration=1e-3, probe=[probe])
    result = impactfem.solve(case)
    sunk = RHO * G / (2.0 * E)
    # Weights of massless nodes act at their neighbours, one element further up.
    assert column(result, "top.uy")[0] == pytest.approx(-sunk, rel=0.05**2 + 1e-9)
    assert column(result, "elastic_energy")[0] == pytest.approx(
        0.1 * (RHO * G) ** 2 / (6.0 * E), rel=3.0 * 0.05
    )


def test_a_cantilever_bends_under_gravity():
    length, height = 2.0, 0.1
    beam = {"kind": "block", "size": [length, height], "corner": [0.0, 1.0]}
    held = [{"surface": "left", "kind": "fixed"}]
    body = {"shape": beam, "mesh_size": 0.1, "degree": 2, "poisson_ratio": 0.0, "supports": held}
    tip = {"name": "tip", "body": "block", "point": [length, 1.05]}
    soft = body | {"youngs_modulus": 1e9}
    result = impactfem.solve(scene(soft, duration=1e-3, probe=[tip]))
    bent = RHO * G * height * length**4 / (8.0 * 1e9 * height**3 / 12.0)
    sheared = 1.2 * RHO * G * length**2 / (2.0 * 0.5e9)
    assert column(result, "tip.uy")[0] == pytest.approx(-(bent + sheared), rel=3e-3)
    assert column(result, "tip.uy")[-1] == pytest.approx(column(result, "tip.uy")[0], rel=1e-9)
    assert column(result, "contact_force").max() == 0.0


def test_pressure_on_a_block_is_a_patch_test():
    body = {"poisson_ratio": 0.0, "pressures": [{"surface": "top", "value": "2e4"}]}
    probes = [{"name": "p", "body": "block", "point": [0.3, 0.4]}]
    result = impactfem.solve(scene(body, gravity=(0.0, 0.0), duration=1e-3, probe=probes))
    assert column(result, "p.uy")[0] == pytest.approx(-0.4 * 2e4 / E, rel=1e-10)
    assert column(result, "contact_force") == pytest.approx(2e4, rel=1e-10)
    assert column(result, "elastic_energy")[0] == pytest.approx(0.5 * 2e4**2 * 0.5 / E, rel=1e-10)


@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize(
    ("method", "strain"),
    [("conserving", "small"), ("moreau_jean", "small"), ("conserving", "finite")],
)
def test_a_block_pressed_on_a_layer_that_gives_way(method, strain, exponent):
    """Block and layer in series: p h / E + d with p = k d^m; under finite strain nearly so."""
    body = {
        "mesh_size": 0.25, "poisson_ratio": 0.0, "contact_surfaces": ["bottom"], "strain": strain,
        "pressures": [{"surface": "top", "value": "2e4"}],
    }  # fmt: skip
    law = {"between": ["block", "floor"], "stiffness": 3e8, "stiffness_exponent": exponent}
    probe = [{"name": "p", "body": "block", "point": [0.5, 0.5]}]
    result = impactfem.solve(
        scene(
            body, gravity=(0.0, 0.0), duration=4e-3, solve={"method": method, "dt": 5e-4},
            contact=[law], probe=probe,
        )
    )  # fmt: skip
    dent = (2e4 / 3e8) ** (1.0 / exponent)
    sunk = dent + 0.5 * 2e4 / E
    place, force = column(result, "p.uy"), column(result, "contact_force")
    assert place[0] == pytest.approx(-sunk, rel=1e-9 if strain == "small" else 5e-3)
    assert force == pytest.approx(2e4, rel=1e-9)
    assert np.ptp(place) < 1e-9 * sunk
    assert column(result, "indentation")[0] == pytest.approx(dent, rel=1e-8)
    assert np.abs(column(result, "gap")).max() < 1e-8 * sunk
    elastic = column(result, "elastic_energy")[0]
    assert np.ptp(column(result, "total_energy")) < 1e-9 * elastic


def test_a_moved_support_presses_a_block():
    lid = [{"surface": "top", "kind": "motion", "value": ["", "-0.001 - 0.01*t"]}]
    body = {"poisson_ratio": 0.0, "supports": lid}
    result = impactfem.solve(scene(body, gravity=(0.0, 0.0), duration=1e-3))
    assert column(result, "contact_force")[0] == pytest.approx(E * 0.001 / 0.5, rel=1e-10)


def test_a_disc_pressed_on_a_floor_against_hertz():
    half = DISC | {"center": [0.0, 0.5], "symmetry": ["x"]}
    refined = [{"point": [0.0, 0.0], "radius": 0.1, "size": 0.01}]
    body = {"shape": half, "mesh_size": 0.06, "refine": refined, "youngs_modulus": 1e6}
    result = impactfem.solve(scene(body, gravity=(0.0, -1.0), duration=1e-3))
    weight = RHO * np.pi * 0.25
    force = column(result, "contact_force")
    assert force == pytest.approx(weight, rel=2e-3)  # of the whole disc, less its facets
    assert result.summary["details"]["symmetry_factor"] == 2
    assert result.summary["details"]["start"]["contact_force"] == pytest.approx(force[0])
    # The deepest node goes down by the approach of a line contact, a few elements wide.
    half_width = np.sqrt(4.0 * force[0] * 0.5 * (1.0 - 0.09) / (np.pi * 1e6))
    touching = column(result, "active")[0]
    assert touching == pytest.approx(half_width / 0.01, abs=1.5)


@pytest.mark.parametrize(
    ("settings", "contacts"),
    [({}, []), ({"method": "explicit"}, []), ({"normals": "updated"}, []), ({}, [0.3])],
    ids=["fixed", "explicit", "following", "rubbing"],
)
def test_a_stack_of_two(settings, contacts):
    top = {"kind": "block", "size": [0.5, 0.25], "corner": [0.2, 0.5]}
    bodies = [{"name": "low"}, {"name": "top", "shape": top, "mesh_size": 0.1}]
    laws = [{"between": ["low", "top"], "friction_coefficient": mu} for mu in contacts]
    laws += [{"between": ["low", "floor"]} for _ in contacts]
    result = impactfem.solve(scene(bodies, solve=settings, contact=laws))
    upper = RHO * G * 0.125
    within = 1e-7 if "normals" in settings else 1e-9
    np.testing.assert_allclose(column(result, "force.low.floor"), WEIGHT + upper, rtol=within)
    np.testing.assert_allclose(column(result, "force.low.top"), upper, rtol=within)
    kinetic, elastic = column(result, "kinetic_energy"), column(result, "elastic_energy")
    # Where normals follow, the upper block slides on what sags under it, which no friction holds.
    assert kinetic.max() < (1e-8 if "normals" in settings else 1e-18) * elastic[0]


def test_a_ball_in_space_and_about_its_axis():
    ball = {"kind": "sphere", "radius": 0.5, "center": [0.0, 0.5]}
    axial = {"model": "axisymmetric", "shape": ball}
    result = impactfem.solve(scene(axial))
    mass = result.summary["bodies"]["block"]["mass"]
    np.testing.assert_allclose(column(result, "contact_force"), mass * G, rtol=1e-9)
    cube = {"kind": "block", "size": [1.0, 0.5, 1.0], "corner": [0.0, 0.0, 0.0]}
    floor = FLOOR | {"point": [0.0, 0.0, 0.0], "normal": [0.0, 1.0, 0.0]}
    body = {"model": "3d", "shape": cube, "mesh_size": 0.25}
    result = impactfem.solve(scene(body, [floor], (0.0, -G, 0.0)))
    np.testing.assert_allclose(column(result, "contact_force"), WEIGHT, rtol=1e-9)
    assert column(result, "kinetic_energy").max() < 1e-18 * column(result, "elastic_energy")[0]


def test_a_disc_that_turns_is_stretched():
    rate = 0.05 * np.sqrt(E / RHO)
    body = {"shape": DISC, "mesh_size": 0.05, "degree": 2, "angular_velocity": rate}
    probes = [{"name": "r", "body": "block", "point": [0.49999, 0.7]}]
    far = FLOOR | {"point": [0.0, -50.0]}
    result = impactfem.solve(scene(body, [far], (0.0, 0.0), 1e-5, probe=probes, solve={"dt": 1e-6}))
    stretch = RHO * rate**2 * 0.25 * 1.3 * 0.4 / (4.0 * E)
    assert column(result, "r.ux")[0] == pytest.approx(0.5 * stretch, rel=5e-3)
    assert column(result, "block.spin")[0] == pytest.approx(rate)


@pytest.mark.parallel([1, 2])
def test_the_start_is_the_same_after_a_restart(tmp_path, monkeypatch):
    bodies = [{"name": "low"}, {"name": "top", "shape": BLOCK | {"corner": [0.2, 0.5]}}]
    bodies[0]["tractions"] = [{"surface": "right", "value": ["-100*t", "0"]}]
    output = {"fields": ["vtkhdf"], "every": 3, "checkpoint": 5}
    case = scene(bodies, output=output)
    whole, again = check_restart(case, 10, tmp_path, monkeypatch)
    assert again.summary["details"]["start"] == whole.summary["details"]["start"]
    if whole.fields is None:  # they are on rank 0
        return
    # Fields of t = 0 show the bodies as they are then.
    first = whole.fields.read(0)
    assert first["displacement"][:, 1].min() < -0.25 * RHO * G / E
    assert first["contact_pressure"].max() > 0.0


@pytest.mark.parametrize(
    ("body", "obstacles", "gravity", "words"),
    [
        ({}, [FLOOR | {"normal": [np.sin(0.3), np.cos(0.3)]}], (0.0, -G),
         "body block against its translation along (0.96, -0.3), driven by 1450 N"),
        ({}, [FLOOR | {"point": [0.0, -1.0]}], (0.0, G), "translation along y, driven by 4905 N"),
        ({"tractions": [{"surface": "top", "value": ["100", "0"]}]}, [FLOOR], (0.0, -G),
         "translation along x, driven by 100 N"),
        ({"supports": [{"surface": "left", "kind": "motion", "value": ["", "0"]}],
          "tractions": [{"surface": "top", "value": ["2000", "0"]}]}, [FLOOR], (0.0, 0.0),
         "translation along x, driven by 2000 N"),
        ({"tractions": [{"surface": "top", "value": ["100", "0"]},
                        {"surface": "bottom", "value": ["-100", "0"]}]},
         [FLOOR | {"point": [0.0, -1.0], "normal": [0.6, 0.8]}], (0.0, 0.0), "driven by"),
        ({"model": "axisymmetric", "shape": DISC | {"kind": "sphere"}},
         [FLOOR | {"point": [0.0, -1.0]}], (0.0, 1.0), "translation along y, driven by 5"),
        ({"angular_velocity": 1.0, "supports": [{"surface": "left", "kind": "fixed"}]},
         [FLOOR], (0.0, 0.0), "needs a body that is free to turn so"),
    ],
    ids=["slope", "lifted", "pushed", "guided", "twisted", "axial", "held"],
)  # fmt: skip
def test_motions_that_nothing_holds_are_named(body, obstacles, gravity, words):
    with pytest.raises(SceneError) as refused:
        impactfem.solve(scene(body, obstacles, gravity))
    assert words in str(refused.value)
    assert 'start = "given"' in str(refused.value)


@pytest.mark.parametrize(("slope", "expected"), [(4e-4, 1), (4e-6, 0)])
def test_small_forces_on_free_motions_are_told_and_left(slope, expected):
    result = impactfem.solve(scene({}, [FLOOR | {"normal": [slope, 1.0]}]))
    found = told(result, "block")
    assert len(found) == expected
    assert all("translation along x" in finding["text"] for finding in found)
    pulled = WEIGHT * slope * column(result, "time")[-1]
    assert column(result, "momentum.x")[-1] == pytest.approx(pulled, rel=1e-3)


@pytest.mark.parametrize(("gap", "expected"), [(0.04, 1), (0.004, 0)])
def test_bodies_that_had_to_be_moved_are_told(gap, expected):
    result = impactfem.solve(scene({"shape": BLOCK | {"corner": [0.0, gap]}}))
    assert len(told(result, "block")) == expected
    assert result.summary["details"]["start"]["shifted"]["block"] == pytest.approx(gap, rel=0.05)
    np.testing.assert_allclose(column(result, "contact_force"), WEIGHT, rtol=1e-8)
    # The potential is 0 where the body begins to touch, wherever it was put.
    sunk = 2.0 * column(result, "elastic_energy")[0]
    assert column(result, "potential_energy")[0] == pytest.approx(-sunk, rel=0.1)


def test_a_body_that_tilts_begins_tilted():
    slope = FLOOR | {"normal": [-0.02, 1.0]}
    wall = {"name": "wall", "kind": "half_space", "point": [-0.001, 0.0], "normal": [1.0, 0.0]}
    shape = BLOCK | {"corner": [0.0, 0.02]}
    held = impactfem.solve(scene({"shape": shape}, [slope, wall]))
    assert column(held, "block.angle")[0] == pytest.approx(0.02, rel=0.02)
    assert column(held, "block.angle")[-1] == pytest.approx(column(held, "block.angle")[0])


def test_the_error_of_a_body_at_rest_is_that_of_its_rest():
    # Of the way since t = 0, which is rounding, every error would be all of it.
    body = {"mesh_size": 0.04, "poisson_ratio": 0.0}
    result = impactfem.solve(scene(body, solve={"estimate": True}, duration=5e-3))
    sunk = RHO * G * 0.5**2 / (3.0 * E)  # of the centre of mass
    moved = result.summary["details"]["start"]["moved"]["block"]
    assert moved[1] == pytest.approx(-sunk, rel=0.02)
    assert result.summary["error"]["displacement_max"] < 0.03
    assert result.summary["verdict"]["level"] == "trust"


def test_a_start_beyond_the_limits_of_the_model_is_not_trusted():
    result = impactfem.solve(scene({"youngs_modulus": 1.2e4}, duration=0.05))
    codes = {f["code"]: f for f in result.summary["verdict"]["findings"]}
    assert codes["model_strain"]["severity"] == "fault"


def test_other_bodies_are_refused(monkeypatch):
    monkeypatch.setattr(impactfem.bodies.Bar, "settles", False)  # as of kinds that are registered
    bar = {"kind": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0, "gap": 0.5}
    table = {
        "title": "no", "duration": 1.0, "start": "static", "body": [{"name": "b"} | bar],
        "obstacle": [{"name": "wall", "kind": "wall"}],
    }  # fmt: skip
    says = "brings bodies of kind solid and point and rod and beam and rigid and mechanism and "
    says += "springs and plate to rest"
    table["body"].append({**table["body"][0], "name": "c", "gap": 2.0})
    with pytest.raises(SceneError, match=f'start = "static" {says}, b is a bar: remove it'):
        Scene.from_dict(table)
