"""One vocabulary of damping for bodies of all kinds that deform: `damping = { ... }`.

    C = mass M + stiffness K,    or  2 zeta / w K  of the first mode, w its angular frequency.

The table fills the keys that each kind has besides: `rayleigh_mass`, `rayleigh_stiffness` and
`damping_ratio`, which say the same one by one.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

from impactfem.scene.given import Given
from impactfem.scene.inline import NumberOrList
from impactfem.scene.kinds import Real
from impactfem.scene.schema import KeyedError, key, table
from impactfem.scene.values import show

MOST_RATIOS = 100
"""Number of modes that may have a damping of their own."""
FILLED = {"mass": "rayleigh_mass", "stiffness": "rayleigh_stiffness", "ratio": "damping_ratio"}
"""Keys of a body that those of the table stand for."""
RATIO = "damping of the first mode of vibration over the critical one, by the stiffness"
"""What the damping ratio of bodies on meshes is."""

QUALITY = (
    "of the first mode of vibration: its energy over what it loses in a radian; by the mass, of a "
    "body that nothing holds by the stiffness"
)


@table("damping = { ... }")
class Damping:
    """How a body loses energy as it deforms: by its mass and stiffness, or in its first modes.

    Raises:
        SceneError: a value is not allowed, or nothing is damped.
    """

    heading: ClassVar[str] = "damping"

    mass: float = key(
        Real(at_least=0), "by the mass: speeds fall at this rate, those of a fall too", unit="1/s",
        default=0.0,
    )  # fmt: skip
    stiffness: float = key(
        Real(at_least=0), "by the stiffness: the time of what creeps", unit="s", default=0.0
    )
    ratio: Given[Sequence[float] | None, float] = key(
        NumberOrList(Real(at_least=0, below=1), MOST_RATIOS),
        "of the first mode over the critical one, by the stiffness; of plates a list is of the "
        "first modes",
        default=None, absent="none",
    )  # fmt: skip

    def _check(self) -> None:
        if not (self.mass or self.stiffness or self.ratio):
            text = " is missing, and so are stiffness and ratio: give one, or remove damping."
            raise KeyedError(self.heading, "mass", text)


def fill_damping(body: Any) -> None:
    """Fill the keys of a body that its table of damping stands for, and refuse two of one thing.

    Args:
        body: With the keys `damping`, `rayleigh_mass`, `rayleigh_stiffness`, `damping_ratio` and
            `quality_factor`.

    Raises:
        KeyedError: naming the key.
    """
    given = body.damping
    for name, filled in FILLED.items() if given is not None else ():
        value = getattr(given, name)
        if not value:
            continue
        if name == "ratio" and not body.damped_by_modes:
            if len(value) > 1:
                text = f".ratio = {show(list(value))} has {len(value)} entries, of which a "
                text += f"{body.kind} takes that of its first mode: give one."
                raise KeyedError(body.kind, "damping", text)
            (value,) = value
        if (own := getattr(body, filled)) and own != value:
            text = f" = {show(own)} contradicts damping.{name}: remove one of them."
            raise KeyedError(body.kind, filled, text)
        object.__setattr__(body, filled, value)
    _check_damping(body)


def filled_keys(body: Any) -> tuple[str, ...]:
    """Keys of a body that its table of damping has filled."""
    given = body.damping
    if given is None:
        return ()
    return tuple(filled for name, filled in FILLED.items() if getattr(given, name))


def _check_damping(owner: Any) -> None:
    """Refuse damping that is given twice."""
    names = ("rayleigh_mass", "rayleigh_stiffness", "quality_factor")
    for k, name in enumerate(names):
        for other in ("damping_ratio", names[-1])[: 2 - k // 2]:
            if (value := getattr(owner, name)) and getattr(owner, other):
                text = f" = {value:g} contradicts {other}: remove one of them."
                raise KeyedError(owner.kind, name, text)


def rayleigh_of(body: Any, first: float, *, held: bool) -> tuple[float, float]:
    """What C = a M + b K its damping asks for, by its first angular frequency.

    Args:
        body: With the keys of damping, and one ratio at most.
        first: [rad/s].
        held: Whether it cannot move without strain, which damping by the mass would brake.

    Returns:
        a [1/s] and b [s].
    """
    if (quality := body.quality_factor) is not None:
        return (first / quality, 0.0) if held else (0.0, 1.0 / (first * quality))
    if body.damping_ratio:
        return 0.0, 2.0 * body.damping_ratio / first
    return body.rayleigh_mass, body.rayleigh_stiffness
