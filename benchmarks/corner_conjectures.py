"""Three conjectures of Paoli and Schatzman (2000), section 3.2, run (about five minutes).

    python benchmarks/corner_conjectures.py [--results FOLDER] [--images FOLDER]

Over-damped penalty, alpha = 1.5, first impact beside the corner. The paper proves for a free point
between two straight walls that its limit is Moreau's rule: the velocity after an impact is the
projection of the one before on the tangent cone. It conjectures the same with a right-hand side,
with smooth curves instead of walls, and in higher dimension. Penalised motions are compared with
Moreau's rule as `event_driven` follows it (e = 0), for a few starts of each kind. In space impacts
are kept apart by 0.2 s: what is left of one dies out as exp(-0.38 sqrt(k) t), and a point that
meets the vertex before is one that starts beside it, of which the paper says nothing.
"""

import math
from dataclasses import dataclass

import numpy as np
from corner import corner
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from penalty import PenaltySettings, integrate_penalty
from stamp import study_arguments, write_stamp

from impactfem.scene.signal import Signal
from impactfem.system.generalized import GeneralizedSystem, LinearSystem
from impactfem.vibro.event_driven import EventSettings, integrate_events

Floats = NDArray[np.float64]

ALPHA = 1.5
STIFFNESSES = (1e3, 1e4, 1e5, 1e6)
# Added to forces of springs, dampers and a gyroscope.
_LOADS = {
    "pressed on wall 1": [Signal(0.4, harmonics=((2.0, 0.3, 0.0),)), Signal(0.2)],
    "pulled away in the end": [Signal(0.5, slope=-1.0), Signal(0.3, slope=-1.0)],
}


@dataclass(frozen=True)
class Case:
    """A corner and how points are thrown into it.

    Attributes:
        name: What it is.
        kind: The conjecture: "force", "curved", "3D", or "proved" for the control.
        system: Constraints with e = 0, and forces.
        starts: Places and velocities, shape (starts, 2, d).
        end: Time to which motions are compared [s].
    """

    name: str
    kind: str
    system: GeneralizedSystem
    starts: Floats
    end: float


def measure(case: Case, k: float) -> list[float]:
    """Largest difference of places over the motion, and of velocities at its end."""
    place = speed = 0.0
    rows = 200
    settings = PenaltySettings(k, case.end / rows, damping=ALPHA, rtol=1e-8, atol=1e-10)
    for u, v in case.starts:
        rule = integrate_events(case.system, u, v, case.end, EventSettings(rows=rows))
        found = integrate_penalty(case.system, u, v, case.end, settings)
        at = np.searchsorted(rule.times, found.times - 1e-12 * case.end)
        place = max(place, float(np.abs(found.position - rule.position[at]).max()))
        speed = max(speed, float(np.abs(found.velocity[-1] - rule.velocity[-1]).max()))
    return [place, speed]


def cases() -> list[Case]:
    """All corners; starts beside them from a seed."""
    rng = np.random.default_rng(15)
    return [*_straight(rng), *_curved(rng), *_spatial(rng)]


def _straight(rng: np.random.Generator) -> list[Case]:
    made = []
    for name, theta in (("pi/3", math.pi / 3), ("2pi/3", 2 * math.pi / 3)):
        # On wall 1 beside the vertex, as in the paper, or just before it.
        starts = np.array([
            [[-rng.uniform(0.0, 0.1), -rng.uniform(0.3, 0.5)], rng.uniform(0.5, 1.0, 2)]
            for _ in range(4)
        ])  # fmt: skip
        walls = corner(theta)
        free = LinearSystem(mass=[1.0, 1.0], normals=walls.normals, offsets=[0.0, 0.0])
        made.append(Case(f"{name}, no force", "proved", free, starts, 2.0))
        for force, load in _LOADS.items():
            loaded = LinearSystem(
                mass=[1.0, 1.0], normals=walls.normals, offsets=[0.0, 0.0], load=load,
                damping=[[0.2, -0.1], [0.1, 0.2]], stiffness=[[0.1, 0.0], [0.0, 0.3]],
            )  # fmt: skip
            made.append(Case(f"{name}, {force}", "force", loaded, starts, 2.0))
    return made


def _curved(rng: np.random.Generator) -> list[Case]:
    made = []
    for name, height in (("hollow circle and wall, pi/3", 0.5), ("the same, 2pi/3", -0.5)):
        hollow = GeneralizedSystem(
            mass=[1.0, 1.0], force=lambda *_: np.zeros(2), restitution=0.0,
            constraints=lambda u, h=height: np.array([1.0 - (u @ u) ** 0.5, u[1] - h]),
        )  # fmt: skip
        starts = []
        for _ in range(4):
            turn = math.asin(height) + rng.uniform(0.4, 0.8)
            out = np.array([math.cos(turn), math.sin(turn)])
            down = np.array([out[1], -out[0]])
            starts.append([rng.uniform(0.9, 1.0) * out, rng.uniform(0.2, 0.6) * out + 0.9 * down])
        made.append(Case(name, "curved", hollow, np.array(starts), 2.0))
    for name, slope in (("hill and wall, pi/3", 0.5 * math.pi), ("hill and floor, 5pi/6", 0.0)):
        foot = np.array([0.5, math.sqrt(0.75) - 1.0])
        normal = np.array([-math.sin(slope), math.cos(slope)])
        hill = GeneralizedSystem(
            mass=[1.0, 1.0], force=lambda *_: np.array([0.0, -3.0]), restitution=0.0,
            constraints=lambda u, n=normal, f=foot: np.array([
                (u[0] ** 2 + (u[1] + 1.0) ** 2) ** 0.5 - 1.0, n @ (u - f)
            ]),
        )  # fmt: skip
        starts = np.array([
            [[rng.uniform(-0.1, 0.0), rng.uniform(0.05, 0.1)],
             [rng.uniform(0.3, 0.6), -rng.uniform(0.2, 0.6)]] for _ in range(3)
        ])  # fmt: skip
        made.append(Case(name, "curved", hill, starts, 1.5))
    return made


def _spatial(rng: np.random.Generator) -> list[Case]:
    made = []
    for name, lean in (("octant", 0.0), ("acute", -0.2), ("obtuse", 0.4)):
        # Normals that lean to each other or apart: angles between faces beyond pi/2 or below.
        normals = np.eye(3) + lean * (1.0 - np.eye(3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        cone = LinearSystem(mass=[1.0] * 3, normals=normals, offsets=[0.0] * 3)
        rays = np.linalg.inv(normals)  # columns: edges, each on two faces
        starts: list[list[Floats]] = []
        while len(starts) < 4:
            place = rays @ np.array([0.05, *rng.uniform(0.2, 0.8, 2)])
            v = rays @ np.array([-0.5, *rng.uniform(-1.0, -0.2, 2)])
            rule = integrate_events(cone, place, v, 2.5, EventSettings(rows=5))
            if rule.impacts is None:
                continue
            times = np.unique(np.round(rule.impacts.time, 6))
            if len(times) >= 3 and np.diff(times).min() > 0.2 and times[-1] < 2.2:
                starts.append([place, v])
        made.append(Case(f"3D, {name}", "3D", cone, np.array(starts), 2.5))
    return made


def main() -> None:
    """Run all and write the table and the picture."""
    arguments = study_arguments(__doc__).parse_args()
    every, found = cases(), {}
    for case in every:
        found[case.name] = np.array([measure(case, k) for k in STIFFNESSES])
        print(case.name, found[case.name].tolist(), flush=True)
    lines = ["Largest distance from Moreau's rule of all starts, alpha = 1.5: velocities [m/s]",
             "at the end for each k, and places over the motion [m] at the last:", "",
             "| corner | " + " | ".join(f"k = {k:.0e}" for k in STIFFNESSES) + " | place |",
             "| --- |" + " --- |" * (len(STIFFNESSES) + 1)]  # fmt: skip
    for name, rows in found.items():
        cells = " | ".join(f"{x:.1e}" for x in (*rows[:, 1], rows[-1, 0]))
        lines.append(f"| {name} | {cells} |")
    (arguments.results / "corner_conjectures.md").write_text("\n".join(lines) + "\n")
    write_stamp("corner_conjectures", folder=arguments.results)
    draw(every, found).savefig(arguments.images / "corner_conjectures.png", dpi=110)


def draw(every: list[Case], found: dict[str, Floats]) -> Figure:
    """Distance of the last velocities from Moreau's rule against k, a panel a conjecture."""
    figure = Figure(figsize=(11.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3, sharey=True)
    titles = {"force": "forces", "curved": "curved sides", "3D": "three dimensions"}
    for axes, (kind, title) in zip(panels, titles.items(), strict=True):
        for case in every:
            if case.kind in {kind, "proved"}:
                style = {"color": "0.7", "ls": ":"} if case.kind == "proved" else {"marker": "o"}
                errors = np.maximum(found[case.name][:, 1], 1e-10)
                label = case.name.replace("pi", "π")
                axes.loglog(STIFFNESSES, errors, label=label, ms=4, mfc="none", **style)
        axes.set(title=title, xlabel="k [1/s²]")
        axes.legend(frameon=False, fontsize=7)
        axes.grid(alpha=0.25)
    panels[0].set_ylabel("|v - Moreau's rule| at the end [m/s]")
    return figure


if __name__ == "__main__":
    main()
