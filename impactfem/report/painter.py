"""What pictures of bodies in the plane and in space have in common: window, arrows and pins."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from impactfem.arrays import Floats
from impactfem.report.arrows import SEEN
from impactfem.report.camera import Camera
from impactfem.report.marks import NO_MARKS, Marks
from impactfem.report.palette import FORCE, HELD
from impactfem.report.skin import Skin, Snapshot, spread, union

_NARROWEST = 0.4  # share of its longer side that a picture of points is wide or high at least


@dataclass(frozen=True)
class Painter(ABC):
    """Draws bodies at true scale.

    Attributes:
        skin: Skin of the bodies.
        obstacles: Obstacles of the scene.
        camera: From where they are looked at.
        stress: Von Mises stress at the ends of the colours [Pa].
        pressure: Largest contact pressure of all pictures [Pa].
        force: Largest contact force of all pictures [N].
        marks: What is drawn upon the bodies.
    """

    skin: Skin
    obstacles: Sequence[Any]
    camera: Camera
    stress: tuple[float, float] = (0.0, 1.0)
    pressure: float = 0.0
    force: float = 0.0
    marks: Marks = NO_MARKS

    def extent(self, snapshot: Snapshot) -> Floats:
        """Range of the bodies in the picture, shape (2, 2): rows are directions."""
        flat = self.camera.flat(snapshot.place[self.skin.nodes])
        reach = self.skin.radius[self.skin.nodes][:, None]
        return np.stack([(flat - reach).min(axis=0), (flat + reach).max(axis=0)], axis=1)

    def window(self, extents: Sequence[Floats]) -> Floats:
        """Range of the picture that shows the bodies in some snapshots, shape (2, 2)."""
        window = union(extents, self.room(spread(extents)))
        if len(self.skin.triangles):
            return window
        extent = np.ptp(window, axis=1)  # not too narrow where points move along a line
        wider = 0.5 * np.maximum(_NARROWEST * extent.max() - extent, 0.0)
        return np.asarray(window + np.stack([-wider, wider], axis=1))

    @abstractmethod
    def room(self, across: float) -> float:
        """What is left free around bodies that reach so far [m]."""

    @abstractmethod
    def prepare(self, axes: Axes, window: Floats, time: float) -> list[Artist]:
        """Set the frame and draw what stays; returns what lies above the bodies."""

    @abstractmethod
    def draw(self, axes: Axes, snapshot: Snapshot) -> list[Artist]:
        """Draw what belongs to one time; returns the artists from the back to the front."""

    def draw_pins(self, axes: Axes, snapshot: Snapshot) -> list[Artist]:
        """Draw joints where they are: round if bodies turn about them, filled if to the ground."""
        drawn: list[Artist] = []
        for pin in self.marks.pins:
            x, y = self.camera.flat(pin.at(snapshot))
            drawn += axes.plot(
                x, y, "o" if pin.turns else "s", markersize=8 if pin.grounded else 6, color=HELD,
                markerfacecolor=HELD if pin.grounded else "white", zorder=4.5,
                scalex=False, scaley=False,
            )  # fmt: skip
        return drawn

    def draw_arrows(self, axes: Axes, arrows: Floats, longest: float) -> Artist:
        """Draw forces from where they act on, for each body those on it.

        Args:
            axes: Where.
            arrows: Places in the picture [m] and forces [N], shape (arrows, 2, 2).
            longest: Length of the largest force in the picture [m].
        """
        shown = arrows[np.linalg.norm(arrows[:, 1], axis=1) > SEEN * self.force]
        return axes.quiver(
            *shown[:, 0].T, *(longest / self.force * shown[:, 1].T), scale=1.0, scale_units="xy",
            angles="xy", color=FORCE, units="inches", width=0.025, headwidth=4.0, headlength=5.0,
            headaxislength=4.5, minlength=0.5, zorder=4, edgecolor="white", linewidth=0.4,
        )  # fmt: skip
