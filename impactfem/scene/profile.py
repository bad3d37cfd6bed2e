"""How mass and the time that waves take are distributed along a bar that is not uniform.

With xi(x), the time that waves take from the near end to x, the equation of a bar of density rho,
modulus E and area A, (E A u_x)_x = rho A u_tt, becomes (Z u_xi)_xi = Z u_tt: one speed, and the
impedance Z = A sqrt(rho E) as the only coefficient. Elements of equal travel times then have one
weight each, and waves run from node to node in them whatever rho, E and A are (the layered medium
of P. Goupillaud, An approach to inverse filtering of near-surface layer effects, 1961).
"""

from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.breaks import find_breaks
from impactfem.scene.formula import Formula

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_SHARES = 0.5 * (1.0 + _POINTS)
_PARTS = 256  # of the table that is inverted
_NEWTON = 20  # steps at most: speeds that are constant in a part need one


def _along(text: str, parts: dict[str, Formula]) -> Formula:
    """A formula of properties as one in t, which the means of formulas are taken in."""
    place = Formula("t", ("t",))
    known = {name: part.composed(x=place) for name, part in parts.items()}
    return Formula(text, tuple(known)).composed(**known)


@dataclass(frozen=True)
class Profile:
    """Mass and travel time along a bar.

    Attributes:
        mass_rate: rho A [kg/m], in the place that formulas call t.
        slowness: sqrt(rho / E) [s/m], likewise.
        moment_rate: rho A x [kg], likewise.
        edges: Borders of parts in which the slowness is smooth [m].
        times: Travel times to them [s].
        breaks: Where density, modulus or area jump or bend, both sides of each [m].
        length: L [m].
        mass: Of the bar [kg].
        center: Its centre of mass [m].
    """

    mass_rate: Formula
    slowness: Formula
    moment_rate: Formula
    edges: Floats
    times: Floats
    breaks: Floats
    length: float
    mass: float
    center: float

    @classmethod
    def of(cls, length: float, density: Formula, modulus: Formula, area: Formula) -> "Profile":
        """Of properties by formulas in x [m]."""
        known = {"density": density, "modulus": modulus, "area": area}
        mass_rate = _along("density*area", known)
        slowness = _along("sqrt(density/modulus)", known)
        moment = _along("density*area*x", known | {"x": Formula("x")})
        found = {at for f in (mass_rate, slowness) for at in find_breaks(f, length)}
        breaks = np.array(sorted({*(at.before for at in found), *(at.after for at in found)}))
        breaks = breaks[(breaks > 0.0) & (breaks < length)]
        edges = np.union1d(np.linspace(0.0, length, _PARTS + 1), breaks)
        times = np.concatenate([[0.0], np.cumsum(_integrals(slowness, edges, breaks))])
        mass = float(_integrals(mass_rate, edges, breaks).sum())
        center = float(_integrals(moment, edges, breaks).sum()) / mass
        return cls(mass_rate, slowness, moment, edges, times, breaks, length, mass, center)

    @property
    def transit_time(self) -> float:
        """Time that a wave needs from one end to the other [s]."""
        return float(self.times[-1])

    def travel(self, x: Floats) -> Floats:
        """Travel time to places, as a share of the transit time times the length [m]."""
        part = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.times) - 2)
        times = self.times[part] + self._since(self.edges[part], x)
        return np.asarray(self.length / self.transit_time * times)

    def places(self, travel: Floats) -> Floats:
        """Places [m] to which waves have these travel times, the inverse of `travel`."""
        if "t" not in self.slowness.used:
            return travel
        times = self.transit_time / self.length * travel
        part = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        low, high = self.edges[part], self.edges[part + 1]
        share = (times - self.times[part]) / (self.times[part + 1] - self.times[part])
        x = low + share * (high - low)
        for _ in range(_NEWTON):
            off = self.times[part] + self._since(low, x) - times
            x = np.clip(x - off / self.slowness(t=x), low, high)
            if np.abs(off).max() <= 4e-16 * self.transit_time:
                break
        x[travel == 0.0], x[travel == self.length] = 0.0, self.length
        return np.asarray(x)

    def weights(self, travel: Floats) -> Floats:
        """Impedance of each element, its mass over its travel time, over their mean M / T.

        Args:
            travel: Nodes, (elements + 1,).
        """
        x = self.places(travel)
        mass = _integrals(self.mass_rate, x, self.breaks)
        return np.asarray(mass / mass.sum() * self.length / np.diff(travel))

    def moments(self, travel: Floats) -> Floats:
        """First moment of the mass of each element about the near end [kg m], as `weights`."""
        return _integrals(self.moment_rate, self.places(travel), self.breaks)

    def jumps(self) -> Floats:
        """Shares of the transit time at which the impedance jumps or bends."""
        return np.asarray(self.travel(self.breaks) / self.length)

    def _since(self, low: Floats, x: Floats) -> Floats:
        """Travel times from one place to another in the same part."""
        values = self.slowness(t=low[:, None] + (x - low)[:, None] * _SHARES)
        values = values + np.zeros((len(x), len(_SHARES)))
        return np.asarray((x - low) * (values @ (0.5 * _WEIGHTS)))


def _integrals(formula: Formula, x: Floats, breaks: Floats) -> Floats:
    """Integrals between places in order, cut at breaks, (places - 1,)."""
    grid = np.union1d(x, breaks[(breaks > x[0]) & (breaks < x[-1])])
    low, width = grid[:-1], np.diff(grid)
    values = formula(t=low[:, None] + width[:, None] * _SHARES)
    parts = width * ((values + np.zeros((len(low), len(_SHARES)))) @ (0.5 * _WEIGHTS))
    return np.bincount(np.searchsorted(x, low, side="right") - 1, parts, len(x) - 1)
