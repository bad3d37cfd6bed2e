"""Files of meshes and geometry that bodies name."""

from typing import Any

from impactfem.reading.opening import MESHIO, STEP
from impactfem.scene.schema import KeyedError
from impactfem.scene.values import show

MESHES = (".msh", *MESHIO)
"""Endings of files that hold elements."""

MESH_FILES = (".msh", ".geo", ".step", ".stp", *MESHIO)
"""Endings of files that make elements."""

PART = "part of a STEP file: its name, or that of an assembly in it"


def check_part(body: Any) -> None:
    """Refuse a part of what is no STEP file.

    Raises:
        KeyedError: naming the key.
    """
    if body.part is not None and not (body.mesh or "").lower().endswith(STEP):
        text = f" = {show(body.part)}: only a STEP file has parts; remove it, or give mesh = one."
        raise KeyedError(body.kind, "part", text)
