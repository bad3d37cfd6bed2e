"""A result of a solid without a solver: a disc or ball that falls, is flattened and flies off."""

import numpy as np
from scipy.spatial import Delaunay

from impactfem.facade import Result
from impactfem.result import FieldSpool, Shape, StoredSnapshots
from impactfem.result.cell_kinds import KINDS
from impactfem.result.history import BodyMotion, Columns, make_history
from impactfem.scene import HalfSpace, Scene, Solid

RADIUS, GAP, SPEED, CONTACT, PEAK_FORCE, PEAK_PRESSURE = 0.5, 0.1, 0.5, (0.2, 0.7), 1e3, 4e3


def points_and_cells(dim, rings=6):
    """Nodes on rings or shells about the origin, and the simplices between them."""
    shells = [np.zeros((1, dim))]
    for k in range(1, rings + 1):
        if dim == 2:
            angle = 2.0 * np.pi * np.arange(6 * k) / (6 * k)
            arms = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        else:  # Fibonacci's lattice
            count = 12 * k * k + 6
            index = np.arange(count) + 0.5
            polar, around = np.arccos(1 - 2 * index / count), np.pi * (1 + 5**0.5) * index
            arms = np.stack([np.cos(around) * np.sin(polar), np.cos(polar),
                             np.sin(around) * np.sin(polar)], axis=1)  # fmt: skip
        shells.append(RADIUS * k / rings * arms)
    points = np.concatenate(shells)
    noise = 1e-9 * np.random.default_rng(0).random(points.shape)
    cells = Delaunay(points + noise).simplices
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    return points, cells[np.abs(np.linalg.det(edges)) > 1e-5 * RADIUS**dim]


def solid_result(path, dim=2, *, layers=25, obstacles=None, broken=False):
    """A result whose fields lie in a file; ``broken`` makes the last layer not finite."""
    local, cells = points_and_cells(dim)
    times = np.linspace(0.0, 1.2, layers)
    start, end = CONTACT
    pulse = np.where((times >= start) & (times <= end),
                     np.sin(np.pi * (times - start) / (end - start)), 0.0)  # fmt: skip
    centre = RADIUS + np.where(times < start, GAP - SPEED * times, SPEED * (times - end))
    centre[(times >= start) & (times <= end)] = RADIUS
    depth = 0.1 * RADIUS * pulse
    kind = KINDS["triangle" if dim == 2 else "tetrahedron", 1]
    rim = np.hypot.reduce(local, axis=1) > 0.999 * RADIUS
    rest = local.copy()
    rest[:, 1] += RADIUS + GAP
    with FieldSpool(path, [Shape("body", rest, cells, kind.vtk_type)]) as spool:
        for k, time in enumerate(times):
            place = local.copy()
            place[:, 1] += centre[k] - depth[k]
            low = rim & (place[:, 1] < 0.0)
            share = np.where(low, -place[:, 1] / max(depth[k], 1e-12), 0.0)
            place[:, 1] = np.maximum(place[:, 1], 0.0)
            stress = PEAK_PRESSURE * pulse[k] * (1.0 - local[:, 1] / RADIUS) / 2.0
            spool.append(
                time,
                {
                    "displacement": place - rest,
                    "velocity": np.zeros_like(place),
                    "von_mises": stress * (np.nan if broken and k == layers - 1 else 1.0),
                    "contact_pressure": PEAK_PRESSURE * pulse[k] * share,
                    "contact_force": np.outer(
                        PEAK_FORCE * pulse[k] * share / max(share.sum(), 1e-12), [0.0, 1.0, 0.0]
                    ),
                    "gap": np.where(rim & (local[:, 1] < 0.0), place[:, 1], np.nan),
                    "active": share > 0.0,
                },
            )
    zero = np.zeros(layers)
    velocity = np.gradient(centre, times)
    columns = Columns(
        time=times,
        gap=np.maximum(centre - RADIUS, 0.0),
        contact_force=PEAK_FORCE * pulse,
        kinetic_energy=0.5 * velocity**2,
        elastic_energy=0.5 * SPEED**2 - 0.5 * velocity**2,
        potential_energy=zero,
        momentum=np.outer(velocity, [1.0, 0.0, 0.0]),
        active=(pulse > 0.0).astype(np.int64),
        bodies={
            "body": BodyMotion(
                np.stack([zero, centre, zero], axis=1), np.stack([zero, velocity, zero], axis=1)
            )
        },
    )
    history = make_history(columns)
    history["momentum"].attrs["direction"] = np.array([0.0, 1.0, 0.0])
    normal = [0.0, 1.0, 0.0][:dim]
    shape = {"kind": "disc" if dim == 2 else "sphere", "radius": RADIUS,
             "center": [0.0, RADIUS + GAP, 0.0][:dim]}  # fmt: skip
    scene = Scene(
        title="Synthetic",
        duration=1.2,
        bodies=[
            Solid(
                name="body",
                model="plane_strain" if dim == 2 else "3d",
                shape=shape,
                mesh_size=0.1,
                density=1.0,
                youngs_modulus=1e4,
                poisson_ratio=0.3,
            )
        ],
        obstacles=obstacles or [HalfSpace(name="floor", point=[0.0] * dim, normal=normal)],
    )
    summary = {
        "title": scene.title,
        "status": "unstable" if broken else "completed",
        "method": "massless",
        "num_dofs": 2 * len(local),
        "num_steps": layers - 1,
        "wall_time": 1.5,
        "peak_memory_mib": 200.0,
        "ranks": 1,
        "active_set": {"iterations": 1, "set_changes": [], "converged": True, "message": "settled"},
        "energy": {"initial": 0.125, "final": 0.125, "max_relative_drift": 0.0,
                   "final_relative_drift": 0.0, "unexplained": 0.0, "max_relative_growth": 0.0,
                   "grows": False, "driven": False},
        "contact": {"intervals": [list(CONTACT)], "max_force": PEAK_FORCE, "impulse": 318.0,
                    "max_penetration": 0.0},
        "error": None,
        "details": {},
        "plan": {"method": "massless", "model": "a disc", "reasons": {}, "findings": []},
        "verdict": {"level": "care", "findings": []},
    }  # fmt: skip
    return Result(scene, history, summary, StoredSnapshots(path))
