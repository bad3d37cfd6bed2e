"""Mechanisms beside bodies under finite strain: as rigid bodies, what stays, statics, restarts."""

from pathlib import Path

import numpy as np
import pytest
from moving_scenes import alone, check_restart, differences

pytest.importorskip("pinocchio")

import impactfem
from impactfem import Scene

pytestmark = pytest.mark.slow

G = 9.81
SHAPE = {"kind": "block", "size": [0.2, 0.2, 0.1], "corner": [-0.1, -0.1, -0.1]}
HELD = {"supports": [{"surface": "bottom", "kind": "fixed"}]}
FALLS = {"orientation": {"axis": [1.0, 2.0, 0.5], "angle": 0.8}, "velocity": [0.5, 0.0, -2.0]}


def pad(strain: str = "finite", **more: object) -> dict:
    """A rubber block whose top is at 0."""
    law = {"material": "neo_hookean"} if strain == "finite" else {}
    return {
        "kind": "solid", "name": "pad", "model": "3d", "shape": SHAPE, "mesh_size": 0.05,
        "density": 1100.0, "youngs_modulus": 1e6, "poisson_ratio": 0.3, "strain": strain,
    } | law | more  # fmt: skip


def robot(*parts: str) -> str:
    return f'<robot name="r" version="1.2">{"".join(parts)}</robot>'


def link(name: str, shape: str, inertia: float, at: str = "0 0 0", mass: float = 0.5) -> str:
    moments = f'ixx="{inertia}" iyy="{inertia}" izz="{inertia}" ixy="0" ixz="0" iyz="0"'
    whole = f'<inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia {moments}/></inertial>'
    touching = f'<collision><origin xyz="{at}"/><geometry>{shape}</geometry></collision>'
    return f'<link name="{name}">{whole}{touching}</link>'


def joint(name: str, kind: str, one: str, two: str, axis: str, at: str = "0 0 0") -> str:
    limits = '<limit lower="-2" upper="2" effort="9" velocity="9"/>' * (kind != "continuous")
    ends = f'<parent link="{one}"/><child link="{two}"/><origin xyz="{at}"/><axis xyz="{axis}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{limits}</joint>'


def scene(folder: Path, bodies: list, duration: float, dt: float, *, mu: float = 0.3,
          gravity: tuple = (0.0, 0.0, 0.0), **more: object) -> Scene:  # fmt: skip
    law = {"between": ["arm", "pad"], "friction_coefficient": mu, "name": "touch"}
    return Scene.from_dict(
        {
            "title": "rubber", "duration": duration, "gravity": list(gravity),
            "body": list(bodies), "contact": [law], "solve": {"dt": dt, "estimate": False},
            "output": {"fields": []} | more,
        },
        base=folder,
    )  # fmt: skip


def chain(folder: Path) -> dict:
    """Three links that nothing holds: a box, a capsule and a ball."""
    (folder / "arm.urdf").write_text(
        robot(
            link("a", '<box size="0.1 0.05 0.04"/>', 4e-4, "0.06 0 0"),
            link("b", '<capsule radius="0.02" length="0.06"/>', 3e-4, "0.06 0 0"),
            link("c", '<sphere radius="0.03"/>', 2e-4, "0.06 0 0"),
            joint("j1", "continuous", "a", "b", "0 1 0", "0.12 0 0"),
            joint("j2", "continuous", "b", "c", "0 0 1", "0.12 0 0"),
        )
    )
    return {
        "kind": "mechanism",
        "name": "arm",
        "file": "arm.urdf",
        "base": "free",
        "position": [-0.08, 0.01, 0.08],
        "velocity": [0.2, 0.1, -2.0],
        "angular_velocity": [1.0, 3.0, 0.0],
        "joints": {"j1": {"position": 0.3, "velocity": 4.0}, "j2": {"position": 0.5}},
    }


def test_a_free_box_does_what_a_rigid_one_does(tmp_path):
    size, place = np.array([0.06, 0.07, 0.08]), np.array([0.01, 0.0, 0.065])
    (tmp_path / "arm.urdf").write_text(robot(link("b", '<box size="0.06 0.07 0.08"/>', 5e-4)))
    free = {"kind": "mechanism", "name": "arm", "file": "arm.urdf", "base": "free",
            "position": place.tolist()} | FALLS  # fmt: skip
    rigid = {"kind": "rigid", "name": "arm", "mass": 0.5, "inertia": [5e-4] * 3,
             "shape": {"kind": "block", "size": size.tolist(),
                       "corner": (place - 0.5 * size).tolist()}} | FALLS  # fmt: skip
    own, same = (
        impactfem.solve(scene(tmp_path, [pad(), each], 0.02, 1e-3)).history
        for each in (free, rigid)
    )
    assert same["contact_force"].values.max() > 50.0
    for name in ("x", "y", "z", "vx", "vy", "vz"):
        np.testing.assert_allclose(own[f"arm.{name}"], same[f"arm.{name}"], atol=1e-8)
    for name in ("qw", "qx", "qy", "qz", "wx", "wy", "wz"):
        np.testing.assert_allclose(own[f"arm.root_joint.{name}"], same[f"arm.{name}"], atol=1e-6)


@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_energy_and_momenta_stay(tmp_path, mu):
    """Of a free block and a chain that strikes it, whatever rubs: friction takes what it tells."""
    history = impactfem.solve(scene(tmp_path, [pad(), chain(tmp_path)], 0.04, 1e-3, mu=mu)).history
    assert history["contact_force"].values.max() > 50.0
    kept = history["total_energy"].values - history["friction_work"].values
    assert np.ptp(kept) < 1e-6 * kept[0]  # steps that contact cuts short round
    assert (history["friction_work"].values[-1] < -0.02 * kept[0]) == (mu > 0.0)
    for axis in "xyz":
        assert np.ptp(history[f"momentum.{axis}"].values) < 1e-11  # of 4.2 N s: rounding


PRESS = robot(
    '<link name="base"/>', link("hand", '<box size="0.08 0.06 0.04"/>', 4e-4),
    joint("z", "prismatic", "base", "hand", "0 0 1"),
)  # fmt: skip


def test_a_hand_presses_rubber_with_its_motor_and_weight(tmp_path):
    (tmp_path / "arm.urdf").write_text(PRESS)
    arm = {"kind": "mechanism", "name": "arm", "file": "arm.urdf", "position": [0.0, 0.0, 0.02],
           "joints": {"z": {"motor": "-20 - 100*v"}}}  # fmt: skip
    block = pad(rayleigh_mass=300.0, **HELD)
    history = impactfem.solve(
        scene(tmp_path, [block, arm], 0.2, 5e-3, mu=0.0, gravity=(0.0, 0.0, -G))
    ).history
    # In each layer the rubber, its top a little bent, gives what motor, weight and inertia ask for.
    q, v = history["arm.z.q"].values, history["arm.z.v"].values
    asked = 20.0 + 100.0 * np.diff(q) / 5e-3 + 0.5 * (G + np.diff(v) / 5e-3)
    np.testing.assert_allclose(history["force.touch"].values[1:], asked, rtol=1e-3)
    assert history["force.touch"].values[-1] == pytest.approx(20.0 + 0.5 * G, rel=0.02)
    assert -5e-3 < history["arm.z.q"].values[-1] < -5e-4


def test_stiff_rubber_is_as_small_strains_say(tmp_path):
    """A swinging bob on the same block: its rate after the impact, but for the steps of both."""
    (tmp_path / "arm.urdf").write_text(
        robot('<link name="base"/>', link("bob", '<sphere radius="0.03"/>', 1e-4, "0.2 0 0"),
              joint("hinge", "continuous", "base", "bob", "0 1 0"))
    )  # fmt: skip
    arm = {
        "kind": "mechanism",
        "name": "arm",
        "file": "arm.urdf",
        "position": [-0.2, 0.0, 0.03 + 1e-5],
        "joints": {"hinge": {"velocity": 0.5}},
    }
    after = []
    for strain in ("finite", "small"):
        block = pad(strain, **HELD) | {"youngs_modulus": 1e8}
        made = scene(tmp_path, [block, arm], 2e-3, 2e-5, mu=0.0)
        after.append(impactfem.solve(made).history["arm.hinge.v"].values[-1])
    assert after[0] < -0.2
    assert after[0] == pytest.approx(after[1], rel=0.02)


def test_an_arm_that_holds_a_weight_by_a_joint_keeps_its_energy(tmp_path):
    """A box at the end of two links strikes rubber, with a ball that hangs on it."""
    (tmp_path / "arm.urdf").write_text(
        robot('<link name="base"/>', link("one", '<sphere radius="0.01"/>', 1e-3, "0.1 0 0"),
              link("two", '<box size="0.08 0.06 0.04"/>', 1e-3, "0.1 0 0"),
              joint("a", "continuous", "base", "one", "0 1 0"),
              joint("b", "continuous", "one", "two", "0 1 0", "0.2 0 0"))
    )  # fmt: skip
    arm = {"kind": "mechanism", "name": "arm", "file": "arm.urdf", "position": [-0.3, 0.0, 0.03],
           "joints": {"a": {"velocity": 4.0}}}  # fmt: skip
    ball = {"kind": "rigid", "name": "ball", "mass": 0.3, "angular_velocity": [0.0, 4.0, 0.0],
            "shape": {"kind": "sphere", "radius": 0.02, "center": [0.14, 0.0, 0.03]},
            "velocity": [0.0, 0.0, -4.0 * 0.44]}  # fmt: skip
    hold = {"name": "hold", "kind": "ball", "between": ["arm/two", "ball"],
            "point": [0.1, 0.0, 0.03]}  # fmt: skip
    made = scene(tmp_path, [pad(**HELD), arm, ball], 0.02, 1e-3, gravity=(0.0, 0.0, -G))
    data = made.to_dict() | {"joint": [hold]}
    history = impactfem.solve(Scene.from_dict(data, base=tmp_path)).history
    assert history["contact_force"].values.max() > 50.0
    kept = history["total_energy"].values - history["friction_work"].values
    assert np.ptp(kept) < 1e-8 * kept[0]


def striking(folder: Path) -> Scene:
    return scene(folder, [pad(**HELD), chain(folder)], 0.026, 1e-3, checkpoint=10)


def test_a_run_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    whole, _ = check_restart(striking(tmp_path), 24, tmp_path, monkeypatch)
    assert whole.history["contact_force"].values[:21].max() > 50.0


@pytest.mark.parallel(2)
def test_ranks_agree(tmp_path, monkeypatch):
    made = striking(tmp_path)
    both = impactfem.solve(made)
    with alone(monkeypatch):
        one = impactfem.solve(made)
    for name, apart in differences(both, one).items():
        size = np.nanmax(np.abs(one.history[name]), initial=1.0)
        assert apart < 1e-10 * size, name
