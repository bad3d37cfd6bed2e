"""VTX and PVD files, which DOLFINx itself writes; it is loaded when they are asked for."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any


def write_functions(
    path: Path,
    kind: str,
    functions: Sequence[Any],
    times: Iterable[float],
    fill: Callable[[int], None],
) -> None:
    """Write functions of one rank's mesh layer by layer.

    Args:
        path: Target; ``.bp`` (a folder of ADIOS2) or ``.pvd`` (beside it a folder of .vtu files).
        kind: "vtx" or "pvd".
        functions: Functions of DOLFINx on a mesh of COMM_SELF.
        times: Time of each layer [s].
        fill: Puts the values of a layer into the functions.
    """
    # Our module first: it loads MPI before DOLFINx.
    from impactfem.fem import MPI  # noqa: PLC0415

    # isort: split
    from dolfinx.io import VTKFile, VTXWriter  # noqa: PLC0415

    comm = MPI.COMM_SELF
    if kind == "vtx":
        with VTXWriter(comm, path, list(functions)) as vtx:
            for layer, time in enumerate(times):
                fill(layer)
                vtx.write(float(time))
        return
    # One file per layer: they go into a folder of their own, the collection stays outside.
    parts = path.with_name(f"{path.stem}_pvd")
    parts.mkdir()
    with VTKFile(comm, parts / path.name, "w") as vtk:
        for layer, time in enumerate(times):
            fill(layer)
            vtk.write_function(list(functions), float(time))
    collection = (parts / path.name).read_text(encoding="utf-8")
    path.write_text(collection.replace('file="', f'file="{parts.name}/'), encoding="utf-8")
    (parts / path.name).unlink()
