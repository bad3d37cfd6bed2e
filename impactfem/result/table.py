"""Columns over time with their units, as runs and pictures use them: no xarray is loaded for it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # it takes a quarter of a second, with pandas behind it
    import xarray as xr


@dataclass(frozen=True)
class Series:
    """One column.

    Attributes:
        dims: Names of the axes of the values.
        values: As many axes as ``dims``.
        attrs: Unit, name and meaning; may be added to.
    """

    dims: tuple[str, ...]
    values: NDArray[Any]
    attrs: dict[str, Any] = field(default_factory=dict)


class Table:
    """Columns and their coordinates: what is needed of a data set of xarray, under its names.

    Attributes:
        data_vars: The columns by name.
        coords: The coordinates by name.
    """

    def __init__(self, data_vars: Mapping[str, Series], coords: Mapping[str, Series]) -> None:
        self.data_vars, self.coords = dict(data_vars), dict(coords)

    @classmethod
    def over_time(cls, times: NDArray[np.float64], columns: Mapping[str, Series]) -> "Table":
        """Columns over the coordinate ``time`` [s]."""
        return cls(columns, {"time": Series(("time",), times, {"units": "s", "long_name": "time"})})

    @classmethod
    def of(cls, data: "Table | xr.Dataset") -> "Table":
        """The same as a table, which shares the arrays."""
        if isinstance(data, cls):
            return data
        parts = (
            {
                str(name): Series(tuple(map(str, one.dims)), one.values, one.attrs)
                for name, one in group.items()
            }
            for group in (data.data_vars, data.coords)
        )
        return cls(*parts)

    def dataset(self) -> "xr.Dataset":
        """The same as a data set of xarray."""
        import xarray as xr  # noqa: PLC0415

        groups = (
            {name: (one.dims, one.values, one.attrs) for name, one in group.items()}
            for group in (self.data_vars, self.coords)
        )
        columns, coords = groups
        return xr.Dataset(columns, coords=coords)

    def first(self, rows: int) -> "Table":
        """The same up to a row, as of slices."""
        groups = (
            {n: Series(one.dims, one.values[:rows], one.attrs) for n, one in group.items()}
            for group in (self.data_vars, self.coords)
        )
        return Table(*groups)

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each axis."""
        found: dict[str, int] = {}
        for one in (*self.data_vars.values(), *self.coords.values()):
            found.update(zip(one.dims, one.values.shape, strict=True))
        return found

    def get(self, name: str) -> Series | None:
        """A column or coordinate; None if there is none of this name."""
        return self.data_vars.get(name) or self.coords.get(name)

    def items(self) -> Iterator[tuple[str, Series]]:
        """The columns, without the coordinates."""
        yield from self.data_vars.items()

    def __getitem__(self, name: str) -> Series:
        found = self.get(name)
        if found is None:
            raise KeyError(name)
        return found

    def __setitem__(self, name: str, column: Series) -> None:
        self.data_vars[name] = column

    def __contains__(self, name: str) -> bool:
        return self.get(name) is not None
