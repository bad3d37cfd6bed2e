"""Scenes that come with impactfem, by name."""

from importlib.resources import files
from pathlib import Path

from impactfem.errors import SceneError


def shipped_scenes() -> dict[str, Path]:
    """Paths of the shipped scenes by name, in alphabetical order."""
    folder = Path(str(files("impactfem") / "scenes"))
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def find_scene(text: str) -> Path:
    """The scene a user means: a file, or else the name of a shipped scene.

    Raises:
        SceneError: It is neither.
    """
    path, scenes = Path(text), shipped_scenes()
    if path.exists() or path.suffix:
        return path
    if text in scenes:
        return scenes[text]
    raise SceneError(f"{text}: neither a file nor a shipped scene; shipped are {', '.join(scenes)}")
