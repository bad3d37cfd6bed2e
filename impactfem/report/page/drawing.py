"""The scene as a drawing: where everything is at t = 0, how it moves, what holds and pulls it."""

from html import escape

from matplotlib.figure import Figure

from impactfem.report.page.line_drawing import draw_bars, draw_on_line
from impactfem.report.page.plane_drawing import draw_plane
from impactfem.report.page.sketch import svg
from impactfem.report.page.space_drawing import draw_points_in_space, draw_solids_in_space
from impactfem.result import Record


def drawing(result: Record) -> str | None:
    """The initial configuration as an SVG element; None if nothing tells what it looks like.

    The shape of a solid with a mesh file is known only if its fields were kept.
    """
    figure = _figure(result)
    return None if figure is None else svg(figure, escape(f"Drawing of {result.scene.title}"))


def _figure(result: Record) -> Figure | None:
    scene = result.scene
    if scene.bars:
        return draw_bars(scene)
    if scene.dim == 1:
        return draw_on_line(scene)
    if scene.dim == 2:
        return draw_plane(result)
    alone = len(scene.points) == len(scene.bodies)
    return draw_points_in_space(scene) if alone else draw_solids_in_space(result)
