"""Settings of a scene: how to solve it and which fields to write."""

from dataclasses import dataclass
from typing import ClassVar, TypedDict, override

from impactfem.extensions import load_installed
from impactfem.methods import METHODS
from impactfem.scene.kinds import (
    Choice,
    Choices,
    FilePath,
    Integer,
    Kind,
    Real,
    Switch,
    one_of,
)
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import is_number, show

ACTIVE_SETS = ("pdas", "snes_vi")
NORMALS = ("fixed", "updated")
LINEAR_SOLVERS = ("mumps", "gamg")
IMPACT_LAWS = ("simultaneous", "sequential")
FIELD_FORMATS = ("vtkhdf", "vtx", "pvd")


@dataclass(frozen=True)
class Window(Kind):
    """A number of layers, or the word "all"."""

    type_name: ClassVar[str] = "integer or text"

    @property
    @override
    def allowed(self) -> str:
        return 'a number of time steps from 1 on or "all"'

    @override
    def read(self, value: object) -> int | str:
        if is_number(value):
            return Integer(1, 1_000_000_000).read(value)
        return one_of(value, ("all",))


@dataclass(frozen=True)
class MethodKind(Choice):
    """A method; those of installed extensions are known too."""

    @override
    def read(self, value: object) -> str:
        load_installed()
        return super().read(value)


@table("[solve]")
class Solve:
    """How to solve the scene; None leaves the choice to the plan, which says why.

    Raises:
        SceneError: a value is not allowed, or two keys contradict each other.
    """

    heading: ClassVar[str] = "solve"

    method: str | None = key(MethodKind(METHODS), "solution method", default=None)
    elements: int | None = key(
        Integer(2, 1_000_000), "number of elements along the bar", default=None
    )
    courant: float | None = key(Real(above=0), "c dt / h, time step by grid size", default=None)
    dt: float | None = key(Real(above=0), "time step, instead of courant", unit="s", default=None)
    window: int | str | None = key(
        Window(), "time steps that one active-set loop solves together", default=None
    )
    active_set: str | None = key(
        Choice(ACTIVE_SETS), "primal-dual active set, or PETSc's SNES VI", default=None
    )
    gamma: float | None = key(
        Real(above=0), "dimensionless merit constant of the active set", default=None
    )
    tolerance: float | None = key(
        Real(above=0, below=1), "relative tolerance of the active set", default=None
    )
    max_iterations: int | None = key(
        Integer(1, 1_000_000), "largest number of active-set iterations", default=None
    )
    friction_residual: float | None = key(
        Real(above=0, below=0.1),
        "error left in forces of many contacts with friction, as a fraction of the largest "
        "(rigid bodies)",
        default=None,
    )
    mesh: str | None = key(
        FilePath(endings=(".geo", ".msh")),
        "space-time mesh to use instead of a generated one",
        default=None,
    )
    accuracy: float | None = key(
        Real(above=0, below=1), "relative error wished; chooses method and size", default=None
    )
    degree: int | None = key(Integer(0, 2), "polynomial degree of method dg", default=None)
    fitted: bool | None = key(
        Switch(), "whether events and characteristics become mesh lines (method dg)", default=None
    )
    normals: str | None = key(
        Choice(NORMALS),
        "contact normals of the undeformed body, or updated in each time step (solid)",
        default=None,
    )
    linear_solver: str | None = key(
        Choice(LINEAR_SOLVERS), "factorised, or by multigrid (solid)", default=None
    )
    estimate: bool | None = key(
        Switch(),
        "whether the error is estimated by further runs: on elements twice and four times as large "
        "(solids; half as large, of a mesh file), by another method or step (point, rod, beam)",
        default=None,
    )

    impact_law: str | None = key(
        Choice(IMPACT_LAWS),
        "how contacts that land together share an impact: at once, or one after the other (bodies "
        "without waves)",
        default=None,
    )
    stick_speed: float | None = key(
        Real(at_least=0),
        "normal speed from which on a contact lasts (event_driven)",
        unit="m/s",
        default=None,
    )

    def _check(self) -> None:
        self._exclude("dt", ("courant",), "each follows from the other; remove one of them")
        fixed = "the mesh fixes it; remove one of them"
        self._exclude("mesh", ("elements", "courant", "dt"), fixed)
        method = None if self.method is None else METHODS[self.method]
        if method is not None and method.exact:
            without = ("mesh", "active_set", "gamma", "tolerance", "max_iterations", "window")
            reason = "the exact solution has no mesh and no iterations; remove one of them"
            self._exclude("method", without, reason)
        if method is not None and method.layered:
            self._exclude("method", ("degree", "fitted"), 'they belong to method = "dg"')
            fixed = "the size follows from the accuracy; remove one of them"
            self._exclude("accuracy", ("elements",), fixed)
        if method is not None and not method.layered:
            reason = "triangles have no time steps; remove one of them"
            self._exclude("method", ("courant", "dt"), reason)
            if self.window not in {None, 1, "all"}:
                self._exclude("window", ("method",), 'dg knows 1 and "all"')
        windowed = method is None or method.windowed
        if not windowed and self.window not in {None, "all"}:
            self._exclude("window", ("method",), "only galerkin has windows of time steps")

    def _exclude(self, name: str, others: tuple[str, ...], why: str) -> None:
        """Refuse a key together with others."""
        for other in others:
            one, two = getattr(self, name), getattr(self, other)
            if one is not None and two is not None:
                text = f" = {show(one)} contradicts {other} = {show(two)}: {why}."
                raise KeyedError("solve", name, text)


class Settings(TypedDict, total=False):
    """Keys of `Solve` as the arguments of `impactfem.solve`, for editors and type checkers."""

    method: str | None
    elements: int | None
    courant: float | None
    dt: float | None
    window: int | str | None
    active_set: str | None
    gamma: float | None
    tolerance: float | None
    max_iterations: int | None
    friction_residual: float | None
    mesh: str | None
    accuracy: float | None
    degree: int | None
    fitted: bool | None
    normals: str | None
    linear_solver: str | None
    estimate: bool | None
    impact_law: str | None
    stick_speed: float | None


@table("[output]")
class Output:
    """Which field files, checkpoints and pictures to write.

    Raises:
        SceneError: a value is not allowed.
    """

    heading: ClassVar[str] = "output"

    fields: tuple[str, ...] = key(
        Choices(FIELD_FORMATS), "formats of the field output", default=("vtkhdf",)
    )
    every: int | None = key(
        Integer(1, 1_000_000_000),
        "field output every so many time steps; absent: every one, of long time-stepped runs fewer",
        default=None,
    )
    checkpoint: int | None = key(
        Integer(0, 1_000_000_000),
        "checkpoint every so many time steps, 0 for none; absent: every half a minute of what is "
        "marched for more than one",
        default=None,
    )
    pictures: bool = key(Switch(), "whether to draw pictures, as PNG files", default=True)
    film: bool | None = key(
        Switch(), "whether to write motion.gif; absent: where it is cheap", default=None
    )
    report: bool = key(Switch(), "whether to write report.html", default=True)

    @property
    def stride(self) -> int:
        """Time steps from one to the next that is kept of what has no time loop."""
        return self.every or 1
