"""A method with settings, as studies name it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from impactfem.errors import SceneError
from impactfem.methods import METHODS
from impactfem.scene import parse_assignment


@dataclass(frozen=True)
class Variant:
    """A method with settings.

    Attributes:
        name: As tables show it, as "galerkin@courant=0.5".
        method: Name as in `impactfem methods`.
        settings: Keys of ``[solve]``; with "elements" it is run at this size only.
    """

    name: str
    method: str
    settings: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str) -> "Variant":
        """Read "galerkin" or "dg@degree=1,fitted=true".

        Raises:
            SceneError: The method is unknown or a setting is malformed.
        """
        method, _, rest = text.partition("@")
        if method not in METHODS:
            raise SceneError(f'method = "{method}" is unknown; choose from {", ".join(METHODS)}')
        pairs = (parse_assignment(f"solve.{item}") for item in rest.split(",") if item)
        return cls(text, method, {key.removeprefix("solve."): value for key, value in pairs})

    @staticmethod
    def split(text: str) -> list[str]:
        """Split a list at its commas, but not at those between settings of one method."""
        names: list[str] = []
        for part in (part.strip() for part in text.split(",")):
            if names and "=" in part and "@" not in part:
                names[-1] += f",{part}"
            elif part:
                names.append(part)
        return names
