"""Errors of impactfem: each message names the object, the value and the remedy."""

import traceback

__all__ = [
    "ConvergenceError",
    "FolderError",
    "ImpactError",
    "ImpactWarning",
    "MeshError",
    "MissingDependencyError",
    "OutputError",
    "SceneError",
]


class ImpactError(Exception):
    """Base of all errors a user can cause or meet; the command line prints its message only."""

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the kind, the message, and the user's line that met it."""
        frames = traceback.extract_tb(self.__traceback__)
        # Constructors of dataclasses have no file: their lines cannot be shown.
        of_users = [f for f in frames if f.line and not f.filename.startswith(_OURS)]
        public = next(kind for kind in type(self).__mro__ if kind.__module__ == __name__)
        lines = [f"{public.__name__}:", plain(str(self))]
        if of_users:
            last = of_users[-1]
            lines.append(f"in line {last.lineno}: {last.line}")
        return lines


class SceneError(ImpactError):
    """A scene cannot be read or contradicts itself."""


class MeshError(ImpactError):
    """A mesh is missing, broken or does not fit the scene."""


class ConvergenceError(ImpactError):
    """A solver stopped without the requested accuracy."""


class MissingDependencyError(ImpactError):
    """A library that the requested task needs is not installed."""


class OutputError(ImpactError):
    """A result cannot be written or read back."""


class FolderError(OutputError):
    """The folder for a result holds other files, which it could replace."""


class ImpactWarning(UserWarning):
    """A result is correct but must be read with care, as an impact without a unique outcome."""


_OURS = __file__.rpartition("errors.py")[0]  # the folder of the package

# Control characters but tab and line break, and those that turn the direction of writing.
_CONTROLS = {
    code: ascii(chr(code))[1:-1]
    for code in (*range(9), *range(11, 32), *range(127, 160), *range(0x202A, 0x202F),
                 *range(0x2066, 0x206A))
}  # fmt: skip


def plain(text: str) -> str:
    """A message whose control characters are spelt out: names in foreign files may hold them."""
    return text.translate(_CONTROLS)
