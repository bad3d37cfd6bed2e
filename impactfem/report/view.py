"""A view of the bodies by pyvista: in a window with a time slider, as a picture, or as a page."""

import os
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import MissingDependencyError, OutputError, SceneError
from impactfem.report.arrows import SEEN
from impactfem.report.camera import Camera
from impactfem.report.page.numbers import quantity
from impactfem.report.palette import EDGE, FORCE, STRESS, fill, tint
from impactfem.report.skin import Skin
from impactfem.report.view_obstacles import joined, obstacle_parts
from impactfem.result.grids import drawing_fault, load_pyvista, make_grid, nearest_layer, thickened
from impactfem.result.whole import Whole
from impactfem.scene.nearest import meant

if TYPE_CHECKING:
    import pyvista as pv

    from impactfem.result import Record, Snapshots


_UNITS = MappingProxyType(
    {
        "displacement": "m", "velocity": "m/s", "von_mises": "Pa", "face_stress": "Pa",
        "stress_bottom": "Pa", "stress_top": "Pa", "contact_pressure": "Pa",
        "contact_force": "N", "gap": "m", "active": "1", "radius": "m",
    }
)  # fmt: skip
_COLOURED = 0.99  # share of the values within the colours: one spot shall not spoil them
_LOOKS = 12  # layers that the range of colours and arrows is taken from
_THIN = 0.01  # share of the size that bars and points without thickness are thick
_LONGEST = 0.3  # share of the size that the largest force is long
_BAR = MappingProxyType(
    {"vertical": True, "position_x": 0.88, "position_y": 0.2, "height": 0.6, "width": 0.06}
)
_ON_TOP = -66000.0  # depth offset with which VTK draws something before all else
_WINDOWLESS = {"vtkOSOpenGLRenderWindow", "vtkEGLRenderWindow"}  # that VTK falls back to
_NO_DISPLAY = (
    "there is no display for a window (DISPLAY); write a picture with --out picture.png, or open "
    "fields.vtkhdf in ParaView"
)
_ENDINGS = {".png", ".html"}


class View:
    """The bodies of a result in a plotter, at one time after the other.

    Attributes:
        plotter: Of pyvista.
        fields: What is shown.
        field: Name of the field of the colours.
        telling: Layer of the largest contact force.
    """

    def __init__(
        self, result: "Record", field: str | None = None, *, off_screen: bool | None = None
    ) -> None:
        """Make the plotter; nothing is in it yet.

        Args:
            result: With fields.
            field: That colours tell; if None the stress, or else the speed, and bodies that have
                cells but no stress have their own colours.
            off_screen: Whether to draw without a window; pyvista decides if None.

        Raises:
            OutputError: There are no fields.
            SceneError: There is no such field.
            MissingDependencyError: pyvista is not installed.
        """
        self._pyvista = load_pyvista()
        self.fields = fields = known_fields(result)
        self._scene = result.scene
        whole = Whole.of_summary(result.summary)
        self._skin = Skin.of(fields, whole, dim=max(2, result.scene.dim))
        layers = np.linspace(0, len(fields) - 1, min(_LOOKS, len(fields))).round().astype(int)
        force = np.nan_to_num(result.rows["contact_force"].values)
        peak = nearest_layer(fields.times, self._inside(result.rows["time"].values[force.argmax()]))
        self._looked = np.union1d(layers, peak)
        self.field, self._kinds = self._chosen(field), field is None
        looks = [self._skin.snapshot(int(layer)) for layer in self._looked]
        forces = [look.largest_force for look in looks]
        self._force = max(forces)
        self.telling = int(self._looked[np.argmax(forces)] if self._force else peak)
        places = np.concatenate(
            [look.place for look in looks if look.is_finite] or [np.zeros((1, 3))]
        )
        self._low, self._high = places.min(axis=0), places.max(axis=0)
        self._size = float(np.ptp(places, axis=0).max()) or self._skin.size or 1.0
        radius = self._skin.radius[: len(fields.points)]
        thick = np.where(radius > 0.0, radius, _THIN * self._size)
        self._layout = replace(fields.layout, radius=thick)
        self._limits = self._range()
        self.plotter: pv.Plotter = self._pyvista.Plotter(off_screen=off_screen)
        self._drawn: set[str] = set()

    def _inside(self, time: float) -> float:
        return float(np.clip(time, self.fields.times[0], self.fields.times[-1]))

    def _chosen(self, name: str | None) -> str:
        known = [*self.fields.point_data, "radius"]
        if name is None:
            stressed = self._skin.is_stressed.any() and "von_mises" in known
            return "von_mises" if stressed else "velocity"
        if name not in known:
            raise SceneError(f'field "{name}" is none of this result; {meant(name, known)}')
        return name

    def _values(self, layer: int) -> Floats:
        """The field at the nodes, vectors by their length, shape (nodes,)."""
        if self.field == "radius":
            return np.asarray(self.fields.layout.radius)
        values = np.asarray(self.fields.read(layer, self.field)[self.field], dtype=np.float64)
        return values if values.ndim == 1 else np.asarray(np.linalg.norm(values, axis=1))

    def _range(self) -> tuple[float, float]:
        """Ends of the colours, the same at all times."""
        seen = np.concatenate([self._values(int(layer)) for layer in self._looked])
        seen = seen[np.isfinite(seen) & (seen != 0.0)]
        if not len(seen):
            return 0.0, 1.0
        low, high = np.quantile(seen, [1.0 - _COLOURED, _COLOURED], method="nearest")
        return min(0.0, float(low)), max(0.0, float(high))

    def show(self, layer: int) -> None:
        """Put the bodies of a layer, obstacles, forces and the time in the plotter."""
        time, drawn = float(self.fields.times[layer]), set(self._drawn)
        self._drawn.clear()
        values = {"displacement": self.fields.read(layer, "displacement")["displacement"]}
        grid = make_grid(self._layout, values, time, deformed=True)
        unit = _UNITS.get(self.field, "")
        grid.point_data[self.field] = self._values(layer)
        pieces = [piece for part in thickened(grid, self._layout) for piece in self._pieces(part)]
        for k, (piece, body) in enumerate(pieces):
            style: dict[str, Any] = {
                "scalars": self.field, "clim": self._limits, "cmap": STRESS, "nan_color": "gray",
                "scalar_bar_args": {"title": f"{self.field} [{unit}]\n", **_BAR},
            }  # fmt: skip
            if body is not None:
                style = {"color": fill(body), "scalars": None}
            for j, image in enumerate(self._images(piece)):
                self._add(image, f"body {k} {j}", lighting=self._scene.dim == 3, **style)
        for name, mesh, style in obstacle_parts(
            self._scene, time, 0.5 * (self._low + self._high), self._size
        ):
            self._add(mesh, name, **style)
        self._add_edges(layer)
        self._add_forces(layer)
        text = f"{self._scene.title}\nt = {time:.6g} s"
        if self._force > 0.0:
            text += f"\narrows: contact forces, the longest {quantity(self._force, 'N', 4)}"
        self.plotter.add_text(text, font_size=10, name="text")
        for name in drawn - self._drawn:
            self.plotter.remove_actor(name)

    def _add_edges(self, layer: int) -> None:
        """Edges of the bodies that have faces."""
        place, (ends, _) = self._skin.snapshot(layer).place, self._skin.edges
        owners = self._skin.bodies[ends[:, 0]]
        for body in np.unique(owners):
            own = ends[owners == body]
            soft = self._skin.is_stressed[own].all() or not self._kinds
            self._add(
                joined(self._pyvista, place[own], "lines"), f"edges {body}", line_width=1.5,
                color=EDGE if soft else tint(int(body)),
            )  # fmt: skip

    def _pieces(self, part: "pv.DataSet") -> "list[tuple[pv.DataSet, int | None]]":
        """What has one colour scale, and each body that has its own colour, with its number."""
        if not self._kinds or "body" not in part.cell_data:
            return [(part, None)]
        own = np.asarray(part.cell_data["body"])
        nodes = self._skin.is_stressed[: len(self.fields.points)]
        soft = np.isin(own, np.unique(self._layout.body_of_nodes[nodes]))
        found = [(part.extract_cells(own == k), int(k)) for k in np.unique(own[~soft])]
        return [*([(part.extract_cells(soft), None)] if soft.any() else []), *found]

    def _add(self, mesh: "pv.DataSet", name: str, **style: Any) -> Any:
        self._drawn.add(name)
        return self.plotter.add_mesh(mesh, name=name, reset_camera=False, **style)

    def _images(self, part: "pv.DataSet") -> "list[pv.DataSet]":
        """A part of the bodies with its mirror images."""
        found = [part]
        for axis, level in self._skin.mirrors:
            point = level * np.eye(3)[axis]
            found += [each.reflect(np.eye(3)[axis], point=point) for each in found]
        return found

    def _add_forces(self, layer: int) -> None:
        arrows = self._skin.snapshot(layer).arrows
        arrows = arrows[np.linalg.norm(arrows[:, 1], axis=1) > SEEN * self._force]
        if not len(arrows):
            return
        starts = self._pyvista.PolyData(arrows[:, 0])
        starts["force"] = arrows[:, 1] * (_LONGEST * self._size / self._force)
        shapes = starts.glyph(orient="force", scale="force", geom=self._pyvista.Arrow())
        actor = self._add(shapes, "forces", color=FORCE, lighting=False)
        # They begin at the surface and point into the body, which would hide them.
        actor.mapper.SetResolveCoincidentTopologyToPolygonOffset()
        actor.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, _ON_TOP)

    def aim(self) -> None:
        """Look at all that happens: from above the plane, or at bodies in space from aside."""
        room = 0.1 * self._size
        low, high = self._low - room, self._high + room
        if self._scene.dim < 3:
            self.plotter.view_xy()
            self.plotter.enable_parallel_projection()
        else:
            camera, middle = Camera.of(self._scene), 0.5 * (low + high)
            self.plotter.camera_position = [middle + camera.towards, middle, camera.up]
        bounds = np.stack([low, high], axis=1).ravel()
        x, y, z = (max(2, round(5.0 * way / (high - low).max())) for way in high - low)
        self.plotter.show_bounds(
            bounds=bounds, show_yaxis=self._scene.dim > 1, show_zaxis=self._scene.dim > 2,
            xtitle="x [m]", ytitle="y [m]", ztitle="z [m]", n_xlabels=x, n_ylabels=y,
            n_zlabels=z, font_size=10, location="outer", fmt="%.3g",
        )  # fmt: skip
        self.plotter.reset_camera(bounds=bounds)

    def add_slider(self, layer: int) -> None:
        """Let the user choose the time."""
        times = self.fields.times
        if len(times) < 2:
            return
        shown = [layer]

        def slide(time: float) -> None:
            nearest = nearest_layer(times, self._inside(time))
            if nearest != shown[0]:
                shown[0] = nearest
                self.show(nearest)

        self.plotter.add_slider_widget(
            slide, [float(times[0]), float(times[-1])], value=float(times[layer]),
            title="time [s]", pointa=(0.3, 0.08), pointb=(0.7, 0.08), interaction_event="always",
            style="modern", fmt="%.4g",
        )  # fmt: skip


def known_fields(result: "Record") -> "Snapshots":
    """The fields of a result.

    Raises:
        OutputError: There are none.
    """
    if result.fields is None:
        raise OutputError(
            "this result has no fields: solve it (a solid on rank 0) with "
            'output.fields = ["vtkhdf"]'
        )
    return result.fields


def make_view(
    result: "Record",
    time: float | None = None,
    field: str | None = None,
    *,
    off_screen: bool | None = None,
) -> tuple[View, int]:
    """A view at a time, or at the largest contact force; and its layer.

    Raises:
        OutputError: There are no fields.
        SceneError: The time or the field is none of the fields.
        MissingDependencyError: pyvista is not installed.
    """
    wanted = None if time is None else nearest_layer(known_fields(result).times, time)
    view = View(result, field, off_screen=off_screen)
    layer = view.telling if wanted is None else wanted
    view.show(layer)
    view.aim()
    return view, layer


def show(
    result: "Record",
    time: float | None = None,
    field: str | None = None,
    path: Path | None = None,
) -> None:
    """Show a result in a window, or write a picture or page of it.

    Args:
        result: With fields.
        time: At which [s]; that of the largest contact force if None.
        field: That colours tell; stress, or else speed, if None.
        path: Target, ``.png`` or ``.html``; None for a window.

    Raises:
        OutputError: There are no fields, no display, or the file cannot be written.
        SceneError: Time, field or ending are unknown.
        MissingDependencyError: pyvista, or for a page trame, is not installed.
    """
    if path is not None and path.suffix not in _ENDINGS:
        raise SceneError(f"--out {path}: a picture is a .png, a page a .html; choose one of them")
    known_fields(result)
    _check_surroundings(path)
    # It tells of displays that it does not need; Debian's pyvista cannot be told not to.
    quiet = getattr(load_pyvista(), "vtk_verbosity", lambda _: nullcontext())
    with quiet("off"):
        view, layer = make_view(result, time, field, off_screen=path is not None)
        _put_out(view, layer, path)


def _put_out(view: View, layer: int, path: Path | None) -> None:
    """Open the window, or write the file."""
    if path is None:
        if view.plotter.render_window.GetClassName() in _WINDOWLESS:
            raise OutputError(_NO_DISPLAY)
        view.add_slider(layer)
        view.plotter.show()
        return
    try:
        if path.suffix == ".png":
            view.plotter.screenshot(path)
        else:
            getattr(view.plotter, "trame", view.plotter).export_html(path)
    except ImportError as error:
        raise MissingDependencyError(
            f"{path}: a page needs more of pyvista ({' '.join(str(error).split())[:80]} ...); "
            "`pip install 'pyvista[jupyter]'`, or write a .png"
        ) from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        view.plotter.close()


def _check_surroundings(path: Path | None) -> None:
    """Refuse what cannot be drawn here, before VTK ends the process.

    Raises:
        OutputError: There is no display for a window, or VTK cannot draw.
    """
    needs_window = path is None and sys.platform.startswith("linux")
    if needs_window and not any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY"))):
        raise OutputError(_NO_DISPLAY)
    if fault := drawing_fault():
        raise OutputError(
            f"VTK {fault}; run it by xvfb-run, or take the pictures of `impactfem plot DIR`, "
            "which need neither VTK nor a display"
        )
