"""Bodies, joints and springs of a scene as a tree in symbols."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene import Joint, Mechanism, Point, RigidBody, Scene
from impactfem.scene.couplings import SpringRow
from impactfem.scene.formula import Formula
from impactfem.scene.grammar import Node
from impactfem.scene.joints import GROUND
from impactfem.scene.values import show
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.tree import Freedom, Part, Rub, Tree, in_space, turning_of

if TYPE_CHECKING:
    from impactfem.trajectory.robots import RobotParts

_AXES = "xyz"
_JOINTS = ("fixed", "revolute", "prismatic", "cylindrical")
_ACROSS = np.array([0.0, 0.0, 1.0])
_CLOSERS = (*_JOINTS, "ball")
_HELD = "joint: they hold all bodies; nothing can move: leave one out"
_APART = 1e-9  # of the speeds, by which a start may differ from what joints let bodies do


@dataclass(frozen=True)
class Symbolic:
    """A scene in symbols.

    Attributes:
        tree: Its bodies.
        columns: Columns of its history, of t, q and v.
        controls: Symbols of its controls (m,).
        names: Of them.
        rate: v' (d,).
        start: Rates at t = 0 (d,).
        limits: Least and largest values of coordinates by name, that mechanisms have.
    """

    tree: Tree
    columns: Mapping[str, Any]
    controls: Any
    names: tuple[str, ...]
    rate: Any
    start: Floats
    limits: Mapping[str, tuple[float, float]]


def symbolic(scene: Scene) -> Symbolic:
    """A scene in symbols of CasADi.

    Raises:
        SceneError: It has bodies, joints or forces that have no such form.
    """
    names = tuple(control.name for control in scene.controls)
    # Controls stand in formulas as their histories, which are found again by unlike values.
    marked = scene.with_settings({
        f"control.{name}.{key}": value for k, name in enumerate(names)
        for key, value in _mark(scene, k).items()
    })  # fmt: skip
    return _Reader(marked, names).read()


def _mark(scene: Scene, k: int) -> dict[str, Any]:
    control = scene.controls[k]
    if control.along != "t":
        raise SceneError(f"control.{control.name}.along: a trajectory takes controls in time only")
    value = 0.5 + 1e-3 * k
    return {"kind": "linear", "pieces": 1, "start": [value, value + 1.0], "bounds": None}


class _Reader:
    """A scene on its way into symbols."""

    def __init__(self, scene: Scene, names: tuple[str, ...]) -> None:
        self.scene, self.names = scene, names
        casadi = loaded()
        self.controls = casadi.SX.sym("u", len(names))
        duration = scene.duration
        self.histories: dict[str, Node] = {c.name: c.tree(duration) for c in scene.controls}
        for what, given in (("controller", scene.controllers), ("tie", scene.ties)):
            if given:
                raise SceneError(
                    f"{what}.{given[0].name}: a trajectory knows none; it finds [[control]]s that "
                    "act on formulas: leave it out"
                )
        for body in scene.bodies:
            if not isinstance(body, Point | RigidBody | Mechanism):
                raise SceneError(
                    f"body.{body.name}: a trajectory knows points, rigid bodies, mechanisms, not "
                    f"{body.kind}; take these, or impactfem.transcribe"
                )

    def read(self) -> Symbolic:
        scene = self.scene
        self.tree = self._tree()
        for body in self.plain:
            self._forces(body)
        for robot in self.robots.values():
            self._drive(robot)
        for joint in scene.couplings:
            self._along(joint)
        self._close()
        rate = self.tree.forward()
        columns = self._columns()
        limits = {
            freedom.name: pair
            for robot in self.robots.values()
            for freedom, pair in zip(robot.freedoms, robot.limits, strict=True)
        }
        return Symbolic(
            self.tree, columns, self.controls, self.names, rate, self._start_rates(), limits
        )

    @property
    def plain(self) -> list[Any]:
        """Bodies that are no mechanisms."""
        return [body for body in self.scene.bodies if not isinstance(body, Mechanism)]

    # Coordinates

    def _tree(self) -> Tree:
        scene = self.scene
        freedoms: list[Freedom] = []
        chains: dict[str, list[int]] = {}
        held = [joint for joint in scene.joints if joint.holds]
        self.closers: list[Joint] = []
        left = [body.name for body in self.plain]
        self.places: dict[str, int] = {}  # of the coordinates of joints
        while left:
            self._grow(held, chains, freedoms)
            left = [name for name in left if name not in chains]
            if left:
                self._root(left[0], chains, freedoms)
        parts = {body.name: self._part(body, chains[body.name]) for body in self.plain}
        rotors = [0.0] * len(freedoms)
        self.robots: dict[str, RobotParts] = {}
        self.first: dict[str, int] = {}  # coordinate of each mechanism
        for body in scene.bodies:
            if isinstance(body, Mechanism):
                from impactfem.trajectory.robots import robot_parts  # noqa: PLC0415  (rare)

                robot = self.robots[body.name] = robot_parts(scene, body)
                first = self.first[body.name] = len(freedoms)
                freedoms += robot.freedoms
                rotors += robot.rotors.tolist()
                parts |= {
                    part.name: replace(part, freedoms=[first + k for k in moved])
                    for part, moved in zip(robot.parts, robot.above, strict=True)
                }
        if not freedoms:
            raise SceneError(_HELD)
        return Tree(freedoms, parts, rotors)

    def _grow(
        self, held: list[Joint], chains: dict[str, list[int]], freedoms: list[Freedom]
    ) -> None:
        """Add bodies that joints hold to those that are there."""
        while True:
            reached = {GROUND, *chains}
            joint = next((j for j in held if set(j.between or ()) & reached), None)
            if joint is None:
                return
            held.remove(joint)
            one, two = joint.between or ()
            self._check_joint(joint, _CLOSERS if {one, two} <= reached else _JOINTS)
            if {one, two} <= reached:
                self.closers.append(joint)
                continue
            parent, child = (one, two) if one in reached else (two, one)
            chain = list(chains.get(parent, ()))
            sign = 1.0 if child == two else -1.0
            for turns in _motions(joint.kind):
                axis = sign * (_ACROSS if joint.axis is None else _unit(joint.axis))
                start = joint.start if len(_motions(joint.kind)) == 1 or not turns else 0.0
                name = (f"{joint.name}.q", f"{joint.name}.v")
                if joint.kind == "cylindrical" and turns:
                    name = (f"{joint.name}.angle", f"{joint.name}.spin")
                else:
                    self.places[joint.name] = len(freedoms)
                chain.append(len(freedoms))
                point = in_space(joint.point or ())
                freedoms.append(Freedom(*name, turns, axis, point, start))
            chains[child] = chain

    def _root(self, name: str, chains: dict[str, list[int]], freedoms: list[Freedom]) -> None:
        """Add a body that nothing holds."""
        body = next(each for each in self.scene.bodies if each.name == name)
        centre = _centre(body)
        if isinstance(body, RigidBody) and body.dim == 3:
            chains[name] = list(range(len(freedoms), len(freedoms) + 7))
            freedoms += Freedom.free(name, centre, body.quaternion)
            return
        chains[name] = list(range(len(freedoms), len(freedoms) + len(centre)))
        for k, at in enumerate(centre):
            freedoms.append(
                Freedom(f"{name}.{_AXES[k]}", f"{name}.v{_AXES[k]}", False, np.eye(3)[k],
                        np.zeros(3), float(at))
            )  # fmt: skip
        if isinstance(body, RigidBody):
            chains[name].append(len(freedoms))
            freedoms.append(
                Freedom(
                    f"{name}.angle", f"{name}.spin", True, _ACROSS, in_space(centre), body.angle
                )
            )

    def _close(self) -> None:
        """Hold what closes loops, by rows that are independent as bodies are at t = 0."""
        casadi, tree = loaded(), self.tree
        start = [freedom.start for freedom in tree.freedoms]
        kept = np.zeros((0, len(start)))
        for joint in self.closers:
            tree.beyond = f"joint.{joint.name} closes a loop"
            acts = ("limits", "motor", "stiffness", "damping", "friction")
            given = next((name for name in acts if getattr(joint, name)), None)
            if given is not None:
                raise SceneError(
                    f"joint.{joint.name}.{given}: it closes a loop, which leaves it no coordinate; "
                    "put a joint of the loop on which nothing acts last"
                )
            for row in self._rows(joint):
                slope = casadi.Function("slope", [tree.q], [casadi.jacobian(row, tree.q)])(start)
                more = np.vstack([kept, np.asarray(slope, dtype=float)])
                if np.linalg.matrix_rank(more) > len(kept):
                    kept = more
                    tree.loops.append(row)
        if len(kept) == len(start):
            raise SceneError(_HELD)

    def _rows(self, joint: Joint) -> list[Any]:
        """What stays 0 in a joint, of q."""
        casadi, tree = loaded(), self.tree
        sides = [None if name == GROUND else name for name in joint.between or ()]
        axis = _ACROSS if joint.axis is None else _unit(joint.axis)
        frame = np.linalg.svd(axis[None])[2]  # along the axis, and twice across
        one, two = ([tree.turned(side, way) for way in frame] for side in sides)
        at = in_space(joint.point or ())
        apart = tree.place(sides[1], at) - tree.place(sides[0], at)
        shifts = [casadi.dot(way, apart) for way in one]
        tilts = [casadi.dot(one[1], two[0]), casadi.dot(one[2], two[0])]
        twist = casadi.dot(one[1], two[2])
        return {
            "ball": shifts, "revolute": shifts + tilts, "cylindrical": shifts[1:] + tilts,
            "prismatic": [*shifts[1:], *tilts, twist], "fixed": [*shifts, *tilts, twist],
        }[joint.kind]  # fmt: skip

    @staticmethod
    def _check_joint(joint: Joint, kinds: Sequence[str]) -> None:
        if joint.kind not in kinds:
            raise SceneError(
                f"joint.{joint.name}.kind = {show(joint.kind)}: a trajectory knows "
                f"{', '.join(kinds)}; take these"
            )
        for name in ("soft", "motion"):
            if getattr(joint, name):
                raise SceneError(
                    f"joint.{joint.name}.{name}: has no smooth form in a trajectory; leave it out"
                )
        if joint.is_driven:
            raise SceneError(
                f"joint.{joint.name}.position: a formula drives it; a trajectory knows motors: "
                "give motor and a control"
            )
        for side in joint.between or ():
            if "/" in side:
                raise SceneError(f"joint.{joint.name}.between: {side} is no rigid body or point")

    @staticmethod
    def _part(body: Any, chain: Sequence[int]) -> Part:
        centre, inertia = in_space(_centre(body)), np.zeros((3, 3))
        if isinstance(body, Point):
            return Part(body.name, chain, body.mass, centre, inertia)
        if body.dim == 2:
            inertia[2, 2] = body.moments[0, 0]
        else:
            turn = body.rotation
            inertia = turn @ body.moments @ turn.T
        return Part(body.name, chain, body.total_mass, centre, inertia)

    # Forces

    def _drive(self, robot: "RobotParts") -> None:
        """What acts on a mechanism: gravity, dampers and motors of its joints."""
        tree = self.tree
        for part in robot.parts:
            tree.weigh(part.name, part.mass * self._gravity())
        names = [freedom.name for freedom in tree.freedoms]
        for k, freedom in enumerate(robot.freedoms):
            at = names.index(freedom.name)
            q, v = tree.q[at], tree.v[at]
            force = -robot.damping[k] * v
            if k in robot.motors:
                force = force + self._value(robot.motors[k], {"t": tree.t, "q": q, "v": v})
            tree.push(q, force)
            name, _, joint = freedom.name.removesuffix(".q").partition(".")
            key = f"body.{name}.file: dry friction of joint {joint}"
            self._rub(key, freedom.rate, q, float(robot.friction[k]))

    def _gravity(self) -> Floats:
        """Constant (3,)."""
        gravity = self.scene.vector_gravity
        if not gravity.is_constant:
            raise SceneError("gravity: changes in time; a trajectory knows a constant one")
        return in_space(gravity.at(0.0))

    def _forces(self, body: Any) -> None:
        """Gravity, forces by formula, springs of a point."""
        casadi, tree = loaded(), self.tree
        centre = tree.centre(body.name)
        weight = body.mass if isinstance(body, Point) else body.total_mass
        tree.weigh(body.name, weight * self._gravity())
        known = self._state(body)
        if body.force:
            told = [self._value(each, known) for each in body.force]
            tree.push(centre, casadi.vertcat(*told, *[0.0] * (3 - len(told))))
        if isinstance(body, RigidBody) and body.moment:
            told = [self._value(each, known) for each in body.moment]
            tree.twist(body.name, casadi.vertcat(*([0.0, 0.0] if len(told) == 1 else []), *told))
        for spring in getattr(body, "springs", ()):
            other = np.zeros(3) if spring.anchor is None else in_space(spring.anchor)
            end = tree.place(None, other) if spring.to is None else tree.centre(spring.to)
            away = centre - end
            if spring.rest_length:
                away = casadi.norm_2(away) - spring.rest_length
            tree.pull(away, spring.stiffness, spring.damping)

    def _along(self, joint: Joint) -> None:
        """What acts along the coordinate of a joint, or of a spring."""
        tree = self.tree
        acts = joint.stiffness or joint.damping or joint.motor or joint.friction
        if not joint.moves or not acts or joint in self.closers:
            return
        if joint.holds:
            place = self.places[joint.name]  # counts from the first to the second body
            q, v = tree.q[place], tree.v[place]
        else:
            q = self._length(joint)
            v = tree.rate(q)
        rest = joint.start if joint.rest is None else joint.rest
        tree.pull(q - rest, joint.stiffness, joint.damping)
        if joint.motor is not None:
            tree.push(q, self._value(joint.motor, {"t": tree.t, "q": q, "v": v}))
        self._rub(f"joint.{joint.name}.friction", f"{joint.name}.v", q, joint.friction)

    def _rub(self, key: str, rate: str, q: Any, most: float) -> None:
        """Dry friction along a coordinate: constant where its rate keeps its sign, or unknown."""
        if not most:
            return
        wanted = self.scene.trajectory
        low, high = dict(wanted.bounds if wanted else {}).get(rate, (-np.inf, np.inf))
        self.tree.beyond = f"{key} is none of contacts"
        if low < 0.0 < high:
            self.tree.rubs.append(Rub(key, rate, self.tree.rate(q), most))
        else:
            self.tree.push(q, -most if low >= 0.0 else most)

    def _length(self, joint: Joint) -> Any:
        """Coordinate of what holds nothing: a length, or a way along a direction."""
        casadi, tree = loaded(), self.tree
        one, two = (None if name == GROUND else name for name in joint.between or ())
        for name in (one, two):
            if name is not None and name not in tree.parts:
                raise SceneError(f"{joint.heading}.{joint.name}.between: {name} is no body here")
        if joint.point is None and joint.points is None:
            ends = [
                tree.place(None, np.zeros(3)) if n is None else tree.centre(n) for n in (one, two)
            ]
            begun = [np.zeros(3) if n is None else tree.parts[n].centre for n in (one, two)]
        else:
            begun = [in_space(place) for place in joint.places]
            ends = [tree.place(n, at) for n, at in zip((one, two), begun, strict=True)]
        if isinstance(joint, SpringRow):
            axis = casadi.DM(in_space(joint.axis or ()))
            way = (ends[1] - ends[0]) - casadi.DM(begun[1] - begun[0])
            return casadi.dot(way, axis)
        return casadi.norm_2(ends[1] - ends[0])

    def _state(self, body: Any) -> dict[str, Any]:
        """Variables of a body's formulas."""
        tree, centre = self.tree, self.tree.centre(body.name)
        speed = tree.rate(centre)
        found = {"t": tree.t}
        for k in range(body.dim):
            found |= {_AXES[k]: centre[k], f"v{_AXES[k]}": speed[k]}
        spin = tree.spin(body.name)
        return found | {"w": spin[2]} | {f"w{_AXES[k]}": spin[k] for k in range(3)}

    def _value(self, formula: Formula, known: Mapping[str, Any]) -> Any:
        """A formula in symbols, with those of controls."""
        marks = [(self.histories[n], self.controls[k]) for k, n in enumerate(self.names)]
        return in_symbols(formula, known, marks)

    # Columns

    def _columns(self) -> dict[str, Any]:
        casadi, tree, found = loaded(), self.tree, dict[str, Any]()
        for name, robot in self.robots.items():
            mass = sum(part.mass for part in robot.parts)
            each = [part.mass / mass * tree.centre(part.name) for part in robot.parts]
            middle = sum(each[1:], each[0])
            speed = tree.rate(middle)
            for k, axis in enumerate(_AXES):
                found |= {f"{name}.{axis}": middle[k], f"{name}.v{axis}": speed[k]}
        for body in self.plain:
            centre = tree.centre(body.name)
            speed, spin = tree.rate(centre), tree.spin(body.name)
            for k in range(body.dim):
                found[f"{body.name}.{_AXES[k]}"] = centre[k]
                found[f"{body.name}.v{_AXES[k]}"] = speed[k]
            if isinstance(body, RigidBody) and body.dim == 2:
                turns = [k for k in tree.parts[body.name].freedoms if tree.freedoms[k].turns]
                ways = [
                    tree.freedoms[k].axis[2] * (tree.q[k] - tree.freedoms[k].start) for k in turns
                ]
                found[f"{body.name}.angle"] = body.angle + sum(ways)
                found[f"{body.name}.spin"] = spin[2]
            elif isinstance(body, RigidBody):
                found |= {f"{body.name}.w{_AXES[k]}": spin[k] for k in range(3)}
        for k, freedom in enumerate(tree.freedoms):
            if freedom.entry < 0:
                found[freedom.name], found[freedom.rate] = tree.q[k], tree.v[k]
        for name, four in tree.quaternions.items():
            length, spin = casadi.norm_2(tree.q[four]), turning_of(tree.q[four]) @ tree.v[four]
            found |= {f"{name}.q{k}": tree.q[four][i] / length for i, k in enumerate("wxyz")}
            found |= {f"{name}.w{axis}": spin[k] for k, axis in enumerate(_AXES)}
        return found

    def _start_rates(self) -> Floats:
        """Rates at t = 0, with which bodies move as the scene says.

        Raises:
            SceneError: Joints do not let them.
        """
        casadi, tree = loaded(), self.tree
        rows: list[Any] = []
        wanted: list[float] = []
        for name, robot in self.robots.items():
            first = self.first[name]
            rows.append(tree.v[first : first + len(robot.freedoms)])
            wanted += robot.rates.tolist()
        for body in self.plain:
            rows.append(tree.rate(tree.centre(body.name))[: body.dim])
            wanted += [float(each) for each in _speed(body)]
            if isinstance(body, RigidBody):
                spin = tree.spin(body.name)
                rows.append(spin[2] if body.dim == 2 else spin)
                wanted += body.start_velocity[body.dim :].tolist()
        matrix = casadi.Function(
            "slopes", [tree.q], [casadi.jacobian(casadi.vertcat(*rows), tree.v)]
        )
        slopes = np.asarray(matrix([f.start for f in tree.freedoms]), dtype=float)
        found, *_ = np.linalg.lstsq(slopes, np.array(wanted), rcond=None)
        apart = np.abs(slopes @ found - wanted).max()
        if apart > _APART * np.abs(wanted).max(initial=0.0) and apart > 0.0:
            raise SceneError(
                f"body: the velocities at t = 0 do not go with the joints, {apart:.3g} m/s or "
                "rad/s off; give those that do, or none"
            )
        return np.asarray(found)


def in_symbols(
    formula: Formula, known: Mapping[str, Any], marks: Sequence[tuple[Node, Any]] = ()
) -> Any:
    """A formula with symbols of CasADi.

    Args:
        formula: Of the scene.
        known: Its variables.
        marks: Parts of it, and what stands for them.
    """
    casadi = loaded()
    functions = {
        name: getattr(casadi, name)
        for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp",
                     "log", "sqrt")
    } | {
        "abs": casadi.fabs, "min": casadi.fmin, "max": casadi.fmax, "where": casadi.if_else,
        "lt": lambda a, b: a < b, "le": lambda a, b: a <= b,
        "gt": lambda a, b: a > b, "ge": lambda a, b: a >= b,
    }  # fmt: skip
    return formula.marked(marks).apply(functions, **known, **{
        f"mark {k}": symbol for k, (_, symbol) in enumerate(marks)
    })  # fmt: skip


def _motions(kind: str) -> tuple[bool, ...]:
    """Of a joint: whether each of its freedoms turns."""
    return {"fixed": (), "revolute": (True,), "prismatic": (False,)}.get(kind, (False, True))


def _centre(body: Any) -> Floats:
    return np.asarray(body.position if isinstance(body, Point) else body.center, dtype=float)


def _speed(body: Any) -> Any:
    return body.velocity if isinstance(body, Point) else body.centre_velocity()


def _unit(axis: Sequence[float]) -> Floats:
    found = in_space(axis)
    return np.asarray(found / np.linalg.norm(found))
