"""The axis of a beam that is curved at t = 0: places at equal distances along it, and frames there.

Frames are carried along by the least turn from one tangent to the next, so that sections do not
turn about the axis (J. Langer, D. Singer, SIAM Rev. 38 (1996) 605-618: Bishop's frame).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.formula import Formula
from impactfem.scene.jets import motion_at
from impactfem.scene.values import NotAllowedError

_PIECES = 8  # of an element, between which frames are carried
_LEAST = 256  # pieces of an axis
_GAUSS = np.polynomial.legendre.leggauss(4)  # in a piece
_NEWTON = 3  # iterates from places that are linear in a piece
_EVEN = 1e-9  # tangents shorter than that share of the mean one have no direction


@dataclass(frozen=True)
class Curve:
    """A curved axis.

    Attributes:
        length: [m].
        middle: Its centre [m], (dim,).
        nodes: Places at equal distances along it [m], (elements + 1, dim).
        frames: Unit vectors there along the axis, the height and the width, in columns, (nodes, 3,
            3); in the plane the height lies in it.
        bend: Its largest curvature [1/m].
    """

    length: float
    middle: Floats
    nodes: Floats
    frames: Floats
    bend: float

    def nearest(self, place: Floats) -> tuple[Floats, float]:
        """Place on the chords between its nodes that is nearest to one (dim,), and how far [m]."""
        one, way = self.nodes[:-1], np.diff(self.nodes, axis=0)
        share = np.einsum("nd,nd->n", place - one, way) / np.einsum("nd,nd->n", way, way)
        found = one + np.clip(share, 0.0, 1.0)[:, None] * way
        far = np.linalg.norm(place - found, axis=1)
        k = int(far.argmin())
        return found[k], float(far[k])


def curve_of(
    formulas: Sequence[Formula], origin: Sequence[float], elements: int, wide: Floats | None
) -> Curve:
    """The curve by formulas in s from 0 to 1, from an origin (dim,).

    Args:
        formulas: One for each axis [m].
        origin: [m], (dim,).
        elements: Number of nodes less one.
        wide: Where the width lies at the first end, in space, (3,); None: across z.

    Raises:
        NotAllowedError: it has no finite places, stands still or begins along the width.
    """
    pieces = max(_PIECES, -(-_LEAST // elements)) * elements
    edges = np.linspace(0.0, 1.0, pieces + 1)
    inside = (edges[:-1, None] + (0.5 / pieces) * (1.0 + _GAUSS[0])).ravel()
    speeds = np.linalg.norm(_tangents(formulas, inside), axis=1)
    weights = np.tile(0.5 / pieces * _GAUSS[1], pieces)
    length = float(weights @ speeds)
    if not speeds.min() > _EVEN * length:
        raise NotAllowedError("its place stands still somewhere as s grows")
    middle = (weights * speeds) @ _places(formulas, inside) / length
    along = np.concatenate([[0.0], np.cumsum((weights * speeds).reshape(pieces, -1).sum(axis=1))])
    wanted = np.linspace(0.0, length, pieces + 1)
    s = np.interp(wanted, along, edges)
    for _ in range(_NEWTON):
        k = np.clip(np.searchsorted(edges, s, side="right") - 1, 0, pieces - 1)
        part = (s - edges[k])[:, None] * 0.5 * (1.0 + _GAUSS[0]) + edges[k][:, None]
        rate = np.linalg.norm(_tangents(formulas, part.ravel()), axis=1).reshape(part.shape)
        reached = along[k] + 0.5 * (s - edges[k]) * (rate @ _GAUSS[1])
        s = s - (reached - wanted) / np.linalg.norm(_tangents(formulas, s), axis=1)
        s = np.clip(s, 0.0, 1.0)
    tangents = _tangents(formulas, s)
    tangents = tangents / np.linalg.norm(tangents, axis=1)[:, None]
    turns = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
    step = pieces // elements
    places = np.asarray(origin, dtype=np.float64) + _places(formulas, s)
    return Curve(
        length, np.asarray(origin) + middle, places[::step], _frames(tangents, wide)[::step],
        float(turns.max()) * pieces / length,
    )  # fmt: skip


def _places(formulas: Sequence[Formula], s: Floats) -> Floats:
    """Places at some s (n,), (n, dim)."""
    return np.stack([np.broadcast_to(formula(s=s), s.shape) for formula in formulas], axis=1)


def _tangents(formulas: Sequence[Formula], s: Floats) -> Floats:
    """Their rates by s, (n, dim)."""
    found = np.stack([motion_at(formula, s, "s").rate for formula in formulas], axis=1)
    if not np.isfinite(found).all():
        raise NotAllowedError("it has no finite tangent at some s from 0 to 1")
    return found


def _frames(tangents: Floats, wide: Floats | None) -> Floats:
    """Frames in columns by unit tangents (n, dim), (n, 3, 3)."""
    count, dim = tangents.shape
    found = np.zeros((count, 3, 3))
    if dim == 2:
        found[:, :2, 0], found[:, 2, 2] = tangents, 1.0
        found[:, 0, 1], found[:, 1, 1] = -tangents[:, 1], tangents[:, 0]
        return found
    if wide is None:
        upright = abs(tangents[0, 2]) > 1.0 - 1e-9
        wide = np.array([0.0, 1.0, 0.0]) if upright else np.cross(tangents[0], [0.0, 0.0, 1.0])
    across = wide - (wide @ tangents[0]) * tangents[0]
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(wide):
        raise NotAllowedError("it begins along width_axis; give one across it")
    across = across / np.linalg.norm(across)
    for k, own in enumerate(tangents):
        if k:  # the least turn from the tangent before to this one
            last = tangents[k - 1]
            axis, cosine = np.cross(last, own), float(last @ own)
            turned = np.cross(axis, across)
            across = across + turned + np.cross(axis, turned) / (1.0 + cosine)
            across = across - (across @ own) * own
            across = across / np.linalg.norm(across)
        found[k] = np.stack([own, np.cross(across, own), across], axis=1)
    return found
