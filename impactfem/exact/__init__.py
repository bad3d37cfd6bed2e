"""Exact solutions: they need no finite elements and measure the error of those that do."""

from impactfem.exact import vibro
from impactfem.exact.bar import ExactBar

__all__ = ["ExactBar", "vibro"]
