"""Planes of symmetry that cut a solid: joints hold the part of a surface that is left as its whole.

What lies on all of the planes is one thing in the whole. Its region is chosen on the unfolded
surface, and rows of nodes and of their images are folded: with S the reflection of an image, its
displacement is S u, so that a row r of it is r S of the node. Of a velocity what is across a plane
cancels, of a spin all but what is about the axis across.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain, combinations

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers

_ON = 1e-9  # share of the size of a body within which a node lies on a plane


@dataclass(frozen=True)
class Cuts:
    """Planes across axes, none of a body that is modelled whole.

    Attributes:
        planes: Number of the axis of each, and its coordinate [m].
    """

    planes: tuple[tuple[int, float], ...] = ()

    def _images(self) -> Iterator[tuple[tuple[int, float], ...]]:
        """By which planes each image is reflected, first the part itself."""
        counts = range(len(self.planes) + 1)
        return chain.from_iterable(combinations(self.planes, count) for count in counts)

    def unfolded(self, points: Floats) -> Floats:
        """Places of nodes (nodes, dim) and of their images [m], (images nodes, dim)."""
        each = []
        for image in self._images():
            own = points.copy()
            for axis, level in image:
                own[:, axis] = 2.0 * level - own[:, axis]
            each.append(own)
        return np.concatenate(each)

    def numbers(self, points: Floats) -> Integers:
        """Numbers of all images among the unfolded nodes, (images, nodes).

        A node on a plane is its own image.
        """
        images = list(self._images())
        on = self.on(points)
        found = np.zeros((len(images), len(points)), dtype=np.int64)
        for own, image in zip(found, images, strict=True):
            for node in range(len(points)):
                off = tuple(plane for plane in image if not on[node, plane[0]])
                own[node] = images.index(off) * len(points) + node
        return found

    def on(self, points: Floats) -> Booleans:
        """Across which axes nodes lie on a plane, (nodes, dim)."""
        found = np.zeros(points.shape, dtype=bool)
        size = float(np.abs(np.ptp(points, axis=0)).max(initial=0.0))
        for axis, level in self.planes:
            found[:, axis] = np.abs(points[:, axis] - level) <= _ON * size
        return found

    def folded(self, rows: Floats) -> Floats:
        """Velocity and spin by nodes, of rows by unfolded nodes, (6, nodes, dim)."""
        images = list(self._images())
        each = rows.reshape(6, len(images), -1, rows.shape[-1]).copy()
        for k, image in enumerate(images):
            for axis, _ in image:
                each[:, k, :, axis] *= -1.0
        found: Floats = each.sum(axis=1)
        for axis, _ in self.planes:  # to the bit, so that rows are left out
            found[axis] = 0.0
            found[[3 + turn for turn in range(3) if turn != axis]] = 0.0
        return found


WHOLE = Cuts()
"""Of a body that is modelled whole."""
