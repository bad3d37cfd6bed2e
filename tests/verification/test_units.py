"""The same scene in other units: the same numbers to rounding, and the same word on them."""

import tomllib

import numpy as np
import pytest
from units import Units

from impactfem import Scene, plan, solve
from impactfem.errors import SceneError
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
    word = result.summary["method"], verdict["level"], codes
    return result.history, word, [f["text"] for f in verdict["findings"]]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_other_units_change_neither_numbers_nor_verdict(name):
    text = (shipped_scenes() | starters())[name].read_text(encoding="utf-8")
    data = Scene.from_dict(tomllib.loads(text)).to_dict() | {"output": {"fields": []}}
    data.pop("probe", None)
    foreseen = plan(Scene.from_dict(data)).seconds or CHEAP
    data["duration"] *= min(1.0, CHEAP / foreseen)
    expected, word, _ = run(data)
    for units in UNITS:
        found, other, said = run(units.scene(data))
        assert other == word, said
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


BLOCK = {"kind": "rigid", "mass": 1.0, "shape": {"kind": "block", "size": [1, 1], "corner": [0, 0]}}
DISC = {"kind": "rigid", "name": "b", "mass": 1.0}
DISC |= {"shape": {"kind": "disc", "radius": 0.2, "center": [3.0, 2.0]}}
BEAM = {"kind": "beam", "length": 1.0, "height": 0.05, "width": 0.05, "density": 1000.0}
LYING = {
    "point": [{"kind": "point", "mass": 1.0, "radius": 0.1, "position": [0.0, 0.1]}],
    "rod": [{"kind": "rod", "mass": 1.0, "length": 1.0, "center": [0.0, 0.0]}],
    "beam": [BEAM | {"youngs_modulus": 1e9, "center": [0.0, 0.0]}],
    "rigid": [BLOCK],
    "two": [BLOCK, DISC],
}


@pytest.mark.parametrize("metre", [1.0, 2.0**-30, 2.0**30])
@pytest.mark.parametrize("name", LYING)
def test_a_body_inside_another_is_refused_in_any_unit(name, metre):
    def lying(depth):
        floor = {"kind": "half_space", "name": "floor", "normal": [0.0, 1.0]}
        bodies = [{"name": "a"} | body for body in LYING[name]]
        data = {"title": "lying", "duration": 1.0, "gravity": [0.0, -1.0], "body": bodies,
                "obstacle": [floor | {"point": [0.0, depth]}],
                "contact": [{"between": ["a", "floor"], "restitution": 0.5}]}  # fmt: skip
        return Scene.from_dict(Units(1.0, metre, 1.0).scene(data))

    plan(lying(0.0))
    with pytest.raises(SceneError, match=r"a.* on floor: .* at t = 0; move"):
        solve(lying(1e-6))
