"""A watch on what contact may miss: corners between nodes, and steps that are too long.

Rods, beams and solids touch obstacles with their nodes, so that corners may pass between; edges of
rigid bodies may pass between nodes of solids; balls and axes have no inside, so that what moves
farther in a step than they are thick may pass through them.
"""

import json
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.ball_kernels import fastest_of
from impactfem.contact.convex_nodes import CornersOnFaces
from impactfem.contact.distance import signed_distance
from impactfem.contact.meeting import Led
from impactfem.contact.overlap import in_obstacle
from impactfem.findings import Finding, by_limits, percent
from impactfem.marching.marched import Marched
from impactfem.marching.rows import Level
from impactfem.models.solids import SolidsModel
from impactfem.runs.verdict import PENETRATION_LIMITS
from impactfem.scene.obstacles import Rigid
from impactfem.scene.pairing import obstacles_of

_PLACES = 8  # along each line, looked at first
_ALONG = (np.arange(_PLACES) + 0.5) / _PLACES
_WEIGHTS = {
    2: np.stack([1.0 - _ALONG, _ALONG], axis=1),
    3: np.array([*np.eye(3), *(0.5 * (1.0 - np.eye(3))), [1.0 / 3.0] * 3]),
}
"""Weights of the corners at places of a line, and of a triangle, (places, corners)."""
_BESIDE = {2: 0.5 / _PLACES, 3: 0.5}
"""How far from the nearest of these places a point may lie, share of the longest side."""

_BEST, _LOOKS_CLOSER, _CLOSER = 8, 12, 0.7  # simplices that are looked at again, each smaller
_LOOKS = 400  # at a run
_SHARES = (0.5, 1.0)  # of a thickness, passed in a step


class AxisWatch:
    """Measures how deep axes lie in obstacles, and these in solids between their nodes.

    Attributes:
        depth: Of each pair of a body and an obstacle [m], or of a rigid body and a solid, by their
            names.
        speed: Largest with which contact nodes near each other, or what stands [m/s].
    """

    def __init__(
        self, model: SolidsModel, few: Sequence[Marched], places: Floats, layers: int
    ) -> None:
        """Look at some layers of a march with contact nodes at places (nodes, dim) at first."""
        scene, self.speed = model.scene, 0.0
        self._reach = float(model.crowd.radii.sum(axis=1).min(initial=np.inf))
        several = model.ball_meetings
        # Axes and points of no radius have no thickness that could be missed.
        thick = (met.pair.thickness for met in several if met.pair.thickness > 0.0)
        self._reach = min([self._reach, *thick])
        self._led = [met.pair for met in several if isinstance(met.pair, Led)]
        # Solids have steppers of their own, obstacles none.
        others = {each.name for each in scene.obstacles} | {p.solid.name for p in model.parts}
        self._among = others.isdisjoint(name for met in several for name in met.names)
        self._places = places
        self._edges = {
            met.names: met.pair
            for met in several
            if isinstance(met.pair, CornersOnFaces) and len(met.pair.between)
        }
        self._solids = model.parts
        self._cuts = np.cumsum([0, *(len(part.system.constrained) for part in self._solids)])
        self._every = max(1, layers // _LOOKS)
        self._bodies = [
            (march, name, march.bodies.nodes_of(k)[march.bodies.lines_of(k)])
            for march in few
            for k, name in enumerate(march.bodies.names)
        ]
        self._steppers = tuple(dict.fromkeys(march.stepper for march in few))
        self._obstacles = {name: obstacles_of(scene, name) for _, name, _ in self._bodies}
        self.depth: dict[tuple[str, str], float] = {}

    def __call__(self, level: Level) -> None:
        """Look at a level if it is its turn."""
        if level.layer % self._every:
            return
        if self._steppers:
            each = np.concatenate([s.surface_velocity for s in self._steppers])
            # Bodies that meet only each other may all fly along: none nears another by that.
            fast = float(fastest_of(each, self._among))
            self.speed = max(self.speed, fast) if np.isfinite(fast) else self.speed
        for names, edged in self._edges.items():
            depth = -edged.least_between(self._places + level.surface)
            if depth > self.depth.get(names, 0.0):
                self.depth[names] = depth
        self._look_between(level)
        for march, name, lines in self._bodies:
            if not len(lines) or not self._obstacles[name]:
                continue
            simplices, room = march.shown.unguarded(lines)
            for obstacle in self._obstacles[name] if len(simplices) else ():
                reach = room
                if march.shown.nodes_sink:
                    corners = simplices.reshape(-1, simplices.shape[2])
                    reach = min(room, signed_distance(obstacle, corners, level.time)[0].min())
                pair = name, obstacle.name
                known = self.depth.get(pair, 0.0)
                depth = reach - _nearest(obstacle, simplices, level.time, reach - known)
                if np.isfinite(depth) and depth > known:
                    self.depth[pair] = depth

    def _look_between(self, level: Level) -> None:
        """Look for obstacles between nodes of solids, by more than chords of round ones."""
        for part, (first, end) in zip(self._solids, pairwise(self._cuts), strict=True):
            places = part.places_at(level.displacement[first:end])
            for obstacle in part.obstacles:
                least = {} if obstacle.is_smooth else {"least": 0.0}
                held = PENETRATION_LIMITS[0]  # from which it is told of nodes
                found = in_obstacle(obstacle, level.time, part.outside, places, held=held, **least)
                pair = part.solid.name, obstacle.name
                if found is not None and found[0] > self.depth.get(pair, 0.0):
                    self.depth[pair] = found[0]

    def findings(self) -> Iterator[Finding]:
        """What was seen."""
        dt = self._bodies[0][0].dt if self._bodies else 0.0
        speed = self.speed + max((led.speed for led in self._led), default=0.0)
        share = speed * dt / self._reach
        text = f"a body moves {speed * dt:.2g} m in a step, {percent(share)} of the least "
        text += "thickness of two that may meet: they can pass through each other"
        remedy = f"use solve.dt below {_SHARES[0] * self._reach / (speed or 1.0):.1g}"
        yield from by_limits("contact_unresolved", share, _SHARES, text, remedy=remedy)
        for names, edged in self._edges.items():
            depth = self.depth.get(names, 0.0)
            share, (other, name) = depth / edged.body.shape.thickness, names
            text = f"an edge of {name} lies up to {depth:.2g} m in {other}, {percent(share)} of "
            text += f"{name}: only its corners and the nodes of {other} touch"
            remedy = "take smaller elements where they meet"
            yield from by_limits("penetration", share, PENETRATION_LIMITS, text, name, remedy)
        for part in self._solids:
            solid = part.solid.name
            for tip in (obstacle.name for obstacle in part.obstacles):
                share = (depth := self.depth.get((solid, tip), 0.0)) / part.outside.size
                text = f"{tip} lies up to {depth:.2g} m in {solid} between its nodes, "
                text += f"{percent(share)} of its size: only nodes touch obstacles"
                remedy = f"take smaller elements where {solid} meets {tip}"
                yield from by_limits("penetration", share, PENETRATION_LIMITS, text, solid, remedy)
        for march, name, lines in self._bodies:
            yield from march.findings()
            if not len(lines):
                continue
            (size, what, remedy), measure = (
                march.shown.unguarded_in_words(lines),
                march.shown.measure,
            )
            for (body, obstacle), depth in self.depth.items():
                if body == name:
                    share = depth / size
                    text = f"{what.format(name=name)} up to {depth:.2g} m in {obstacle}, "
                    text += f"{percent(share)} of its {measure}: only its contact nodes "
                    text += "touch obstacles"
                    yield from by_limits(
                        "penetration", share, PENETRATION_LIMITS, text, name, remedy
                    )

    def state(self) -> str:
        """What was seen, for a checkpoint."""
        return json.dumps([self.speed, [[*pair, depth] for pair, depth in self.depth.items()]])

    def restore(self, state: str) -> None:
        """Go on from what was seen."""
        self.speed, seen = json.loads(state)
        self.depth = {(body, obstacle): depth for body, obstacle, depth in seen}


def _nearest(obstacle: Rigid, simplices: Floats, time: float, below: float) -> float:
    """Least signed distance [m] of an obstacle from lines or triangles (several, corners, dim).

    Only one below a limit [m] is looked for: simplices that are farther off are left, and most
    levels end with the first look. The distance from a convex obstacle is convex on each: a look at
    ever smaller parts about the best place finds tips that are far smaller than the simplices.
    """
    weights, least = _WEIGHTS[simplices.shape[1]], np.inf
    for _ in range(1 + _LOOKS_CLOSER):
        places = np.einsum("pk,nkd->npd", weights, simplices)
        flat = signed_distance(obstacle, places.reshape(-1, places.shape[2]), time)[0]
        away = flat.reshape(places.shape[:2])
        own = away.min(axis=1)
        least = min(least, float(own.min()))
        best = np.argsort(own)[:_BEST]
        sides = simplices[best] - np.roll(simplices[best], 1, axis=1)
        beside = _BESIDE[simplices.shape[1]] * np.linalg.norm(sides, axis=2).max(axis=1)
        best = best[obstacle.least_near(own[best], beside) < below]
        if not len(best):
            break
        centres = places[best, away[best].argmin(axis=1)][:, None]
        simplices = centres + _CLOSER * (simplices[best] - centres)
    return least
