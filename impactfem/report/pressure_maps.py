"""Maps of the contact pressure of solids in space: the contact face seen square to it."""

from collections.abc import Collection, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from impactfem.arrays import Booleans, Floats
from impactfem.report.edges import normals
from impactfem.report.page.numbers import quantity
from impactfem.report.palette import PRESSURES
from impactfem.report.prefixes import prefix_ticks
from impactfem.report.skin import Skin, Snapshot


def draw_pressure_maps(
    figure: Figure,
    panels: list[Axes],
    skin: Skin,
    snapshots: list[Snapshot],
    largest: float,
    names: Sequence[str],
    carriers: Collection[str] = (),
) -> None:
    """The contact faces seen square to them from outside, coloured by the contact pressure.

    Of several bodies one is shown: of those whose nodes carry the pressure (on the other side of a
    contact it is a mean) the one with the largest.

    Args:
        figure: Where to draw.
        panels: One for each snapshot.
        skin: Skin of the bodies.
        snapshots: What to show.
        largest: Largest pressure of the colours [Pa].
        names: Names of the bodies.
        carriers: Names of those whose nodes carry the pressure; all if empty.
    """
    pressed = np.max([snapshot.pressure for snapshot in snapshots], axis=0)
    eligible = np.ones(len(pressed), dtype=bool)
    named = len(names) > 1 and skin.bodies.max() + 1 == len(names)
    if named and carriers:
        carries = np.isin(skin.bodies, [names.index(name) for name in carriers])
        eligible = carries if pressed[carries].any() else eligible
    shown = skin.bodies[int(np.argmax(np.where(eligible, pressed, 0.0)))]
    own = skin.bodies == shown
    near = np.any([s.may_touch[skin.triangles] for s in snapshots], axis=0)
    near &= own[skin.triangles]
    # On a coarse mesh perhaps no face may touch with all corners.
    touching = near.all(axis=1) if near.all(axis=1).any() else near.any(axis=1)
    faces = skin.triangles[touching]
    loaded = (pressed > 0.0) & own
    peak = max(snapshots, key=lambda snapshot: float((snapshot.pressure * own).max()))
    # The loaded faces say from where, as a body may touch on many sides and turn.
    bearing = faces[(peak.pressure[faces] > 0.0).all(axis=1)]
    outward = normals(peak.place, bearing if len(bearing) else faces).sum(axis=0)
    towards = outward / np.linalg.norm(outward) if np.linalg.norm(outward) > 0 else np.eye(3)[1]
    up = np.eye(3)[2] if abs(towards[2]) < 0.9 else np.eye(3)[1]
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    frame = np.stack([right, np.cross(towards, right)], axis=1)
    spots = [_spot(snapshot, loaded, towards) for snapshot in snapshots]
    own_spread = (peak.place[(peak.pressure > 0.0) & own] - _spot(peak, loaded, towards)) @ frame
    reach = max(1.6 * float(np.abs(own_spread).max(initial=0.0)), 0.05 * skin.size)
    for axes, snapshot, spot in zip(panels, snapshots, spots, strict=True):
        flat = (snapshot.place - spot) @ frame
        seen = faces[normals(snapshot.place, faces) @ towards > 0.0]
        axes.set_aspect("equal")
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-reach, reach)
        axes.set_xticks([])
        axes.set_yticks([])
        if not len(seen):
            continue
        mesh = Triangulation(flat[:, 0], flat[:, 1], seen)
        axes.tripcolor(
            mesh, snapshot.pressure, shading="gouraud", cmap=PRESSURES, vmin=0.0, vmax=largest,
            rasterized=True,
        )  # fmt: skip
        axes.triplot(mesh, color="0.5", linewidth=0.2)
    of = f" of {names[shown]}" if named else ""
    panels[0].set_ylabel(f"contact face{of}, {quantity(2 * reach, 'm', 3)} wide")
    colours = ScalarMappable(Normalize(0.0, largest), PRESSURES)
    bar = figure.colorbar(colours, ax=panels, shrink=0.9)
    prefix_ticks(bar.ax.yaxis, "contact pressure [Pa]")


def _spot(snapshot: Snapshot, loaded: Booleans, towards: Floats) -> Floats:
    """Middle of the pressure, or else of what is foremost of the nodes that are ever loaded."""
    now = loaded & (snapshot.pressure > 0.0)
    if now.any():
        return np.asarray(snapshot.place[now].mean(axis=0))
    places = snapshot.place[loaded]
    return np.asarray(places[int(np.argmax(places @ towards))])
