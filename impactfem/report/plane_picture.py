"""Pictures of bodies in the plane: stress in colours, obstacles in grey, contact pressure."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, override

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, to_rgb
from matplotlib.tri import Triangulation

from impactfem.arrays import Booleans, Floats
from impactfem.contact.distance import nearest_obstacle, signed_distance
from impactfem.report.camera import FLAT, Camera
from impactfem.report.marks import spoke
from impactfem.report.painter import Painter
from impactfem.report.palette import (
    EDGE,
    HELD,
    OBSTACLE,
    OBSTACLE_EDGE,
    PRESSURE,
    STRESS,
    fill,
    tint,
)
from impactfem.report.pile import Pile
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.skin import Snapshot
from impactfem.report.slender_picture import slender

_SAMPLES = 240  # of the obstacles' outline along each axis
_LONGEST = 0.2  # share of the body's size that the largest contact pressure is drawn at
_ROOM = 0.06  # share of the picture that is left free around the bodies
_THICK = 3.0  # of a slender body the size is at most so many times its thickness

WIDEST = 5.0
"""Width of the line that the largest pressure between bodies is drawn with [pt]."""


@dataclass(frozen=True)
class PlanePainter(Painter):
    """Draws plane or axisymmetric bodies.

    Attributes:
        axisymmetric: Whether x is the radius.
        several: Whether bodies can strike each other: then the pressure is a line along the
            contact, the wider the larger, as an area beyond it would cover the other body.
    """

    camera: Camera = FLAT
    axisymmetric: bool = False
    several: bool = False

    @override
    def room(self, across: float) -> float:
        beyond = self.pressure > 0.0 and not self.several
        return _ROOM * max(self.skin.size, across) + (1.1 * self._longest if beyond else 0.0)

    @override
    def window(self, extents: Sequence[Floats]) -> Floats:
        window = super().window(extents)
        if self.axisymmetric:
            window[0, 0] = -0.06 * self.skin.size
        return window

    @override
    def prepare(self, axes: Axes, window: Floats, time: float) -> list[Artist]:
        axes.set_aspect("equal")
        axes.set_xlim(*window[0])
        axes.set_ylim(*window[1])
        axes.locator_params(axis="x", nbins=4)
        axes.locator_params(axis="y", nbins=5)
        prefix_ticks(axes.xaxis, "radius x [m]" if self.axisymmetric else "x [m]")
        prefix_ticks(axes.yaxis, "y [m]")
        if self.axisymmetric:
            axes.axvline(0.0, color="0.5", linewidth=0.8, linestyle="-.", zorder=0.5)
        if not self._moves:
            draw_obstacles(axes, self.obstacles, time)
        return []

    @override
    def draw(self, axes: Axes, snapshot: Snapshot) -> list[Artist]:
        artists = draw_obstacles(axes, self.obstacles, snapshot.time) if self._moves else []
        ends = snapshot.place[self.skin.segments][:, :, :2]
        if self.skin.stressed.any():
            x, y = snapshot.place[:, 0], snapshot.place[:, 1]
            colours = axes.tripcolor(
                Triangulation(x, y, self.skin.triangles[self.skin.stressed]), snapshot.von_mises,
                shading="gouraud", cmap=STRESS, norm=Normalize(*self.stress), rasterized=True,
            )  # fmt: skip
            outline = LineCollection(list(ends[self._outlined]), colors=EDGE, linewidths=0.5)
            axes.add_collection(outline, autolim=False)
            artists += [colours, outline]
        pile = self._pile(snapshot)
        if len(pile):
            others = pile.collection(2.5)
            axes.add_collection(others, autolim=False)
            artists.append(others)
        if self.pressure > 0.0:
            drawn = self._pressure_lines if self.several else self._pressure
            pressures = drawn(snapshot, ends)
            axes.add_collection(pressures, autolim=False)
            artists.append(pressures)
        if self.force > 0.0:
            longest = self._longest if len(self.skin.triangles) else _LONGEST * self.skin.size
            arrows = snapshot.arrows[:, :, :2] * ([0.0, 1.0] if self.axisymmetric else 1.0)
            artists.append(self.draw_arrows(axes, arrows, longest))
        return [*artists, *self.draw_pins(axes, snapshot)]

    @cached_property
    def _outlined(self) -> Booleans:
        """Segments of the boundary of solids with stress, shape (segments,)."""
        return np.asarray(self.skin.is_stressed[self.skin.segments].all(axis=1))

    def _pile(self, snapshot: Snapshot) -> Pile:
        """Bodies without stress in their colours, what is held, and lines that turn with bodies."""
        skin, place, pile = self.skin, snapshot.place[:, :2], Pile()
        plain = skin.triangles[~skin.stressed]
        rims = skin.edges[0] if len(plain) else skin.segments[:0]
        for body in np.unique(skin.bodies[plain]):
            own = plain[skin.bodies[plain[:, 0]] == body]
            rim = rims[skin.bodies[rims[:, 0]] == body]
            pile.add(place[own], fill(body), width=0.3)
            pile.add(place[rim], fill(body), edges=tint(body), width=1.0)
        polygons, tints, _ = slender(skin, place)
        pile.add(polygons, tints, width=0.0)
        if self.marks.held.any():
            held = skin.segments[self.marks.held[skin.segments].all(axis=1)]
            pile.add(place[held], to_rgb(HELD), width=3.0)
        for body in self.marks.turned:
            line = spoke(skin, snapshot, body)[:, :2]
            soft = skin.is_stressed[skin.solid_nodes[body]].any()
            pile.add(line[None], to_rgb(EDGE) if soft else tint(body), width=1.2)
        return pile

    @property
    def _longest(self) -> float:
        """Length at which the largest contact pressure is drawn [m]."""
        extents = np.ptp(self.skin.points[self.skin.nodes, :2], axis=0)
        return _LONGEST * min(self.skin.size, _THICK * float(extents.min()))

    @property
    def _moves(self) -> bool:
        return any(obstacle.moves for obstacle in self.obstacles)

    def _pressure(self, snapshot: Snapshot, ends: Floats) -> PolyCollection:
        """The pressure as an area beyond the contact face, drawn into the obstacle."""
        loaded = snapshot.pressure > 0.0
        into = np.zeros((len(snapshot.place), 2))
        along = ends[:, 1] - ends[:, 0]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        if loaded.any():
            places = snapshot.place[loaded, :2]
            into[loaded] = -nearest_obstacle(self.obstacles, places, snapshot.time)[2]
        scale = self._longest / self.pressure
        tops = ends + (scale * snapshot.pressure[:, None] * into)[self.skin.segments]
        # Edges that end at a loaded corner but turn away carry nothing themselves.
        facing = np.einsum("ij,ij->i", outward, into[self.skin.segments].sum(axis=1))
        shown = snapshot.may_touch[self.skin.segments].all(axis=1)
        shown &= facing > 0.3 * np.hypot(*outward.T)
        areas = np.concatenate([ends, tops[:, ::-1]], axis=1)[shown]
        return PolyCollection(
            list(areas), facecolors=PRESSURE, edgecolors=PRESSURE, linewidths=0.3, zorder=3
        )

    def _pressure_lines(self, snapshot: Snapshot, ends: Floats) -> LineCollection:
        """The pressure as lines along the faces that are pressed at both ends."""
        pressure = snapshot.pressure[self.skin.segments]
        shown = (pressure > 0.0).all(axis=1)
        return LineCollection(
            list(ends[shown]), colors=PRESSURE, capstyle="butt", zorder=3,
            linewidths=np.maximum(1.0, WIDEST * pressure[shown].mean(axis=1) / self.pressure),
        )  # fmt: skip


def draw_obstacles(axes: Axes, obstacles: Sequence[Any], time: float) -> list[Artist]:
    """Fill where the signed distance that the solver uses is negative, within the axes' limits."""
    if not obstacles:
        return []
    x, y = (np.linspace(*limits, _SAMPLES) for limits in (axes.get_xlim(), axes.get_ylim()))
    places = np.stack([part.ravel() for part in np.meshgrid(x, y)], axis=1)
    gaps = [signed_distance(obstacle, places, time)[0] for obstacle in obstacles]
    gap = np.min(gaps, axis=0).reshape(len(y), len(x))
    if gap.min() > 0.0:
        return []
    filled = axes.contourf(x, y, gap, levels=[gap.min() - 1.0, 0.0], colors=[OBSTACLE], zorder=0.3)
    edge = axes.contour(x, y, gap, levels=[0.0], colors=[OBSTACLE_EDGE], linewidths=1.0, zorder=0.4)
    return [filled, edge]
