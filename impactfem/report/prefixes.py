"""Prefixes of units: axes, charts and words show ms, µm or MN, chosen by what they show."""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.axis import Axis

_SMALL, _LARGE = 0.1, 1e4  # between which numbers have no prefix
_LETTERS = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_UNITS = {"m", "s", "N", "J", "Pa", "N s", "m/s", "m/m", "N/m", "kg", "kg m/s"}
_NEVER_LARGE = ("s", "kg", "kg m/s")  # nobody says kiloseconds or megagrams
_ROUNDING = 1e-9  # share of an axis below which a tick is at 0
_UNIT = re.compile(r"\[([^\]]+)\]")


@dataclass(frozen=True)
class Prefixed:
    """A unit with its prefix.

    Attributes:
        factor: Times a number in SI units gives one in this unit.
        unit: With the prefix.
    """

    factor: float
    unit: str

    def text(self, value: float, digits: int) -> str:
        """A number in this unit, given in SI units."""
        return f"{self.factor * value:.{digits}g} {self.unit}"

    def title(self, text: str) -> str:
        """A title with this unit in place of the one in its brackets."""
        return _UNIT.sub(f"[{self.unit}]", text, count=1)


def prefixed_unit(unit: str, *values: ArrayLike) -> Prefixed:
    """The prefix that suits numbers of a unit: the largest one is then from 1 to below 1000.

    Args:
        unit: Of SI, as columns and titles have it.
        values: Numbers; those that are not finite do not count.

    Returns:
        The unit alone where all are 0, where the largest is from 0.1 to below 10 000 (of seconds
        and kilograms: from 0.1), and for a unit that takes no prefix.
    """
    most = max((_largest(each) for each in values), default=0.0)
    large = np.inf if unit in _NEVER_LARGE else _LARGE
    if unit not in _UNITS or most == 0.0 or _SMALL <= most < large:
        return Prefixed(1.0, unit)
    if unit.startswith("k"):  # a kilogram has its prefix already
        unit, most, own = unit[1:], 1e3 * most, 1e3
    else:
        own = 1.0
    # A number that six digits round up to 1000 has the next prefix.
    power = 3 * int(np.floor(np.log10(most * (1.0 + 1e-6)) / 3.0))
    power = min(max(power, min(_LETTERS)), max(_LETTERS))
    return Prefixed(own * 10.0**-power, f"{_LETTERS[power]}{unit}")


def unit_of(title: str) -> str:
    """What the brackets of a title hold; empty without any."""
    found = _UNIT.search(title)
    return found[1] if found else ""


def prefix_ticks(axis: "Axis", title: str) -> None:
    """Give an axis of Matplotlib its title, and ticks in a unit with the prefix that suits them.

    Args:
        axis: Linear, of data in SI units, with its final limits; others get the title alone.
        title: With the unit of SI in brackets.
    """
    if axis.get_scale() != "linear":
        axis.set_label_text(title)
        return
    unit = prefixed_unit(unit_of(title), axis.get_view_interval())
    least = _ROUNDING * unit.factor * float(np.ptp(axis.get_view_interval()))

    def shown(value: float, _: float = 0.0) -> str:
        number = unit.factor * value
        return f"{0.0 if abs(number) < least else number:.10g}".replace("-", "\N{MINUS SIGN}")

    axis.set_major_formatter(shown)
    axis.set_label_text(unit.title(title))


def _largest(values: ArrayLike) -> float:
    sizes = np.abs(np.asarray(values, dtype=np.float64))
    return float(sizes.max(initial=0.0, where=np.isfinite(sizes)))
