"""Points, rods and beams in pictures: discs and bands, seen along any direction."""

from collections.abc import Sequence

import numpy as np

from impactfem.arrays import Floats, Integers
from impactfem.report.palette import fill, tint
from impactfem.report.skin import Skin

_DOT, _BAND = 0.012, 0.004  # radius of points and of lines that have none, as shares of the size
_ARC = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
_CIRCLE = np.stack([np.cos(_ARC), np.sin(_ARC)], axis=1)
_LIGHT, _HIGHLIGHT = np.array([-0.3, 0.35]), 0.45  # middle and radius of a spot on a ball


def slender(skin: Skin, flat: Floats) -> tuple[list[Floats], Floats, Integers]:
    """Outlines of all points and lines.

    Args:
        skin: Of the bodies.
        flat: Where the nodes are in the picture [m], shape (nodes, 2).

    Returns:
        Polygons (corners, 2), their colours (polygons, 3), and a node of each that says how near
        it is.
    """
    polygons: list[Floats] = []
    colours, nodes = [np.empty((0, 3))], [np.empty(0, dtype=np.int64)]
    for a, b in skin.lines:
        along = flat[b] - flat[a]
        across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-300)
        for half, shade in _bands(skin, int(a)):
            ends = half * across
            polygons.append(
                np.array([flat[a] - ends, flat[b] - ends, flat[b] + ends, flat[a] + ends])
            )
            colours.append(shade[None])
            nodes.append(np.array([a]))
    for node in skin.balls:
        radius = float(skin.radius[node]) or _DOT * skin.size
        body = int(skin.bodies[node])
        polygons += [
            flat[node] + radius * _CIRCLE, flat[node] + radius * (_LIGHT + _HIGHLIGHT * _CIRCLE)
        ]  # fmt: skip
        colours.append(np.stack([tint(body), fill(body)]))
        nodes.append(np.array([node, node]))
    return polygons, np.concatenate(colours), np.concatenate(nodes)


def _bands(skin: Skin, node: int) -> Sequence[tuple[float, Floats]]:
    """Half widths and colours of what a line is drawn with: its thickness, pale, and its axis."""
    body = int(skin.bodies[node])
    axis, thick = (_BAND * skin.size, tint(body)), (float(skin.radius[node]), fill(body))
    return [thick, axis] if skin.radius[node] > 0.0 else [axis]


def tracks(times: Floats, places: Floats, time: float, share: float) -> list[Floats]:
    """Where points have been shortly before a time.

    Args:
        times: [s], shape (layers,).
        places: In the picture [m], shape (layers, points, 2).
        time: [s].
        share: Of the duration, that a track is long.

    Returns:
        A line for each point, shape (layers shown, 2).
    """
    last = int(np.searchsorted(times, time, side="right"))
    first = int(np.searchsorted(times, time - share * (times[-1] - times[0])))
    return [places[first:last, k] for k in range(places.shape[1])]
