"""Two results side by side: what differs, by how much, and when they count as the same."""

import numpy as np
import pytest

import impactfem
from impactfem.errors import OutputError
from impactfem.result.compare import compare_histories
from impactfem.result.table import Series, Table


def table(times, **columns):
    units = {"gap": "m", "total_energy": "J", "dissipated_energy": "J"}
    return Table.over_time(
        np.asarray(times, dtype=float),
        {
            name.replace("_x", ".x"): Series(
                ("time",), np.asarray(values, dtype=float), {"units": units.get(name, "m")}
            )
            for name, values in columns.items()
        },
    )


def test_differences_are_relative_to_the_columns_of_the_same_unit_and_body():
    one = table([0, 1, 2], total_energy=[4, 4, 4], dissipated_energy=[0, 1e-9, 0], a_x=[2, 3, 4])
    other = table([0, 1, 2], total_energy=[4, 4, 4], dissipated_energy=[0, 0, 0], a_x=[2, 3, 4.5])
    found = compare_histories(one, other)
    assert [column.name for column in found.columns] == ["a.x", "dissipated_energy", "total_energy"]
    assert found.columns[0].absolute == 0.5
    assert found.columns[0].relative == pytest.approx(0.5 / 4.5)
    assert found.columns[0].time == 2.0
    assert found.columns[1].relative == pytest.approx(1e-9 / 4)
    assert not found.interpolated
    assert found.within(0.2)
    assert not found.within(0.1)


def test_a_value_that_is_none_differs_from_one_and_not_from_none():
    none = table([0, 1], gap=[np.nan, 1])
    assert compare_histories(none, none).worst == 0.0
    assert compare_histories(none, table([0, 1], gap=[0.5, 1])).worst == np.inf


def test_other_times_are_interpolated_and_other_ends_are_not_the_same():
    fine = table(np.linspace(0, 2, 9), gap=np.linspace(0, 4, 9), b_x=np.zeros(9))
    coarse = table([0, 1, 2], gap=[0, 2, 4], c_x=np.zeros(3))
    found = compare_histories(fine, coarse)
    assert found.interpolated
    assert found.within(1e-15)
    assert (found.only_first, found.only_second) == (("b.x",), ("c.x",))
    half = table([0, 0.25, 0.5], gap=[0, 0.5, 1])
    assert compare_histories(fine, half).worst == 0.0
    assert compare_histories(fine, half).until == 0.5
    assert not compare_histories(fine, half).within(1.0)


def point(**more):
    tables = {
        "title": "p", "duration": 1.0, "gravity": [0.0, -9.81],
        "body": [{"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 0.5]}],
        "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                      "normal": [0.0, 1.0]}],
    }  # fmt: skip
    return impactfem.Scene.from_dict(tables | more)


def test_the_same_scene_said_two_ways(tmp_path):
    plain = impactfem.solve(point())
    said = impactfem.solve(point(contact=[{"between": ["ball", "floor"]}]))
    named = impactfem.solve(point(contact=[{"between": ["ball", "floor"], "name": "hit"}]))
    assert impactfem.compare(plain, said).worst == 0.0
    folder = said.save(tmp_path / "said", pictures=False)
    found = impactfem.compare(folder, named)
    assert found.worst == 0.0
    assert found.only_second == ("force.hit", "gap.hit", "impulse.hit")
    with pytest.raises(OutputError, match="no complete result"):
        impactfem.compare(plain, tmp_path / "absent")
