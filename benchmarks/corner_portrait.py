"""Figure 3 of Paoli and Schatzman (2000): the over-damped penalty beside a vertex, in the plane.

    python benchmarks/corner_portrait.py [--results FOLDER] [--images FOLDER]

A point that slides past the end of wall 1 of `corner` is held by the vertex alone: with r the
distance, u'' = -k u - 2 alpha sqrt(k) (r'/r) u. The paper's scaling, r = eta R / sqrt(k), tau =
(t - t0) sqrt(k), eta = exp(xi1 t0 sqrt(k) / 2), gives equations (18) and (19),

    R'' - G^2 / R^3 + 2 alpha R' + R = 0,   Theta' = G / R^2,   G = E (1 - epsilon),

with E = v1 v2 / (xi1 - xi2) and epsilon = exp((xi2 - xi1) t0 sqrt(k)). (The print has
E (1 - epsilon)^2 over R^3; the radial force of a motion with R^2 Theta' = G is G^2 / R^3.)
"""

import math
from dataclasses import dataclass

import numpy as np
from corner import THROWN, corner
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray
from penalty import PenaltySettings, integrate_penalty
from scipy.integrate import solve_ivp
from stamp import study_arguments, write_stamp

Floats = NDArray[np.float64]

ALPHA = 1.5
SLIDES = (1.0, 3.0, 5.0, 7.0)  # t0 sqrt(k): how long the point was on wall 1


@dataclass(frozen=True)
class Entry:
    """State in which a point leaves wall 1 for the vertex, in scaled variables.

    Attributes:
        radius: R > 0.
        speed: R'.
        spin: G = R^2 Theta'.
        eta: The scale of positions and velocities.
    """

    radius: float
    speed: float
    spin: float
    eta: float

    @property
    def rest(self) -> float:
        """Rc = sqrt(G), where R rests while Theta goes on turning."""
        return math.sqrt(self.spin)


def roots(alpha: float) -> tuple[float, float]:
    """xi1 > xi2 of xi^2 + 2 alpha xi + 1 = 0, alpha > 1."""
    spread = math.sqrt(alpha * alpha - 1.0)
    return -alpha + spread, -alpha - spread


def entry(alpha: float, v: ArrayLike, slide: float) -> Entry:
    """The state after ``slide`` = t0 sqrt(k) on wall 1, met with the velocity v > 0."""
    (xi1, xi2), (v1, v2) = roots(alpha), np.asarray(v, dtype=float)
    eta = math.exp(0.5 * xi1 * slide)
    depth = v1 * (math.exp(xi1 * slide) - math.exp(xi2 * slide)) / (xi1 - xi2)
    rate = v1 * (xi1 * math.exp(xi1 * slide) - xi2 * math.exp(xi2 * slide)) / (xi1 - xi2)
    return Entry(float(depth / eta), float(rate / eta), float(depth * v2) / eta**2, eta)


def radial(alpha: float, start: Entry, times: ArrayLike) -> Floats:
    """R, R' and Theta at times tau, shape (3, times), by equations (18) and (19)."""
    g = start.spin
    found = solve_ivp(
        lambda _, y: [y[1], g * g / y[0] ** 3 - 2.0 * alpha * y[1] - y[0], g / y[0] ** 2],
        (0.0, float(np.max(times))), [start.radius, start.speed, 0.0], method="DOP853",
        t_eval=np.asarray(times, dtype=float), rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    states: Floats = found.y
    return states


def penalised(theta: float, alpha: float, v: ArrayLike, slide: float, rows: ArrayLike) -> Floats:
    """R, R' and Theta, shape (3, rows), of the penalised point in the plane, by `penalty`.

    Args:
        theta: Angle of the corner; the vertex acts alone while Theta < pi - theta.
        alpha: Damping.
        v: Velocity at the first contact, both components > 0.
        slide: t0 sqrt(k).
        rows: How many equal steps of tau to take, and how far: (count, end).
    """
    count, end = np.asarray(rows, dtype=float)
    k, start = 1e6, entry(alpha, v, slide)
    root, v2 = math.sqrt(k), np.asarray(v, dtype=float)[1]
    # Output begins with the slide: a grid that has both its end and the rows asked for.
    step = end / count
    ahead = math.ceil(slide / step)
    settings = PenaltySettings(k, step / root, damping=alpha, rtol=1e-11, atol=1e-13)
    place = [-(ahead * step - slide) * np.asarray(v)[0] / root, -ahead * step * v2 / root]
    motion = integrate_penalty(corner(theta), place, v, (ahead * step + end) / root, settings)
    u, w = motion.position[ahead:] * root / start.eta, motion.velocity[ahead:] / start.eta
    r = np.hypot(*u.T)
    return np.array([r, np.sum(u * w, axis=1) / r, np.unwrap(np.arctan2(u[:, 1], u[:, 0]))])


def first_asymptotic(start: Entry, times: Floats) -> Floats:
    """R of (20), R'' = G^2 / R^3: a straight line at constant speed, seen from the vertex."""
    across = start.speed**2 + (start.spin / start.radius) ** 2
    line: Floats = np.sqrt(
        start.radius**2 + 2.0 * start.radius * start.speed * times + across * times**2
    )
    return line


def second_asymptotic(alpha: float, state: ArrayLike, times: Floats) -> Floats:
    """R of R'' + 2 alpha R' + R = 0 from a state (R, R')."""
    (xi1, xi2), (r, s) = roots(alpha), np.asarray(state, dtype=float)
    slow, fast = (s - xi2 * r) / (xi1 - xi2), (xi1 * r - s) / (xi1 - xi2)
    linear: Floats = slow * np.exp(xi1 * times) + fast * np.exp(xi2 * times)
    return linear


def facts(alpha: float, slide: float) -> list[float]:
    """eta; share by which each asymptotic is off in its region; top of R; turn there; turn at Rc.

    The first is compared at tau = eta, the second from there to the top of R.
    """
    start = entry(alpha, THROWN, slide)
    times = np.linspace(0.0, 40.0, 400_001)
    r, speed, turn = radial(alpha, start, times)
    line = int(np.searchsorted(times, start.eta))
    top = int(np.argmax(r))
    one = abs(first_asymptotic(start, times[line : line + 1])[0] / r[line] - 1.0)
    two = second_asymptotic(alpha, (r[line], speed[line]), times[line : top + 1] - times[line])
    back = top + int(np.argmax(r[top:] < 1.01 * start.rest))
    worst = float(np.abs(two / r[line : top + 1] - 1.0).max())
    return [start.eta, one, worst, r[top] / start.rest, turn[line], turn[top], turn[back]]


def main() -> None:
    """Write the table and the picture."""
    arguments = study_arguments(__doc__).parse_args()
    lines = [
        "alpha = 1.5, v = (0.6, 0.8):", "",
        "| t0 sqrt(k) | η | (20) off by | A2 off by | top R / Rc | turn [°], τ = η | top | back |",
        "| --- |" + " --- |" * 7,
    ]  # fmt: skip
    for slide in (*SLIDES, 12.0, 18.0, 24.0):
        eta, one, two, top, *turns = facts(ALPHA, slide)
        cells = " | ".join(f"{math.degrees(x):.1f}" for x in turns)
        lines.append(f"| {slide:g} | {eta:.3g} | {one:.1e} | {two:.1e} | {top:.3g} | {cells} |")
    (arguments.results / "corner_portrait.md").write_text("\n".join(lines) + "\n")
    write_stamp("corner_portrait", folder=arguments.results)
    print("\n".join(lines))
    draw().savefig(arguments.images / "corner_portrait.png", dpi=110)


def draw() -> Figure:
    """The portrait for alpha = 1.5, Rc = 1, with penalised points of a thin corner upon it."""
    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    r, s = np.meshgrid(np.linspace(0.12, 2.2, 60), np.linspace(-1.1, 4.0, 60))
    flow = (s, 1.0 / r**3 - 2.0 * ALPHA * s - r)
    axes.streamplot(r, s, *flow, color="0.82", linewidth=0.6, arrowsize=0.6, density=1.4)
    times = np.concatenate([np.geomspace(1e-4, 1.0, 800) - 1e-4, np.linspace(1.0, 25.0, 2000)[1:]])
    colours = ("#0b559f", "#1b7837", "#7570b3", "#d95f02")
    for slide, colour in zip(SLIDES, colours, strict=True):
        start = entry(ALPHA, THROWN, slide)
        rest = start.rest
        path = radial(ALPHA, start, times) / rest
        axes.plot(path[0], path[1], color=colour, lw=1.6, label=f"η = {start.eta:.2f}")
        held = penalised(0.02, ALPHA, THROWN, slide, (400, 4.0))
        inside = held[2] < math.pi - 0.02
        axes.plot(*held[:2, inside][:, ::4] / rest, "o", color=colour, ms=3.5, mfc="none")
        line = np.linspace(0.0, 1.5 * start.eta, 60)
        axes.plot(
            first_asymptotic(start, line) / rest,
            np.gradient(first_asymptotic(start, line), line) / rest, "--", color=colour, lw=0.9,
        )  # fmt: skip
    axes.plot([], [], "o", color="0.3", mfc="none", ms=3.5, label="penalised point, k = 1e6")
    axes.plot([], [], "--", color="0.3", lw=0.9, label="first asymptotic, (20)")
    axes.plot(1.0, 0.0, "k*", ms=11, label="(Rc, 0), at rest")
    axes.set(xlim=(0.0, 2.2), ylim=(-1.1, 4.0), xlabel="R / Rc", ylabel="R' / Rc")
    axes.legend(frameon=True, framealpha=0.9, loc="upper right")
    return figure


if __name__ == "__main__":
    main()
