"""Weak form of the Timoshenko beam: deflection w [m] and rotation r of the section [rad].

    int rho A w_tt v + rho I r_tt q + E I r' q' + kappa G A (w' - r) (v' - q) dx = loads

Deflections of one degree more than rotations can follow a bent axis without shear, w' = r in the
whole element: thin beams do not lock. Source: S. P. Timoshenko, Phil. Mag. 41 (1921) 744-746;
T. J. R. Hughes, The Finite Element Method (Dover, 2000), section 5.
"""

from dataclasses import dataclass
from typing import Any

from impactfem.fem import ufl


@dataclass(frozen=True)
class TimoshenkoForms:
    """UFL forms on a mixed space (w, r); the data may be UFL constants, to share compiled code.

    Attributes:
        space: Mixed Lagrange space on an interval mesh.
        line_mass: rho A [kg/m].
        rotary_inertia: rho I [kg m].
        bending_stiffness: E I [N m^2].
        shear_stiffness: kappa G A [N].
    """

    space: Any
    line_mass: Any
    rotary_inertia: Any
    bending_stiffness: Any
    shear_stiffness: Any

    @property
    def mass(self) -> Any:
        """Bilinear form of the consistent mass."""
        w, r = ufl.TrialFunctions(self.space)
        v, q = ufl.TestFunctions(self.space)
        return (self.line_mass * w * v + self.rotary_inertia * r * q) * ufl.dx

    @property
    def stiffness(self) -> Any:
        """Bilinear form of bending and shear."""
        w, r = ufl.TrialFunctions(self.space)
        v, q = ufl.TestFunctions(self.space)
        bending = self.bending_stiffness * r.dx(0) * q.dx(0)
        shear = self.shear_stiffness * (w.dx(0) - r) * (v.dx(0) - q)
        return (bending + shear) * ufl.dx
