"""Compare the variational inequality with the primal-dual solution (a minute).

    python docs/scripts/variational_inequality.py [PAGE]

Writes into docs/benchmarks.md, between its two marks: iterations, errors and energy on K1, K2 and
K3, and what the inequality leaves open when its test functions are paired as they are printed.
"""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

import impactfem
from impactfem.exact.fourier import GravityImpact
from impactfem.shipped import shipped_scenes

DOCS = Path(__file__).resolve().parent.parent
SIZES = (10, 20, 40, 80)
BEGIN, END = "<!-- variational inequality: begin -->", "<!-- variational inequality: end -->"


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def cases() -> Iterator[tuple[str, impactfem.Scene, float]]:
    """Name, scene, and |lambda| times|lambda| times the end's speed at release, over c."""
    scenes = {name: impactfem.Scene.from_toml(path) for name, path in shipped_scenes().items()}
    yield "K1", scenes["bar_impact"], 0.5 * 0.5
    for suffix, gap in (("", 0.5), (", tau = 1 s", 0.55)):
        formula = GravityImpact(1.0, 1.0, gap, 0.5, 0.1)
        tau, speed = formula.impact_time, formula.impact_speed
        k2 = scenes["gravity_impact"].with_settings({"body.bar.gap": gap})
        yield f"K2{suffix}", k2, (speed + 0.2) * (speed - 0.2)
        yield f"K3{suffix}", k2.with_settings({"gravity": [[0.0, 0.1], [tau, 0.0]]}), speed**2


def compare() -> str:
    """Both solvers on the same equations."""
    rows = []
    for name, scene, product in cases():
        for n in SIZES:
            runs = [
                impactfem.solve(scene, method="monolithic", elements=n, active_set=solver)
                for solver in ("pdas", "snes_vi")
            ]
            energies = [float(run.history["total_energy"][-1]) for run in runs]
            iterations = [run.summary["active_set"]["iterations"] for run in runs]
            errors = [run.summary["error"] for run in runs]
            rows.append([
                name, n, *iterations,
                *(f"{error['displacement_max']:.1e}" for error in errors),
                *(f"{error['force_l1']:.1e}" for error in errors),
                f"{energies[0] - energies[1]:.3e}", f"{product / (4 * n):.3e}",
            ])  # fmt: skip
    head = ["case", "n", "iterations: PDAS", "VI", "displacement error: PDAS", "VI"]
    head += ["force error: PDAS", "VI", "energy lost by the VI [J]", "h λ w / 4c [J]"]
    return table(head, rows)


def literal(n: int, share: float) -> tuple[float, float, float]:
    """K1 by leapfrog, r_m paired with u_m: the residual of the last contact node is free.

    Where u_m = 0 any r_m >= 0 with u_{m+1} >= 0 satisfies the inequality. While the bar pushes,
    u_{m+1} > 0 would put u_{m+2} below the wall; at the last node nothing forbids it.

    Args:
        n: Elements.
        share: Residual of the last node over that of the node before, h |and |lambda| times|.

    Returns:
        Energy after release over that before, displacement error [m], smallest u at the wall [m].
    """
    h, rounding = 1.0 / n, 1e-12
    old, u = np.full(n + 1, 0.5), np.full(n + 1, 0.5 - 0.5 * h)
    x = np.linspace(0.0, 1.0, n + 1)
    error, touching = 0.0, False
    gaps = []
    for m in range(1, 5 * n):
        new = np.empty_like(u)
        new[1:-1] = u[2:] + u[:-2] - old[1:-1]
        new[0], new[-1] = 2 * u[1] - old[0], 2 * u[-2] - old[-1]
        if u[0] <= rounding:
            pushes = new[0] < -rounding
            if pushes:
                new[0] = 0.0
            elif touching:
                new[0] += 2.0 * share * h * 0.5
            touching = pushes
        old, u = u, new
        gaps.append(u[0])
        t = (m + 1) * h
        exact = np.maximum(np.maximum(0.5 - 0.5 * t, -0.5 * x), 0.5 * (t - 3.0))
        error = max(error, float(np.abs(u - exact).max()))
    v = (u - old) / h
    mass = np.full(n + 1, h)
    mass[[0, -1]] = h / 2
    energy = 0.5 * mass @ v**2 + 0.5 * np.diff(u) @ np.diff(old) / h
    return float(energy / 0.125), error, float(min(gaps))


def main() -> None:
    """Measure and write."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "benchmarks.md"
    rows = []
    for n in (10, 40):
        for share in (0.0, 0.5, 1.0):
            energy, error, gap = literal(n, share)
            rows.append([n, f"{share:g} h λ₀", f"{energy:.4f}", f"{error:.1e}", f"{gap:.0e}"])
    head = ["n", "r at the last node of contact", "energy after / before"]
    head += ["displacement error [m]", "smallest u at the wall [m]"]
    text = f"{compare()}\n\nPaired as printed, r_m with u_m (K1):\n\n{table(head, rows)}"
    before, mark, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    if not mark:
        sys.exit(f"{path}: no line {BEGIN}")
    path.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
