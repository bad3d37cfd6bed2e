"""Panels and maps in units with prefixes: plotly shows numbers as they are given."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from impactfem.report.panel import Curve, Map, Panel
from impactfem.report.prefixes import Prefixed, prefixed_unit, unit_of

_TOLD = re.compile(r"%\{(x|y|customdata):([^}]*)\} ([^<]+)")


def prefixed_panel(panel: Panel) -> Panel:
    """A panel with numbers, titles and what pointing at it tells in units with prefixes."""
    ends = panel.span or ()
    places = [curve.x for curve in panel.curves] + [np.asarray(ends)]
    heights = [curve.y for curve in panel.curves]
    if panel.equal:  # one scale, one unit
        places = heights = places + heights
    across = prefixed_unit(unit_of(panel.x), *places)
    up = prefixed_unit("" if panel.log else unit_of(panel.y), *heights)
    factor = across.factor
    return replace(
        panel,
        curves=_curves(panel.curves, across, up, (unit_of(panel.x), unit_of(panel.y))),
        x=across.title(panel.x),
        y=panel.y if panel.log else up.title(panel.y),
        span=(factor * panel.span[0], factor * panel.span[1]) if panel.span else None,
        shaded=[[factor * first, factor * last] for first, last in panel.shaded],
    )


def prefixed_map(shown: Map) -> Map:
    """A map with numbers, titles and what pointing at it tells in units with prefixes."""
    across = prefixed_unit(unit_of(shown.x), shown.times)
    up = prefixed_unit(unit_of(shown.y), shown.places)
    value = prefixed_unit(unit_of(shown.label), shown.values)
    return replace(
        shown,
        times=across.factor * shown.times,
        places=up.factor * shown.places,
        values=value.factor * shown.values,
        x=across.title(shown.x),
        y=up.title(shown.y),
        label=value.title(shown.label),
        touching=_curves(shown.touching, across, up, (unit_of(shown.x), unit_of(shown.y))),
    )


def _curves(
    curves: Sequence[Curve], across: Prefixed, up: Prefixed, units: tuple[str, str]
) -> list[Curve]:
    told = [curve.told or f"t = %{{x:.6g}} s<br>%{{y:.6g}} {curve.unit}" for curve in curves]
    beside = _unit_beside(curves, told)
    new = {("x", units[0]): across.unit, ("y", units[1]): up.unit or units[1]}
    if beside is not None:
        new["customdata", beside[0]] = beside[1].unit

    def renamed(found: re.Match[str]) -> str:
        name, form, unit = found.groups()
        return f"%{{{name}:{form}}} {new.get((name, unit), unit)}"

    return [
        replace(
            curve,
            x=across.factor * curve.x,
            y=up.factor * curve.y,
            beside=curve.beside if beside is None or curve.beside is None
            else beside[1].factor * curve.beside,
            told=_TOLD.sub(renamed, text),
        )
        for curve, text in zip(curves, told, strict=True)
    ]  # fmt: skip


def _unit_beside(curves: Sequence[Curve], told: Iterable[str]) -> tuple[str, Prefixed] | None:
    """The unit of what is told besides and the one it gets; None if nothing is."""
    for text in told:
        for name, _, unit in _TOLD.findall(text):
            if name == "customdata":
                values = [curve.beside for curve in curves if curve.beside is not None]
                return unit, prefixed_unit(unit, *values)
    return None
