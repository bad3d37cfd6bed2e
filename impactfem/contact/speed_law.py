"""Contact of nodes with mass on both sides, whose law acts on velocities: impacts in a layer.

Positions cannot be the law there: a node that arrives with the speed w would leave with -w. With
w_a and w_b before and after the layer, Moreau's and Jean's rule

    0 <= Lambda _|_ w_b + e w_a >= 0    where the gap would close,

makes the work Lambda (w_a + w_b) dt / 2 <= 0 for nodes that approach. For those that leave
(w_a > 0), e = 1 stands in, so that this work is 0: no layer gains energy.

Between nodes with mass and ends of bars, or two of these, nothing stores the force from layer to
layer either, but an end has a velocity at once: the law acts on gaps, and the force of a layer is
its own. Its work is Lambda times the change of the gap, never positive.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.errors import SceneError


@dataclass(frozen=True)
class Halfway:
    """Gaps that have forces of the layer alone.

    Attributes:
        rows: Which they are, of both sorts, shape (pairs,).
        way: (w_b + e w_a) dt / 2 without contact forces [m], shape (pairs, ways), tangential parts
            without e. The unit makes the answer of Lambda that of the gaps, so that both kinds of
            gaps are one problem. Of ends of bars the gap itself [m].
        ends: Which of the gaps are those of ends of bars, shape (pairs,).
        across: Which of the other gaps have springs and no massless nodes, shape (pairs,): only
            what is tangential acts on velocities, and has forces of the layer alone. None: none.
        touching: Which take part though they would not close, as impacts reach them, shape
            (pairs,). None: none.
    """

    rows: Booleans
    way: Floats
    ends: Booleans
    across: Booleans | None = None
    touching: Booleans | None = None

    @property
    def acts(self) -> bool:
        """Whether there is any such gap."""
        return bool(self.rows.any() or (self.across is not None and self.across.any()))

    def acting(self, gap: Floats) -> NDArray[np.int64]:
        """Gaps to be solved: those of positions, and of the others what would close."""
        takes = ~self.rows | self.ends | (gap <= 0.0)
        return np.flatnonzero(takes if self.touching is None else takes | self.touching)

    def components(self) -> Booleans:
        """Which components of the gaps act on velocities, (pairs, ways)."""
        found = np.repeat(self.rows[:, None], self.way.shape[1], axis=1)
        if self.across is not None:
            found[:, 1:] |= self.across[:, None]
        return found


@dataclass(frozen=True)
class SpeedLaws:
    """Restitution of gaps, in some of them by the speed of approach.

    Attributes:
        laws: Names, and what gives e by speeds > 0 [m/s] and numbers e, (gaps,) each.
        which: Law of each gap, -1: its number, (gaps,).
        given: Numbers e of the gaps, (gaps,).
    """

    laws: tuple[tuple[str, Callable[[Floats, Floats], Floats]], ...]
    which: Integers
    given: Floats

    def some(self, rows: Integers) -> "SpeedLaws":
        """Those of some gaps."""
        return replace(self, which=self.which[rows], given=self.given[rows])

    def at(self, speed: Floats) -> Floats:
        """Newton's e by normal speeds before an impact [m/s], < 0 approaching, (gaps,).

        Raises:
            SceneError: A law gives anything but numbers from 0 to 1.
        """
        found = self.given.copy()
        for k, (name, law) in enumerate(self.laws):
            rows = np.flatnonzero((self.which == k) & (speed < 0.0))
            if len(rows):
                found[rows] = _allowed(name, law(-speed[rows], self.given[rows]), -speed[rows])
        return found


def _allowed(name: str, told: object, speed: Floats) -> Floats:
    """What a law of a user gives for some speeds, if it may."""
    values = np.asarray(told, dtype=float)
    if values.shape != speed.shape:
        text = f"an array of shape {values.shape} for speeds of shape {speed.shape}"
    else:
        wrong = np.flatnonzero(~((values >= 0.0) & (values <= 1.0)))
        if not len(wrong):
            return values
        text = f"{values[wrong[0]]:g} for an approach with {speed[wrong[0]]:g} m/s"
    raise SceneError(
        f"restitution_law: {name} gives {text}; mend it: e from 0 (no rebound) to 1 (no loss), one "
        "for each speed"
    )


def rebound(before: Floats, after: Floats, restitution: Floats, half: float) -> Floats:
    """(w_b + e w_a) dt / 2 of normal velocities [m], by dt / 2; see `Halfway`."""
    return np.asarray(half * (after + returned(before, restitution)))


def returned(before: Floats, restitution: Floats) -> Floats:
    """Normal speeds that a layer has to give back, (pairs,); see `Halfway`."""
    return np.where(before > 0.0, 1.0, restitution) * before


def expanded(restitution: Floats, compression: Floats, before: Floats) -> Floats:
    """Least forces of impacts with a compression and an expansion (Poisson) [N], (pairs,).

    Args:
        restitution: Poisson's e, 0 where there is no such impact, (pairs,).
        compression: Forces that end the approach, (pairs,).
        before: What of these bodies that rest on each other had before, (pairs,).
    """
    struck = np.maximum(compression - before, 0.0)
    return np.where(restitution > 0.0, compression + restitution * struck, 0.0)
