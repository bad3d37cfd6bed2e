"""Explicit steps under finite strain: bodies that rub, roll, meet, and are pressed."""

import numpy as np
import pytest
from test_finite import RUBBER, columns, scene, spread
from test_finite_contact import aslant, missing

import impactfem
from impactfem.marching.coupled_levels import CoupledLevels
from impactfem.marching.rubbing import turned
from impactfem.system.inward import Inward

EXPLICIT = {"method": "explicit", "courant": 0.6, "dt": None}


def rub(duration, body=(), obstacle=(), friction=0.3, **more):
    contact = [{"between": ["disc", "floor"], "friction_coefficient": friction}]
    return impactfem.solve(scene(duration, body, obstacle, EXPLICIT, contact=contact, **more))


def met(bodies, duration, friction=0.0):
    contact = [{"between": ["one", "two"], "friction_coefficient": friction}] if friction else []
    return impactfem.solve(
        impactfem.Scene.from_dict(
            {
                "title": "explicit", "duration": duration, "body": bodies, "contact": contact,
                "output": {"fields": []}, "solve": {"method": "explicit", "estimate": False},
            }
        )
    )  # fmt: skip


@pytest.mark.slow
def test_a_spinning_disc_leaves_as_with_implicit_steps():
    result = rub(0.013, {"mesh_size": 0.01, "angular_velocity": 60.0})
    names = ("disc.vx", "disc.vy", "disc.spin", "friction_work", "total_energy")
    aside, up, spin, work, energy = (values[-1] for values in columns(result, *names))
    # Implicit steps, 10 to 1.25 mm: -1.145 to -1.151, 1.842 to 1.856 m/s, 14.1 to 15.1 rad/s.
    assert aside == pytest.approx(-1.148, abs=0.01)
    assert up == pytest.approx(1.842, abs=0.02)
    assert spin == pytest.approx(14.1, abs=0.3)
    assert work == pytest.approx(-12.17, abs=0.12)
    (kept,) = columns(result, "friction_work")
    assert np.diff(kept).max() <= 1e-5 * energy
    assert np.abs(missing(result) - missing(result)[0]).max() <= 3e-4
    # Growth is told of what friction leaves: the energy itself only falls.
    (total,) = columns(result, "total_energy")
    grown = (total - total[0] - kept).max() / total[0]
    assert grown > (total / total[0] - 1.0).max() + 2e-5
    assert result.summary["energy"]["max_relative_growth"] == pytest.approx(
        grown, abs=1e-9
    )  # rounding


def test_forces_obey_the_cone_at_each_level(monkeypatch):
    """|T| <= mu Lambda and T against the slip, which turns round through stick; in space."""
    seen = []
    settle = CoupledLevels._settle

    def watch(self, begin, start, time):
        found = settle(self, begin, start, time)
        acting, way = self._acting, self.interior.surface_displacement - begin
        seen.append((acting.force, turned(acting.directions, self._gaps.relative(way))))
        return found

    monkeypatch.setattr(CoupledLevels, "_settle", watch)
    ball = {
        "model": "3d", "mesh_size": 0.02, "velocity": [0.5, 0.3, -2.0],
        "angular_velocity": [-5.0, 8.0, 20.0],
        "shape": {"kind": "sphere", "radius": 0.05, "center": [0.0, 0.0, 0.0501]},
    }  # fmt: skip
    floor = {"point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]}
    result = rub(0.004, ball, floor)
    largest, stuck, slid = 0.0, 0, 0
    for force, way in seen:
        pressed = force[:, 0] > 0.0
        normal, tau, slip = force[pressed, 0], force[pressed, 1:], way[pressed, 1:]
        length, moved = np.linalg.norm(tau, axis=1), np.linalg.norm(slip, axis=1)
        largest = max(largest, normal.max(initial=0.0))
        assert np.abs(force[~pressed]).max(initial=0.0) == 0.0
        assert (length <= 0.3 * normal * (1.0 + 1e-9) + 1e-9 * largest).all()
        slips = length > 0.3 * normal * (1.0 - 1e-9)
        along = np.einsum("ij,ij->i", tau, slip)
        assert (along <= 1e-12).all()
        assert np.abs(along + length * moved)[slips].max(initial=0.0) <= 1e-6 * largest * 1e-4
        stuck, slid = stuck + np.count_nonzero(~slips), slid + np.count_nonzero(slips)
    assert min(stuck, slid) > 10
    (work,) = columns(result, "friction_work")
    assert work[-1] < -5e-4
    assert np.ptp(missing(result)) <= 5e-3


@pytest.mark.slow
def test_a_disc_slides_and_then_rolls():
    """A rigid one slides until 2 v0 / 3, when friction has taken a third of its energy."""
    disc = {
        "mesh_size": 0.01, "velocity": [1.0, 0.0],
        "shape": {"kind": "disc", "radius": 0.05, "center": [0.0, 0.05]},
    }  # fmt: skip
    result = rub(0.06, disc, gravity=[0.0, -40.0], start="static")
    time, speed, spin, work = columns(result, "time", "disc.vx", "disc.spin", "friction_work")
    rolling = time > 0.04
    assert speed[rolling].mean() == pytest.approx(2.0 / 3.0, rel=0.01)
    assert (-0.05 * spin[rolling]).mean() == pytest.approx(2.0 / 3.0, rel=0.03)  # flattened
    mass = result.summary["bodies"]["disc"]["mass"]
    assert work[-1] == pytest.approx(-mass / 6.0, rel=0.05)
    balance = missing(result) - missing(result)[0]
    assert -1e-2 <= balance.min() <= balance.max() <= 1e-3


@pytest.mark.slow
def test_a_moving_floor_drags_a_block_along():
    """mu g t of speed while it slips; the work of the floor is counted."""
    block = {
        "shape": {"kind": "block", "size": [0.1, 0.03], "corner": [0.0, 0.0]},
        "mesh_size": 0.01, "velocity": [0.0, 0.0],
    }  # fmt: skip
    result = rub(0.02, block, {"motion": ["t", "0"]}, 0.4, gravity=[0.0, -9.81], start="static")
    time, speed = columns(result, "time", "disc.vx")
    assert speed[-1] == pytest.approx(0.4 * 9.81 * time[-1], rel=0.02)
    assert spread(missing(result)) <= 1e-2


@pytest.mark.parametrize("solve", [EXPLICIT, {"method": "conserving"}])
def test_a_block_with_an_axis_rubs(solve):
    """Friction has no direction across the axis: with it neither method found a force."""
    block = {
        "model": "axisymmetric", "mesh_size": 0.01,
        "shape": {"kind": "block", "size": [0.05, 0.04], "corner": [0.0, 0.0005]},
    }  # fmt: skip
    contact = [{"between": ["disc", "floor"], "friction_coefficient": 0.5}]
    result = impactfem.solve(scene(0.002, block, (), solve, contact=contact))
    force, work = columns(result, "contact_force", "friction_work")
    assert result.summary["status"] == "completed"
    assert force.max() > 300.0
    assert work[-1] < 0.0
    assert spread(missing(result)) <= 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("friction", "spin"), [(0.0, 0.0), (0.3, 40.0)])
def test_discs_that_meet_off_centre_keep_all_momenta(friction, spin):
    result = met(aslant(spin), 0.014, friction)
    names = ("angular_momentum", "momentum.x", "momentum.y", "contact_force", "friction_work")
    spun, x, y, force, work = columns(result, *names)
    assert force.max() > 1500.0
    assert force[-1] == 0.0  # they have parted
    assert max(spread(x), spread(y)) <= 1e-12 * 4.3  # kg m/s of one of them
    assert spread(spun) <= 1e-11 * abs(spun[0])
    balance = missing(result) - missing(result)[0]
    assert -0.01 <= balance.min() <= balance.max() <= 3e-3
    assert (work[-1] < -0.3) == (friction > 0.0)


def test_forces_handed_inside_without_their_moment_would_show(monkeypatch):
    """The negative control of `Inward`."""
    bodies = [body | {"mesh_size": 0.02} for body in aslant(40.0)]
    kept = spread(next(columns(met(bodies, 0.006, 0.3), "angular_momentum")))
    made = Inward.__init__

    def bare(self, *data, **more):
        made(self, *data, **more | {"turns": False})

    monkeypatch.setattr(Inward, "__init__", bare)
    lost = spread(next(columns(met(bodies, 0.006, 0.3), "angular_momentum")))
    assert kept <= 1e-13
    assert lost >= 1e-9


@pytest.mark.slow
def test_balls_that_rub_off_centre_in_space_keep_all_momenta():
    shape = {"kind": "sphere", "radius": 0.05}
    common = RUBBER | {"model": "3d", "mesh_size": 0.02}
    one = common | {
        "name": "one", "shape": shape | {"center": [-0.0505, 0.0, 0.0]},
        "velocity": [1.0, 0.0, 0.0], "angular_velocity": [0.0, 30.0, 30.0],
    }  # fmt: skip
    two = common | {
        "name": "two", "shape": shape | {"center": [0.0405, 0.03, 0.03]},
        "velocity": [-1.0, 0.0, 0.0],
    }  # fmt: skip
    result = met([one, two], 0.004, 0.3)
    names = [f"{kind}.{axis}" for kind in ("momentum", "angular_momentum") for axis in "xyz"]
    force, work, *kept = columns(result, "contact_force", "friction_work", *names)
    assert force.max() > 20.0
    assert work[-1] < -0.002
    for values in kept[:3]:
        assert spread(values) <= 1e-12 * 0.5
    for values in kept[3:]:
        assert spread(values) <= 1e-11 * np.abs(kept[5]).max()
    assert spread(missing(result)) <= 0.01


def pressed(method, **load):
    body = {
        "velocity": [1.0, 0.0], "angular_velocity": 60.0, "mesh_size": 0.02,
        "pressures": [{"surface": "rim", "value": "5e4*sin(300*t)"} | load],
    }  # fmt: skip
    solve = EXPLICIT if method == "explicit" else {"method": method}
    return impactfem.solve(scene(0.01, body, {"point": [0.0, -3.0]}, solve))


def test_pressures_follow_a_body_that_turns():
    result = pressed("explicit")
    names = ("total_energy", "angular_momentum", "momentum.x", "momentum.y")
    energy, spun, x, y = columns(result, *names)
    assert spread(spun) <= 1e-12 * spun.max()
    assert max(spread(x), spread(y)) <= 1e-12 * x.max()
    assert spread(energy) <= 3e-3 * energy[0]  # of second order in the step
    dead = pressed("explicit", follows=False)  # which turns a body that has turned
    assert spread(next(columns(dead, "angular_momentum"))) >= 1e-2 * spun.max()
    ends = [
        [values.max() for values in columns(each, "elastic_energy", "disc.angle", "disc.spin")]
        for each in (result, pressed("conserving"))
    ]
    assert ends[0] == pytest.approx(ends[1], rel=0.03)  # masses lie elsewhere


def test_pressures_in_space_have_no_moment():
    """Implicit steps have one of third order in the step: 1e-5 here."""
    ball = {
        "model": "3d", "mesh_size": 0.02, "velocity": [0.0, 0.0, 0.0],
        "angular_velocity": [0.0, 60.0, 30.0], "shape": {"kind": "sphere", "radius": 0.05},
        "pressures": [{"surface": "surface", "value": "5e4*sin(300*t)"}],
    }  # fmt: skip
    floor = {"point": [0.0, 0.0, -1.0], "normal": [0.0, 0.0, 1.0]}
    result = impactfem.solve(scene(0.006, ball, floor, EXPLICIT))
    spun, upright, other = columns(
        result, "angular_momentum.y", "angular_momentum.z", "angular_momentum.x"
    )
    assert max(map(spread, (spun, upright, other))) <= 1e-12 * spun.max()
