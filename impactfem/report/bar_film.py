"""The motion of bars for a film: stress in colours along the axis, with the contact force."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from impactfem.report.bar_row_figures import magnified
from impactfem.report.film import force_beside, tell_time
from impactfem.report.sheet import Sheet
from impactfem.report.solid_film import even_moments
from impactfem.result import Fields, Result

Floats = NDArray[np.float64]
Nodes = NDArray[np.int64]

_FRAMES = 60
_PIECES = 400  # coloured pieces of all bars together


@dataclass(frozen=True)
class BarReel:
    """Bars on their axis at some layers.

    Attributes:
        figure: With the panel of the bars and that of the force.
        times: [s], shape (moments,).
        near, far: Places of the ends of the pieces in the picture [m], (moments, pieces).
        stress: Stress of the pieces, tension positive [Pa], (moments, pieces).
        first: First piece of each bar, shape (bars,).
        pieces: The pieces as drawn.
        outlines: The outlines of the bars.
        clock: Says the time.
        now: Marks the time.
    """

    figure: Figure
    times: Floats
    near: Floats
    far: Floats
    stress: Floats
    first: NDArray[np.int64]
    pieces: PolyCollection
    outlines: LineCollection
    clock: Text
    now: Line2D

    @property
    def count(self) -> int:
        """Number of moments."""
        return len(self.times)

    def show(self, moment: int) -> Sequence[Artist]:
        """Let the figure show a layer; returns what moves, from the back to the front."""
        a, b = self.near[moment], self.far[moment]
        self.pieces.set_verts(_boxes(a, b))
        self.pieces.set_array(self.stress[moment])
        ends = a[self.first], b[np.append(self.first[1:], len(b)) - 1]
        self.outlines.set_segments(_boxes(*ends)[:, [0, 1, 2, 3, 0]])
        told = tell_time(self.clock, self.now, float(self.times[moment]))
        return [self.pieces, self.outlines, *told]


def bar_reel(result: Result, fields: Fields, frames: int | None) -> BarReel | None:
    """The reel of a bar or of bars in a row.

    Motion and gaps of stiff bars are magnified, as in their picture of world lines.

    Args:
        result: The result.
        fields: Its fields.
        frames: Number of moments at most; 60 if None.

    Returns:
        None if the motion is not finite.
    """
    moments = even_moments(fields.times, frames or _FRAMES)
    if not np.isfinite(fields.displacement[moments]).all():
        return None
    near, far, moduli, first = _pieces(result, fields)
    place, factor = magnified(fields, moments)
    u, x = fields.displacement[moments], fields.positions
    stress = moduli * (u[:, far] - u[:, near]) / (x[far] - x[near])
    figure = Sheet(8.0, 4.0, dpi=90)
    above, below = figure.subplots(2, 1, height_ratios=[0.8, 1.0])
    wall = bool(result.scene.obstacles)
    low, high = float(place.min()), float(place.max())
    room = 0.04 * (high - low)
    low = min(low, 0.0) if wall else low
    above.set_xlim(low - room, high + room)
    above.set_ylim(-2.2, 2.2)
    above.set_yticks([])
    motion = f", motion and gaps x {factor:g}" if factor > 1.0 else ""
    above.set_xlabel(f"place on the axis [m]{motion}")
    if wall:
        above.axvspan(low - room, 0.0, color="0.45", alpha=0.5, hatch="//", linewidth=0)
    most = float(np.abs(stress).max()) or 1.0
    pieces = PolyCollection(
        [], cmap="coolwarm", norm=Normalize(-most, most), linewidths=0, antialiaseds=False
    )
    outlines = LineCollection([], colors="0.25", linewidths=0.8)
    for drawn in (pieces, outlines):
        drawn.set_animated(True)
        above.add_collection(drawn, autolim=False)
    figure.colorbar(pieces, ax=above, label="stress [Pa]", aspect=8)
    clock = above.text(0.99, 0.95, "", transform=above.transAxes, ha="right", va="top", fontsize=9)
    clock.set_animated(True)
    now = force_beside(below, result)
    figure.suptitle(result.scene.title, fontsize=11)
    times = fields.times[moments]
    ends = place[:, near], place[:, far]
    return BarReel(figure, times, *ends, stress, first, pieces, outlines, clock, now)


def _boxes(near: Floats, far: Floats) -> Any:
    """Corners of boxes between two ends each, shape (boxes, 4, 2): the types know no arrays."""
    across = np.broadcast_to([-1.0, -1.0, 1.0, 1.0], (len(near), 4))
    return np.stack([np.column_stack([near, far, far, near]), across], axis=2)


def _pieces(result: Result, fields: Fields) -> tuple[Nodes, Nodes, Floats, Nodes]:
    """First and last nodes of the pieces, Young's moduli [Pa], and the first piece of each bar."""
    counts = fields.counts or (len(fields.positions),)
    starts = np.cumsum([0, *counts])
    most = max(2, _PIECES // len(counts))
    near, far, moduli = [], [], []
    for k, bar in enumerate(result.scene.bars):
        nodes = np.linspace(starts[k], starts[k + 1] - 1, min(counts[k], most + 1)).astype(int)
        near.append(nodes[:-1])
        far.append(nodes[1:])
        moduli.append(np.full(len(nodes) - 1, bar.youngs_modulus))
    first = np.cumsum([0, *(len(part) for part in near[:-1])])
    return np.concatenate(near), np.concatenate(far), np.concatenate(moduli), first
