"""What a scene really does with the controls of a motion that was found: a run of it as any other.

The run knows nothing of the search, and all that the search leaves out: contacts, limits of joints,
friction. It is repeated with ever shorter steps until these do not matter for the verdict.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import lcm
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import ConvergenceError, SceneError
from impactfem.scene import Scene
from impactfem.trajectory.rotations import quaternion_rates
from impactfem.trajectory.scenes import Planned

TOUCHING = "contact_implicit", "hybrid"  # that know forces of contact
_PIECES = 5000  # of a control at most
_STEPS = 20_000  # of a run at most
_FIRST = 10  # steps in an interval of the first run
_PARABOLA = 20  # straight pieces that stand for one, in an interval
_SHARE = 0.25  # of the allowed end error that steps may cost
_AT_REST = 1e-9  # of a state's size, by which a start may differ from that of the scene


@dataclass(frozen=True)
class Ran:
    """A run of a scene with the controls that were found.

    Attributes:
        result: Of the run; None if there was none.
        why: Why there was none.
        method: Of the run.
        dt: Its step [s]; 0 where it chooses its own.
        distance: Largest of the motion from it at the nodes, in shares of how far states move.
        end_error: From what is asked at the end, in such shares.
        unsure: By how much the run itself changed with its last halving of steps, in such shares.
        touched: Contacts and limits that it met, with the time of the first touch [s].
    """

    result: Any = None
    why: str = ""
    method: str = ""
    dt: float = 0.0
    distance: float = float("nan")
    end_error: float = float("nan")
    unsure: float = float("nan")
    touched: Mapping[str, float] | None = None

    @property
    def summary(self) -> dict[str, Any]:
        """Figures for summary.json; nothing without a run."""
        if self.result is None:
            return {"not_run": self.why}
        return {
            "resimulated_by": self.method, "resimulated_dt": self.dt,
            "resimulated_distance": self.distance, "resimulated_end_error": self.end_error,
            "resimulated_unsure": self.unsure, "touched": dict(self.touched or {}),
        }  # fmt: skip

    def doubts(self, allowed: float) -> tuple[str, ...]:
        """Why the motion is not to be trusted; nothing if it is, or if there was no run."""
        if self.result is None or self.end_error <= allowed + self.unsure:
            return ()
        met = "".join(f"; it meets {n} at t = {t:.4g} s" for n, t in (self.touched or {}).items())
        text = f"a run of the scene with these controls misses the end by {self.end_error:.2g} of "
        text += f"how far the states move, allowed {allowed:.2g}{met}; give more nodes, refine, "
        return (f"{text}or bounds that keep off what it meets",)


def run_again(planned: Planned, run: Callable[[Scene], Any]) -> Ran:
    """Run a scene with the controls that were found.

    Args:
        planned: The motion.
        run: Solves a scene; its answer has ``history`` and ``summary``.
    """
    if why := _why_none(planned):
        return Ran(why=why)
    found = planned.found
    tables, count = _tables(planned)
    try:
        result = run(Scene.from_dict(_by(tables, "event_driven", None), base=planned.scene.folder))
    except (SceneError, ConvergenceError):
        pass
    else:
        return _ran(planned, result, "event_driven", 0.0, 0.0)
    # Steps take impacts to first order only; but nothing else knows friction of joints.
    if found.problem.impacts and _by_events(planned):
        return Ran(why=_follows(planned))
    steps, before, answer = count * max(1, round(_FIRST * found.nodes / count)), None, Ran()
    while steps <= _STEPS or before is None:
        dt = found.duration / steps
        try:
            scene = Scene.from_dict(_by(tables, None, dt), base=planned.scene.folder)
            result = run(scene)
        except (SceneError, ConvergenceError) as error:
            return answer if answer.result is not None else Ran(why=str(error))
        states = _at_nodes(planned, result)
        unsure = float("nan") if before is None else _apart(planned, states, before)
        answer = _ran(planned, result, str(result.summary["method"]), dt, unsure)
        # A halved step of second order has a third of that left.
        if before is not None and unsure <= _SHARE * found.allowed:
            break
        before, steps = states, 2 * steps
    return answer


def _why_none(planned: Planned) -> str:
    """Why there is no run; empty if there may be one."""
    found = planned.found
    if found.status != "converged":
        return "nothing was found"
    if found.transcription in TOUCHING and _by_events(planned) and not planned.unseen:
        return _follows(planned)
    moved = _moved(planned)
    return f"it starts with another {moved} than the scene" if moved else ""


def _by_events(planned: Planned) -> bool:
    """Whether what follows was told from event to event, in coordinates."""
    return planned.found.follower == "event_driven"


def _follows(planned: Planned) -> str:
    return f"{planned.found.follower} follows it from contact to contact in its coordinates"


def _moved(planned: Planned) -> str:
    """A column in which the motion begins elsewhere than the scene; empty if there is none."""
    wanted = planned.scene.trajectory
    start = {} if wanted is None else wanted.start
    table = planned.table(np.zeros(1), planned.found.at_nodes[:1])
    plain = planned.at_start
    for name in start:
        size = max(abs(plain[name]), float(np.ptp(planned.found.at_nodes)), 1e-300)
        if abs(float(table[name][0]) - plain[name]) > _AT_REST * size:
            return name
    return ""


def _tables(planned: Planned) -> tuple[dict[str, Any], int]:
    """The scene with its controls, and in how many equal parts of time nodes lie on steps."""
    found, tables = planned.found, planned.scene.to_dict()
    shares = [Fraction(each).limit_denominator(_PIECES) for each in found.fractions.tolist()]
    parts = lcm(*(share.denominator for share in shares))
    parts = min(parts, _PIECES)
    pieces, constant = parts, found.is_stepwise
    if not constant:
        pieces = parts * max(1, min(_PARABOLA * found.nodes, _PIECES) // parts)
    edges = np.linspace(0.0, found.duration, pieces + 1)
    at = 0.5 * (edges[1:] + edges[:-1]) if constant else edges
    values = found.control(at)
    tables.pop("trajectory", None)
    tables["duration"] = found.duration
    for k, table in enumerate(tables["control"]):
        table.pop("bounds", None)
        table |= {
            "kind": "constant" if constant else "linear", "pieces": pieces,
            "start": values[:, k].tolist(),
        }  # fmt: skip
    return tables, parts


def _by(tables: dict[str, Any], method: str | None, dt: float | None) -> dict[str, Any]:
    """The same scene by a method and step."""
    solve = {k: v for k, v in tables["solve"].items() if k not in {"method", "dt", "courant"}}
    solve |= {"estimate": False} | ({} if method is None else {"method": method})
    solve |= {} if dt is None else {"dt": dt}
    return tables | {"solve": solve}


def _ran(planned: Planned, result: Any, method: str, dt: float, unsure: float) -> Ran:
    found, states = planned.found, _at_nodes(planned, result)
    return Ran(
        result, "", method, dt, _apart(planned, states, found.at_nodes),
        found.off_end(states[-1]), unsure, _touched(planned, result.history),
    )  # fmt: skip


def _at_nodes(planned: Planned, result: Any) -> Floats:
    """States of a run at the nodes (N + 1, n); straight between its rows."""
    found, history = planned.found, result.history
    time = np.asarray(history["time"].values)

    def read(*names: str) -> Floats:
        values = [np.asarray(history[name].values) for name in names]
        return np.array([np.interp(found.times, time, each) for each in values]).T

    states = {name: read(name)[:, 0] for name in found.states if name in history}
    turning = [name.removesuffix(".qw_rate") for name in found.states if name.endswith("qw_rate")]
    for name in turning:
        turns = read(*(f"{name}.q{letter}" for letter in "wxyz"))
        rates = quaternion_rates(turns, read(*(f"{name}.w{axis}" for axis in "xyz")))
        states |= {f"{name}.q{letter}_rate": rates[:, k] for k, letter in enumerate("wxyz")}
    return np.array([states[name] for name in found.states]).T


def _apart(planned: Planned, one: Floats, two: Floats) -> float:
    shares = np.abs(one - two) / planned.found.sizes
    return float(np.nan_to_num(shares, nan=np.inf).max())


def _touched(planned: Planned, history: Any) -> dict[str, float]:
    """Contacts that carried a force, and limits of joints that were reached: since when [s]."""
    time, found = np.asarray(history["time"].values), dict[str, float]()
    for name in history:
        if str(name).startswith("impulse.") and (met := np.asarray(history[name].values) > 0).any():
            found[str(name).removeprefix("impulse.")] = float(time[int(np.argmax(met))])
    for column, (low, high) in planned.limits.items():
        if column not in history:
            continue
        way = np.asarray(history[column].values)
        room = _AT_REST * float(np.ptp(planned.found.at_nodes))
        if (met := (way <= low + room) | (way >= high - room)).any():
            name = column.removesuffix(".q")
            found[f"the limit of {name}"] = float(time[int(np.argmax(met))])
    return found
