"""Hard cases of solids beyond one scene: units, slivers, nearly incompressible bodies."""

import tempfile
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from impactfem.errors import MeshError
from impactfem.result import Result
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.solid_facts import (
    DISC,
    EXPLICIT,
    IMPULSE,
    SOLID,
    SPEED,
    claims,
    facts_of,
    run,
    solid_scene,
    solved,
    youngs_modulus,
)
from impactfem.studies.hard.special import gmsh_text

Floats = NDArray[np.float64]

# Materials by name: size [m], density [kg/m^3], Young's modulus [Pa]. Sizes are powers of 2: with
# others Gmsh rounds otherwise, and now and then decides for another mesh.
_UNITS = {
    "silicon disc of a micron": (2.0**-20, 2330.0, 160e9),
    "steel disc of 128 m": (128.0, 7850.0, 210e9),
}
_DT = 1.0 / 16.0  # below the stable step of explicit methods, which would follow rounding


def _dimensionless(method: str, size: float, density: float, modulus: float) -> Floats:
    """Gap over size, force over E size^2 and energy over E size^3 of the same motion."""
    plane = modulus / youngs_modulus(0.3)  # lambda + 2 mu
    speed = (plane / density) ** 0.5
    scene = solid_scene(
        6.0 * size / speed,
        gravity=(0.0, -0.01 * speed**2 / size),
        shape=DISC | {"radius": 0.5 * size, "center": [0.0, 0.52 * size]},
        mesh_size=0.125 * size,
        thickness=size,
        density=density,
        youngs_modulus=modulus,
        velocity=[0.0, -SPEED * speed],
    )
    history = solved(method, scene, dt=_DT * size / speed).history
    return np.stack(
        [
            history["gap"].values / size,
            history["contact_force"].values / (plane * size**2),
            history["total_energy"].values / (plane * size**3),
        ]
    )


def _in_units(data: tuple[float, float, float]) -> Any:
    def compare(method: str) -> Facts:
        base = _dimensionless(method, 1.0, 1.0, youngs_modulus(0.3))
        other = _dimensionless(method, *data)
        scale = np.abs(base).max(axis=1, keepdims=True)
        return {"difference": float(np.abs((other - base) / scale).max())}

    return compare


def _incompressible(method: str) -> Facts:
    """A disc with nu = 0.4999 behaves as with 0.499: it does not lock."""
    data: dict[str, Any] = {"degree": 2, "mesh_size": 0.2, "youngs_modulus": 1.0}
    softer, scene = (solid_scene(6.0, poisson_ratio=ratio, **data) for ratio in (0.499, 0.4999))
    settings = {"dt": 0.02}
    facts = run(method, scene, settings, pulse=False)
    heights = [solved(method, one, **settings).history["body.y"].values for one in (softer, scene)]
    moved = float(np.abs(heights[0] - heights[0][0]).max())
    return facts | {"locking": float(np.abs(heights[1] - heights[0]).max()) / moved}


def _square_mesh(near: float, number: int = 8) -> str:
    """A unit square above the floor by .02: pairs of inner points that lie ``near`` each other."""
    ends = np.linspace(0.0, 1.0, number + 1)
    grid = np.stack(np.meshgrid(ends, ends, indexing="ij"), axis=-1).reshape(-1, 2)
    inner = ((grid > 0.0) & (grid < 1.0)).all(axis=1)
    places = grid[inner] + np.random.default_rng(7).uniform(-0.02, 0.02, (int(inner.sum()), 2))
    points = np.concatenate([grid[~inner], places, places + np.array([near, 0.3 * near])])
    triangles = Delaunay(points).simplices
    corners = points[triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    turn = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    triangles = triangles[np.abs(turn) > 1e-12]
    elements = [f"2 2 1 1 {i + 1} {j + 1} {k + 1}" for i, j, k in triangles]
    names = ['2 1 "square"']
    for tag, (name, axis, end) in enumerate(
        (("left", 0, 0.0), ("right", 0, 1.0), ("bottom", 1, 0.0), ("top", 1, 1.0)), 2
    ):
        there = np.flatnonzero(points[:, axis] == end) + 1
        line = there[np.argsort(points[there - 1, 1 - axis])]
        elements += [f"1 2 {tag} {tag} {i} {j}" for i, j in pairwise(line)]
        names.append(f'1 {tag} "{name}"')
    return gmsh_text(names, points + np.array([-0.5, 0.02]), elements)


def _from_file(text: str, method: str, duration: float, **body: Any) -> Result:
    """A body falls whose mesh is in a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "body.msh"
        path.write_text(text, encoding="ascii")
        try:
            # The plan's step would follow slivers.
            settings = {} if method in EXPLICIT else {"dt": _DT}
            return solved(method, solid_scene(duration, mesh=str(path), **body), **settings)
        except MeshError as error:
            raise MeshError(str(error).replace(f"{folder}/", "")) from error


def _slivers(method: str) -> Facts:
    """A square falls flat on triangles with angles of 1e-2 and less."""
    return facts_of(_from_file(_square_mesh(1e-3), method, 4.0))


def _two_materials(method: str) -> Facts:
    """A square whose file has its triangles in a group of rubber and one of steel."""
    one, last = '2 1 "square"', "2 2 1 1 "
    text = _square_mesh(1e-3).replace(one, '2 1 "rubber"\n2 9 "steel"')
    text = text.replace("$PhysicalNames\n5", "$PhysicalNames\n6")
    head, tail = text.rsplit(last, 1)
    return facts_of(_from_file(f"{head}2 2 9 9 {tail}", method, 1.0))


def _curved_mesh(number: int = 16) -> str:
    """A disc of radius 1/2 above the floor by .02: a fan of triangles of order 2."""
    turns = np.pi * np.arange(2 * number) / number - np.pi / 2.0
    rim = 0.5 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    points = np.concatenate([[[0.0, 0.0]], rim, 0.5 * rim[::2]]) + np.array([0.0, 0.52])
    elements = []
    for k in range(number):
        one, middle, two = 1 + 2 * k, 2 + 2 * k, 1 + (2 * k + 2) % (2 * number)
        spokes = [1 + 2 * number + k, 1 + 2 * number + (k + 1) % number]
        nodes = [0, one, two, spokes[0], middle, spokes[1]]
        elements += [f"9 2 1 1 {' '.join(str(node + 1) for node in nodes)}"]
        elements += [f"8 2 2 2 {one + 1} {two + 1} {middle + 1}"]
    return gmsh_text(['2 1 "disc"', '1 2 "rim"'], points, elements)


def _curved(degree: int) -> Callable[[str], Facts]:
    def fall(method: str) -> Facts:
        """A disc from a file of order 2; 16 straight edges would lose 2.6 % of its mass."""
        result = _from_file(_curved_mesh(), method, 2.0, degree=degree)
        history = result.history
        speed = np.hypot(history["body.vx"].values, history["body.vy"].values)[0]
        mass = abs(float(history["momentum"].values[0])) / speed
        return facts_of(result) | {"mass": abs(mass / (np.pi / 4.0) - 1.0)}

    return fall


def _same(_: str) -> Sequence[Claim]:
    return [Claim("difference", 1e-9, "the equations know no units")]


CASES: tuple[Case, ...] = (
    *(Case(f"units: {name}", _in_units(data), _same, SOLID, quick=False, body="solid")
      for name, data in _UNITS.items()),
    Case("nu = 0.4999, degree 2", _incompressible,
         lambda m: [*claims(m, pulse=False), IMPULSE,
                    Claim("locking", 0.02, "the motion is as with nu = .499")],
         SOLID, frozenset(EXPLICIT), quick=False, body="solid"),
    Case("square of slivers", _slivers, lambda m: [*claims(m, pulse=False), IMPULSE], SOLID,
         quick=False, body="solid"),
    Case("mesh file of two materials", _two_materials, lambda _: [], SOLID, frozenset(SOLID),
         quick=False, body="solid"),
    Case("curved mesh file, degree 1", _curved(1), lambda _: [], SOLID, frozenset(SOLID),
         quick=False, body="solid"),
    Case("curved mesh file, degree 2", _curved(2),
         lambda m: [*claims(m, pulse=False), IMPULSE,
                    Claim("mass", 1e-3, "the curves of the file are kept")],
         SOLID, frozenset(EXPLICIT), quick=False, body="solid"),
)  # fmt: skip
"""Hard cases of solids that compare runs or bring their own meshes."""
