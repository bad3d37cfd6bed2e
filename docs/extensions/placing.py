"""Put generated files in place without touching those that have not changed, and clear the rest."""

import shutil
from pathlib import Path


class Placed:
    """Files of folders that are wholly generated.

    A file that has not changed keeps its date: Sphinx does not read its page again, and a build
    beside this one does not miss it.
    """

    def __init__(self, *folders: Path) -> None:
        self.folders = folders
        self.files: set[Path] = set()

    def _new(self, path: Path) -> Path:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.files.add(path)
        return path

    def text(self, path: Path, text: str) -> None:
        """Write a text."""
        write_changed(self._new(path), text)

    def copy(self, source: Path, path: Path) -> None:
        """Copy a file, unless the copy has its size and date."""
        self._new(path)
        old, new = path.stat() if path.is_file() else None, source.stat()
        if old is None or (old.st_size, int(old.st_mtime)) != (new.st_size, int(new.st_mtime)):
            shutil.copy2(source, path)

    def bytes(self, path: Path, content: bytes) -> None:
        """Write bytes."""
        if not self._new(path).is_file() or path.read_bytes() != content:
            path.write_bytes(content)

    def clear(self) -> None:
        """Remove what earlier builds left in the folders."""
        for folder in self.folders:
            for path in folder.rglob("*"):
                if path.is_file() and path not in self.files:
                    path.unlink()


def write_changed(path: Path, text: str) -> None:
    """Write a text unless the file holds it already."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
