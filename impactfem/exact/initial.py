"""Initial and load data of an exact bar: checked, and sampled where they are given as functions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from impactfem.errors import SceneError
from impactfem.exact.pieces import Array, Line

_ROUNDING = 64 * float(np.finfo(float).eps)
_INSET = 1e-9  # "just inside a piece", as a share of its width
_GAUSS = 0.5 - 0.5 / 3.0**0.5, 0.5 + 0.5 / 3.0**0.5
_ROUNDS = 40  # a jump is enclosed to 2^-40 of a piece
_MOST = 16384  # pieces


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
    first, last = np.r_[towards[:, 0], away[:, 0]], np.r_[towards[:, 1], away[:, 1]]
    return Line(border.tolist(), first.tolist(), last.tolist())


@dataclass(frozen=True)
class Start:
    """An initial state in pieces: u quadratic and u_t linear on each.

    Attributes:
        nodes: (n+1,) borders [m].
        displacement: (n+1,) there [m].
        velocity: (n, 2) at both ends of each piece [m/s].
        middle: (n,) displacement in the middle of each piece [m]; None: linear there.
        error: estimate of the largest error of a displacement that the pieces leave [m].
    """

    nodes: Array
    displacement: Array
    velocity: Array
    middle: Array | None
    error: float


def sample(
    length: float,
    speed: float,
    displacement: Callable[[Array], ArrayLike],
    velocity: Callable[[Array], ArrayLike],
    count: int,
    tolerance: float,
) -> Start:
    """An initial state given by two functions of x, in as many pieces as it needs.

    One piece if both functions are affine to rounding. Otherwise `count` equal pieces, halved
    where displacements would err by more than `tolerance`: u by its parabola through ends and
    middle; int u_t dx / c by the line through the two Gauss points of u_t, whose integral over a
    piece is right to order five, so that what is left does not add up along the bar. Jumps and
    bends inside pieces are enclosed by ever shorter ones.

    Args:
        length: L [m].
        speed: c [m/s].
        displacement: u(0, x) [m].
        velocity: u_t(0, x) [m/s].
        count: pieces to begin with.
        tolerance: share of the largest displacement (or way of one transit at the largest speed).
    """
    if count < 1:
        raise SceneError(f"pieces = {count}: give at least 1")
    x = np.linspace(0.0, length, count + 1)
    fine = np.linspace(0.0, length, 2 * count + 1)
    u, v = _values("displacement", displacement, fine), _lines(x, velocity)[0]
    if _affine(fine, u) and _affine(np.stack([x[:-1], x[1:]], axis=-1), v):
        return Start(x[[0, -1]], u[[0, -1]], np.array([[v[0, 0], v[-1, 1]]]), None, 0.0)
    allowed = tolerance * max(np.abs(u).max(), np.abs(v).max() * length / speed)
    errors = _deviations(x, speed, displacement, velocity)
    for _ in range(_ROUNDS):
        halved = errors.sum(axis=1) > allowed
        halved &= np.diff(x) > 4.0 * _ROUNDING * length
        if not halved.any() or len(errors) + halved.sum() > _MOST:
            break
        i = np.flatnonzero(halved)
        x = np.insert(x, i + 1, 0.5 * (x[i] + x[i + 1]))
        pairs = i + np.arange(len(i))  # first of each two new pieces
        edges = np.stack([x[pairs], x[pairs + 1], x[pairs + 2]], axis=-1)
        errors = np.repeat(errors, 1 + halved, axis=0)
        errors[np.stack([pairs, pairs + 1], axis=-1)] = _deviations(
            edges, speed, displacement, velocity
        )
    return Start(
        x,
        _values("displacement", displacement, x),
        _lines(x, velocity)[0],
        _values("displacement", displacement, 0.5 * (x[1:] + x[:-1])),
        float(errors[:, 0].max() + errors[:, 1].sum()),
    )


def _lines(x: Array, velocity: Callable[[Array], ArrayLike]) -> tuple[Array, Array, Array]:
    """Line through two Gauss points of each piece between borders x (..., n+1).

    Returns:
        Its values at both ends and those of the function just inside them (..., n, 2), and its
        integral over the piece (..., n).
    """
    width = np.diff(x)[..., None]
    places = x[..., :-1, None] + width * np.array([_INSET, *_GAUSS, 1.0 - _INSET])
    values = _values("velocity", velocity, places)
    mean, half = 0.5 * (values[..., 1] + values[..., 2]), 0.5 * (values[..., 2] - values[..., 1])
    ends = np.stack([mean - half * 3.0**0.5, mean + half * 3.0**0.5], axis=-1)
    return ends, values[..., [0, 3]], width[..., 0] * mean


def _deviations(
    x: Array,
    speed: float,
    displacement: Callable[[Array], ArrayLike],
    velocity: Callable[[Array], ArrayLike],
) -> Array:
    """Errors of displacement that pieces between borders x (..., n+1) leave [m], (..., n, 2).

    First those inside of the piece, then that beyond it, which adds up along the bar.
    """
    left, width = x[..., :-1], np.diff(x)
    u = _values("displacement", displacement, left[..., None] + width[..., None] * np.arange(5) / 4)
    # The parabola through the ends and the middle, at both quarters.
    near = np.abs(u[..., 1] - (0.375 * u[..., 0] + 0.75 * u[..., 2] - 0.125 * u[..., 4]))
    far = np.abs(u[..., 3] - (0.375 * u[..., 4] + 0.75 * u[..., 2] - 0.125 * u[..., 0]))
    ends, edges, whole = _lines(x, velocity)
    halves = np.stack([left, left + 0.5 * width, x[..., 1:]], axis=-1)
    _, parts, integrals = _lines(halves, velocity)
    # What is left of a smooth function is a parabola: with r at the ends and r / 2 in the middle
    # its integral reaches 0.1 r h within the piece.
    inner = np.abs(parts[..., [0, 1], [1, 0]] - ends.mean(axis=-1)[..., None])
    rest = np.maximum(0.1 * np.abs(edges - ends), 0.2 * inner).max(axis=-1) * width / speed
    beyond = np.abs(integrals.sum(axis=-1) - whole) / speed
    return np.stack([np.maximum(np.maximum(near, far), rest), beyond], axis=-1)


def _values(name: str, function: Callable[[Array], ArrayLike], x: Array) -> Array:
    return finite(name, np.broadcast_to(np.asarray(function(x), dtype=np.float64), x.shape))


def _affine(x: Array, y: Array) -> bool:
    first, last = float(y.flat[0]), float(y.flat[-1])
    chord = first + (last - first) * (x / x.flat[-1])
    return bool(np.abs(y - chord).max() <= _ROUNDING * np.abs(y).max())
