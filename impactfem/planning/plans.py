"""The plan of any scene: method, choices with their reasons, findings and cost."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from impactfem.cards import card, table
from impactfem.findings import Finding

_UNITS = {
    "dt": "s", "mesh_size": "m", "memory_mib": "MiB", "seconds": "s", "drawing_seconds": "s",
    "stick_speed": "m/s",
}  # fmt: skip
_NAMES = {
    "layers": "time steps",
    "memory_mib": "memory, about",
    "seconds": "time, about",
    "drawing_seconds": "pictures, film and report, about",
}
_COSTS = ("seconds", "drawing_seconds", "memory_mib")


@dataclass(frozen=True)
class Choice:
    """One choice of a plan: its key, what was chosen, in which unit, and why if that is said."""

    key: str
    value: Any
    unit: str
    why: str | None


@dataclass(frozen=True)
class Numbers(ABC):
    """What a runner takes from a plan besides the method; ``unknowns`` and more of its own."""

    @abstractmethod
    def rows(self, plan: "Plan[Any]") -> list[tuple[str, str]]:
        """Lines of the numbers and the cost in a terminal."""


@dataclass(frozen=True, repr=False, kw_only=True)
class Plan[N: Numbers]:
    """What will be modelled and how. Each of the ``numbers`` is an attribute of the plan too.

    Attributes:
        method: Name as in `impactfem methods`.
        model: The model in words.
        numbers: Steps, sizes and settings, those that the run needs.
        reasons: Why each choice was made, by key; "offer ..." are cheaper models of the scene.
        memory_mib: Estimated peak memory [MiB]; None if not known beforehand.
        seconds: Estimated time [s] on a 2-core machine, that of runs for the error included; None
            if not known beforehand.
        findings: What the user should know before trusting the answer.
        predicted_error: Relative error of the displacement to expect; None if there is no
            prediction.
        film: Whether a film of the motion is written.
        drawing_seconds: Time that pictures, film and report take besides [s], as far as the scene
            asks for them.
    """

    method: str
    model: str
    numbers: N
    reasons: dict[str, str]
    memory_mib: float | None
    seconds: float | None
    findings: Sequence[Finding] = ()
    predicted_error: float | None = None
    film: bool = False
    drawing_seconds: float = 0.0

    def __getattr__(self, name: str) -> Any:
        """One of the numbers."""
        if name == "numbers" or name.startswith("__"):  # of a copy that is being made
            raise AttributeError(name)
        return getattr(self.numbers, name)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences of the findings that are more than notes."""
        return tuple(found.sentence for found in self.findings if found.severity != "note")

    @property
    def choices(self) -> tuple[Choice, ...]:
        """All that was chosen."""
        chosen = {"film": self.film, "method": self.method, "model": self.model}
        return tuple(
            Choice(key, value, _UNITS.get(key, ""), self.reasons.get(key))
            for key, value in {**chosen, **asdict(self.numbers)}.items()
        )

    def as_dict(self) -> dict[str, Any]:
        """Plain data for ``summary.json``."""
        data = asdict(self)
        numbers = data.pop("numbers")
        return {"method": data.pop("method"), "model": data.pop("model"), **numbers, **data}

    def as_json(self) -> dict[str, Any]:
        """Plain data of ``impactfem plan --json``: each choice with its unit and its reason."""
        data = self.as_dict()
        return {
            "method": self.method,
            "choices": [asdict(choice) for choice in self.choices],
            "reasons": {key: why for key, why in self.reasons.items() if key not in data},
            "predicted_error": self.predicted_error,
            "findings": data["findings"],
            "cost": {key: data[key] for key in _COSTS},
        }

    def __repr__(self) -> str:
        said = [f"{self.method}, {self.model}"]
        if self.unknowns:
            said.append(f"{self.unknowns} unknowns")
        if self.seconds is not None:
            said.append(f"about {self.seconds:.2g} s")
        said += [f"warning: {text}" for text in self.warnings]
        return f"{type(self).__name__}({'; '.join(said)}; why: see reasons)"

    def _repr_html_(self) -> str:
        return plan_card(self)


def cost_rows(plan: Plan[Any]) -> list[tuple[str, str]]:
    """Lines of the cost in a terminal, as far as it is known."""
    if plan.memory_mib is None or plan.seconds is None:
        return []
    return [
        ("memory", f"about {plan.memory_mib:.0f} MiB"),
        ("time", f"about {plan.seconds:.2g} s on two cores"),
    ]


def estimate_row(numbers: Any) -> tuple[str, str]:
    """Line of the estimate of the error in a terminal."""
    return "estimate", "the error, by further runs" if numbers.estimate else "none"


def plan_card(plan: Plan[Any]) -> str:
    """The choices that were made, each with its reason; then cheaper models and warnings."""
    data = plan.as_dict()
    reasons = dict(data.pop("reasons"))
    data.pop("findings")
    title = f"Plan: {data.pop('model')}"
    rows = [("model", "", reasons.pop("model", ""))]
    for key, value in data.items():
        if value is not None or key in reasons:
            text = _shown(value) + (f" {_UNITS[key]}" if key in _UNITS and value else "")
            rows.append((_NAMES.get(key, key).replace("_", " "), text, reasons.pop(key, "")))
    rows += [(key.replace("_", " "), "", text) for key, text in reasons.items()]
    rows += [("warning", "", text) for text in plan.warnings]
    said = [row for row in rows if any(row[1:])]
    return card(title, [], parts=[table(("", "chosen", "why"), said)])


def _shown(value: object) -> str:
    if value is None:
        return "found later"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return ", ".join(_shown(entry) for entry in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
