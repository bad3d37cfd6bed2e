"""The numbers that an objective is made of: those of measures, and of terms."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.inverse.data import Data, data_of
from impactfem.inverse.outcomes import Outcome
from impactfem.scene import Limit, Scene, Term
from impactfem.scene.nearest import meant
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

_AXES = "xyz"


@dataclass(frozen=True)
class Quantities:
    """The numbers q of a scene, and the objective J(q).

    Attributes:
        scene: The scene.
        data: Of each measure, in the order of the scene.
        terms: Of the objective.
        limits: Terms that stay within limits.
    """

    scene: Scene
    data: tuple[Data, ...]
    terms: tuple[Term, ...]
    limits: tuple[Limit, ...] = ()

    @classmethod
    def of(cls, scene: Scene) -> "Quantities":
        """Those of a scene.

        Raises:
            SceneError: Nothing is wanted, or data cannot be read.
        """
        if scene.objective is not None:
            terms = scene.objective.minimise
        else:
            measured = [m.name for m in scene.measures if m.is_measured]
            terms = tuple(Term(term="misfit", of=name) for name in measured)
        if not terms:
            raise SceneError(
                "objective: nothing is wanted: give [objective] with minimise, or data of a "
                "[[measure]], whose misfit then becomes least"
            )
        data = tuple(data_of(scene, index) for index in range(len(scene.measures)))
        return cls(scene, data, terms, scene.objective.constraints if scene.objective else ())

    @property
    def times(self) -> Floats:
        """Times at which a run has to be known, with its start and end [s]."""
        own = [each.times for each in self.data]
        own += [np.array([self.at(term)]) for term in self.all_terms]
        return np.unique(np.concatenate([[0.0, self.scene.duration], *own]))

    @property
    def all_terms(self) -> tuple[Term, ...]:
        """Terms of the objective, then those that stay within limits."""
        return (*self.terms, *(limit.limited for limit in self.limits))

    def at(self, term: Term) -> float:
        """Time that a term is of [s]."""
        return self.scene.duration if term.at is None else term.at

    @property
    def ends(self) -> list[int]:
        """Where the numbers of each measure end; those of terms follow."""
        return np.cumsum([len(each.times) for each in self.data]).tolist()

    @property
    def count(self) -> int:
        """How many numbers there are."""
        return self._first_term + len(self.all_terms)

    def read(self, outcome: Outcome, scene: Scene) -> Floats:
        """The numbers of a run, (n,): of all measures at their times, then of all terms.

        Args:
            outcome: Of the run.
            scene: With the parameters of that run.

        Raises:
            SceneError: A measure is of nothing that the run has.
        """
        found = [self._measured(index, outcome, data.times) for index, data in enumerate(self.data)]
        return np.concatenate(
            [*found, [self._term(term, outcome, scene) for term in self.all_terms]]
        )

    def add_efforts(self, found: Floats, scene: Scene) -> None:
        """Add derivatives (..., n, P) of terms that controls of a scene change without motion."""
        first, terms = len(scene.parameters), self.all_terms
        for control in scene.controls:
            own = slice(first, first := first + control.count)
            for k, term in enumerate(terms):
                if term.term == "effort" and term.of == control.name:
                    found[..., k - len(terms), own] += control.effort_slope(scene.duration)

    def _measured(self, index: int, outcome: Outcome, times: Floats) -> Floats:
        measure = self.scene.measures[index]
        kind, _, name = measure.of.partition(".")
        where = f"measure[{index}]"
        if kind == "impulse" and name in outcome.impulse:
            values, unit = outcome.impulse[name], "N s"
        elif kind == "duration" and name in outcome.duration:
            values, unit = np.full(len(outcome.times), outcome.duration[name]), "s"
        elif kind == "force_rise" and name in outcome.impulse:
            values, unit = np.full(len(outcome.times), _rise(where, measure.of, outcome)), "N/s"
        elif kind == "rebound_speed" and name in outcome.rebound:
            values, unit = np.full(len(outcome.times), outcome.rebound[name]), "m/s"
            if np.isnan(values).any():
                text = f" = {show(measure.of)}: {name} touches nothing in this run, or what it "
                text += "touches yet where it ends; start elsewhere, or give a longer duration"
                raise KeyedError(where, "of", text)
        elif measure.of in outcome.names:
            column = outcome.history[measure.of]
            values, unit = np.asarray(column.values, dtype=float), str(column.attrs.get("units"))
            if self.data[index].by_rows:  # means beside means
                values = outcome.means.get(measure.of, values)
        else:
            text = f" = {show(measure.of)} is nothing of this run; "
            raise KeyedError(where, "of", f"{text}{meant(measure.of, outcome.names)}.")
        if measure.unit is not None and measure.unit != unit:
            text = f" = {show(measure.unit)}, but {measure.of} is in {unit}: convert the data."
            raise KeyedError(where, "unit", text)
        return values[_rows(outcome.times, times)]

    def _term(self, term: Term, outcome: Outcome, scene: Scene) -> float:
        """Number of a term that is of no measure; else 0."""
        if term.term == "effort":
            (control,) = (each for each in scene.controls if each.name == term.of)
            return control.effort(scene.duration)
        if term.term == "mass":
            return outcome.masses[str(term.body)]
        if term.of is not None:
            return 0.0
        if term.term in {"peak_force", "time"}:
            return _of_pair(term, outcome)
        row = _rows(outcome.times, np.array([self.at(term)]))[0]
        if term.term == "speed":
            return float(np.linalg.norm(_velocity(outcome, str(term.body), row)))
        columns = [outcome.history.get(f"{name}_energy") for name in _ENERGIES[term.term]]
        energy = sum(float(column.values[row]) for column in columns if column is not None)
        if term.term == "terminal_energy":
            energy += float(np.broadcast_to(outcome.driven, outcome.times.shape)[row])
        if term.term == "vibration_energy":
            for name, mass in outcome.masses.items():
                energy -= 0.5 * mass * float(np.square(_velocity(outcome, name, row)).sum())
        return energy

    def parts(self, q: Floats) -> list[float]:
        """Each term of J(q), with its weight."""
        return [term.weight * self._part(k, term, q)[0] for k, term in enumerate(self.terms)]

    def objective(self, q: Floats) -> float:
        """J(q)."""
        return float(sum(self.parts(q)))

    def slope(self, q: Floats) -> Floats:
        """Derivatives of J by q, (n,)."""
        found = np.zeros(len(q))
        for k, term in enumerate(self.terms):
            found += term.weight * self._part(k, term, q)[1]
        return found

    def limited(self, q: Floats) -> tuple[Floats, Floats]:
        """What stays within limits (m,), and its derivatives by q (m, n)."""
        first = len(self.terms)
        each = [self._part(first + k, one.limited, q) for k, one in enumerate(self.limits)]
        slopes = np.array([slope for _, slope in each]).reshape(len(each), len(q))
        return np.array([value for value, _ in each]), slopes

    def _part(self, k: int, term: Term, q: Floats) -> tuple[float, Floats]:
        """A term without its weight, and its derivatives by q (n,)."""
        slope = np.zeros(len(q))
        if term.term not in {"value", "misfit"}:
            place = self._first_term + k
            slope[place] = 1.0
            return float(q[place]), slope
        index = self.index(str(term.of))
        own = self.slices[index]
        if term.term == "value":
            slope[own.start] = 1.0
            return float(q[own.start]), slope
        wrong = self.residuals(index, q)
        slope[own] = wrong / self.sigma(index)
        return 0.5 * float(wrong @ wrong), slope

    def residuals(self, index: int, q: Floats) -> Floats:
        """(measure - data) / sigma of a measure, (times,)."""
        values = self.data[index].values
        if values is None:
            raise SceneError(f"measure[{index}]: there are no data to differ from; give some")
        return np.asarray((q[self.slices[index]] - values) / self.sigma(index))

    def sigma(self, index: int) -> Floats:
        """Standard deviations of a measure's data, 1 where they are unknown, (times,)."""
        data = self.data[index]
        return np.ones(len(data.times)) if data.sigma is None else data.sigma

    def index(self, name: str) -> int:
        """Place of a measure."""
        return [measure.name for measure in self.scene.measures].index(name)

    @property
    def slices(self) -> list[slice]:
        """Where the numbers of each measure stand in q."""
        ends = self.ends
        return [slice(a, b) for a, b in zip([0, *ends], ends, strict=False)]

    @property
    def _first_term(self) -> int:
        return self.ends[-1] if self.data else 0

    @property
    def notes(self) -> tuple[str, ...]:
        """What makes a search difficult, in words, with the remedy."""
        found = []
        for term in self.terms:
            if term.term != "misfit":
                continue
            index = self.index(str(term.of))
            of, times = self.scene.measures[index].of, self.data[index].times
            if of.partition(".")[0] not in _FORCES or len(times) < _HISTORY:
                continue
            soft = self.scene.contacts and all(law.stiffness for law in self.scene.contacts)
            round_ = {getattr(solid.shape, "kind", "") for solid in self.scene.solids}
            if soft or (round_ and round_ <= _ROUND):
                continue  # such forces begin and end at 0
            found.append(
                f"{of} jumps where contacts begin and end: its misfit has a V at the answer and "
                "minima beside it unless these times are right from the start; impulse.PAIR and "
                "duration.PAIR are smooth"
            )
        return tuple(found)

    @property
    def misfits(self) -> Sequence[tuple[int, float]]:
        """Measures whose misfits are wanted, and the roots of their weights.

        Raises:
            SceneError: There are other terms, or negative weights.
        """
        found = []
        for k, term in enumerate(self.terms):
            if term.term != "misfit" or not term.weight > 0.0:
                raise KeyedError(
                    f"objective.minimise[{k}]", "term",
                    f" = {show(term.term)} with weight {term.weight:g}: what is identified are "
                    "misfits with positive weights; remove it, or ask for a gradient only.",
                )  # fmt: skip
            found.append((self.index(str(term.of)), float(np.sqrt(term.weight))))
        return found


def _rise(where: str, of: str, outcome: Outcome) -> float:
    """Rate at which the force of a pair rises [N/s].

    Raises:
        KeyedError: It jumps, or there is none.
    """
    found = outcome.rise.get(of.partition(".")[2])
    if found is None:
        text = f" = {show(of)}: the force jumps, as what meets is rigid; give stiffness in "
        text += '[[contact]] of a bar and its wall, and solve.method = "galerkin".'
        raise KeyedError(where, "of", text)
    if np.isnan(found):
        text = f" = {show(of)}: the pair does not touch in this run; start elsewhere"
        raise KeyedError(where, "of", text)
    return found


def _of_pair(term: Term, outcome: Outcome) -> float:
    """Largest force of the pair of a term [N], or when it first touches [s].

    Raises:
        SceneError: There is no such pair, or it does not touch.
    """
    key, found, none, remedy = {
        "peak_force": ("pair", outcome.peak, "impacts take no time in this run", "of a bar"),
        "time": ("until", outcome.touched, "time steps know it to their length", "of an exact run"),
    }[term.term]
    name = str(getattr(term, key))
    where = f"objective: {term.term} of {key} = {show(name)}"
    if name not in found:
        known = ", ".join(found) or f"none: {none}"
        raise SceneError(f"{where}: there is {known}; give a pair {remedy}")
    if np.isnan(found[name]):
        raise SceneError(f"{where} does not touch in this run; start elsewhere, or run longer")
    return found[name]


_FORCES = ("force", "contact_force")
_ROUND = {"disc", "sphere"}
_HISTORY = 2  # values of a history
_ENERGIES = {
    "terminal_energy": ("kinetic", "elastic", "potential"),
    "vibration_energy": ("kinetic", "elastic"),
}


def _velocity(outcome: Outcome, body: str, row: int) -> Floats:
    """Of the centre of mass of a body (axes,)."""
    columns = [outcome.history.get(f"{body}.v{axis}") for axis in _AXES]
    return np.array([column.values[row] for column in columns if column is not None])


def _rows(known: Floats, wanted: Floats) -> NDArray[np.int64]:
    """Rows of times that are among those known."""
    right = np.clip(np.searchsorted(known, wanted), 1, len(known) - 1)
    nearer = np.abs(known[right - 1] - wanted) < np.abs(known[right] - wanted)
    return np.where(nearer, right - 1, right)
