"""How contacts between nodes with mass that land in one step share it: the law of the scene."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.impact_law import Approach, Law, in_turn
from impactfem.errors import ConvergenceError
from impactfem.findings import Finding

_MOST = 60  # contacts up to which both laws are compared
_SETTLED = 1e-9  # of the fastest approach: slower ones are left to what lasts
_LASTS, _ENDS = 1000, 100_000  # two-body impacts, to compare with and where they are the law
_MATTERS, _ENOUGH = 0.01, 0.1  # of the fastest approach: speeds after both laws differ, and much
_OFTEN = 200  # comparisons at most


class Impacts:
    """The law of a march, and what it has seen of it.

    Attributes:
        law: "simultaneous" or "sequential"; see `impactfem.contact.impact_law`.
        seen: Of the step in which both laws differ most: contacts (0: none yet), time [s], pair,
            and by how much of the fastest approach; and how often they were compared.
    """

    def __init__(self, law: Law) -> None:
        """Begin without any."""
        self.law = law
        self.seen: Floats = np.zeros(5)

    def asks(self, contacts: int) -> bool:
        """Whether so many contacts that share an impact have to be looked at."""
        return contacts > 1 and (self.law == "sequential" or self._compares(contacts))

    def _compares(self, contacts: int) -> bool:
        known = self.seen[4] >= _OFTEN or self.seen[3] > _ENOUGH
        return contacts <= _MOST and not known

    def given(
        self,
        time: float,
        pairs: Callable[[], Integers],
        matrix: Floats,
        bodies: Approach,
        span: float,
    ) -> Floats | None:
        """Forces of impacts that come one after the other [N], (k, ways); None: they come at once.

        Where the law is the other one both are compared, until they differ much.

        Args:
            time: At the end of the step [s].
            pairs: Tells which pair of the scene each contact is of.
            matrix: Answers of half the ways that speeds go in the step to forces [m/N],
                (k ways, k ways).
            bodies: Speeds as such ways, of all contacts that take part, and gaps [m].
            span: Of the step by the time in which speeds go these ways: 2.

        Raises:
            ConvergenceError: The impacts did not come to an end.
        """
        count, ways = bodies.speed.shape
        # What closes in the step does so at its end at the latest.
        latest = span * np.maximum(-bodies.speed[:, 0], 0.0)
        bodies = replace(bodies, gap=np.minimum(bodies.gap, latest))
        at_once = self.law == "simultaneous"
        compares = self._compares(count) and not _apart(matrix, count, ways)
        if at_once and not compares:
            return None
        self.seen[4] += float(compares)
        try:
            found, after = in_turn(matrix, bodies, span, _SETTLED, _LASTS if at_once else _ENDS)
        except ConvergenceError:
            if at_once:
                return None
            raise
        if compares:
            with suppress(ConvergenceError):
                self._compare(time, pairs, matrix, bodies, after)
        return None if at_once else found

    def _compare(
        self,
        time: float,
        pairs: Callable[[], Integers],
        matrix: Floats,
        bodies: Approach,
        in_turns: Floats,
    ) -> None:
        speed, every = bodies.speed, np.arange(len(bodies.speed))
        impulse = bodies.strike(matrix, speed, every)
        at_once = speed + (matrix @ impulse.ravel()).reshape(speed.shape)
        apart = np.abs(at_once - in_turns).max(axis=1) / np.abs(speed[:, 0]).max()
        worst = int(np.argmax(apart))
        if apart[worst] > max(_MATTERS, self.seen[3]):
            self.seen[:4] = len(speed), time, pairs()[worst], apart[worst]

    def figures(self, names: Sequence[str]) -> dict[str, Any]:
        """What it has seen, for the details of a run.

        Args:
            names: Of the pairs of the scene.
        """
        count, time, pair, differs, _ = self.seen.tolist()
        if not count:
            return {}
        told = {"law": self.law, "contacts": int(count), "time": time, "pair": names[int(pair)]}
        return {"impact_law": told | {"difference": differs}}

    def findings(self, figures: Mapping[str, Any]) -> tuple[Finding, ...]:
        """The same in words, of `figures`."""
        if (told := figures.get("impact_law")) is None:
            return ()
        other = "sequential" if self.law == "simultaneous" else "simultaneous"
        text = (
            f"{told['contacts']} contacts share an impact within a step at t = {told['time']:.6g} "
            f"s, among them {told['pair']}: {_WORDS[self.law]} "
            f'(impact_law = "{self.law}"); '
            f"{_WORDS[other]} speeds after it differ by {100 * told['difference']:.3g} % of the "
            "approach"
        )
        remedy = f'compare impact_law = "{other}", and a smaller solve.dt, which parts what lands'
        return (
            Finding(
                "impact_law", "note", text, told["pair"], told["difference"], _MATTERS, remedy
            ),
        )  # fmt: skip


_WORDS = {"simultaneous": "they were struck at once", "sequential": "one after the other"}


def reached(closes: Booleans, arrives: Booleans, gap: Floats, leaves: Booleans) -> Booleans:
    """Contacts between nodes with mass that take part in a step, (gaps,).

    What would close without contact forces, and where something arrives all that touches.

    Args:
        closes: Whether a gap would.
        arrives: Whether it closes faster than forces make it.
        gap: Less the rounding of places, before the step [m].
        leaves: Whether it opens faster than they do.
    """
    if not (closes & arrives).any():
        return closes
    found: Booleans = closes | ((gap <= 0.0) & ~leaves)
    return found


def _apart(matrix: Floats, count: int, ways: int) -> bool:
    """Whether no contact feels another."""
    links = np.abs(matrix).reshape(count, ways, count, ways).max(axis=(1, 3))
    return not (links - np.diag(np.diag(links))).any()
