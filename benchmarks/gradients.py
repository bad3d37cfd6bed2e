"""Errors of gradients against their cost: ours, differences, and MJX beside them (2 minutes).

    python benchmarks/gradients.py [--python PYTHON] [--out benchmarks/results]

PYTHON imports mujoco and jax (pip install mujoco-mjx); without it MJX is left out. Writes
gradients.md with its stamp and docs/images/gradients.png.
"""

import argparse
import json
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from stamp import RESULTS, write_stamp

import impactfem
from impactfem import Scene
from impactfem.inverse.varied import Varied
from impactfem.studies.study import markdown_table

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
QUIET = {"report": False, "pictures": False, "fields": []}
END, RESTITUTION, G = 0.9, 0.8, 9.81
GAP, TIMES = 0.609717, np.linspace(0.0, 4.0, 161)[1:]  # of the bar; its impact is off layers
BEST_OF = 3


class Point(NamedTuple):
    """A derivative.

    Attributes:
        problem, way: What of, and how it was found.
        number: Step of differences, time step [s] or elements.
        slope: The derivative.
        error: Relative.
        seconds: It took [s].
        runs: The same in plain runs of that method.
    """

    problem: str
    way: str
    number: str
    slope: float
    error: float
    seconds: float
    runs: float


def ball(**solve: Any) -> Scene:
    """A ball that falls on a floor and comes back."""
    return Scene.from_dict(
        {
            "title": "ball", "duration": END, "gravity": [0.0, -G],
            "body": [{"kind": "point", "name": "ball", "mass": 1.0, "position": [0.0, 1.0]}],
            "obstacle": [{"kind": "half_space", "name": "floor", "point": [0.0, 0.0],
                          "normal": [0.0, 1.0]}],
            "contact": [{"between": ["ball", "floor"], "restitution": RESTITUTION}],
            "parameter": [{"name": "p", "key": "body.ball.position.1"}],
            "measure": [{"name": "m", "of": "ball.y"}],
            "objective": {"minimise": [{"term": "value", "of": "m"}]},
            "solve": solve, "output": QUIET,
        }
    )  # fmt: skip


def bar(folder: Path, **solve: Any) -> Scene:
    """The founding bar: the squares of what its wall misses of a wanted impulse, as a sum."""
    data = np.column_stack([TIMES, np.clip(0.5 * (TIMES - 1.0), 0.0, 1.0)])
    np.savetxt(folder / "wanted.csv", data, delimiter=",", fmt="%.17g")
    return Scene.from_dict(
        {
            "title": "bar", "duration": 4.0,
            "body": [{"kind": "bar", "name": "bar", "length": 1.0, "density": 1.0,
                      "area": 1.0, "youngs_modulus": 1.0, "gap": GAP, "velocity": -0.5}],
            "obstacle": [{"kind": "wall", "name": "wall"}],
            "parameter": [{"name": "p", "key": "body.bar.gap", "bounds": [0.1, 1.0]}],
            "measure": [{"name": "m", "of": "impulse.bar.wall", "data": "wanted.csv",
                         "sigma": 1.0}],
            "solve": solve, "output": QUIET,
        },
        base=folder,
    )  # fmt: skip


def fastest(act: Callable[[], Any]) -> tuple[Any, float]:
    """What an act finds, and the least of some times that it took [s]."""
    found, least = act(), float("inf")
    for _ in range(BEST_OF):
        begin = time.perf_counter()
        found = act()
        least = min(least, time.perf_counter() - begin)
    return found, least


def ours(problem: str, way: str, number: str, scene: Scene, right: float) -> Point:
    """A derivative along the motion."""
    varied = Varied.of(scene)

    def slope() -> float:
        varied._last = None  # each anew  # noqa: SLF001
        told = varied.jacobian(varied.start)
        return float((varied.quantities.slope(told.numbers) @ told.jacobian)[0])

    found, seconds = fastest(slope)
    _, plain = fastest(lambda: varied.numbers(varied.start))
    return Point(problem, way, number, found, abs(found / right - 1.0), seconds, seconds / plain)


def differences(scene: Scene, right: float) -> list[Point]:
    """Central differences of exact runs, by their step."""
    varied, points = Varied.of(scene), []
    for step in 10.0 ** -np.arange(1, 10):

        def slope(step: float = float(step)) -> float:
            at = varied.start
            far, near = (varied.quantities.objective(varied.numbers(at + s)) for s in (step, -step))
            return float(far - near) / (2.0 * step)

        found, seconds = fastest(slope)
        error = abs(found / right - 1.0)
        points.append(Point("ball", "differences, event_driven", f"{step:.0e}", found, error,
                            seconds, 2.0))  # fmt: skip
    return points


def stepped(method: str, right: float) -> list[Point]:
    """Central differences of a tenth of the way of a step, of runs with time steps."""
    points = []
    for dt in (1e-2, 1e-3, 1e-4):

        def height(first: float, dt: float = dt) -> float:
            scene = ball(method=method, dt=dt).with_settings({"parameter.p.start": first})
            return float(impactfem.solve(scene).history["ball.y"][-1])

        def slope(dt: float = dt, height: Callable[[float], float] = height) -> float:
            step = 0.1 * dt
            return (height(1.0 + step) - height(1.0 - step)) / (2.0 * step)

        found, seconds = fastest(slope)
        points.append(Point("ball", f"differences, {method}", f"{dt:.0e} s", found,
                            abs(found / right - 1.0), seconds, 2.0))  # fmt: skip
    return points


def mjx(python: str, right: float) -> list[Point]:
    """MJX's own derivative, by its time step."""
    script, points = Path(__file__).parent / "peers" / "gradient_mjx.py", []
    for dt, stiffness in ((1e-2, 1e4), (1e-3, 1e4), (1e-4, 1e5)):
        case = {"dt": dt, "end": END, "restitution": RESTITUTION, "stiffness": stiffness}
        done = subprocess.run(
            [python, str(script), json.dumps(case)], capture_output=True, text=True, check=True
        )
        told = json.loads(done.stdout.splitlines()[-1])
        cost = told["slope_seconds"]
        points.append(Point("ball", "MJX", f"{dt:.0e} s", told["slope"],
                            abs(told["slope"] / right - 1.0), cost,
                            cost / told["value_seconds"]))  # fmt: skip
    return points


def measured(python: str | None) -> list[Point]:
    """All derivatives."""
    fall = float(np.sqrt(2.0 / G))
    right = (RESTITUTION * (END - 2.0 * fall) + END - fall) / fall
    points = [ours("ball", "impactfem, event_driven", "", ball(method="event_driven"), right)]
    points += differences(ball(method="event_driven"), right)
    points += stepped("moreau_jean", right) + stepped("paoli_schatzman", right)
    points += mjx(python, right) if python else []
    # The sum over times in closed form: p = (t - H/v)/2 while the bar touches, dp/dH = -1.
    inside = (2.0 * GAP < TIMES) & (2.0 * GAP + 2.0 > TIMES)
    wrong = np.clip(0.5 * (TIMES - 2.0 * GAP), 0, 1) - np.clip(0.5 * (TIMES - 1.0), 0, 1)
    closed = float(-(wrong * inside).sum())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        points.append(ours("bar", "impactfem, exact", "", bar(folder, method="exact"), closed))
        for n in (20, 40, 80, 160, 320):
            scene = bar(folder, method="galerkin", elements=n)
            points.append(ours("bar", "impactfem, galerkin", f"{n} elements", scene, closed))
    return points


def picture(points: list[Point]) -> None:
    """Errors against seconds, a panel for each problem."""
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 2)
    for panel, name in zip(panels, ("ball", "bar"), strict=True):
        for way in dict.fromkeys(p.way for p in points if p.problem == name):
            own = [p for p in points if p.problem == name and p.way == way]
            style = "o" if way.startswith("impactfem") else "s--" if way == "MJX" else ".:"
            panel.loglog([p.seconds for p in own], [max(p.error, 1e-13) for p in own], style,
                         label=way)  # fmt: skip
        panel.set(xlabel="time of a gradient [s]", ylabel="relative error")
        panel.legend(fontsize=7)
        panel.grid(alpha=0.3)
    panels[1].set_xlim(1e-2, 1.0)
    panels[0].set_title("height of a ball after an impact, by its first height", fontsize=9)
    panels[1].set_title("impulse of a bar on its wall, by its gap, off the time levels", fontsize=9)
    figure.savefig(IMAGES / "gradients.png", dpi=110)


def main() -> None:
    """Measure, and write table and picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--python", help="interpreter that imports mujoco and jax")
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    points = measured(given.python)
    head = ["gradient of", "by", "step, elements", "found", "relative error", "time [ms]", "runs"]
    rows = [
        [p.problem, p.way, p.number, f"{p.slope:.8g}", f"{p.error:.1e}", f"{1e3 * p.seconds:.3g}",
         f"{p.runs:.2g}"] for p in points
    ]  # fmt: skip
    table = markdown_table(head, rows)
    print(table)
    (given.out / "gradients.md").write_text(table + "\n", encoding="utf-8")
    picture(points)
    write_stamp("gradients", folder=given.out)


if __name__ == "__main__":
    main()
