"""Files of netCDF 3, which xarray reads without further libraries, written without any.

Format: NetCDF Users Guide, "File Format Specifications", classic format with 64-bit offsets.
"""

from collections.abc import Mapping
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from impactfem.result.table import Series, Table

if TYPE_CHECKING:
    import xarray as xr

_MAGIC, _DIMENSIONS, _VARIABLES, _ATTRIBUTES = b"CDF\x02", 10, 11, 12
_TEXT, _INTEGER, _REAL = 2, 4, 6
_MOST = 2**32 - 1  # size that is noted of what is larger


def write_netcdf(table: Table, path: Path) -> None:
    """Write columns and coordinates as xarray does: a missing value of real numbers is NaN.

    Args:
        table: Whole numbers of 32 bits and real ones; what is not real is taken for whole.
        path: Target.
    """
    every = {**table.data_vars, **table.coords}
    values = {name: _big_endian(one.values) for name, one in every.items()}
    dimensions = list(table.sizes.items())
    number = {name: _int(k) for k, (name, _) in enumerate(dimensions)}
    heads = [
        _text(name)
        + _list_of(number[dim] for dim in one.dims)
        + _attributes(_with_missing(one))
        + _kind(values[name])
        + _int(min(_padded(values[name].nbytes), _MOST))
        for name, one in every.items()
    ]
    lengths = [_text(name) + _int(size) for name, size in dimensions]
    start = _MAGIC + _int(0) + _tagged(_DIMENSIONS, lengths) + _attributes({})
    # Each head ends with the 8 bytes that tell where its values begin.
    first = len(start) + len(_tagged(_VARIABLES, heads)) + 8 * len(heads)
    begins = accumulate((_padded(one.nbytes) for one in values.values()), initial=first)
    with path.open("wb") as file:
        file.write(start)
        told = (head + begin.to_bytes(8) for head, begin in zip(heads, begins, strict=False))
        file.write(_tagged(_VARIABLES, list(told)))
        for one in values.values():
            file.write(one.tobytes())
            file.write(bytes(_padded(one.nbytes) - one.nbytes))


def read_netcdf(path: Path, needed: frozenset[str]) -> "xr.Dataset":
    """Read a file back into memory.

    Raises:
        ValueError: What is needed is not in it; further errors are those of xarray and SciPy.
    """
    import xarray as xr  # noqa: PLC0415

    with xr.open_dataset(path, engine="scipy") as data:
        if not needed <= set(data.variables):
            raise ValueError(f"{path}: {' and '.join(sorted(needed))} are not all in it")
        return data.load()


def _with_missing(one: Series) -> dict[str, Any]:
    return one.attrs | ({"_FillValue": np.nan} if one.values.dtype.kind == "f" else {})


def _attributes(attributes: Mapping[str, Any]) -> bytes:
    found = []
    for name, value in attributes.items():
        if isinstance(value, str):
            data = value.encode()
            found.append(_text(name) + _int(_TEXT) + _int(len(data)) + _filled(data))
        else:
            numbers = _big_endian(np.atleast_1d(np.asarray(value)))
            found.append(
                _text(name) + _kind(numbers) + _int(numbers.size) + _filled(numbers.tobytes())
            )
    return _tagged(_ATTRIBUTES, found)


def _big_endian(values: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(values, dtype=">f8" if values.dtype.kind == "f" else ">i4")


def _kind(values: NDArray[Any]) -> bytes:
    return _int(_REAL if values.dtype.kind == "f" else _INTEGER)


def _tagged(tag: int, items: list[bytes]) -> bytes:
    return _int(tag if items else 0) + _list_of(items)


def _list_of(items: Any) -> bytes:
    every = list(items)
    return _int(len(every)) + b"".join(every)


def _text(text: str) -> bytes:
    data = text.encode("ascii")  # readers differ on other letters in names
    return _int(len(data)) + _filled(data)


def _int(number: int) -> bytes:
    return number.to_bytes(4)


def _padded(size: int) -> int:
    return -(-size // 4) * 4


def _filled(data: bytes) -> bytes:
    return data + bytes(_padded(len(data)) - len(data))
