"""Pictures of bodies in space, projected and shaded here: no display and no VTK is needed."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, override

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, to_rgb

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.report.camera import Camera
from impactfem.report.edges import unit_normals
from impactfem.report.page.numbers import quantity
from impactfem.report.painter import Painter
from impactfem.report.palette import EDGE, FLOOR, GRID, HELD, STRESS, fill, tint
from impactfem.report.pile import Pile
from impactfem.report.skin import Skin, Snapshot
from impactfem.report.slender_picture import slender
from impactfem.result import Record, Snapshots
from impactfem.result.whole import Whole
from impactfem.scene.obstacles.faces import spacing
from impactfem.scene.obstacles.rotation import Placement, placement

_GREY = np.array([0.78, 0.78, 0.78])
_AMBIENT = 0.62  # share of the light that comes from all around
_ARROW = {"arrowstyle": "->", "shrinkA": 0.0, "shrinkB": 0.0}
_LONGEST = 0.3  # share of the size that the largest contact force is drawn at


@dataclass(frozen=True)
class SpacePainter(Painter):
    """Draws bodies in space, with their edges and their faces in the light.

    Attributes:
        plain: Whether bodies have their own colours, whatever their stress.
        ground: Where obstacles without end are drawn, and how far [m]; around the bodies if None.
    """

    plain: bool = False
    ground: tuple[Floats, float] | None = None

    @override
    def room(self, across: float) -> float:
        return max(0.15 * self.skin.size, 0.06 * across)

    @override
    def prepare(self, axes: Axes, window: Floats, time: float) -> list[Artist]:
        del time
        axes.set_aspect("equal")
        axes.set_xlim(*window[0])
        axes.set_ylim(*window[1])
        axes.set_xticks([])
        axes.set_yticks([])
        above = self._draw_directions(axes, window)
        if any(obstacle.plane_normal for obstacle in self.obstacles):
            every = quantity(spacing(self._reach), "m", 3)
            scale = axes.text(
                0.97, 0.02, f"lines every {every}", fontsize=8, ha="right", va="bottom",
                transform=axes.transAxes, zorder=4,
            )  # fmt: skip
            above.append(scale)
        return above

    @override
    def draw(self, axes: Axes, snapshot: Snapshot) -> list[Artist]:
        artists: list[Artist] = []
        pile = Pile()
        centre = 0.5 * (snapshot.place.min(axis=0) + snapshot.place.max(axis=0))
        centre = centre if self.ground is None else self.ground[0]
        for obstacle in self.obstacles:
            at = placement(obstacle, snapshot.time)
            if self.skin.relief is not None:
                at = replace(at, shift=at.shift + self.skin.relief.shift(obstacle, snapshot.time))
            if obstacle.plane_normal is not None:
                artists += self._plane(axes, obstacle, at, centre)
                continue
            patches = at.moved(obstacle.faces(at.back(centre), 1.25 * self._reach))
            self._lay(pile, patches, np.broadcast_to(_GREY, (len(patches), 3)))
        faces, two_sided = snapshot.place[self.skin.triangles], self.skin.open_faces
        self._lay(pile, faces, self._colours(snapshot), two_sided)
        self._lay_edges(pile, snapshot.place)
        discs, tints, nodes = slender(self.skin, self.camera.flat(snapshot.place))
        pile.add(discs, tints, snapshot.place[nodes] @ self.camera.towards, width=0.0)
        body = pile.collection(2.0)
        axes.add_collection(body, autolim=False)
        artists.append(body)
        if self.force > 0.0:
            flat = self.camera.flat(snapshot.arrows)
            artists.append(self.draw_arrows(axes, flat, _LONGEST * self.skin.size))
        return [*artists, *self.draw_pins(axes, snapshot)]

    def _lay(
        self,
        pile: Pile,
        faces: Floats,
        colours: Floats,
        two_sided: Booleans | bool = False,
    ) -> None:
        """Lay faces on the pile that show their front, darker where they turn from the light."""
        normal = unit_normals(faces)
        away = two_sided & (normal @ self.camera.towards < 0.0)
        normal[away] *= -1.0
        front = normal @ self.camera.towards > 0.0
        faces, normal = faces[front], normal[front]
        lit = _AMBIENT + (1.0 - _AMBIENT) * np.clip(normal @ self._light, 0.0, 1.0)
        near = faces.mean(axis=1) @ self.camera.towards
        pile.add(self.camera.flat(faces), colours[front] * lit[:, None], near)

    def _lay_edges(self, pile: Pile, place: Floats) -> None:
        """Lay edges on the pile, just before the faces beside them that show their front."""
        ends, beside = self._edges
        if not len(ends):
            return
        corners = place[self.skin.triangles]
        towards = self.camera.towards
        near = corners.mean(axis=1) @ towards
        near[(unit_normals(corners) @ towards <= 0.0) & ~self.skin.open_faces] = -np.inf
        nearest = near[beside].max(axis=1)
        shown = np.isfinite(nearest)
        ends, nearest = ends[shown], nearest[shown]
        held = self.marks.held[ends].all(axis=1) if self.marks.held.any() else nearest < -np.inf
        owners = self.skin.bodies[ends[:, 0]]
        colours = np.where(
            self.skin.is_stressed[ends].all(axis=1)[:, None], to_rgb(EDGE), self._tints[owners]
        )
        for some, tone, width in ((~held, colours, 0.8), (held, to_rgb(HELD), 2.5)):
            own = tone[some] if isinstance(tone, np.ndarray) else tone
            lines = self.camera.flat(place[ends[some]])
            before = (0.05 if width > 1.0 else 0.02) * self.skin.size
            pile.add(lines, own, nearest[some] + before, width=width)

    @cached_property
    def _edges(self) -> tuple[Integers, Integers]:
        """Edges of the surfaces, and of marks on bodies with stress that turn; see `Skin.edges`."""
        turned = list(self.marks.turned)
        if self.plain or not turned:
            return self.skin.edges
        ends, beside = self.skin.seams
        marked = np.isin(self.skin.bodies[ends[:, 0]], turned) & self.skin.stressed[beside[:, 0]]
        kept, plain = self.skin.edges, self.skin.bodies[self.skin.edges[0][:, 0]]
        others = ~(np.isin(plain, turned) & self.skin.stressed[kept[1][:, 0]])
        return (
            np.concatenate([kept[0][others], ends[marked]]),
            np.concatenate([kept[1][others], beside[marked]]),
        )

    @cached_property
    def _tints(self) -> Floats:
        return np.array([tint(k) for k in range(len(self.skin.names))])

    @cached_property
    def _plain(self) -> Floats:
        """Colours of faces without stress: in those of their bodies, with marks; (triangles, 3)."""
        owners = self.skin.bodies[self.skin.triangles[:, 0]]
        fills = np.array([fill(k) for k in range(len(self.skin.names))])[owners]
        marked = self.skin.marked & np.isin(owners, list(self.marks.turned))
        fills[marked] = 0.5 * (fills + self._tints[owners])[marked]
        return np.asarray(fills)

    @cached_property
    def _light(self) -> Floats:
        light = self.camera.towards + 0.8 * self.camera.up - 0.8 * self.camera.right
        return np.asarray(light / np.linalg.norm(light))

    @property
    def _reach(self) -> float:
        return 1.6 * self.skin.size if self.ground is None else self.ground[1]

    def _colours(self, snapshot: Snapshot) -> Floats:
        """Stress as a colour, or that of the body, shape (triangles, 3)."""
        if self.plain:
            return self._plain
        stress = snapshot.von_mises[self.skin.triangles].mean(axis=1)
        colours = np.array(colormaps[STRESS](Normalize(*self.stress)(stress)))[:, :3]
        return np.where(self.skin.stressed[:, None], colours, self._plain)

    def _plane(self, axes: Axes, obstacle: Any, at: Placement, centre: Floats) -> list[Artist]:
        """A part of the plane below the body; what shows its front lies behind all bodies."""
        corners, lines = map(at.moved, obstacle.grid(at.back(centre), self._reach))
        front = float(at.turned(np.array(obstacle.unit_normal)) @ self.camera.towards) > 0.0
        plane = PolyCollection(
            [self.camera.flat(corners)], facecolors=FLOOR if front else "none",
            edgecolors=GRID, linewidths=0.8, zorder=0.5,
        )  # fmt: skip
        grid = LineCollection(
            list(self.camera.flat(lines)), colors=GRID, linewidths=0.5, zorder=0.6
        )
        for collection in (plane, grid):
            axes.add_collection(collection, autolim=False)
        return [plane, grid] if front else [plane]

    def _draw_directions(self, axes: Axes, window: Floats) -> list[Artist]:
        drawn: list[Artist] = []
        size = 0.09 * float(np.ptp(window, axis=1).min())
        start = window[:, 0] + 1.6 * size
        for axis, name in zip(np.eye(3), "xyz", strict=True):
            step = size * self.camera.flat(axis)
            tip, place = start + step, start + 1.35 * step
            arrow = axes.annotate(
                "", (tip[0], tip[1]), (start[0], start[1]), arrowprops=_ARROW, zorder=4,
                annotation_clip=False,
            )  # fmt: skip
            letter = axes.text(
                place[0], place[1], name, ha="center", va="center", fontsize=8, zorder=4
            )
            drawn += [arrow, letter]
        return drawn


def skin_of(result: Record, fields: Snapshots) -> Skin:
    """Skin of the bodies of a result; a quarter or eighth is completed but for what hides it."""
    whole = Whole.of_summary(result.summary)
    scene = result.scene
    towards = Camera.of(scene).towards if scene.dim == 3 else np.zeros(3)
    return Skin.of(fields, whole, towards, max(2, scene.dim))
