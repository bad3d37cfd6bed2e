"""What a mesh file holds, in numbers and in words: elements, their order, groups by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

_KIND = ("point", "curve", "surface", "volume")
STRAIGHT = 1e-6
"""Share of an element by which its nodes may miss straight edges and still count as on them."""


@dataclass(frozen=True)
class Group:
    """A physical group.

    Attributes:
        name: Its name, or its number in the file.
        dim: Dimension of its elements.
        elements: How many it has.
        entities: Gmsh's tags of the parts of the geometry in it.
        low: Least coordinates of its nodes, shape (3,).
        high: Largest ones, shape (3,).
    """

    name: str
    dim: int
    elements: int
    entities: tuple[int, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]

    def __str__(self) -> str:
        many = "" if self.elements == 1 else "s"
        return f"{_KIND[self.dim]} {self.name!r} ({self.elements} element{many})"


@dataclass(frozen=True)
class Holdings:
    """What Gmsh found in a file.

    Attributes:
        elements: Number of elements by kind, those of the highest dimension only.
        order: Highest order of their geometry.
        bent: Largest distance of a node from where straight edges would have it, over the size of
            its element; 0 for first order.
        groups: The physical groups.
    """

    elements: Mapping[str, int]
    order: int
    bent: float
    groups: tuple[Group, ...]

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> "Holdings":
        """From the plain data of the process that read the file."""
        groups = tuple(
            Group(
                str(entry["name"]), int(entry["dim"]), int(entry["elements"]),
                *(tuple(entry[key]) for key in ("entities", "low", "high")),
            )
            for entry in data["groups"]
        )  # fmt: skip
        return cls(dict(data["elements"]), int(data["order"]), float(data["bent"]), groups)

    @property
    def is_curved(self) -> bool:
        """Whether straight elements would be another body."""
        return not self.bent <= STRAIGHT

    def of_dim(self, dim: int) -> tuple[Group, ...]:
        """Groups of a dimension that have elements."""
        return tuple(group for group in self.groups if group.dim == dim and group.elements)

    def told(self, uses: Mapping[Group, str]) -> str:
        """The file in words.

        Args:
            uses: What each group serves for; those that are missing serve for nothing.
        """
        kinds = [f"{count} {kind} elements" for kind, count in self.elements.items()]
        shape = f" of order {self.order}{', curved' * self.is_curved}"
        groups = [f"{group} = {uses.get(group, 'not used')}" for group in self.groups]
        return f"{' and '.join(kinds)}{shape}; {', '.join(groups) or 'no groups'}"

    def shared(self) -> tuple[Group, Group, int] | None:
        """Two groups that share a part of the geometry, and its tag."""
        owners: dict[tuple[int, int], Group] = {}
        for group in self.groups:
            for entity in group.entities:
                other = owners.setdefault((group.dim, abs(entity)), group)
                if other is not group:
                    return other, group, entity
        return None
