"""Limits and friction of joints in a layer: which rates they set, and what they push with.

A rate v_i of a joint obeys, with its impulse P_i and rates v_a and v_b before and after the layer,

    limit      0 <= P_i _|_ v_b + e v_a >= 0           where the layer would end beyond it,
    friction   P_i in [-f dt, f dt], P_i = -f dt sign(v_b) where v_b is not 0.

States are found as active sets are: all that is wrong changes, later the first that is wrong.
"""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.system.mechanism import Joints

FREE, LOWER, UPPER, STICKS, FORTH, BACK, DRIVEN = range(7)
"""States of a joint: those of its limits, of its friction by the sign of its rate, and given."""

_ALL_AT_ONCE, _MOST = 10, 100  # changes of states


@dataclass
class JointLaws:
    """States of the joints of a mechanism, and the laws that they obey.

    Attributes:
        joints: What acts in them.
        states: Of the rates, (v,).
        given: Rates at the end of the layer of those that are driven, (v,).
    """

    joints: Joints
    states: Integers
    given: Floats

    @classmethod
    def at_rest(cls, joints: Joints) -> "JointLaws":
        """No joint at a limit; those with friction stick."""
        states = np.where(joints.friction > 0.0, STICKS, FREE)
        states[list(joints.driven)] = DRIVEN
        return cls(joints, states, np.zeros(len(states)))

    def lead(self, start: float, end: float, angle: Floats, before: Floats) -> None:
        """Learn where driven joints go in a layer, by their positions and rates now, (v,) each."""
        for at, formula in self.joints.driven.items():
            way = float(formula(t=end)) - angle[at]
            self.given[at] = 2.0 * way / (end - start) - before[at]

    @property
    def driven(self) -> Integers:
        """Rates that are given."""
        return np.flatnonzero(self.states == DRIVEN)

    @property
    def stopped(self) -> bool:
        """Whether any is at a limit."""
        return bool(np.isin(self.states, (LOWER, UPPER)).any())

    def held(self, before: Floats) -> tuple[Integers, Floats]:
        """Which rates are set, and to what, by those before the layer, (v,)."""
        at = np.flatnonzero((self.states == LOWER) | (self.states == UPPER))
        back = _back(before[at], np.where(self.states[at] == LOWER, 1.0, -1.0), self.joints, at)
        sticks, led = np.flatnonzero(self.states == STICKS), self.driven
        rates = np.concatenate([back, np.zeros(len(sticks)), self.given[led]])
        return np.concatenate([at, sticks, led]), rates

    def rubbing(self, dt: float) -> Floats:
        """Impulses of the friction of joints that slide, (v,)."""
        way = (self.states == BACK).astype(float) - (self.states == FORTH)
        return np.asarray(self.joints.friction * dt * way)

    def renew(
        self, before: Floats, after: Floats, angle: Floats, impulses: Floats, dt: float, turn: int
    ) -> bool:
        """Change states that are wrong; whether there were any.

        Args:
            before: Rates before the layer, (v,).
            after: After it, (v,).
            angle: Positions at its end, (v,).
            impulses: Of rates that are set, (v,).
            dt: Time step [s].
            turn: How often states have changed in the layer.
        """
        joints, states = self.joints, self.states
        size = max(float(np.abs(after).max()), float(np.abs(before).max()))
        small = 1e-12 * size + np.finfo(float).tiny
        new = states.copy()
        bound = joints.friction * dt
        # What a limit pulls, or friction cannot hold, is let go.
        rubbed = np.where(joints.friction > 0.0, STICKS, FREE)
        new = np.where((states == LOWER) & (impulses < 0.0), rubbed, new)
        new = np.where((states == UPPER) & (impulses > 0.0), rubbed, new)
        new = np.where((states == STICKS) & (impulses > bound), BACK, new)
        new = np.where((states == STICKS) & (impulses < -bound), FORTH, new)
        turned = ((states == FORTH) & (after < -small)) | ((states == BACK) & (after > small))
        new = np.where(turned, STICKS, new)
        for limit, state, way in ((joints.lower, LOWER, 1.0), (joints.upper, UPPER, -1.0)):
            past = way * (angle - limit) < 0.0
            back = _back(before, np.full(len(before), way), joints, np.arange(len(before)))
            arrives = past & (way * (after - back) < -small)
            new = np.where(arrives & (states != LOWER) & (states != UPPER), state, new)
        new = np.where(states == DRIVEN, DRIVEN, new)
        wrong = np.flatnonzero(new != states)
        if turn > _ALL_AT_ONCE:
            wrong = wrong[:1]
        self.states = states.copy()
        self.states[wrong] = new[wrong]
        return bool(len(wrong)) and turn < _MOST


def _back(before: Floats, way: Floats, joints: Joints, at: Integers) -> Floats:
    """Least rates after a limit, along its way: -e of those before; what leaves does not turn."""
    e = np.where(way * before > 0.0, 1.0, joints.restitution[at])
    return np.asarray(-e * before)
