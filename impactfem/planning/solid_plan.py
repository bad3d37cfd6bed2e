"""The plan of bodies that are marched, as data, and what they are in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, override

from impactfem.planning.plans import Numbers, Plan, cost_rows, estimate_row
from impactfem.planning.solid_costs import Size
from impactfem.result.whole import Whole
from impactfem.scene import Scene
from impactfem.scene.solids import Solid

if TYPE_CHECKING:
    from impactfem.models.solids import SolidsModel
    from impactfem.system.few import FewBodies

_MODELS = {
    "plane_strain": "in plane strain",
    "plane_stress": "in plane stress",
    "axisymmetric": "axisymmetric",
    "3d": "in 3D",
}
_CELLS = {
    (2, "simplex"): "triangles", (3, "simplex"): "tetrahedra",
    (2, "hexahedron"): "quadrilaterals", (3, "hexahedron"): "hexahedra",
}  # fmt: skip


STARTS = {
    "static": {
        "start": "at rest: equilibrium of loads, gravity, supports and contact at "
        "t = 0 is found before the first time step"
    }
}
"""What is told of starts."""


@dataclass(frozen=True, kw_only=True)
class MarchNumbers(Numbers):
    """Numbers of the march, of one body or several.

    Attributes:
        degree: Largest degree of the elements.
        degrees: That of each body.
        strains: "small" or "finite", of each body.
        cells: "simplex" or "hexahedron", of the first body.
        mesh_size: Size of the smallest elements [m], the mean one with a mesh file.
        dt: Time step [s]; None if it is a share of the stable step, which is found at run time.
        courant: c_p dt / h of implicit methods; for explicit ones the share of the stable step, or
            None if dt is given.
        layers: Time steps; None as for dt.
        linear_solver: "mumps", "gamg" or "none".
        normals: "fixed" or "updated".
        active_set: Solver of the contact conditions.
        tolerance: Rounding level of gaps, relative to the size of the body.
        max_iterations: Limit of linear solves of one active-set loop.
        contact_pairs: Gaps: of nodes to obstacles, and between bodies.
        unknowns: Displacement components.
        estimate: Whether the error is estimated by runs on other elements.
        resizing: How many times as large elements are in these.
        unresized: Bodies whose elements stay as they are there.
        whole: What is told of, if planes of symmetry leave only a part to be computed.
        apart: Whether the step is one for bodies that nothing strikes.
    """

    degree: int = 0
    degrees: tuple[int, ...] = ()
    strains: tuple[str, ...] = ()
    cells: str = "none"
    mesh_size: float
    dt: float | None
    courant: float | None = None
    layers: int | None
    linear_solver: str
    normals: str
    active_set: str
    tolerance: float
    max_iterations: int
    contact_pairs: int
    unknowns: int
    estimate: bool
    resizing: tuple[float, ...]
    unresized: tuple[str, ...]
    whole: Whole
    apart: bool = False

    @override
    def rows(self, plan: Plan[Any]) -> list[tuple[str, str]]:
        found_later = "as many as the stable step asks for, found when the run starts"
        if self.dt is None:
            step = f"{self.courant:g} of the stable step"
        elif self.courant is None:
            step = f"{self.dt:g} s"
        else:
            step = f"{self.dt:g} s (courant {self.courant:g})"
        limits = f"tolerance {self.tolerance:g}, at most {self.max_iterations} iterations"
        return [
            *([("mesh size", f"{self.mesh_size:g} m")] if self.mesh_size else []),
            ("time steps", found_later if self.layers is None else str(self.layers)),
            ("dt", step),
            ("linear solver", self.linear_solver),
            ("normals", self.normals),
            ("active set", f"{self.active_set}, {limits}"),
            ("unknowns", f"{self.unknowns} ({self.contact_pairs} contact pairs)"),
            estimate_row(self),
            *cost_rows(plan),
        ]


def in_words(scene: Scene, sizes: Sequence[Size]) -> str:
    """What the bodies are, in words."""
    each = [_body(solid, size) for solid, size in zip(scene.solids, sizes, strict=True)]
    if len(each) > 1:
        each = [f"{solid.name}: {text}" for solid, text in zip(scene.solids, each, strict=True)]
    laws = " and ".join(dict.fromkeys(solid.law_in_words for solid in scene.solids))
    return "; ".join([*each, f"{laws}, {law_in_words(scene)}"])


def law_in_words(scene: Scene) -> str:
    """What bodies meet, and how."""
    rubs = any(contact.friction_coefficient > 0.0 for contact in scene.contacts)
    walls = "rigid obstacles, " * bool(scene.rigid_obstacles)
    return walls + ("Coulomb friction" if rubs else "no friction")


def _body(solid: Solid, size: Size) -> str:
    what = "body of a mesh file" if solid.shape is None else solid.shape.kind
    letter = "P" if size.cells == "simplex" else "Q"
    kind = _CELLS[size.dim, size.cells]
    text = f"{what} {_MODELS[solid.model]}"
    cuts = () if solid.shape is None else solid.shape.symmetry
    if cuts:
        fraction = {1: "half", 2: "quarter", 3: "eighth"}[len(cuts)]
        text = f"{fraction} of a {text}"
    return f"{text}, {letter}{size.degree} {kind}"


def few_in_words(few: Sequence["FewBodies"]) -> str:
    """What the bodies are, in words."""
    return ", ".join(bodies.words for bodies in few)


def joined_in_words(model: "SolidsModel") -> str:
    """What joints leave free, in words with a comma behind; empty without any."""
    if model.joints is None:
        return ""
    each, free = model.joints.joints, model.joints.mobility
    plural = "" if len(each) == 1 else "s"
    degrees = "degree" if free == 1 else "degrees"
    return (
        f"{len(each)} joint{plural} that leave{'' if plural else 's'} {free} {degrees} of freedom, "
    )
