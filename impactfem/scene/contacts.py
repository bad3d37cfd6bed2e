"""Contact laws of a scene: which bodies meet, and what an impact leaves of their speed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from impactfem.scene.inline import ListOf
from impactfem.scene.kinds import Name, Real, SideName
from impactfem.scene.schema import KeyedError, check_fields, key, table
from impactfem.scene.values import show


@table("[[contact]]")
@dataclass(frozen=True, kw_only=True)
class Contact:
    """A pair that may meet: two bodies, a body and an obstacle, or a body and itself.

    Raises:
        SceneError: a value is missing or not allowed.
    """

    heading: ClassVar[str] = "contact"

    name: str | None = key(
        Name(),
        "name of the pair in columns such as `force.NAME`",
        default=None,
        absent="those of between, as ball.floor or ball_skin.floor",
    )
    between: Sequence[str] = key(
        ListOf(SideName(), at_least=2),
        "names of two bodies, or of a body and an obstacle; a surface of a solid as ball/skin; "
        "twice the same solid, of finite strain, where it may meet itself",
    )
    restitution: float = key(
        Real(at_least=0),
        "Newton's coefficient of restitution, 0 to 1 (point, rod, beam, rigid)",
        default=0.0,
    )
    friction_coefficient: float = key(Real(at_least=0), "Coulomb's coefficient", default=0.0)
    tangential_restitution: float = key(
        Real(at_least=0),
        "share of the slip that an impact reverses as far as friction can, 0 to 1 (1: superball)",
        default=0.0,
    )

    def __post_init__(self) -> None:
        check_fields(self, self.heading)
        if len(self.between) != 2:
            text = f" = {show(list(self.between))} has {len(self.between)} names: give two."
            raise KeyedError(self.heading, "between", text)
        for name in ("restitution", "tangential_restitution"):
            if (value := getattr(self, name)) > 1.0:
                text = f" = {show(value)} is not allowed: an impact would gain energy; "
                text += "give a number from 0 (no rebound) to 1 (no loss)."
                raise KeyedError(self.heading, name, text)
        if self.tangential_restitution and not self.friction_coefficient:
            text = f" = {show(self.tangential_restitution)} needs friction_coefficient: without "
            text += "friction nothing acts along the surface; give it (large where nothing slips)."
            raise KeyedError(self.heading, "tangential_restitution", text)
