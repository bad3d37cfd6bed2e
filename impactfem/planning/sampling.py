"""Do data of a scene depend on a coordinate? Told from their values at many points."""

from collections.abc import Callable, Sequence

import numpy as np

from impactfem.arrays import Floats
from impactfem.scene import Scene
from impactfem.scene.formula import Formula
from impactfem.scene.solids import Solid

Field = Callable[[Floats, Floats], Floats]
"""Takes points (n, dim) and times (n,); returns values (n, components)."""

_POINTS = 1024
_EQUAL = 1e-9  # of the largest value


def of_formulas(formulas: Sequence[Formula | None]) -> Field:
    """Formulas in x, y, z, t as a field; a missing one is 0."""

    def field(points: Floats, times: Floats) -> Floats:
        columns = []
        for formula in formulas:
            values = {"t": times}
            values |= dict(zip("xyz", points.T, strict=False))
            known = {k: v for k, v in values.items() if formula and k in formula.variables}
            value = 0.0 if formula is None else formula(**known)
            columns.append(np.broadcast_to(value, times.shape))
        return np.stack(columns, axis=1)

    return field


def sum_of(fields: Sequence[Field], components: int) -> Field:
    """The sum of fields; 0 without any."""
    return lambda points, times: sum(
        (field(points, times) for field in fields), np.zeros((len(times), components))
    )


def samples(scene: Scene) -> tuple[Floats, Floats]:
    """Points (n, dim) in the box of the shape and around it, and times (n,), always the same."""
    solid = scene.solid
    if solid.shape is None:
        raise ValueError("a mesh file has no shape to sample")
    random = np.random.default_rng(0)
    centre, half = np.array(solid.shape.centre), np.array(solid.shape.half_extents)
    points = centre + half * random.uniform(-1.0, 1.0, (_POINTS, solid.dim))
    return points, random.uniform(0.0, scene.duration, _POINTS)


def equal(left: Floats, right: Floats) -> bool:
    """Whether two fields have the same values up to rounding."""
    with np.errstate(all="ignore"):  # formulas that overflow are equal to nothing
        scale = max(np.abs(left).max(initial=0.0), np.abs(right).max(initial=0.0))
        return bool(np.all(np.abs(left - right) <= _EQUAL * scale))


def is_independent(scene: Scene, field: Field, axes: Sequence[int]) -> bool:
    """Whether a field is the same at points that differ in the coordinates ``axes`` only."""
    points, times = samples(scene)
    moved = points.copy()
    moved[:, list(axes)] = np.random.default_rng(1).permutation(points)[:, list(axes)]
    return equal(field(points, times), field(moved, times))


def is_zero(formula: Formula | None) -> bool:
    """Whether a formula is the number 0, or missing."""
    return formula is None or formula.plain == 0.0


def turns(solid: Solid) -> bool:
    """Whether the body turns at t = 0."""
    spin = solid.angular_velocity
    return any(spin) if isinstance(spin, tuple) else spin != 0.0
