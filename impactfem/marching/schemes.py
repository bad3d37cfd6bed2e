"""Time schemes as data."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:  # they load Numba
    from impactfem.contact.layer_law import Rule
    from impactfem.system.chain import Chain


@dataclass(frozen=True)
class BarScheme:
    """A time scheme of one bar before a wall.

    Attributes:
        kernel: "two_step", "conserving", "newmark", or a function with the arguments of
            `impactfem.marching.negative_control.newmark` that fills its arrays.
        limited: Whether it is stable up to dt omega = 2 only.
    """

    kernel: str | Callable[..., None]
    limited: bool = False

    def stable_dt(self, chain: "Chain") -> float:
        """Largest stable time step without contact [s]."""
        return 2.0 / chain.highest_frequency if self.limited else float("inf")


SCHEMES: dict[str, BarScheme] = {
    "galerkin": BarScheme("two_step", limited=True),
    "conserving": BarScheme("conserving"),
    "newmark": BarScheme("newmark"),
}
"""Schemes of a bar by the name of their method; `impactfem.extend` adds others."""


@dataclass(frozen=True)
class SolidScheme:
    """A time scheme: how the inside moves, which mass contact nodes have, and the contact rule.

    Attributes:
        interior: "midpoint" is the space-time form with layer weight beta = 1/4 (implicit),
            "leapfrog" with beta = 0 (explicit, lumped mass); or what makes another
            `impactfem.marching.layers.Interior`, of the arguments of
            `impactfem.marching.midpoint.Midpoint`.
        massless: Whether contact nodes give their mass to their neighbours.
        contact: Rule for theta (`impactfem.contact.layer_law`), or "velocity": impulses on
            nodes whose gap would close. Where massless nodes meet nothing but nodes with mass,
            these have the law of velocities in any case.
        holds: Under finite strain, whether contact holds gaps that are closed instead of barring
            the way into obstacles: without work, but a little too late.
        levels: Whether velocities and energies of explicit steps are those of levels, as under
            finite strain, instead of those amid layers.
    """

    interior: Literal["midpoint", "leapfrog"] | Callable[..., Any]
    massless: bool
    contact: "Rule | Literal['velocity']"
    holds: bool = False
    levels: bool = False

    @property
    def staggered(self) -> bool:
        """Whether velocities and energies belong to the middle of layers."""
        return self.explicit and not self.levels

    @property
    def explicit(self) -> bool:
        """Whether nothing but the contact is solved for: the mass is lumped, beta is 0."""
        return self.interior == "leapfrog"

    @property
    def rule(self) -> "Rule":
        """Rule for theta of gaps whose law acts on positions."""
        return "middle" if self.contact == "velocity" else self.contact

    @property
    def shares_forces(self) -> bool:
        """Whether a level takes half the force of each neighbouring layer, as the bar does."""
        return self.explicit and not self.massless


SOLID_SCHEMES: dict[str, SolidScheme] = {
    "massless": SolidScheme("midpoint", massless=True, contact="dissipative"),
    "conserving": SolidScheme("midpoint", massless=True, contact="conserving", holds=True),
    "explicit": SolidScheme("leapfrog", massless=True, contact="conserving"),
    "galerkin": SolidScheme("leapfrog", massless=False, contact="middle"),
    "moreau_jean": SolidScheme("midpoint", massless=False, contact="velocity"),
    "newmark": SolidScheme("midpoint", massless=False, contact="middle"),
}
"""Schemes of solids by the name of their method; `impactfem.extend` adds others."""


def scheme_of(method: str, *, finite: bool) -> SolidScheme:
    """Scheme of a method; ``finite`` tells whether there is a body under finite strain."""
    scheme = SOLID_SCHEMES[method]
    return replace(scheme, holds=True, levels=True) if finite and scheme.explicit else scheme
