"""Polygons and lines that lie upon each other in one collection of Matplotlib."""

from collections.abc import Sequence

import numpy as np
from matplotlib.collections import PolyCollection
from numpy.typing import ArrayLike

from impactfem.arrays import Floats


class Pile:
    """Polygons and lines, each with its colours, from the back to the front."""

    def __init__(self) -> None:
        """An empty pile."""
        self._polygons: list[Floats] = []
        self._fills, self._edges = [np.empty((0, 4))], [np.empty((0, 4))]
        self._widths, self._near = [np.empty(0)], [np.empty(0)]

    def __len__(self) -> int:
        return len(self._polygons)

    def add(
        self,
        polygons: Sequence[Floats] | Floats,
        fills: ArrayLike,
        near: ArrayLike = 0.0,
        edges: ArrayLike | None = None,
        width: float = 0.5,
    ) -> None:
        """Lay polygons on the pile.

        Args:
            polygons: Corners in the picture, (corners, 2) each; two of a line.
            fills: Red, green and blue, of all or of each.
            near: How near to the viewer they are: those of equal numbers lie as they came.
            edges: Colours of the edges and lines; those of the polygons if None.
            width: Of these [pt].
        """
        count = len(polygons)
        self._polygons.extend(polygons)
        self._fills.append(_opaque(fills, count))
        self._edges.append(_opaque(fills if edges is None else edges, count))
        self._widths.append(np.full(count, width))
        self._near.append(np.broadcast_to(np.asarray(near, dtype=np.float64), count))

    def collection(self, zorder: float) -> PolyCollection:
        """All of it, from the back to the front."""
        order = np.argsort(np.concatenate(self._near), kind="stable")
        return PolyCollection(
            [self._polygons[k] for k in order],
            facecolors=np.concatenate(self._fills)[order],
            edgecolors=np.concatenate(self._edges)[order],
            linewidths=np.concatenate(self._widths)[order],
            capstyle="round", zorder=zorder, rasterized=True,
        )  # fmt: skip


def _opaque(colours: ArrayLike, count: int) -> Floats:
    found = np.ones((count, 4))
    found[:, :3] = colours
    return found
