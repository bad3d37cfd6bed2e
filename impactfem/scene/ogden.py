"""Terms of Ogden's law and of that for foams, and what they are at small strains."""

from collections.abc import Sequence
from typing import ClassVar

from impactfem.scene.kinds import Real
from impactfem.scene.schema import KeyedError, key, table


@table("terms = [{ mu = ... }]")
class OgdenTerm:
    """2 mu / alpha^2 times the sum of the powers alpha of the principal stretches.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "terms"

    mu: float = key(Real(), "what it adds to the shear modulus at small strains", unit="Pa")
    alpha: float = key(Real(), "power of the stretches, not 0")
    beta: float | None = key(
        Real(), "of foams: how far pulling narrows them, nu / (1 - 2 nu) at small strains",
        default=None, absent='by poisson_ratio for "foam", none for "ogden"',
    )  # fmt: skip

    def _check(self) -> None:
        for name in ("mu", "alpha"):
            if getattr(self, name) == 0.0:
                raise KeyedError(self.heading, name, " = 0 makes no term: give another, or none.")


def small_strains(
    terms: Sequence[tuple[float, float, float]], bulk: float | None
) -> tuple[float, float]:
    """Young's modulus [Pa] and Poisson's ratio of mu, alpha, beta of terms.

    Args:
        terms: One for each.
        bulk: Bulk modulus [Pa]; None: beta makes it.
    """
    shear = sum(mu for mu, _, _ in terms)
    if bulk is None:
        bulk = sum(2.0 * mu * (beta + 1.0 / 3.0) for mu, _, beta in terms)
    modulus = 9.0 * bulk * shear / (3.0 * bulk + shear)
    return modulus, (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear))
