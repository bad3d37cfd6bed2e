"""Exact solutions: they need no finite elements and measure the error of those that do."""

from impactfem.exact import vibro
from impactfem.exact.bar import ExactBar
from impactfem.exact.bar_row import ExactBarRow
from impactfem.exact.row_bar import RowBar

__all__ = ["ExactBar", "ExactBarRow", "RowBar", "vibro"]
