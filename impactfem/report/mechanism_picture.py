"""A picture of mechanisms at t = 0: shapes of links, frames, and what a frame shall reach."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import PolyCollection

from impactfem.report.camera import Camera
from impactfem.report.palette import fill, tint
from impactfem.report.sheet import Sheet
from impactfem.scene import Scene
from impactfem.scene.rigid_keys import rotation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from impactfem.models.kinematics import Kinematics


_AXIS = 0.08  # length of the axes of a frame, as a share of the picture
_COLOURS = ("tab:red", "tab:green", "tab:blue")


def mechanism_picture(scene: Scene, mechanisms: "Sequence[Kinematics]") -> Sheet:
    """Draw mechanisms in parallel projection."""
    from scipy.spatial import ConvexHull  # noqa: PLC0415  (only this picture needs it)

    camera, figure = Camera.of(scene), Sheet(6.0, 5.0)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    places = [frame.position for each in mechanisms for frame in each.frames.values()]
    places += [point for each in mechanisms for shape in each.shapes for point in shape]
    places += [np.array(each.target) for each in mechanisms if each.target is not None]
    flat = camera.flat(np.array(places))
    size = float(np.ptp(flat, axis=0).max()) or 1.0
    for number, each in enumerate(mechanisms):
        for shape in each.shapes:
            seen = camera.flat(shape)
            outline = seen[ConvexHull(seen).vertices]
            axes.add_collection(
                PolyCollection([outline], facecolors=fill(number), edgecolors=tint(number),
                               alpha=0.6, zorder=1)
            )  # fmt: skip
        for name, frame in each.frames.items():
            here = camera.flat(frame.position)
            if each.above[name] in each.frames:
                ends = np.array([camera.flat(each.frames[each.above[name]].position), here])
                axes.plot(*ends.T, color="0.3", linewidth=1.5, zorder=2)
            for axis, colour in zip(rotation(frame.quaternion).T, _COLOURS, strict=True):
                end = camera.flat(frame.position + _AXIS * size * axis)
                axes.plot(*np.array([here, end]).T, color=colour, linewidth=1.0, zorder=3)
        shown: dict[tuple[float, ...], list[str]] = {}
        for name, frame in each.frames.items():
            at = tuple(np.round(camera.flat(frame.position) / size, 2).tolist())
            shown.setdefault(at, []).append(name)
        for at, names in shown.items():
            where = size * at[0], size * at[1]
            axes.annotate(", ".join(names), where, (4, 4), textcoords="offset points", fontsize=7)
        if each.target is not None:
            there = camera.flat(np.array(each.target))
            axes.plot(*there, "x", color="black", markersize=9, zorder=4)
    low, high = flat.min(axis=0) - 0.15 * size, flat.max(axis=0) + 0.15 * size
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_axis_off()
    axes.set_title(scene.title, fontsize=9)
    return figure
