"""True stress at a place of a body under finite strain, of the displacements around it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.orthotropic import PLACES
from impactfem.system.law_kernels import stress, thickened
from impactfem.system.point_memory import REMEMBERED

_ORDER = {2: ("xx", "yy", "xy", "zz"), 3: ("xx", "yy", "zz", "xy", "yz", "xz")}


@dataclass(frozen=True)
class TrueStress:
    """Cauchy's stress of a law by the displacement gradient at a place.

    Attributes:
        slopes: Gradients of the shape functions there [1/m], shape (nodes, dim).
        hoop: Weights of the hoop strain [1/m], shape (nodes,); 0 but for axisymmetric bodies.
        material: As `impactfem.system.law_kernels.stress` takes it, (entries,).
        bulk: Of nearly incompressible bodies what of lambda is asked of the mean of J in the cell
            [Pa]; else 0.
        cell: Slopes, weights of the hoop strain and volumes at points of it, (points, ...).
        linear: C of small strains but for that [Pa], (6, 6) or (4, 4), of Maxwell terms.
    """

    slopes: Floats
    hoop: Floats
    material: Floats
    bulk: float
    cell: tuple[Floats, Floats, Floats]
    linear: Floats

    @property
    def weights(self) -> dict[str, Floats]:
        """What has to be kept of each layer: every displacement by itself, (nodes, dim) each."""
        count = self.slopes.size
        unit = np.eye(count).reshape(count, *self.slopes.shape)
        return {f"u{k}": each for k, each in enumerate(unit)}

    def of(self, kept: Mapping[str, Floats]) -> dict[str, Floats]:
        """Components [Pa] by what `weights` has kept, shape (rows,) each.

        Args:
            kept: And what Maxwell terms remember, if there are any.
        """
        dim = self.slopes.shape[1]
        moved = np.stack([kept[name] for name in self.weights], axis=1)
        moved = moved.reshape(len(moved), *self.slopes.shape)
        gradient = _gradient(moved, self.slopes, self.hoop)
        turned = gradient.transpose(0, 2, 1)
        strain, full = 0.5 * (gradient + turned + turned @ gradient), gradient + np.eye(3)
        flat = bool(self.material[1])
        pushed = np.zeros_like(full)
        for k, own in enumerate(strain):
            six = [float(own[i, j]) for i, j in PLACES]
            for (i, j), value in zip(PLACES, stress(self.material, *six)[1:], strict=True):
                pushed[k, i, j] = pushed[k, j, i] = value
            if flat:
                across = thickened(self.material, six[0], six[1], six[3])
                full[k, 2, 2] = np.sqrt(1.0 + 2.0 * across)
        if "rise" in kept:
            pushed += self._linearly(kept)
        ratio = np.linalg.det(full)
        true = full @ pushed @ full.transpose(0, 2, 1) / ratio[:, None, None]
        if self.bulk:
            slopes, hoop, volumes = self.cell
            each = zip(slopes, hoop, volumes, strict=True)
            sums = sum(
                size * np.linalg.det(_gradient(moved, *at) + np.eye(3)) for *at, size in each
            )
            mean = np.asarray(sums) / volumes.sum()
            pressed = np.log(mean) / mean
            pressed = pressed + kept.get("rise", 0.0)
            true += (self.bulk * pressed)[:, None, None] * np.eye(3)
        return {
            f"s{name}": true[:, "xyz".index(name[0]), "xyz".index(name[1])] for name in _ORDER[dim]
        }

    def _linearly(self, kept: Mapping[str, Floats]) -> Floats:
        """C : sum g r of what terms remember, (rows, 3, 3)."""
        places = PLACES[: len(self.linear)]
        each = zip(REMEMBERED, places, strict=False)
        strains = np.stack([kept[name] * (1.0 if i == j else 2.0) for name, (i, j) in each])
        found = np.zeros((strains.shape[1], 3, 3))
        for (i, j), values in zip(places, self.linear @ strains, strict=True):
            found[:, i, j] = found[:, j, i] = values
        return found


def _gradient(moved: Floats, slopes: Floats, hoop: Floats) -> Floats:
    """Gradients (rows, 3, 3) of displacements (rows, nodes, dim) at a place."""
    dim = slopes.shape[1]
    found = np.zeros((len(moved), 3, 3))
    found[:, :dim, :dim] = np.einsum("rni,nj->rij", moved, slopes)
    found[:, 2, 2] += moved[:, :, 0] @ hoop
    return found
