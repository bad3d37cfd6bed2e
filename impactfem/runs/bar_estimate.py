"""The error of a bar whose exact solution is not known, from runs on other elements."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from impactfem.planning import BarNumbers, Plan
from impactfem.reference.bar import Errors, norm, relative, trapezoidal
from impactfem.result import BarMotion
from impactfem.scene import Scene
from impactfem.sizing import ON_LAYER, off_nodes

_SAFETY = 2.0  # errors of first order, as those of events between layers are


def estimate_of_bar(
    scene: Scene, plan: Plan[BarNumbers], motion: BarMotion,
    solve: Callable[[Scene, Plan[BarNumbers]], BarMotion],
) -> Errors:  # fmt: skip
    """Errors of a motion in layers, from those that it has nodes and levels in common with.

    A run on halved elements alone can agree by chance: an impact between layers may end at the same
    level in both, and does the same harm there. So there is one more, with few common levels.

    Args:
        scene: The scene.
        plan: Its plan.
        motion: What it gave, fields at the kept levels.
        solve: Solves a scene by galerkin.
    """
    count = plan.numbers.elements or 1
    others = (2 * count, _beside(scene, count))
    found = [_apart(scene, plan, motion, other, solve) for other in others]
    largest = [max(values) for values in zip(*found, strict=True)]
    text = f"runs on {others[0]} and {others[1]} elements, twice the difference"
    return Errors(text, *(_SAFETY * value for value in largest))


def _beside(scene: Scene, count: int) -> int:
    """Number of elements with few nodes in common, and nodes at the same jumps of impedance."""
    jumps = scene.bar.jumps
    room = max(off_nodes(jumps, count), ON_LAYER)
    between = range(count + count // 2, 2 * count)
    known = [number for number in between if off_nodes(jumps, number) <= room]
    known = known or [count + count // 2]
    return min(known, key=lambda number: (math.gcd(number, count) == 1, math.gcd(number, count)))


def _apart(
    scene: Scene, plan: Plan[BarNumbers], motion: BarMotion, count: int,
    solve: Callable[[Scene, Plan[BarNumbers]], BarMotion],
) -> tuple[float, float, float]:  # fmt: skip
    """Differences at common nodes and levels: largest, L2, of the force in L1; all relative."""
    numbers = plan.numbers
    own = numbers.elements or 1
    common = math.gcd(own, count)
    step, fine = own // common, count // common
    rows = len(motion.multiplier) // step
    finer = replace(
        numbers, elements=count, layers=rows * fine, dt=(numbers.dt or 0.0) * own / count, window=1
    )
    seen = replace(scene, output=replace(scene.output, every=fine), probes=())
    other = solve(seen, replace(plan, method="galerkin", numbers=finer))
    kept = np.flatnonzero((motion.kept % step == 0) & (motion.kept // step <= rows))
    levels = motion.kept[kept] // step
    u = other.displacement[levels][:, ::fine]
    wrong = motion.displacement[kept][:, ::step] - u
    gaps = motion.gap[: rows * step + 1 : step] - other.gap[::fine]
    weights = trapezoidal(motion.times[motion.kept[kept]]), trapezoidal(motion.positions[::step])
    pressed = [
        values[: rows * each].reshape(rows, each).mean(axis=1)
        for values, each in ((motion.multiplier, step), (other.multiplier, fine))
    ]
    return (
        relative(max(float(np.abs(a).max()) for a in (wrong, gaps)), float(np.abs(u).max())),
        relative(norm(wrong, *weights), norm(u, *weights)),
        relative(float(np.abs(pressed[0] - pressed[1]).sum()), float(np.abs(pressed[1]).sum())),
    )
