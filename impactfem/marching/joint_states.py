"""What joints do besides holding: springs, motors, dry friction and limits, as laws of rows.

Rates of a layer are taken at its ends: where a coordinate goes from q_a to q_b and its rate was
v_a, it ends with v_b = 2 (q_b - q_a) / dt - v_a. Dry friction that holds lets it end at rest, a
limit with -e v_a. States are found as active sets are: all laws that turn out to be wrong are
changed, later the first one.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.scene.means import StepMean
from impactfem.system.joints import Joints

_SETTLED = 1e-12  # change of a motor's force, as a share of it
_ROUNDING = 1e-14  # of its parts, which cancel where it is at its target
_ALL_AT_ONCE = 10  # looks in a layer
_STEP = 1e-6  # of coordinates and rates where motors are differentiated


def _back(restitution: float, rate: float) -> float:
    """Share of a rate with which a limit sends back: all of one that leaves, for no work."""
    return 1.0 if rate > 0.0 else restitution


@dataclass
class Motor:
    """A motor about the last look: constant - stiffness q - damping v; the force it gave."""

    mean: StepMean
    constant: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    force: float = 0.0

    def look(self, start: float, end: float, q: float, v: float) -> bool:
        """Follow it between times, at a coordinate and rate; whether it is as it was thought."""
        mean = self.mean
        self.force = mean(start, end, q=q, v=v)
        parts = self.constant, -self.stiffness * q, -self.damping * v
        settled = _SETTLED * abs(self.force) + _ROUNDING * sum(map(abs, parts))
        if abs(self.force - sum(parts)) <= settled:
            return True
        slopes = []
        for at, name in ((q, "q"), (v, "v")):
            h = _STEP * max(1.0, abs(at))
            sides = [mean(start, end, **({"q": q, "v": v} | {name: at + s * h})) for s in (1, -1)]
            slopes.append(-(sides[0] - sides[1]) / (2.0 * h))
        self.stiffness, self.damping = slopes
        self.constant = self.force + self.stiffness * q + self.damping * v
        return False


class JointStates:
    """How joints slide, stop and are driven, from layer to layer.

    Attributes:
        slides: 1, -1: the way that it slides; 0: friction holds it, or there is none, (joints,).
        stops: 1: at its lower limit, -1: at its upper one, (joints,).
        parted: When ties let go [s], infinite of what holds, (joints,).
        motors: By the place of the joint.
        span: Of the step [s].
    """

    def __init__(self, joints: Joints, rates: Floats, span: float, sizes: Floats) -> None:
        """Begin at t = 0.

        Args:
            joints: The joints.
            rates: Of their rows, (rows,).
            span: Of the first step [s].
            sizes: Of the rows up to which they are rounding, (rows,).
        """
        self._joints, self.span, self._sizes = joints, span, sizes
        self.slides = np.sign(np.where(joints.rubbing < 0, 0.0, rates[joints.rubbing]))
        self.stops = np.zeros(len(joints.joints))
        self.parted = np.full(len(joints.joints), np.inf)
        most = [getattr(joint, "break_force", None) or np.inf for joint in joints.joints]
        self._strength = np.array(most)
        self.motors = {k: Motor(StepMean(j.motor)) for k, j in enumerate(joints.joints) if j.motor}
        self._still = np.zeros((joints.count, 3))  # laws that do not change
        self._still[:, 1] = 1.0
        self._still[joints.holding] = 1.0, 0.0, 0.0
        self._soft = np.flatnonzero(joints.holding & ~joints.hard)
        self._moving = np.flatnonzero(joints.moving >= 0)
        self._changing = np.flatnonzero((joints.rubbing >= 0) | (joints.stopping >= 0))
        # Stiffness, damping and what acts where the coordinate is 0, of each joint.
        each = [(j.stiffness, j.damping, j.stiffness * joints.rest(j)) for j in joints.joints]
        self._acting = np.array(each).T

    def laws(self, begun: Floats, rates: Floats) -> Floats:
        """a, b, c of all rows; see `impactfem.marching.joint_kernels`.

        Args:
            begun: Rows at the start of the layer, (rows,).
            rates: Their rates there, (rows,).
        """
        joints, dt = self._joints, self.span
        laws = self._still.copy()
        laws[self.gone] = 0.0, 1.0, 0.0
        for row in self._soft:
            if (soft := joints.joints[joints.owner[row]].soft) is not None:
                missing = begun[row] - joints.start[row]
                laws[row, 1:] = soft.cfm, -(1.0 - soft.erp) * missing
        own: Integers = joints.moving[self._moving]
        stiffness, damping, given = self._acting.copy()
        for k, motor in self.motors.items():
            # Its coordinate counts from where the joint says.
            given[k] += motor.constant - motor.stiffness * joints.shift(joints.joints[k])
            stiffness[k] += motor.stiffness
            damping[k] += motor.damping
        half, slow = 0.5 * stiffness[self._moving], damping[self._moving] / dt
        laws[own, 0], laws[own, 1] = half + slow, 1.0 / dt
        laws[own, 2] = (half - slow) * begun[own] - given[self._moving]
        for k in self._changing.tolist():
            joint, row = joints.joints[k], joints.moving[k]
            q = begun[row]
            if (rubs := joints.rubbing[k]) >= 0:
                sliding = self.slides[k] * dt * joint.friction
                stopping = 1.0, 0.0, -(q + 0.5 * dt * rates[row])
                # At a limit that holds it friction has nothing left to hold.
                loose = self.slides[k] or self.stops[k]
                laws[rubs] = (0.0, 1.0, sliding) if loose else stopping
            if (limit := joints.stopping[k]) >= 0 and self.stops[k]:
                back = _back(joint.restitution, self.stops[k] * rates[row])
                way = 0.5 * dt * (1.0 - back) * rates[row]
                laws[limit] = 1.0, 0.0, -(q + way)
        return laws

    @property
    def gone(self) -> Booleans:
        """Rows of ties that have let go, (rows,)."""
        return np.isfinite(self.parted)[self._joints.owner]

    @property
    def hard(self) -> Booleans:
        """Rows that are constraints now and do not give way, (rows,)."""
        return np.asarray(self._joints.hard & ~self.gone)

    def part(self, forces: Floats, time: float) -> None:
        """Let ties go whose resultants [N], (joints,), are too large at a time [s]."""
        self.parted[(forces > self._strength) & ~np.isfinite(self.parted)] = time

    def unbounded(self, laws: Floats) -> Floats:
        """The laws that contact meets: dry friction, whose force is bounded, does not hold it.

        What it can hold it holds when joints are solved again.
        """
        found, rubbing = laws.copy(), self._joints.rubbing
        found[rubbing[rubbing >= 0]] = 0.0, 1.0, 0.0
        return found

    def settled(
        self, begun: Floats, ended: Floats, rates: Floats, acting: Floats, time: float, look: int
    ) -> bool:
        """Whether motors, friction and limits do what was thought; else it is thought anew.

        Args:
            begun: Rows at the start of the layer, (rows,).
            ended: At its end.
            rates: Their rates at its start, (rows,).
            acting: Impulses of the rows, (rows,).
            time: Amid the layer [s].
            look: How often it was asked in the layer.
        """
        joints, fine = self._joints, True
        for k, motor in self.motors.items():
            row = joints.moving[k]
            q = 0.5 * (begun[row] + ended[row]) + joints.shift(joints.joints[k])
            rate = (ended[row] - begun[row]) / self.span
            fine &= motor.look(time - 0.5 * self.span, time + 0.5 * self.span, q, rate)
        return not self._switched(begun, ended, rates, acting, single=look > _ALL_AT_ONCE) and fine

    def _switched(
        self, begun: Floats, ended: Floats, rates: Floats, acting: Floats, *, single: bool
    ) -> bool:
        """Change laws that are wrong, or the first one; whether there are any."""
        joints, dt, found = self._joints, self.span, False
        for k in self._changing.tolist():
            joint, row = joints.joints[k], joints.moving[k]
            slides, stops = self.slides[k], self.stops[k]
            rate = 2.0 * (ended[row] - begun[row]) / dt - rates[row]
            if (own := joints.rubbing[k]) >= 0:
                if not slides and abs(acting[own]) > dt * joint.friction:
                    slides = -np.sign(acting[own])
                elif slides * rate < -2.0 * self._sizes[row] / dt:
                    # Not by rounding: where a layer ends just as it stops, friction that
                    # holds is at its bound, and neither law would stay.
                    slides = 0.0
            if single and slides != self.slides[k]:
                self.slides[k] = slides
                return True
            if (own := joints.stopping[k]) >= 0 and joint.limits is not None:
                if stops:
                    stops = 0.0 if stops * acting[own] < 0.0 else stops
                else:
                    q = ended[row] + joints.shift(joint)
                    for way, beyond in ((1.0, q < joint.limits[0]), (-1.0, q > joint.limits[1])):
                        back = _back(joint.restitution, way * rates[row])
                        stops += way * float(beyond and way * (rate + back * rates[row]) < 0.0)
            found |= slides != self.slides[k] or stops != self.stops[k]
            self.slides[k], self.stops[k] = slides, stops
            if found and single:
                break
        return found

    def let_go(self, slid: Floats) -> bool:
        """Let slide what no force could hold, as a linkage near a dead point; whether there is any.

        Args:
            slid: How it slid in the layer before; now it goes the other way.
        """
        held = (self._joints.rubbing >= 0) & (self.slides == 0.0) & (slid != 0.0)
        self.slides[held] = -slid[held]
        return bool(held.any())

    def driven(self, way: Floats) -> float:
        """Work of the motors in a layer [J], by the ways of the rows (rows,)."""
        each = (motor.force * way[self._joints.moving[k]] for k, motor in self.motors.items())
        return float(sum(each))

    def memory(self) -> dict[str, Floats]:
        """What the next layer needs."""
        motors = [[m.constant, m.stiffness, m.damping] for m in self.motors.values()]
        return {
            "joints.slides": self.slides.copy(), "joints.stops": self.stops.copy(),
            "joints.parted": self.parted.copy(),
            "joints.motors": np.array(motors).reshape(-1, 3),
        }  # fmt: skip

    def remember(self, memory: Mapping[str, Floats]) -> None:
        """Go on from what `memory` gave."""
        self.slides, self.stops = memory["joints.slides"].copy(), memory["joints.stops"].copy()
        self.parted = memory["joints.parted"].copy()
        for motor, kept in zip(self.motors.values(), memory["joints.motors"], strict=True):
            motor.constant, motor.stiffness, motor.damping = (float(value) for value in kept)
