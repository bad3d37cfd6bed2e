"""What our methods are held against: time loops as a peer would write them with NumPy or SciPy.

Each takes a scene and a number of elements and returns the motion with the seconds of its loop
alone: meshes, assembly, factors and the tables of results are not counted, in their favour.
"""

import time
from functools import partial

import numpy as np
from dolfinx_system import assembled
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import splu

from impactfem.result.bar_motion import BarMotion, Effort, kept_levels
from impactfem.scene import Scene
from impactfem.studies.precision import Baseline

Floats = NDArray[np.float64]
KEPT = 400


def numpy_leapfrog(scene: Scene, elements: int, courant: float = 0.9) -> tuple[BarMotion, float]:
    """Velocity Verlet on lumped linear elements; the contact node is massless."""
    bar = scene.bodies[0]
    x = np.linspace(0.0, bar.length, elements + 1)
    h, c = bar.length / elements, bar.wave_speed
    dt = courant * h / c
    layers = int(np.ceil(scene.duration / dt - 1e-9))
    k = c**2 / h
    mass = np.full(elements + 1, h)
    mass[0], mass[1], mass[-1] = 0.0, 1.5 * h, 0.5 * h
    clamped = bar.far_end == "clamped"
    u, v = _initial(scene, x)
    gravity = scene.gravity(dt * np.arange(layers + 1))
    every = max(1, layers // KEPT)
    kept = kept_levels(layers, every)
    us, vs = np.empty((len(kept), elements + 1)), np.empty((len(kept), elements + 1))
    gap, force = np.empty(layers + 1), np.empty(layers + 1)
    a, pull = np.zeros(elements), np.zeros(elements + 1)
    start = time.perf_counter()
    for m in range(layers + 1):
        if m:
            v[1:] += 0.5 * dt * a
            u[1:] += dt * v[1:]
        u[0] = max(u[1], 0.0)
        pull[:-1] = k * np.diff(u)
        a = np.diff(pull) / mass[1:] - gravity[m]
        if clamped:
            a[-1] = 0.0
        if m:
            v[1:] += 0.5 * dt * a
        gap[m], force[m] = u[0], pull[0]
        if m % every == 0:
            us[m // every], vs[m // every] = u, v
    seconds = time.perf_counter() - start
    us[-1], vs[-1] = u, v
    # The force of a layer: the mean of its ends, free of the half layer's delay.
    multiplier = np.minimum(0.5 * (force[1:] + force[:-1]), 0.0)
    motion = _motion(scene, x, dt, kept, us, vs, gap, multiplier, mass)
    return motion, seconds


def dolfinx_newmark(scene: Scene, elements: int, courant: float = 1.0) -> tuple[BarMotion, float]:
    """Newmark 1/4 with matrices of DOLFINx, SciPy's sparse LU kept, massless contact node.

    Each step is solved free, and once more with the contact node held if it got into the wall.
    """
    bar = scene.bodies[0]
    x, mass, stiffness = assembled(bar.length, elements, bar.wave_speed)
    n = elements + 1
    dt = courant * bar.length / elements / bar.wave_speed
    layers = int(np.ceil(scene.duration / dt - 1e-9))
    mass[1] += mass[0]
    mass[0] = 0.0
    weight = 4.0 / dt**2
    system = (stiffness + diags(weight * mass)).tocsc()
    clamped = bar.far_end == "clamped"
    held = [n - 1] if clamped else []
    u, v = _initial(scene, x)
    free, stuck = splu(_hold(system, held)), splu(_hold(system, [0, *held]))
    gravity = scene.gravity(dt * np.arange(layers + 1))
    every = max(1, layers // KEPT)
    kept = kept_levels(layers, every)
    us, vs = np.empty((len(kept), n)), np.empty((len(kept), n))
    gap, force = np.empty(layers + 1), np.zeros(layers)
    us[0], vs[0], gap[0] = u, v, u[0]
    a = np.zeros(n)
    a[1:] = -(stiffness @ u)[1:] / mass[1:] - gravity[0]
    if clamped:
        a[-1] = 0.0
    end = u[-1]
    start = time.perf_counter()
    for m in range(layers):
        b = mass * (weight * u + 4.0 / dt * v + a - gravity[m + 1])
        if clamped:
            b[-1] = end
        new = free.solve(b)
        if new[0] < 0.0:
            b[0] = 0.0
            new = stuck.solve(b)
            force[m] = stiffness[0, :].dot(new)[0]
        ahead = weight * (new - u - dt * v) - a
        v += 0.5 * dt * (a + ahead)
        u, a = new, ahead
        gap[m + 1] = u[0]
        if (m + 1) % every == 0:
            us[(m + 1) // every], vs[(m + 1) // every] = u, v
    seconds = time.perf_counter() - start
    us[-1], vs[-1] = u, v
    return _motion(scene, x, dt, kept, us, vs, gap, -np.abs(force), mass), seconds


def _initial(scene: Scene, x: Floats) -> tuple[Floats, Floats]:
    bar = scene.bodies[0]
    u = bar.initial_displacement(x=x) + np.zeros_like(x)
    v = bar.initial_velocity(x=x) + np.zeros_like(x)
    if bar.far_end == "clamped":
        v[-1] = 0.0
    return u, v


def _hold(matrix: csc_matrix, nodes: list[int]) -> csc_matrix:
    """Rows of held nodes become those of the identity."""
    rows = matrix.tolil()
    for node in nodes:
        rows[node, :] = 0.0
        rows[node, node] = 1.0
    return rows.tocsc()


def _motion(
    scene: Scene, x: Floats, dt: float, kept: NDArray[np.int64], us: Floats, vs: Floats,
    gap: Floats, multiplier: Floats, mass: Floats,
) -> BarMotion:  # fmt: skip
    """The motion; energies are those of the last kept level."""
    bar, layers = scene.bodies[0], len(multiplier)
    times = dt * np.arange(layers + 1)
    last = np.searchsorted(kept, np.arange(layers + 1), side="right") - 1
    kinetic = 0.5 * vs**2 @ mass
    elastic = 0.5 * bar.wave_speed**2 * np.sum(np.diff(us, axis=1) ** 2 / np.diff(x), axis=1)
    mean, speed = us @ mass / bar.length, vs @ mass / bar.length
    p = scene.gravity(0.5 * (times[kept][1:] + times[kept][:-1]))
    work = np.cumsum(np.append(scene.gravity(0.0) * mean[0], p * np.diff(mean)))
    return BarMotion(
        times, x, kept, us, vs, gap, multiplier, multiplier < 0.0, kinetic[last], elastic[last],
        bar.length * work[last], mean[last], speed[last],
        Effort(len(x) * layers, 1, (), True, "loop"),
    )  # fmt: skip


BASELINES: dict[str, Baseline] = {
    "NumPy leapfrog": numpy_leapfrog,
    "DOLFINx + SciPy Newmark": partial(dolfinx_newmark, courant=1.0),
}
"""Baselines by the name that tables and pictures show."""
