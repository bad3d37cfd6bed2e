"""What is told of contact forces: the largest as means, and whether contact was resolved."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.findings import Finding, percent
from impactfem.methods import Method
from impactfem.planning.resolution import SINGLE_LIMIT, STEPS, single_node, unresolved
from impactfem.result import BarMotion
from impactfem.result.table import Table
from impactfem.scene import Solid

NO_FORCE = 1e-6
"""Share of the largest force that counts as none.

Displacements right to 1e-9 at an impact on a layer can make a pair active one layer early, with
about this force.
"""

# Behind the front of a struck face lies an overshoot of 27 to 35 %, some nodes wide whatever their
# distance h: of the mean over h/c 21 to 31 % is left, over 4 h/c 4 to 26 %, over 10 h/c 2 to 7 %
# (blocks in 2D and 3D, degrees 1 and 2, all schemes).
_NODES = 10.0
_SEVERAL = 2
_PART = 0.25  # longest window as a share of the longest contact: 3 % off the peak of half a sine
_STEPS = 4  # shortest window

PEAK_LIMITS = (0.1, 0.5)
"""By how much the largest force of a step exceeds its mean, from where it is noted and doubted."""

_ALONE = 0.9  # share of the force from which a node carries it alone
_SMALL = 0.1  # impacts with a smaller share of the largest impulse are not counted


def mesh_window(solids: Sequence[Solid], degrees: Sequence[int], size: float) -> float:
    """Time [s] over which forces on meshes of solids are means: some nodes' distances of waves.

    0 without any solid: forces between nodes with mass are those of lasting contact.

    Args:
        solids: The bodies.
        degrees: Of the elements of each.
        size: Size of elements [m] of those that do not say it.
    """
    waves = (
        _NODES
        * min([solid.mesh_size or size, *(ball.size for ball in solid.refine)])
        / (degree * solid.p_wave_speed)
        for solid, degree in zip(solids, degrees, strict=True)
    )
    return max(waves, default=0.0)


def strongest_spells(
    history: Table, together: Sequence[Sequence[float]]
) -> Sequence[Sequence[float]]:
    """Contact intervals of the pair with the largest force: others may rest all the time [s].

    Args:
        history: With columns ``force.PAIR``.
        together: Intervals of all pairs, for histories of a single one.
    """
    forces = {n: column.values for n, column in history.items() if n.startswith("force.")}
    if len(forces) < _SEVERAL:
        return together
    peaks = {name: float(force.max(initial=0.0)) for name, force in forces.items()}
    name = max(peaks, key=lambda name: peaks[name])
    if not (np.isfinite(peaks[name]) and peaks[name] > 0.0):
        return together
    time, force = history["time"].values, forces[name]
    return [(float(time[first]), float(time[last])) for first, last in spells_of(force)]


def spells_of(force: Floats) -> NDArray[np.int64]:
    """Rows from before the first to the last of each spell with a force, shape (spells, 2).

    Args:
        force: In each step [N], shape (rows,); row 0 is ignored.
    """
    on = np.concatenate([[False], force[1:] > NO_FORCE * force.max(), [False]])
    return np.flatnonzero(on[1:] != on[:-1]).reshape(-1, 2)


def largest_force(
    times: Floats,
    force: Floats,
    intervals: Sequence[Sequence[float]],
    window: float,
    least: float = 0.0,
) -> dict[str, float]:
    """The largest force of a run, as its mean over a window, and of a single row.

    Args:
        times: t_m [s], shape (rows,).
        force: During (t_{m-1}, t_m] [N], shape (rows,); row 0 is ignored.
        intervals: Of contact [s].
        window: At most so long [s]; not longer than a part of the longest contact, but at least
            some steps. 0 where rows are right by themselves.
        least: At least so long [s], however short contacts are.

    Returns:
        ``max_force`` [N], ``max_force_raw`` [N] and ``force_window`` [s].
    """
    raw = float(force.max())
    if max(window, least) > 0.0 and len(times) > 1 and np.isfinite(force).all():
        longest = max((end - begin for begin, end in intervals), default=0.0)
        steps = _STEPS * float(np.diff(times).max())
        window = min(max(steps, least, min(window, _PART * longest)), float(times[-1] - times[0]))
        impulse = np.append(0.0, np.cumsum(force[1:] * np.diff(times)))
        # The mean is linear between positions of the window at which an end meets a level.
        begin = np.clip(np.append(times, times - window), times[0], times[-1] - window)
        gained = np.interp(begin + window, times, impulse) - np.interp(begin, times, impulse)
        return {
            "max_force": float(gained.max()) / window,
            "max_force_raw": raw,
            "force_window": window,
        }
    return {"max_force": raw, "max_force_raw": raw, "force_window": 0.0}


def peak_findings(contact: Mapping[str, Any], least: float = 0.0) -> tuple[Finding, ...]:
    """What the largest force of a single row says of the mesh.

    Args:
        contact: With ``max_force``, ``max_force_raw`` and ``force_window``.
        least: See `largest_force`: means over so much are right, whatever rows are.
    """
    mean, raw = contact["max_force"], contact["max_force_raw"]
    if mean is None or raw is None or mean <= 0.0 or raw / mean - 1.0 <= PEAK_LIMITS[0]:
        return ()
    over = raw / mean - 1.0
    rings = over > PEAK_LIMITS[1] and not least
    text = (
        f"the largest force of a step, {raw:.6g} N, exceeds the largest mean over "
        f"{contact['force_window']:.3g} s, {mean:.6g} N, by {percent(over)}: "
        f"{'the force rings with mesh and step' if rings else 'a peak that belongs to the mesh'}"
    )
    limit = PEAK_LIMITS[1] if rings else PEAK_LIMITS[0]
    remedy = "take means or impulses of the force" if rings else ""
    return (
        Finding(
            "force_peak",
            "warning" if rings else "note",
            text,
            value=over,
            limit=limit,
            remedy=remedy,
        ),
    )


def bar_window(method: Method, motion: BarMotion, wave_speed: float) -> float:
    """Time [s] over which forces of a bar are means; 0 where rows are right by themselves.

    Methods that are stable up to courant 1 are exact at the nodes there, and ring below; a
    negative control rings always.
    """
    distance = float(np.diff(motion.positions).max())
    below = wave_speed * float(np.diff(motion.times).max()) < (1.0 - 1e-9) * distance
    rings = not method.plannable or (method.stable == "limited" and below)
    return _NODES * distance / wave_speed if rings else 0.0


def contact_codes(force: Floats) -> tuple[str, ...]:
    """What `contact_findings` has settled; nothing where there was no contact.

    A corner may slip between the nodes of another body: then the plan alone knows of it.
    """
    return ("contact_unresolved", "contact_single_node") if force.max(initial=0.0) > 0.0 else ()


def contact_findings(force: Floats, largest: Floats, dt: float) -> tuple[Finding, ...]:
    """Whether contact on a mesh was resolved in time and space.

    Args:
        force: In each step [N], shape (rows,); row 0 is ignored.
        largest: That of the node with the largest, shape (rows,).
        dt: Step [s].
    """
    found: list[Finding] = []
    if not np.isfinite(force).all() or not force.max(initial=0.0) > 0.0:
        return ()
    steps = shortest_impact(force)
    if steps is not None and steps < STEPS[0]:
        text = f"an impact lasts {steps} steps of {dt:.3g} s: speeds after it and forces are "
        text += "wrong" if steps <= STEPS[1] else "rough"
        found.append(unresolved(float(steps), text))
    alone = force * (largest > _ALONE * force)
    share = float(alone[1:].sum() / force[1:].sum())
    if share > SINGLE_LIMIT:
        found.append(single_node(share, f"a single node carries {percent(share)} of the impulse"))
    return tuple(found)


def shortest_impact(force: Floats) -> int | None:
    """Steps of the shortest impact that counts; None if there is none that began and ended.

    Args:
        force: In each step [N], shape (rows,); row 0 is ignored.
    """
    spells = spells_of(force)
    impulses = [float(force[1:][a:b].sum()) for a, b in spells]
    lasting = [
        int(b - a)
        for (a, b), impulse in zip(spells, impulses, strict=True)
        if b < len(force) - 1 and impulse > _SMALL * max(impulses)
    ]
    return min(lasting, default=None)
