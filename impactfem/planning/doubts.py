"""What in a scene is probably a mistake: bodies that meet nothing, units that do not fit.

A body is taken as rigid and its bounding box as the body: what is told to meet nothing meets
nothing. Where that is not certain (loads, rotations, moving obstacles), nothing is said.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.exact import ExactBar
from impactfem.findings import Finding, warning
from impactfem.scene import Scene
from impactfem.scene.apartness import Apartness
from impactfem.scene.pairing import bodies_met, obstacles_of, self_meeting

MEETS_NOTHING = "meets_nothing"
"""Code of bodies that meet nothing."""

_SAMPLES = 2000
_ROUNDING = 1e-9  # share of the size of boxes within which they touch
_FAST = 3.0  # times the speed of waves


@dataclass(frozen=True)
class _Path:
    """A box on its way: half its edges (dim,), velocity at t = 0 (dim,) and centres (samples, dim).

    In m and m/s.
    """

    half: Floats
    velocity: Floats
    centres: Floats

    @property
    def margin(self) -> float:
        """Largest step between two samples [m]."""
        return float(np.abs(np.diff(self.centres, axis=0)).max(initial=0.0))


def doubts(scene: Scene, told: Sequence[Finding] = ()) -> tuple[Finding, ...]:
    """Warnings about points, rods, beams and solids that meet nothing, and about units.

    Args:
        scene: The scene.
        told: What is known already, which may say more of a body that meets nothing.
    """
    if scene.bars:
        return _only_fly(scene)
    found = [doubt for body in scene.bodies for doubt in units_of(body, _against(scene))]
    lonely = {finding.subject for finding in told if finding.code == MEETS_NOTHING}
    if not lonely & {body.name for body in scene.bodies} and _meet_nothing(scene):
        first, *others = (body.name for body in scene.bodies)
        what = "the bodies meet" if others else f"{first} meets"
        text = f"{what} nothing within duration = {scene.duration:g} s"
        remedy = "check the signs of velocity and gravity, and the duration"
        found.append(warning(MEETS_NOTHING, text, remedy=remedy))
    return tuple(found)


def _only_fly(scene: Scene) -> tuple[Finding, ...]:
    """A warning about a bar without a wall that does not even vibrate."""
    first, *others = scene.bars
    still = first.velocity.is_constant and first.displacement.is_constant
    if scene.obstacles or others or not still:
        return ()
    text = f"{first.name} meets nothing, and nothing makes it vibrate: it only flies"
    remedy = 'add [[obstacle]] with kind = "wall", or a velocity or displacement that varies in x'
    return (warning(MEETS_NOTHING, text, remedy=remedy),)


def doubts_of_bar(scene: Scene, exact: ExactBar) -> tuple[Finding, ...]:
    """Warnings about a bar that never meets the wall, and about units."""
    found = list(units_of(scene.bar))
    if not float(exact.force_integral(0.0, scene.duration)):
        text = f"the bar never presses on the wall within duration = {scene.duration:g} s"
        remedy = "velocities towards the wall are negative, gravity towards it is positive"
        found.append(warning(MEETS_NOTHING, text, scene.bar.name, remedy))
    return tuple(found)


def may_reach(apart: Apartness, body: str, obstacle: Any) -> bool:
    """Whether a body may meet an obstacle, whatever strikes it."""
    if not apart.balls:
        return True
    radius, center = apart.balls[body]
    ways = np.array([center, center + apart.way])
    half = np.full(len(center), radius)
    return _may_meet(_Path(half, np.zeros(len(center)), ways), obstacle)


def _meet_nothing(scene: Scene) -> bool:
    """Whether it is certain that there is no contact: one impact may lead to others."""
    if scene.starts_at_rest:  # they are moved to where they are held
        return False
    lone = len(scene.bodies) == 1 or not scene.solids  # several solids are there to meet
    wanted = (
        body.may_meet_nothing
        and (body.flight is None or (body.turns_in_joints and not body.in_elements))
        for body in scene.bodies
    )
    if lone and not scene.obstacles and all(wanted):
        return False  # nor shall they, while what has elements, or does not turn, would only fly
    times = np.linspace(0.0, scene.duration, _SAMPLES)
    known = {body.name: _path(scene, body, times) for body in scene.bodies}
    paths = {name: path for name, path in known.items() if path is not None}
    if len(paths) < len(known):
        return False
    if any(
        _may_meet(path, obstacle)
        for name, path in paths.items()
        for obstacle in obstacles_of(scene, name)
    ):
        return False
    # Other methods than the march take points to meet only where it is said.
    return not (scene.contacts or scene.marches) or not _may_touch(scene, paths)


def _speed(body: Any) -> Floats:
    """Velocity at x = 0 [m/s], (entries,)."""
    given = body.velocity or 0.0
    entries = given if isinstance(given, tuple) else (given,)
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    return np.array([e if isinstance(e, float) else float(e(**zero)) for e in entries])


def _against(scene: Scene) -> list[Floats]:
    """Velocities against which those of bodies count [m/s]: of all that meet only each other."""
    held = any(getattr(body, "supports", ()) for body in scene.bodies) or scene.couplings
    if scene.obstacles or held or len(scene.bodies) == 1:
        return []
    speeds = [_speed(body) for body in scene.bodies if hasattr(body, "velocity")]
    return speeds if len({len(each) for each in speeds}) == 1 else []


def units_of(body: Any, against: Sequence[Floats] = ()) -> list[Finding]:
    """A body that moves faster than its waves: its modulus is perhaps in GPa or MPa.

    Args:
        body: The body.
        against: Velocities against which its own counts [m/s]; none: 0.
    """
    if getattr(body, "youngs_modulus", None) is None or not getattr(body, "is_uniform", True):
        return []
    waves = getattr(body, "wave_speed", None)  # of bars, along which it may vary
    if waves is None:
        waves = math.sqrt(body.youngs_modulus / body.density)
    own = _speed(body)
    speed = max(float(np.linalg.norm(own - other)) for other in against or [0.0 * own])
    if not speed > _FAST * waves:
        return []
    text = f"body {body.name} moves {speed / waves:.2g} times as fast as the waves in it: strains "
    text += "are not small"
    remedy = "check the units, youngs_modulus in Pa (210 GPa is 210e9)"
    return [warning("units", text, body.name, remedy)]


def _path(scene: Scene, body: Any, times: Floats) -> _Path | None:
    """Way of a body that flies freely; None if that is not certain."""
    flight = body.flight
    if flight is None or any(body.name in joint.bodies for joint in scene.couplings):
        return None
    velocity = np.asarray(flight.velocity)
    gravity = np.asarray(scene.vector_gravity.at(times), dtype=float)
    step = times[1] - times[0]
    speed = velocity + np.vstack([np.zeros_like(velocity), np.cumsum(gravity[:-1], axis=0) * step])
    way = np.vstack([np.zeros_like(velocity), np.cumsum(speed[1:] + speed[:-1], axis=0) * step / 2])
    return _Path(np.asarray(flight.half), velocity, np.asarray(flight.center) + way)


def _may_meet(path: _Path, obstacle: Any) -> bool:
    """Whether a box may meet an obstacle; true if it is not known."""
    plane, core = obstacle.plane, obstacle.core
    if obstacle.moves:
        return True
    if plane is not None:
        height = (path.centres - np.asarray(plane.point)) @ np.asarray(plane.normal)
        return bool((height - np.abs(plane.normal) @ path.half <= path.margin).any())
    if core is None or core.axis is not None or core.side < 0.0:
        return True
    apart = np.maximum(np.abs(path.centres - core.center) - path.half, 0.0)
    reach = core.radius + path.margin * math.sqrt(len(core.center))
    return bool((np.linalg.norm(apart, axis=1) <= reach).any())


def _may_touch(scene: Scene, paths: Mapping[str, _Path]) -> bool:
    """Whether the boxes of two bodies that may meet ever touch, which fall alike."""
    names = list(paths)
    half = np.array([path.half for path in paths.values()])
    speed = np.array([path.velocity for path in paths.values()])
    start = np.array([path.centres[0] for path in paths.values()])
    for k, name in enumerate(names):
        others = slice(k + 1, None)
        # Along each axis -room <= apart + speed t <= room.
        apart, fast = start[others] - start[k], speed[others] - speed[k]
        room = (1.0 + _ROUNDING) * (half[others] + half[k])
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort([(-room - apart) / fast, (room - apart) / fast], axis=0)
        still = np.where(np.abs(apart) <= room, np.inf, -np.inf)
        first = np.where(fast == 0.0, -still, ends[0]).max(axis=1)
        last = np.where(fast == 0.0, still, ends[1]).min(axis=1)
        near = np.flatnonzero((first <= last) & (last >= 0.0) & (first <= scene.duration))
        met = bodies_met(scene, name) if len(near) else ()
        if not set(met).isdisjoint(names[k + 1 + j] for j in near.tolist()):
            return True
    return bool(self_meeting(scene))
