"""Stiffness of the cross-section of a plate: of one material, or of layers from bottom to top.

Strains e_xx, e_yy, 2 e_xy at the height z are e0 + z c, c the curvatures, and stresses Q times
these, so that forces and moments are A e0 + B c and B e0 + D c. Where nothing holds the mid-surface
in its plane e0 = -A^-1 B c and moments are (D - B A^-1 B) c: exactly so if B = z0 A, as in layers
that are symmetric or differ by a factor only (z0: neutral surface), else if curvatures do not vary
(reduced bending stiffness; J. E. Ashton, J. Compos. Mater. 3 (1969) 694-700).

Shear: the stress that balances that of bending along an axis gives its stiffness by its energy, 5/6
of G t in one material (J. M. Whitney, J. Appl. Mech. 40 (1973) 302-304).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from impactfem.arrays import Floats

_GAUSS = np.polynomial.legendre.leggauss(3)  # exact for squares of quadratic stresses


@dataclass(frozen=True)
class Ply:
    """A layer of one material.

    Attributes:
        thickness: [m].
        density: [kg/m^3].
        plane: Q, plane stress along the axes of the plate [Pa], (3, 3).
        across: Moduli of the shears xz and yz along these axes [Pa], (2, 2).
    """

    thickness: float
    density: float
    plane: Floats
    across: Floats

    @classmethod
    def of(
        cls,
        thickness: float,
        density: float,
        moduli: tuple[float, float],
        ratio: float,
        shears: tuple[float, float, float],
        angle: float = 0.0,
    ) -> "Ply":
        """Of an orthotropic material.

        Args:
            thickness: [m].
            density: [kg/m^3].
            moduli: Along its axes 1 and 2 [Pa].
            ratio: nu12, by which pulling along 1 narrows 2.
            shears: G12, G13, G23 [Pa].
            angle: Of axis 1 from the x axis of the plate [rad].
        """
        one, two = moduli
        share = 1.0 / (1.0 - ratio**2 * two / one)
        along = np.array([[one, ratio * two, 0.0], [ratio * two, two, 0.0], [0.0, 0.0, 0.0]])
        along *= share
        along[2, 2] = shears[0]
        c, s = math.cos(angle), math.sin(angle)
        strains = np.array(
            [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
        )
        turn = np.array([[c, s], [-s, c]])
        return cls(
            thickness, density, strains.T @ along @ strains, turn.T @ np.diag(shears[1:]) @ turn
        )

    @classmethod
    def isotropic(cls, thickness: float, density: float, modulus: float, ratio: float) -> "Ply":
        """Of a material alike in all directions, by Young's modulus [Pa] and Poisson's ratio."""
        shear = 0.5 * modulus / (1.0 + ratio)
        return cls.of(thickness, density, (modulus, modulus), ratio, (shear, shear, shear))


@dataclass(frozen=True)
class Section:
    """A cross-section.

    Attributes:
        thickness: [m].
        mass: By the area [kg/m^2].
        turning: Rotary inertia by the area about the centre of mass [kg].
        stretching: Forces by strains of the mid-surface, A [N/m], (3, 3).
        bending: Moments by curvatures [N m], (3, 3).
        shear: Forces by shears xz and yz [N/m], (2, 2).
        faces: Stresses at the bottom and the top face by curvatures [Pa m], (2, 3, 3).
        skins: The same by strains of the mid-surface [Pa], (2, 3, 3).
        hardness: Mean modulus of plane strain at the softer face [Pa].
        coupled: Share by which bending that may not stretch is stiffer, but for a neutral surface
            that is shifted: what a plate without motion in its plane leaves open.
    """

    thickness: float
    mass: float
    turning: float
    stretching: Floats
    bending: Floats
    shear: Floats
    faces: Floats
    skins: Floats
    hardness: float
    coupled: float

    @classmethod
    def of(cls, plies: Sequence[Ply]) -> "Section":
        """Of layers from bottom to top."""
        thickness = math.fsum(ply.thickness for ply in plies)
        lows = np.cumsum([0.0, *(ply.thickness for ply in plies)]) - 0.5 * thickness
        spans = list(zip(lows[:-1].tolist(), lows[1:].tolist(), strict=True))
        each = list(zip(plies, spans, strict=True))

        def moment(power: int, *, plane: bool) -> Floats:
            n = power + 1
            return np.asarray(
                sum(
                    (b**n - a**n) / n * (ply.plane if plane else np.array(ply.density))
                    for ply, (a, b) in each
                )
            )

        stretch, mixed, bend = (moment(k, plane=True) for k in range(3))
        mass, first, second = (float(moment(k, plane=False)) for k in range(3))
        slip = np.linalg.solve(stretch, mixed)  # -e0 by curvatures
        bending = bend - mixed @ slip
        neutral = float(np.trace(mixed) / np.trace(stretch))
        left = mixed - neutral * stretch
        coupled = np.linalg.norm(left @ np.linalg.solve(stretch, left)) / np.linalg.norm(bending)
        heights = np.array([lows[0], lows[-1]])
        ends = plies[0], plies[-1]
        faces = [
            ply.plane @ (z * np.eye(3) - slip)
            for ply, z in zip(ends, heights.tolist(), strict=True)
        ]
        hard = [math.sqrt(ply.plane[0, 0] * ply.plane[1, 1]) for ply in ends]
        return cls(
            thickness=thickness,
            mass=mass,
            turning=second - first**2 / mass,
            stretching=stretch,
            bending=0.5 * (bending + bending.T),
            shear=_shear(each, stretch, mixed),
            faces=np.array(faces),
            skins=np.array([ply.plane for ply in ends]),
            hardness=min(hard),
            coupled=float(coupled),
        )

    @property
    def rigidity(self) -> float:
        """Mean of the bending stiffnesses along x and y [N m]."""
        return math.sqrt(float(self.bending[0, 0] * self.bending[1, 1]))

    @property
    def shear_depth(self) -> float:
        """Thickness of a plate with nu = 0.3 that gives way to shear as much beside bending [m]."""
        share = np.diag(self.bending)[:2] / np.diag(self.shear)
        return math.sqrt(5.0 * 0.7 * float(share.max()))


def _shear(
    each: Sequence[tuple[Ply, tuple[float, float]]], stretch: Floats, mixed: Floats
) -> Floats:
    """Stiffness to shear by its energy; see the top of the module."""
    total = np.asarray(sum((b - a) * ply.across for ply, (a, b) in each))
    shares = np.empty(2)
    for k in range(2):
        neutral = mixed[k, k] / stretch[k, k]
        below = bend = soft = 0.0
        for ply, (a, b) in each:
            modulus, slide = ply.plane[k, k], ply.across[k, k]
            z = 0.5 * (a + b) + 0.5 * (b - a) * _GAUSS[0]
            weight = 0.5 * (b - a) * _GAUSS[1]
            flow = below + 0.5 * modulus * ((z - neutral) ** 2 - (a - neutral) ** 2)
            soft += float(weight @ flow**2) / slide
            bend += float(weight @ (modulus * (z - neutral) ** 2))
            below += 0.5 * modulus * ((b - neutral) ** 2 - (a - neutral) ** 2)
        shares[k] = math.sqrt(bend**2 / soft / total[k, k])
    return total * np.outer(shares, shares)
