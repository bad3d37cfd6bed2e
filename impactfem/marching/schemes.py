"""Time schemes of solids as data."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from impactfem.contact.layer_law import Rule


@dataclass(frozen=True)
class SolidScheme:
    """A time scheme: how the inside moves, which mass contact nodes have, and the contact rule.

    Attributes:
        interior: "midpoint" is the space-time form with layer weight beta = 1/4 (implicit),
            "leapfrog" with beta = 0 (explicit, lumped mass).
        massless: Whether contact nodes give their mass to their neighbours.
        contact: Rule for theta (`impactfem.contact.layer_law`), or "velocity": impulses on
            nodes whose gap would close. Where massless nodes meet nothing but nodes with mass,
            these have the law of velocities in any case.
        holds: Under finite strain, whether contact holds gaps that are closed instead of barring
            the way into obstacles: without work, but a little too late.
        levels: Whether velocities and energies of explicit steps are those of levels, as under
            finite strain, instead of those amid layers.
    """

    interior: Literal["midpoint", "leapfrog"]
    massless: bool
    contact: Rule | Literal["velocity"]
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
    def rule(self) -> Rule:
        """Rule for theta of gaps whose law acts on positions."""
        return "middle" if self.contact == "velocity" else self.contact

    @property
    def shares_forces(self) -> bool:
        """Whether a level takes half the force of each neighbouring layer, as the bar does."""
        return self.explicit and not self.massless


SOLID_SCHEMES: Mapping[str, SolidScheme] = {
    "massless": SolidScheme("midpoint", massless=True, contact="dissipative"),
    "conserving": SolidScheme("midpoint", massless=True, contact="conserving", holds=True),
    "explicit": SolidScheme("leapfrog", massless=True, contact="conserving"),
    "galerkin": SolidScheme("leapfrog", massless=False, contact="middle"),
    "moreau_jean": SolidScheme("midpoint", massless=False, contact="velocity"),
    "newmark": SolidScheme("midpoint", massless=False, contact="middle"),
}
"""Schemes by the name of their method."""


def scheme_of(method: str, *, finite: bool) -> SolidScheme:
    """Scheme of a method; ``finite`` tells whether there is a body under finite strain."""
    scheme = SOLID_SCHEMES[method]
    return replace(scheme, holds=True, levels=True) if finite and scheme.explicit else scheme
