"""Supports: which degrees of freedom are held or moved, and how."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impactfem import fem
from impactfem.arrays import Floats, Integers
from impactfem.errors import MeshError, SceneError
from impactfem.scene import Formula
from impactfem.scene.jets import motion_at
from impactfem.system.nodes import Nodes

_AXES = "xyz"
_FREE = -1
_ZERO = Formula("0", ("t",))


@dataclass(frozen=True)
class Supports:
    """Constrained degrees of freedom of this rank.

    Attributes:
        constrained: Whether each owned degree of freedom is held or moved, shape (owned dofs,).
        lasting: Which of them always are, (owned dofs,).
        moved: Owned degrees of freedom that follow a formula, shape (moved,).
        which: Index of the formula of each of ``moved``, shape (moved,).
        formulas: Displacements [m] in t, the same on all ranks.
        planes: Axis and coordinate [m] of symmetry supports that bound the body, of axes that have
            one only; the same on all ranks.
    """

    constrained: NDArray[np.bool_]
    lasting: NDArray[np.bool_]
    moved: Integers
    which: Integers
    formulas: tuple[Formula, ...]
    planes: tuple[tuple[int, float], ...] = ()

    def motion(self, t: float, *, inertia: bool = False) -> tuple[Floats, Floats, Floats]:
        """Displacement [m], velocity [m/s] and acceleration [m/s^2] of ``moved`` at time t.

        Args:
            t: Time [s].
            inertia: Whether the acceleration must be finite, which that of t**1.5 at 0 is not.

        Raises:
            SceneError: One of them is not finite at that time; on all ranks.
        """
        jets = [motion_at(formula, t) for formula in self.formulas]
        for formula, jet in zip(self.formulas, jets, strict=True):
            if not np.isfinite(jet.value + jet.rate + (jet.second if inertia else 0.0)):
                raise SceneError(
                    f"the motion {formula.text!r} of a support is not finite at t = {t:g} s: "
                    f"{jet.value:g} m, {jet.rate:g} m/s, {jet.second:g} m/s^2; give a formula that "
                    "is smooth there"
                )
        table = np.array([(jet.value, jet.rate, jet.second) for jet in jets]).reshape(-1, 3)
        values = table[self.which]
        return values[:, 0], values[:, 1], values[:, 2]


def find_supports(
    nodes: Nodes,
    surfaces: Mapping[str, NDArray[np.int32]],
    supports: Sequence[Any],
    *,
    axisymmetric: bool = False,
) -> Supports:
    """Find what supports hold (collective).

    Args:
        nodes: Nodes of the body.
        surfaces: Local facets of each named surface.
        supports: With attributes ``surface``, ``kind`` ("fixed", "symmetry" or "motion"), ``value``
            (formula in t or None for each direction) and ``until`` (None: for ever).
        axisymmetric: Whether nodes at x = 0 lie on the axis, which they cannot leave.

    Raises:
        MeshError: An unknown surface, a symmetry surface that is no plane along the axes, or an
            axisymmetric body that reaches beyond the axis.
        SceneError: Two supports contradict each other at a node.
    """
    supports = sorted(supports, key=lambda each: each.until is not None)
    formulas: list[Formula] = [_ZERO]
    holder = [
        [(direction, _index(formulas, formula)) for direction, formula in enumerate(values)]
        for values in (_values(support, nodes.dim) for support in supports)
    ]
    state = np.full(nodes.owned * nodes.dim, _FREE, dtype=np.int64)
    by = np.full(nodes.owned * nodes.dim, _FREE, dtype=np.int64)
    labels = [f"{support.kind} support of {support.surface!r}" for support in supports]
    if axisymmetric:
        _check_axis(nodes)
        labels.append("axis of symmetry")
        on_axis = np.flatnonzero(np.abs(nodes.positions[: nodes.owned, 0]) <= nodes.same)
        _hold(nodes, state, by, nodes.dofs(on_axis, 0), 0, len(supports), labels, formulas)
    levels: list[Floats] = [np.zeros(0)] * nodes.dim
    for k, support in enumerate(supports):
        facets = surface_facets(surfaces, support.surface, "support")
        if support.mirrors:
            for direction, part in enumerate(_plane_facets(nodes, facets, support.surface)):
                dofs = nodes.dofs(nodes.on_facets(part), direction)
                _hold(nodes, state, by, dofs, 0, k, labels, formulas)
                own = nodes.positions[nodes.of_facets(part), direction].ravel()
                levels[direction] = np.append(levels[direction], own)
            continue
        found = nodes.on_facets(facets)
        for direction, index in holder[k]:
            if index != _FREE:
                dofs = nodes.dofs(found, direction)
                _hold(nodes, state, by, dofs, index, k, labels, formulas)
    moved = np.flatnonzero(state > 0)
    planes = _bounding_planes(nodes, levels, axisymmetric=axisymmetric)
    held = state != _FREE
    ending = np.array([*(each.until is not None for each in supports), False])
    which = state[moved] - 1
    return Supports(held, held & ~ending[by], moved, which, tuple(formulas[1:]), planes)


def _bounding_planes(
    nodes: Nodes, levels: Sequence[Floats], *, axisymmetric: bool
) -> tuple[tuple[int, float], ...]:
    """Axes along which all levels are one, with the body on one side of it (collective)."""
    found = []
    for axis in range(int(axisymmetric), nodes.dim):  # at r = 0 the model itself is symmetric
        places = nodes.positions[:, axis]
        ends = [(x.min(initial=np.inf), x.max(initial=-np.inf)) for x in (levels[axis], places)]
        low, high = np.array(nodes.comm.allgather(ends)).transpose(2, 1, 0)
        (held, body), (last, beyond) = low.min(axis=1), high.max(axis=1)
        bounds = [end for end in (body, beyond) if abs(held - end) <= nodes.same]
        if bounds and last - held <= nodes.same:
            found.append((axis, float(bounds[0])))
    return tuple(found)


def surface_facets(
    surfaces: Mapping[str, NDArray[np.int32]], name: str, what: str
) -> NDArray[np.int32]:
    """Facets of a surface.

    Raises:
        MeshError: There is no such surface.
    """
    if name not in surfaces:
        known = ", ".join(surfaces) or "no named surface"
        raise MeshError(f"the surface {name!r} of a {what} is not in the mesh, which has {known}")
    return surfaces[name]


def _values(support: Any, dim: int) -> Sequence[Formula | None]:
    return support.value if support.moves else (_ZERO,) * dim


def _index(formulas: list[Formula], formula: Formula | None) -> int:
    """Index of a formula in the list, to which it is added when new; 0 for what never moves."""
    if formula is None:
        return _FREE
    for k, known in enumerate(formulas):
        both = formula.is_constant and known.is_constant
        if known.text == formula.text or (both and known(t=0.0) == formula(t=0.0)):
            return k
    formulas.append(formula)
    return len(formulas) - 1


def _hold(
    nodes: Nodes,
    state: Integers,
    by: Integers,
    dofs: Integers,
    index: int,
    support: int,
    labels: list[str],
    formulas: list[Formula],
) -> None:
    """Let a formula govern degrees of freedom, unless another one does (collective)."""
    clash = dofs[(state[dofs] != _FREE) & (state[dofs] != index)]
    error = None
    if clash.size:
        dof = int(clash[0])
        place = ", ".join(f"{x:g}" for x in nodes.positions[dof // nodes.dim])
        error = SceneError(
            f"two supports give the node at ({place}) different displacements along "
            f"{_AXES[dof % nodes.dim]}: {formulas[state[dof]].text!r} by the "
            f"{labels[by[dof]]}, {formulas[index].text!r} by the {labels[support]}; give both the "
            'same formula, or leave that direction free in one of them with ""'
        )
    fem.raise_together(nodes.comm, error)
    state[dofs] = index
    by[dofs] = support


def _check_axis(nodes: Nodes) -> None:
    x = nodes.positions[:, 0]
    error = None
    if x.size and x.min() < -nodes.same:
        error = MeshError(
            f"an axisymmetric body reaches x = {x.min():g} m, but x is the distance from the axis; "
            "draw the half with x >= 0 only"
        )
    fem.raise_together(nodes.comm, error)


def _plane_facets(nodes: Nodes, facets: NDArray[np.int32], name: str) -> list[NDArray[np.int32]]:
    """Split facets by the axis along which they are flat (collective).

    Raises:
        MeshError: A facet is not flat along an axis.
    """
    points = nodes.positions[nodes.of_facets(facets)]
    span = np.ptp(points, axis=1)
    axis = np.argmin(span, axis=1)
    bent = np.flatnonzero(np.min(span, axis=1) > nodes.same)
    error = None
    if bent.size:
        place = ", ".join(f"{x:g}" for x in points[bent[0]].mean(axis=0))
        error = MeshError(
            f"the symmetry surface {name!r} is inclined or curved near ({place}), but a symmetry "
            "plane must be normal to x, y or z; turn the body so that it is, or use "
            'kind = "motion" or "fixed"'
        )
    fem.raise_together(nodes.comm, error)
    return [facets[axis == direction] for direction in range(nodes.dim)]
