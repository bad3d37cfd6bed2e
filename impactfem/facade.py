"""A result as users have it: the record of a run, with pictures, films and a page of it."""

import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, overload

from impactfem.result.occupied import check_free
from impactfem.result.record import Record
from impactfem.result.store import replaced

if TYPE_CHECKING:
    import pyvista as pv
    from matplotlib.animation import FuncAnimation
    from matplotlib.figure import Figure

    from impactfem.result.spectrum import Spectrum
    from impactfem.result.summary import Summary


class Result(Record):
    """What a run answers.

    What draws is loaded when it is asked for.

    Attributes:
        scene: The scene as used.
        history: One row per time step; columns and units in `impactfem.result.history.COLUMNS`.
        summary: Figures of the run, as written to ``summary.json``.
        fields: The motion of all bodies at the time levels asked for; None if none were. Those of a
            solid are read from their file when asked for.
        exact: Exact contact force at the times of the history [N]; None if unknown.
        impacts: Impacts of points, rods and beams one by one; None if the method tells none.
    """

    if TYPE_CHECKING:
        summary: Summary

    def plot(self, folder: str | Path | None = None) -> "dict[str, Figure]":
        """Draw all figures that the result allows.

        Args:
            folder: Where to write them as PNG files, with a film of the motion; None to
                only return them.

        Returns:
            Matplotlib figures by name.
        """
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
        """The deformed body at the time level of the fields nearest to a time.

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

    def plot_spectrum(
        self, column: str, *, q: float | None = None, modes: str | None = None
    ) -> "Figure":
        """Draw what `spectrum` tells.

        Raises:
            SceneError: As of `spectrum`.
        """
        from impactfem.report.spectrum_figure import spectrum_figure  # noqa: PLC0415

        return spectrum_figure(self.spectrum(column, q=q, modes=modes))

    def spectrum(
        self, column: str, *, q: float | None = None, modes: str | None = None
    ) -> "Spectrum":
        """Amplitudes of a column of the history by frequency, and how oscillators would answer it.

        Args:
            column: Name in ``history``.
            q: Quality factor of the oscillators of the shock response spectrum, which columns of
                accelerations have; 10 if None.
            modes: Body whose natural frequencies are told beside.

        Raises:
            SceneError: There is no such column or body, or it has no spectrum.
        """
        from impactfem.result.spectrum import spectrum  # noqa: PLC0415
        from impactfem.runs.tones import natural_frequencies  # noqa: PLC0415

        found = spectrum(self.rows, column, q)
        if modes is None:
            return found
        return replace(found, modes=natural_frequencies(self.scene, modes), mode_body=modes)

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

    def _repr_html_(self) -> str:
        from impactfem.report.notebook import result_card  # noqa: PLC0415

        return result_card(self)
