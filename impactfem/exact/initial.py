"""Initial and load data of an exact bar: checked, and sampled where they are given as functions."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.exact.pieces import Array, Line

_ROUNDING = 64 * float(np.finfo(float).eps)
_INSET = 1e-9  # "just inside a piece", as a share of its width


def finite(name: str, values: ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """The values as floats, if they are finite and of the shape; SceneError otherwise."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SceneError(f"{name}: give real numbers ({error})") from error
    if shape is not None and array.shape != shape:
        raise SceneError(f"{name} has shape {array.shape}: give {shape}")
    if not np.isfinite(array).all():
        raise SceneError(f"{name} = {array[~np.isfinite(array)].flat[0]}: give finite numbers")
    return array


def positive(name: str, value: float) -> float:
    """The value as a float, if it is finite and above 0; SceneError otherwise."""
    number = float(finite(name, value, ()))
    if number <= 0.0:
        raise SceneError(f"{name} = {value}: give a number greater than 0")
    return number


def steps(times: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """Times (m,) and values (m,) of a load that is constant between increasing times from 0 on."""
    t = finite("gravity_times", times)
    if t.ndim != 1 or len(t) == 0 or t[0] != 0.0 or not (np.diff(t) > 0.0).all():
        raise SceneError(f"gravity_times = {t.tolist()}: start at 0.0 and increase")
    return t, finite("gravity_values", values, t.shape)


def pieces(
    length: float, nodes: ArrayLike, displacement: ArrayLike, velocity: ArrayLike
) -> tuple[Array, Array, Array]:
    """Borders (n+1,), displacement (n+1,) there and velocity (n, 2) at both ends of each piece."""
    x = finite("nodes", nodes)
    if x.ndim != 1 or len(x) < 2 or not (np.diff(x) > _ROUNDING * length).all():
        raise SceneError(f"nodes: give at least two, increasing from 0 to {length}")
    if x[0] != 0.0 or abs(x[-1] - length) > _ROUNDING * length:
        raise SceneError(f"nodes run from {x[0]} to {x[-1]}: give nodes from 0 to {length}")
    x = np.r_[x[:-1], length]
    u = finite("displacement", displacement, x.shape)
    v = finite("velocity", velocity)
    if v.shape == x.shape:
        v = np.stack([v[:-1], v[1:]], axis=-1)
    return x, u, finite("velocity", v, (len(x) - 1, 2))


def strain(x: Array, u: Array, bulge: Array) -> Array:
    """Strain (n, 2) at both ends of each piece; `bulge` = 4 (middle u - mean of end u)."""
    rise = np.diff(u)
    return np.stack([rise + bulge, rise - bulge], axis=-1) / np.diff(x)[:, None]


def wave(y: Array, v: Array, s: Array, *, clamped: bool) -> Line:
    """Wave w_out(t - 2l), 0 <= t <= 2l, that would have left the wall for the initial state.

    Args:
        y: (n+1,) travel times x/c of the nodes [s].
        v: (n, 2) velocity at both ends of each piece [m/s].
        s: (n, 2) c times strain there [m/s].
        clamped: whether the far end is held: it sends v + s back with the other sign.
    """
    towards, away = (-1.0 if clamped else 1.0) * (v + s), (v - s)[::-1, ::-1]
    border = np.r_[y[:-1], 2.0 * y[-1] - y[::-1]]
    return Line(border, np.r_[towards[:, 0], away[:, 0]], np.r_[towards[:, 1], away[:, 1]])


def sample(
    length: float,
    displacement: Callable[[Array], ArrayLike],
    velocity: Callable[[Array], ArrayLike],
    count: int,
) -> tuple[Array, Array, Array, Array | None]:
    """Nodes, displacement, velocity (n, 2) and midpoint displacement of two functions of x.

    One piece and no midpoints if both functions are affine to rounding, else `count` equal
    pieces.
    """
    if count < 1:
        raise SceneError(f"pieces = {count}: give at least 1")
    fine = np.linspace(0.0, length, 2 * count + 1)
    x, u = fine[::2], _values("displacement", displacement, fine)
    inset = _INSET * length / count
    inner = _values("velocity", velocity, np.stack([x[:-1] + inset, x[1:] - inset], axis=-1))
    # From just inside the piece out to its ends, so that a jump on a border stays a jump.
    tilt = (inner[:, 1:] - inner[:, :1]) * (_INSET / (1.0 - 2.0 * _INSET))
    v = np.concatenate([inner[:, :1] - tilt, inner[:, 1:] + tilt], axis=1)
    if _affine(fine, u) and _affine(np.stack([x[:-1], x[1:]], axis=-1), v):
        return x[[0, -1]], u[[0, -1]], np.array([[v[0, 0], v[-1, 1]]]), None
    return x, u[::2], v, u[1::2]


def _values(name: str, function: Callable[[Array], ArrayLike], x: Array) -> Array:
    return finite(name, np.broadcast_to(np.asarray(function(x), dtype=np.float64), x.shape))


def _affine(x: Array, y: Array) -> bool:
    first, last = float(y.flat[0]), float(y.flat[-1])
    chord = first + (last - first) * (x / x.flat[-1])
    return bool(np.abs(y - chord).max() <= _ROUNDING * np.abs(y).max())
