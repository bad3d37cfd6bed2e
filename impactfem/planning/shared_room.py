"""Parts of rigid bodies that lie in each other: what they share counts twice in the mass."""

from itertools import combinations

import numpy as np

from impactfem.contact.convex_pairs import facing
from impactfem.findings import Finding, warning
from impactfem.scene.content import Body
from impactfem.system.rigid import convex_of, in_space

_TOLD = 1e-6  # depth, as a share of the reach of the smaller part: what touches is drawn rounded


def overlapping(body: Body) -> Finding | None:
    """A warning about parts of a body that overlap, the deepest ones named."""
    shapes = [convex_of(part) for part in body.summed]
    centres = [in_space(part.centre) for part in body.summed]
    deep: list[tuple[float, int, int]] = []
    for i, j in combinations(range(len(shapes)), 2):
        one, two = shapes[i], shapes[j]
        if np.linalg.norm(centres[i] - centres[j]) > one.reach + two.reach:
            continue
        n, x, y = facing(one, two, (centres[i], np.eye(3)), (centres[j], np.eye(3)), 1)
        depth = one.radius + two.radius - float((x[0] - y[0]) @ n)
        if depth > _TOLD * min(one.reach, two.reach):
            deep.append((depth, i, j))
    if not deep:
        return None
    depth, i, j = max(deep)
    count = "" if len(deep) == 1 else f", the deepest of {len(deep)} such pairs"
    text = f"shapes[{i}] and shapes[{j}] of {body.name} overlap by {depth:.3g} m{count}: what they "
    remedy = "draw them side by side, or give mass, center_of_mass and inertia"
    text += "share counts twice in mass, centre and inertia"
    return warning("overlapping_parts", text, body.name, remedy)
