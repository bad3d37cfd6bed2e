"""Mechanisms as the march takes them: a tree in minimal coordinates, and what of it can touch."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.scene import Formula, Mechanism, Scene
from impactfem.scene.breaks import check_motion
from impactfem.scene.control import AXES
from impactfem.scene.controllers import Controller
from impactfem.scene.jets import motion_at
from impactfem.scene.means import StepMean
from impactfem.scene.mechanism import JointStart
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show
from impactfem.system.actuators import Acting
from impactfem.system.few import FewBodies
from impactfem.system.inverse_kinematics import Found, place_frame
from impactfem.system.link_shapes import LinkNodes, Partner, named, picture
from impactfem.system.mechanism_file import Robot, read_mechanism
from impactfem.system.stations import Asked, Stations
from impactfem.system.tree import Tree

_SAMPLES = 1001  # of the positions that formulas give
_ROOM = 1e-9  # share of these by which they may be beyond limits
_SINGULAR = 1e-12  # share of the largest inertia of a rate that counts as none


@dataclass(frozen=True, kw_only=True)
class Joints:
    """What acts in the joints, by rate; (v,) each.

    Attributes:
        lower, upper: Limits [rad, m], infinite without.
        restitution: Of these.
        damping: [N m s, N s/m].
        friction: Coulomb's [N m, N].
        motors: Formulas in t, q and v by rate, as their means over steps.
        driven: Formulas in t of the positions that are given, by rate.
    """

    lower: Floats
    upper: Floats
    restitution: Floats
    damping: Floats
    friction: Floats
    motors: Mapping[int, StepMean]
    driven: Mapping[int, Formula]

    def drive(self, start: float, end: float, angle: Floats, v: Floats) -> Floats:
        """Mean moments and forces of the motors from one time to another [s], (v,)."""
        found = np.zeros(len(v))
        for at, motor in self.motors.items():
            found[at] = motor(start, end, q=angle[at], v=v[at])
        return found


@dataclass(frozen=True, kw_only=True)
class Arm(FewBodies):
    """A mechanism.

    A ball on a link rolls: it touches different things at different places of its surface. So each
    obstacle and body has contact nodes of its own.

    Attributes:
        tree: Kinematics and dynamics.
        joints: What acts in the joints.
        moving: Joints whose frames carry nodes or pictures, as Pinocchio counts them; 0 stays.
        on: Place among these of each contact node, (nodes,).
        arms: In its frame [m], (nodes, 3).
        following: Arms of nodes along the axes of space besides [m], (nodes, 3); see `Carrier`.
        meets: Links and contact nodes that meet a body or obstacle, by its name and the number of
            its face.
        rolling: Radius with which nodes roll [m], (nodes,).
        angles_at_start: Positions of single joints at t = 0, counted over turns, (v,).
        picture: Place in `moving`, points [m], (points, 3), in its frame, and cells.
        inverse: How `place` was found; None without it.
        left_out: What of the file is not taken as it stands, in words.
    """

    tree: Tree
    joints: Joints
    moving: tuple[int, ...]
    on: Integers
    arms: Floats
    following: Floats
    meets: Mapping[Partner, Sequence[tuple[str, Integers]]]
    rolling: Floats
    angles_at_start: Floats
    picture: tuple[Integers, Floats, Integers]
    inverse: Found | None
    left_out: tuple[str, ...] = ()

    @property
    def figured(self) -> Mapping[str, Mapping[str, float]]:
        """What each single joint has to move at t = 0 [kg m^2 or kg], by name.

        Of a free base the mean about three axes through its origin, with all links.
        """
        tree = self.tree
        own = tree.inertia(self.position).diagonal()
        found = {name: float(own[at]) for name, at in tree.single.items()}
        return {"inertia": found | ({tree.root: float(own[3:6].mean())} if tree.free else {})}

    def stations(self, asked: Sequence[Asked]) -> Stations:
        """The links that are named.

        Raises:
            KeyedError: The file has no such link, or but one that is free, whose momenta would
                not stay: no joint of the tree makes up for energy.
        """
        tree, links = self.tree, self.tree.links()
        if tree.free and tree.rates == 6:
            text = (
                f" = {show(asked[0][0])} is the only link of {self.names[0]}, and free: model it "
            )
            raise KeyedError("joint", "between", text + 'as a body of kind "rigid".')
        names = tuple(dict.fromkeys(name for name, *_ in asked))
        for name in names:
            link = name.partition("/")[2]
            if link not in links:
                raise named("joint", "between", name, list(links), "link")
        joints = [links[name.partition("/")[2]] for name in names]
        turns, places = tree.poses(self.position, joints)
        rows = tree.jacobians(self.position, joints)
        answers = np.linalg.solve(tree.inertia(self.position), rows.reshape(-1, tree.rates).T)
        found = Stations.along(
            tuple(names.index(name) for name, *_ in asked), names, places, rows, answers,
            self.velocity,
        )  # fmt: skip
        spins = np.einsum("sji,sj->si", turns, found.spins)
        return replace(
            found, turns=turns, spins=spins, freedoms=tree.rates, given=(), told=self._told(joints)
        )

    def _told(self, joints: Sequence[int]) -> Callable[[Floats], str]:
        """Says what impulses on the frames of joints at t = 0 make of the rates, by their keys."""
        tree, q = self.tree, self.position

        def told(impulses: Floats) -> str:
            rows = tree.jacobians(q, joints).reshape(-1, tree.rates)
            made = np.linalg.solve(tree.inertia(q), rows.T @ impulses.ravel())
            v = np.round(self.velocity + made, 13) + 0.0
            found = [f"joints.{name}.velocity = {v[at]:.13g}" for name, at in tree.single.items()]
            if tree.free:
                spin = np.round(tree.base(q) @ v[3:6], 13) + 0.0
                for key, values in (("velocity", v[:3]), ("angular_velocity", spin)):
                    found.append(f"{key} = [" + ", ".join(f"{x:.13g}" for x in values) + "]")
            return f"{self.names[0]}: " + ", ".join(found)

        return told

    def meeting(
        self,
        body: int,  # noqa: ARG002  (it is one)
        surfaces: Sequence[str] | None,
        partner: tuple[str, int],
    ) -> Integers:
        """Contact nodes that may meet a body, or a face of an obstacle."""
        whole = not surfaces or "" in surfaces
        own = [n for link, n in self.meets.get(partner, ()) if whole or link in (surfaces or ())]
        return np.concatenate([np.zeros(0, dtype=np.int64), *own])


def mechanism_system(scene: Scene, body: Mechanism) -> Arm:
    """A mechanism of a scene.

    Raises:
        KeyedError: Its file or the keys of its joints are wrong.
        ConvergenceError: ``place`` cannot be reached.
    """
    where = f"body[{scene.bodies.index(body)}]"
    try:
        robot = read_mechanism(body, scene.folder)
    except KeyedError as error:
        raise error.moved(where) from None
    tree, shapes = robot.tree, robot.shapes
    for index, own in enumerate(scene.controllers):
        if own.law == "whole_body" and own.acts.split(".")[1] == body.name:
            _check_whole(own, f"controller[{index}]", tree)
    try:
        joints, q, v, found = start_of(body, robot)
        _check_driven(body, tree, joints, scene.duration)
    except KeyedError as error:
        raise error.moved(where) from None
    if found is not None:
        found.check(body, tree)
    nodes = LinkNodes.of(scene, body, shapes, list(tree.links()))
    moving = sorted({shape.joint for shape in shapes} | {0})
    on, arms = np.searchsorted(moving, nodes.on), nodes.arms

    def places(q: Floats) -> Floats:
        turns, there = tree.poses(q, moving)
        return np.asarray(there[on] + np.einsum("kij,kj->ki", turns[on], arms))

    centre = tree.centre(q)
    links = len({link for link, joint in tree.links().items() if joint})
    return Arm(
        names=(body.name,),
        masses=(tree.mass,),
        centers=centre[None],
        speeds=(tree.centre_jacobian(q) @ v)[None],
        inertias=(0.0,),
        angles=(0.0,),
        position=q,
        velocity=v,
        places=places,
        radius=nodes.radius,
        shell=nodes.radius,
        touching=np.ones(len(arms), dtype=bool),
        body=np.zeros(len(arms), dtype=np.int64),
        lines=np.zeros((0, 2), dtype=np.int64),
        ends={},
        rate=lambda: _rate(scene, tree, joints, q, v),
        words=f"a mechanism of {links} moving links and {tree.rates} degrees of freedom",
        tree=tree,
        joints=joints,
        moving=tuple(moving),
        on=on.astype(np.int64),
        arms=arms,
        following=nodes.following,
        meets=nodes.meets,
        rolling=nodes.rolling,
        angles_at_start=_positions(tree, q, body),
        picture=picture(shapes, moving.index),
        inverse=found,
        left_out=robot.left_out,
        carriers=nodes.carriers,
    )


def _check_whole(own: Controller, where: str, tree: Tree) -> None:
    """Refuse a controller of all motors that names what the mechanism has not."""
    joints, frames = list(tree.single), tree.frames()
    if tree.rates != len(joints):
        text = f" = {show(own.acts)}: a free base and ball joints have no columns to measure: "
        text += "give them in the file as sliding and turning joints, without motors."
        raise KeyedError(where, "acts", text)
    for joint in own.motors or ():
        if joint not in joints:
            raise named(where, "motors", joint, joints, "joint of one degree of freedom")
    for k, task in enumerate(own.tasks):
        head, _, axis = task.of.rpartition(".")
        if task.of not in joints and (axis not in AXES or head not in {"centre", *frames}):
            known = [*joints, "centre.x", *(f"{frame}.x" for frame in frames)]
            raise named(where, f"tasks[{k}].of", task.of, known, "joint or place")
    for k, foot in enumerate(own.feet):
        if foot.link not in frames:
            raise named(where, f"feet[{k}].link", foot.link, frames, "link")


def start_of(body: Mechanism, robot: Robot) -> tuple[Joints, Floats, Floats, Found | None]:
    """Joints, coordinates, rates at t = 0, and how `place` was found.

    Raises:
        KeyedError: A joint is not known, begins outside its limits, or moves nothing.
    """
    tree = robot.tree
    lower, upper = tree.limits()
    restitution, q, v = np.zeros(tree.rates), tree.neutral(), np.zeros(tree.rates)
    motors: dict[int, StepMean] = {}
    driven: dict[int, Formula] = {}
    for name, at in tree.single.items():
        tree.put(q, name, min(max(0.0, lower[at]), upper[at]))
    for name, given in body.joints.items():
        _check_start(body, robot, name, given)
        at = tree.single[name]
        if given.start is not None:
            tree.put(q, name, given.start)
        v[at], restitution[at] = given.velocity, given.restitution
        if given.drive is not None:
            driven[at], v[at] = given.drive, motion_at(given.drive, 0.0).rate
    for name, at in tree.single.items():
        motor = motor_of(body, robot, name, tree.position(q, name), v[at])
        if motor is not None and at not in driven:
            motors[at] = StepMean(motor)
    _check_inertia(body, tree, q)
    joints = Joints(
        lower=lower,
        upper=upper,
        restitution=restitution,
        damping=tree.damping,
        friction=tree.friction,
        motors=motors,
        driven=driven,
    )
    found = None if body.place is None else place_frame(body, body.place, tree, q, list(driven))
    q = q if found is None else found.q
    _set_base_off(body, tree, q, v)
    return joints, q, v, found


def _check_start(body: Mechanism, robot: Robot, name: str, given: JointStart) -> None:
    """Refuse keys of a joint that there is not, beyond its limits, or for what it has not."""
    tree, where = robot.tree, f"joints.{name}"
    if name in tree.followers:
        text = f" follows {show(tree.followers[name][0])} in {body.file}: give that, remove it."
        raise KeyedError(body.kind, where, text)
    if name not in tree.single:
        known = list(tree.single)
        raise named(body.kind, where, name, known, "joint of one degree of freedom")
    low, high = (ends[tree.single[name]] for ends in tree.limits())
    if given.start is not None and not low <= given.start <= high:
        text = f" = {show(given.start)} is outside its limits: give {low:.6g} to {high:.6g}."
        raise KeyedError(body.kind, f"{where}.position", text)
    if given.control is not None and not robot.acting.get(name, Acting()).actuators:
        text = f" = {show(given.control.plain)}, but {body.file} has no actuator of this joint "
        raise KeyedError(body.kind, f"{where}.control", text + "that is read: give motor.")


def motor_of(body: Mechanism, robot: Robot, name: str, q: float, v: float) -> Formula | None:
    """What acts in a joint, by the scene and the file, in t, q and v; None if nothing does."""
    own = body.joints.get(name)
    motor, control = (None, None) if own is None else (own.motor, own.control)
    found = robot.acting.get(name, Acting()).formula(motor, control)
    start = {"t": 0.0, "q": q, "v": v}
    if found is None or np.isfinite(found(**{each: start[each] for each in found.used})):
        return found
    key, given = ("motor", motor) if motor is not None else ("control", control or found)
    text = f" = {show(given.text)} has no finite value at the start: rewrite it."
    raise KeyedError(body.kind, f"joints.{name}.{key}", text)


def _set_base_off(body: Mechanism, tree: Tree, q: Floats, v: Floats) -> None:
    """Put the rates of a free base at t = 0 into all rates.

    Raises:
        KeyedError: It is fixed, but is given some.
    """
    if tree.free:
        v[:3], v[3:6] = body.velocity, tree.base(q).T @ np.asarray(body.angular_velocity)
        return
    for where, given in (("velocity", body.velocity), ("angular_velocity", body.angular_velocity)):
        if any(given):
            text = f" = {show(list(given))} is of a first link that moves: give base = "
            raise KeyedError(body.kind, where, f'{text}"free" too, or remove {where}.')


def _positions(tree: Tree, q: Floats, body: Mechanism) -> Floats:
    """Positions of single joints, counted over turns as they are given, (v,)."""
    found = np.zeros(tree.rates)
    for name, at in tree.single.items():
        given = body.joints[name].start if name in body.joints else None
        stays = body.place is None or (name in body.joints and body.joints[name].drive is not None)
        found[at] = given if given is not None and stays else tree.position(q, name)
    return found


def _check_inertia(body: Mechanism, tree: Tree, q: Floats) -> None:
    """Refuse links that move without inertia."""
    if not tree.rates:
        text = f" = {show(body.file)} has no joint that moves: give a file with one."
        raise KeyedError(body.kind, "file", text)
    own, ways = np.linalg.eigh(tree.inertia(q))
    if own[0] > _SINGULAR * max(own[-1], 0.0) and np.isfinite(own).all():
        return
    joint = tree.rate_names()[int(np.argmax(np.abs(ways[:, 0])))].partition(".")[0]
    text = f" = {show(body.file)}: joint {show(joint)} moves nothing that has inertia "
    raise KeyedError(body.kind, "file", f"{text}about it: give the links after it <inertial>.")


def _check_driven(body: Mechanism, tree: Tree, joints: Joints, duration: float) -> None:
    """Refuse formulas that jump or leave the limits of the joints that they drive."""
    for name, at in tree.single.items():
        if at not in joints.driven:
            continue
        formula, where = joints.driven[at], f"joints.{name}.position"
        check_motion(body.kind, where, [formula], duration, "rad or m")
        times = np.linspace(0.0, duration, _SAMPLES)
        places = formula(t=times)
        low, high = joints.lower[at], joints.upper[at]
        room = _ROOM * np.abs(places).max()
        if (out := (places < low - room) | (places > high + room)).any():
            text = (
                f" = {show(formula.text)} is outside its limits, {low:.6g} to {high:.6g}, at t = "
            )
            raise KeyedError(body.kind, where, f"{text}{times[np.argmax(out)]:.6g} s: rewrite it.")


def _rate(scene: Scene, tree: Tree, joints: Joints, q: Floats, v: Floats) -> float:
    """Frequency of the start [rad/s] that steps follow: swinging, motors, and rates themselves."""
    pull = np.asarray(scene.vector_gravity.at(0.0))
    inertia = tree.inertia(q)
    angle = np.array([0.0] * tree.rates)
    for name, at in tree.single.items():
        angle[at] = tree.position(q, name)

    def force(way: Floats) -> Floats:
        there = tree.integrate(q, way)
        swung: Floats = tree.mass * tree.centre_jacobian(there).T @ pull
        return swung + joints.drive(0.0, 0.0, angle + way, v)

    step = 1e-6 * np.eye(tree.rates)
    stiffness = np.stack([(force(-h) - force(h)) / 2e-6 for h in step], axis=1)
    squares = np.abs(np.linalg.eigvals(np.linalg.solve(inertia, stiffness)))
    return float(max(np.sqrt(squares.max()), np.abs(v).max()))
