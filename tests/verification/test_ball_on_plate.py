"""Balls that dent plates: Karas' and Zener's problems (`[[contact]] stiffness` beside DKT plates).

Sources: K. Karas, Ing.-Arch. 10 (1939) 237; C. Zener, Phys. Rev. 59 (1941) 669.
"""

import math

import gmsh
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import impactfem
from impactfem import Scene

E, NU, RHO = 2.06e11, 0.3, 7800.0
SIDE, THICKNESS = 0.2, 0.008
D = E * THICKNESS**3 / (12.0 * (1.0 - NU**2))
CENTRE = 0.0116008  # deflection by a force in the middle, in P a^2 / D (Timoshenko)


def mass_of(radius):
    return RHO * 4.0 / 3.0 * math.pi * radius**3


def hertz(radius):
    return 4.0 / 3.0 * E / (2.0 * (1.0 - NU**2)) * math.sqrt(radius)


def thin_modes(most=79):
    """Odd modes of a thin plate: frequencies, what a force amid it does to each, static rest."""
    odd = np.arange(1, most + 1, 2)
    squares = (odd[:, None] ** 2 + odd**2).ravel()
    w = (math.pi / SIDE) ** 2 * squares * math.sqrt(D / (RHO * THICKNESS))
    b = np.full(len(w), 4.0 / (RHO * THICKNESS * SIDE**2))  # all have 1 in the middle
    return w, b, CENTRE * SIDE**2 / D - (b / w**2).sum()


def shearing_modes(patch, most=121):
    """The same with shear and rotary inertia, two of each shape, of a force that is a Gaussian.

    Of each wave number deflection and the slope along it, (rho t, rho t^3/12) and
    ((S k^2, -S k), (-S k, D k^2 + S)); what is met is the mean by the same Gaussian.
    """
    odd = np.arange(1, most + 1, 2)
    shear = 5.0 / 6.0 * E / (2.0 * (1.0 + NU)) * THICKNESS
    mass = RHO * THICKNESS * np.array([1.0, THICKNESS**2 / 12.0])
    w, b = [], []
    for k in math.pi / SIDE * np.sqrt((odd[:, None] ** 2 + odd**2).ravel()):
        stiffness = np.array([[shear * k**2, -shear * k], [-shear * k, D * k**2 + shear]])
        squares, ways = np.linalg.eigh(stiffness / np.sqrt(np.outer(mass, mass)))
        w += np.sqrt(squares).tolist()
        b += (4.0 / SIDE**2 * math.exp(-((k * patch) ** 2)) * ways[0] ** 2 / mass[0]).tolist()
    return np.array(w), np.array(b), 0.0


def by_modes(radius, duration, dt=1e-7, modes=None):
    """Times, forces and velocity of the ball: modes, the others by their statics.

    Each mode is exact for a force that is linear in a step; that at its end by Newton's method.
    """
    w, b, tail = modes or thin_modes()
    m, k = mass_of(radius), hertz(radius)
    cosine, sine = np.cos(w * dt), np.sin(w * dt)
    q, v, z, speed, force = np.zeros(len(w)), np.zeros(len(w)), 0.0, -1.0, 0.0
    forces = [0.0]
    for _ in range(round(duration / dt)):

        def moved(new, q=q, v=v, old=force):
            """Modes and their velocities at the end, pushed down."""
            slope, part = (new - old) / dt, b / w**2
            one, two = q + part * old, v / w + part * slope / w
            end = cosine * one + sine * two - part * new
            return end, w * (cosine * two - sine * one) - part * slope

        still, per = moved(0.0)[0].sum(), 0.0
        per = moved(1.0)[0].sum() - still
        coast = z + speed * dt + dt**2 * force / (3.0 * m)
        new = force
        for _ in range(50):
            dent = max(0.0, still + (per - tail) * new - coast - dt**2 / (6.0 * m) * new)
            rate = 1.5 * k * math.sqrt(dent) * (per - tail - dt**2 / (6.0 * m)) - 1.0
            change = (k * dent**1.5 - new) / rate
            new -= change
            if abs(change) <= 1e-12 * (1.0 + new):
                break
        z, speed = coast + dt**2 / (6.0 * m) * new, speed + 0.5 * dt / m * (force + new)
        q, v = moved(new)
        force = new
        forces.append(force)
    return dt * np.arange(len(forces)), np.array(forces), speed


def square(path, half, count, ratio=1.0):
    """A mesh file of a square with a vertex in its middle, finer there by some ratio."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        line = [-half, 0.0, half]
        point = [[geo.addPoint(x, y, 0.0) for x in line] for y in line]
        across = [[geo.addLine(row[i], row[i + 1]) for i in range(2)] for row in point]
        upward = [[geo.addLine(point[j][i], point[j + 1][i]) for i in range(3)] for j in range(2)]
        for pair in across:
            geo.mesh.setTransfiniteCurve(pair[0], count + 1, "Progression", 1.0 / ratio)
            geo.mesh.setTransfiniteCurve(pair[1], count + 1, "Progression", ratio)
        for j, each in enumerate(upward):
            for curve in each:
                geo.mesh.setTransfiniteCurve(curve, count + 1, "Progression", ratio ** (2 * j - 1))
        faces = []
        for j, i in np.ndindex(2, 2):
            around = [across[j][i], upward[j][i + 1], -across[j + 1][i], -upward[j][i]]
            faces.append(geo.addPlaneSurface([geo.addCurveLoop(around)]))
            geo.mesh.setTransfiniteSurface(faces[-1], "Right" if i == j else "Left")
        geo.synchronize()
        rim = {"bottom": across[0], "top": across[2], "left": [upward[0][0], upward[1][0]],
               "right": [upward[0][2], upward[1][2]]}  # fmt: skip
        for name, curves in rim.items():
            gmsh.model.addPhysicalGroup(1, curves, name=name)
        gmsh.model.addPhysicalGroup(2, faces, name="plate")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def scene(path, radius, mass, stiffness, duration, dt, **plate):
    body = {"kind": "plate", "name": "plate", "mesh": str(path), "thickness": THICKNESS,
            "density": RHO, "youngs_modulus": E, "poisson_ratio": NU} | plate  # fmt: skip
    ball = {"kind": "rigid", "name": "ball", "mass": mass, "velocity": [0.0, 0.0, -1.0],
            "shape": {"kind": "sphere", "radius": radius,
                      "center": [0.0, 0.0, 0.5 * body["thickness"] + radius]}}  # fmt: skip
    law = {"between": ["ball", "plate"], "stiffness": stiffness, "stiffness_exponent": 1.5}
    return Scene.from_dict(
        {"title": "Ball on a plate", "duration": duration, "body": [body, ball], "contact": [law],
         "solve": {"dt": dt, "estimate": False}, "output": {"fields": []}}
    )  # fmt: skip


def karas(folder, radius, count, duration, dt):
    path = folder / "plate.msh"
    square(path, 0.5 * SIDE, count)
    held = [
        {"edge": edge, "kind": "simply_supported"} for edge in ("left", "right", "bottom", "top")
    ]
    made = scene(path, radius, mass_of(radius), hertz(radius), duration, dt, supports=held)
    history = impactfem.solve(made).history
    return history["time"].values - 0.5 * dt, history["contact_force"].values, history


def peaks(time, force):
    """Largest force of each contact, its time, its start and its end."""
    on = np.diff(np.concatenate([[0], (force > 0.0).astype(int), [0]]))
    found = []
    for first, last in zip(np.flatnonzero(on > 0), np.flatnonzero(on < 0), strict=True):
        k = first + int(np.argmax(force[first:last]))
        y = force[k - 1 : k + 2]
        way = 0.5 * (y[0] - y[2]) / (y[0] - 2.0 * y[1] + y[2])
        step = time[1] - time[0]
        begin, end = time[first] - 0.5 * step, time[last - 1] + 0.5 * step
        found.append([y[1] - 0.25 * (y[0] - y[2]) * way, time[k] + way * step, begin, end])
    return np.array(found)


def test_the_modal_sum_has_the_known_figures():
    time, force, speed = by_modes(0.01, 8e-5)
    (peak, at, _, end), *others = peaks(time, force)
    assert not others
    assert peak == pytest.approx(1379.64, rel=2e-4)
    assert at == pytest.approx(32.730e-6, rel=1e-3)
    assert end == pytest.approx(73.040e-6, abs=1e-7)
    assert speed == pytest.approx(0.66415, rel=2e-4)


@pytest.mark.parametrize(
    ("count", "near"), [(16, 0.003), pytest.param(32, 0.002, marks=pytest.mark.slow)]
)
def test_karas(tmp_path, count, near):
    time, force, history = karas(tmp_path, 0.01, count, 8e-5, 2e-6 / count)
    (peak, at, _, end), *others = peaks(time, force)
    assert not others
    assert peak == pytest.approx(1379.64, rel=near)
    assert at == pytest.approx(32.730e-6, rel=near)
    assert end == pytest.approx(73.040e-6, rel=near)
    assert history["ball.vz"].values[-1] == pytest.approx(0.66415, rel=near)
    assert np.ptp(history["total_energy"].values) < 1e-6 * history["total_energy"].values[0]


@pytest.mark.slow
@pytest.mark.parametrize(("radius", "duration", "contacts"), [(0.02, 3e-4, 1), (0.03, 9e-4, 2)])
def test_larger_balls_against_the_modal_sum(tmp_path, radius, duration, contacts):
    known = by_modes(radius, duration, dt=4e-7)
    time, force, history = karas(tmp_path, radius, 16, duration, 1e-6)
    one, two = peaks(time, force), peaks(*known[:2])
    assert len(one) == len(two) == contacts
    np.testing.assert_allclose(one[:, :2], two[:, :2], rtol=0.01)
    np.testing.assert_allclose(one[:, 2:], two[:, 2:], rtol=0.01, atol=2e-6)
    assert history["ball.vz"].values[-1] == pytest.approx(known[2], rel=0.01)


ZENER = {0.05: 0.917772, 0.1: 0.843339, 0.2: 0.714045, 0.5: 0.436895}


def zener(number):
    """Coefficient of restitution of Zener's equation: s'' + (1 + lambda d/dt) s^1.5 = 0."""

    def rate(_, y):
        pushed = max(y[0], 0.0) ** 1.5
        return [y[1], -pushed - number * 1.5 * math.sqrt(max(y[0], 0.0)) * y[1], pushed]

    def leaves(_, y):
        return y[0]

    leaves.terminal, leaves.direction = True, -1.0
    run = solve_ivp(rate, (0.0, 10.0), [0.0, 1.0, 0.0], events=leaves, rtol=1e-10, atol=1e-12)
    return run.y[2, -1] - 1.0


@pytest.mark.parametrize("number", [0.1, 0.5])
@pytest.mark.slow
def test_zener(tmp_path, number):
    """A ball on a plate so large that waves do not come back in its contact."""
    assert zener(number) == pytest.approx(ZENER[number], abs=2e-6)
    thin, radius = 0.002, 0.02
    rigidity, surface = E * thin**3 / (12.0 * (1.0 - NU**2)), RHO * thin
    k = hertz(radius)
    mass = (number * 8.0 * math.sqrt(rigidity * surface) / k**0.4) ** (5.0 / 3.0)
    lasts = 3.7 * (mass**2 / k**2) ** 0.2
    spread = math.sqrt(lasts * math.sqrt(rigidity / surface))
    path = tmp_path / "plate.msh"
    square(path, 12.0 * spread, 26, 1.12)
    made = scene(path, radius, mass, k, lasts, lasts / 300.0, thickness=thin, supports=[])
    history = impactfem.solve(made).history
    assert history["contact_force"].values[-1] == 0.0
    assert history["ball.vz"].values[-1] == pytest.approx(ZENER[number], rel=0.01)


def test_karas_with_shear_on_a_patch(tmp_path):
    """A Gaussian of half the thickness: without it the force falls without end, 1322, 1308 N."""
    patch, path = 0.5 * THICKNESS, tmp_path / "plate.msh"
    times, forces, speed = by_modes(0.01, 8e-5, modes=shearing_modes(patch))
    known = peaks(times, forces)[0]
    square(path, 0.5 * SIDE, 32)
    held = [
        {"edge": edge, "kind": "simply_supported"} for edge in ("left", "right", "bottom", "top")
    ]
    keys = {"supports": held, "theory": "reissner_mindlin", "patch_radius": patch}
    made = scene(path, 0.01, mass_of(0.01), hertz(0.01), 8e-5, 2.5e-7, **keys)
    history = impactfem.solve(made).history
    force = history["contact_force"].values
    found = peaks(history["time"].values - 1.25e-7, force)[0]
    assert found[:2] == pytest.approx(known[:2], rel=3e-3)
    assert history["ball.vz"].values[-1] == pytest.approx(speed, rel=2e-3)
    energy = history["total_energy"].values
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-6  # closest places slide over triangles


@pytest.mark.parametrize(("number", "lasts"), [(0.2, 100.0), (0.5, 100.0)])
def test_zener_by_finite_elements_of_the_body(number, lasts):
    """A rigid ball on the axis of a plate as a solid, whose dent is no law but elements of a/6.

    The contact takes 100 times as long as a wave through the thickness, so that the plate is thin
    for it; its rim is too far away to be heard of.
    """
    rigidity, radius, scaled = 1.0 / (12.0 * (1.0 - NU**2)), 5.0, {0.2: 3.34866, 0.5: 3.62444}
    k = 4.0 / 3.0 / (1.0 - NU**2) * math.sqrt(radius)
    root = number * 8.0 * math.sqrt(rigidity)  # K^0.4 v^0.2 m^0.6
    speed = (scaled[number] * root ** (2.0 / 3.0) / lasts) ** 3 / k**2
    mass = (root / (k**0.4 * speed**0.2)) ** (5.0 / 3.0)
    touching = math.sqrt(radius * speed * lasts / 2.94)  # radius of the contact, by Hertz
    plate = {
        "kind": "solid", "name": "plate", "model": "axisymmetric", "strain": "small",
        "shape": {"kind": "block", "size": [60.0, 1.0], "corner": [0.0, -1.0]}, "mesh_size": 0.45,
        "refine": [{"point": [0.0, 0.0], "radius": 3.0 * touching, "size": touching / 6.0}],
        "degree": 2, "density": 1.0, "youngs_modulus": 1.0, "poisson_ratio": NU,
        "contact_surfaces": ["top"],
    }  # fmt: skip
    ball = {"kind": "point", "name": "ball", "mass": mass, "radius": radius,
            "position": [0.0, radius + 1e-9], "velocity": [0.0, -speed]}  # fmt: skip
    made = Scene.from_dict(
        {"title": "Zener", "duration": 1.08 * lasts, "gravity": [0.0, 0.0], "body": [plate, ball],
         "solve": {"dt": lasts / 200.0, "estimate": False, "method": "conserving"},
         "output": {"fields": []}}
    )  # fmt: skip
    history = impactfem.solve(made).history
    assert history["contact_force"].values[-1] == 0.0
    assert history["ball.vy"].values[-1] / speed == pytest.approx(ZENER[number], rel=0.03)


def strip_by_modes(beam, mass, k, duration, dt, most=40):
    """Times, and the force on the middle of a clamped beam by a mass with 1 m/s, a spring between.

    Modes of even shape, the others by their statics: each is exact for a force that is linear in a
    step.

    Args:
        beam: Its stiffness E I [N m^2], mass by the length [kg/m], and length [m].
        mass: [kg].
        k: Of the spring [N/m].
        duration: [s].
        dt: [s].
        most: Modes.
    """
    bending, line, length = beam
    roots = [
        brentq(lambda x: math.cos(x) - 1.0 / math.cosh(x), (2 * j + 1.5) * math.pi - 0.5,
               (2 * j + 1.5) * math.pi + 0.5)
        for j in range(most)
    ]  # fmt: skip
    beta = np.array(roots)
    w = beta**2 / length**2 * math.sqrt(bending / line)
    # Middle of cosh - cos - s (sinh - sin), whose mean square is 1.
    s = (np.cosh(beta) - np.cos(beta)) / (np.sinh(beta) - np.sin(beta))
    half = beta / 2.0
    shape = np.cosh(half) - np.cos(half) - s * (np.sinh(half) - np.sin(half))
    b = shape**2 / (line * length)
    tail = length**3 / (192.0 * bending) - (b / w**2).sum()
    cosine, sine = np.cos(w * dt), np.sin(w * dt)
    q, v, z, speed, force, forces = np.zeros(most), np.zeros(most), 0.0, 1.0, 0.0, [0.0]

    def moved(new):
        slope, part = (new - force) / dt, b / w**2
        one, two = q - part * force, v / w - part * slope / w
        return cosine * one + sine * two + part * new, w * (
            cosine * two - sine * one
        ) + part * slope

    for _ in range(round(duration / dt)):
        still = moved(0.0)[0].sum()
        per = moved(1.0)[0].sum() - still + tail + dt**2 / (6.0 * mass)
        coast = z + speed * dt - dt**2 * force / (3.0 * mass)
        new = max(0.0, k * (coast - still) / (1.0 + k * per))
        end = moved(new)
        z, speed = coast - dt**2 / (6.0 * mass) * new, speed - 0.5 * dt / mass * (force + new)
        (q, v), force = end, new
        forces.append(force)
    return dt * np.arange(len(forces)), np.array(forces)


def test_mass_dropped_on_a_clamped_strip(tmp_path):
    """A narrow strip without Poisson's ratio is a beam: three contacts; later ones are chaotic."""
    length, width, thin, mass, k = 0.2, 0.01, 0.001, 0.01, 2e5
    path = tmp_path / "strip.msh"
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo = gmsh.model.geo
        x, y = 0.5 * length, 0.5 * width
        point = [geo.addPoint(a, c, 0.0) for a, c in ((-x, -y), (x, -y), (x, y), (-x, y))]
        sides = [geo.addLine(point[j], point[(j + 1) % 4]) for j in range(4)]
        for side, count in zip(sides, (80, 4, 80, 4), strict=True):
            geo.mesh.setTransfiniteCurve(side, count + 1)
        face = geo.addPlaneSurface([geo.addCurveLoop(sides)])
        geo.mesh.setTransfiniteSurface(face, "AlternateLeft")
        geo.synchronize()
        for name, side in (("right", sides[1]), ("left", sides[3])):
            gmsh.model.addPhysicalGroup(1, [side], name=name)
        gmsh.model.addPhysicalGroup(2, [face], name="strip")
        gmsh.model.mesh.generate(2)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()
    held = [{"edge": edge, "kind": "clamped"} for edge in ("left", "right")]
    keys = {"thickness": thin, "supports": held, "poisson_ratio": 0.0}
    made = scene(path, 0.01, mass, k, 4.15e-3, 4e-6, **keys).to_dict()
    made["contact"][0]["stiffness_exponent"] = 1.0
    history = impactfem.solve(Scene.from_dict(made)).history
    time, force = history["time"].values, history["contact_force"].values
    beam = E * width * thin**3 / 12.0, RHO * width * thin, length
    known, exact = strip_by_modes(beam, mass, k, 4.15e-3, 1e-6)
    assert np.count_nonzero((exact[1:] > 0.0) & (exact[:-1] == 0.0)) >= 2
    impulses = 4e-6 * np.cumsum(force), 1e-6 * np.cumsum(exact)
    ways = np.interp(time, known, impulses[1])
    assert np.abs(impulses[0] - ways).max() < 0.01 * ways[-1]
