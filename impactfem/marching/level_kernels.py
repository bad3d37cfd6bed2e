"""Loops over the nodes of a body in explicit steps under finite strain."""

from impactfem.compiled import fused


@fused
def drifted(u, v, a, inverse, step, slow):
    """Take velocities to the middle of a step and displacements of what moves to its end.

    Args:
        u, v, a, inverse: Displacement, velocity, acceleration and inverse mass, (dofs,).
        step: [s].
        slow: Half of what damping by mass takes in it.
    """
    for i in range(len(u)):
        if inverse[i] > 0.0:
            v[i] = (v[i] + 0.5 * step * a[i]) / (1.0 + slow)
            u[i] += step * v[i]


@fused
def accelerated(force, last, v, inverse, pull, step, a):
    """Fill accelerations by forces (dofs,) and gravity (dim,).

    Args:
        force, last: At the level and at the last one, without gravity [N], (dofs,).
        v: Velocities between both, (dofs,).
        inverse: Inverse masses, (dofs,).
        pull: Gravity, (dim,).
        step: [s].
        a: Filled, (dofs,).

    Returns:
        f M^-1 f, and v K v + f M^-1 f_last with K v by the change of the forces.
    """
    dim, own, rate = len(pull), 0.0, 0.0
    for i in range(len(force)):
        a[i] = 0.0
        if inverse[i] > 0.0:
            given = force[i] * inverse[i]
            a[i] = given + pull[i % dim]
            own += force[i] * given
            rate += given * last[i] - v[i] * (force[i] - last[i]) / step
    return own, rate
