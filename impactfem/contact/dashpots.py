"""Dashpots beside the springs of contacts: what they take, and that they never pull.

A contact that is pressed by d has the force of a Kelvin-Voigt element, or that of Hunt and Crossley
(J. Appl. Mech. 42 (1975) 440-445),

    F = max(0, K d^p + c d'),        F = max(0, K d^p (1 + chi d')).

Both are F = max(0, f(d) + P(d)') with P = c d, and P = chi U, U = K d^(p+1) / (p + 1) the energy of
the spring: over a layer from a to b the mean of the dashpot's force is (P(d_b) - P(d_a)) / dt, to
the whole of its impulse also where contact begins within the layer. With the elastic part
(1 - theta) f_a + theta f_b of the layer, theta as `impactfem.contact.layer_law` finds it, its force
is

    F = theta y,    y = max(0, phi(d_b)),
    phi(d) = f(d) + (1 - theta) / theta f_a + (P(d) - P(d_a)) / (theta dt),

convex and increasing in d. Where phi(0) >= 0 the least force of a layer is theta phi(0); else none
acts unless the gap is shut by more than the root of phi. In what is added to either the law is that
of a spring again. The elastic part does the work U_a - U_b, the rest

    (F - F_elastic) (g_b - g_a) <= 0,

since both factors have the sign of d_b - d_a, and of its opposite. A spring that is still pressed
when its force has ended gives the rest of its energy to the dashpot.
"""

from dataclasses import dataclass, field

import numpy as np

from impactfem.arrays import Floats
from impactfem.contact.springs import ContactSprings

_STEPS = 100
_ROUNDING = 8.0 * np.finfo(float).eps


@dataclass(frozen=True)
class DampedLayer(ContactSprings):
    """Springs and dashpots in a layer, whose forces are counted from the least ones on.

    Dashpots are told by mean forces over the layer, as `ContactSprings.over` does.

    Attributes:
        theta: Weight of the force at the end of the layer.
        least: y to begin with [N], (gaps,); of rigid gaps and of springs alone the force that
            belongs to the start.
        first: How far gaps are shut before more acts [m], (gaps,).
    """

    theta: float = 0.5
    least: Floats = field(default_factory=lambda: np.zeros(0))
    first: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, springs: ContactSprings, force: Floats, theta: float) -> "DampedLayer":
        """From the elastic forces at the start [N], (gaps,)."""
        damped, base = springs.damped, (1.0 - theta) / theta * force
        before = np.where(damped, springs.depth(np.where(damped, force, 0.0)), 0.0)
        rest = np.where(damped, base - springs.braked(before)[0] / theta, base)
        # Newton's steps from above come down to the root of a convex function.
        first, open_ = np.where(rest < 0.0, before, 0.0), rest < 0.0
        for _ in range(_STEPS):
            (drawn, slope), (braked, more) = springs.drawn(first), springs.braked(first)
            steep = np.where(open_, slope + more / theta, 1.0)
            step = np.where(open_, (rest + drawn + braked / theta) / steep, 0.0)
            first = np.maximum(first - np.maximum(step, 0.0), 0.0)
            if (step <= _ROUNDING * first).all():
                break
        return cls(
            springs.stiffness, springs.exponent, springs.dashpots,
            theta, np.maximum(rest, 0.0), first,
        )  # fmt: skip

    def depths(self, gap: Floats) -> Floats:
        """How far springs are pressed by gaps without them [m], (gaps,)."""
        return np.where(self.there, np.maximum(-gap, 0.0), 0.0)

    def _law(self, depth: Floats) -> tuple[Floats, Floats]:
        """Forces beyond the least ones by depths beyond the first ones, and their slopes."""
        deep = self.first + depth
        (drawn, slope), (braked, more) = self.drawn(deep), self.braked(deep)
        (less, _), (before, _) = self.drawn(self.first), self.braked(self.first)
        return drawn - less + (braked - before) / self.theta, slope + more / self.theta

    def _rounding(self, depth: Floats, give: Floats) -> Floats:
        """What differences lose [N], (gaps,)."""
        deep = self.first + depth
        parts = self.drawn(deep)[0] + self.braked(deep)[0] / self.theta
        return _ROUNDING * (parts + deep / np.where(self.damped, give, 1.0)) * self.damped
