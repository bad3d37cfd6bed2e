"""What in a scene is probably a mistake: bodies that meet nothing, units that do not fit.

A body is taken as rigid and its bounding box as the body: what is told to meet nothing meets
nothing. Where that is not certain (loads, rotations, moving obstacles), nothing is said.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.exact import ExactBar
from impactfem.findings import Finding, warning
from impactfem.scene import Scene
from impactfem.scene.pairing import body_pairs, obstacles_of

MEETS_NOTHING = "meets_nothing"
"""Code of bodies that meet nothing."""

_SAMPLES = 2000
_FAST = 3.0  # times the speed of waves

type Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Path:
    """A box on its way: half its edges (dim,), and its centres (samples, dim) [m]."""

    half: Floats
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
        return ()
    found = [doubt for body in scene.bodies for doubt in _units(body)]
    lonely = {finding.subject for finding in told if finding.code == MEETS_NOTHING}
    if not lonely & {body.name for body in scene.bodies} and _meet_nothing(scene):
        first, *others = (body.name for body in scene.bodies)
        what = "the bodies meet" if others else f"{first} meets"
        text = f"{what} nothing within duration = {scene.duration:g} s"
        remedy = "check the signs of velocity and gravity, and the duration"
        found.append(warning(MEETS_NOTHING, text, remedy=remedy))
    return tuple(found)


def doubts_of_bar(scene: Scene, exact: ExactBar) -> tuple[Finding, ...]:
    """Warnings about a bar that never meets the wall, and about units."""
    found = list(_units(scene.bar))
    if not float(exact.force_integral(0.0, scene.duration)):
        text = f"the bar never presses on the wall within duration = {scene.duration:g} s"
        remedy = "velocities towards the wall are negative, gravity towards it is positive"
        found.append(warning(MEETS_NOTHING, text, scene.bar.name, remedy))
    return tuple(found)


def _meet_nothing(scene: Scene) -> bool:
    """Whether it is certain that there is no contact: one impact may lead to others."""
    if scene.starts_at_rest:  # they are moved to where they are held
        return False
    if not scene.obstacles and all(body.may_meet_nothing for body in scene.bodies):
        return False  # nor shall they
    times = np.linspace(0.0, scene.duration, _SAMPLES)
    known = {body.name: _path(scene, body, times) for body in scene.bodies}
    paths = {name: path for name, path in known.items() if path is not None}
    if len(paths) < len(known):
        return False
    # Other methods than the march take points to meet only where it is said.
    pairs = body_pairs(scene) if scene.contacts or scene.marches else []
    return not any(
        _may_meet(path, obstacle)
        for name, path in paths.items()
        for obstacle in obstacles_of(scene, name)
    ) and not any(_may_touch(paths[one[0]], paths[two[0]]) for one, two in pairs)


def _units(body: Any) -> list[Finding]:
    """A body that moves faster than its waves: its modulus is perhaps in GPa or MPa."""
    if not hasattr(body, "youngs_modulus"):
        return []
    waves = math.sqrt(body.youngs_modulus / body.density)
    entries = body.velocity if isinstance(body.velocity, tuple) else (body.velocity,)
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    speed = math.hypot(*(e if isinstance(e, float) else float(e(**zero)) for e in entries))
    if not speed > _FAST * waves:
        return []
    text = f"body {body.name} moves {speed / waves:.2g} times as fast as the waves in it: strains "
    text += "are not small"
    remedy = "check the units, youngs_modulus in Pa (210 GPa is 210e9)"
    return [warning("units", text, body.name, remedy)]


def _path(scene: Scene, body: Any, times: Floats) -> _Path | None:
    """Way of a body that flies freely; None if that is not certain."""
    flight = body.flight
    if flight is None:
        return None
    velocity = np.asarray(flight.velocity)
    gravity = np.asarray(scene.vector_gravity.at(times), dtype=float)
    step = times[1] - times[0]
    speed = velocity + np.vstack([np.zeros_like(velocity), np.cumsum(gravity[:-1], axis=0) * step])
    way = np.vstack([np.zeros_like(velocity), np.cumsum(speed[1:] + speed[:-1], axis=0) * step / 2])
    return _Path(np.asarray(flight.half), np.asarray(flight.center) + way)


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


def _may_touch(one: _Path, two: _Path) -> bool:
    """Whether two boxes on their ways may touch."""
    apart = np.abs(one.centres - two.centres) - one.half - two.half
    return bool((apart <= one.margin + two.margin).all(axis=1).any())
