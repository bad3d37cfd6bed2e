"""A plan as a card in a notebook: each choice beside its reason."""

from typing import Any, Protocol

from impactfem.cards import card, table

_UNITS = {"dt": "s", "mesh_size": "m", "memory_mib": "MiB", "seconds": "s", "stick_speed": "m/s"}
_NAMES = {"memory_mib": "memory, about", "seconds": "time, about"}


class AsDict(Protocol):
    """A plan."""

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""


class ShowsItself:
    """What plans share: a line in a terminal, a card in a notebook."""

    def __repr__(self: AsDict) -> str:
        data = self.as_dict()
        said = [f"{data['method']}, {data['model']}"]
        if data["unknowns"]:
            said.append(f"{data['unknowns']} unknowns")
        if data["seconds"] is not None:
            said.append(f"about {data['seconds']:.2g} s")
        said += [f"warning: {text}" for text in data["warnings"]]
        return f"{type(self).__name__}({'; '.join(said)}; why: see reasons)"

    def _repr_html_(self: AsDict) -> str:
        return plan_card(self)


def plan_card(plan: AsDict) -> str:
    """The choices that were made, each with its reason; then cheaper models and warnings."""
    data = plan.as_dict()
    reasons, warnings = dict(data.pop("reasons")), data.pop("warnings")
    title = f"Plan: {data.pop('model')}"
    rows = [("model", "", reasons.pop("model", ""))]
    for key, value in data.items():
        if value is not None or key in reasons:
            text = _shown(value) + (f" {_UNITS[key]}" if key in _UNITS and value else "")
            rows.append((_NAMES.get(key, key).replace("_", " "), text, reasons.pop(key, "")))
    rows += [(key.replace("_", " "), "", text) for key, text in reasons.items()]
    rows += [("warning", "", text) for text in warnings]
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
