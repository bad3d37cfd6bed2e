"""The paper that figures are drawn on: no display is needed, and notebooks show it."""

import io
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

_DOTS_PER_INCH = 130


class Sheet(Figure):
    """A figure of Matplotlib on a canvas of Agg that a notebook shows without pyplot."""

    def __init__(self, width: float, height: float, **settings: Any) -> None:
        """Make a blank sheet with constrained layout.

        Args:
            width: [inches].
            height: [inches].
            **settings: Those of `matplotlib.figure.Figure`.
        """
        super().__init__(figsize=(width, height), layout="constrained", **settings)
        FigureCanvasAgg(self)

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png")
        return file.getvalue()


def write_png(figure: Figure, file: Path | BinaryIO) -> None:
    """Write a figure, drawn once: `savefig` draws twice where a layout is to be found.

    Args:
        figure: On a canvas of Agg.
        file: Target.
    """
    shown = figure.dpi
    canvas: Any = figure.canvas  # whose methods have no types
    figure.set_dpi(_DOTS_PER_INCH)
    try:
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())
    finally:
        figure.set_dpi(shown)
    dots = _DOTS_PER_INCH, _DOTS_PER_INCH
    Image.fromarray(pixels).convert("RGB").save(file, format="png", compress_level=3, dpi=dots)
