"""What is known of a run: the record that files keep and pictures are drawn from."""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from impactfem.errors import OutputError, SceneError
from impactfem.extensions import missing
from impactfem.result.export import needed_bytes, write_fields
from impactfem.result.fields import StoredFields
from impactfem.result.history import write_csv
from impactfem.result.netcdf import read_netcdf, write_netcdf
from impactfem.result.snapshots import Snapshots
from impactfem.result.store import LAST, finish, reserve, staged, write_summary
from impactfem.result.stored_snapshots import StoredSnapshots
from impactfem.result.table import Table
from impactfem.result.trajectory import Impacts
from impactfem.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

IMPACTS = "impacts.csv"
_CURVES = frozenset({"time", "contact_force"})  # without which a file holds no history
FIELD_FILES = {"vtkhdf": "fields.vtkhdf", "vtx": "fields.bp", "pvd": "fields.pvd"}
"""File of each field format."""


@dataclass(frozen=True, init=False)
class Record:
    """What a run answers, as data; `impactfem.Result` also shows itself.

    Attributes:
        scene: The scene as used.
        history: One row per time step; columns and units in `impactfem.result.history.COLUMNS`.
        summary: Figures of the run, as written to ``summary.json``.
        fields: The motion of all bodies at the time levels asked for; None if none were. Those of a
            solid are read from their file when asked for.
        exact: Exact contact force at the times of the history [N]; None if unknown.
        impacts: Impacts of points, rods and beams one by one; None if the method tells none.
    """

    scene: Scene
    history: "xr.Dataset"
    summary: Mapping[str, Any]
    fields: Snapshots | None
    exact: "xr.Dataset | None"
    impacts: Impacts | None

    def __init__(
        self,
        scene: Scene,
        history: "Table | xr.Dataset",
        summary: Mapping[str, Any],
        fields: Snapshots | None = None,
        exact: "Table | xr.Dataset | None" = None,
        impacts: Impacts | None = None,
    ) -> None:
        """Take the parts; tables become data sets of xarray when these are asked for."""
        given = {"history": history, "exact": exact}
        tables = {name: part for name, part in given.items() if isinstance(part, Table)}
        self.__dict__.update(
            {name: part for name, part in given.items() if name not in tables}
            | {"scene": scene, "summary": summary, "fields": fields, "impacts": impacts}
            | {"_tables": tables}
        )

    def __getattr__(self, name: str) -> Any:  # asked for what is not there: the data sets
        tables = self.__dict__.get("_tables", {})
        if name not in tables:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        self.__dict__[name] = tables.pop(name).dataset()
        return self.__dict__[name]

    @property
    def rows(self) -> Table:
        """The history without xarray, which takes long to load."""
        return self._table("history") or Table({}, {})

    @property
    def exact_rows(self) -> Table | None:
        """The exact curves without xarray."""
        return self._table("exact")

    def _table(self, name: str) -> Table | None:
        tables: dict[str, Table] = self.__dict__["_tables"]
        if name in tables:
            return tables[name]
        return None if (data := self.__dict__[name]) is None else Table.of(data)

    def with_summary(self, summary: Mapping[str, Any]) -> Self:
        """The same with another summary."""
        parts = self.scene, self.rows, summary, self.fields, self.exact_rows, self.impacts
        return type(self)(*parts)

    def write_data(self, folder: Path) -> None:
        """Write all but what is drawn, whatever files of others the folder holds.

        Raises:
            OutputError: The folder cannot be written, or the disk is full.
        """
        with staged(folder) as stage:
            (stage / "scene.toml").write_text(self.scene.to_toml(folder=folder), encoding="utf-8")
            self.scene.keep_meshes(stage)
            write_csv(self.rows, stage / "history.csv")
            write_netcdf(self.rows, stage / "history.nc")
            if self.exact_rows is not None:
                write_netcdf(self.exact_rows, stage / "exact.nc")
            if self.impacts is not None:
                self.impacts.write_csv(stage / IMPACTS)
            self._write_fields(stage)
            write_summary(self.summary, stage)

    def _write_fields(self, stage: Path) -> None:
        if self.fields is None:
            return
        for kind in self.scene.output.fields:
            path = stage / FIELD_FILES[kind]
            reserve(stage, needed_bytes(self.fields, kind))
            write_fields(self.fields, path, kind)

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """Read a result folder back.

        Raises:
            OutputError: The folder holds no complete result.
        """
        folder = Path(folder)
        with suppress(OSError):  # one that cannot be written is read as it is
            finish(folder)
        try:
            summary = json.loads((folder / LAST).read_text(encoding="utf-8"))
            summary.pop("files", None)  # tells of the folder, not of the run
            extensions = summary.get("run", {}).get("extensions", ())
            if why := missing({what: one["module"] for one in extensions for what in one["adds"]}):
                raise OutputError(f"{folder}: {why}")
            history = read_netcdf(folder / "history.nc", _CURVES)
            scene = Scene.from_toml(folder / "scene.toml")
            exact = folder / "exact.nc"
            reference = read_netcdf(exact, _CURVES) if exact.exists() else None
            listed = folder / IMPACTS
            impacts = Impacts.read_csv(listed) if listed.exists() else None
        # xarray and SciPy meet noise with TypeError, KeyError and IndexError.
        except (OSError, ValueError, TypeError, LookupError, AttributeError, SceneError) as error:
            raise OutputError(
                f"{folder}: no complete result ({error}); run the scene with --out {folder}"
            ) from error
        path = folder / FIELD_FILES["vtkhdf"]
        fields: Snapshots | None = None
        if path.exists():
            stored = StoredSnapshots(path)
            fields = StoredFields(stored) if scene.bars == scene.bodies else stored
        return cls(scene, history, summary, fields, reference, impacts)

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({self.summary['title']!r}, method={self.summary['method']!r}, "
            f"status={self.summary['status']!r}, rows={self.rows.sizes['time']})"
        )
