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
from impactfem.scene import Beam, HalfSpace, Point, RigidCylinder, RigidSphere, Rod, Scene
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
        what = f"{scene.bodies[0].name} meets" if len(scene.bodies) == 1 else "the bodies meet"
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
    times = np.linspace(0.0, scene.duration, _SAMPLES)
    known = {body.name: _path(scene, body, times) for body in scene.bodies}
    paths = {name: path for name, path in known.items() if path is not None}
    if len(paths) < len(known):
        return False
    pairs = _point_pairs(scene) if scene.is_vibro else _marched_pairs(scene)
    return not any(
        _may_meet(path, obstacle)
        for name, path in paths.items()
        for obstacle in obstacles_of(scene, name)
    ) and not any(_may_touch(paths[one], paths[two]) for one, two in pairs)


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
    box = _box(body)
    velocity = _uniform_velocity(body)
    if box is None or velocity is None:
        return None
    gravity = np.asarray(scene.vector_gravity.at(times), dtype=float)
    step = times[1] - times[0]
    speed = velocity + np.vstack([np.zeros_like(velocity), np.cumsum(gravity[:-1], axis=0) * step])
    way = np.vstack([np.zeros_like(velocity), np.cumsum(speed[1:] + speed[:-1], axis=0) * step / 2])
    half, centre = box
    return _Path(half, centre + way)


def _box(body: Any) -> tuple[Floats, Floats] | None:
    """Half edges and centre of a box around a body in any rotation that it may take."""
    if isinstance(body, Point):
        return np.full(body.dim, body.radius), np.asarray(body.position)
    if isinstance(body, Rod | Beam):
        half = body.length / 2 + getattr(body, "radius", 0.0)
        return np.full(2, half), np.asarray(body.center)
    if body.shape is None:
        return None
    lower, upper = map(np.asarray, body.shape.bounds(axisymmetric=body.is_axisymmetric))
    return (upper - lower) / 2, (upper + lower) / 2


def _uniform_velocity(body: Any) -> Floats | None:
    """Velocity of a body with which it moves without load and rotation; else None."""
    if isinstance(body, Point):
        return None if body.force or body.springs else np.asarray(body.velocity)
    if isinstance(body, Rod):
        return np.asarray(body.velocity)
    if isinstance(body, Beam):
        return None if body.rayleigh_damping[0] else np.asarray(body.velocity)
    spin = body.angular_velocity
    loads = (body.supports, body.tractions, body.pressures, body.rayleigh_mass)
    turns = any(spin) if isinstance(spin, tuple) else spin
    formulas = (*body.velocity, *body.displacement)
    still = all(entry.is_constant and float(entry()) == 0.0 for entry in body.displacement)
    if any(loads) or turns or not still or not all(entry.is_constant for entry in formulas):
        return None
    return np.array([float(entry()) for entry in body.velocity])


def _point_pairs(scene: Scene) -> list[tuple[str, str]]:
    """Pairs of points that may meet."""
    names = {body.name for body in scene.bodies}
    pairs = [entry.between for entry in scene.contacts]
    return [(one, two) for one, two in pairs if one in names and two in names]


def _marched_pairs(scene: Scene) -> list[tuple[str, str]]:
    """Pairs of bodies that may meet in the march."""
    return [(one[0], two[0]) for one, two in body_pairs(scene)]


def _may_meet(path: _Path, obstacle: Any) -> bool:
    """Whether a box may meet an obstacle; true if it is not known."""
    if obstacle.motion is not None:
        return True
    if isinstance(obstacle, HalfSpace):
        normal = np.asarray(obstacle.unit_normal)
        height = (path.centres - np.asarray(obstacle.point)) @ normal
        return bool((height - np.abs(normal) @ path.half <= path.margin).any())
    circle = isinstance(obstacle, RigidCylinder) and len(obstacle.point) == 2
    if isinstance(obstacle, RigidSphere) or circle:
        if obstacle.side == "inside":
            return True
        centre = np.asarray(getattr(obstacle, "center", getattr(obstacle, "point", None)))
        apart = np.maximum(np.abs(path.centres - centre) - path.half, 0.0)
        reach = obstacle.radius + path.margin * math.sqrt(len(centre))
        return bool((np.linalg.norm(apart, axis=1) <= reach).any())
    return True


def _may_touch(one: _Path, two: _Path) -> bool:
    """Whether two boxes on their ways may touch."""
    apart = np.abs(one.centres - two.centres) - one.half - two.half
    return bool((apart <= one.margin + two.margin).all(axis=1).any())
