"""Whether a system in generalised coordinates can be started from a state."""

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.system.derivatives import differentiate
from impactfem.system.generalized import GeneralizedSystem, LinearSystem, factor_mass

_OPEN = 1e-6  # share of the lengths and speeds by which a start may miss bilateral rows
_SAME_JACOBIAN = 1e-5  # share of the largest entry by which a given Jacobian may differ


def check_start(system: GeneralizedSystem, u: Floats, v: Floats, t: float = 0.0) -> None:
    """Refuse a system that cannot be started from a state.

    Raises:
        SceneError: Wrong shapes, a mass matrix that is not symmetric positive definite, forces
            that are not finite, a Jacobian that contradicts differences, a gradient that vanishes
            where its constraint is closed, or a state outside the constraints.
    """
    for name, value, size in (("position", u, system.coordinates), ("velocity", v, system.dofs)):
        if value.shape != (size,) or not np.isfinite(value).all():
            raise SceneError(
                f"{name} = {value.tolist()}: give {size} finite numbers, one for each of "
                f"{', '.join(system.names)}"
            )
    _check_joined(system, u, v)
    factor_mass(system, u)
    force = system.force(t, u, v)
    if force.shape != (system.dofs,) or not np.isfinite(force).all():
        raise SceneError(
            f"force at t = {t:g} is {force.tolist()}: it must give {system.dofs} finite numbers"
        )
    _check_gradients(system, u, t)
    system.slip(u)
    gap = system.gap(t, u)
    length = max(1e-300, float(np.abs(u).max(initial=0.0)), float(np.abs(gap).max(initial=0.0)))
    worst = int(np.argmin(gap)) if len(gap) else 0
    if len(gap) and gap[worst] < -1e-12 * length:
        raise SceneError(
            f"position = {u.tolist()} lies outside constraint {worst}: its gap is {gap[worst]:.6g} "
            "< 0; start where every constraint is >= 0"
        )


def _check_joined(system: GeneralizedSystem, u: Floats, v: Floats) -> None:
    """Refuse a start that bilateral rows or unit vectors do not allow."""
    for entries in system.unit_vectors:
        length = float(np.linalg.norm(u[entries]))
        if abs(length - 1.0) > _OPEN:
            raise SceneError(
                f"position = {u.tolist()}: entries {entries.tolist()} are a unit vector, and have "
                f"the length {length:.9g}; give a vector of length 1"
            )
    if system.bilateral is None:
        return
    left = np.atleast_1d(np.asarray(system.bilateral(u), dtype=float))
    length = max(1e-300, float(np.abs(u).max(initial=0.0)))
    worst = int(np.argmax(np.abs(left))) if len(left) else 0
    if len(left) and not abs(left[worst]) <= _OPEN * length:
        raise SceneError(
            f"position = {u.tolist()} leaves {left[worst]:.6g} of bilateral row {worst}, which "
            "must be 0: start where joints and loops are closed"
        )
    rates = system.joined(u) @ v
    fast = int(np.argmax(np.abs(rates))) if len(rates) else 0
    if len(rates) and abs(rates[fast]) > _OPEN * max(1e-300, float(np.abs(v).max(initial=0.0))):
        raise SceneError(
            f"velocity = {v.tolist()} opens bilateral row {fast} at the rate {rates[fast]:.6g}: "
            "give one along the rows"
        )


def _check_gradients(system: GeneralizedSystem, u: Floats, t: float) -> None:
    jacobian = system.jacobian(u)
    shape = (system.num_constraints, system.dofs)
    if jacobian.shape != shape:
        raise SceneError(f"jacobian has shape {jacobian.shape}; it must be {shape}")
    if isinstance(system, LinearSystem):  # they are its rows; of thousands differences take minutes
        found = jacobian
    else:
        found = differentiate(system.constraint_function, u) @ system.moving(u)
    size = max(float(np.abs(found).max(initial=0.0)), 1e-300)
    wrong = np.abs(jacobian - found) > _SAME_JACOBIAN * size
    if wrong.any():
        j, i = (int(index) for index in np.argwhere(wrong)[0])
        raise SceneError(
            f"jacobian[{j}, {i}] = {jacobian[j, i]:.9g} at u = {u.tolist()}, but differences of "
            f"constraint {j} along {system.names[i]} give {found[j, i]:.9g}; correct it, or leave "
            "jacobian out to have it computed"
        )
    norms = np.linalg.norm(jacobian, axis=1)
    gap = system.gap(t, u)
    length = max(float(np.abs(u).max(initial=0.0)), float(np.abs(gap).max(initial=0.0)))
    flat = np.flatnonzero((norms <= 1e-12 * size) & (np.abs(gap) <= 1e-9 * length))
    if len(flat):
        raise SceneError(
            f"the gradient of constraint {flat[0]} vanishes at u = {u.tolist()}, where it is "
            "closed: it gives no normal; write it so that its gradient is not zero on its boundary "
            "(a distance instead of its square)"
        )
