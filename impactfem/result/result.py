"""The result of a run."""

import json
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from impactfem.errors import OutputError, SceneError
from impactfem.result.export import needed_bytes, write_fields
from impactfem.result.fields import StoredFields
from impactfem.result.history import write_csv
from impactfem.result.netcdf import read_netcdf, write_netcdf
from impactfem.result.occupied import check_free
from impactfem.result.snapshots import Snapshots
from impactfem.result.store import LAST, finish, replaced, reserve, staged, write_summary
from impactfem.result.stored_snapshots import StoredSnapshots
from impactfem.result.table import Table
from impactfem.result.trajectory import Impacts
from impactfem.scene import Scene

if TYPE_CHECKING:
    import pyvista as pv
    import xarray as xr
    from matplotlib.animation import FuncAnimation
    from matplotlib.figure import Figure

IMPACTS = "impacts.csv"
_CURVES = frozenset({"time", "contact_force"})  # without which a file holds no history
FIELD_FILES = {"vtkhdf": "fields.vtkhdf", "vtx": "fields.bp", "pvd": "fields.pvd"}
"""File of each field format."""


@dataclass(frozen=True, init=False)
class Result:
    """What a run answers.

    Attributes:
        scene: The scene as used.
        history: One row per layer; columns and units in `impactfem.result.history.COLUMNS`.
        summary: Figures of the run, as written to ``summary.json``.
        fields: The motion of all bodies at the layers asked for; None if none were. Those of a
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

    def with_summary(self, summary: Mapping[str, Any]) -> "Result":
        """The same with another summary."""
        return Result(self.scene, self.rows, summary, self.fields, self.exact_rows, self.impacts)

    def plot(self, folder: str | Path | None = None) -> "dict[str, Figure]":
        """Draw all figures that the result allows.

        Args:
            folder: Where to write them as PNG files, with a film of the motion; None to
                only return them.

        Returns:
            Matplotlib figures by name.
        """
        # A convenience door to the layer above, opened only on demand.
        from impactfem.report.animation import film_if_any  # noqa: PLC0415
        from impactfem.report.figures import draw_all, write_all  # noqa: PLC0415

        figures = draw_all(self)
        if folder is not None:
            with replaced(Path(folder)) as stage:
                write_all(figures, stage)
                film_if_any(self, stage / "motion.gif")
        return figures

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures that `figure` draws."""
        from impactfem.report.figures import painters  # noqa: PLC0415

        return tuple(painters(self))

    def figure(self, name: str) -> "Figure":
        """Draw one figure of `plot`, without the others.

        Args:
            name: One of `figures`.

        Raises:
            SceneError: There is no such figure; the message names those that are near.
        """
        from impactfem.report.figures import draw_one  # noqa: PLC0415

        return draw_one(self, name)

    def plot_history(self, *names: str) -> "Figure":
        """Draw columns of the history over time; those of one unit share axes.

        Args:
            *names: As in ``history``; gap, contact force and energies if none is given.

        Raises:
            SceneError: There is no such column; the message names those that are near.
        """
        from impactfem.report.history_figure import plot_history  # noqa: PLC0415

        return plot_history(self, *names)

    @overload
    def animate(self, path: str | Path, frames: int | None = None) -> Path: ...

    @overload
    def animate(self, path: None = None, frames: int | None = None) -> "FuncAnimation": ...

    def animate(
        self, path: str | Path | None = None, frames: int | None = None
    ) -> "Path | FuncAnimation":
        """Film the motion with a curve beside it.

        Args:
            path: Target; ``.gif``, or ``.mp4`` if imageio-ffmpeg is installed. None to only return
                the film, which shows itself in a notebook with a slider.
            frames: Number of frames at most; at most 60, fewer for large meshes, if None.

        Returns:
            The path; without one an animation of Matplotlib.

        Raises:
            OutputError: There are no fields of the body, or the file cannot be written.
            MissingDependencyError: MP4 is asked for without imageio-ffmpeg.
        """
        from impactfem.report.animation import animate  # noqa: PLC0415

        return animate(self, path, frames)

    def mesh_at(self, time: float) -> "pv.UnstructuredGrid":
        """The deformed body at the layer of the fields that is nearest to a time.

        Args:
            time: [s].

        Returns:
            A grid of pyvista with all fields at its points. No display is needed.

        Raises:
            OutputError: There are no fields.
            SceneError: The time is none of the fields.
            MissingDependencyError: pyvista is not installed.
        """
        from impactfem.report.view import known_fields  # noqa: PLC0415

        return known_fields(self).grid(time=time, deformed=True)

    def plotter(
        self, time: float, *, field: str | None = None, off_screen: bool | None = None
    ) -> "pv.Plotter":
        """A plotter of pyvista that shows bodies, obstacles and contact forces at a time.

        Rods and beams are tubes, points are balls, as thick as they are. VTK as Debian builds it
        needs a display to draw, off screen too; `mesh_at` needs none.

        Args:
            time: [s].
            field: That colours tell, vectors by their length; stress, or else velocity, if None.
            off_screen: Whether to draw without a window; pyvista decides if None.

        Returns:
            A plotter to ``show()``, or to take a ``screenshot`` of.

        Raises:
            OutputError: There are no fields.
            SceneError: The time or the field is none of the fields.
            MissingDependencyError: pyvista is not installed.
        """
        from impactfem.report.view import make_view  # noqa: PLC0415

        return make_view(self, time, field, off_screen=off_screen)[0].plotter

    def save(self, folder: str | Path, *, pictures: bool = True) -> Path:
        """Write scene, histories, fields and summary into a folder, then pictures and report.

        The data are there, whole, before anything is drawn: whatever happens to the pictures,
        `load` reads them, and ``impactfem plot FOLDER`` draws anew.

        Args:
            folder: Made if absent. The data appear together when all are written, and so do the
                pictures.
            pictures: Whether to draw what ``[output]`` asks for; what fails is a `RuntimeWarning`.

        Returns:
            The folder.

        Raises:
            FolderError: The folder holds other files than those of a result.
            OutputError: The folder cannot be written, or the disk is full.
        """
        from impactfem.report.adding import add_pictures  # noqa: PLC0415

        folder = Path(folder)
        check_free(folder)
        self.write_data(folder)
        for line in add_pictures(self, folder)[1] if pictures else ():
            warnings.warn(f"{folder}: {line}", RuntimeWarning, stacklevel=2)
        return folder

    def write_data(self, folder: Path) -> None:
        """Write all but what is drawn, whatever files of others the folder holds.

        Raises:
            OutputError: The folder cannot be written, or the disk is full.
        """
        with staged(folder) as stage:
            (stage / "scene.toml").write_text(self.scene.to_toml(folder=folder), encoding="utf-8")
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
    def load(cls, folder: str | Path) -> "Result":
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

    def _repr_html_(self) -> str:
        from impactfem.report.notebook import result_card  # noqa: PLC0415

        return result_card(self)

    def __repr__(self) -> str:
        return (
            f"Result({self.summary['title']!r}, method={self.summary['method']!r}, "
            f"status={self.summary['status']!r}, rows={self.rows.sizes['time']})"
        )
