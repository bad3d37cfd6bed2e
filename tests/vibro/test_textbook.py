"""Textbook schemes against closed forms: orders, stability, energy, impacts, rest."""

import numpy as np
import pytest

import impactfem
from impactfem.studies.schemes import (
    DOUBLE_STEPS,
    double_end,
    double_pendulum,
    growth,
    pendulum,
    period,
    scheme_study,
)
from impactfem.vibro.textbook import SCHEMES

ORDERS = {"explicit_euler": 1, "implicit_euler": 1, "symplectic_euler": 1, "midpoint": 2,
          "trapezoid": 2, "rk4": 4, "energy_momentum": 2}  # fmt: skip


@pytest.mark.parametrize("name", SCHEMES)
def test_order_on_a_pendulum(name):
    whole = period(1.0)
    assert whole == pytest.approx(2.1391376, abs=5e-8)
    missed = []
    for steps in (200, 400):
        motion = impactfem.integrate(
            pendulum(), [1.0], [0.0], 0.25 * whole, method=name, dt=whole / steps
        )
        lowest = -2.0 * np.sin(0.5) * np.sqrt(9.81)  # rate where it hangs
        missed.append(np.hypot(motion.position[-1, 0], motion.velocity[-1, 0] - lowest))
    assert np.log2(missed[0] / missed[1]) == pytest.approx(ORDERS[name], abs=0.12)


def test_kutta_on_the_double_pendulum():
    assert double_end() == pytest.approx([-0.64373045, -1.76608996], abs=5e-9)
    expected = {2e-3: 3.3e-9, 1e-3: 2.1e-10, 5e-4: 1.3e-11}
    for h in DOUBLE_STEPS[:2]:
        motion = impactfem.integrate(
            double_pendulum(), [2.0, 1.0], [0.0, 0.0], 2.0, method="rk4", dt=h
        )
        missed = np.abs(motion.position[-1] - double_end()).max()
        assert missed == pytest.approx(expected[h], rel=0.04)


@pytest.mark.parametrize(
    ("name", "spring", "factor"),
    [
        ("implicit_euler", (1e4, 0.0, 0.01), 2**-0.5),
        ("implicit_euler", (1e6, 10.0, 0.01), 1.0 / np.sqrt(1.0 + 0.1 + 100.0)),
        ("implicit_euler", (1.0, 10.0, 0.1), 1.0 / (1.0 + 0.05 * (10.0 - np.sqrt(96.0)))),
        ("symplectic_euler", (1e6, 10.0, 0.01), 98.0908),
        ("explicit_euler", (1e6, 10.0, 0.01), 10.0449),
        ("symplectic_euler", (1.0, 0.0, 1.99), 1.0),
        ("midpoint", (1e6, 0.0, 0.1), 1.0),
        ("trapezoid", (1e6, 0.0, 0.1), 1.0),
    ],
)
def test_growth_on_a_spring(name, spring, factor):
    assert growth(name, *spring) == pytest.approx(factor, rel=1e-6)


def test_kutta_is_stable_up_to_the_root_of_eight():
    assert growth("rk4", 1.0, 0.0, 0.999 * np.sqrt(8.0)) < 1.0
    assert growth("rk4", 1.0, 0.0, 1.001 * np.sqrt(8.0)) > 1.0


def test_energy_momentum_keeps_energy_and_the_momentum_of_a_cyclic_coordinate():
    """Two rods in the plane, one on the other, without weight: the first angle is cyclic."""

    def mass(u):
        c = np.cos(u[1])
        return [[3.0 + 2.0 * c, 1.0 + c], [1.0 + c, 1.0]]

    def force(_, u, v):
        s = np.sin(u[1])
        return [s * v[1] * (2.0 * v[0] + v[1]), -s * v[0] ** 2 - 5.0 * np.sin(u[1])]

    arm = impactfem.systems.GeneralizedSystem(
        mass=mass, force=force, dofs=2, potential=lambda _, u: -5.0 * np.cos(u[1])
    )
    motion = impactfem.integrate(
        arm, [0.0, 1.0], [2.0, -1.0], 4.0, method="energy_momentum", dt=0.02
    )
    turning = [(np.array(mass(u)) @ v)[0]
               for u, v in zip(motion.position, motion.velocity, strict=True)]  # fmt: skip
    assert np.ptp(turning) < 2e-13
    assert np.ptp(motion.total) < 1e-11
    rough = impactfem.integrate(arm, [0.0, 1.0], [2.0, -1.0], 4.0, method="midpoint", dt=0.02)
    assert np.ptp(rough.total) > 1e-5


def ball(restitution):
    return impactfem.systems.GeneralizedSystem(
        mass=1.0, force=lambda *_: [-10.0], constraints=lambda u: u, restitution=restitution,
        potential=lambda _, u: 10.0 * float(u[0]),
    )  # fmt: skip


def test_lossless_bounces_keep_the_energy():
    motion = impactfem.integrate(ball(1.0), [1.0], [0.0], 4.0, method="energy_momentum", dt=0.003)
    assert np.ptp(motion.total) < 1e-12
    assert len(motion.impacts) == 4  # at 0.447, 1.342, ... s
    assert motion.impacts.time[0] == pytest.approx(np.sqrt(0.2), abs=3e-3)


@pytest.mark.parametrize("name", SCHEMES)
def test_ball_comes_to_rest_and_stays(name):
    motion = impactfem.integrate(ball(0.5), [0.2], [0.0], 1.0, method=name, dt=1e-3)
    late = motion.times > 0.8  # bounces end at 0.6 s
    if name == "explicit_euler":  # it goes on hopping at the speed of a step's fall
        assert np.abs(motion.velocity[late]).max() < 1.001 * 10.0 * 1e-3
        return
    assert np.abs(motion.velocity[late]).max() < 1e-12
    assert np.ptp(motion.position[late]) < 1e-12
    assert motion.contact_force[late].mean() == pytest.approx(10.0, rel=1e-9)


def test_refusals_name_what_can():
    rubbing = impactfem.systems.GeneralizedSystem(
        mass=[1.0, 1.0], force=lambda *_: [0.0, -1.0], constraints=lambda u: u[1:],
        friction=0.1, slip=lambda _: [[1.0, 0.0]],
    )  # fmt: skip
    with pytest.raises(impactfem.SceneError, match="moreau_jean"):
        impactfem.integrate(rubbing, [0, 0], [1, 0], 1.0, method="rk4", dt=0.1)
    with pytest.raises(impactfem.SceneError, match="textbook scheme"):
        scheme_study(["galerkin"])
    with pytest.raises(impactfem.errors.ConvergenceError, match="smaller dt"):
        impactfem.integrate(
            impactfem.systems.LinearSystem(
                mass=1.0, stiffness=1e6, normals=np.zeros((0, 1)), offsets=[]
            ),
            [1.0], [0.0], 100.0, method="explicit_euler", dt=0.1,
        )  # fmt: skip


def test_scene_takes_a_scheme_by_its_name():
    scene = impactfem.Scene(
        title="ball on a spring", duration=1.0, gravity=[-9.81],
        bodies=[impactfem.Point(mass=1.0, position=[1.0], springs=[
            {"anchor": [1.0], "stiffness": 4.0}])],
        obstacles=[impactfem.HalfSpace(name="floor", point=[0.0], normal=[1.0])],
        contacts=[impactfem.Contact(between=("point", "floor"), restitution=1.0)],
        solve=impactfem.Solve(method="energy_momentum", estimate=False),
    )  # fmt: skip
    summary = impactfem.solve(scene).summary
    assert summary["method"] == "energy_momentum"
    assert abs(summary["energy"]["final_relative_drift"]) < 1e-13
