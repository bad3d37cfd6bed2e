"""The same scene in other units: the same numbers to rounding, and the same word on them."""

import tomllib

import numpy as np
import pytest
from units import Units

from impactfem import Scene, plan, solve
from impactfem.shipped import shipped_scenes
from impactfem.starting import starters

# Powers of 2 keep every digit, so that what differs is a length, time or mass in the code.
UNITS = [Units(2.0**3, 2.0**10, 2.0**5), Units(2.0**20, 2.0**-9, 2.0**-12)]
SCENES = [
    "bar_impact", "gravity_impact", "two_bars", "bar_row", "bouncing_ball", "cradle", "rod",
    "dropped_disc", "colliding_discs", "sliding_block", "hammer_bar", "mixed",
]  # fmt: skip
CHEAP = 0.2  # seconds: of longer runs the beginning


def run(data):
    result = solve(Scene.from_dict(data))
    verdict = result.summary["verdict"]
    codes = sorted((f["code"], f["severity"]) for f in verdict["findings"])
    return result.history, (result.summary["method"], verdict["level"], codes)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_other_units_change_neither_numbers_nor_verdict(name):
    text = (shipped_scenes() | starters())[name].read_text(encoding="utf-8")
    data = Scene.from_dict(tomllib.loads(text)).to_dict() | {"output": {"fields": []}}
    data.pop("probe", None)
    foreseen = plan(Scene.from_dict(data)).seconds or CHEAP
    data["duration"] *= min(1.0, CHEAP / foreseen)
    expected, word = run(data)
    for units in UNITS:
        found, other = run(units.scene(data))
        assert other == word
        assert list(found) == list(expected)
        scales = {}  # vectors share the size of their largest entry
        for column, series in expected.items():
            of = column.rpartition(".")[0], series.attrs["units"]
            size = np.abs(np.nan_to_num(series.values, posinf=0.0)).max(initial=0.0)
            scales[of] = max(scales.get(of, 0.0), size)
        for column, series in expected.items():
            unit = series.attrs["units"]
            values = found[column].values / units.factor(unit)
            error = np.abs(np.nan_to_num(values - series.values))
            size = scales[column.rpartition(".")[0], unit]
            assert error.max(initial=0.0) <= 1e-9 * size, column
