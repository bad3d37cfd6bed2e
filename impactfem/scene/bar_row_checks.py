"""Checks of a row of bars, or one without a wall: order, overlap, ends, what they do not know."""

from itertools import pairwise
from typing import Any

from impactfem.scene.bodies import Bar
from impactfem.scene.content import Content
from impactfem.scene.obstacles import OBSTACLES
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

METHODS_OF_ROWS = ("galerkin", "conserving", "exact")

_FAR_WALL = 'add [[obstacle]] with kind = "wall" out of its reach'
_ROUNDING = 1e-12  # share of a place by which ends that meet may overlap
_UNKNOWN = (
    "window", "active_set", "gamma", "tolerance", "max_iterations", "mesh", "accuracy", "degree",
    "fitted",
)  # fmt: skip


def check_bar_row(scene: Content) -> None:
    """Refuse a row of bars that overlap, are out of order, or ask for what rows do not know.

    Args:
        scene: Scene with two or more bodies, all of them bars, or with one and no wall.

    Raises:
        KeyedError: naming the key.
    """
    _check_obstacles(scene)
    if scene.contacts:
        text = f" = {show(scene.contacts[0])} is not for bars in a row: they meet their neighbours "
        text += (
            "and rebound by their own elasticity, without friction; remove it, or give a stiffness."
        )
        raise KeyedError("contact[0]", "", text)
    bars = scene.bars
    here = f"here is none: {{}}, or {_FAR_WALL}" if len(bars) == 1 else "here are other bodies: {}"
    for index, bar in enumerate(bars):
        try:
            bar.check_plain(here)
        except KeyedError as error:
            raise error.moved(f"body[{index}]") from None
    for index, (before, bar) in enumerate(pairwise(bars), start=1):
        _check_order(before, bar, index)
    solve, words = scene.solve, words_of(len(bars))
    if solve.method is not None and solve.method not in METHODS_OF_ROWS:
        *others, last = map(show, METHODS_OF_ROWS)
        fitting = f"{', '.join(others)} or {last}"
        text = f" = {show(solve.method)} does not solve {words}: give {fitting}."
        raise KeyedError("solve", "method", text)
    for name in _UNKNOWN:
        value = getattr(solve, name)
        if value is not None:
            text = f" = {show(value)} belongs to a single bar before a wall, this is {words}: "
            raise KeyedError("solve", name, f"{text}remove it.")
    if scene.output.checkpoint:
        text = f" = {scene.output.checkpoint}: bars are not checkpointed; remove it."
        raise KeyedError("output", "checkpoint", text)


def words_of(bars: int) -> str:
    """What so many bars are."""
    return "a bar without a wall" if bars == 1 else f"a row of {bars} bars"


def check_walls(scene: Content) -> None:
    """Refuse obstacles that bars do not meet.

    Raises:
        KeyedError: naming the key.
    """
    walls = " or ".join(show(kind) for kind, cls in OBSTACLES.items() if cls.before_bars)
    for index, obstacle in enumerate(scene.obstacles):
        if not obstacle.before_bars:
            text = f" = {show(obstacle.kind)} is for solids: bars meet kind = {walls}; give it."
            raise KeyedError(f"obstacle[{index}]", "kind", text)


def _check_obstacles(scene: Content) -> None:
    check_walls(scene)
    if len(scene.obstacles) > 1:
        why = f"there are {len(scene.obstacles)}, but only the first bar of a row meets a wall"
        shown = show(list(scene.obstacles))
        raise KeyedError("obstacle", "", f" = {shown} is not allowed: {why}; give one or none.")


def check_apart(scene: Content) -> None:
    """Refuse bars that overlap on the axis, in any order, where all may meet.

    Raises:
        KeyedError: naming the key.
    """
    known: list[tuple[Any, int]] = [(bar, k) for k, bar in enumerate(scene.bodies) if bar.waves]
    known.sort(key=lambda each: each[0].gap + float(each[0].displacement(x=0.0)))
    for (before, _), (bar, index) in pairwise(known if not scene.contacts else ()):
        _check_overlap(before, bar, index)


def _check_order(before: Bar, bar: Bar, index: int) -> None:
    """Refuse a bar that begins before the end of its predecessor, or behind one that is held."""
    if before.far_end == "clamped":
        text = ' = "clamped" holds a bar in the middle of the row: only the last one may be '
        raise KeyedError(f"body[{index - 1}]", "far_end", f"{text}clamped, remove it.")
    _check_overlap(before, bar, index)


def _check_overlap(before: Bar, bar: Bar, index: int) -> None:
    """Refuse a bar that begins before the end of its predecessor."""
    end = before.gap + before.length + float(before.displacement(x=before.length))
    start = bar.gap + float(bar.displacement(x=0.0))
    if start < end - _ROUNDING * max(abs(start), abs(end)):
        text = (
            f" = {bar.gap:g} lets bar {show(bar.name)} begin at {start:.6g} m, inside the one "
            f"before it: {show(before.name)} ends at {end:.6g} m, they overlap by "
            f"{end - start:.6g} m; list the bars in the order of the axis and give a gap of at "
            f"least {bar.gap + end - start:.6g}."
        )
        raise KeyedError(f"body[{index}]", "gap", text)
