"""Evaluations of a search, kept so that it can go on after an interruption, bit by bit.

The file holds what each run told. A search that begins again asks for the same values in the same
order, and runs only what is not there.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import IO

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import FolderError, OutputError
from impactfem.inverse.steps import Slopes
from impactfem.processes import on_root
from impactfem.scene import Scene

NAME = "search.npy"


class Evaluations:
    """What runs of a search told, in memory and in a file.

    Args:
        scene: The scene that is searched.
        folder: Where the file is kept.
        restart: Folder of a search to go on with; None for a new one.

    Attributes:
        taken: How many evaluations were taken from the file.

    Raises:
        FolderError: There is no such search, or it is of another scene.
        OutputError: The folder cannot be written.
    """

    def __init__(self, scene: Scene, folder: Path, restart: Path | None = None) -> None:
        key = hashlib.sha256(scene.to_toml(Path("/")).encode()).hexdigest()
        self.taken = 0
        self._known: dict[bytes, Slopes] = {}
        self._path = folder / NAME
        if restart is not None:
            self._read(restart / NAME, key)

        def begin() -> None:
            folder.mkdir(parents=True, exist_ok=True)
            # Replaced as a whole, for interruptions and for other ranks that still read it.
            beside = self._path.with_suffix(".new")
            with beside.open("wb") as file:
                np.save(file, np.array(key))
                for values, slopes in self._known.items():
                    _write(file, np.frombuffer(values), slopes)
            beside.replace(self._path)

        self._on_root(begin)

    def find(self, values: Floats) -> Slopes | None:
        """What the run with some values told; None if it was not run."""
        found = self._known.get(values.tobytes())
        self.taken += found is not None
        return found

    def add(self, values: Floats, slopes: Slopes) -> None:
        """Keep what a run told."""
        self._known[values.tobytes()] = slopes

        def append() -> None:
            with self._path.open("ab") as file:
                _write(file, values, slopes)

        self._on_root(append)

    def _read(self, path: Path, key: str) -> None:
        try:
            with path.open("rb") as file:
                if str(np.load(file)) != key:
                    raise FolderError(
                        f"{path}: is the search of another scene; give the scene it was begun with"
                    )
                self._take(file)
        except (OSError, ValueError, EOFError) as error:
            raise FolderError(
                f"{path}: no search can go on from here ({error}); leave --restart out"
            ) from None

    def _take(self, file: IO[bytes]) -> None:
        while True:
            try:
                values, numbers, jacobian, doubts, margin, sides = (np.load(file) for _ in range(6))
            except (ValueError, EOFError):  # the end, or what an interruption left half written
                return
            told = [str(each) for each in doubts]
            both = (sides[0], sides[1]) if len(sides) else None
            slopes = Slopes(numbers, jacobian, told, float(margin), both)
            self._known[values.tobytes()] = slopes

    def _on_root(self, act: Callable[[], None]) -> None:
        try:
            on_root(act)
        except OSError as error:
            why = (
                f"{self._path}: cannot be written ({error.strerror}); choose another folder (--out)"
            )
            raise OutputError(why) from None


def _write(file: IO[bytes], values: Floats, slopes: Slopes) -> None:
    doubts = np.array(slopes.doubts, dtype=str)
    sides = np.array(slopes.sides or ())
    for each in (values, slopes.numbers, slopes.jacobian, doubts, np.array(slopes.margin), sides):
        np.save(file, each)
