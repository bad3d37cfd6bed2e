"""The motion of solids for a film: stress in colours, with the contact force beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from impactfem.report.film import force_beside, tell_time
from impactfem.report.sheet import Sheet
from impactfem.report.skin import Skin
from impactfem.report.solid_figures import FLAT, Painter, survey
from impactfem.report.space_picture import skin_of
from impactfem.result import Result, Snapshots

_MOST, _LEAST = 60, 12  # frames
_TRIANGLES = 600_000  # drawn in all frames together: some seconds


@dataclass(frozen=True)
class SolidReel:
    """The deformed body at some layers.

    Attributes:
        figure: With the panel of the body and that of the force.
        layers: Layers of the fields, shape (moments,).
        skin: Skin of the body.
        painter: Draws it.
        panel: Where it is drawn.
        above: What stays above it.
        clock: Says the time.
        now: Marks the time.
        drawn: What the last moment drew.
    """

    figure: Figure
    layers: NDArray[np.int64]
    skin: Skin
    painter: Painter
    panel: Axes
    above: Sequence[Artist]
    clock: Text
    now: Line2D
    drawn: list[Artist] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of moments."""
        return len(self.layers)

    def show(self, moment: int) -> list[Artist]:
        """Let the figure show a layer; returns what moves, from the back to the front."""
        snapshot = self.skin.snapshot(int(self.layers[moment]))
        for artist in self.drawn:
            artist.remove()
        self.drawn.clear()
        if snapshot.is_finite:
            self.drawn.extend(self.painter.draw(self.panel, snapshot))
        for artist in self.drawn:
            artist.set_animated(True)
        told = tell_time(self.clock, self.now, snapshot.time)
        return [*self.drawn, *self.above, *told]


def solid_reel(result: Result, fields: Snapshots, frames: int | None) -> SolidReel | None:
    """The reel of solids.

    Args:
        result: The result.
        fields: Its fields.
        frames: Number of moments at most; fewer for large meshes if None.

    Returns:
        None if nothing of the motion is finite.
    """
    skin = skin_of(result, fields)
    if frames is None:
        frames = int(np.clip(_TRIANGLES // max(1, len(skin.triangles)), _LEAST, _MOST))
    layers = even_moments(fields.times, frames)
    painter, extents = survey(result, skin, (skin.snapshot(int(layer)) for layer in layers))
    if not extents:
        return None
    window = painter.window(extents)
    aspect = float(np.ptp(window[1]) / np.ptp(window[0]))
    figure = Sheet(*_size(aspect), dpi=90)
    if aspect < FLAT:
        left, right = figure.subplots(2, 1, height_ratios=[0.3 + 1.8 * aspect, 0.7])
    else:
        left, right = figure.subplots(1, 2, width_ratios=[1.3, 1.0])
    above = painter.prepare(left, window, float(fields.times[layers[0]]))
    colours = ScalarMappable(Normalize(0.0, painter.stress), "viridis")
    figure.colorbar(colours, ax=left, label="von Mises stress [Pa]", shrink=0.9)
    now = force_beside(right, result)
    figure.suptitle(result.scene.title, fontsize=11)
    clock = left.text(0.02, 0.98, "", transform=left.transAxes, va="top", zorder=5, fontsize=9)
    for artist in (*above, clock):
        artist.set_animated(True)
    return SolidReel(figure, layers, skin, painter, left, above, clock, now)


def even_moments(times: NDArray[np.float64], frames: int) -> NDArray[np.int64]:
    """Layers at about equal distances in time, at most so many."""
    wanted = np.linspace(times[0], times[-1], min(frames, len(times)))
    after = np.clip(np.searchsorted(times, wanted), 1, max(1, len(times) - 1))
    before = after - 1
    after = np.minimum(after, len(times) - 1)
    nearer = wanted - times[before] <= times[after] - wanted
    return np.unique(np.where(nearer, before, after))


def _size(aspect: float) -> tuple[float, float]:
    """Size of a frame [inches] in which the body's panel fits its height over width."""
    if aspect < FLAT:
        return 8.0, 4.2 + 6.0 * aspect
    return 9.0, float(np.clip(4.0 * aspect + 1.0, 3.2, 6.0))
