"""Elastic solids in 2D and 3D: their keys filled in and checked."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from impactfem.scene.boundary import (
    SPACE,
    FormulaLike,
    Pressure,
    Support,
    Traction,
)
from impactfem.scene.formula import Formula
from impactfem.scene.schema import check_fields, table
from impactfem.scene.solid_checks import check_solid
from impactfem.scene.solid_constants import check_constants
from impactfem.scene.solid_keys import AnyShape, Refinement, SolidKeys

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@table('[[body]] with kind = "solid"')
@dataclass(frozen=True, kw_only=True)
class Solid(SolidKeys):
    """An elastic body in 2D or 3D, drawn by Gmsh or read from a mesh file.

    Tables may be given for `shape`, `supports`, `tractions`, `pressures` and `refine`; numbers for
    formulas. `velocity`, `displacement` and `angular_velocity` are 0 where absent and stored so.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    if TYPE_CHECKING:  # type checkers learn what else may be given

        def __init__(
            self,
            *,
            model: str,
            density: float,
            youngs_modulus: float | None = None,
            poisson_ratio: float | None = None,
            strain: str | None = None,
            material: str = "linear",
            element: str | None = None,
            c10: float | None = None,
            c01: float | None = None,
            bulk_modulus: float | None = None,
            name: str = "solid",
            shape: AnyShape | Mapping[str, Any] | None = None,
            mesh: str | None = None,
            mesh_size: float | None = None,
            refine: Sequence[Refinement | Mapping[str, Any]] = (),
            cells: str = "simplex",
            degree: int | None = None,
            thickness: float = 1.0,
            velocity: Sequence[FormulaLike] | None = None,
            angular_velocity: float | Sequence[float] | None = None,
            displacement: Sequence[FormulaLike] | None = None,
            supports: Sequence[Support | Mapping[str, Any]] = (),
            tractions: Sequence[Traction | Mapping[str, Any]] = (),
            pressures: Sequence[Pressure | Mapping[str, Any]] = (),
            rayleigh_mass: float = 0.0,
            rayleigh_stiffness: float = 0.0,
            contact_surfaces: Sequence[str] | None = None,
        ) -> None: ...

    def __post_init__(self) -> None:
        check_fields(self, self.kind)
        elastic = check_constants(self)
        for name, value in elastic.items():
            object.__setattr__(self, name, value)
        self._fill()
        check_solid(self)

    def _fill(self) -> None:
        """Put zeros where nothing is given."""
        rest = (Formula("0.0", SPACE),) * self.dim
        zeros = {
            "velocity": rest,
            "displacement": rest,
            "angular_velocity": 0.0 if self.dim == 2 else (0.0,) * 3,
        }
        for name, zero in zeros.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, zero)
