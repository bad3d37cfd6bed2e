"""Which nodes of a surface a joint holds: those around its place."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.closest import closest_shares, distances
from impactfem.system.cuts import WHOLE, Cuts
from impactfem.system.rigid import in_space
from impactfem.system.stations import Tied

type Key = tuple[str, tuple[float, ...], float | Tied | None]
"""A side of a joint, its place at t = 0 [m], and the radius that it gives [m]."""

_FLAT = 1e-9  # share of the largest moment of a tip below which its nodes lie on a line

SHARE = 1.0 / 6.0
"""Of the largest extent of a surface: as far as a joint holds it about its place."""

_EDGE = 1.0 + 1e-9  # a node at the radius is within it


@dataclass(frozen=True)
class Region:
    """Nodes of a surface that a joint holds.

    Attributes:
        nodes: Which of those of the surface, (nodes,).
        radius: Largest distance from the foot of the joint's place [m].
        why: Where the radius is from, in words; empty if it was given.
    """

    nodes: Booleans
    radius: float
    why: str


def region(
    place: Floats,
    points: Floats,
    faces: Integers,
    radius: float | None,
    weights: Floats,
    free: Booleans,
    where: tuple[str, str],
) -> Region:
    """Nodes about the foot of a place on a surface.

    Without a radius they are those within a sixth of its largest extent, but no further than half
    way to its nearest edge, so that their mean is about the place. Where these are too few to tell
    how they turn, the nearest ones that do.

    Args:
        place: Of the joint [m], (dim,), which may stand off the surface.
        points: Nodes of the surface [m], (nodes, dim).
        faces: Corners of its lines or triangles, (faces, 2 or 3).
        radius: That of the scene [m].
        weights: Of the nodes in the mean, (nodes,).
        free: Which of them no support holds, (nodes,): others are in no region.
        where: Table of the joint and name of the side, for messages.

    Raises:
        KeyedError: Those within the radius do not.
    """

    def holds(nodes: Booleans) -> bool:
        return tip(points, weights * (nodes & free)) is not None

    corners = points[faces]
    shares = closest_shares(place[None], corners)
    nearest = int(distances(place[None], corners, shares)[1][0].argmin())
    foot = shares[0, nearest] @ corners[nearest]
    away = np.linalg.norm(points - foot, axis=1)
    least = _least(away, holds)
    table, side = where
    if radius is not None and (radius < np.inf or least):
        radius = radius or least
        found = away <= radius * _EDGE
        if not holds(found):
            text = f" = {radius:.6g}: {int(found.sum())} nodes of {side} are within it, too few to "
            text += "tell how they turn, or held by supports; give "
            text += f"{1.01 * least:.3g} or more, or finer elements." if least else "another place."
            raise KeyedError(table, "radius", text)
        return Region(found & free, radius, "")
    if not least:
        text = f" = {show(side)}: its nodes that no support holds are too few to tell how it turns;"
        raise KeyedError(table, "between", text + " give finer elements, or another surface.")
    size = float(np.ptp(points, axis=0).max())
    wide, rim = SHARE * size, 0.5 * _to_rim(foot, points, faces)
    for within, why in (
        (rim, "half way to its nearest edge"),
        (wide, "a sixth of its size"),
        (least, "the nearest that tell how it turns"),
    ):
        found = away <= within * _EDGE
        if within <= max(wide, least) and holds(found):
            return Region(found & free, within, why)
    raise AssertionError


def _least(away: Floats, holds: Callable[[Booleans], bool]) -> float:
    """Smallest radius whose nodes tell how they turn [m]; 0 if none does."""
    tried = np.unique(away)
    low, high = 0, len(tried)  # more nodes tell whatever fewer did
    while low < high:
        middle = (low + high) // 2
        if holds(away <= tried[middle] * _EDGE):
            high = middle
        else:
            low = middle + 1
    return float(tried[low]) if low < len(tried) else 0.0


def _to_rim(foot: Floats, points: Floats, faces: Integers) -> float:
    """Distance from the edge of a surface [m]; infinite of a closed one."""
    several = points.shape[1]  # corners of a face
    if faces.shape[1] != several:
        return np.inf
    sides = np.concatenate([np.delete(faces, k, axis=1) for k in range(several)])
    each, counts = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    rim = points[each[counts == 1]]
    if not len(rim):
        return np.inf
    return float(distances(foot[None], rim, closest_shares(foot[None], rim))[1].min())


def triangles(faces: Integers, dim: int) -> Integers:
    """Lines or triangles of faces with all of their nodes, by corners."""
    if dim == 2:
        return faces[:, :2]
    if faces.shape[1] in {4, 9}:
        return np.concatenate([faces[:, [0, 1, 2]], faces[:, [1, 3, 2]]])
    return faces[:, :3]


@dataclass(frozen=True)
class HeldRegion:
    """Nodes of a solid or a plate that joints hold at one place.

    Attributes:
        numbers: Canonical numbers of those that no support holds, increasing, (nodes,).
        points: Their places [m], (nodes, dim).
        areas: [m^2], (nodes,).
        every: How many nodes the surface has.
        radius: Within which they are [m].
        why: Where the radius is from, in words; empty if it was given.
        turns: Whether it turns: a place in a solid does not, nodes about it have its shape
            functions for areas.
        cuts: Planes of symmetry that leave these of the nodes.
    """

    numbers: Integers
    points: Floats
    areas: Floats
    every: int
    radius: float
    why: str
    turns: bool = True
    cuts: Cuts = WHOLE

    def tip(self) -> tuple[Floats, Floats]:
        """Its place (3,), and its velocity and spin by those of its nodes, (6, nodes, dim)."""
        if self.turns and (made := tip(self.points, self.areas, self.cuts)) is not None:
            return made
        dim = self.points.shape[1]
        rows = np.zeros((6, len(self.points), dim))
        rows[:dim] = self.areas[None, :, None] * np.eye(dim)[:, None]
        for axis, _ in self.cuts.planes:
            rows[axis] = 0.0
        return in_space(self.areas @ self.points), rows


@dataclass
class HeldRegions:
    """Regions of one body as they are found, no two of which share nodes.

    Attributes:
        regions: By the name of a side and a place.
        owners: Joints that hold them first.
    """

    regions: dict[Key, HeldRegion] = field(default_factory=dict)
    owners: dict[Key, str] = field(default_factory=dict)

    def add(
        self, index: int, joint: str, key: Key, made: HeldRegion, *, alone: bool = True
    ) -> None:
        """Add what a joint holds, by its number and name.

        Args:
            index: Of the joint.
            joint: Its name.
            key: Where it holds what.
            made: What it holds.
            alone: Whether no other may hold the same: springs and dampers leave nodes free.

        Raises:
            KeyedError: Another joint holds some of its nodes.
        """
        for other, known in self.regions.items() if alone else ():
            both = np.intersect1d(made.numbers, known.numbers)
            if len(both) and (other != key or not np.array_equal(made.numbers, known.numbers)):
                apart = float(np.linalg.norm(np.subtract(key[1], other[1])))
                text = f" = {made.radius:.6g}: joint {self.owners[other]}, {apart:.6g} m from it, "
                text += f"holds {len(both)} nodes of {key[0]} too, within {known.radius:.6g} m of "
                less = f"a radius below {0.5 * apart:.3g}, or finer elements."
                less = f"its place; give both {less}" if apart else "its place; give one radius."
                raise KeyedError(f"joint[{index}]", "radius", text + less)
        self.regions.setdefault(key, made)
        self.owners.setdefault(key, joint)


def tip(points: Floats, weights: Floats, cuts: Cuts = WHOLE) -> tuple[Floats, Floats] | None:
    """Place (3,) of a tip and its velocity and spin by those of nodes (6, nodes, dim).

    Of what planes cut it is that of the whole. None where its nodes do not tell how it turns.
    """
    if cuts.planes:
        images = 2 ** len(cuts.planes)
        made = tip(cuts.unfolded(points), np.tile(weights, images))
        return None if made is None else (made[0], cuts.folded(made[1]))
    dim = points.shape[1]
    whole = weights.sum()
    if not whole > 0.0:
        return None
    shares = weights / whole
    mean = shares @ points
    arms = in_space(points - mean)
    unit = np.eye(3)[:dim]
    moments = (arms**2).sum(axis=1)[:, None, None] * np.eye(3) - arms[:, :, None] * arms[:, None]
    moment = np.einsum("n,nij->ij", shares, moments)
    turns = slice(2, 3) if dim == 2 else slice(0, 3)  # in the plane one turn
    inner = moment[turns, turns]
    if np.linalg.eigvalsh(inner)[0] <= _FLAT * np.trace(moment):
        return None
    rows = np.zeros((6, len(points), dim))
    rows[:3] = shares[None, :, None] * np.eye(3)[:, None, :dim]
    turned = np.cross(arms[:, None], unit)  # r x e, (nodes, dim, 3)
    spins = np.einsum("n,ndk->knd", shares, turned)[turns]
    rows[3:][turns] = np.tensordot(np.linalg.inv(inner), spins, axes=1)
    return in_space(mean), rows
