"""Places at which a tie holds two bodies: means of nodes, or places of what is rigid."""

from dataclasses import dataclass

from impactfem.arrays import Floats
from impactfem.system.stations import Asked


@dataclass(frozen=True)
class TiedPlace:
    """Two places that a tie holds together along some axes.

    Attributes:
        sides: What it holds of either body, in the order of the scene.
        arms: From means of nodes to where they are held [m], (2, 3); what is rigid has its own.
        along: Numbers of the axes.
    """

    sides: tuple[Asked, Asked]
    arms: Floats
    along: tuple[int, ...]
