"""Settings of a scene: how to solve it and which fields to write."""

from dataclasses import dataclass
from pathlib import PurePath
from typing import ClassVar

from impactfem.scene.kinds import Choice, Choices, Integer, Line, NotAllowedError, Real
from impactfem.scene.schema import KeyFault, check_fields, key, table

METHODS = ("galerkin", "exact")


@dataclass(frozen=True)
class _Window(Choice):
    """The word "all"; numbers of layers will come."""

    def read(self, value: object) -> str:
        """Return "all"; raise NotAllowedError saying why not."""
        if isinstance(value, int | float) and not isinstance(value, bool):
            raise NotAllowedError('windows are not available yet, use "all"')
        return super().read(value)


@dataclass(frozen=True)
class _MeshPath(Line):
    """The path of a mesh file."""

    max_length: int = 1000
    type_name: ClassVar[str] = "text"

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        return "the path of a .geo or .msh file, relative to the scene file or absolute"

    def read(self, value: object) -> str:
        """Return the path as a text; raise NotAllowedError saying why not."""
        path = super().read(str(value) if isinstance(value, PurePath) else value)
        if not path.lower().endswith((".geo", ".msh")):
            raise NotAllowedError("its name does not end in .geo or .msh")
        return path


@table("[solve]")
@dataclass(frozen=True, kw_only=True)
class Solve:
    """How to solve the scene; None leaves the choice to the plan, which says why.

    Raises:
        SceneError: a value is not allowed, or two keys contradict each other.
    """

    method: str | None = key(Choice(METHODS), "solution method", default=None)
    elements: int | None = key(
        Integer(2, 1_000_000), "number of elements along the bar", default=None
    )
    courant: float | None = key(Real(above=0), "c dt / h, time step over grid size", default=None)
    dt: float | None = key(Real(above=0), "time step, instead of courant", unit="s", default=None)
    window: str | None = key(
        _Window(("all",)), "time layers that one active-set loop solves together", default=None
    )
    active_set: str | None = key(
        Choice(("pdas", "snes_vi")), "primal-dual active set or PETSc's SNES VI", default=None
    )
    gamma: float | None = key(
        Real(above=0), "merit constant of the active set, dimensionless", default=None
    )
    tolerance: float | None = key(
        Real(above=0, below=1), "relative tolerance of the active set", default=None
    )
    max_iterations: int | None = key(
        Integer(1, 1_000_000), "largest number of active-set iterations", default=None
    )
    mesh: str | None = key(
        _MeshPath(), "space-time mesh to use instead of a generated one", default=None
    )

    def __post_init__(self) -> None:
        check_fields(self, "solve")
        self._contradict("dt", ("courant",), "each follows from the other; remove one of them")
        self._contradict(
            "mesh", ("elements", "courant", "dt"), "the mesh fixes them; remove one or the other"
        )
        if self.method == "exact":
            self._contradict(
                "method",
                ("mesh", "active_set", "gamma", "tolerance", "max_iterations"),
                "the exact solution needs neither mesh nor iterations; remove one of the two keys",
            )

    def _contradict(self, first: str, others: tuple[str, ...], why: str) -> None:
        for other in others:
            one, two = getattr(self, first), getattr(self, other)
            if one is not None and two is not None:
                raise KeyFault("solve", first, f" = {one!r} contradicts {other} = {two!r}: {why}.")


@table("[output]")
@dataclass(frozen=True, kw_only=True)
class Output:
    """Which field files to write.

    Raises:
        SceneError: a value is not allowed.
    """

    fields: tuple[str, ...] = key(
        Choices(("vtkhdf", "vtx", "pvd")), "formats of the field output", default=("vtkhdf",)
    )
    every: int = key(Integer(1, 1_000_000_000), "field output every so many time layers", default=1)

    def __post_init__(self) -> None:
        check_fields(self, "output")
