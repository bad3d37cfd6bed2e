"""The plan of a bar that is not uniform, has a load or a wall that gives way, and of any one."""

import math
from typing import Any

from impactfem.findings import Finding, warning
from impactfem.methods import METHODS
from impactfem.planning.bar_costs import cost_of_bar
from impactfem.planning.bars import BarNumbers, plan_bar, ringing
from impactfem.planning.doubts import units_of
from impactfem.planning.plans import Plan
from impactfem.scene import Bar, Scene
from impactfem.scene.values import LEAST
from impactfem.sizing import ALIGNED, DEFAULT_ELEMENTS, ON_LAYER, Grid, layers_of, off_nodes

_ITERATES = 20  # linear solves to expect of a loop over all layers
_PER_RISE = 5.0  # elements in E A / k: forces at the wall to a few per mille of the largest
_MOST = 1000
_WITH_OTHERS = 5.0  # times as long as the run, with those on more elements that tell its error


def plan_one_bar(scene: Scene) -> Plan[BarNumbers]:
    """Choose method and numbers for the bar of a scene.

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
    """
    return plan_bar(scene) if scene.bar.has_two_waves else _plan_layers(scene)


def _plan_layers(scene: Scene) -> Plan[BarNumbers]:
    bar, solve = scene.bar, scene.solve
    what = "with a load along it" if bar.is_loaded else "whose wall gives way"
    what = what if bar.is_uniform else "whose section or material varies"
    reasons = {
        "model": f"one bar {what}, which moves along its axis; one contact point, frictionless",
        "method": "as asked",
    }
    if solve.method is None:
        reasons["method"] = (
            "elements of equal travel times and courant 1: waves run from node to node and are "
            "reflected there, exact where properties are constant in elements and events on "
            "time levels"
        )
    name = solve.method or ("monolithic" if solve.active_set == "snes_vi" else "galerkin")
    method = METHODS[name]
    grid = layers_of(scene, method, _elements(bar, solve.elements, reasons), reasons)
    window = "all" if method.assembled else solve.window or 1
    iterations = 1 if window == 1 else _ITERATES
    cost = cost_of_bar(scene, method, grid, 1, iterations)
    wall = "rigid" if bar.wall_stiffness is None else "springy"
    end = "driven" if bar.is_driven else bar.far_end
    return Plan(
        method=name,
        model=f"elastic bar in 1D, far end {end}, {wall} wall at its near end",
        numbers=BarNumbers(
            elements=grid.elements,
            layers=grid.layers,
            dt=grid.dt,
            courant=grid.courant,
            window=window,
            degree=None,
            fitted=None,
            active_set=solve.active_set or "pdas",
            gamma=solve.gamma or 1.0,
            tolerance=solve.tolerance or method.tolerance,
            max_iterations=solve.max_iterations or 3 * iterations * (grid.elements or 0) + 50,
            contact_pairs=cost.contact_pairs,
            unknowns=cost.unknowns,
        ),
        memory_mib=cost.memory_mib,
        seconds=_WITH_OTHERS * (cost.seconds or 0.0),
        reasons=reasons,
        findings=(*ringing(grid, "use courant = 1"), *_stiff(bar, grid), *units_of(bar)),
    )


def _rises(bar: Bar) -> float:
    """Times k L / (E A) that a transit has of the one in which the force at a wall rises."""
    return bar.wall_spring * bar.length / bar.wave_speed**2


def _stiff(bar: Bar, grid: Grid) -> tuple[Finding, ...]:
    """That the force at a wall rises within an element."""
    per = (grid.elements or 1) / max(_rises(bar), LEAST)
    if per >= 1.0:
        return ()
    text = f"the force at the wall rises to 63 % in {per:.2g} of an element: it rings"
    remedy = f"use {math.ceil(_PER_RISE * _rises(bar))} elements, or leave the stiffness out"
    return (warning("contact_unresolved", text, remedy=remedy),)


def _elements(bar: Bar, asked: int | None, reasons: dict[str, Any]) -> int:
    """As asked, else the least number that has a node wherever impedances jump."""
    if asked is not None:
        reasons["elements"] = "as asked"
        return asked
    jumps = bar.jumps
    if not jumps.size:
        wanted = min(math.ceil(_PER_RISE * _rises(bar)), _MOST)
        more = "so many that the rise of the force is seen"
        reasons["elements"] = more if wanted > DEFAULT_ELEMENTS else "the default"
        return max(DEFAULT_ELEMENTS, wanted)
    for count in ALIGNED:
        if off_nodes(jumps, count) <= ON_LAYER:
            reasons["elements"] = "the least number from 40 on with a node at each jump"
            return count
    reasons["elements"] = f"the default; none up to {ALIGNED[-1]} has a node at each jump"
    return DEFAULT_ELEMENTS
