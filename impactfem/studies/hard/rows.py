"""Hard cases as tables: what each sets in a scene, and which bounds must hold in it."""

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from impactfem.scene import Formula, Scene
from impactfem.studies.hard.board import Case, Claim, Facts

_ROUNDING = 1e-9  # of methods that lose no time


@dataclass(frozen=True)
class Sizes:
    """Numbers of a run of points.

    Attributes:
        dt: Step h of the schemes with time steps [s].
        row: Time between rows of the methods that have no steps of their own [s].
    """

    dt: float = 1e-4
    row: float = 1e-2

    def time(self, method: str) -> float:
        """What a method cannot tell from an instant, tau [s]: the length of its impacts.

        h of moreau_jean, 2 h of paoli_schatzman, none of event_driven.
        """
        lasting = _LASTING.get(method)
        return self.dt if lasting is None else lasting(self)


_LASTING: Mapping[str, Callable[[Sizes], float]] = {
    "event_driven": lambda _: 0.0,
    "paoli_schatzman": lambda sizes: 2.0 * sizes.dt,
}
"""How long impacts of a method last [s], where it is not a step."""


@dataclass(frozen=True)
class Row:
    """A case of a table.

    Attributes:
        base: The scene that it changes.
        set: What it changes, value by path.
        vary: Further changes, a run each.
        figures: What is asked of it.
        without: Figures that say nothing here.
        given: What its function takes.
        sizes: Numbers of runs of points.
    """

    base: Mapping[str, Any] = field(default_factory=dict)
    set: Mapping[str, Any] = field(default_factory=dict)
    vary: Sequence[Mapping[str, Any]] = ({},)
    figures: frozenset[str] = frozenset()
    without: frozenset[str] = frozenset()
    given: Mapping[str, Any] = field(default_factory=dict)
    sizes: Sizes = field(default_factory=Sizes)

    def scene(self, more: Mapping[str, Any] | None = None) -> Scene:
        """The scene, with further changes.

        Raises:
            SceneError: It is not allowed.
        """
        return Scene.from_dict(self.base).with_settings({**self.set, **(more or {})})

    def worst(self, facts: Callable[[Scene], Facts]) -> dict[str, float]:
        """The largest of each fact of all its scenes."""
        found: dict[str, float] = {}
        for more in self.vary:
            for name, value in facts(self.scene(more)).items():
                if name not in self.without:
                    found[name] = max(value, found.get(name, -math.inf))
        return found


type Run = Callable[[str, Row], Facts]
"""Takes the name of a method and a case and returns its facts; an ImpactError is a refusal."""


def base(table: str, name: str | None = None) -> Mapping[str, Any]:
    """The scene of a table that its cases change, or another one by name."""
    read = _read(table)
    scene: Mapping[str, Any] = read["scene"] if name is None else read["scenes"][name]
    return scene


def load(table: str, runs: Sequence[Run]) -> tuple[Case, ...]:
    """The cases of a table.

    Args:
        table: Its name.
        runs: What may measure a case, which names one of these functions, or else ``plain``.
    """
    named = {run.__name__: run for run in runs}
    return tuple(_case(table, entry, named) for entry in _read(table)["case"])


def _case(table: str, entry: Mapping[str, Any], runs: Mapping[str, Run]) -> Case:
    read, keys = _read(table), dict(entry)
    name, methods = keys.pop("name"), keys.pop("methods")
    refused, run = keys.pop("refused", ()), runs[keys.pop("run", "plain")]
    rows = [row for group in keys.pop("bounds", ()) for row in _read("bounds")[group]]
    quick, values = keys.pop("quick", True), keys.pop("values", {})
    sizes = Sizes(**keys.pop("sizes", {}))
    row = Row(
        base=base(table, keys.pop("scene", None)) if "scene" in read else {},
        figures=frozenset(row["figure"] for row in rows),
        without=frozenset(keys.pop("without", ())),
        sizes=sizes, **keys,
    )  # fmt: skip

    def names(given: str | Sequence[str]) -> tuple[str, ...]:
        return tuple(read["methods"][given] if isinstance(given, str) else given)

    return Case(
        name,
        lambda method: run(method, row),
        lambda method: _claims(rows, method, sizes.time(method), values),
        names(methods), frozenset(names(refused)), quick, read["body"],
    )  # fmt: skip


def _claims(
    rows: Sequence[Mapping[str, Any]], method: str, tau: float, values: Mapping[str, float | str]
) -> list[Claim]:
    return [
        Claim(row["figure"], limit(row["limit"], tau, values), row["why"])
        for row in rows
        if method in row.get("of", (method,)) and method not in row.get("but", ())
    ]


def limit(given: float | str, tau: float, values: Mapping[str, float | str]) -> float:
    """A limit: a number, or a formula of tau [s] and values, to three digits."""
    if not isinstance(given, str):
        return float(given)
    if tau == 0.0:
        return _ROUNDING
    known = {name: float(Formula(str(value), ())()) for name, value in values.items()}
    formula = Formula(given, ("tau", *known))
    return float(f"{formula(tau=tau, **known):.3g}")


@cache
def _read(name: str) -> dict[str, Any]:
    with (Path(__file__).parent / f"{name}.toml").open("rb") as file:
        return tomllib.load(file)
