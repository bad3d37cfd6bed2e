"""True stress at a place of a body under finite strain, of the displacements around it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.forms.finite_strain import Law, Moduli

_ORDER = {2: ("xx", "yy", "xy", "zz"), 3: ("xx", "yy", "zz", "xy", "yz", "xz")}


@dataclass(frozen=True)
class TrueStress:
    """Cauchy's stress of a law by the displacement gradient at a place.

    Attributes:
        slopes: Gradients of the shape functions there [1/m], shape (nodes, dim).
        hoop: Weights of the hoop strain [1/m], shape (nodes,); 0 but for axisymmetric bodies.
        law: Of the material.
        moduli: What the law takes.
        cell: Of nearly incompressible bodies, whose lambda' is asked of the mean of J in the cell:
            slopes, weights of the hoop strain and volumes at points of it, (points, ...); else
            None.
    """

    slopes: Floats
    hoop: Floats
    law: type[Law]
    moduli: Moduli
    cell: tuple[Floats, Floats, Floats] | None = None

    @property
    def weights(self) -> dict[str, Floats]:
        """What has to be kept of each layer: every displacement by itself, (nodes, dim) each."""
        count = self.slopes.size
        unit = np.eye(count).reshape(count, *self.slopes.shape)
        return {f"u{k}": each for k, each in enumerate(unit)}

    def of(self, kept: Any) -> dict[str, Floats]:
        """Components [Pa] by what `weights` has kept, shape (rows,) each."""
        dim = self.slopes.shape[1]
        moved = np.stack([kept[name] for name in self.weights], axis=1)
        moved = moved.reshape(len(moved), *self.slopes.shape)
        full = _full(moved, self.slopes, self.hoop)
        left, ratio = full @ full.transpose(0, 2, 1), np.linalg.det(full)
        trace = np.trace(left, axis1=1, axis2=2)
        moduli = self.moduli
        if self.cell is not None:
            moduli = moduli._replace(first_lame=4.0 * moduli.c01)
        unit, square, inverse = (
            np.multiply.outer(np.broadcast_to(value, len(left)), np.ones((1, 1)))
            for value in self.law.coefficients(trace, np.log(ratio), moduli)
        )
        true = (unit * left + square * (left @ left) + inverse * np.eye(3)) / ratio[:, None, None]
        if self.cell is not None:
            slopes, hoop, volumes = self.cell
            each = zip(slopes, hoop, volumes, strict=True)
            sums = sum(size * np.linalg.det(_full(moved, *at)) for *at, size in each)
            mean = np.asarray(sums) / volumes.sum()
            bulk = self.moduli.first_lame - 4.0 * self.moduli.c01
            true += (bulk * np.log(mean) / mean)[:, None, None] * np.eye(3)
        return {
            f"s{name}": true[:, "xyz".index(name[0]), "xyz".index(name[1])] for name in _ORDER[dim]
        }


def _full(moved: Floats, slopes: Floats, hoop: Floats) -> Floats:
    """Deformation gradients (rows, 3, 3) of displacements (rows, nodes, dim) at a place."""
    dim = slopes.shape[1]
    full = np.zeros((len(moved), 3, 3)) + np.eye(3)
    full[:, :dim, :dim] += np.einsum("rni,nj->rij", moved, slopes)
    full[:, 2, 2] += moved[:, :, 0] @ hoop
    return full
