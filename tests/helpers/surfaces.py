"""Closed triangulated surfaces for tests, and STL files of them."""

import numpy as np

CUBE = np.array([[1, 0, 2], [2, 3, 1], [4, 5, 6], [7, 6, 5], [0, 1, 4], [5, 4, 1],
                 [2, 6, 3], [7, 3, 6], [0, 4, 2], [6, 2, 4], [1, 3, 5], [7, 5, 3]])  # fmt: skip


def box(size=(1.0, 1.0, 1.0), corner=(0.0, 0.0, 0.0)):
    """Corners of the triangles of a block, (12, 3, 3)."""
    places = np.array(list(np.ndindex(2, 2, 2)), dtype=float)[:, ::-1]
    return (np.array(corner) + places * np.array(size))[CUBE]


def swept(profile, pieces):
    """A closed profile (points, 2) of radius and height, revolved about y: (triangles, 3, 3)."""
    angle = 2.0 * np.pi * np.arange(pieces) / pieces
    r, y = np.asarray(profile).T
    places = np.stack(
        [np.outer(np.cos(angle), r), np.tile(y, (pieces, 1)), -np.outer(np.sin(angle), r)], axis=2
    )
    found = []
    for k in range(pieces):
        one, two = places[k], places[(k + 1) % pieces]
        for j in range(len(r)):
            i = (j + 1) % len(r)
            found += [[one[j], two[j], two[i]], [one[j], two[i], one[i]]]
    found = np.array(found)
    area = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    return found[area > 1e-12]


def sphere(radius, pieces, centre=(0.0, 0.0, 0.0)):
    """A ball whose corners lie on the sphere."""
    turn = np.pi * (np.arange(pieces + 1) / pieces - 0.5)
    profile = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    profile[[0, -1], 0] = 0.0
    return swept(profile, 2 * pieces) + np.array(centre)


def ell():
    """An L of three unit cubes, with a corner that bends inwards."""
    outline = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    flat = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    low, high = (np.insert(outline, 2, z, axis=1) for z in (0.0, 1.0))
    found = [low[flat][:, ::-1], high[flat]]
    for j in range(6):
        i = (j + 1) % 6
        found += [[[low[j], low[i], high[i]], [low[j], high[i], high[j]]]]
    return np.concatenate([np.array(part) for part in found])


def write_stl(path, corners, *, binary=False):
    """Write triangles (count, 3, 3) as STL."""
    if binary:
        layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
        data = np.zeros(len(corners), layout)
        data["corners"] = corners
        path.write_bytes(bytes(80) + len(corners).to_bytes(4, "little") + data.tobytes())
        return path
    lines = ["solid body"]
    for triangle in np.asarray(corners).tolist():
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x!r} {y!r} {z!r}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid body", ""]))
    return path


def write_half_square(path, size, foot):
    """A geometry file of a rectangle, 1 m by .5 m, one of whose four sides is named foot."""
    path.write_text(f"""
    Point(1) = {{0, 0, 0, {size}}}; Point(2) = {{1, 0, 0, {size}}};
    Point(3) = {{1, 0.5, 0, {size}}}; Point(4) = {{0, 0.5, 0, {size}}};
    Line(1) = {{1, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 4}}; Line(4) = {{4, 1}};
    Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}};
    Physical Surface("all") = {{1}}; Physical Curve("foot") = {{{foot}}};
    """)
