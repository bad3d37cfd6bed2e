"""Cost and end of the motion that really follows, against seconds: all transcriptions, Crocoddyl.

    python benchmarks/trajectories.py [--python PYTHON] [--out benchmarks/results]

PYTHON imports crocoddyl (pip install crocoddyl); without it the peer is left out. Writes
trajectories.md with its stamp and docs/images/transcriptions.png.
"""

import argparse
import json
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.integrate import solve_ivp
from stamp import RESULTS, write_stamp

import impactfem
from impactfem.studies.study import markdown_table

HERE = Path(__file__).resolve().parent
IMAGES = HERE.parent / "docs" / "images"
ROWS = (
    "euler", "midpoint", "trapezoid", "hermite_simpson", "multiple_shooting", "single_shooting",
)  # fmt: skip
INTERVALS = (25, 50, 100, 200)
LEAST = (58.8076675, 57.94478)  # of the two motions that are found, as N grows
HEAVY, LIGHT, LENGTH, G = 1.0, 0.3, 0.5, 9.81
DURATION, END, MOST = 2.0, (1.0, np.pi), 20.0
BEST_OF = 3


class Point(NamedTuple):
    """An answer.

    Attributes:
        way: How it was found.
        nodes: Intervals.
        cost: By the transcription.
        end: How far the motion that follows misses its end, in shares of how far states move.
        seconds: It took, the least of three [s].
    """

    way: str
    nodes: int
    cost: float
    end: float
    seconds: float


def rate(_t: Any, x: Any, u: Any) -> list[Any]:
    """Kelly's pole of .3 kg and .5 m on a cart of 1 kg: x, angle from hanging, v, spin."""
    s, c, push, spin = np.sin(x[1]), np.cos(x[1]), u[0], x[3]
    mass = HEAVY + LIGHT * s**2
    cart = (LENGTH * LIGHT * s * spin**2 + push + LIGHT * G * c * s) / mass
    pole = -(LENGTH * LIGHT * c * s * spin**2 + push * c + (HEAVY + LIGHT) * G * s)
    return [x[2], spin, cart, pole / (LENGTH * mass)]


def swung(row: str, nodes: int, **more: Any) -> Any:
    """The pole is turned over in 2 s with least effort."""
    rest = {"v": 0.0, "spin": 0.0}
    return impactfem.transcribe(
        rate, states={"x": (-2.0, 2.0), "angle": None, "v": None, "spin": None},
        controls={"u": (-MOST, MOST)}, duration=DURATION, start={"x": 0.0, "angle": 0.0} | rest,
        end={"x": END[0], "angle": END[1]} | rest, running=lambda _t, _x, u: u[0] ** 2,
        transcription=row, nodes=nodes, **more,
    )  # fmt: skip


def ours(guess: Any) -> list[Point]:
    """All rows of the table."""
    found = []
    for row in ROWS:
        for nodes in INTERVALS:
            runs = [swung(row, nodes, guess=guess) for _ in range(BEST_OF)]
            told = runs[0].summary
            seconds = min(run.seconds for run in runs)
            found.append(Point(row, nodes, told["cost"], told["resimulated_end_error"], seconds))
            print(found[-1], flush=True)
    return found


def peer(python: str, guess: Any) -> list[Point]:
    """Crocoddyl from the same guess; its controls are followed by the same equations."""
    found = []
    for nodes in INTERVALS:
        times = np.linspace(0.0, DURATION, nodes + 1)
        states = np.stack([np.interp(times, guess.times, x) for x in guess.states.values()], axis=1)
        given = {
            "name": "cart", "nodes": nodes, "end": END, "most": MOST, "duration": DURATION,
            "states": states.tolist(), "controls": guess.control(times[:-1])[:, 0].tolist(),
        }  # fmt: skip
        command = [python, str(HERE / "peers" / "trajectory_crocoddyl.py"), json.dumps(given)]
        told = [
            json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            for _ in range(BEST_OF)
        ]
        controls = np.array(told[0]["controls"])
        x = np.zeros(4)
        for push, start, end in zip(controls, times[:-1], times[1:], strict=True):
            x = solve_ivp(
                lambda t, x, u=push: rate(t, x, [u]), (start, end), x, "DOP853", rtol=1e-12,
                atol=1e-12,
            ).y[:, -1]  # fmt: skip
        moved = np.ptp(np.array(told[0]["states"]), axis=0)
        off = float(np.abs((x - [*END, 0.0, 0.0]) / moved).max())
        cost = float(controls @ controls) * DURATION / nodes
        found.append(Point("Crocoddyl", nodes, cost, off, min(each["seconds"] for each in told)))
        print(found[-1], flush=True)
    return found


def off(point: Point) -> float:
    """Cost, less the least of the motion that it is near to."""
    return min((point.cost - least for least in LEAST), key=abs)


def drawn(points: list[Point]) -> None:
    """Cost and end against seconds."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for way in dict.fromkeys(point.way for point in points):
        mine = [point for point in points if point.way == way]
        seconds, style = [point.seconds for point in mine], "--" if way == "Crocoddyl" else "-"
        left.loglog(seconds, [abs(off(p)) for p in mine], f"o{style}", label=way)
        right.loglog(seconds, [p.end for p in mine], f"o{style}", label=way)
    left.set_ylabel("cost less that of its motion")
    right.set_ylabel("end error, share of the way")
    for axes in (left, right):
        axes.set_xlabel("time of the search [s]")
        axes.grid(visible=True, which="major", alpha=0.3)
    left.legend(fontsize=8)
    figure.savefig(IMAGES / "transcriptions.png", dpi=110)


def main() -> None:
    """Run all and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", help="an interpreter that imports crocoddyl")
    parser.add_argument("--out", type=Path, default=RESULTS)
    asked = parser.parse_args()
    guess = swung("trapezoid", 10)  # single shooting finds another motion from rest
    points = ours(guess) + (peer(asked.python, guess) if asked.python else [])
    rows = [
        [p.way, str(p.nodes), f"{p.cost:.6f}", f"{off(p):+.1e}", f"{p.end:.1e}",
         f"{p.seconds:.2f}"] for p in points
    ]  # fmt: skip
    table = markdown_table(["way", "N", "cost", "off", "end error", "s"], rows)
    (asked.out / "trajectories.md").write_text(table + "\n", encoding="utf-8")
    write_stamp("trajectories", folder=asked.out)
    drawn(points)


if __name__ == "__main__":
    main()
