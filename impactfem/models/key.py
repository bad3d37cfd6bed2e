"""A scene by what shapes its model, so that plan and run can share one model."""

from pathlib import Path

from impactfem.scene import Scene

_NOT_MODEL = {"title", "solve", "output"}
_FILES = ("mesh", "heights", "file")


class SceneKey:
    """Equal for scenes with the same model: solver and output settings may differ."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        parts = scene.to_dict()
        given = [scene.folder, *(parts[k] for k in sorted(set(parts) - _NOT_MODEL))]
        entries = [*parts["body"], *parts["obstacle"]]
        files = [entry[name] for entry in entries for name in _FILES if name in entry]
        self._text = repr([*given, *(_stamp(Path(scene.folder or "", name)) for name in files)])

    def __hash__(self) -> int:
        return hash(self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SceneKey) and self._text == other._text


def _stamp(path: Path) -> int:
    """When a file was written last [ns]; 0 if it is not there, which others tell."""
    return path.stat().st_mtime_ns if path.exists() else 0
