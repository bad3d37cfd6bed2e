"""Generalised Maxwell elements over the whole elasticity of a body, in steps of the midpoint rule.

Each term has a share g of the stiffness K and follows the displacement u with its own place q,

    f = K (u + sum g r),   r = u - q,   r' = u' - r / tau,

whose energy is g r . K r / 2 and whose dashpot takes g r . K r / tau. The midpoint rule makes it,
for a step dt and k = dt / (2 tau),

    r_m = (r_a + (u_b - u_a) / 2) / (1 + k),   r_b = ((1 - k) r_a + u_b - u_a) / (1 + k),

so that a step has K (1 + sum g / (1 + k)) in place of K, and takes the energy of r_m. What is kept
are r, not q: they stay as small as strains last, however far the body flies.

Source: J. C. Simo, T. J. R. Hughes, Computational Inelasticity (Springer, 1998), section 10.3.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats

_NAME = "relaxing_"


@dataclass(frozen=True)
class Relaxation:
    """The terms of a body.

    Attributes:
        shares: g of each, over the stiffness that is left after long, (terms,).
        times: Of relaxation [s], (terms,).
    """

    shares: Floats
    times: Floats

    @classmethod
    def of(cls, terms: Sequence[tuple[float, float]]) -> "Relaxation":
        """Take shares and times [s], one pair for each term."""
        each = np.array(terms, dtype=np.float64).reshape(-1, 2)
        return cls(each[:, 0].copy(), each[:, 1].copy())

    def __bool__(self) -> bool:
        """Whether there are any terms."""
        return bool(len(self.shares))

    def rest(self, size: int) -> Floats:
        """R of a body at rest for long, (terms, size)."""
        return np.zeros((len(self.shares), size))

    def stiffening(self, dt: float) -> float:
        """What the terms add to the stiffness of a step, as a share of it."""
        return float((self.shares / (1.0 + self._steps(dt))).sum())

    def weights(self, dt: float) -> Floats:
        """1 / (1 + k) of each term in a step, (terms,)."""
        return 1.0 / (1.0 + self._steps(dt))

    def pull(self, kept: Floats, dt: float) -> Floats:
        """Sum of g r amid a step in which nothing moves, of r at its start (terms, ...)."""
        return np.tensordot(self.shares / (1.0 + self._steps(dt)), kept, axes=1)

    def amid(self, kept: Floats, way: Floats, dt: float) -> Floats:
        """R amid a step with a way (...), (terms, ...)."""
        found: Floats = (kept + 0.5 * way) / self._wide(1.0 + self._steps(dt), kept)
        return found

    def after(self, kept: Floats, way: Floats, dt: float) -> Floats:
        """R at the end of a step with a way (...), (terms, ...)."""
        steps = self._wide(self._steps(dt), kept)
        found: Floats = ((1.0 - steps) * kept + way) / (1.0 + steps)
        return found

    def held(self, kept: Floats, place: Floats, dt: float) -> Floats:
        """What is known of u + sum g r at the end of a step: the rest is 1 + `stiffening` times u.

        Args:
            kept: r at its start, (terms, ...).
            place: u there.
            dt: [s].
        """
        steps = self._steps(dt)
        weights = self.shares * (1.0 - steps) / (1.0 + steps)
        return np.tensordot(weights, kept, axes=1) - self.stiffening(dt) * place

    def after_by(self, by: Floats, dt: float) -> tuple[Floats, Floats]:
        """Of derivatives by `after` (terms, ...) those by the way (...) and by r at the start."""
        steps = self._wide(self._steps(dt), by)
        by = by / (1.0 + steps)
        return by.sum(axis=0), (1.0 - steps) * by

    def kept_by(self, pulled: Floats, held: Floats, dt: float) -> Floats:
        """Those by r at the start of a step, (terms, ...), of what it does to the step.

        Args:
            pulled: Derivatives by `pull`, (...).
            held: By `held`, (...).
            dt: [s].
        """
        steps = self._steps(dt)
        shares = self.shares / (1.0 + steps)
        found = np.multiply.outer(shares, pulled)
        found += np.multiply.outer((1.0 - steps) * shares, held)
        return found

    def straining(self, kept: Floats) -> Floats:
        """Sum of g r: a displacement by which the stress exceeds that of the elasticity."""
        return np.tensordot(self.shares, kept, axes=1)

    def _steps(self, dt: float) -> Floats:
        return 0.5 * dt / self.times

    @staticmethod
    def _wide(values: Floats, kept: Floats) -> Floats:
        return values.reshape(-1, *(1,) * (kept.ndim - 1))


def named(kept: Floats) -> dict[str, Floats]:
    """R of each term by name, for the state of a march."""
    return {f"{_NAME}{k}": each.copy() for k, each in enumerate(kept)}


def kept_of(state: Mapping[str, Floats]) -> Floats:
    """R of all terms of a state, (terms, ...)."""
    return np.array([each for name, each in state.items() if name.startswith(_NAME)])
