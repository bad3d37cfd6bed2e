"""Meshes built or read with Gmsh; boundaries are known by name."""
