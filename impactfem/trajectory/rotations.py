"""How what turns freely in space ends: rows that say it, and a motion to begin a search with.

Of the four numbers of a quaternion three are free, so that four rows would depend on each other.
That of the rotation from the end that is asked, conj(p) q, has no vector part there. Its first
entry is 1; -1 is the same place, a full turn away.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from impactfem.arrays import Floats
from impactfem.errors import SceneError
from impactfem.scene.rigid_keys import rotation
from impactfem.scene.values import show
from impactfem.trajectory.problem import Row
from impactfem.trajectory.symbols import loaded
from impactfem.trajectory.tree import Tree

_NORMAL = 1e-6  # by which the length of a quaternion may differ from 1
_PLACES = 65  # of a guess


def asked_rotations(tree: Tree, given: Mapping[str, tuple[float, float]]) -> dict[str, Floats]:
    """Quaternions (4,) at the end, of bodies all of whose numbers are said.

    Args:
        tree: The bodies.
        given: Limits of columns.

    Raises:
        SceneError: One is no rotation.
    """
    found = {}
    for name in tree.quaternions:
        columns = [f"{name}.q{letter}" for letter in "wxyz"]
        if not all(column in given and not np.ptp(given[column]) for column in columns):
            continue
        wanted = np.array([given[column][0] for column in columns])
        length = float(np.linalg.norm(wanted))
        if abs(length - 1.0) > _NORMAL:
            own = "" if length == 0.0 else f", as {show((wanted / length).round(9).tolist())}"
            raise SceneError(
                f"trajectory.end.{name}.qw to .qz = {show(wanted.tolist())}: is no unit "
                f"quaternion, its length is {length:.6g}; give one{own}"
            )
        found[name] = wanted / length
    return found


def rotation_rows(name: str, tree: Tree, wanted: Floats, states: Any) -> list[Row]:
    """Three rows of an end that is turned as wanted (4,), and one that counts full turns.

    Args:
        name: Of the body.
        tree: With it.
        wanted: Quaternion, w first.
        states: Symbols of all states.
    """
    casadi = loaded()
    own = tree.q[tree.quaternions[name]]
    left = _difference(wanted) @ (own / casadi.norm_2(own))
    about = [
        Row(f"{name}: half of the turn about {axis} that is left at the end",
            casadi.Function("row", [states], [left[1 + k]]), 0.0, 0.0, 1.0)
        for k, axis in enumerate("xyz")
    ]  # fmt: skip
    whole = casadi.Function("row", [states], [left[0]])
    return [*about, Row(f"{name}: signs of qw to qz at the end", whole, 0.0, np.inf, 1.0)]


def turned(start: Floats, wanted: Floats, spin: Floats) -> Floats:
    """Quaternions evenly on the way from one (4,) to another, (places, 4).

    Args:
        start: At t = 0.
        wanted: At the end; the opposite of the start is a full turn away.
        spin: About which it turns at t = 0, for full turns [rad/s], (3,).
    """
    way = _difference(start) @ wanted
    angle = np.arctan2(np.linalg.norm(way[1:]), way[0])
    ways = way[1:], rotation(start).T @ spin, np.eye(3)[0]
    axis = next(each / size for each in ways if (size := np.linalg.norm(each)) > _NORMAL)
    shares = np.linspace(0.0, angle, _PLACES)[:, None]
    steps = np.hstack([np.cos(shares), np.sin(shares) * axis])
    return np.asarray(steps @ _difference(start))


def quaternion_rates(quaternions: Floats, spins: Floats) -> Floats:
    """Rates (..., 4) of unit quaternions (..., 4) by angular velocities (..., 3) [rad/s]."""
    first, rest = quaternions[..., :1], quaternions[..., 1:]
    along = -np.sum(spins * rest, axis=-1, keepdims=True)
    return np.asarray(0.5 * np.concatenate([along, first * spins + np.cross(spins, rest)], axis=-1))


def _difference(quaternion: Floats) -> Floats:
    """What makes others those of the rotations from it, conj(p) q, (4, 4)."""
    w, x, y, z = quaternion
    return np.array([[w, x, y, z], [-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]])
