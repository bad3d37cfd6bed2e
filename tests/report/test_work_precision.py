"""Work-precision studies: what they measure, compare and write."""

import csv
import io

import numpy as np
import pytest

import impactfem
from impactfem.reference.bar import exact_bar, exact_motion
from impactfem.reference.rounding import rounding_of_exact
from impactfem.shipped import find_scene
from impactfem.studies.precision import Variant
from impactfem.studies.study import LOST, Row, Study

pytestmark = pytest.mark.slow


def thrown(gap=0.5 + 2**0.5 / 100):
    return impactfem.Scene.from_toml(find_scene("bar_impact")).with_settings({"body.bar.gap": gap})


@pytest.fixture(scope="module")
def study():
    methods = ["galerkin", "conserving@courant=0.5", "exact@elements=4"]
    return impactfem.studies.work_precision(thrown(), methods, [10, 20, 40], 1)


def test_rows_hold_errors_and_costs(study):
    assert [row.elements for row in study.rows] == [10, 20, 40, 10, 20, 40, 4]
    for row in study.rows:
        assert row.status == "completed"
        assert 0.0 < row.seconds <= row.total
    direct = impactfem.solve(thrown(), method="galerkin", elements=20).summary
    row = study.rows[1]
    assert row.displacement_max == pytest.approx(direct["error"]["displacement_max"], rel=1e-12)
    assert row.force_l1 == pytest.approx(direct["error"]["force_l1"], rel=1e-12)
    assert row.unknowns == direct["num_dofs"]


def test_observed_order_is_the_slope_in_a_logarithmic_picture(study):
    rows = [r for r in study.rows if r.method == "conserving@courant=0.5"]
    sizes, errors = [r.elements for r in rows], [r.displacement_l2 for r in rows]
    slope = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert study.orders()["conserving@courant=0.5"]["displacement_l2"] == pytest.approx(slope)
    assert 0.8 < slope < 1.2  # first order: the impact lies between layers
    assert study.orders()["exact@elements=4"]["displacement_l2"] is None


def test_exact_is_shown_at_its_rounding_level_and_not_at_zero(study):
    row = study.rows[-1]
    assert "rounding level" in row.note
    assert row.displacement_max <= 1e-12
    assert row.force_l1 <= 1e-12


def test_rounding_check_notices_a_wrong_solution(monkeypatch):
    """The second solution is not the first one read twice."""
    scene = thrown()
    other = exact_bar(scene.with_settings({"body.bar.gap": 0.52}))
    monkeypatch.setattr("impactfem.reference.rounding.exact_bar", lambda _: other)
    assert rounding_of_exact(scene).displacement_max > 1e-3


def test_baselines_are_measured_in_the_same_way():
    def perfect(scene, elements):
        bar, times = scene.bodies[0], np.linspace(0.0, scene.duration, 50 * elements + 1)
        positions = np.linspace(0.0, bar.length, elements + 1)
        exact = exact_bar(scene)
        return exact_motion(exact, bar, scene.gravity, times, positions, 1), 0.25

    found = impactfem.studies.work_precision(thrown(), [], [4], 1, baselines={"peer": perfect})
    (row,) = found.rows
    assert row.seconds == 0.25
    assert row.displacement_max <= 1e-14
    assert found.baselines == ("peer",)


def test_methods_that_fail_are_rows_that_say_why():
    found = impactfem.studies.work_precision(thrown(), ["galerkin@courant=2"], [10], 1)
    (row,) = found.rows
    assert row.status == "failed"
    assert "stability limit" in row.note
    assert row.displacement_max is None
    assert "failed: " in found.markdown()


@pytest.mark.parametrize(
    ("methods", "sizes", "message"),
    [
        (["galerkine"], [10], "unknown"),
        (["galerkin@courant"], [10], "courant"),
        (["galerkin"], [], "sizes"),
        (["galerkin"], [0], "sizes"),
        ([], [10], "methods"),
    ],
)
def test_wrong_arguments_are_named(methods, sizes, message):
    with pytest.raises(impactfem.SceneError, match=message):
        impactfem.studies.work_precision(thrown(), methods, sizes, 1)


def test_commas_between_settings_do_not_split_methods():
    names = Variant.split("galerkin@courant=0.5,dg@degree=1,fitted=true, exact")
    assert names == ["galerkin@courant=0.5", "dg@degree=1,fitted=true", "exact"]
    assert Variant.parse(names[1]).settings == {"degree": 1, "fitted": True}


def rows(name, *points):
    return tuple(
        Row(name, n, "completed", e, e, e, 0.0, t, t, 1) for n, (e, t) in enumerate(points, 1)
    )


def test_comparison_takes_the_fastest_row_that_is_no_less_accurate():
    study = Study(
        "made up",
        rows("ours", (1e-1, 1.0), (1e-3, 3.0))
        + rows("peer", (2 * LOST, 0.1), (1e-1, 10.0), (1e-2, 30.0), (1e-4, 60.0)),
        1,
        ("peer",),
    )
    found = study.compare(["ours"], "peer", "force_l1")
    assert [c.speedup for c in found] == [10.0, 10.0, None]
    assert [c.ours and c.ours.elements for c in found] == [1, 2, None]


def test_tables_and_picture_are_written(study, tmp_path):
    paths = study.save(tmp_path / "new", "k1")
    assert [path.name for path in paths] == ["k1.csv", "k1.md", "k1.png"]
    table = list(csv.DictReader(io.StringIO(paths[0].read_text())))
    assert [int(row["elements"]) for row in table] == [row.elements for row in study.rows]
    assert float(table[0]["force_l1"]) == study.rows[0].force_l1
    text = paths[1].read_text()
    assert "Measured on 20" in text
    assert "numba" in text
    assert paths[2].read_bytes().startswith(b"\x89PNG")


def test_a_folder_that_cannot_be_written_is_named(study, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(impactfem.errors.OutputError, match="file"):
        study.save(tmp_path / "file")
