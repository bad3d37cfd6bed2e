"""Probes of bars, points, rods and beams: places between the nodes of a line."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.result.bar_motion import BarMotion, kept_levels
from impactfem.result.bar_row_motion import RowMotion
from impactfem.result.trajectory import Trajectory
from impactfem.runs.accelerations import Probed, accelerated
from impactfem.scene import Bar, Probe, Scene
from impactfem.scene.probes import outside

if TYPE_CHECKING:
    from impactfem.models.vibro import VibroModel

LETTERS = {"displacement": "u", "velocity": "v"}
"""First letters of the columns of vectors, by quantity."""

_ROUNDING = 1e-6  # share of a line's length by which a place may lie beside it
_TINY = 1e-30  # imaginary step of derivatives
_VALUES = 2**20  # values held at once


def on_line(nodes: Floats, point: ArrayLike, room: float = 0.0) -> Floats | None:
    """Weights of the nodes of a line at a place on it, shape (nodes,); None if it is beside.

    Args:
        nodes: Places of the nodes, one after the other [m], (nodes, dim).
        point: The place [m], (dim,).
        room: How far beside the line it may lie besides rounding [m].
    """
    place, weights = np.asarray(point, dtype=float), np.zeros(len(nodes))
    allowed = room + _ROUNDING * float(np.ptp(nodes, axis=0).max(initial=0.0))
    if len(nodes) == 1:
        weights[0] = 1.0
        allowed += 1e-9 * float(np.abs(nodes).max())
        return weights if np.linalg.norm(place - nodes[0]) <= allowed else None
    way = np.diff(nodes, axis=0)
    share = np.einsum("ij,ij->i", place - nodes[:-1], way) / np.einsum("ij,ij->i", way, way)
    share = np.clip(share, 0.0, 1.0)
    apart = np.linalg.norm(nodes[:-1] + share[:, None] * way - place, axis=1)
    k = int(np.argmin(apart))
    weights[k], weights[k + 1] = 1.0 - share[k], share[k]
    return weights if apart[k] <= allowed else None


def vibro_probes(scene: Scene, model: "VibroModel") -> Callable[[Trajectory], Probed]:
    """What tells the columns of probes of points, rods and beams from their motion.

    Raises:
        SceneError: A probe is outside its body.
    """
    rest = [np.asarray(shape.points, dtype=float) for shape in model.shapes]
    starts = np.cumsum([0, *map(len, rest)])
    rows = []
    for index, probe in enumerate(scene.probes):
        body = [shape.name for shape in model.shapes].index(probe.body)
        # Of a ball all places move alike; of a line those on it.
        radius = np.asarray(model.shapes[body].radius, dtype=float)
        room = float(radius.max()) if len(rest[body]) == 1 else 0.0
        found = on_line(rest[body], probe.point, room)
        if found is None:
            raise outside(index, probe, _nearest(rest[body], probe.point))
        rows.append(np.zeros(starts[-1]))
        rows[-1][starts[body] : starts[body + 1]] = found

    def told(motion: Trajectory) -> Probed:
        if not rows:
            return {}
        weights, at_rest = np.array(rows), np.concatenate(rest)
        parts = -(-len(motion.times) * at_rest.size // _VALUES)
        moved, speed = [], []
        for u, v in zip(*(np.array_split(a, parts) for a in (motion.position, motion.velocity)),
                        strict=True):  # fmt: skip
            moved.append(np.einsum("pn,rnk->rpk", weights, model.places(u) - at_rest))
            rates = model.places(u + 1j * _TINY * v).imag / _TINY
            speed.append(np.einsum("pn,rnk->rpk", weights, rates))
        known = {"displacement": np.concatenate(moved), "velocity": np.concatenate(speed)}
        found = {
            probe.name: {
                f"{letter}{'xyz'[k]}": known[quantity][:, index, k]
                for quantity, letter in LETTERS.items()
                if quantity in probe.watched
                for k in range(scene.dim)
            }
            for index, probe in enumerate(scene.probes)
        }
        return accelerated(scene.probes, motion.times, found)

    return told


def _nearest(nodes: Floats, point: ArrayLike) -> Floats:
    apart = np.linalg.norm(nodes - np.asarray(point, dtype=float), axis=1)
    return np.asarray(nodes[int(np.argmin(apart))])


def check_bar_probes(scene: Scene) -> None:
    """Refuse probes outside their bars.

    Raises:
        SceneError: One is.
    """
    bars = {bar.name: bar for bar in scene.bars}
    for index, probe in enumerate(scene.probes):
        length = bars[probe.body].length
        if not 0.0 <= probe.point[0] <= length:
            raise outside(index, probe, [min(max(probe.point[0], 0.0), length)])


def every_level(scene: Scene) -> Scene:
    """The scene as it is run for its probes: they look at every level."""
    return replace(scene, output=replace(scene.output, every=1)) if _looks(scene) else scene


def _looks(scene: Scene) -> bool:
    """Whether something looks at every level: probes, or controllers at far ends."""
    return bool(scene.probes) or any("v" in bar.far_end_force.used for bar in scene.bars)


def thinned[M: (BarMotion, RowMotion)](motion: M, scene: Scene) -> M:
    """The motion with the fields of those levels only that were asked for."""
    if not _looks(scene):
        return motion
    kept = kept_levels(len(motion.times) - 1, scene.output.stride)

    def cut(values: Any) -> Any:
        return tuple(map(cut, values)) if isinstance(values, tuple) else values[kept]

    thin: M = replace(
        motion, kept=kept, displacement=cut(motion.displacement), velocity=cut(motion.velocity)
    )
    return thin


def bar_probes(scene: Scene, motion: RowMotion) -> Probed:
    """Columns of probes of bars: displacement from the place without strain, elastic stress.

    Args:
        scene: The scene.
        motion: Its motion with all levels kept.
    """
    names, found = [bar.name for bar in scene.bars], {}
    for probe in scene.probes:
        k = names.index(probe.body)
        found[probe.name] = _of_bar(
            probe, scene.bars[k], motion.positions[k], motion.displacement[k], motion.velocity[k]
        )
    told = accelerated(scene.probes, motion.times, found)
    for k, bar in enumerate(scene.bars):
        if "v" in bar.far_end_force.used:
            end = Probe(name="far_end", body=bar.name, point=[bar.length])
            told[f"{bar.name}.far_end"] = _of_bar(
                end, bar, motion.positions[k], motion.displacement[k], motion.velocity[k]
            )
    return told


def _of_bar(probe: Probe, bar: Bar, x: Floats, u: Floats, v: Floats) -> dict[str, Floats]:
    place = float(probe.point[0])
    # At a node the mean of the elements beside it.
    beside = [int(np.searchsorted(x, place, side="left")), int(np.searchsorted(x, place, "right"))]
    first, last = (min(max(k - 1, 0), len(x) - 2) for k in beside)
    share = (place - x[first]) / (x[first + 1] - x[first])
    columns = {}
    if "displacement" in probe.quantities:
        columns["ux"] = (1.0 - share) * u[:, first] + share * u[:, first + 1] - bar.gap
    if "velocity" in probe.watched:
        columns["vx"] = (1.0 - share) * v[:, first] + share * v[:, first + 1]
    if "stress" in probe.quantities:
        slopes = [(u[:, k + 1] - u[:, k]) / (x[k + 1] - x[k]) for k in (first, last)]
        moduli = bar.at("youngs_modulus", 0.5 * (x[[first, last]] + x[[first + 1, last + 1]]))
        columns["sxx"] = 0.5 * (moduli[0] * slopes[0] + moduli[1] * slopes[1])
    return columns
