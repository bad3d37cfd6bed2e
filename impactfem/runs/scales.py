"""How large the bodies of a scene are, and what rounding of their coordinates can make of it.

Relative measures need a scale, and at rest there is none but these: motions shorter than
`rounding_way` and energies below `rounding_energy` are none.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.findings import Finding, by_limits, percent
from impactfem.result.table import Table
from impactfem.scene import Scene

_AXES = "xyz"
_EPS = float(np.finfo(np.float64).eps)
_LEAST = (
    1e-11  # equations of a layer lose up to five of sixteen digits, however few layers there are
)


OPENING_LIMITS = (1e-8, 1e-4)
"""Opening of a joint, as a share of its bodies or in radians, that is no rounding, and no joint."""


def opening_findings(
    scene: Scene, history: Table, opened: Mapping[str, tuple[float, float]]
) -> Iterator[Finding]:
    """Joints that stand open at the end of a run.

    Args:
        scene: What was modelled.
        history: History of the run.
        opened: How far they are open by their names [m], [rad].
    """
    sizes = {body.name: _size(body, history) for body in scene.bodies}
    between = {joint.name: joint.bodies or sizes for joint in scene.couplings}
    least = rounding_way(scene, history, len(history["time"].values))
    for name, (way, turn) in opened.items():
        known = [size for body in between[name] if (size := sizes.get(body))]
        share = way / min(known) if known and way > least else 0.0
        text = f"joint {name} is open by {way:.2g} m, {percent(share)} of a body"
        if turn > share:
            share, text = turn, f"joint {name} is open by {turn:.2g} rad"
        remedy = "use a smaller solve.dt, or check points and axes of joints that hold one another"
        yield from by_limits("joint_open", share, OPENING_LIMITS, text, name, remedy)


def size_of(scene: Scene, history: Table) -> float | None:
    """Smallest characteristic length of the bodies [m].

    The length of bars, rods and beams, the largest extent of a solid's shape, of others the larger
    one of their extent and their way. None if nothing has a length.
    """
    known = [size for body in scene.bodies if (size := _size(body, history))]
    return min(known) if known else None


def rounding_share(layers: int) -> float:
    """Share of a body's extent, its place and way included, below which a way is but rounding.

    Coordinates are kept to eps of it. Each layer adds as much again.

    Args:
        layers: That the run took, or as many as are known.
    """
    return max(_LEAST, layers * _EPS)


def fall_in_step(scene: Scene, times: Floats) -> float:
    """Way that bodies would fall in a step [m]: what rests at the origin has no other length.

    Args:
        scene: What was modelled.
        times: Of the levels [s].
    """
    step = float(times[-1] - times[0]) / max(1, len(times) - 1)
    return _pull(scene) * step**2


def _pull(scene: Scene) -> float:
    """Largest gravity [m/s^2]."""
    pulls = np.asarray(scene.gravity.values, dtype=np.float64)
    return float(np.linalg.norm(pulls.reshape(len(pulls), -1), axis=1).max())


def rounding_way(scene: Scene, history: Table, layers: int) -> float:
    """Way that rounding of coordinates can make in a run, `rounding_share` of the largest one [m].

    Args:
        scene: What was modelled.
        history: Of the run.
        layers: That it took.
    """
    names = (f"{body.name}.{axis}" for body in scene.bodies for axis in _AXES)
    places = [history[name].values for name in names if name in history]
    finite = (np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in places)
    sizes = (_size(body, history) or 0.0 for body in scene.bodies)
    falls = fall_in_step(scene, history["time"].values)
    return rounding_share(layers) * float(max(*finite, *sizes, falls))


def rounding_energy(
    scene: Scene, history: Table, layers: int, bodies: Mapping[str, Mapping[str, Any]]
) -> float:
    """Energy that rounding of coordinates can make in a run [J].

    It is the work of the weights and of the largest contact force over `rounding_way`, and what
    bodies have that go as far in the run.

    Args:
        scene: What was modelled.
        history: Of the run.
        layers: That it took.
        bodies: With the mass of each, as in ``summary.json``.
    """
    way = rounding_way(scene, history, layers)
    mass = float(sum(body["mass"] for body in bodies.values()))
    force = np.abs(history["contact_force"].values)
    largest = float(force[np.isfinite(force)].max(initial=0.0))
    jump = way / (history["time"].values[-1] or 1.0)
    return way * (mass * _pull(scene) + largest) + 0.5 * mass * jump**2


def _size(body: Any, history: Table) -> float | None:
    if hasattr(body, "length"):
        return float(body.length)
    if hasattr(body, "shape"):
        return None if body.shape is None else 2.0 * max(body.shape.half_extents)
    box = body.box()
    if box is None:
        return None
    columns = [history[f"{body.name}.{axis}"].values for axis in _AXES]
    way = max(float(column.max() - column.min()) for column in columns)
    return max(2.0 * float(box[0].max()), way)
