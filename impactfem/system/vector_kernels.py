"""Vectors of three components as tuples in compiled loops: arrays for each product take longer."""

from impactfem.compiled import compiled


@compiled
def by(matrix, a):
    """A matrix (3, 3) times a vector."""
    return (
        matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
        matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
        matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
    )


@compiled
def across(matrix, a):
    """The transpose of a matrix (3, 3) times a vector."""
    return (
        matrix[0, 0] * a[0] + matrix[1, 0] * a[1] + matrix[2, 0] * a[2],
        matrix[0, 1] * a[0] + matrix[1, 1] * a[1] + matrix[2, 1] * a[2],
        matrix[0, 2] * a[0] + matrix[1, 2] * a[1] + matrix[2, 2] * a[2],
    )


@compiled
def crossed(a, b):
    """The cross product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@compiled
def dot(a, b):
    """The scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def less(a, b):
    """Their difference."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled
def plus(a, share, b):
    """A vector and a share of another one."""
    return (a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2])


@compiled
def put(a, share, where):
    """A share of a vector, written."""
    where[0], where[1], where[2] = share * a[0], share * a[1], share * a[2]


@compiled
def add(a, share, where):
    """The same, added."""
    where[0] += share * a[0]
    where[1] += share * a[1]
    where[2] += share * a[2]
