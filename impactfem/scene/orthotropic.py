"""Solids whose moduli differ along three axes at right angles: constants, and their stiffness.

Strains and stresses are in the order xx, yy, zz, xy, yz, zx, shears as engineers count them: twice.
"""

import math
from functools import cached_property
from typing import ClassVar

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.given import MaybeTable
from impactfem.scene.inline import InlineTable
from impactfem.scene.kinds import Real
from impactfem.scene.rigid_keys import Orientation, rotation
from impactfem.scene.schema import KeyedError, key, table

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Rows and columns of the components."""
_ROUND = 48  # directions by a half turn among which the fastest and slowest waves are sought


@table("orthotropic = { e1 = ..., e3 = ... }")
class OrthotropicSolid:
    """Elasticity with axes 1, 2, 3 at right angles, which lie along x, y, z unless turned.

    In the plane axis 3 is the normal, of axisymmetric bodies the circumference.

    Raises:
        SceneError: a value is not allowed, or the material would give way without end.
    """

    heading: ClassVar[str] = "orthotropic"

    e1: float = key(Real(above=0), "Young's modulus along axis 1", unit="Pa")
    e2: float = key(Real(above=0), "Young's modulus along axis 2", unit="Pa")
    e3: float | None = key(
        Real(above=0), "Young's modulus along axis 3", unit="Pa", default=None,
        absent="required, but in plane stress",
    )  # fmt: skip
    nu12: float = key(Real(), "Poisson's ratio: pulled along 1 it narrows along 2 by so much")
    nu13: float | None = key(
        Real(), "Poisson's ratio: pulled along 1 it narrows along 3 by so much", default=None,
        absent="required, but in plane stress",
    )  # fmt: skip
    nu23: float | None = key(
        Real(), "Poisson's ratio: pulled along 2 it narrows along 3 by so much", default=None,
        absent="required, but in plane stress",
    )  # fmt: skip
    g12: float = key(Real(above=0), "shear modulus between axes 1 and 2", unit="Pa")
    g13: float | None = key(
        Real(above=0), "shear modulus between axes 1 and 3", unit="Pa", default=None,
        absent="required in 3D",
    )  # fmt: skip
    g23: float | None = key(
        Real(above=0), "shear modulus between axes 2 and 3", unit="Pa", default=None,
        absent="required in 3D",
    )  # fmt: skip
    angle: float = key(
        Real(), "of axis 1 from x about z, from x towards y", unit="rad", default=0.0
    )
    orientation: MaybeTable[Orientation] = key(
        InlineTable((Orientation,)), "in 3D instead of angle: turns all axes", default=None,
        absent="none",
    )  # fmt: skip

    def _check(self) -> None:
        pairs = (("nu12", "e1", "e2"), ("nu13", "e1", "e3"), ("nu23", "e2", "e3"))
        for name, along, across in pairs:
            ratio, one, two = (getattr(self, each) for each in (name, along, across))
            if None not in (ratio, one, two) and not ratio**2 < one / two:
                text = f" = {ratio:g} is no Poisson's ratio of {along} = {one:g} and {across} = "
                text += f"{two:g}: {name}^2 must be below {along}/{across} = {one / two:.4g}."
                raise KeyedError(self.heading, name, text)
        if self.is_whole and not self._volume_left > 0.0:
            text = f" = {self.nu12:g}, nu13 = {self.nu13:g} and nu23 = {self.nu23:g} with e1 = "
            text += f"{self.e1:g}, e2 = {self.e2:g} and e3 = {self.e3:g} would give energy away: "
            text += "1 - nu12^2 e2/e1 - nu13^2 e3/e1 - nu23^2 e3/e2 - 2 nu12 nu13 nu23 e3/e1 = "
            text += f"{self._volume_left:.4g} must be > 0; give smaller ratios."
            raise KeyedError(self.heading, "nu12", text)
        if self.orientation is not None and self.angle != 0.0:
            text = f" = {self.angle:g}, and orientation is given too: remove one of them."
            raise KeyedError(self.heading, "angle", text)

    @property
    def is_whole(self) -> bool:
        """Whether all constants but shears across the plane are given."""
        return None not in (self.e3, self.nu13, self.nu23)

    @property
    def _volume_left(self) -> float:
        """Determinant of the compliance of direct stresses, times the moduli."""
        one, two, three = self.e1, self.e2, self.e3 or self.e2
        a, b, c = self.nu12, self.nu13 or 0.0, self.nu23 or 0.0
        squares = a * a * two / one + b * b * three / one + c * c * three / two
        return 1.0 - squares - 2.0 * a * b * c * three / one

    def check_model(self, model: str) -> None:
        """Refuse constants that a model lacks, and axes that leave its plane.

        Raises:
            KeyedError: naming the key.
        """
        wanted = [] if model == "plane_stress" else ["e3", "nu13", "nu23"]
        wanted += ["g13", "g23"] if model == "3d" else []
        for name in wanted:
            if getattr(self, name) is None:
                raise KeyedError(self.heading, name, f' is missing: model = "{model}" needs it.')
        if self.orientation is None:
            return
        if model == "3d":
            self.orientation.check_in_space(self.heading)
        elif self.orientation.in_plane is None:
            text = f' turns axis 3 out of the normal of model = "{model}": give angle, or '
            raise KeyedError(self.heading, "orientation", text + 'model = "3d".')

    @property
    def _own(self) -> Floats:
        """Compliance along its axes [1/Pa], (6, 6); what no model asks for is filled in."""
        three, a, b, c = self.e3, self.nu12, self.nu13, self.nu23
        if three is None or b is None or c is None:
            three, b, c = min(self.e1, self.e2), 0.0, 0.0
        found = np.diag(
            [1.0 / value for value in (self.e1, self.e2, three, self.g12, self.g23 or self.g12,
                                       self.g13 or self.g12)]
        )  # fmt: skip
        for i, j, ratio, one in ((0, 1, a, self.e1), (0, 2, b, self.e1), (1, 2, c, self.e2)):
            found[i, j] = found[j, i] = -ratio / one
        return found

    @property
    def axes(self) -> Floats:
        """Its axes by columns, (3, 3)."""
        turn = np.eye(3)
        if self.orientation is not None and self.orientation.in_plane is None:
            turn = rotation(np.asarray(self.orientation.unit))
        else:
            angle = (
                self.angle if self.orientation is None else float(self.orientation.in_plane or 0)
            )
            c, s = math.cos(angle), math.sin(angle)
            turn[:2, :2] = [[c, -s], [s, c]]
        return turn

    @cached_property
    def stiffness(self) -> Floats:
        """Stress by strain along x, y, z [Pa], (6, 6), symmetric."""
        turn = self.axes
        first, second = np.array(PLACES).T
        # Stress along x, y, z by stress along the axes: T_ij t_kl T' of symmetric tensors.
        mixed = turn[first][:, first] * turn[second][:, second]
        other = turn[first][:, second] * turn[second][:, first]
        carried = mixed + np.where(np.arange(6) < 3, 0.0, other)
        found = carried @ np.linalg.inv(self._own) @ carried.T
        return np.asarray(0.5 * (found + found.T))

    def of_model(self, model: str) -> Floats:
        """What a model sees of it [Pa]: (6, 6) in space, else (4, 4) of xx, yy, zz, xy.

        In plane stress the third row and column are empty.
        """
        return seen_by(self.stiffness, model)

    def wave_moduli(self, model: str) -> tuple[float, float]:
        """Density times the square of the speeds of the fastest and the slowest waves [Pa]."""
        seen, dim = self.of_model(model), 3 if model == "3d" else 2
        turn = np.linspace(0.0, math.pi, _ROUND, endpoint=False)
        ways = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        if dim == 3:
            up = np.linspace(0.0, math.pi, _ROUND)[:, None, None]
            flat = np.sin(up) * ways
            ways = np.concatenate([flat, np.broadcast_to(np.cos(up), (*flat.shape[:2], 1))], axis=2)
            ways = ways.reshape(-1, 3)
        size = len(seen)
        strained = np.zeros((len(ways), size, dim))
        for row, (i, j) in enumerate(PLACES[:size]):
            if max(i, j) < dim:
                strained[:, row, i] += ways[:, j]
                strained[:, row, j] += ways[:, i] * (i != j)
        each = np.linalg.eigvalsh(strained.transpose(0, 2, 1) @ seen @ strained)
        return float(each.max()), float(each.min())

    @cached_property
    def mean(self) -> tuple[float, float]:
        """Young's modulus [Pa] and Poisson's ratio of the mean of its stiffness in all directions.

        Source: W. Voigt, Lehrbuch der Kristallphysik (Teubner, 1910).
        """
        c = self.stiffness
        direct, beside = float(np.trace(c[:3, :3])), float(c[0, 1] + c[1, 2] + c[0, 2])
        bulk = (direct + 2.0 * beside) / 9.0
        shear = (direct - beside) / 15.0 + float(np.trace(c[3:, 3:])) / 5.0
        own = 9.0 * bulk * shear / (3.0 * bulk + shear)
        return own, (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear))


def seen_by(stiffness: Floats, model: str) -> Floats:
    """Of a stiffness in space [Pa], (..., 6, 6), what `OrthotropicSolid.of_model` says."""
    if model == "3d":
        return stiffness
    found = stiffness[..., :4, :4].copy()
    if model == "plane_stress":
        across = found[..., :, 2].copy()
        found -= across[..., :, None] * across[..., None, :] / across[..., 2, None, None]
        found[..., 2, :] = found[..., :, 2] = 0.0
    return found
