"""Files of meshes and geometry that bodies name."""

from impactfem.reading.opening import MESHIO

MESHES = (".msh", *MESHIO)
"""Endings of files that hold elements."""

MESH_FILES = (".msh", ".geo", ".step", ".stp", *MESHIO)
"""Endings of files that make elements."""
