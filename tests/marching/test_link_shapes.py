"""Edges and faces of links: beside rigid bodies, closed forms, momenta, restarts."""

from pathlib import Path

import numpy as np
import pytest
from moving_scenes import alone, check_restart

pytest.importorskip("pinocchio")

import impactfem
from impactfem import Scene

G = 9.81
FLOOR = {"kind": "box", "name": "floor", "center": [0.0, 0.0, -1.0], "size": [9.0, 9.0, 2.0]}
PLANE = {"kind": "half_space", "name": "floor", "point": [0.0] * 3, "normal": [0.0, 0.0, 1.0]}
SLAB = {"kind": "block", "size": [0.4, 0.4, 0.2], "corner": [-0.2, -0.2, 0.0]}
LOW = {"kind": "rigid", "name": "low", "mass": 2.0, "shape": SLAB}
BALL = LOW | {"shape": {"kind": "sphere", "radius": 0.1, "center": [0.0, 0.0, 0.1]}}
SOFT = {"kind": "solid", "name": "low", "model": "3d", "youngs_modulus": 1e8, "poisson_ratio": 0.3,
        "density": 1000.0, "mesh_size": 0.1, "shape": SLAB}  # fmt: skip
SLOPE = np.radians(20.0)


def link(name: str, shape: str, inertia: list[float], at: str = "0 0 0", mass: float = 1.0) -> str:
    moments = " ".join(f'{n}="{v!r}"' for n, v in zip(("ixx", "iyy", "izz"), inertia, strict=True))
    zero = 'ixy="0" ixz="0" iyz="0"'
    whole = f'<inertial><origin xyz="{at}"/><mass value="{mass}"/><inertia {moments} {zero}/>'
    touching = f'<collision><origin xyz="{at}"/><geometry>{shape}</geometry></collision>'
    return f'<link name="{name}">{whole}</inertial>{touching}</link>'


def robot(*parts: str) -> str:
    return f'<robot name="r" version="1.2">{"".join(parts)}</robot>'


def scene(folder: Path, bodies: list, duration: float, dt: float, *, laws: list = (),
          gravity: tuple = (0.0, 0.0, 0.0), obstacles: tuple = ()) -> Scene:  # fmt: skip
    return Scene.from_dict(
        {
            "title": "links", "duration": duration, "gravity": list(gravity), "body": list(bodies),
            "obstacle": list(obstacles), "contact": list(laws),
            "solve": {"dt": dt, "estimate": False}, "output": {"fields": []},
        },
        base=folder,
    )  # fmt: skip


def columns(made: Scene) -> dict[str, np.ndarray]:
    history = impactfem.solve(made).history
    return {name: history[name].values for name in history.data_vars}


FALLS = {"orientation": {"axis": [1.0, 2.0, 0.5], "angle": 0.8}, "velocity": [0.5, 0.0, -1.0]}
RUBS = {"friction_coefficient": 0.3}
DOWN = (G * np.sin(SLOPE), 0.0, -G * np.cos(SLOPE))


@pytest.mark.parametrize(
    ("height", "start", "other", "gravity"),
    [
        (0.15, {}, FLOOR, DOWN),  # slides
        (0.15, {"angular_velocity": [0.0, 4.0, 0.0]}, FLOOR, (0.0, 0.0, -G)),  # tips
        (0.25, FALLS, FLOOR, (0.0, 0.0, -G)),
        (0.25, FALLS, PLANE, (0.0, 0.0, -G)),
        (0.44, FALLS, LOW, (0.0, 0.0, -G)),
        (0.44, FALLS, BALL, (0.0, 0.0, 0.0)),
        pytest.param(
            0.44,
            FALLS | {"velocity": [0.5, 0.0, -4.0]},
            SOFT,
            (0.0, 0.0, 0.0),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_free_box_does_what_a_rigid_one_does(tmp_path, height, start, other, gravity):
    size, place = np.array([0.1, 0.2, 0.3]), np.array([0.02, 0.01, height])
    shape = {"kind": "block", "size": size.tolist(), "corner": (place - 0.5 * size).tolist()}
    rigid = {"kind": "rigid", "name": "box", "mass": 1.0, "shape": shape} | start
    inertia = [float((size**2).sum() - s**2) / 12.0 for s in size]
    (tmp_path / "box.urdf").write_text(robot(link("b", '<box size="0.1 0.2 0.3"/>', inertia)))
    body = {"kind": "mechanism", "name": "box", "file": "box.urdf", "base": "free",
            "position": place.tolist()} | start  # fmt: skip
    beside = [] if other["name"] == "floor" else [other]
    obstacles = [other] if other["name"] == "floor" else []
    law = RUBS if other.get("kind") == "solid" else RUBS | {"restitution": 0.2}
    laws = [{"between": ["box", other["name"]]} | law]
    own, same = (
        columns(scene(tmp_path, [each, *beside], 0.1, 1e-3, laws=laws, gravity=gravity,
                      obstacles=obstacles))
        for each in (body, rigid)
    )  # fmt: skip
    for name in ("x", "y", "z", "vx", "vy", "vz"):
        assert own[f"box.{name}"] == pytest.approx(same[f"box.{name}"], abs=1e-9)
    for name in ("qw", "qx", "qy", "qz", "wx", "wy", "wz"):
        assert own[f"box.root_joint.{name}"] == pytest.approx(same[f"box.{name}"], abs=1e-9)
    assert same["impulse.box." + other["name"]].max() + same["contact_force"].max() > 0.1


@pytest.mark.parametrize("floor", [FLOOR, PLANE])
@pytest.mark.parametrize("kind", ["cylinder", "capsule"])
def test_wheels_roll(tmp_path, floor, kind):
    radius, across = 0.1, 0.003
    shape = f'<{kind} radius="{radius}" length="0.2"/>'
    (tmp_path / "wheel.urdf").write_text(robot(link("w", shape, [across, across, 0.006])))
    wheel = {"kind": "mechanism", "name": "wheel", "file": "wheel.urdf", "base": "free",
             "position": [0.0, 0.0, radius],
             "orientation": {"axis": [1.0, 0.0, 0.0], "angle": 0.5 * np.pi}}  # fmt: skip
    laws = [{"between": ["wheel", "floor"]} | RUBS]
    found = columns(scene(tmp_path, [wheel], 0.2, 2e-3, laws=laws, gravity=DOWN,
                          obstacles=[floor]))  # fmt: skip
    pull = G * np.sin(SLOPE) / (1.0 + 0.006 / radius**2)
    assert found["wheel.vx"][-1] == pytest.approx(0.2 * pull, rel=1e-9)
    assert found["wheel.root_joint.wy"][-1] == pytest.approx(2.0 * pull, rel=1e-9)
    assert np.ptp(found["wheel.z"]) < 1e-9


PRESS = robot(
    '<link name="base"/>',
    link("hand", '<box size="0.1 0.1 0.1"/>', [1e-3] * 3, mass=2.0).replace(
        '0"/><geometry>', f'0" rpy="0 {np.pi / 4} 0"/><geometry>'
    ),
    '<joint name="z" type="prismatic"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>'
    '<limit lower="-9" upper="9" effort="9" velocity="9"/></joint>',
)


@pytest.mark.parametrize("under", [LOW, BALL])
def test_a_hand_presses_a_box_or_a_ball(tmp_path, under):
    (tmp_path / "press.urdf").write_text(PRESS)
    arm = {
        "kind": "mechanism",
        "name": "arm",
        "file": "press.urdf",
        "position": [0.05 * (under is LOW), 0.0, 0.2 + 0.05 * np.sqrt(2.0)],
        "joints": {"z": {"motor": "-30"}},
    }
    laws = [{"between": ["arm/hand", "low"], "name": "press"}, {"between": ["low", "floor"]}]
    found = columns(scene(tmp_path, [arm, under], 0.01, 1e-3, laws=laws, gravity=(0.0, 0.0, -G),
                          obstacles=[FLOOR]))  # fmt: skip
    pressed, stands = 30.0 + 2.0 * G, 30.0 + 4.0 * G
    assert found["force.press"][1:] == pytest.approx(pressed, rel=1e-8)
    assert found["force.low.floor"][1:] == pytest.approx(stands, rel=1e-8)
    assert np.ptp(found["arm.z.q"]) < 1e-9
    if under is LOW:  # an edge of the hand presses beside the middle
        middle = found["center.low.floor.x"][1:]
        assert middle == pytest.approx(0.05 * pressed / stands, rel=1e-5)


@pytest.mark.parametrize("e", [0.0, 1.0])
def test_a_hinged_box_strikes_one_edge_across_edge(tmp_path, e):
    """J = (1 + e) w / k with k = 1 / m + (a x n)^2 / I of the free box, r^2 / I of the arm."""
    half, gap, reach = 0.1, 1e-5, 0.5
    far, inertia = half * np.sqrt(2.0), 4e-2
    turned = f'<origin xyz="{reach} 0 0" rpy="{np.pi / 4} 0 0"/>'
    swing = link("arm", '<box size="0.2 0.2 0.2"/>', [inertia] * 3, mass=1.0)
    swing = swing.replace('<collision><origin xyz="0 0 0"/>', f"<collision>{turned}")
    (tmp_path / "swing.urdf").write_text(
        robot('<link name="base"/>', swing, '<joint name="y" type="continuous"><axis xyz="0 1 0"/>'
              '<parent link="base"/><child link="arm"/></joint>')
    )  # fmt: skip
    arm = {"kind": "mechanism", "name": "arm", "file": "swing.urdf",
           "position": [0.0, 0.0, far + gap], "joints": {"y": {"velocity": 1.0}}}  # fmt: skip
    # The edge below is along y, that of the hand along x: they cross at y = 0.
    box = {"kind": "rigid", "name": "box", "mass": 2.0,
           "orientation": {"axis": [0.0, 1.0, 0.0], "angle": np.pi / 4},
           "shape": {"kind": "block", "size": [0.2] * 3,
                     "corner": [reach - 0.03 - half, 0.02 - half, -far - half]}}  # fmt: skip
    laws = [{"between": ["arm", "box"], "restitution": e}]
    found = columns(scene(tmp_path, [arm, box], 1e-4, 1e-5, laws=laws))
    lever, own = reach - 0.03, 2.0 * 0.2**2 / 6.0
    k = 0.5 + 0.02**2 / own + lever**2 / inertia
    impulse = (1.0 + e) * lever / k
    assert found["box.vz"][-1] == pytest.approx(-0.5 * impulse, rel=1e-4)
    assert found["arm.y.v"][-1] == pytest.approx(1.0 - lever * impulse / inertia, abs=1e-4)
    assert found["box.wx"][-1] == pytest.approx(0.02 * impulse / own, rel=1e-4)


def chain(*shapes: str) -> str:
    made = []
    for k, shape in enumerate(shapes):
        one = link(f"l{k}", shape, [0.003, 0.008, 0.008], "0.15 0 0")
        made.append(one.replace('0"/><geometry>', '0" rpy="0 1.5708 0"/><geometry>'))
        if k:
            ends = f'<parent link="l{k - 1}"/><child link="l{k}"/><origin xyz="0.35 0 0"/>'
            axis = '<axis xyz="0 1 0"/>' if k % 2 else '<axis xyz="0 0 1"/>'
            made.append(f'<joint name="j{k}" type="continuous">{ends}{axis}</joint>')
    return robot(*made)


def clash(folder: Path) -> Scene:
    """Two chains and a box that nothing holds strike each other, with friction."""
    (folder / "a.urdf").write_text(
        chain('<box size="0.08 0.1 0.3"/>', '<capsule radius="0.04" length="0.2"/>',
              '<sphere radius="0.06"/>')
    )  # fmt: skip
    (folder / "c.urdf").write_text(
        chain('<cylinder radius="0.05" length="0.3"/>', '<box size="0.1 0.1 0.28"/>')
    )
    one = {
        "kind": "mechanism",
        "name": "a",
        "file": "a.urdf",
        "base": "free",
        "position": [0.0, 0.0, 0.2],
        "velocity": [0.0, 0.2, -1.0],
        "angular_velocity": [1.0, 0.5, 0.0],
        "joints": {"j1": {"position": 0.3, "velocity": 2.0}, "j2": {"position": 0.5}},
    }
    two = {"kind": "mechanism", "name": "c", "file": "c.urdf", "base": "free",
           "position": [0.1, -0.1, 0.0], "orientation": {"axis": [0.0, 0.0, 1.0], "angle": 0.9},
           "joints": {"j1": {"position": 0.2}}}  # fmt: skip
    box = {"kind": "rigid", "name": "d", "mass": 1.5,
           "shape": {"kind": "block", "size": [0.2] * 3, "corner": [0.5, -0.1, -0.24]},
           "orientation": {"axis": [1.0, 0.0, 1.0], "angle": 0.5}}  # fmt: skip
    laws = [
        {"between": pair, "friction_coefficient": 0.4, "restitution": 0.3}
        for pair in (["a", "c"], ["a", "d"], ["c", "d"])
    ]
    made = scene(folder, [one, two, box], 0.24, 2e-3, laws=laws)
    return made.with_settings({"output.checkpoint": 25})


def test_chains_that_clash_keep_both_momenta_and_restart_to_the_last_bit(tmp_path, monkeypatch):
    whole, _ = check_restart(clash(tmp_path), 60, tmp_path, monkeypatch)
    found = whole.history
    assert min(found[f"impulse.{pair}"].values.max() for pair in ("a.c", "a.d")) > 0.01
    for name in ("momentum", "angular_momentum"):
        each = np.stack([found[f"{name}.{axis}"].values for axis in "xyz"])
        assert np.abs(each - each[:, :1]).max() < 1e-11
    energy = found["total_energy"].values
    assert np.diff(energy).max() < 1e-12


@pytest.mark.parallel(2)
def test_two_ranks_do_the_same(tmp_path, monkeypatch):
    made = clash(tmp_path)
    both = impactfem.solve(made)
    with alone(monkeypatch):
        one = impactfem.solve(made)
    for name in one.history.data_vars:
        np.testing.assert_allclose(
            both.history[name].values, one.history[name].values, rtol=1e-10, atol=1e-10
        )
