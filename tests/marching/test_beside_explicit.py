"""Bodies beside solids in explicit steps: laws, energy, order, joints, restart, ranks."""

import numpy as np
import pytest
from moving_scenes import check_ranks, check_restart

import impactfem
from impactfem import Scene, SceneError

FLOOR = {"kind": "half_space", "name": "floor", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
SOLID = {
    "kind": "solid", "name": "s", "model": "plane_strain", "strain": "small", "density": 1100.0,
    "youngs_modulus": 1e6, "poisson_ratio": 0.3, "mesh_size": 0.025,
    "shape": {"kind": "block", "size": [0.1, 0.1], "corner": [0.0, 0.0]},
    "supports": [{"surface": "bottom", "kind": "fixed"}],
}  # fmt: skip
POINT = {
    "kind": "point", "name": "b", "mass": 0.1, "radius": 0.01, "position": [0.05, 0.1105],
    "velocity": [0.0, -0.5],
}  # fmt: skip
DISC = {
    "kind": "rigid", "name": "b", "mass": 0.05, "velocity": [0.5, -0.3], "angular_velocity": 5.0,
    "shape": {"kind": "disc", "radius": 0.02, "center": [0.03, 0.1201]},
}  # fmt: skip
BOX = {
    "kind": "rigid", "name": "b", "density": 1000.0, "velocity": [0.0, -0.5],
    "shape": {"kind": "block", "size": [0.04, 0.04], "corner": [0.03, 0.1005]},
}  # fmt: skip
AWAY = {
    "kind": "rigid", "name": "b", "mass": 1.0, "velocity": [1.0, -1.0],
    "shape": {"kind": "disc", "radius": 0.02, "center": [-0.3, 0.0205]},
}  # fmt: skip


FINITE = {"strain": "finite", "material": "neo_hookean"}


@pytest.fixture(params=["small", "finite"])
def solid(request):
    return solid_of(request.param)


def solid_of(strain):
    return SOLID | (FINITE if strain == "finite" else {})


def scene(bodies, law=(), duration=4e-3, dt=2e-5, gravity=(0.0, 0.0), method="explicit", **more):
    return Scene.from_dict(
        {
            "title": "beside explicit", "duration": duration, "gravity": list(gravity),
            "body": list(bodies), "obstacle": [FLOOR], "contact": list(law),
            "solve": {"dt": dt, "estimate": False, "method": method}, "output": {"fields": []},
        } | more
    )  # fmt: skip


def run(*given, **more):
    return impactfem.solve(scene(*given, **more)).history


@pytest.mark.slow
def test_static_friction_holds_a_body_on_a_slope_of_rubber_or_lets_it_slide():
    """mu_s holds it from rest; where it is too small it rattles down as in implicit steps."""
    g = 9.81 * np.array([np.sin(0.5), -np.cos(0.5)])
    lies = BOX | {"velocity": [0.0, 0.0], "shape": {"kind": "block", "size": [0.04, 0.04],
                                                    "corner": [0.03, 0.1]}}  # fmt: skip
    ended = []
    for static, start, method in (
        (0.8, "static", "explicit"), (0.4, "given", "explicit"), (0.4, "given", "conserving")
    ):  # fmt: skip
        of = {"between": ["b", "s"], "friction_coefficient": 0.3,
              "static_friction_coefficient": static}  # fmt: skip
        found = run(
            [solid_of("finite") | {"youngs_modulus": 1e7}, lies], [of], duration=0.01, dt=5e-5,
            gravity=g.tolist(), start=start, method=method,
        )  # fmt: skip
        ended.append([found[f"b.{name}"].values[-1] for name in ("vx", "vy")])
    assert ended[0] == pytest.approx([0.0, 0.0], abs=1e-4)
    assert ended[1][0] > 0.01
    assert ended[1] == pytest.approx(ended[2], abs=2e-3)


def law(**more):
    return [{"between": ["b", "floor"]} | more]


@pytest.mark.parametrize(
    ("of", "expected"),
    [
        ({"friction_coefficient": 0.1, "restitution": 0.5}, (0.85, 0.5, -0.15 / 0.01)),
        (
            {"friction_coefficient": 10.0, "restitution": 1.0, "tangential_restitution": 1.0},
            (1.0 / 3.0, 1.0, -2.0 / 3.0 / 0.01),
        ),
        ({"restitution": 0.5, "restitution_law": "poisson"}, (1.0, 0.5, 0.0)),
        ({"stiffness": 1e7}, (1.0, 1.0, 0.0)),
    ],
    ids=["slides", "superball", "poisson", "gives way"],
)
def test_laws_of_impact_are_those_of_rigid_bodies(of, expected, solid):
    """A disc strikes a floor: the spin takes the friction's moment, I = m r^2 / 2."""
    result = impactfem.solve(scene([solid, AWAY], law(**of)))
    found = result.history
    told = -result.summary["details"].get("energy_taken", {}).get("impacts", 0.0)
    speeds = [found[f"b.{name}"].values[-1] for name in ("vx", "vy")]
    assert speeds == pytest.approx(expected[:2], abs=1e-9)
    assert found["b.spin"].values[-1] == pytest.approx(expected[2], abs=1e-6)
    if "stiffness" in of:
        assert np.ptp(found["total_energy"].values) < 1e-12
    energy = found["total_energy"].values[-1] - found["total_energy"].values[0]
    told += found["friction_work"].values[-1] if "friction_work" in found else 0.0
    assert energy == pytest.approx(told, abs=1e-12)


def test_a_body_that_flies_and_falls_is_where_it_should_be(solid):
    """Places are those of levels; speeds too, or with small strains those of the layer before."""
    found = run([solid, AWAY | {"angular_velocity": 5.0}], gravity=(0.0, -9.81), duration=4e-4)
    t, finite = found["time"].values, solid["strain"] == "finite"
    np.testing.assert_allclose(found["b.x"].values, -0.3 + t, atol=1e-15)
    np.testing.assert_allclose(found["b.angle"].values, 5.0 * t, atol=1e-12)
    fallen = 0.0205 - t - 0.5 * 9.81 * t**2
    np.testing.assert_allclose(found["b.y"].values, fallen, atol=1e-15 if finite else 4e-9)
    speed = -1.0 - 9.81 * (t[1:] - (0.0 if finite else 1e-5))
    np.testing.assert_allclose(found["b.vy"].values[1:], speed, atol=1e-12)
    # Amid the first layer the body has fallen an eighth of g dt^2, not half of what it has after.
    energy = found["total_energy"].values[1:]
    assert np.ptp(energy) < (1e-8 if finite else 1e-12) * energy[0]


@pytest.mark.parametrize(
    ("body", "strain"),
    [(POINT, "small"), (BOX, "small"), (DISC, "small"), (BOX, "finite"), (DISC, "finite")],
    ids=["point", "box", "disc", "box on rubber", "disc on rubber"],
)
def test_impacts_on_solids_keep_energy_and_converge(body, strain):
    """Less the work of friction; what normals that turn do is told by energy at larger steps."""
    rough = [{"between": ["b", "s"], "friction_coefficient": 0.3}]
    speeds, drifts = [], []
    for dt in (1e-4, 5e-5, 2.5e-5, 1.25e-5):
        found = run([solid_of(strain), body], rough, duration=6e-3, dt=dt)
        kept = found["total_energy"].values - found["friction_work"].values
        drifts.append(np.ptp(kept) / kept[0])
        speeds.append([found[f"b.{name}"].values[-1] for name in ("vx", "vy")])
    if strain == "small":
        assert drifts[0] < 2e-3
        assert drifts[-1] < 2e-4
    else:  # of second order: the laws of levels keep no energy by themselves
        assert drifts[0] < 0.025  # the shortest contact lasts eight of these steps
        assert drifts[-1] < 3e-4
    changes = np.abs(np.diff(speeds, axis=0)).max(axis=1)
    assert changes[0] < 0.01
    assert changes[2] < 0.5 * changes[0]


@pytest.mark.slow
def test_fine_meshes_agree_with_implicit_steps(solid):
    """Both move the mass of contact nodes inwards; lumping makes the rest of the difference."""
    speeds = {
        how["method"]: [
            run([solid | {"mesh_size": h}, BOX], duration=6e-3, **how)["b.vy"].values[-1]
            for h in (0.025, 0.0125)
        ]
        for how in ({"method": "explicit"}, {"method": "conserving", "dt": 4e-5})
    }
    coarse, fine = np.abs(np.subtract(speeds["explicit"], speeds["conserving"]))
    assert coarse < 0.02
    assert fine < 0.5 * coarse


def test_joints_hold_bodies_beside(solid):
    """A hammer on a pin, and two points on a rod, strike a block."""
    hammer = BOX | {"velocity": [0.0, 0.0], "shape": {"kind": "disc", "radius": 0.02,
                                                      "center": [0.12, 0.14]}}  # fmt: skip
    pin = {"kind": "revolute", "name": "j", "between": ["b", "ground"], "point": [0.06, 0.14]}
    found = run(
        [solid, hammer], duration=0.08, dt=2e-4, gravity=(0.0, -9.81), joint=[pin],
        contact=[{"between": ["b", "s"], "friction_coefficient": 0.2}],
    )  # fmt: skip
    apart = np.hypot(found["b.x"].values - 0.06, found["b.y"].values - 0.14)
    assert np.abs(apart - 0.06).max() < 1e-5
    assert found["contact_force"].values.max() > 1.0
    kept = found["total_energy"].values - found["friction_work"].values
    assert np.ptp(kept) < 5e-3 * found["kinetic_energy"].values.max()


def beside(strain="small"):
    pin = {"kind": "distance", "name": "j", "between": ["c", "d"],
           "points": [[0.02, 0.1305], [0.08, 0.1305]]}  # fmt: skip
    two = [
        POINT | {"name": name, "position": [x, 0.1305]} for name, x in (("c", 0.02), ("d", 0.08))
    ]
    rough = [{"between": ["b", "s"], "friction_coefficient": 0.3},
             {"between": ["b", "floor"], "friction_coefficient": 0.3}]  # fmt: skip
    rough[0] |= (
        {"rolling_resistance": 1e-3} if strain == "small" else {"static_friction_coefficient": 0.6}
    )
    made = scene([solid_of(strain), DISC, *two], rough, duration=3e-3, dt=4e-5, joint=[pin])
    return made.with_settings({"output.checkpoint": 10})


@pytest.mark.parametrize("strain", ["small", "finite"])
def test_a_restarted_run_is_equal_to_the_last_bit(strain, tmp_path, monkeypatch):
    whole, _ = check_restart(beside(strain), 25, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values[20:].max() > 0.0


@pytest.mark.parallel(2)
@pytest.mark.parametrize("strain", ["small", "finite"])
def test_two_ranks_do_the_same(strain, monkeypatch):
    check_ranks(lambda: beside(strain), monkeypatch)


@pytest.mark.parametrize(
    ("bodies", "more", "says"),
    [
        (
            [{"kind": "bar", "name": "b", "length": 0.5, "youngs_modulus": 1e9, "density": 1e3,
              "area": 1e-4, "point": [0.05, 0.1005], "axis": [0.0, 1.0], "velocity": -0.5}],
            {}, r'body\[1\].kind = "bar": beside solids in explicit steps b has none',
        ),
        (
            [BOX | {"shape": DISC["shape"]}],
            {"contact": [{"between": ["s", "b"], "friction_coefficient": 0.1,
                          "rolling_resistance": 1e-3}]},
            r"contact\[0\].rolling_resistance = 0.001: forces of explicit steps",
        ),
    ],
)  # fmt: skip
def test_what_is_not_stepped_amid_layers_is_refused(bodies, more, says):
    strain = "finite" if more else "small"
    with pytest.raises(SceneError, match=says):
        scene([solid_of(strain), *bodies], **more)


def test_explicit_steps_want_a_solid():
    with pytest.raises(SceneError, match=r'solve.method = "explicit" does not solve'):
        scene([POINT, AWAY | {"name": "c"}])


def test_a_finite_solid_that_can_reach_nothing_stands_beside_bodies():
    """Contacts of parts without a node that may touch were asked for their first name."""
    floor = {"kind": "half_space", "name": "floor", "point": [0.0, -9.0], "normal": [0.0, 1.0]}
    flies = solid_of("finite") | {"supports": []}
    found = run([flies, AWAY], gravity=(0.0, -9.81), duration=4e-5, obstacle=[floor])
    assert np.isfinite(found["total_energy"].values).all()
