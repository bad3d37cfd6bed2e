"""Meshes of hard cases as text: triangles among given points, slivers, curved elements."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial import Delaunay

from impactfem.arrays import Floats
from impactfem.errors import MeshError


@contextmanager
def mesh_file(text: str, name: str = "mesh.msh") -> Iterator[str]:
    """The path of a file with a text; messages about it do not name its folder."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_text(text, encoding="ascii")
        try:
            yield str(path)
        except MeshError as error:
            raise MeshError(str(error).replace(f"{folder}/", "")) from error


def triangles(
    body: str, points: Floats, sides: Sequence[tuple[str, int, float]], shift: Sequence[float]
) -> str:
    """The Delaunay triangles of points of a rectangle, in Gmsh's format 2.2.

    Args:
        body: Name of the whole.
        points: Corners, points on the sides and within, shape (n, 2).
        sides: Name, axis and place of each side.
        shift: Where the origin goes.
    """
    corners = points[(found := Delaunay(points).simplices)]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    found = found[np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) > 1e-12]
    elements = [f"2 2 1 1 {i + 1} {j + 1} {k + 1}" for i, j, k in found]
    names = [f'2 1 "{body}"']
    for tag, (name, axis, end) in enumerate(sides, 2):
        there = np.flatnonzero(points[:, axis] == end) + 1
        line = there[np.argsort(points[there - 1, 1 - axis])]
        elements += [f"1 2 {tag} {tag} {i} {j}" for i, j in pairwise(line)]
        names.append(f'1 {tag} "{name}"')
    return gmsh_text(names, points + np.asarray(shift), elements)


def gmsh_text(names: Sequence[str], nodes: Floats, elements: Sequence[str]) -> str:
    """A plane mesh in Gmsh's format 2.2, from lines without the numbers that elements get."""
    places = [f"{k} {x!r} {y!r} 0" for k, (x, y) in enumerate(nodes.tolist(), 1)]
    parts = (
        ("MeshFormat", ["2.2 0 8"]),
        ("PhysicalNames", [str(len(names)), *names]),
        ("Nodes", [str(len(nodes)), *places]),
        ("Elements", [str(len(elements)), *(f"{k} {e}" for k, e in enumerate(elements, 1))]),
    )
    return "\n".join(f"${name}\n{'\n'.join(lines)}\n$End{name}" for name, lines in parts) + "\n"


def space_time(points: Floats, size: int, duration: float) -> str:
    """The rectangle (0, duration) x (0, 1) with points in it."""
    x = np.linspace(0.0, 1.0, size + 1)
    t = np.linspace(0.0, duration, round(duration * size) + 1)
    sides = [np.column_stack([t, np.full_like(t, end)]) for end in (0.0, 1.0)]
    ends = [np.column_stack([np.full(size - 1, end), x[1:-1]]) for end in (0.0, duration)]
    names = (("wall", 1, 0.0), ("far", 1, 1.0), ("start", 0, 0.0), ("end", 0, duration))
    return triangles("bar", np.concatenate([*sides, *ends, points]), names, (0.0, 0.0))


def square(near: float, number: int = 8) -> str:
    """A unit square above the floor by .02: pairs of inner points that lie ``near`` each other."""
    ends = np.linspace(0.0, 1.0, number + 1)
    grid = np.stack(np.meshgrid(ends, ends, indexing="ij"), axis=-1).reshape(-1, 2)
    inner = ((grid > 0.0) & (grid < 1.0)).all(axis=1)
    places = grid[inner] + np.random.default_rng(7).uniform(-0.02, 0.02, (int(inner.sum()), 2))
    points = np.concatenate([grid[~inner], places, places + np.array([near, 0.3 * near])])
    names = (("left", 0, 0.0), ("right", 0, 1.0), ("bottom", 1, 0.0), ("top", 1, 1.0))
    return triangles("square", points, names, (-0.5, 0.02))


def curved_disc(number: int = 16) -> str:
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
