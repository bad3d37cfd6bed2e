"""The own writer of netCDF files, held against xarray's, and data sets made when asked for."""

import numpy as np
import pytest
import xarray as xr

import impactfem
from impactfem.result.netcdf import read_netcdf, write_netcdf
from impactfem.result.table import Series, Table


def over(values, **attrs):
    return Series(("time",), values, attrs)


def table() -> Table:
    """Columns of several kinds, shapes and odd lengths."""
    made = Table.over_time(
        np.array([0.0, 0.5, 1.0]),
        {
            "gap": Series(
                ("time",), np.array([0.5, np.nan, -0.0]), {"units": "m", "long_name": "g"}
            ),
            "active": Series(
                ("time",), np.array([0, 1, 2], dtype=np.int32), {"comment": "\u2265 0"}
            ),
            "bar.x": Series(("time", "station"), np.arange(6.0).reshape(3, 2), {}),
            "way": over(np.ones(3), direction=np.array([0.6, 0.8]), n=3),
        },
    )
    made.coords["station"] = Series(("station",), np.array([0.0, 2.0]), {"units": "m"})
    return made


@pytest.mark.parametrize("as_stored", [False, True])
def test_the_file_reads_as_that_of_xarray(as_stored, tmp_path):
    write_netcdf(table(), tmp_path / "own.nc")
    table().dataset().to_netcdf(tmp_path / "theirs.nc", engine="scipy")
    own, theirs = (
        xr.load_dataset(tmp_path / name, engine="scipy", mask_and_scale=not as_stored)
        for name in ("own.nc", "theirs.nc")
    )
    xr.testing.assert_identical(own, theirs)
    assert list(own.data_vars) == list(table().data_vars)
    if not as_stored:
        xr.testing.assert_identical(own, table().dataset())


def test_what_is_missing_in_a_file_is_named(tmp_path):
    write_netcdf(table(), tmp_path / "own.nc")
    with pytest.raises(ValueError, match="contact_force and time are not all in it"):
        read_netcdf(tmp_path / "own.nc", frozenset({"time", "contact_force"}))


def test_there_and_back_nothing_changes():
    again = Table.of(table().dataset())
    assert again.sizes == {"time": 3, "station": 2}
    assert again["way"].attrs["direction"] is not None
    assert "gap" in again
    assert "force" not in again
    with pytest.raises(KeyError):
        again["force"]


def test_a_result_makes_data_sets_when_they_are_asked_for_and_keeps_changes():
    made = table()
    result = impactfem.Result(None, made, {"title": "t"}, exact=table())
    assert result.rows is made
    assert impactfem.Result(None, made, {"title": "t"}).exact is None
    assert result.history is result.history
    xr.testing.assert_identical(result.history, made.dataset())
    result.history["gap"][1] = 7.0
    result.history["more"] = ("time", np.zeros(3))
    assert result.rows["gap"].values[1] == 7.0
    assert "more" in result.with_summary({}).rows
    assert "more" not in result.exact_rows
    with pytest.raises(AttributeError, match="no attribute 'histories'"):
        _ = result.histories
