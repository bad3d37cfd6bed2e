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
    try:
        is_path = path.exists() or bool(path.suffix)
    except (OSError, ValueError):  # too long a name; whoever reads it says so
        is_path = True
    if is_path:
        return path
    if text in scenes:
        return scenes[text]
    raise SceneError(f"{text}: neither a file nor a shipped scene; shipped are {', '.join(scenes)}")
