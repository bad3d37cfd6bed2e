"""Hard cases of a point in a corner: beside the vertex, next to it, and into it."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from impactfem.exact.vibro import elastic_corner
from impactfem.studies.hard.board import Case, Claim, Facts
from impactfem.studies.hard.vibro_facts import (
    STEPPED,
    VIBRO,
    WARNED,
    Sizes,
    basic_claims,
    facts_of,
    run,
    unwarned,
)
from impactfem.system.generalized import LinearSystem

_CORNER = Sizes(row=5e-2)
_ANGLES = {"pi/2": 0.5 * math.pi, "pi/3": math.pi / 3.0, "2pi/5": 0.4 * math.pi}


def _throw(method: str, angle: float, offset: float) -> Facts:
    """A ray that passes the vertex at a distance (> 0 on the left of its way)."""
    psi = math.pi + 0.62 * angle
    v = np.array([math.cos(psi), math.sin(psi)])
    start = -v + offset * np.array([-v[1], v[0]])
    walls = np.array([[0.0, 1.0], [math.sin(angle), -math.cos(angle)]])
    corner = LinearSystem(mass=[1.0, 1.0], normals=walls, offsets=[0.0, 0.0], restitution=1.0)
    motion = run(method, corner, start, v, 2.5, _CORNER)
    exact = -v  # into the vertex: P_T v = 0 in corners up to pi/2
    if offset != 0.0:
        first = int(np.argmin((walls @ start) / -(walls @ v)))
        exact = elastic_corner(angle, v, first).velocity
    found = {"direction": float(np.abs(motion.velocity[-1] - exact).max())}
    return found | facts_of(motion, 0.5) | {"unwarned": unwarned(motion)}


def _corner(name: str, *offsets: float) -> Callable[[str], Facts]:
    """The worst of the facts of some rays."""

    def thrown(method: str) -> Facts:
        worst: dict[str, float] = {}
        for offset in offsets:
            for fact, value in _throw(method, _ANGLES[name], offset).items():
                worst[fact] = max(value, worst.get(fact, 0.0))
        if min(map(abs, offsets)) > _CORNER.time("penalty"):
            del worst["unwarned"]  # there is nothing to warn of
        return worst

    return thrown


def _direction(method: str) -> Claim:
    """Rounding; by steps that of positions, 1e-12, over h; of penalty 1000 tolerances."""
    limits = {"event_driven": 1e-9, "penalty": 1e-6}
    return Claim("direction", limits.get(method, 1e-8), "unfolded reflections, to rounding")


def _corner_claims(method: str) -> Sequence[Claim]:
    return [*basic_claims(_CORNER, method, 1.0, 0.0), _direction(method)]


def _beside_claims(method: str) -> Sequence[Claim]:
    """Within h v of the vertex the direction of a stepped method is its own, but it must say so."""
    if method in STEPPED:
        return [WARNED, *basic_claims(_CORNER, method, 1.0, 0.0)]
    return _corner_claims(method)


def _vertex_claims(method: str) -> Sequence[Claim]:
    return [WARNED, *_corner_claims(method)]


CORNERS: tuple[Case, ...] = (
    *(Case(f"corner {name}, beside the vertex", _corner(name, -0.1, -1e-3, 1e-3, 0.1),
           _corner_claims, VIBRO, body="point")
      for name in _ANGLES),
    Case("corner 2pi/5, 5e-5 and 1e-6 beside the vertex",
         _corner("2pi/5", -5e-5, -1e-6, 1e-6, 5e-5), _beside_claims, VIBRO, body="point"),
    Case("corner 2pi/5, into the vertex", _corner("2pi/5", 0.0), _vertex_claims, VIBRO,
         body="point"),
)  # fmt: skip
"""Corners of three angles, lossless."""
