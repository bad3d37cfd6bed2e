"""What drawings of scenes are made of: an empty picture, arrows, dimensions, springs, SVG text."""

import io
import re
from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from impactfem.arrays import Floats
from impactfem.report.camera import Camera
from impactfem.report.page.numbers import quantity
from impactfem.result.shapes import as_vectors

BODY, EDGE, VELOCITY, GRAVITY, SUPPORT, OBSTACLE = (
    "#c6dbef", "#0b559f", "#d95f02", "#1b7837", "#7b3294", "0.80",
)  # fmt: skip
SMALL = 8.5
"""Size of labels [pt]."""

_MAGNIFIED = 1.5  # pixels of the page for a point of the drawing
_NO_METADATA = dict.fromkeys(("Creator", "Date", "Format", "Type"))


def empty(width: float, height: float) -> tuple[Figure, Axes]:
    """A picture of some inches with one pair of axes without a frame."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def arrow(
    axes: Axes, start: Sequence[float] | Floats, way: Sequence[float] | Floats, colour: str
) -> None:
    """An arrow from a place along a way, in the coordinates of the axes."""
    end = (start[0] + way[0], start[1] + way[1])
    axes.annotate(
        "", end, (start[0], start[1]), zorder=6, annotation_clip=False,
        arrowprops={
            "arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0,
            "mutation_scale": 13,
        },
    )  # fmt: skip


def draw_velocity(
    axes: Axes, camera: Camera, place: Floats, velocity: ArrayLike, length: float, beyond: float
) -> None:
    """An arrow with the speed; its length says nothing.

    Args:
        axes: Where.
        camera: From where the velocity is seen.
        place: Where the arrow begins in the picture, shape (2,).
        velocity: [m/s], shape (2,) or (3,).
        length: Of an arrow square to the view [m].
        beyond: Of this length, where the speed is told.
    """
    given = as_vectors(velocity)
    speed = float(np.linalg.norm(given))
    if speed:
        way = length * camera.flat(given / speed)
        arrow(axes, place, way, VELOCITY)
        label(axes, place + beyond * way, quantity(speed, "m/s", 4), VELOCITY)


def dimension(
    axes: Axes, start: Sequence[float], end: Sequence[float], text: str, below: float = 0.0
) -> None:
    """A dimension line between two places with its text in the middle, or some way below it."""
    axes.annotate(
        "", (end[0], end[1]), (start[0], start[1]), zorder=5,
        arrowprops={
            "arrowstyle": "<->", "color": "0.3", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0,
        },
    )  # fmt: skip
    middle = (0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1]) - below)
    label(axes, middle, text, va="top" if below else "center")


def label(
    axes: Axes, place: Sequence[float] | Floats, text: str, colour: str = "0.15", va: str = "center"
) -> None:
    """A small text on a light ground; dollar signs and such are shown as they are."""
    axes.text(
        place[0], place[1], text, fontsize=SMALL, color=colour, ha="center", va=va, zorder=7,
        parse_math=False,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "alpha": 0.9, "linewidth": 0},
    )  # fmt: skip


def spring(axes: Axes, start: Floats, end: Floats, width: float) -> None:
    """A zigzag between two places (2,), as wide as said."""
    along = end - start
    length = float(np.hypot(*along))
    if length == 0.0:
        return
    across = width * np.array([-along[1], along[0]]) / length
    share = np.concatenate([[0.0, 0.2], np.linspace(0.2, 0.8, 13), [0.8, 1.0]])
    swing = np.zeros(len(share))
    swing[3:14] = [0.5 * (-1) ** k for k in range(11)]
    axes.plot(*(start + np.outer(share, along) + np.outer(swing, across)).T, color="0.4",
              linewidth=1.0, zorder=2)  # fmt: skip


def svg(figure: Figure, title: str) -> str:
    """The picture as an SVG element to stand in a page; its texts stay texts.

    Args:
        figure: What to draw.
        title: Plain text for readers that do not see the picture; must be escaped by the caller.
    """
    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "impactfem"}):
        figure.savefig(buffer, format="svg", metadata=_NO_METADATA)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    opening = re.search(r'<svg [^>]*?viewBox="0 0 ([\d.]+) ([\d.]+)"[^>]*>', text, re.DOTALL)
    if opening is None:
        raise ValueError("Matplotlib's SVG has no viewBox")
    width, height = float(opening[1]), float(opening[2])
    element = (
        f'<svg class="drawing" width="{_MAGNIFIED * width:.0f}" viewBox="0 0 {width} {height}" '
        f'role="img" aria-label="{title}" xmlns="http://www.w3.org/2000/svg" '
        'xmlns:xlink="http://www.w3.org/1999/xlink">'
    )
    return element + text[opening.end() :]
