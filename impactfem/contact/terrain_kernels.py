"""Compiled parts of `impactfem.contact.terrain`: triangles near a body, what it strikes of them."""

import numpy as np

from impactfem.compiled import compiled
from impactfem.contact.convex_kernels import separate, touching

_LEVEL = 1e-6  # sine of the angle to the axis below which a cylinder is met end-on
_SLOTS = 8  # contact points of a triangle


@compiled
def _aimed(body, axis, n):
    """The prism of a cylinder, turned so that an edge is lowest along a direction."""
    vertices, normals, flat, starts, loop, edges, ways, radius = body
    if not axis.any():
        return body
    down = (n @ axis) * axis - n
    length = np.sqrt(down @ down)
    if length <= _LEVEL:
        return body
    middle = np.zeros(3)
    for vertex in vertices:
        middle += vertex / len(vertices)
    arm = vertices[0] - middle
    arm = arm - (arm @ axis) * axis
    arm = arm / np.sqrt(arm @ arm)
    cosine, sine = (down @ arm) / length, (down @ np.cross(axis, arm)) / length
    turned, out = np.empty_like(vertices), np.empty_like(normals)
    for k in range(len(vertices)):
        turned[k] = middle + _spun(vertices[k] - middle, axis, cosine, sine)
    for k in range(len(normals)):
        out[k] = _spun(normals[k], axis, cosine, sine)
    return turned, out, flat, starts, loop, edges, ways, radius


@compiled
def _spun(vector, axis, cosine, sine):
    """A vector turned about an axis by an angle (Rodrigues)."""
    along = (axis @ vector) * (1.0 - cosine)
    return cosine * vector + sine * np.cross(axis, vector) + along * axis


@compiled
def struck(body, spine, axis, size, near, corners, normals):
    """Where edges and faces of a body meet those of triangles, but not by their own normals.

    Args:
        body: As `convex_kernels.separate` takes it.
        spine: Of a cylinder its axis with a radius, as that; of others the body.
        axis: Of a cylinder, (3,); 0 of others.
        size: Of the body [m].
        near: Triangles that are looked at.
        corners, normals: Of all triangles, (triangles, 3, 3) and (triangles, 3).

    Returns:
        Places on the core of the body and on the surface, directions to the body, (places, 3) each,
        and of which triangle they are.
    """
    most = _SLOTS * len(near)
    found, of, count = np.empty((3, most, 3)), np.empty(most, dtype=np.int64), 0
    flat, ends = np.zeros(1, dtype=np.bool_), np.array([0, 3])
    around, sides = np.array([0, 1, 2]), np.array([[0, 1], [1, 2], [2, 0]])
    seen = body
    for t in near:
        triangle, face, along = corners[t], np.empty((1, 3)), np.empty((3, 3))
        for k in range(3):
            face[0, k] = normals[t, k]
            way = triangle[(k + 1) % 3] - triangle[k]
            along[k] = way / np.sqrt(way @ way)
        other = triangle, face, flat, ends, around, sides, along, 0.0
        hint = np.zeros(3)
        if axis.any():
            hint, _, _ = separate(spine, other, hint, size)
            seen = _aimed(body, axis, hint)
        n, kind, index = separate(seen, other, hint, size)
        x, y, some = touching(seen, other, n, kind, index, size, _SLOTS)
        for j in range(some):
            found[0, count], found[1, count], found[2, count], of[count] = x[j], y[j], n, t
            count += 1
    return found[:, :count], of[:count]
