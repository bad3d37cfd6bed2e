"""What plans share: findings, a prediction of the error, plain data, a card in a notebook."""

from dataclasses import asdict, dataclass
from typing import Any

from impactfem.cards import card, table
from impactfem.findings import Finding

_UNITS = {
    "dt": "s", "mesh_size": "m", "memory_mib": "MiB", "seconds": "s", "drawing_seconds": "s",
    "stick_speed": "m/s",
}  # fmt: skip
_NAMES = {
    "memory_mib": "memory, about",
    "seconds": "time, about",
    "drawing_seconds": "pictures, film and report, about",
}
_COSTS = ("seconds", "drawing_seconds", "memory_mib")
_APART = ("reasons", "findings", "predicted_error", *_COSTS)  # no choices


@dataclass(frozen=True, repr=False, kw_only=True)
class Foresees:
    """What plans share: a line in a terminal, a card in a notebook, plain data.

    Attributes:
        findings: What the user should know before trusting the answer.
        predicted_error: Relative error of the displacement to expect; None if there is no
            prediction.
        film: Whether a film of the motion is written.
        drawing_seconds: Time that pictures, film and report take besides [s], as far as the scene
            asks for them.
    """

    findings: tuple[Finding, ...] = ()
    predicted_error: float | None = None
    film: bool = False
    drawing_seconds: float = 0.0

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences of the findings that are more than notes."""
        return tuple(found.sentence for found in self.findings if found.severity != "note")

    def as_dict(self) -> dict[str, Any]:
        """Plain data for ``summary.json``."""
        return asdict(self)

    def as_json(self) -> dict[str, Any]:
        """Plain data of ``impactfem plan --json``: each choice with its unit and its reason."""
        data = self.as_dict()
        reasons = data["reasons"]
        return {
            "method": data["method"],
            "choices": [
                {"key": key, "value": value, "unit": _UNITS.get(key, ""), "why": reasons.get(key)}
                for key, value in data.items()
                if key not in _APART
            ],
            "reasons": {key: why for key, why in reasons.items() if key not in data},
            "predicted_error": self.predicted_error,
            "findings": data["findings"],
            "cost": {key: data[key] for key in _COSTS},
        }

    def __repr__(self) -> str:
        data = self.as_dict()
        said = [f"{data['method']}, {data['model']}"]
        if data["unknowns"]:
            said.append(f"{data['unknowns']} unknowns")
        if data["seconds"] is not None:
            said.append(f"about {data['seconds']:.2g} s")
        said += [f"warning: {text}" for text in self.warnings]
        return f"{type(self).__name__}({'; '.join(said)}; why: see reasons)"

    def _repr_html_(self) -> str:
        return plan_card(self)


def plan_card(plan: Foresees) -> str:
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
