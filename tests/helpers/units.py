"""A scene said in other units, by the units of the reference of keys."""

import copy
import re
from functools import cache

from impactfem.scene import describe

# Powers of kilogram, metre, second.
POWERS = {
    "kg": (1, 0, 0), "m": (0, 1, 0), "s": (0, 0, 1), "rad": (0, 0, 0), "1": (0, 0, 0),
    "N": (1, 1, -2), "Pa": (1, -1, -2), "J": (1, 2, -2), "": (0, 0, 0),
}  # fmt: skip
SLIDING = {"prismatic", "distance", "cylindrical"}  # joints whose coordinate is a length
RATES = {"rad/s": (0, 0, -1)}


@cache
def powers(unit):
    """Powers of a product of units such as "N m s/rad"."""
    over, _, under = unit.partition("/")
    total = [0, 0, 0]
    for words, sign in ((over, 1), (under.strip("()"), -1)):
        for word in words.split():
            name, _, power = word.partition("^")
            for k, each in enumerate(POWERS[name]):
                total[k] += sign * each * int(power or 1)
    return tuple(total)


class Units:
    """Units so many times as small as those of SI.

    Args:
        mass, length, time: How many of the new units are one of SI.
    """

    def __init__(self, mass, length, time):
        self._each = (mass, length, time)

    def factor(self, unit):
        """What a number in SI is multiplied by."""
        found = 1.0
        for base, power in zip(self._each, powers(unit), strict=True):
            found *= base**power
        return found

    def scene(self, data):
        """Tables of a scene in these units; raises ValueError for formulas with numbers."""
        self._data = copy.deepcopy(data)
        self._table(self._data, "top level")
        return self._data

    def _unit(self, row, table):
        unit = row.unit
        if " or " not in unit:
            return unit
        if row.key == "stiffness" and unit.startswith("N or Pa"):
            raise ValueError("stiffness of a contact")
        turning, sliding = unit.split(" or ")
        return sliding if table.get("kind") in SLIDING else turning

    def _table(self, table, name):
        for key, value in table.items():
            heading = (name, key)
            row = ROWS.get(heading)
            if row is None:
                raise ValueError(f"{heading} is not in the reference")
            table[key] = self._value(value, row, table)

    def _value(self, value, row, table):
        if isinstance(value, dict):
            self._table(value, self._heading(row, value))
            return value
        if isinstance(value, list) and value and isinstance(value[0], dict):
            for each in value:
                self._table(each, self._heading(row, each))
            return value
        if row.key == "gravity" and isinstance(value, list) and isinstance(value[0], list):
            return [self._gravity(entry) for entry in value]
        factor = self.factor(self._unit(row, table)) if row.unit else 1.0
        return _times(value, factor, row)

    def _gravity(self, entry):
        when, *pulls = entry
        g, t = self.factor("m/s^2"), self.factor("s")
        return [when * t, *[_times(pull, g, None) for pull in pulls]]

    def _heading(self, row, value):
        if row.key in {"solve", "output", "objective", "trajectory"}:
            return f"[{row.key}]"
        kind = value.get("kind")
        if row.key in {"body", "obstacle"}:
            return f'[[{row.key}]] with kind = "{kind}"'
        if row.key in {"contact", "joint", "probe"}:
            return f"[[{row.key}]]"
        options = [name for name, _ in ROWS if name.startswith(f"{row.key} = ")]
        for name in options:
            if kind and f'"{kind}"' in name:
                return name
        fitting = [n for n in dict.fromkeys(options) if all((n, k) in ROWS for k in value)]
        if not fitting:
            raise ValueError(f"no table of {row.key} in the reference has {sorted(value)}")
        return fitting[0]


ROWS = {(table.name, row.key): row for table in describe() for row in table.keys}


def _times(value, factor, row):
    if isinstance(value, list):
        return [_times(each, factor, row) for each in value]
    if isinstance(value, bool) or value is None or factor == 1.0:
        return value
    if isinstance(value, str):
        if re.fullmatch(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?", value):
            return float(value) * factor
        if row is not None and "formula" not in row.type:
            return value
        raise ValueError(f'{row.key} = "{value}" is a formula')
    return value * factor
