"""Hard cases of contact forces and impulses of points, and of walls that change their velocity."""

import math
from collections.abc import Sequence

from impactfem.scene import Formula
from impactfem.scene.signal import Signal
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.vibro_facts import VIBRO, Sizes, run
from impactfem.system.generalized import LinearSystem

G = 9.81

_FALL = (Sizes(dt=1e-3, stiffness=1e8, row=1e-2), Sizes(dt=1e-4, stiffness=1e8, row=1e-3))
_DROP = math.sqrt(2.0 * G)


def _force(method: str) -> Facts:
    """A ball falls 1 m and stays: its weight and its impulse, also by a tenth of the step."""
    ball = LinearSystem(mass=1.0, normals=[[1.0]], offsets=[0.0], load=[-G], restitution=0.0)
    runs = [run(method, ball, [1.0], [0.0], 1.0, sizes) for sizes in _FALL]
    forces = [motion.peak or math.inf for motion in runs]
    return {
        "weight": max(abs(force / G - 1.0) for force in forces),
        "impulse": max(
            abs(float(motion.impacts.impulse.max()) / _DROP - 1.0) if motion.impacts else math.inf
            for motion in runs
        ),
        "total": max(abs(float(motion.impulse.sum()) / G - 1.0) for motion in runs),
    }


def _force_claims(method: str) -> Sequence[Claim]:
    coarse = _FALL[0]
    return [
        Claim("weight", 1e-6, "at rest the floor bears the weight, whatever the step"),
        coarse.claim("impulse", method, 2.0 * G / _DROP, "g tau / v, the weight in an impact"),
        Claim("total", 1e-5, "what gravity has given"),
    ]


_KICK = Sizes(dt=0.7e-3, stiffness=1e8, row=1e-3)
_SPEED, _E, _WHEN, _END = 2.0, 0.5, 0.3, 0.4


def _kick(method: str) -> Facts:
    """A wall that starts at once strikes the ball that lies on it."""
    wall = Signal(formulas=((1.0, Formula("where(t < 0.3, 0, 2*(t - 0.3))", ("t",))),))
    ball = LinearSystem(
        mass=1.0, normals=[[1.0]], offsets=[0.0], restitution=_E, motion=[wall]
    )  # fmt: skip
    motion = run(method, ball, [0.0], [0.0], _END, _KICK)
    speed = (1.0 + _E) * _SPEED
    return {
        "speed": abs(float(motion.velocity[-1, 0]) / speed - 1.0),
        "place": abs(float(motion.position[-1, 0]) - speed * (_END - _WHEN)),
    }


def _kick_claims(method: str) -> Sequence[Claim]:
    return [
        Claim("speed", 1e-6, "Newton's law for the velocity relative to the wall after it"),
        _KICK.claim("place", method, (1.0 + _E) * _SPEED, "v tau"),
    ]


FORCES: tuple[Case, ...] = (
    Case("force and impulse, two steps", _force, _force_claims, VIBRO, body="point"),
    Case("wall that starts at once", _kick, _kick_claims, VIBRO, body="point"),
)
