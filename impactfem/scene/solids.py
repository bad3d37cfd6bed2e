"""Elastic solids in 2D and 3D, with supports, loads and what Gmsh needs to draw them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene.body import BodyKind, Solver
from impactfem.scene.boundary import (
    SPACE,
    SURFACE,
    Pressure,
    Support,
    Traction,
)
from impactfem.scene.damping import QUALITY, RATIO, Damping, fill_damping, filled_keys
from impactfem.scene.flight import Flight
from impactfem.scene.formula import Formula
from impactfem.scene.given import FormulaLike, Given, MaybeFormulas, MaybeTable, Tables
from impactfem.scene.inline import (
    Formulas,
    InlineTable,
    ListOf,
    NumberOrVector,
    TablesByName,
    Vector,
)
from impactfem.scene.kinds import Choice, FilePath, Integer, Line, Name, Real, RealOrFormula
from impactfem.scene.materials import STRESS_AT_REST, Material, solids_of
from impactfem.scene.mesh_files import MESH_FILES, PART
from impactfem.scene.ogden import OgdenTerm
from impactfem.scene.orthotropic import OrthotropicSolid
from impactfem.scene.probes import STRAINS
from impactfem.scene.rigid_keys import Orientation
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.shape import MODELS
from impactfem.scene.shapes import SHAPES, Block, Cylinder, Disc, Ring, Sphere
from impactfem.scene.solid_checks import check_solid
from impactfem.scene.solid_constants import LAWS, check_constants, derived_constants, terms_of
from impactfem.scene.viscoelastic import (
    VISCOELASTIC,
    KelvinVoigt,
    Maxwell,
    check_viscoelastic,
)

type AnyShape = Block | Disc | Ring | Cylinder | Sphere

RESIDUAL = {2: ("sxx", "syy", "sxy"), 3: ("sxx", "syy", "szz", "sxy", "syz", "sxz")}
"""Components of residual stresses by the number of coordinates."""
CELLS = ("simplex", "hexahedron")
STRAINS_OF = ("small", "finite")
ELEMENTS = ("standard", "mean_dilatation")
NEARLY_INCOMPRESSIBLE = 0.45
"""Poisson's ratio above which elements keep their volume in the mean only."""
_IF_ELASTIC = "required, but by materials, orthotropic or the constants of another law"
_LAW_WORDS = {
    "linear": "elastic (St. Venant, Kirchhoff) under finite strain",
    "neo_hookean": "neo-Hookean under finite strain",
    "mooney_rivlin": "Mooney–Rivlin under finite strain",
    "ogden": "Ogden under finite strain",
    "foam": "foam (Ogden, Storåkers) under finite strain",
}


@table("refine = [{ ... }]")
class Refinement:
    """Smaller elements in a ball, growing to the mesh size outside.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "refine"

    point: Sequence[float] = key(Vector(), "centre of the ball", unit="m")
    radius: float = key(Real(above=0), "radius of the ball", unit="m")
    size: float = key(Real(above=0), "size of elements inside", unit="m")


@table('[[body]] with kind = "solid"')
class Solid(BodyKind):
    """An elastic body in 2D or 3D, drawn by Gmsh or read from a mesh file.

    Tables may be given for `shape`, `supports`, `tractions`, `pressures` and `refine`; numbers for
    formulas. `velocity`, `displacement` and `angular_velocity` are 0 where absent and stored so.

    Raises:
        SceneError: a value is missing or not allowed, or two contradict each other.
    """

    kind: ClassVar[str] = "solid"
    solvers: ClassVar[tuple[Solver, Solver]] = ("march", "march")
    probed: ClassVar[tuple[str, ...]] = STRAINS
    waves: ClassVar[bool] = True
    in_elements: ClassVar[bool] = True
    joined_in_steps: ClassVar[bool] = True
    may_meet_nothing: ClassVar[bool] = True
    settles: ClassVar[bool] = True
    lined: ClassVar[bool] = True
    meshed: ClassVar[bool] = True
    meets_edges: ClassVar[bool] = True
    has_surface: ClassVar[bool] = True
    meets_alike: ClassVar[bool] = True
    takes_joints: ClassVar[bool] = True
    joined_whole: ClassVar[bool] = False
    joined_by_surface: ClassVar[bool] = True
    sprung_inside: ClassVar[bool] = True
    tied: ClassVar[bool] = True
    parts_in_joints: ClassVar[str] = "surfaces"

    name: str = key(Name(), "name of the body in histories", default="solid")
    model: str = key(Choice(MODELS), "what the body is; axisymmetric: x is the radius, y the axis")
    shape: MaybeTable[AnyShape] = key(
        InlineTable(SHAPES), "shape for Gmsh to draw, or give mesh", default=None, absent="none"
    )
    mesh: str | None = key(
        FilePath(endings=MESH_FILES),
        "mesh or geometry file instead of a shape",
        default=None,
        absent="none",
    )
    position: Sequence[float] | None = key(
        Vector(),
        "where the origin of the mesh file is at t = 0",
        unit="m",
        default=None,
        absent="at the origin",
    )
    orientation: MaybeTable[Orientation] = key(
        InlineTable((Orientation,)),
        "turns the mesh file about its origin at t = 0; axes of materials and formulas stay",
        default=None,
        absent="as the file has it",
    )
    part: str | None = key(Line(), PART, default=None, absent="all of them")
    mesh_size: float | None = key(
        Real(above=0),
        "size of elements; required with a shape or a STEP file",
        unit="m",
        default=None,
        absent="by the mesh file",
    )
    refine: Tables[Refinement] = key(
        ListOf(InlineTable((Refinement,))), "where elements are smaller", default=()
    )
    cells: str = key(
        Choice(CELLS),
        "triangles and tetrahedra, or quadrilaterals and hexahedra",
        default="simplex",
    )
    degree: int | None = key(Integer(1, 2), "polynomial degree of elements", default=None)
    thickness: float = key(Real(above=0), "thickness of plane models", unit="m", default=1.0)
    density: Given[float, FormulaLike | None] = key(
        RealOrFormula(SPACE),
        "mass density; a formula: of the undeformed body, each element has its mean",
        unit="kg/m^3",
        default=None,
        absent="required, but by materials",
    )
    youngs_modulus: Given[float, FormulaLike | None] = key(
        RealOrFormula(SPACE),
        "Young's modulus; a formula: of the undeformed body, each element has its mean",
        unit="Pa",
        default=None,
        absent=_IF_ELASTIC,
    )
    poisson_ratio: Given[float, FormulaLike | None] = key(
        RealOrFormula(SPACE, above=-1, below=0.5),
        "Poisson's ratio; a formula: of the undeformed body, each element has its mean",
        default=None,
        absent=_IF_ELASTIC,
    )
    orthotropic: MaybeTable[OrthotropicSolid] = key(
        InlineTable((OrthotropicSolid,)),
        "moduli along three axes instead of youngs_modulus and poisson_ratio",
        default=None,
        absent="none: alike in all directions",
    )
    materials: Given[Mapping[str, Material], Mapping[str, Material | Mapping[str, Any]]] = key(
        TablesByName(Material),
        "materials by the names of the physical groups of elements in the mesh file; what one "
        "leaves out is as the body has it",
        default=(),
    )
    strain: str | None = key(
        Choice(STRAINS_OF),
        "whether the body may turn and be strained at will",
        default=None,
        absent="small; finite for a law that is not linear, and where small strains end",
    )
    material: str = key(
        Choice(LAWS),
        "law of the material; linear under finite strain: St. Venant and Kirchhoff's",
        default="linear",
    )
    element: str | None = key(
        Choice(ELEMENTS),
        "whether cells keep their volume at each point or in the mean",
        default=None,
        absent='"mean_dilatation" above a Poisson\'s ratio of 0.45',
    )
    c10: float | None = key(
        Real(at_least=0),
        "constant of Mooney's and Rivlin's law",
        unit="Pa",
        default=None,
        absent="none",
    )
    c01: float | None = key(
        Real(at_least=0),
        "constant of Mooney's and Rivlin's law; mu = 2 (c10 + c01)",
        unit="Pa",
        default=None,
        absent="none",
    )
    bulk_modulus: float | None = key(
        Real(above=0),
        "bulk modulus at small strains, with c10 and c01 or terms",
        unit="Pa",
        default=None,
        absent="none",
    )
    terms: Tables[OgdenTerm] = key(
        ListOf(InlineTable((OgdenTerm,))), 'terms of "ogden" and "foam"', default=()
    )
    velocity: Given[tuple[Formula, ...], Sequence[FormulaLike] | None] = key(
        Formulas(SPACE), "velocity at t = 0", unit="m/s", default=None, absent="0"
    )
    angular_velocity: Given[float | tuple[float, ...], Sequence[float] | None] = key(
        NumberOrVector(),
        "rotation at t = 0 about the centre of mass, added to the velocity",
        unit="rad/s",
        default=None,
        absent="0",
    )
    displacement: Given[tuple[Formula, ...], Sequence[FormulaLike] | None] = key(
        Formulas(SPACE), "displacement at t = 0", unit="m", default=None, absent="0"
    )
    residual_stress: MaybeFormulas = key(
        Formulas(SPACE, lengths=(3, 6)),
        STRESS_AT_REST,
        unit="Pa",
        default=None,
        absent="none",
    )
    supports: Tables[Support] = key(
        ListOf(InlineTable((Support,))), "surfaces that are held or moved", default=()
    )
    tractions: Tables[Traction] = key(
        ListOf(InlineTable((Traction,))), "forces on surfaces", default=()
    )
    pressures: Tables[Pressure] = key(
        ListOf(InlineTable((Pressure,))), "pressures on surfaces", default=()
    )
    rayleigh_mass: float = key(
        Real(at_least=0), "damping by the mass matrix", unit="1/s", default=0.0
    )
    rayleigh_stiffness: float = key(
        Real(at_least=0), "damping by the stiffness matrix", unit="s", default=0.0
    )
    damping_ratio: float | None = key(Real(at_least=0, below=1), RATIO, default=None, absent="none")
    quality_factor: float | None = key(Real(above=0), QUALITY, default=None, absent="none")
    damping: MaybeTable[Damping] = key(
        InlineTable((Damping,)), "the same in one table", default=None, absent="none"
    )
    viscoelastic: MaybeTable[KelvinVoigt | Maxwell] = key(
        InlineTable(tuple(VISCOELASTIC)),
        "how it creeps and relaxes; it is at rest so at t = 0, as if held for long",
        default=None,
        absent="not",
    )
    contact_surfaces: tuple[str, ...] | None = key(
        ListOf(SURFACE, at_least=1, different=True),
        "surfaces that may touch obstacles",
        default=None,
        absent="every surface that can",
    )

    def _check(self) -> None:
        elastic = {} if self.materials else check_constants(self)
        for name, value in elastic.items():
            object.__setattr__(self, name, value)
        self._fill()
        self._check_residual()
        if self.damping or self.quality_factor or self.damping_ratio:
            fill_damping(self)
        if self.viscoelastic or self.quality_factor or self.damping_ratio:
            check_viscoelastic(self)
        check_solid(self)

    def _check_residual(self) -> None:
        """Refuse stresses of other models, and take small strains beside them."""
        given = self.residual_stress
        if given is None:
            if self.has_residual_stress:  # as each material says it
                object.__setattr__(self, "strain", self.strain or "small")
            return
        count, what = len(given), " has {} entries"
        if self.model == "axisymmetric":
            text = ": axisymmetric bodies take none; remove it, or model the body in space."
            raise KeyedError(self.kind, "residual_stress", text)
        if count != len(RESIDUAL[self.dim]):
            text = f"{what.format(count)}: give {', '.join(RESIDUAL[self.dim])}."
            raise KeyedError(self.kind, "residual_stress", text)
        other = "strain" if self.strain == "finite" else "viscoelastic" if self.relaxing else ""
        if other:
            text = ": residual_stress is known of elastic solids of small strain; remove one."
            raise KeyedError(self.kind, other, text)
        object.__setattr__(self, "strain", "small")

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

    @property
    def turn(self) -> Floats:
        """Rotation of its mesh file at t = 0, (dim, dim)."""
        given = self.orientation
        return np.eye(self.dim) if given is None else given.matrix(self.dim)

    @property
    def flight(self) -> Flight | None:
        """How it flies; None if loads, supports or rotation act on it or its box is not known."""
        spin = self.angular_velocity
        loads = (
            self.supports, self.tractions, self.pressures, self.rayleigh_mass,
            self.has_residual_stress,
        )  # fmt: skip
        turns = any(spin) if isinstance(spin, tuple) else spin
        still = all(entry.is_constant and float(entry()) == 0.0 for entry in self.displacement)
        if self.shape is None or any(loads) or turns or not still:
            return None
        if not all(entry.is_constant for entry in self.velocity):
            return None
        lower, upper = self.shape.bounds(axisymmetric=self.is_axisymmetric)
        half = tuple((b - a) / 2 for a, b in zip(lower, upper, strict=True))
        center = tuple((b + a) / 2 for a, b in zip(lower, upper, strict=True))
        return Flight(half, center, tuple(float(entry()) for entry in self.velocity))

    @property
    def dim(self) -> int:
        """Number of coordinates: 3, or 2 for plane and axisymmetric models."""
        return 3 if self.model == "3d" else 2

    @property
    def mesh_dim(self) -> int:
        """Dimension of its elements."""
        return self.dim

    def with_elements(self, factor: float) -> Self:
        """The same with elements so many times as large, of one that has a `mesh_size`."""
        balls = tuple(replace(ball, size=factor * ball.size) for ball in self.refine)
        return replace(self, mesh_size=factor * (self.mesh_size or 0.0), refine=balls)

    @property
    def is_plane(self) -> bool:
        """Whether the body is a plate or slice with a thickness."""
        return self.model in {"plane_strain", "plane_stress"}

    @property
    def is_axisymmetric(self) -> bool:
        """Whether x is the radius and y the axis."""
        return self.model == "axisymmetric"

    def check_on_axis(self, where: str) -> None:
        """Nothing: models tell whether they fit."""

    @cached_property
    def of_groups(self) -> "Mapping[str, Solid]":
        """The body as it would be of each of its `materials` alone; empty without these."""
        return solids_of(self) if self.materials else {}

    @property
    def has_residual_stress(self) -> bool:
        """Whether stress is in it, or in one of its materials, without displacement."""
        each = (material.residual_stress for material in self.materials.values())
        return any(stress is not None for stress in (self.residual_stress, *each))

    @property
    def is_uniform(self) -> bool:
        """Whether its material is one everywhere, so that its constants are numbers."""
        constants = self.density, self.youngs_modulus, self.poisson_ratio
        return not (self.materials or any(isinstance(value, Formula) for value in constants))

    @property
    def is_orthotropic(self) -> bool:
        """Whether one of its materials is."""
        return any(each.orthotropic for each in (self.of_groups or {"": self}).values())

    @property
    def spectral(self) -> tuple[tuple[float, float, float], ...]:
        """Terms of Ogden's law: mu [Pa], alpha and beta of each."""
        return terms_of(self)

    @property
    def largest_ratio(self) -> float:
        """Largest of Poisson's ratios of its materials; of formulas what they may be at most."""
        each = (solid.poisson_ratio for solid in (self.of_groups or {"": self}).values())
        return max(NEARLY_INCOMPRESSIBLE if isinstance(nu, Formula) else nu for nu in each)

    @property
    def law(self) -> str:
        """Name of the law of its material; of several, of the first that is not linear."""
        laws = (material.material for material in self.materials.values())
        asked = [self.material if law is None else law for law in laws] or [self.material]
        return next((law for law in asked if law != "linear"), "linear")

    @property
    def is_finite(self) -> bool:
        """Whether it is computed under finite strain and rotation."""
        return self.strain == "finite" or (self.strain is None and self.law != "linear")

    @property
    def turns_far(self) -> bool:
        """Under finite strain."""
        return self.is_finite

    @property
    def why_iterated(self) -> str:
        """Finite strain, or materials that creep each in its own way."""
        if self.is_finite:
            return "has finite strain"
        return "has materials that creep each in its own way" if self.creeps_unlike else ""

    @property
    def meets_itself(self) -> bool:
        """Whether it may bend into itself."""
        return True

    @property
    def keeps_volume(self) -> bool:
        """Whether its elements keep their volume in the mean only: it is nearly incompressible."""
        gives_way = self.model == "plane_stress" or self.material == "foam"
        if not self.materials and (gives_way or self.orthotropic):
            return False
        if self.materials:
            return any(each.keeps_volume for each in self.of_groups.values())
        if self.element is None:
            return self.largest_ratio > NEARLY_INCOMPRESSIBLE
        return self.element == "mean_dilatation"

    @property
    def following(self) -> tuple[Pressure, ...]:
        """Pressures that act on their surface as it is by then."""
        if not self.is_finite:
            return ()
        return tuple(load for load in self.pressures if load.follows is not False)

    @property
    def derived(self) -> tuple[str, ...]:
        """Keys that follow from others: scene files leave them out."""
        found = () if self.materials else derived_constants(self)
        retarded = isinstance(self.viscoelastic, KelvinVoigt)
        filled = filled_keys(self) if self.damping else ()
        return (*found, *filled, *("rayleigh_stiffness",) * retarded)

    @property
    def relaxing(self) -> tuple[tuple[float, float], ...]:
        """Of each Maxwell term what it adds to the elasticity, as a share, and its time [s].

        Of several materials the terms of all, which each has in its own cells.
        """
        if self.materials:
            return tuple(term for each in self.of_groups.values() for term in each.relaxing)
        law = self.viscoelastic
        if not isinstance(law, Maxwell):
            return ()
        modulus = self.orthotropic.e1 if self.orthotropic else self.youngs_modulus
        return tuple((term.modulus / modulus, term.time) for term in law.terms)

    @property
    def remembered(self) -> tuple[tuple[float, float], ...]:
        """Those of `relaxing` whose stress is not that of some displacement: all or none."""
        return self.relaxing if self.is_finite or self.creeps_unlike else ()

    @property
    def creeps_unlike(self) -> bool:
        """Whether its materials relax or are retarded, and not all alike."""
        each = {(one.relaxing, one.rayleigh_stiffness) for one in self.of_groups.values()}
        return len(each) > 1 or any(terms for terms, _ in each)

    @property
    def retardation(self) -> float:
        """Time by which the stiffness damps [s], the longest of its materials."""
        each = (self.of_groups or {"": self}).values()
        return max(solid.rayleigh_stiffness for solid in each)

    @property
    def at_once(self) -> float:
        """Elasticity at once over that which is left after long."""
        return 1.0 + sum(share for share, _ in self.relaxing)

    @property
    def law_in_words(self) -> str:
        """Name of its law."""
        law = _LAW_WORDS[self.law] if self.is_finite else "linear elastic"
        return "orthotropic, " * bool(self.orthotropic) + law

    @property
    def shear_modulus(self) -> float:
        """Mu = E / (2 (1 + nu)) [Pa]; of orthotropic bodies that of the mean of all directions."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))

    @property
    def lame(self) -> float:
        """First Lamé parameter of the material, lambda = E nu / ((1 + nu) (1 - 2 nu)) [Pa]."""
        nu = self.poisson_ratio
        return self.youngs_modulus * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def p_wave_speed(self) -> float:
        """Speed [m/s] of the fastest waves: sqrt((lambda + 2 mu) / rho), in plane stress less."""
        nu = self.poisson_ratio
        if self.orthotropic:
            modulus, _ = self.orthotropic.wave_moduli(self.model)
        elif self.model == "plane_stress":
            modulus = self.youngs_modulus / ((1.0 - nu) * (1.0 + nu))
        else:
            modulus = self.lame + 2.0 * self.shear_modulus
        return math.sqrt(self.at_once * modulus / self.density)

    @property
    def s_wave_speed(self) -> float:
        """Speed [m/s] of shear waves, sqrt(mu / rho); of orthotropic bodies of the slowest."""
        modulus = self.shear_modulus
        if self.orthotropic:
            _, modulus = self.orthotropic.wave_moduli(self.model)
        return math.sqrt(self.at_once * modulus / self.density)

    @property
    def surface_names(self) -> tuple[str, ...] | None:
        """Names of the surfaces of the shape; None with a mesh file, which names its own."""
        if self.shape is None:
            return None
        return self.shape.surface_names(axisymmetric=self.is_axisymmetric)

    @property
    def all_supports(self) -> tuple[Support, ...]:
        """Supports as given, and those of symmetry cuts. The axis is not among them."""
        cuts = () if self.shape is None else self.shape.symmetry
        held = (Support(surface=f"symmetry_{axis}", kind="symmetry") for axis in cuts)
        return (*self.supports, *held)

    @property
    def cuts(self) -> tuple[tuple[int, float], ...]:
        """Those of its shape."""
        return () if self.shape is None else self.shape.cuts

    @property
    def volume(self) -> float | None:
        """Volume [m^3] of what is modelled, after symmetry cuts; None with a mesh file."""
        if self.shape is None:
            return None
        if self.is_axisymmetric:
            return self.shape.revolved_volume
        return self.shape.volume * (self.thickness if self.dim == 2 else 1.0)

    @property
    def mass(self) -> float | None:
        """Mass [kg] of what is modelled, after symmetry cuts; None with a mesh file or formula."""
        volume = self.volume if self.is_uniform else None
        return None if volume is None else self.density * volume
