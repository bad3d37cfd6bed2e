"""Surfaces of unlike meshes glued together, or to what is rigid: rows as those of joints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from impactfem.scene.inline import ListOf
from impactfem.scene.joints import Joint
from impactfem.scene.kinds import Name, Real, SideName
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show


@dataclass(frozen=True, kw_only=True)
class TieRows(Joint):
    """A tie as what holds two bodies: how many rows it has its meshes say.

    Attributes:
        number: Number of coordinates.
        break_force: Above which it lets go [N]; None: never.
    """

    heading: ClassVar[str] = "tie"

    number: int
    break_force: float | None

    def __post_init__(self) -> None:
        """Nothing: the tie is checked."""

    @property
    def dim(self) -> int:
        """Number of coordinates."""
        return self.number

    @property
    def holds(self) -> bool:
        """It does."""
        return True

    @property
    def is_driven(self) -> bool:
        """It moves nothing."""
        return False

    @property
    def start(self) -> float:
        """It has no coordinate."""
        return 0.0


@table("[[tie]]")
class Tie:
    """Two surfaces that stay together, of meshes that need not match, or one and what is rigid.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "tie"

    name: str = key(Name(), "name of the tie in columns such as `force.NAME`", default="tie")
    between: Sequence[str] = key(
        ListOf(SideName(), at_least=2),
        "names of two surfaces of solids (`block/top`) that touch at t = 0, or of one and of a "
        'rigid body or "ground"',
    )
    break_force: float | None = key(
        Real(above=0), "amount of its resultant above which it lets go, at the end of that step",
        unit="N", default=None, absent="it holds for ever",
    )  # fmt: skip

    def _check(self) -> None:
        given = f" = {show(list(self.between))}"
        if len(self.between) != 2:
            text = f"{given} has {len(self.between)} names: give two."
            raise KeyedError(self.heading, "between", text)
        if self.between[0] == self.between[1]:
            text = f"{given} is one surface twice: a tie needs two; give another."
            raise KeyedError(self.heading, "between", text)

    def rows(self, dim: int) -> TieRows:
        """It as what holds bodies."""
        return TieRows(
            name=self.name, kind="fixed", between=self.between, number=dim,
            break_force=self.break_force,
        )  # fmt: skip
