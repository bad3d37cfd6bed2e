"""The plan of bars in a row: elements that match, one time step for all, the method and why."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, override

import numpy as np

from impactfem.errors import SceneError
from impactfem.exact import ExactBarRow
from impactfem.findings import Finding, warning
from impactfem.methods import DISPERSIVE, METHODS, is_exact
from impactfem.planning.bar_errors import EXACT, ROUNDING, rounding_findings
from impactfem.planning.plans import Numbers, Plan, cost_rows
from impactfem.reference.bar_row import exact_row_if_known
from impactfem.reference.rounding import sampling_of_row
from impactfem.scene import Bar, Scene
from impactfem.sizing import DEFAULT_ELEMENTS, Grid, marching_cost

_LEAST = 2  # elements of a bar: its end nodes then meet one neighbour each
_TRIED = range(40, 161)  # sizes tried to put all events on time levels
_MOST = 2000  # elements of the longest bar up to which a match is looked for
_WHOLE = 1e-9  # share of a number of elements by which it may miss an integer
_ON_LAYER = 1e-6  # share of a layer within which an event counts as on it
_STABLE = 1.0 + 1e-9
_GROWTH = 5.0  # of an error from contact to contact, the most seen of one bar
_EXACT = 1e-12  # of the characteristics, tested against closed forms


@dataclass(frozen=True, kw_only=True)
class RowNumbers(Numbers):
    """Numbers of the run of bars in a row.

    Attributes:
        elements: Elements along each bar.
        layers: Time steps.
        dt: Time step [s], the same for all bars.
        courant: c dt / h of each bar.
        matched: Whether c dt / h is the same in all bars, so that with courant 1 waves run from
            node to node through all of them.
        on_layers: Whether all contacts begin and end on time levels.
        exact_known: Whether the exact solution can be followed to the end.
        contact_pairs: Complementarity pairs, time steps times pairs of neighbours.
        unknowns: Nodes times time steps; 0 of the exact solution.
    """

    elements: tuple[int, ...]
    layers: int
    dt: float
    courant: tuple[float, ...]
    matched: bool
    on_layers: bool
    exact_known: bool
    contact_pairs: int
    unknowns: int

    @property
    def longest(self) -> int:
        """Elements along the bar with the longest transit time, as solve.elements counts."""
        return max(self.elements)

    @override
    def rows(self, plan: Plan[Any]) -> list[tuple[str, str]]:
        low, high = min(self.courant), max(self.courant)
        courant = f"{high:g}" if self.matched else f"{low:g} to {high:g}"
        return [
            ("elements", " + ".join(str(count) for count in self.elements)),
            ("time steps", str(self.layers)),
            ("dt", f"{self.dt:g} s (courant {courant})"),
            ("unknowns", f"{self.unknowns} ({self.contact_pairs} contact pairs)"),
            *cost_rows(plan),
        ]


def plan_bar_row(scene: Scene) -> Plan[RowNumbers]:
    """Choose method, elements and step for bars in a row; nothing is solved but the exact motion.

    Raises:
        SceneError: The settings cannot work, or need more memory than the machine has.
    """
    bars, exact = scene.bars, exact_row_if_known(scene)
    pairs = len(bars) - (not scene.obstacles)
    reasons = {
        "model": "homogeneous bars on one axis: nothing in the scene bends them or varies across "
        f"them; {pairs} place{'s' if pairs != 1 else ''} of contact, frictionless"
    }
    elements = _choose_elements(scene, exact, reasons)
    transits = np.array([bar.transit_time for bar in bars])
    dt = _choose_step(scene, transits / elements, reasons)
    courant = tuple((dt * np.array(elements) / transits).tolist())
    matched = bool(np.ptp(courant) <= _WHOLE * max(courant))
    layers = max(1, math.ceil(scene.duration / dt - 1e-9))
    if layers * dt > scene.duration * (1 + 1e-9):
        reasons["layers"] = f"the last time step ends at {layers * dt:g} s, past the duration"
    aligned = _on_layers(exact, dt)
    fitting = matched and aligned and max(courant) >= 1.0 - _WHOLE
    fitting = fitting and _jumps_on_nodes(exact, elements)
    rounding = _rounding(exact) if fitting else None
    sampled = exact is not None and exact.sampled
    followed = sampling_of_row(scene, exact).displacement_max if exact and sampled else _EXACT
    kept = _predicted("conserving", exact, elements, courant, None)
    method = _choose_method(
        scene, exact, reasons, rounding, followed if kept is None or followed <= kept else None
    )
    grid = Grid(sum(elements) + len(elements) - 1, layers, dt)
    memory, seconds = marching_cost(grid, scene.output.stride, 1)
    nodes = sum(elements) + len(elements)
    return Plan(
        method=method,
        model=_model(bars, wall=bool(scene.obstacles)),
        numbers=RowNumbers(
            elements=tuple(elements),
            layers=layers,
            dt=dt,
            courant=courant,
            matched=matched,
            on_layers=aligned,
            exact_known=exact is not None,
            contact_pairs=layers * pairs,
            unknowns=0 if METHODS[method].exact else nodes * layers,
        ),
        memory_mib=memory,
        seconds=seconds,
        predicted_error=(
            followed
            if METHODS[method].exact
            else _predicted(method, exact, elements, courant, rounding)
        ),
        reasons=reasons,
        findings=_findings(method, exact, courant, rounding),
    )


def _model(bars: Sequence[Bar], *, wall: bool) -> str:
    start = "behind a rigid wall" if wall else "without a wall"
    if len(bars) == 1:
        return f"an elastic bar, {start}, far end {bars[0].far_end}"
    return f"{len(bars)} elastic bars in a row, {start}, last far end {bars[-1].far_end}"


def _choose_elements(scene: Scene, exact: ExactBarRow | None, reasons: dict[str, str]) -> list[int]:
    """Elements of each bar so that h / c is the same in all, and events fall on time levels."""
    transits = [bar.transit_time for bar in scene.bars]
    asked = scene.solve.elements
    if asked is not None:
        found = _matching(transits, asked)
        if found is None:
            _refuse_unmatched(scene, transits, asked)
        reasons["elements"] = "as asked, along the bar with the longest transit time"
        return found or _unmatched(transits, asked)
    matches = {n: found for n in _TRIED if (found := _matching(transits, n))}
    for n, found in matches.items():
        if _on_layers(exact, max(transits) / n):
            reasons["elements"] = (
                f"the least number from {_TRIED[0]} on along the bar with the longest transit time "
                "that gives all bars the same h / c and puts all events on time levels"
            )
            return found
    for n in range(DEFAULT_ELEMENTS, _MOST + 1):
        if found := _matching(transits, n):
            reasons["elements"] = (
                "the least number from the default on that gives all bars the same h / c; none up "
                f"to {_TRIED[-1]} puts all events on time levels"
            )
            return found
    reasons["elements"] = (
        f"the default; no number up to {_MOST} gives all bars the same h / c: their transit times "
        "have no common measure"
    )
    return _unmatched(transits, DEFAULT_ELEMENTS)


def _matching(transits: Sequence[float], longest: int) -> list[int] | None:
    """Elements of each bar with the same h / c; None if they are not whole or too few."""
    exact = longest * np.array(transits) / max(transits)
    whole = np.rint(exact)
    if (np.abs(exact - whole) > _WHOLE * longest).any() or whole.min() < _LEAST:
        return None
    return [int(n) for n in whole]


def _unmatched(transits: Sequence[float], longest: int) -> list[int]:
    """Elements whose h / c is at least that of the bar with the longest transit time."""
    share = np.array(transits) / max(transits)
    return [max(_LEAST, math.floor(n)) for n in longest * share * _STABLE]


def _refuse_unmatched(scene: Scene, transits: Sequence[float], asked: int) -> None:
    """Refuse a number of elements that does not match where others do."""
    others = [n for n in range(_LEAST, _MOST + 1) if _matching(transits, n)]
    if not others or is_exact(scene.solve.method):
        return
    near = sorted(sorted(others, key=lambda n: abs(n - asked))[:2])
    raise SceneError(
        f"solve.elements = {asked} along the bar with the longest transit time gives the others no "
        f"whole number of elements with the same h / c; give {' or '.join(map(str, near))}, or "
        'method = "exact"'
    )


def _choose_step(scene: Scene, limits: "np.ndarray[Any, Any]", reasons: dict[str, str]) -> float:
    """Time step [s], at most h / c of each bar."""
    solve, limit = scene.solve, float(min(limits))
    dt = limit * (solve.courant or 1.0) if solve.dt is None else solve.dt
    if dt > limit * _STABLE and not is_exact(solve.method):
        given = "dt" if solve.dt is not None else "courant"
        name = scene.bars[int(np.argmin(limits))].name
        raise SceneError(
            f"solve.{given} = {getattr(solve, given):g}: the step {dt:g} s is beyond the stability "
            f"limit h / c = {limit:g} s of {name}; give a smaller one, fewer elements, or "
            'method = "exact"'
        )
    if solve.dt is not None or solve.courant is not None:
        reasons["dt"] = "as asked"
    else:
        reasons["dt"] = "the least h / c: waves run from node to node"
    return dt


def _on_layers(exact: ExactBarRow | None, dt: float) -> bool:
    if exact is None:
        return False
    layer = exact.events / dt
    return bool(np.all(np.abs(layer - np.rint(layer)) < _ON_LAYER))


def _jumps_on_nodes(exact: ExactBarRow | None, elements: Sequence[int]) -> bool:
    """Whether speeds are constant in elements: galerkin weights others with hat functions."""
    if exact is None or exact.sampled:
        return False
    for bar, n in zip(exact.bars, elements, strict=True):
        jumps = np.asarray(bar.nodes)[1:-1][np.diff(np.asarray(bar.velocity)) != 0.0]
        at = jumps / bar.length * n
        if (np.abs(at - np.rint(at)) > _WHOLE * n).any():
            return False
    return True


def _rounding(exact: ExactBarRow | None) -> float:
    """Relative error of galerkin where only rounding makes one: as for one bar, at worst."""
    contacts = 0 if exact is None else sum(map(len, exact.contacts))
    return float(min(1.0, ROUNDING * _GROWTH ** max(0, min(contacts, 30) - 1)))


def _predicted(
    method: str, exact: ExactBarRow | None, elements: Sequence[int], courant: Sequence[float],
    rounding: float | None,
) -> float | None:  # fmt: skip
    """Largest relative error of displacements of a method that marches; None: no prediction."""
    if exact is None:
        return None
    limited = METHODS[method].stable == "limited"
    if rounding is not None:
        return rounding if limited else _EXACT
    ringing = limited and min(courant) < 1.0 - _WHOLE
    constant, rate = DISPERSIVE if ringing else METHODS[method].error
    contacts = max(1, sum(map(len, exact.contacts)))
    return float(min(1.0, constant * contacts / min(elements) ** rate))


def _choose_method(
    scene: Scene, exact: ExactBarRow | None, reasons: dict[str, str], rounding: float | None,
    followed: float | None,
) -> str:  # fmt: skip
    """As asked, else the first whose condition holds; ``followed``: error of exact, if worth it."""
    pieces = "velocity and strain are constant in pieces: the characteristics give the motion to"
    if exact is not None and exact.sampled:
        pieces = "velocity or strain vary along a bar and are sampled: by other pieces that leaves"
    off = "events fall between time levels or the bars have different h / c"
    if rounding is not None:
        off = f"from contact to contact the rounding of galerkin might grow to {rounding:.0e}"
    lines = "one line a time step and end for each wave keeps energy and momentum to rounding"
    choices = (
        (scene.solve.method is not None, scene.solve.method or "", "as asked"),
        (
            rounding is not None and rounding <= EXACT,
            "galerkin",
            "exact at the nodes: the same h / c in all bars, all events on time levels",
        ),
        (
            exact is not None and followed is not None,
            "exact",
            f"{off}; {pieces} {followed or 0.0:.0e}",
        ),
        (
            exact is not None,
            "conserving",
            (
                f"{off}; velocity or strain vary along a bar, too much for the pieces of the "
                f"characteristics; {lines}"
            ),
        ),
        (
            True,
            "conserving",
            f"waves split too often for the characteristics to follow them; {lines}",
        ),
    )
    name, reasons["method"] = next((name, why) for holds, name, why in choices if holds)
    return name


def _findings(
    method: str, exact: ExactBarRow | None, courant: Sequence[float], rounding: float | None
) -> tuple[Finding, ...]:
    """What the plan foresees; ``rounding`` is that of galerkin where there is no other error."""
    if exact is None:
        text = "too many waves for the exact solution: the error is not measured"
        return (warning("no_estimate", text),)
    if METHODS[method].exact:
        return ()
    limited = METHODS[method].stable == "limited"
    if limited and min(courant) < 1.0 - _WHOLE:
        text = f"c dt / h is {min(courant):g} in a bar: the forces ring"
        return (warning("ringing", text, remedy='method = "conserving" or "exact" does not'),)
    if rounding is None:
        text = "an impact or release lies between time levels: errors of first order in h"
        return (Finding("error_large", "note", text),)
    return rounding_findings(rounding, "may grow") if limited else ()
