"""Rigid bodies that strike elastic ones, against closed forms: bars (waves) and Hertz (none)."""

import numpy as np
import pytest

import impactfem
from impactfem import Scene

WAVE = 1e3  # speed in the bars [m/s], of length 1
LEAVES = {1.0: 3.06767, 0.5: 4.70858}  # times L / c


def bar_force(a, t):
    """Force over that of first contact at times in L / c, on a clamped bar of a times the mass.

    F = v + 2 w for the wave w(t) = F(t - 2) - w(t - 2) that comes back, and v' = -a F.
    """
    q, s, z = np.exp(-2.0 * a), t - 2.0, t - 4.0
    third = q * (q - 4.0 * a) + 2.0 + 2.0 * q - 2.0 * a * (3.0 + q) * z + 2.0 * (a * z) ** 2
    late = np.where(t < 4.0, (q + 2.0 - 2.0 * a * s) * np.exp(-a * s), third * np.exp(-a * z))
    return np.where(t < 2.0, np.exp(-a * t), late) * (t < LEAVES[a])


def rebound(a):
    """Speed over that of the impact."""
    t = (np.arange(200_000) + 0.5) / 200_000 * 2.0
    return -1.0 + a * 1e-5 * sum(bar_force(a, t + k).sum() for k in (0.0, 2.0, 4.0))


def struck_bar(kind, a, n):
    """A striker on a bar of length 1 with n layers or elements along it.

    Returns:
        Times amid the layers [L / c], force over that of first contact, speed at the end.
    """
    dim, wide = {"bar": 2, "plane_strain": 2, "3d": 3}[kind], 0.1
    area = wide ** (dim - 1)
    bar = {"kind": "solid", "name": "bar", "density": 1e3, "youngs_modulus": 1e3 * WAVE**2}
    mass = {"kind": "rigid", "name": "mass", "mass": 1e3 * area / a,
            "velocity": [0.0, -1.0, 0.0][:dim],
            "shape": {"kind": "block", "size": [0.3, 0.1, 0.3][:dim],
                      "corner": [-0.15, 0.0, -0.15][:dim]}}  # fmt: skip
    if kind == "bar":
        bar |= {"kind": "bar", "length": 1.0, "area": area, "far_end": "clamped",
                "point": [0.0, 0.0], "axis": [0.0, -1.0]}  # fmt: skip
        mass |= {"shape": {"kind": "disc", "radius": 0.1, "center": [0.0, 0.1]}}
    else:
        bar |= {"model": kind, "poisson_ratio": 0.0, "mesh_size": 1.0 / n, "strain": "small",
                "shape": {"kind": "block", "size": [wide, 1.0, wide][:dim],
                          "corner": [-0.5 * wide, -1.0, -0.5 * wide][:dim]},
                "supports": [{"surface": "bottom", "kind": "fixed"}]}  # fmt: skip
    met = ["mass", "bar" if kind == "bar" else "bar/top"]
    made = Scene.from_dict(
        {"title": "bar", "duration": {1.0: 3.6, 0.5: 5.2}[a] / WAVE, "body": [bar, mass],
         "contact": [{"between": met}], "output": {"fields": []},
         "solve": {"dt": 1.0 / (WAVE * n), "estimate": False}}
    )  # fmt: skip
    history = impactfem.solve(made).history
    time, force = history["time"].values * WAVE, history["contact_force"].values[1:]
    force = force / (1e3 * WAVE * area)
    return 0.5 * (time[1:] + time[:-1]), force, history["mass.vy"].values[-1]


@pytest.mark.parametrize("a", [1.0, 0.5])
def test_a_rigid_mass_on_a_clamped_bar_of_waves(a):
    errors = []
    for n in (50, 200):
        time, force, speed = struck_bar("bar", a, n)
        errors.append(np.abs(force - bar_force(a, time)).mean())
        assert speed == pytest.approx(rebound(a), abs=2e-5 + (0.5 / n) ** 2)
        assert time[force > 0.0][-1] == pytest.approx(LEAVES[a], abs=1.5 / n)
    assert errors[1] < 1e-5
    assert errors[1] < errors[0] / 8.0


@pytest.mark.parametrize(
    ("kind", "a", "sizes", "within"),
    [
        ("plane_strain", 1.0, (20, 80), 1e-3),
        ("plane_strain", 0.5, (20, 80), 1.2e-3),
        pytest.param("3d", 1.0, (10, 20), 6e-3, marks=pytest.mark.slow),
    ],
)
def test_a_rigid_box_on_a_clamped_solid_bar(kind, a, sizes, within):
    """The jump at 2 L / c overshoots as waves of elements do; the impulse is right."""
    impulses = []
    for n in sizes:
        time, force, speed = struck_bar(kind, a, n)
        impulses.append((speed + 1.0) / (rebound(a) + 1.0) - 1.0)
        assert time[force > 0.0][-1] == pytest.approx(LEAVES[a], abs=3.5 / n)
    assert abs(impulses[1]) < within
    assert abs(impulses[1]) < 0.6 * abs(impulses[0])


A = 0.02  # contact radius over that of the ball


def hertz(half, per, nu=0.3, steps=200, *, dim=2, **solve):
    """A rigid ball on a block of a half width and height in contact radii, so slow as to be static.

    In space a quarter of both is computed, the ball on a guide.

    Returns:
        Contact time, largest force, impulse of the ball over Hertz's, history.
    """
    stiff, still = 1.0 / (1.0 - nu**2), [0.0] * (dim - 2)
    force, depth = 4.0 / 3.0 * stiff * A**3 * (1.0 if dim == 2 else 0.25), A**2
    time = 100.0 * half * A  # transits of waves of speed 1
    speed = 2.94328 * depth / time
    mass = 0.8 * force * depth / speed**2
    balls, size = [], A / per
    while size < 0.125 * half * A:  # from the contact outwards elements double
        balls.append({"point": [0.0, 0.0, *still], "radius": 1.2 * per * size, "size": size})
        size *= 2.0
    block = {
        "kind": "solid", "name": "block", "strain": "small",
        "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": nu, "degree": 2, "refine": balls,
        "mesh_size": 0.125 * half * A,
        "shape": {"kind": "block", "size": [half * A, half * A], "corner": [0.0, -half * A]},
        "model": "axisymmetric",
        "supports": [{"surface": "bottom", "kind": "fixed"}],
    }  # fmt: skip
    wide = {"size": [2 * half * A, half * A, 2 * half * A], "corner": [-half * A] * 3}
    if dim == 3:
        block |= {"model": "3d", "shape": {"kind": "block", "symmetry": ["x", "z"]} | wide}
    dt = time / steps
    ball = {"kind": "point", "name": "ball", "mass": mass, "radius": 1.0,
            "position": [0.0, 1.0 + 0.5 * speed * dt, *still],
            "velocity": [0.0, -speed, *still]}  # fmt: skip
    guide = {"kind": "prismatic", "name": "guide", "between": ["ball", "ground"],
             "axis": [0.0, 1.0, 0.0], "point": ball["position"]}  # fmt: skip
    made = Scene.from_dict(
        {"title": "Hertz", "duration": 1.1 * time, "body": [block, ball],
         "contact": [{"between": ["ball", "block/top"]}], "joint": [guide] * (dim - 2),
         "solve": {"dt": dt, "estimate": False} | solve, "output": {"fields": []}}
    )  # fmt: skip
    history = impactfem.solve(made).history
    found, way = history["contact_force"].values, history["ball.vy"].values
    impulse = mass * (way[-1] - way[0])
    # Histories hold the sum of normal forces, which lean by up to A, 1 - A^2 / 4 of it axial.
    assert found.sum() * dt == pytest.approx(impulse * (1.0 + A**2 / 4.0), rel=1e-4)
    ratios = (found > 0.0).sum() * dt / time, found.max() / force, impulse / (2.0 * mass * speed)
    return *ratios, history


def test_a_rigid_ball_on_a_large_block_is_hertz_s():
    """What is left is the block: its depth is missed by the share 1 / half of the dent."""
    forces = []
    for half, per in ((12.0, 4), (48.0, 4), (96.0, 6)):
        time, force, impulse, history = hertz(half, per)
        forces.append(force - 1.0)
        energy = history["total_energy"].values
        assert impulse == pytest.approx(1.0, abs=1e-3)
        assert np.abs(energy / energy[0] - 1.0).max() < 2e-4
    assert forces[0] > 3.0 * forces[1] > 3.0 * forces[2]
    assert force == pytest.approx(1.0, abs=0.008)
    assert time == pytest.approx(1.0, abs=0.005)


@pytest.mark.parametrize("nu", [0.0, 0.45])
def test_hertz_at_other_poisson_ratios(nu):
    time, force, impulse, history = hertz(96.0, 4, nu=nu, method="conserving")
    assert (time, force, impulse) == pytest.approx((1.0, 1.0, 1.0), abs=0.01)
    assert history["total_energy"].values.max() <= (1.0 + 1e-11) * history["total_energy"].values[0]


@pytest.mark.slow
def test_hertz_in_space():
    time, force, impulse, _ = hertz(96.0, 3, steps=100, dim=3)
    assert (time, force, impulse) == pytest.approx((1.0, 1.0, 1.0), abs=0.011)
    assert impulse == pytest.approx(1.0, abs=1e-4)
