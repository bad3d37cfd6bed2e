"""Fields of a solid in the formats a user asks for."""

import shutil
from pathlib import Path

import numpy as np

from impactfem.result.cell_kinds import BY_VTK_TYPE, CellKind
from impactfem.result.dolfinx_files import write_functions
from impactfem.result.solid_fields import SolidFields


def write_solid(fields: SolidFields, path: Path, kind: str) -> None:
    """Write the fields to a file; one layer at a time is in memory.

    Args:
        fields: What to write.
        path: Target; ends in ``.vtkhdf``, ``.bp`` or ``.pvd``.
        kind: "vtkhdf", "vtx" or "pvd".
    """
    if kind == "vtkhdf":
        _place(fields, path)
    else:
        _write_with_dolfinx(fields, path, kind)


def needed_bytes(fields: SolidFields, kind: str) -> int:
    """Upper bound of what a format needs on disk.

    VTX stores mesh and fields with each layer in binary form; PVD as text, of up to 25 characters
    for a number.
    """
    if kind == "vtkhdf":
        return fields.path.stat().st_size
    values = 3 + 2 + sum(fields.point_data.values())  # the nodes, their numbers and marks
    nodes_of_cells = fields.num_cells * (len(_kind(fields).order) + 4)
    per_value, per_entry = (8, 8) if kind == "vtx" else (25, 12)
    layer = per_value * values * fields.num_points + per_entry * nodes_of_cells
    return 65_536 + len(fields) * (16_384 + layer)


def _kind(fields: SolidFields) -> CellKind:
    return BY_VTK_TYPE[fields.vtk_cell_type]


def _place(fields: SolidFields, path: Path) -> None:
    """Let the file appear at another place, without a copy where the spool is a passing one."""
    if fields.is_passing:
        try:
            path.hardlink_to(fields.path)
        except OSError:  # another disk, or one without links
            pass
        else:
            return
    shutil.copyfile(fields.path, path)


def _write_with_dolfinx(fields: SolidFields, path: Path, kind: str) -> None:
    """Through DOLFINx, on one rank, with functions of the degree of the mesh."""
    # Only when such output is wanted. Our module: it loads MPI before DOLFINx.
    from impactfem.fem import MPI, cell_nodes, dolfinx_fem, global_mesh, input_numbers  # noqa: PLC0415

    cell = _kind(fields)
    mesh = global_mesh(
        MPI.COMM_SELF,
        np.ascontiguousarray(fields.points[:, : cell.dim]),
        fields.cells[:, cell.order_of_dolfinx],
        cell.shape,
        cell.degree,
    )
    numbers = input_numbers(mesh)
    functions = []
    for name, components in fields.point_data.items():
        shape = () if components == 1 else ((components,),)
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
