"""Motors of a whole mechanism by least squares of tasks, solved anew at every sample.

Unknown are accelerations a, motors' outputs u and forces f of feet. Of all that fulfil
M a + h = S^T u + J^T f, feet that stay (J a + J' v = -k J v), limits of u and cones of friction,
those are taken whose weighted squares of J_k a + J_k' v - y_k'' are least, see
A. Herzog et al., Momentum control with hierarchical inverse dynamics on a torque-controlled
humanoid, Autonomous Robots 40 (2016).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from impactfem.arrays import Floats
from impactfem.runs.least_tasks import Sample, import_clarabel
from impactfem.scene import Scene
from impactfem.scene.control import AXES
from impactfem.scene.controllers import Controller, Foot
from impactfem.scene.jets import motion_at
from impactfem.system.mechanism import Joints, mechanism_system
from impactfem.system.tree import Tree, cross

_CALM = 0.2  # share of a foot's velocity that is to be gone in a sample


type Answer = tuple[dict[str, float], float]
"""Outputs by joint, and the largest velocity of a foot that stands [m/s]."""


@dataclass
class WholeBody:
    """What drives the motors of a mechanism; it remembers nothing.

    Attributes:
        scene: The scene.
        own: The controller, of all motors.
        tree: Of its mechanism.
        joints: What else acts in them.
        span: Time between two samples [s].
        columns: That it measures: positions and rates of all joints.
        last: Time [s], what was measured then, and the answer, which all motors share.
    """

    scene: Scene
    own: Controller
    tree: Tree
    joints: Joints
    span: float
    columns: tuple[str, ...]
    last: tuple[float, bytes, Answer] = field(default=(-1.0, b"", ({}, 0.0)))

    @classmethod
    def of(cls, scene: Scene, own: Controller, span: float) -> "WholeBody":
        """That of a controller of a scene."""
        import_clarabel()
        name = own.acts.split(".")[1]
        (body,) = (each for each in scene.mechanisms if each.name == name)
        arm = mechanism_system(scene, body)
        places = [f"{name}.{joint}" for joint in arm.tree.single]
        columns = (*(f"{each}.q" for each in places), *(f"{each}.v" for each in places))
        return cls(scene, own, arm.tree, arm.joints, span, columns)

    def outputs(self, time: float, measured: Floats) -> Answer:
        """Of motors by joint, and the largest velocity of a foot that stands [m/s].

        There are no outputs where nothing fulfils dynamics, feet, limits and cones.

        Args:
            time: [s].
            measured: Its columns.
        """
        key = measured.tobytes()
        if self.last[:2] != (time, key):
            self.last = time, key, self._solved(time, *np.split(measured, 2))
        return self.last[2]

    def _solved(self, time: float, angles: Floats, v: Floats) -> Answer:
        tree, own = self.tree, self.own
        q = tree.neutral()
        for joint, angle in zip(tree.single, angles, strict=True):
            tree.put(q, joint, angle)
        driven = {part.acts.split(".")[3]: part.held.value for part in own.parts}
        motors = [tree.single[joint] for joint in driven]
        others = self.joints.drive(time, time + self.span, angles, v)
        others[motors] -= list(driven.values())  # which are in its formulas
        pull = np.asarray(self.scene.vector_gravity.at(time))
        feet = [foot for foot in own.feet if float(foot.stands(t=time)) > 0.0]
        rows, drift = self._feet(q, v, feet)
        tasks, wanted = self._tasks(time, q, v, angles)
        found = Sample(
            inertia=tree.inertia(q),
            bias=tree.bias(q, v, pull) + tree.damping * v - others,
            mass=tree.mass,
            rows=rows,
            calm=-drift - _CALM / self.span * rows @ v,
            tasks=tasks,
            wanted=wanted,
            weights=np.array([task.weight for task in own.tasks]),
            motors=motors,
            given={at: motion_at(way, time).second for at, way in self.joints.driven.items()},
            limits=own.ends,
            feet=feet,
        ).outputs()
        moved = np.linalg.norm((rows @ v).reshape(-1, 3), axis=1).max(initial=0.0)
        return dict(zip(driven, found, strict=False)), float(moved)

    def _tasks(self, time: float, q: Floats, v: Floats, angles: Floats) -> tuple[Floats, Floats]:
        """J of tasks, (tasks, n), and what J a shall be, (tasks,)."""
        tree = self.tree
        rows, wanted = [], []
        for task in self.own.tasks:
            asked = motion_at(task.target, time)
            if task.of in tree.single:
                row, drift = np.eye(tree.rates)[tree.single[task.of]], 0.0
                place = float(row @ angles)  # counted over turns
            else:
                head, _, axis = task.of.rpartition(".")
                at = AXES.index(axis)
                centre, frames = tree.drifts(q, v, [] if head == "centre" else [head])
                if head == "centre":
                    there, jacobian, drift = tree.centre(q), tree.centre_jacobian(q), centre[at]
                else:
                    (there, _, jacobian), drift = tree.frame(q, head), frames[0, at]
                place, row = float(there[at]), jacobian[at]
            rows.append(row)
            off, slow = asked.value - place, asked.rate - row @ v
            wanted.append(asked.second + task.kp * off + task.kd * slow - drift)
        return np.array(rows), np.array(wanted)

    def _feet(self, q: Floats, v: Floats, feet: Sequence[Foot]) -> tuple[Floats, Floats]:
        """J of feet where they touch, three rows each, and J' v.

        A ball that rolls keeps v + w x (-r n) at 0, whose derivative has no centripetal part.
        """
        rows, drifts = [np.zeros((0, self.tree.rates))], [np.zeros(0)]
        _, moved = self.tree.drifts(q, v, [foot.link for foot in feet])
        for foot, drift in zip(feet, moved, strict=True):
            *_, jacobian = self.tree.frame(q, foot.link)
            arm = -foot.radius * foot.up
            rows.append(jacobian[:3] + cross(jacobian[3:].T, arm).T)
            drifts.append(drift[:3] + cross(drift[3:], arm))
        return np.concatenate(rows), np.concatenate(drifts)
