"""Panels of bodies along a line: world lines, and maps over time and place."""

from itertools import pairwise

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.report.page.numbers import quantity, round_below
from impactfem.report.panel import CONTACT, Curve, Map, Panel, colour, evenly, over_time
from impactfem.result import Fields, Record

_MAP = 200  # samples of a map along each axis
_LINE, _LINES = 500, 11  # samples of a world line; lines of one bar, and at most of each of several
_SHARE = 0.6  # of the length of all bars that their motion may take in a picture
_MOST_CONTACTS = 20  # of a pair that are marked
_APART = 1e-9  # of the length, between ends that touch: places of maps increase


def stacked_places(fields: Fields) -> Floats:
    """Places of the nodes if all bars touched each other and the wall [m], shape (nodes,)."""
    counts = np.array(fields.counts or (len(fields.positions),))
    lengths = fields.positions[np.cumsum(counts) - 1]
    places: Floats = fields.positions + np.repeat(np.cumsum(lengths) - lengths, counts)
    return places


def magnified(
    fields: Fields, levels: Integers | None = None, share: float = _SHARE
) -> tuple[Floats, float]:
    """Places of all nodes with magnified motion and gaps, and the factor, at least 1.

    Stiff bars move by far less than their length; bars that touch do so in the picture too.

    Args:
        fields: The motion.
        levels: Which of the kept levels; all if None.
        share: Of all lengths that motion and gaps may take.

    Returns:
        Shape (levels, nodes).
    """
    stacked = stacked_places(fields)
    displacement = fields.displacement if levels is None else fields.displacement[levels]
    motion = fields.positions + displacement - stacked
    span, room = float(np.nanmax(motion) - np.nanmin(motion)), share * float(stacked[-1])
    factor = round_below(room / span) if 0.0 < span < room else 1.0
    return stacked + factor * motion, factor


def _bodies(fields: Fields) -> Integers:
    """First node of each bar, and the number of all nodes."""
    return np.cumsum([0, *(fields.counts or (len(fields.positions),))])


def world_lines(result: Record) -> Panel | None:
    """World lines of all bars; motion and gaps magnified alike where they are small."""
    fields = result.fields
    if not isinstance(fields, Fields):
        return None
    t = evenly(len(fields.times), _LINE)
    place, factor = magnified(fields, t)
    times, starts = fields.times[t], _bodies(fields)
    count = len(starts) - 1
    each = _LINES if count <= 3 else 4 if count <= 12 else 2
    curves: list[Curve] = []
    told = "t = %{x:.6g} s<br>at %{customdata:.6g} m"
    for k, name in enumerate(fields.layout.names):
        first, last = int(starts[k]), int(starts[k + 1]) - 1
        for node in first + evenly(last + 1 - first, each):
            true = fields.displacement[t, node] + fields.positions[node]
            label = name if count > 1 else f"x = {quantity(fields.positions[node], 'm', 4)}"
            curves.append(
                Curve(
                    label, times, place[:, node], "m", colour(k), beside=true, told=told,
                    width=2.0 if node in (first, last) else 0.8,
                    named=bool(node == first) and count > 1,
                )
            )  # fmt: skip
    curves += _touching(result, fields, times, place)
    what = "all bars" if count > 1 else "the bar"
    caption = f"World lines of cross-sections of {what}, in red where it touches"
    if count > 1:
        caption = f"World lines of cross-sections of {what}, in red where neighbours touch"
    if factor > 1.0:
        caption += f"; motion and gaps are magnified {factor:g} times, hovering tells true places"
    shown = f", motion and gaps × {factor:g}" if factor > 1.0 else ""
    return over_time(
        result, "world_lines", "World lines", f"{caption}.", curves,
        f"place on the axis [m]{shown}", wall=bool(result.scene.obstacles), high=True,
        named=count > 1,
    )  # fmt: skip


def _touching(result: Record, fields: Fields, times: Floats, place: Floats) -> list[Curve]:
    """Thick lines while a bar touches what is before it."""
    contact, starts = result.summary["contact"], _bodies(fields)
    offset = 0 if result.scene.obstacles else 1
    pairs = contact.get("pairs", [{"intervals": contact["intervals"]}])
    curves: list[Curve] = []
    for pair, found in enumerate(pairs):
        end = place[:, starts[pair + offset]]
        for first, last in found["intervals"][:_MOST_CONTACTS]:
            at = np.linspace(first, last, 20)
            curves.append(
                Curve("contact", at, np.interp(at, times, end), "m", CONTACT, width=4.0,
                      named=not curves)
            )  # fmt: skip
    return curves


def displacement(result: Record) -> Map | None:
    """Displacement of all cross-sections over time."""
    text = (
        "Displacement u of each cross-section x; waves run along oblique lines, red lines mark "
        "contact."
    )
    found = _of_nodes(result, "displacement")
    return found and _map(result, "displacement", "Displacement in space and time", text,
                          *found, "displacement u [m]")  # fmt: skip


def velocity_map(result: Record) -> Map | None:
    """Velocity of all cross-sections over time."""
    text = "Velocity of each cross-section x: fronts of waves are where it jumps."
    found = _of_nodes(result, "velocity")
    return found and _map(result, "velocity_map", "Velocity in space and time", text,
                          *found, "velocity [m/s]", signed=True)  # fmt: skip


def strain(result: Record) -> Map | None:
    """Strain of all cross-sections over time."""
    fields = result.fields
    if not isinstance(fields, Fields):
        return None
    t, starts = evenly(len(fields.times), _MAP), _bodies(fields)
    stacked, values, places = stacked_places(fields), [], []
    for first, last in pairwise(starts):
        nodes = first + evenly(last - first, max(3, _MAP // (len(starts) - 1)))
        change = np.diff(fields.displacement[np.ix_(t, nodes)], axis=1)
        values.append(change / np.diff(fields.positions[nodes]))
        places.append(0.5 * (stacked[nodes][1:] + stacked[nodes][:-1]))
    text = "Strain of each cross-section x: red is tension, blue compression."
    return _map(result, "strain", "Strain in space and time", text, fields.times[t],
                np.concatenate(places), np.concatenate(values, axis=1).T, "strain [m/m]",
                signed=True)  # fmt: skip


def _of_nodes(result: Record, name: str) -> tuple[Floats, Floats, Floats] | None:
    """Times, places at rest and values (places, times) of a field of bars, thinned."""
    fields = result.fields
    if not isinstance(fields, Fields):
        return None
    t, starts = evenly(len(fields.times), _MAP), _bodies(fields)
    each = max(2, _MAP // (len(starts) - 1))
    nodes = np.concatenate([first + evenly(last - first, each) for first, last in pairwise(starts)])
    stacked = stacked_places(fields)
    inner = np.isin(nodes, starts[1:-1])  # where a bar begins: just beyond the end of another
    places = stacked[nodes] + _APART * float(stacked[-1]) * inner
    return fields.times[t], places, getattr(fields, name)[np.ix_(t, nodes)].T


def _map(
    result: Record, name: str, title: str, text: str, times: Floats, places: Floats,
    values: Floats, label: str, *, signed: bool = False,
) -> Map:  # fmt: skip
    fields = result.fields
    several = isinstance(fields, Fields) and fields.counts is not None
    y = "place along the bars at rest x [m]" if several else "position in the bar x [m]"
    touching = []
    if isinstance(fields, Fields):
        at_rest = np.tile(stacked_places(fields), (2, 1))
        ends = np.array([times[0], times[-1]])
        touching = _touching(result, fields, ends, at_rest)
    return Map(name, title, text, times, places, values, label, y, signed, touching)
