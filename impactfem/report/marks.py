"""Marks on bodies: what shows that they turn, their joints, and where they are held."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.report.skin import Skin, Snapshot
from impactfem.scene import Scene
from impactfem.scene.joints import GROUND

_TURNED = np.cos(np.radians(3.0))  # cosine of the angle of a body that is seen to turn
_WHOLE = 0.99  # correlation of its places with those of a rigid body
_BESIDE, _HOLE = 0.08, 0.3  # of the way from the middle to the rim
_STILL = 1e-9  # of the size, that a node moves which is held


@dataclass(frozen=True)
class Pin:
    """A place on a body, or on the ground.

    Attributes:
        nodes: Of the body, shape (nodes,).
        weights: Of their places, shape (nodes,).
        place: At t = 0 [m], shape (3,); where it stays if there are no nodes.
        grounded: Whether the joint holds to the ground.
        turns: Whether bodies turn about it.
    """

    nodes: Integers
    weights: Floats
    place: Floats
    grounded: bool
    turns: bool

    def at(self, snapshot: Snapshot) -> Floats:
        """Where it is [m], shape (3,)."""
        return self.weights @ snapshot.place[self.nodes] if len(self.nodes) else self.place


@dataclass(frozen=True)
class Marks:
    """What is drawn upon bodies.

    Attributes:
        pins: Of joints.
        held: Whether a node is held, shape (nodes,).
        whole: Numbers of the bodies that may turn as a whole.
        turned: Those that are seen to.
    """

    pins: Sequence[Pin] = ()
    held: Booleans = field(default_factory=lambda: np.empty(0, dtype=bool))
    whole: frozenset[int] = frozenset()
    turned: frozenset[int] = frozenset()

    @classmethod
    def of(cls, scene: Scene, skin: Skin) -> "Marks":
        """Joints, and nodes that are held as long as no snapshot shows them elsewhere."""
        start = skin.snapshot(0).place if scene.couplings else skin.points
        pins = [pin for joint in scene.couplings for pin in _pins(joint, skin, start)]
        names = [k for k, name in enumerate(skin.names) if _is_held(scene, name)]
        linked = {each.name for each in scene.mechanisms}
        whole = frozenset(k for k in skin.solid_nodes if skin.names[k] not in linked)
        return cls(tuple(pins), np.isin(skin.bodies, names), whole)

    def seen(self, skin: Skin, snapshot: Snapshot) -> "Marks":
        """With what a snapshot tells."""
        held = self.held
        if held.any():
            way = np.abs(snapshot.place - skin.points).max(axis=1)
            held = held & (way <= _STILL * skin.size)
        own = {} if skin.mirrors else {k: skin.solid_nodes[k] for k in self.whole}
        more = {
            k for k, nodes in own.items()
            if k not in self.turned and _has_turned(skin.points[nodes], snapshot.place[nodes])
        }  # fmt: skip
        return replace(self, held=held, turned=self.turned | more)


NO_MARKS = Marks()


def spoke(skin: Skin, snapshot: Snapshot, body: int) -> Floats:
    """A line from the middle of a body to its rim [m], or across a ring; shape (2, 3)."""
    nodes = skin.solid_nodes[body]
    start, rim = snapshot.place[nodes].mean(axis=0), int(np.argmax(skin.points[nodes, 0]))
    arms = skin.points[nodes] - skin.points[nodes].mean(axis=0)
    reach = float(np.linalg.norm(arms[rim]))
    along = arms @ arms[rim] / reach**2
    beside = np.linalg.norm(arms - along[:, None] * arms[rim], axis=1) < _BESIDE * reach
    first = int(np.argmin(np.where(beside & (along > 0.0), along, np.inf)))
    if _HOLE < along[first] < 0.95:
        start = snapshot.place[nodes[first]]
    return np.stack([start, snapshot.place[nodes[rim]]])


def _has_turned(points: Floats, places: Floats) -> bool:
    """Whether a body has turned as a whole, by the rotation that fits best (W. Kabsch, 1976)."""
    arms, turned = points - points.mean(axis=0), places - places.mean(axis=0)
    left, shares, right = np.linalg.svd(arms.T @ turned)
    sign = np.sign(np.linalg.det(left @ right))
    left[:, 2] *= sign
    fit = shares[:2].sum() + sign * shares[2]
    whole = np.linalg.norm(arms) * np.linalg.norm(turned)
    return bool(np.trace(left @ right) < 1.0 + 2.0 * _TURNED and fit > _WHOLE * whole)


def _is_held(scene: Scene, name: str) -> bool:
    body = next((body for body in scene.bodies if body.name == name), None)
    return bool(getattr(body, "supports", ()))


def _pins(joint: Any, skin: Skin, start: Floats) -> list[Pin]:
    sides = joint.between or ()
    places = joint.points or ([joint.point] * 2 if joint.point is not None else [])
    found = [
        _pin(side, place, skin, start, grounded=GROUND in sides, turns=joint.kind_of.turns)
        for side, place in zip(sides, places, strict=False)
        if side != GROUND or joint.points
    ]
    return found if joint.points else found[:1]


def _pin(
    side: str, given: Sequence[float], skin: Skin, start: Floats, *, grounded: bool, turns: bool
) -> Pin:
    place = np.zeros(3)
    place[: len(given)] = given
    known = [
        k for k, name in enumerate(skin.names)  # a link by its robot too, a surface by its solid
        if side in (name, name.split("/")[0]) or side.partition("/")[0] == name
    ]  # fmt: skip
    exact = [k for k in known if skin.names[k] == side] or known
    nodes = np.flatnonzero(np.isin(skin.bodies, exact)) if side != GROUND else np.empty(0, int)
    if not len(nodes):
        return Pin(nodes, np.empty(0), place, grounded, turns)
    arms = start[nodes]
    if skin.is_stressed[nodes].any() or exact[0] not in skin.solid_nodes:  # it is not rigid
        nearest = nodes[[int(np.linalg.norm(arms - place, axis=1).argmin())]]
        return Pin(nearest, np.ones(1), place, grounded, turns)
    # Weights that keep all affine motions, so those of a rigid body.
    system = np.vstack([arms.T / skin.size, np.ones(len(nodes))])
    weights = np.linalg.lstsq(system, np.append(place / skin.size, 1.0), rcond=None)[0]
    return Pin(nodes, weights, place, grounded, turns)
