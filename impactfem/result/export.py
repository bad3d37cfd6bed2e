"""Fields in the formats a user asks for."""

from pathlib import Path

import numpy as np

from impactfem.result.cell_kinds import BY_VTK_TYPE, CellKind
from impactfem.result.dolfinx_files import write_functions
from impactfem.result.shapes import LINE, Layout
from impactfem.result.snapshots import Snapshots

_KINDS = {LINE: CellKind("interval", 1, LINE, (0, 1), ()), **BY_VTK_TYPE}


def write_fields(fields: Snapshots, path: Path, kind: str) -> None:
    """Write the fields to a file.

    Args:
        fields: What to write; formats but VTKHDF take cells of one kind.
        path: Target; ends in ``.vtkhdf``, ``.bp`` or ``.pvd``.
        kind: "vtkhdf", "vtx" or "pvd".
    """
    if kind == "vtkhdf":
        fields.write(path)
    else:
        _write_with_dolfinx(fields, path, kind)


def needed_bytes(fields: Snapshots, kind: str) -> int:
    """Upper bound of what a format needs on disk.

    VTX stores mesh and fields with each layer in binary form; PVD as text, of up to 25 characters
    for a number.
    """
    if kind == "vtkhdf":
        return fields.needed_bytes
    layout = fields.layout
    values = 3 + 2 + sum(fields.point_data.values())  # the nodes, their numbers and marks
    entries = len(layout.connectivity) + 4 * len(layout.types)
    per_value, per_entry = (8, 8) if kind == "vtx" else (25, 12)
    layer = per_value * values * len(layout.points) + per_entry * entries
    return 65_536 + len(fields) * (16_384 + layer)


def _write_with_dolfinx(fields: Snapshots, path: Path, kind: str) -> None:
    """Through DOLFINx, on one rank, with functions of the degree of the mesh."""
    # Only when such output is wanted. Our module: it loads MPI before DOLFINx.
    from impactfem.fem import MPI, cell_nodes, dolfinx_fem, global_mesh, input_numbers  # noqa: PLC0415

    layout = fields.layout
    ((vtk_type, cells),) = layout.blocks.items()
    cell = _KINDS[vtk_type]
    mesh = global_mesh(
        MPI.COMM_SELF,
        np.ascontiguousarray(layout.points[:, : _dim(layout, cell)]),
        cells[:, cell.order_of_dolfinx],
        cell.shape,
        cell.degree,
    )
    numbers = input_numbers(mesh)
    functions = []
    for name, components in fields.point_data.items():
        # DOLFINx pads what is neither a vector nor a tensor beyond its end.
        shape = {1: (), 3: ((3,),), 9: ((3, 3),)}[components]
        space = dolfinx_fem.functionspace(mesh, ("Lagrange", cell.degree, *shape))
        function = dolfinx_fem.Function(space)
        function.name = name
        functions.append(function)
    # Space and geometry have the same nodes in each cell, but number them differently.
    node_of = np.empty(len(numbers), dtype=np.int64)
    node_of[space.dofmap.list.ravel()] = numbers[cell_nodes(mesh).ravel()]

    def fill(layer: int) -> None:
        values = fields.read(layer)
        for function in functions:
            function.x.array[:] = values[function.name][node_of].ravel()

    write_functions(path, kind, functions, fields.times, fill)


def _dim(layout: Layout, cell: CellKind) -> int:
    """Coordinates that the nodes need."""
    used = np.flatnonzero(layout.points.any(axis=0))
    return max(cell.dim, int(used[-1]) + 1 if len(used) else 1)
