"""Scenes: what is modelled and how, read from TOML or made in Python; no finite elements."""

from impactfem.scene.bodies import Bar
from impactfem.scene.formula import Formula
from impactfem.scene.loads import PiecewiseConstant
from impactfem.scene.obstacles import Wall
from impactfem.scene.scene import Scene
from impactfem.scene.schema import describe
from impactfem.scene.settings import Output, Solve
from impactfem.scene.toml import parse_assignment

__all__ = [
    "Bar",
    "Formula",
    "Output",
    "PiecewiseConstant",
    "Scene",
    "Solve",
    "Wall",
    "describe",
    "parse_assignment",
]
