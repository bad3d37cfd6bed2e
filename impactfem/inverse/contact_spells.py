"""When pairs of a march touch, as measures tell it: continued beyond the time levels."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.result.table import Table
from impactfem.scene import Scene


@dataclass(frozen=True)
class Pair:
    """What a pair did in a march.

    Attributes:
        name: Of the pair.
        force: Normal force in the layer before each level [N], (levels,).
        gap: Least gap at each level [m], (levels,).
        impulse: Up to each level [N s], (levels,).
        spells: Levels, first and last, between which it touches.
        times: Of these spells, gaps continued to 0 beyond the levels [s], (spells, 2).
    """

    name: str
    force: Floats
    gap: Floats
    impulse: Floats
    spells: list[tuple[int, int]]
    times: Floats

    @classmethod
    def of(cls, name: str, history: Table, tolerance: float, *, by_force: bool = False) -> "Pair":
        """Of a history.

        Args:
            name: Of the pair.
            history: With its columns.
            tolerance: Gap that is none [m].
            by_force: Whether it also touches at the end of each layer in which it presses, as where
                iterates keep the gap with which it began to.
        """
        levels = np.asarray(history["time"].values)
        force, gap = (np.asarray(history[f"{c}.{name}"].values) for c in ("force", "gap"))
        struck = history.get(f"impulse.{name}")
        pushed = np.zeros(len(levels)) if struck is None else np.asarray(struck.values)
        impulse = np.cumsum(pushed + np.concatenate([[0.0], force[1:] * np.diff(levels)]))
        shut = (gap <= tolerance) | (by_force & (force > 0.0))
        touches = np.concatenate([[False], shut, [False]]).astype(np.int8)
        begins, ends = np.flatnonzero(np.diff(touches) > 0), np.flatnonzero(np.diff(touches) < 0)
        spells = list(zip(begins.tolist(), (ends - 1).tolist(), strict=True))
        times = [(_touch(levels, gap, b, -1), _touch(levels, gap, e, 1)) for b, e in spells]
        return cls(name, force, gap, impulse, spells, np.array(times).reshape(-1, 2))

    @property
    def begin(self) -> float:
        """When it first touches [s]; NaN if it does not."""
        return float(self.times[0, 0]) if len(self.times) else float("nan")

    @property
    def duration(self) -> float:
        """How long it touches in all [s]."""
        return float(np.diff(self.times, axis=1).sum())


def _touch(levels: Floats, gap: Floats, level: int, way: int) -> float:
    """When a gap that is shut at a level was so first or last [s].

    The straight line through the two levels beyond, held within the layer.

    Args:
        levels: Times [s].
        gap: Of the pair at these [m].
        level: First or last one of a spell.
        way: -1 for what was before it, 1 for what comes after it.
    """
    near, far = level + way, level + 2 * way
    if not 0 <= near < len(levels) or np.isnan(gap[near]):
        return float(levels[level])
    if not 0 <= far < len(levels) or not gap[far] > gap[near]:
        return float(levels[near])
    beyond = (levels[far] - levels[near]) * gap[near] / (gap[far] - gap[near])
    return float(np.clip(levels[near] - beyond, *sorted((levels[level], levels[near]))))


def rebound_row(name: str, scene: Scene, pairs: Mapping[str, Pair], last: int) -> int:
    """Row of the history after a body's last contact; 0 if there was none, or it lasts.

    Args:
        name: Of the body.
        scene: The scene.
        pairs: What its pairs did.
        last: Row of the history.
    """
    own = [pair for pair in pairs.values() if name in _partners(scene, pair.name)]
    pressed: Integers = np.flatnonzero(sum((pair.force for pair in own), np.zeros(1)))
    return int(pressed[-1]) + 1 if pressed.size and pressed[-1] < last else 0


def _partners(scene: Scene, pair: str) -> tuple[str, ...]:
    """Bodies of a pair by its name, BODY.OTHER or that of its contact law."""
    for law in scene.contacts:
        if law.name == pair:
            return tuple(side.partition("/")[0] for side in law.between)
    bodies = [body.name for body in scene.bodies]
    return tuple(n for n in bodies if pair.startswith(f"{n}.") or pair.endswith(f".{n}"))
