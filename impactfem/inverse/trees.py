"""Bodies and joints that runs take by steps, from event to event in coordinates of their joints.

Steps have no right derivatives at impacts. The same bodies in symbols (`impactfem.trajectory`) are
a system M(q) v' = f(t, q, v) with gaps, which `event_driven` follows from impact to impact, through
lasting contact and friction, with the saltation of all of these (`impactfem.vibro.tangents`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, override

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.events import EventRuns
from impactfem.models.vibro import VibroModel
from impactfem.planning import Plan
from impactfem.result.history import BodyMotion
from impactfem.result.table import Series, Table
from impactfem.result.trajectory import Trajectory
from impactfem.scene import Mechanism, Point, RigidBody, Scene
from impactfem.scene.breaks import Break
from impactfem.scene.means import stops_of
from impactfem.trajectory.bodies import Symbolic, symbolic
from impactfem.trajectory.contacts import Closing, closings, system_of
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.tree import Tree
from impactfem.vibro.event_driven import EventSettings

_UNITS = {"q": "m or rad", "v": "m/s or rad/s", "angle": "rad", "spin": "rad/s"}
_UNITS |= dict.fromkeys(("x", "y", "z"), "m") | dict.fromkeys(("vx", "vy", "vz"), "m/s")
_UNITS |= dict.fromkeys(("qw", "qx", "qy", "qz"), "1") | dict.fromkeys(("wx", "wy", "wz"), "rad/s")


def is_tree(scene: Scene) -> bool:
    """Whether bodies that runs take by steps have such coordinates."""
    kinds = Point | RigidBody | Mechanism
    return scene.solver == "march" and all(isinstance(body, kinds) for body in scene.bodies)


@dataclass(frozen=True)
class TreeModel(VibroModel):
    """Bodies and joints as a system.

    Attributes:
        columns: Of rows of u and v to the columns that histories of joints have besides.
    """

    columns: Callable[[Floats, Floats], Mapping[str, Floats]] = lambda *_: {}


class TreeRuns(EventRuns):
    """Event-driven runs in coordinates of joints."""

    @classmethod
    def of(cls, chosen: Plan[Any], scene: Scene) -> "TreeRuns":
        """Of a plan.

        Raises:
            SceneError: The scene has no such coordinates, or contacts that have no right gradient.
        """
        tree_model(scene)
        return cls(chosen)

    @override
    def _model(self, scene: Scene) -> VibroModel:
        return tree_model(scene)

    @override
    def _settings(self, scene: Scene, times: Floats) -> EventSettings:
        return self._sharp(EventSettings(), times)

    @override
    def _history(self, scene: Scene, model: VibroModel, motion: Trajectory) -> Table:
        history = super()._history(scene, model, motion)
        if isinstance(model, TreeModel):
            for name, values in model.columns(motion.position, motion.velocity).items():
                unit = _UNITS[name.rpartition(".")[2]]
                history[name] = Series(("time",), values, {"units": unit, "long_name": name})
        return history


def tree_model(scene: Scene) -> TreeModel:
    """Make the system of a scene of points, rigid bodies, mechanisms and joints.

    Raises:
        SceneError: It has no such coordinates, or contacts that have no right gradient.
    """
    try:
        known = symbolic(scene)
    except SceneError as error:
        text = "gradients go from impact to impact in coordinates of joints, as trajectories do: "
        raise SceneError(f"{text}{error}") from None
    gaps, unseen = closings(scene, known)
    strange = [*unseen, *(each.pair for each in gaps if not each.known)]
    if strange:
        raise SceneError(
            f"contact {strange[0]}: has no right gradient (known are corners and balls on half-"
            "spaces and balls on balls, by restitution, in the plane with friction): say in "
            "[[contact]] what may meet, and leave this one out if it does not; or give contacts a "
            "stiffness, of which time steps have derivatives"
        )
    return _model(scene, known, gaps)


def _model(scene: Scene, known: Symbolic, gaps: Sequence[Closing]) -> TreeModel:
    casadi, tree = loaded(), known.tree
    readers = [control.reader(scene.duration) for control in scene.controls]
    system = system_of(
        known, gaps, lambda t: np.array([read(t) for read in readers]),
        lambda end: _stops(scene, end),
    )  # fmt: skip
    elastic = casadi.Function("elastic", [tree.q], [sum(tree.elastic, casadi.SX(0))])
    told = casadi.Function("told", [tree.q, tree.v], [casadi.vertcat(*known.columns.values())])

    def columns(u: Floats, v: Floats) -> dict[str, Floats]:
        rows = np.asarray(told(u.T, v.T), dtype=float)
        return dict(zip(known.columns, rows, strict=True))

    moving = [body for body in scene.bodies if f"{body.name}.vx" in known.columns]

    def bodies(u: Floats, v: Floats) -> dict[str, BodyMotion]:
        values, none = columns(u, v), np.zeros(len(u))
        found = {}
        for body in moving:
            place, speed = (
                np.stack([values.get(f"{body.name}.{head}{axis}", none) for axis in "xyz"], axis=1)
                for head in ("", "v")
            )
            turn, spin = (values.get(f"{body.name}.{name}") for name in ("angle", "spin"))
            found[body.name] = BodyMotion(
                place, speed, *(each if each is None else each[:, None] for each in (turn, spin))
            )
        return found

    pairs = tuple(dict.fromkeys(each.pair for each in gaps))
    return TreeModel(
        system, np.array([freedom.start for freedom in tree.freedoms]), known.start,
        tuple(each.name for each in gaps), pairs,
        np.array([pairs.index(each.pair) for each in gaps], dtype=np.int64),
        tuple(_mass(tree, body) for body in moving), bodies, lambda u: float(elastic(u)), True,
        f"{len(tree.parts)} bodies by {len(tree.freedoms)} coordinates", (), lambda u: u,
        dim=scene.dim, columns=columns,
    )  # fmt: skip


def _mass(tree: Tree, body: Any) -> float:
    own = [part.mass for name, part in tree.parts.items() if name.partition("/")[0] == body.name]
    return float(sum(own))


def _stops(scene: Scene, end: float) -> list[Break]:
    """When forces and motors jump, as the states at the start have them."""
    found = []
    for each in (*scene.bodies, *scene.joints):
        for name in ("force", "moment", "motor"):
            given = getattr(each, name, None) or ()
            for formula in given if isinstance(given, tuple) else (given,):
                still = dict.fromkeys(formula.used - {"t"}, 0.0)
                found += stops_of(formula.fixed(**still), end)
    return found
