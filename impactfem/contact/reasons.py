"""What is said about the choice of contact nodes: sentences for the plan, and the refusal."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from impactfem.arrays import Booleans, Floats, Integers
from impactfem.contact.boundary import Boundary
from impactfem.contact.facing import ROUNDING, Fields
from impactfem.contact.reach import Reach
from impactfem.errors import SceneError


def check_start(
    name: str,
    obstacles: Sequence[Any],
    places: Floats,
    fields: Fields,
    on_asked: Booleans,
    size: float,
) -> None:
    """Refuse a body that is inside an obstacle at t = 0."""
    inside = (fields.gap < -ROUNDING * size) & on_asked & ~fields.held
    if not inside.any():
        return
    k, node = divmod(int(np.argmin(np.where(inside, fields.gap, 0.0))), inside.shape[1])
    obstacle, depth = obstacles[k], -fields.gap[k, node]
    within = int(inside[k].sum())
    whole = within == int((on_asked & ~fields.held[k]).sum())
    remedy = (
        f"move the body by {depth:.3g} m along {_show(fields.normal[k, node])}, or the obstacle"
    )
    if whole:
        turned = {
            "half_space": "turn its normal: the body stays on the side that it points to",
            "sphere": "is side = 'inside' or 'outside' the wrong way round?",
            "cylinder": "is side = 'inside' or 'outside' the wrong way round?",
            "polyline": "reverse its points: the body stays on the left of their direction",
        }.get(obstacle.kind)
        remedy += f"; or {turned}" if turned else ""
    nodes = "1 of its nodes lies" if within == 1 else f"{within} of its nodes lie"
    raise SceneError(
        f"body {name!r}: at t = 0 {'the whole of it lies' if whole else nodes} "
        f"inside obstacle {obstacle.name!r}, deepest at {_show(places[node])} by {depth:.3g} m; "
        f"{remedy}"
    )


def _show(vector: Floats) -> str:
    return "(" + ", ".join(f"{value + 0.0:.4g}" for value in vector) + ")"


def explain(
    outside: Boundary,
    asked: Booleans,
    real: Booleans,
    obstacles: Sequence[Any],
    fields: Fields,
    able: Booleans,
    chosen: Integers,
    reach: Reach,
    holding: str,
) -> tuple[str, ...]:
    """Count what was chosen and what was left out, by reasons and surfaces."""
    on_asked = outside.touched(asked)
    home = np.where(on_asked, _homes(outside, asked), _homes(outside, real))
    names = (*outside.names, "without name")

    def counted(nodes: Booleans) -> str:
        counts = np.bincount(home[nodes], minlength=len(names))
        parts = [f"{names[k]} {counts[k]}" for k in np.flatnonzero(counts)]
        return f"{int(nodes.sum())} nodes ({', '.join(parts)})"

    kept = able.any(axis=0)
    if not kept.any():
        alone = "warning: no face of the body can touch an obstacle: it flies freely"
        said = [alone.partition(": ")[2].partition(": ")[0] if "joints" in holding else alone]
    else:
        said = [f"{counted(kept)} of the {int(on_asked.sum())} on the outside can touch"]
        said += [
            f"obstacle {obstacle.name!r}: {int((kept & (chosen == k)).sum())} of them"
            for k, obstacle in enumerate(obstacles)
            if len(obstacles) > 1
        ]
    left = on_asked & ~kept
    held = left & fields.held.all(axis=0)
    away = left & ~held & (fields.held | fields.away).all(axis=0)
    behind = left & ~held & ~away
    behind &= (fields.held | fields.hidden | fields.away).all(axis=0)
    far = left & ~held & ~away & ~behind
    it = "every obstacle" if len(obstacles) > 1 else f"obstacle {obstacles[0].name!r}"
    if held.any():
        said.append(f"{counted(held)} are held by {holding} along the normal of {it}")
    if away.any():
        said.append(f"{counted(away)} face away from {it}")
    if behind.any():
        said.append(f"{counted(behind)} have other parts of the body between them and {it}")
    if far.any():
        said.append(f"{counted(far)} are too far from {it}: {reach.why}")
    elif not np.isfinite(reach.distance) and kept.any():
        said.append(f"none is left out for its distance: {reach.why}")
    unasked = outside.touched(real) & ~on_asked
    if unasked.any():
        said.append(f"{counted(unasked)} are not on the contact surfaces")
    several = able.sum(axis=0) > 1
    if several.any():
        said.append(
            f"{counted(several)} could touch more than one obstacle; each is held off the one it "
            "meets first, the run watches the others"
        )
    return tuple(said)


def _homes(outside: Boundary, faces: Booleans) -> Integers:
    """The first surface of each node, seen from some faces; one past the last if there is none."""
    none = len(outside.names)
    home = np.full(len(outside.numbers), none)
    member = np.full(len(outside.faces), none)
    for k in reversed(range(none)):
        member[outside.members[:, k]] = k
    np.minimum.at(home, outside.faces[faces], member[faces][:, None])
    return home
