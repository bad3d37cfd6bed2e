"""Hard cases of solids that compare runs or bring their own meshes."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.facade import Result
from impactfem.marching.schemes import SOLID_SCHEMES
from impactfem.studies.hard.board import Case, Facts
from impactfem.studies.hard.meshes import curved_disc, mesh_file, square
from impactfem.studies.hard.rows import Row, load
from impactfem.studies.hard.solids import (
    beyond,
    face,
    facts_of,
    graze,
    half,
    plain,
    resting,
    solved,
    told,
    untouched,
)

_DT = 1.0 / 16.0  # below the stable step of explicit methods, which would follow rounding


def units(method: str, row: Row) -> Facts:
    """The same motion of another size and material."""

    def dimensionless(size: float, density: float, modulus: float) -> NDArray[np.float64]:
        """Gap over size, force over E size^2 and energy over E size^3."""
        plane = modulus / row.scene().solid.youngs_modulus  # lambda + 2 mu
        speed = (plane / density) ** 0.5
        body: dict[str, Any] = {
            "shape": {"kind": "disc", "radius": 0.5 * size, "center": [0.0, 0.52 * size]},
            "mesh_size": 0.125 * size, "thickness": size, "density": density,
            "youngs_modulus": modulus, "velocity": [0.0, -0.1 * speed],
        }  # fmt: skip
        scene = row.scene(
            {
                "duration": 6.0 * size / speed,
                "gravity": [0.0, -0.01 * speed**2 / size],
                "solve.dt": _DT * size / speed,
                **{f"body.body.{key}": value for key, value in body.items()},
            }
        )
        history = solved(method, scene).history
        scales = {"gap": size, "contact_force": plane * size**2, "total_energy": plane * size**3}
        return np.stack([history[name].values / scale for name, scale in scales.items()])

    first = dimensionless(1.0, 1.0, row.scene().solid.youngs_modulus)
    other = dimensionless(*(row.given[name] for name in ("size", "density", "modulus")))
    scale = np.abs(first).max(axis=1, keepdims=True)
    return {"difference": float(np.abs((other - first) / scale).max())}


def incompressible(method: str, row: Row) -> Facts:
    """A disc with nu = 0.4999 behaves as with 0.499: it does not lock."""
    result = solved(method, row.scene())
    softer = solved(method, row.scene({"body.body.poisson_ratio": 0.499}))
    heights, other = (one.history["body.y"].values for one in (softer, result))
    moved = float(np.abs(heights - heights[0]).max())
    return facts_of(result) | {"locking": float(np.abs(other - heights).max()) / moved}


def _from_file(text: str, method: str, row: Row) -> Result:
    """A body falls whose mesh is in a file."""
    with mesh_file(text, "body.msh") as path:
        own: dict[str, Any] = {"shape": None, "mesh_size": None, "mesh": path}
        more = {f"body.body.{key}": value for key, value in own.items()}
        if not SOLID_SCHEMES[method].explicit:
            more["solve.dt"] = _DT  # the plan's step would follow slivers
        return solved(method, row.scene(more))


def slivers(method: str, row: Row) -> Facts:
    """A square falls flat on triangles with angles of 1e-2 and less."""
    return facts_of(_from_file(square(1e-3), method, row))


def two_materials(method: str, row: Row) -> Facts:
    """A square whose file has its triangles in a group of rubber and one of steel."""
    one, last = '2 1 "square"', "2 2 1 1 "
    text = square(1e-3).replace(one, '2 1 "rubber"\n2 9 "steel"')
    text = text.replace("$PhysicalNames\n5", "$PhysicalNames\n6")
    head, tail = text.rsplit(last, 1)
    return facts_of(_from_file(f"{head}2 2 9 9 {tail}", method, row))


def curved(method: str, row: Row) -> Facts:
    """A disc from a file of order 2; 16 straight edges would lose 2.6 % of its mass."""
    result = _from_file(curved_disc(), method, row)
    history = result.history
    speed = np.hypot(history["body.vx"].values, history["body.vy"].values)[0]
    mass = abs(float(history["momentum"].values[0])) / speed
    return facts_of(result) | {"mass": abs(mass / (np.pi / 4.0) - 1.0)}


CASES: tuple[Case, ...] = load(
    "solids",
    (
        plain, graze, resting, untouched, face, told, beyond, half,
        units, incompressible, slivers, two_materials, curved,
    ),
)  # fmt: skip
"""Hard cases of one solid."""
