"""A scene by what shapes its model, so that plan and run can share one model."""

from impactfem.scene import Scene

_NOT_MODEL = {"title", "solve", "output"}


class SceneKey:
    """Equal for scenes with the same model: solver and output settings may differ."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        parts = scene.to_dict()
        self._text = repr([scene.folder, *(parts[k] for k in sorted(set(parts) - _NOT_MODEL))])

    def __hash__(self) -> int:
        return hash(self._text)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SceneKey) and self._text == other._text
