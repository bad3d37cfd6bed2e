"""Compiled search for the places where axes cross others, on the way across both."""

import numpy as np

from impactfem.compiled import compiled

_PARALLEL = 1e-6  # sine of the angle from which on lines cross
_ROUNDING = 1e-9  # share of a line by which what is at its end is on it
_BESIDE = 0.25  # share of a chord by which curves may cross beside where chords do
_TWICE = 1e-7  # share of a line from which on two places are two
_WIDER = 0.02  # sine by which ways may lie beside the normals of faces: bodies turn in a layer
_STEPS, _DONE = 8, 1e-15  # of Newton's method along curves; a share that is rounding


@compiled
def crossed(curves, edges, normals, deep, most):
    """Where curves cross others, on the way across both.

    Chords say which pieces of two curves may cross, tangents where they do.

    Args:
        curves: Coefficients of 1, s, s^2, s^3 of places [m], s from 0 to 1, (pieces, 4, 3).
        edges: The same of the others, (edges, 4, 3).
        normals: Outward ones of the faces that meet at these, 0 if there are none; the first one of
            the face to the left seen from outside, (edges, 2, 3).
        deep: How far a place may lie behind an edge that has faces [m].
        most: Of the nearest places that are kept of a piece.

    Returns:
        Which piece, in rising order, which edge, (places,) each; s on both, (places, 2); the unit
        way from the edge to the piece, (places, 3); its length [m], negative behind faces, and the
        sine of the angle of both, (places,) each.
    """
    size = len(curves) * most
    which = np.empty((size, 2), dtype=np.int64)
    shares, normal, far = np.empty((size, 2)), np.empty((size, 3)), np.empty((size, 2))
    before = first = count = 0
    for k in range(len(curves)):
        for j in range(len(edges)):
            s, t = _chords(curves[k], edges[j])
            if not s < np.inf:
                continue
            s, t, n, apart, sine = _across(curves[k], edges[j], s, t)
            if not (min(s, t) >= -_ROUNDING and max(s, t) <= 1.0 + _ROUNDING):
                continue
            if _hidden(n, edges[j], normals[j]) or apart < -deep:
                n, apart = -n, -apart
                if _hidden(n, edges[j], normals[j]) or apart < -deep:
                    continue
            place, known = _at(curves[k], s), False
            for i in range(before, count):  # what is at a node is on both pieces
                way = _at(curves[which[i, 0]], shares[i, 0]) - place
                known |= way @ way <= _TWICE**2 * (curves[k, 1] @ curves[k, 1])
            at = count
            while at > first and far[at - 1, 0] > apart:
                at -= 1
            if known or at - first == most:
                continue
            count = min(count + 1, first + most)
            for i in range(count - 1, at, -1):
                which[i], shares[i], normal[i], far[i] = (
                    which[i - 1],
                    shares[i - 1],
                    normal[i - 1],
                    far[i - 1],
                )
            which[at, 0], which[at, 1], shares[at, 0], shares[at, 1] = k, j, s, t
            normal[at], far[at, 0], far[at, 1] = n, apart, sine
        before, first = first, count
    return which[:count, 0], which[:count, 1], shares[:count], normal[:count], far[:count]


@compiled
def _chords(one, two):
    """Shares of the chords of two pieces where they cross; infinite if that is not near them."""
    u, v, w = one[1] + one[2] + one[3], two[1] + two[2] + two[3], one[0] - two[0]
    uu, uv, vv, uw, vw = u @ u, u @ v, v @ v, u @ w, v @ w
    det = uu * vv - uv * uv
    if det > _PARALLEL**2 * uu * vv:
        s, t = (uv * vw - vv * uw) / det, (uu * vw - uv * uw) / det
        if min(s, t) >= -_BESIDE and max(s, t) <= 1.0 + _BESIDE:
            return s, t
    return np.inf, np.inf


@compiled
def _across(one, two, s, t):
    """Shares of two pieces where the way is across both, that, how far it is, and their sine."""
    for _ in range(_STEPS):
        u, v, w = _way(one, s), _way(two, t), _at(one, s) - _at(two, t)
        uu, uv, vv, uw, vw = u @ u, u @ v, v @ v, u @ w, v @ w
        det = uu * vv - uv * uv
        ds, dt = (uv * vw - vv * uw) / det, (uu * vw - uv * uw) / det
        s, t = s + ds, t + dt
        if max(abs(ds), abs(dt)) < _DONE:
            break
    u, v, w = _way(one, s), _way(two, t), _at(one, s) - _at(two, t)
    n = np.cross(u, v)
    length = np.sqrt(n @ n)
    n = n / length
    return s, t, n, w @ n, length / np.sqrt((u @ u) * (v @ v))


@compiled
def _hidden(n, edge, normals):
    """Whether a direction does not lie between the faces that meet at an edge."""
    if np.abs(normals).max() == 0.0:
        return False
    way = edge[1] / np.sqrt(edge[1] @ edge[1])
    return max(n @ np.cross(normals[0], way), n @ np.cross(way, normals[1])) > _WIDER


@compiled
def _at(curve, s):
    """Place of a piece."""
    return curve[0] + s * (curve[1] + s * (curve[2] + s * curve[3]))


@compiled
def _way(curve, s):
    """Its derivative."""
    return curve[1] + s * (2.0 * curve[2] + 3.0 * s * curve[3])
