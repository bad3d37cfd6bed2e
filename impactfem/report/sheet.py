"""The paper that figures are drawn on: no display is needed, and notebooks show it."""

import io
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


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
