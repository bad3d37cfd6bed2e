"""Checkpoints: the state between two layers in one file, for any number of ranks."""

import hashlib
import io
import json
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import OutputError
from impactfem.fem import on_root
from impactfem.marching.collect import Collector, total
from impactfem.marching.rows import OF_RANKS
from impactfem.marching.time_loop import TimeLoop
from impactfem.result.store import CHECKPOINT, in_mib

FILE = CHECKPOINT
"""Name of the file in a result folder."""

# What NumPy meets in files that are cut off, damaged, or none of its own.
_BROKEN = (
    OSError, ValueError, LookupError, TypeError, AttributeError, EOFError, NotImplementedError,
    SyntaxError, MemoryError, zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip
_OWN = frozenset({"scene", "extensions", "body", "layer", "dt"})


class Checkpoints:
    """Writes and reads the state of a march.

    Values of nodes are kept in canonical order, sums over all ranks: a march may be continued on
    another number of ranks. On the same number it goes on bit by bit as if it had not stopped.
    """

    def __init__(
        self, comm: Any, collector: Collector, positions: Floats, folder: Path, scene: str,
        extensions: Mapping[str, str],
    ) -> None:  # fmt: skip
        """Set where and for which scene (collective).

        Args:
            comm: MPI communicator.
            collector: Of the nodes.
            positions: Undeformed places of the nodes this rank owns [m], shape (owned, dim).
            folder: Where the file lies; it must exist.
            scene: The scene as text; a checkpoint of another one is refused.
            extensions: What the scene needs (`impactfem.extensions.needed`).
        """
        self._comm, self._collector, self._dim = comm, collector, positions.shape[1]
        self._path, self._scene = folder / FILE, scene
        self._extensions = json.dumps(dict(extensions))
        # Gmsh of another version, or a mesh file that was changed, makes another mesh of a scene.
        places = collector.collect(positions.ravel(), self._dim)
        self._body = "" if places is None else hashlib.sha256(places.tobytes()).hexdigest()

    def write(self, march: TimeLoop[Any], extra: Mapping[str, float | str]) -> None:
        """Write the state; the last file is replaced when the new one is complete (collective).

        Args:
            march: Between two layers.
            extra: What the caller needs to go on, besides.

        Raises:
            OutputError: The file cannot be written; the last one is kept.
        """
        data: dict[str, Any] = {
            "scene": self._scene, "extensions": self._extensions, "body": self._body,
            "layer": march.layer, "dt": march.interior.dt, **extra,
        }  # fmt: skip
        for name, values in march.interior.state().items():
            data[f"node.{name}"] = self._collector.collect(values, self._dim)
        data |= {f"march.{name}": values for name, values in march.memory().items()}
        data["asked.nodes"] = march.asked
        done = march.layer + 1
        for entry in fields(march.rows):
            data[f"rows.{entry.name}"] = getattr(march.rows, entry.name)[:done]
        for name in OF_RANKS:
            data[f"rows.{name}"] = total(self._comm, getattr(march.rows, name)[:done])
        on_root(self._comm, lambda: self._write(data))

    def _write(self, data: dict[str, Any]) -> None:
        partial = self._path.with_name(f".{FILE}.partial")
        buffer = io.BytesIO()
        np.savez(buffer, **data)
        try:
            partial.unlink(missing_ok=True)  # left by a killed run, or a link to another file
            with partial.open("xb") as file:
                file.write(buffer.getbuffer())
                file.flush()
                os.fsync(file.fileno())
            partial.replace(self._path)
        except OSError as error:
            with suppress(OSError):
                partial.unlink(missing_ok=True)
            size = in_mib(buffer.getbuffer().nbytes)
            raise OutputError(
                f"{self._path}: the checkpoint of {size} cannot be written ({error.strerror}); "
                "free some space, or set output.checkpoint = 0"
            ) from error

    def forget(self) -> None:
        """Remove the file of an earlier run, which this one overwrites piece by piece (collective).

        Raises:
            OutputError: It cannot be removed.
        """

        def remove() -> None:
            try:
                self._path.unlink(missing_ok=True)
            except OSError as error:
                raise OutputError(
                    f"{self._path}: the checkpoint of an earlier run cannot be removed "
                    f"({error.strerror}); choose another folder (--out)"
                ) from error

        on_root(self._comm, remove)

    def layer(self) -> int:
        """Number of layers done in the file (collective).

        Raises:
            OutputError: There is no such file.
        """
        return int(on_root(self._comm, lambda: load(self._path, "layer").get("layer", 0)))

    def read(self, march: TimeLoop[Any]) -> dict[str, float | str]:
        """Continue a march from the file; returns what was written with it (collective).

        Raises:
            OutputError: There is no such file, or it belongs to another scene or mesh.
        """
        expected = self._expected(march)  # gathers: on all ranks
        data = on_root(self._comm, lambda: self._read(march, expected))
        layer, dim = int(data["layer"]), self._dim
        state = {
            name.removeprefix("node."): self._collector.distribute(values, dim)
            for name, values in data.items()
            if name.startswith("node.")
        }
        memory = {
            name.removeprefix("march."): values
            for name, values in data.items()
            if name.startswith("march.")
        }
        for entry in fields(march.rows):
            getattr(march.rows, entry.name)[: layer + 1] = data[f"rows.{entry.name}"]
        if self._comm.rank != 0:  # the sums of all ranks: only once
            for name in OF_RANKS:
                getattr(march.rows, name)[: layer + 1] = 0.0
        march.restore(state, memory, data["asked.nodes"], layer)
        return {
            name: value.item()
            for name, value in data.items()
            if name not in _OWN and "." not in name
        }

    def _read(
        self, march: TimeLoop[Any], expected: Mapping[str, tuple[int, ...]]
    ) -> dict[str, Any]:
        data = load(self._path)
        if str(data.get("scene")) != self._scene:
            raise OutputError(
                f"{self._path}: belongs to another scene; restart with the scene of that folder"
            )
        if str(data.get("body")) != self._body:
            raise OutputError(
                f"{self._path}: was written on another mesh of this scene (its mesh file was "
                "changed, or this is another version of Gmsh); run the scene from its start"
            )
        given = dict(expected)
        if "asked.nodes" in data:  # as many as the march had needed
            given["asked.nodes"] = data["asked.nodes"].shape
        layer, dt = data.get("layer"), data.get("dt")
        if layer is None or dt is None or float(dt) != march.interior.dt:
            raise OutputError(
                f"{self._path}: was written with the time step {dt} s, not {march.interior.dt} s; "
                "run the scene from its start"
            )
        for name, shape in given.items():
            found = data.get(name)
            wanted = (int(layer) + 1, *shape[1:]) if name.startswith("rows.") else shape
            if found is None or found.shape != wanted or int(layer) > march.layers:
                raise OutputError(
                    f"{self._path}: is damaged, or was written by another version of impactfem "
                    f"({name}); run the scene from its start"
                )
        return data

    def _expected(self, march: TimeLoop[Any]) -> dict[str, tuple[int, ...]]:
        """Shapes of the arrays in a file, those of rows as long as the whole march (collective)."""
        nodes = (self._collector.count, self._dim)
        inside = {f"node.{name}": nodes for name in march.interior.state()}
        memory = {f"march.{name}": values.shape for name, values in march.memory().items()}
        rows = {
            f"rows.{entry.name}": getattr(march.rows, entry.name).shape
            for entry in fields(march.rows)
        }
        return inside | memory | rows | {"asked.nodes": (0,)}


def load(path: Path, *names: str) -> dict[str, Any]:
    """Arrays of a checkpoint by name: some, as far as they are there, or all.

    Raises:
        OutputError: There is no such file, or it is broken.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise OSError("not a file")
        with zipfile.ZipFile(path) as archive:
            # NumPy packs nothing: what is packed may be larger than any memory.
            if any(entry.compress_type != zipfile.ZIP_STORED for entry in archive.infolist()):
                raise ValueError("its arrays are packed")
            if sum(entry.file_size for entry in archive.infolist()) > path.stat().st_size:
                raise ValueError("its arrays overlap")
        # No pickles: reading those would run whatever they say.
        with np.load(path, allow_pickle=False) as file:
            wanted = set(names or file.files)
            return {name: file[name] for name in file.files if name in wanted}
    except _BROKEN as error:
        raise OutputError(
            f"{path}: no checkpoint that can be read ({error}); give the folder of a stopped run "
            "with output.checkpoint = N, or run the scene from its start"
        ) from error


def scene_of(folder: Path) -> tuple[str, dict[str, str]]:
    """Text of the scene whose checkpoint lies in a folder, and the extensions that it needs.

    Raises:
        OutputError: There is no checkpoint.
    """
    found = load(folder / FILE, "scene", "extensions")
    text = found.get("scene")
    if text is None:
        raise OutputError(
            f"{folder / FILE}: names no scene, so it is no checkpoint; give the folder of a "
            "stopped run with output.checkpoint = N"
        )
    return str(text), json.loads(str(found.get("extensions", "{}")))
