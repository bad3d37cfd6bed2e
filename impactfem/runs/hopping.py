"""Raibert's three parts of a control that makes a leg hop, learning what its hops lose.

After M. H. Raibert, Legged Robots That Balance, MIT Press 1986. Heights by a thrust while the leg
extends, forward speed by where the foot lands, attitude by the hip's torque in stance.
"""

import math
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Scene
from impactfem.scene.controllers import Controller
from impactfem.scene.hopping_checks import motor_of, rigid_of

FLIGHT, LANDING, LEAVING = 0, 1, 2
_LEARNT = 0.5  # share of what a hop missed that the next one expects
_PLACED = 2.0 / 3.0  # share of a false speed that the next stance is to take away
_FIRM = 5.0  # how many times spins die out by e in a stance
_BRIEF = 0.1  # least flight that is looked ahead to, in stances
_WIDEST = 0.5  # largest way of the foot from below the body, of the leg's length
_SHORTEST = 0.05  # least way that a thrust is thought to have, of the leg's length


@dataclass
class Hopping:
    """One hopper: what it is, and what it remembers.

    Attributes:
        gravity: [m/s^2].
        weight: Of the body and all that hangs on it [N].
        inertia: Of the body [kg m^2].
        side: 1 if the hip counts the leg's turns against the body, -1 the body's against the leg.
        stance: How long the last stances were, or the first is thought to be [s].
        period: Of the last hop [s].
        phase: FLIGHT, LANDING (until the body rises) or LEAVING.
        began: When the stance did [s].
        apex: Height of the last apex [m]; NaN before the first.
        passed: Whether it is that of the present flight.
        yields: Way that the leg's spring gives to a force [m/N].
        landed: Coordinate of the leg when the foot did [m].
        push: Last thrust [N].
        asked: Height that it was for [m]; NaN if there was none, or a limit cut it.
        fall: Height from that to where the body was as the foot landed [m].
        lost: Share of the energy of the fall that a hop is thought to lose.
        lean: Angle by which the body is turned on beyond what is asked for [rad].
        ahead: Place of the foot, beyond that of half a stance, at which it keeps its speed [m].
        next: Speed after the next stance, as the foot is placed [m/s]; NaN if a limit cuts it.
        expected: The same after the last one.
    """

    gravity: float
    weight: float
    inertia: float
    yields: float
    side: float
    stance: float
    period: float
    phase: int = FLIGHT
    began: float = 0.0
    apex: float = math.nan
    passed: bool = False
    landed: float = 0.0
    push: float = 0.0
    asked: float = math.nan
    fall: float = 0.0
    lost: float = 0.0
    lean: float = 0.0
    ahead: float = 0.0
    next: float = math.nan
    expected: float = math.nan

    @classmethod
    def of(cls, scene: Scene, own: Controller) -> "Hopping":
        """The hopper of a scene that a controller drives."""
        rigid = rigid_of(scene)
        hung = {str(own.body)}
        for _ in scene.joints:
            held = [each.bodies for each in scene.joints if each.bodies & hung]
            hung = hung.union(*held) & {*rigid}
        mass, gravity = sum(rigid[n].total_mass for n in hung), -scene.vector_gravity.at(0.0)[1]
        leg = motor_of(scene, "controller", "acts", own.acts, "prismatic")
        yields = 1.0 / leg.stiffness if leg.stiffness else 0.0
        half, lost = math.pi * math.sqrt(mass * yields), 0.0  # of a period on the spring
        if leg.stiffness:  # of which the damper takes a part
            lost = -math.expm1(-leg.damping * half / mass)
        stance, side = half, 1.0
        if own.hip is not None:
            hip = motor_of(scene, "controller", "hip.acts", own.hip.acts, "revolute")
            stance = own.hip.stance or half
            side = 1.0 if hip.between and hip.between[0] == own.body else -1.0
        inertia = float(rigid[str(own.body)].moments[0, 0])
        known = float(gravity), float(gravity * mass), inertia, yields, side, stance, 2.0 * stance
        return cls(*known, lost=lost)

    def output(self, own: Controller, time: float, measured: Floats, force: float) -> float:
        """What the law asks for, before its limits.

        Args:
            own: The controller, or that of its hip.
            time: [s].
            measured: Its columns.
            force: With which the foot is pressed to what it touches [N].
        """
        x, y, vx, vy, angle, spin, *foot, q, _ = measured.tolist()
        leg = (np.array(foot) - (x, y, vx, vy)).tolist()
        event = self._follow(time, force, y, vy)
        if own.swings:
            return self._swing(own, event, (time, vx, angle, spin), leg)
        return self._thrust(own, event, (time, y, q), math.hypot(*leg[:2]) or 1.0)

    def _follow(self, time: float, force: float, height: float, rise: float) -> str:
        """What happens, as a word: nothing mostly."""
        if self.phase == FLIGHT and force > 0.0 and rise <= 0.0:  # not a leg that was drawn in
            self.phase, self.began = LANDING, time
            return "lands"
        if self.phase == FLIGHT and not self.passed and rise <= 0.0:
            self.passed, self.apex = True, height + 0.5 * rise**2 / self.gravity
            return "apex"
        if self.phase == LANDING and force > 0.0 and rise >= 0.0:
            self.phase = LEAVING
            return "lowest"
        if self.phase == LEAVING and force <= 0.0:
            self.phase, self.passed = FLIGHT, False
            self.stance += _LEARNT * (time - self.began - self.stance)
            self.period = self.stance + 2.0 * max(0.0, rise) / self.gravity
            return "leaves"
        return ""

    def _thrust(
        self, own: Controller, event: str, now: tuple[float, float, float], length: float
    ) -> float:
        """Along the leg while it extends, of the energy that the apex asks for."""
        time, height, q = now
        if event == "lands":
            self.landed, self.fall = q, 0.0 if math.isnan(self.apex) else self.apex - height
        elif event == "lowest":
            wanted, out = own.target.number({"t": time}), math.copysign(1.0, self.landed - q)
            missing = wanted - (height if math.isnan(self.apex) else self.apex)
            energy = self.weight * (missing + self.lost * self.fall)
            way = max(abs(self.landed - q), _SHORTEST * length)
            # Along the way, and on until the spring pulls as much; what that holds is lost.
            root = math.sqrt(max(0.0, way**2 + 2.0 * self.yields * energy))
            self.push = out * 2.0 * energy / (way + root)
            self.asked = wanted if own.within(self.push) == self.push else math.nan
        elif event == "apex" and math.isfinite(self.asked):
            self.lost += _LEARNT * (self.asked - self.apex) / max(self.fall, _SHORTEST * length)
        return self.push if self.phase == LEAVING else 0.0

    def _swing(
        self, own: Controller, event: str, now: tuple[float, float, float, float], leg: list[float]
    ) -> float:
        """In flight the leg to where the foot shall land, in stance the body upright."""
        hip, (time, speed, angle, spin), (along, up, rate, rise) = own.hip, now, leg
        if hip is None:
            return 0.0
        length = math.hypot(along, up) or 1.0
        answer = self.gravity * self.period / length  # of the speed to the foot's place [1/s]
        upright = hip.attitude.number({"t": time})
        if event == "apex" and math.isfinite(self.expected):
            self.ahead += _LEARNT * (speed - self.expected) / answer
            self.lean += _LEARNT * math.remainder(upright - angle, math.tau)
        if event == "lands":
            self.expected = self.next
        if self.phase != FLIGHT:  # the spin that turns it upright until the foot lands again
            away = math.remainder(upright + self.lean - angle, math.tau)
            wanted = away / max(self.period - self.stance, _BRIEF * self.stance)
            gain = _FIRM * self.inertia / self.stance if hip.body_kd is None else hip.body_kd
            return self.side * gain * (spin - wanted)
        neutral = 0.5 * speed * self.stance + self.ahead
        gain = _PLACED / answer if hip.placement is None else hip.placement
        place = neutral + gain * (speed - hip.speed.number({"t": time}))
        place = min(max(place, -_WIDEST * length), _WIDEST * length)
        turned, turning = math.atan2(along, -up), (along * rise - up * rate) / length**2
        found = self.side * (
            hip.swing_kp * (math.asin(place / length) - turned) - hip.swing_kd * turning
        )
        self.next = speed - answer * (place - neutral) if own.within(found) == found else math.nan
        return found
