"""How many starts a penalised corner misleads, against the stiffness (about two minutes).

    python benchmarks/corner_share.py [--results FOLDER] [--images FOLDER]

Undamped penalty, mass 1, speed v. A contact with a wall lasts pi / sqrt(k); in it the point moves
along the wall by pi v cos(psi) / sqrt(k), psi the angle between its way and the wall. If that
carries it past the vertex, both walls act at once, and the direction it leaves in belongs to no
order of reflections. The way misses the vertex by b = (distance along the wall) sin(psi), and each
reflection towards the vertex shortens b by s = pi v sin(psi) cos(psi) / sqrt(k). So a way at the
angle phi from the wall met first is misled if

    b < (pi v / (2 sqrt(k))) sum of sin(2 (phi + i theta)) over i >= 0, phi + i theta < pi / 2.

The mean over phi in (0, theta) is pi v / (2 theta sqrt(k)) on each side of the vertex, whatever
theta: of the starts spread evenly over a sector of radius L and all directions the share

    v / (theta L sqrt(k))

is misled, up to terms of 1 / k; and in a polygon of area A with n corners n v^2 T / (2 A sqrt(k))
of those that move for a time T. Both vanish as k grows: the first conjecture of Paoli and Schatzman
(2000), section 3.1, for polygons.
"""

import math
from itertools import pairwise

import numpy as np
from corner import corner
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from penalty import PenaltySettings, follow
from scipy.optimize import brentq
from stamp import study_arguments, write_stamp

from impactfem.system.generalized import LinearSystem

Floats = NDArray[np.float64]

ANGLES = {"3pi/4": 0.75 * math.pi, "pi/2": 0.5 * math.pi, "2pi/5": 0.4 * math.pi,
          "pi/5": math.pi / 5}  # fmt: skip
STIFFNESSES = (1e2, 1e4, 1e6)
TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.8]])
TIME = 2.0  # that points move in the triangle


def depth(theta: float, phi: float) -> float:
    """Half width, times sqrt(k) / v, of the misled ways that meet a wall first, phi from it."""
    steps = phi + theta * np.arange(math.ceil(math.pi / theta))
    return 0.5 * math.pi * float(np.sin(2.0 * steps[steps < 0.5 * math.pi]).sum())


def sector_share(theta: float, root: float) -> float:
    """Share of the starts in a sector of radius 1 with speed 1, root = sqrt(k)."""
    return 1.0 / (theta * root)


def triangle_share(root: float) -> float:
    """Share of the starts in the triangle with speed 1, after TIME."""
    (ax, ay), (bx, by) = TRIANGLE[1] - TRIANGLE[0], TRIANGLE[2] - TRIANGLE[0]
    return float(3.0 * TIME / (abs(ax * by - ay * bx) * root))


def both_act(system: LinearSystem, u: Floats, v: Floats, end: float, k: float) -> bool:
    """Whether two constraints act at once in the penalised motion, undamped."""
    settings = PenaltySettings(k, end / 10.0, damping=0.0, rtol=1e-8, atol=1e-10)
    _, record = follow(system, u, v, end, settings)
    spells = [(start, stop) for (start, *_), stop in zip(record.episodes, record.ends, strict=True)]
    spells += [(start, end) for start, *_ in record.open.values()]
    spells.sort()
    overlap = 1e-6 / math.sqrt(k)
    return any(b[0] < a[1] - overlap for a, b in pairwise(spells))


def way(phi: float, b: float, ahead: float) -> tuple[Floats, Floats]:
    """Place and velocity, speed 1, of a way at phi from wall 1 that passes the vertex by b.

    Args:
        phi: Angle between the way and wall 1.
        b: How far it misses the vertex; > 0 if wall 1 is met first.
        ahead: Distance of the start from the foot of the vertex on the way.
    """
    turn = -0.5 * math.pi - phi  # the domain lies between -pi/2, wall 1, and -pi/2 - theta
    out = np.array([math.cos(turn), math.sin(turn)])
    return ahead * out + b * np.array([-out[1], out[0]]), -out


def measured_depth(theta: float, phi: float, k: float = 1e4) -> float:
    """As `depth`, found by bisection of penalised motions; phi < pi / 2."""
    root = math.sqrt(k)
    system = corner(theta)

    def misled(b: float) -> float:
        ahead = (2.0 + b / math.tan(phi)) / root  # inside the corner
        u, v = way(phi, b / root, ahead)
        return 1.0 if both_act(system, u, v, ahead + 40.0 / root, k) else -1.0

    return float(brentq(misled, 1e-3, 6.0, xtol=1e-6))


def sampled_share(theta: float, k: float, runs: int, rng: np.random.Generator) -> Floats:
    """Share of starts in the unit sector that are misled, and its standard error.

    Only starts whose ways pass the vertex within a width that no misled one exceeds are drawn,
    evenly in their distance from the vertex; their weights make up for both.
    """
    system, root = corner(theta), math.sqrt(k)
    width = 0.5 * math.pi * math.ceil(0.5 * math.pi / theta) / root
    counts = np.zeros(runs)
    for i in range(runs):
        radius, polar = rng.random(), -0.5 * math.pi - theta * rng.random()
        span = math.asin(width / radius) if radius > width else math.pi
        heading = polar + math.pi + span * rng.uniform(-1.0, 1.0)
        place, v = (np.array([math.cos(x), math.sin(x)]) for x in (polar, heading))
        found = both_act(system, radius * place, v, radius + 40.0 / root, k)
        counts[i] = 2.0 * radius * span / math.pi * found
    return np.array([counts.mean(), counts.std() / math.sqrt(runs)])


def sampled_triangle(k: float, runs: int, rng: np.random.Generator) -> Floats:
    """Share of starts in the triangle that are misled within TIME, and its standard error."""
    sides = np.roll(TRIANGLE, -1, axis=0) - TRIANGLE
    normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    offsets = -np.sum(normals * TRIANGLE, axis=1)
    walls = LinearSystem(mass=[1.0, 1.0], normals=normals, offsets=offsets, restitution=1.0)
    found = 0
    for _ in range(runs):
        place = rng.dirichlet(np.ones(3)) @ TRIANGLE
        turn = rng.uniform(0.0, 2.0 * math.pi)
        found += both_act(walls, place, np.array([math.cos(turn), math.sin(turn)]), TIME, k)
    share = found / runs
    return np.array([share, math.sqrt(share * (1.0 - share) / runs)])


def main() -> None:
    """Measure widths and shares, write the tables and the picture."""
    parser = study_arguments(__doc__)
    parser.add_argument("--runs", type=int, default=1000)
    arguments = parser.parse_args()
    rng = np.random.default_rng(1)
    widths = {name: measured_widths(theta) for name, theta in ANGLES.items()}
    rows = []
    for k in STIFFNESSES:
        root = math.sqrt(k)
        for name in ("2pi/5", "3pi/4"):
            found = sampled_share(ANGLES[name], k, arguments.runs, rng)
            rows.append((name, k, sector_share(ANGLES[name], root), *found))
            print(*rows[-1], flush=True)
        if k > 1e2:  # there a contact lasts a sixth of the time
            found = sampled_triangle(k, arguments.runs, rng)
            rows.append(("triangle, T = 2", k, triangle_share(root), *found))
            print(*rows[-1], flush=True)
    lines = ["Half width of the misled ways times sqrt(k) / v, sum against bisected motions:", "",
             "| corner | ways | largest difference |",
             "| --- | --- | --- |"]  # fmt: skip
    for name, line in widths.items():
        off = max(abs(found - formula) for _, formula, found in line)
        lines.append(f"| {name} | {len(line)} | {off:.1e} |")
    lines += ["", f"Share of misled starts, {arguments.runs} penalised motions each:", "",
              "| domain | k | derived | measured |", "| --- | --- | --- | --- |"]  # fmt: skip
    lines += [f"| {n} | {k:.0e} | {d:.2e} | {m:.2e} ± {s:.0e} |" for n, k, d, m, s in rows]
    (arguments.results / "corner_share.md").write_text("\n".join(lines) + "\n")
    write_stamp("corner_share", folder=arguments.results)
    draw(widths, rows).savefig(arguments.images / "corner_share.png", dpi=130)


def measured_widths(theta: float) -> list[tuple[float, float, float]]:
    """Rows (phi, derived half width, measured one)."""
    reach = min(theta, 0.5 * math.pi)
    ways = reach * np.array([0.06, 0.2, 0.35, 0.5, 0.65, 0.8, 0.94])
    return [(phi, depth(theta, phi), measured_depth(theta, phi)) for phi in map(float, ways)]


def draw(
    widths: dict[str, list[tuple[float, float, float]]],
    rows: list[tuple[str, float, float, float, float]],
) -> Figure:
    """Half widths against the way in, and shares against the stiffness."""
    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    colours = ("#d95f02", "k", "#0b559f", "#1b7837")
    for (name, line), colour in zip(widths.items(), colours, strict=True):
        theta = ANGLES[name]
        phis = np.linspace(1e-3, theta - 1e-3, 400)
        label = name.replace("pi", "π")
        curve = [depth(theta, phi) for phi in phis]
        left.plot(phis / theta, curve, color=colour, lw=1.2, label=label)
        dots = np.array(line)
        left.plot(dots[:, 0] / theta, dots[:, 2], "o", color=colour, ms=4.5, mfc="none")
    left.set(xlabel="φ / corner, of the wall met first", ylabel="half width × √k / v")
    left.legend(frameon=False, title="corner")
    stiffness = np.geomspace(50.0, 2e6, 50)
    names = {"2pi/5": "#0b559f", "3pi/4": "#d95f02", "triangle, T = 2": "#7570b3"}
    for name, colour in names.items():
        share = triangle_share if name.startswith("tri") else None
        curve = [
            share(math.sqrt(k)) if share else sector_share(ANGLES[name], math.sqrt(k))
            for k in stiffness
        ]
        right.loglog(stiffness, curve, color=colour, lw=1.2, label=name.replace("pi", "π"))
        dots = np.array([row[1:] for row in rows if row[0] == name])
        right.errorbar(dots[:, 0], dots[:, 2], 2.0 * dots[:, 3], fmt="o", color=colour, mfc="none")
    right.set(xlabel="k [1/s²]", ylabel="share of misled starts")
    right.legend(frameon=False)
    for axes in (left, right):
        axes.grid(alpha=0.25)
    return figure


if __name__ == "__main__":
    main()
