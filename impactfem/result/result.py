"""The result of a run."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from impactfem.errors import OutputError, SceneError
from impactfem.result.fields import (
    Fields,
    is_bar_file,
    needed_bytes,
    read_vtkhdf,
    write_vtkhdf,
    write_with_dolfinx,
)
from impactfem.result.history import read_netcdf, write_csv, write_netcdf
from impactfem.result.solid_export import needed_bytes as needed_bytes_of_solid
from impactfem.result.solid_export import write_solid
from impactfem.result.solid_fields import SolidFields
from impactfem.result.store import LAST, reserve, staged
from impactfem.result.trajectory import Impacts
from impactfem.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMPACTS = "impacts.csv"
FIELD_FILES = {"vtkhdf": "fields.vtkhdf", "vtx": "fields.bp", "pvd": "fields.pvd"}
"""File of each field format."""


@dataclass(frozen=True)
class Result:
    """What a run answers.

    Attributes:
        scene: The scene as used.
        history: One row per layer; columns and units in `impactfem.result.history.COLUMNS`.
        summary: Figures of the run, as written to ``summary.json``.
        fields: The body's motion at the layers asked for; None if none were. Those of a bar are
            arrays, those of a solid are read from their file when asked for.
        exact: Exact contact force at the times of the history [N]; None if unknown.
        impacts: Impacts of points, rods and beams one by one; None if the method tells none.
    """

    scene: Scene
    history: xr.Dataset
    summary: Mapping[str, Any]
    fields: Fields | SolidFields | None = None
    exact: xr.Dataset | None = None
    impacts: Impacts | None = None

    def plot(self, folder: str | Path | None = None) -> "dict[str, Figure]":
        """Draw all figures that the result allows.

        Args:
            folder: Where to write them as PNG files, with a film of a solid's motion; None to
                only return them.

        Returns:
            Matplotlib figures by name.
        """
        # A convenience door to the layer above, opened only on demand.
        from impactfem.report.figures import draw_all, write_pictures  # noqa: PLC0415

        if folder is None:
            return draw_all(self)
        Path(folder).mkdir(parents=True, exist_ok=True)
        return write_pictures(self, Path(folder))[0]

    def animate(self, path: str | Path, frames: int | None = None) -> Path:
        """Write a film of a solid's motion with the contact force beside it.

        Args:
            path: Target; ``.gif``, or ``.mp4`` if imageio-ffmpeg is installed.
            frames: Number of frames at most; at most 60, fewer for large meshes, if None.

        Returns:
            The path.

        Raises:
            OutputError: There are no fields of a solid, or the file cannot be written.
            MissingDependencyError: MP4 is asked for without imageio-ffmpeg.
        """
        from impactfem.report.animation import animate  # noqa: PLC0415

        return animate(self, path, frames)

    def save(self, folder: str | Path, *, pictures: bool = True) -> Path:
        """Write scene, histories, fields, pictures and summary into a folder.

        Args:
            folder: Made if absent. The files appear together when all are written.
            pictures: Whether to draw them.

        Returns:
            The folder.

        Raises:
            OutputError: The folder cannot be written, or the disk is full.
        """
        folder = Path(folder)
        with staged(folder) as stage:
            (stage / "scene.toml").write_text(self.scene.to_toml(folder=folder), encoding="utf-8")
            write_csv(self.history, stage / "history.csv")
            write_netcdf(self.history, stage / "history.nc")
            if self.exact is not None:
                write_netcdf(self.exact, stage / "exact.nc")
            if self.impacts is not None:
                self.impacts.write_csv(stage / IMPACTS)
            self._write_fields(stage)
            if pictures:
                self.plot(stage)
            text = json.dumps(self.summary, indent=2, allow_nan=False)
            (stage / LAST).write_text(text + "\n", encoding="utf-8")
        return folder

    def _write_fields(self, stage: Path) -> None:
        if self.fields is None:
            return
        for kind in self.scene.output.fields:
            path = stage / FIELD_FILES[kind]
            if isinstance(self.fields, SolidFields):
                reserve(stage, needed_bytes_of_solid(self.fields, kind))
                write_solid(self.fields, path, kind)
                continue
            reserve(stage, needed_bytes(self.fields, kind))
            if kind == "vtkhdf":
                write_vtkhdf(self.fields, path)
            else:
                write_with_dolfinx(self.fields, path, kind)

    @classmethod
    def load(cls, folder: str | Path) -> "Result":
        """Read a result folder back.

        Raises:
            OutputError: The folder holds no complete result.
        """
        folder = Path(folder)
        try:
            summary = json.loads((folder / LAST).read_text(encoding="utf-8"))
            history = read_netcdf(folder / "history.nc")
            scene = Scene.from_toml(folder / "scene.toml")
            exact = folder / "exact.nc"
            reference = read_netcdf(exact) if exact.exists() else None
            listed = folder / IMPACTS
            impacts = Impacts.read_csv(listed) if listed.exists() else None
        # xarray and SciPy meet noise with TypeError, KeyError and IndexError.
        except (OSError, ValueError, TypeError, LookupError, SceneError) as error:
            raise OutputError(
                f"{folder}: no complete result ({error}); run the scene with --out {folder}"
            ) from error
        path = folder / FIELD_FILES["vtkhdf"]
        fields: Fields | SolidFields | None = None
        if path.exists():
            fields = read_vtkhdf(path) if is_bar_file(path) else SolidFields(path)
        return cls(scene, history, summary, fields, reference, impacts)

    def __repr__(self) -> str:
        return (
            f"Result({self.summary['title']!r}, method={self.summary['method']!r}, "
            f"status={self.summary['status']!r}, rows={self.history.sizes['time']})"
        )
