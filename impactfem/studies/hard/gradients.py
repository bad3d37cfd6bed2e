"""Hard cases of gradients: what is nearly touched, told on both sides, or has none."""

import math
from typing import Any

import numpy as np

from impactfem.errors import ImpactError, SceneError
from impactfem.inverse import Gradient, gradient, identify
from impactfem.methods import METHODS
from impactfem.scene import Scene
from impactfem.studies.hard.board import Facts
from impactfem.studies.hard.rows import Row

_QUIET = {"report": False, "pictures": False, "fields": []}
_BAR = {
    "kind": "bar", "name": "bar", "length": 1.0, "density": 1.0, "youngs_modulus": 1.0,
    "area": 1.0, "velocity": -0.5,
}  # fmt: skip


def _asked(title: str, method: str, **tables: Any) -> Scene:
    """A scene of which something is asked, with a method."""
    return Scene.from_dict(
        {"title": title, "solve": {"method": method}, "output": _QUIET} | tables
    )  # fmt: skip


def beside_graze(method: str, row: Row) -> Facts:
    """A mass on a spring meets a wall just before it would turn: place later by first place.

    x0 cos(2 t1 - t) with x0 cos t1 = -w; its derivative grows with the inverse root of the depth.

    Args:
        method: Name of the method.
        row: Gives how ``deep`` beyond the wall it would turn; 0 or less: it touches or misses it.
    """
    end, depth = 5.0, row.given["deep"]
    wall = 1.0 - depth
    spring = _asked(
        "graze", method,
        duration=end,
        body=[{"kind": "point", "name": "mass", "mass": 1.0, "position": [1.0], "force": ["-x"]}],
        obstacle=[{"kind": "half_space", "name": "wall", "point": [-wall], "normal": [1.0]}],
        contact=[{"between": ["mass", "wall"], "restitution": 1.0}],
        parameter=[{"name": "x0", "key": "body.mass.position.0"}],
        measure=[{"name": "place", "of": "mass.x"}],
        objective={"minimise": [{"term": "value", "of": "place"}]},
    )  # fmt: skip
    if depth <= 0.0:
        return {"untold": _untold(spring)}
    found, hit = gradient(spring), math.acos(-wall)
    phase, late = 2.0 * hit - end, -wall / math.sin(hit)
    right = math.cos(phase) - 2.0 * math.sin(phase) * late
    return {"slope": abs(found.gradient["x0"] / right - 1.0), "untold": 0.0}


def _untold(scene: Scene) -> float:
    """0 where a gradient is refused or doubted."""
    try:
        return float(gradient(scene).trusted)
    except SceneError:
        raise
    except ImpactError:
        return 0.0


def restitution(method: str, row: Row) -> Facts:  # noqa: ARG001  (of all cases)
    """The height of a ball after its impact by that from which it fell, .98785200."""
    g, e, end = 9.81, 0.8, 0.9
    ball = _asked(
        "ball", method,
        duration=end, gravity=[0.0, -g],
        body=[{"kind": "point", "name": "ball", "mass": 2.0, "position": [0.0, 1.0]}],
        obstacle=[{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                   "normal": [0.0, 1.0]}],
        contact=[{"between": ["ball", "floor"], "restitution": e}],
        parameter=[{"name": "h0", "key": "body.ball.position.1"}],
        measure=[{"name": "height", "of": "ball.y"}],
        objective={"minimise": [{"term": "value", "of": "height"}]},
    )  # fmt: skip
    fall = math.sqrt(2.0 / g)
    # h = e g s (t - s) - g (t - s)^2 / 2 with s = sqrt(2 h0 / g), so ds/dh0 = 1 / (g s)
    right = (e * (end - 2.0 * fall) + end - fall) / fall
    return {"slope": abs(gradient(ball).gradient["h0"] / right - 1.0), "untold": 0.0}


def _founding(method: str, row: Row, of: str, values: Any, gap: float) -> Scene:
    """The founding bar with a history that its gap is to follow, (times, values)."""
    elements = int(row.given["elements"])
    scene = _asked(
        "founding bar", method,
        duration=4.0, body=[_BAR | {"gap": gap}], obstacle=[{"kind": "wall", "name": "wall"}],
        parameter=[{"name": "H", "key": "body.bar.gap", "bounds": [0.1, 1.0]}],
        measure=[{"name": f"m{k}", "of": of, "at": float(t), "value": float(v), "sigma": 0.02}
                 for k, (t, v) in enumerate(values)],
    )  # fmt: skip
    return scene if METHODS[method].exact else scene.with_settings({"solve.elements": elements})


def on_layers(method: str, row: Row) -> Facts:
    """Misfit of the founding bar's impulse by its gap, with impacts on layers: .38 in the mean.

    One-sided slopes of 40 elements are .3825 and .3775; that of the exact solution is .38.
    """
    times = np.linspace(0.0, 4.0, 4 * int(row.given["elements"]) + 1)[1:]
    pushed = np.clip(0.5 * (times - 1.0), 0.0, 1.0)
    scene = _founding(method, row, "impulse.bar.wall", zip(times, pushed, strict=True), 0.6)
    found: Gradient = gradient(scene)
    sides = found.sides is not None or METHODS[method].exact
    slope = 2.0 * found.gradient["H"] * times[0] * 0.02**2  # of squares, not halves of them
    return {"slope": abs(slope / 0.38 - 1.0), "untold": float(not sides)}


def valley(method: str, row: Row) -> Facts:
    """The gap of the founding bar from its force with noise: a V, and minima beside it."""
    times = np.arange(0.05, 4.0, 0.05)
    force = 0.5 * ((times > 1.0) & (times < 3.0))
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(times))
    scene = _founding(method, row, "force.bar.wall", zip(times, force + noise, strict=True), 0.45)
    found = identify(scene)
    off = abs(found.parameters["H"].value - 0.5) / (found.parameters["H"].sigma or 1.0)
    return {"untold": float(off > 4.0 and found.trusted)}
