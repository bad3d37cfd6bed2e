"""The solver of contact with friction against others, on a hundred problems (three minutes).

    python benchmarks/friction_solvers.py [--results FOLDER]

Beside it: Clarabel's second-order cone (needs `pip install clarabel`) in a fixed point of the term
of De Saxce, mu |slip|; Lemke's method on pyramids of eight sides, for problems of up to 18 pairs;
projected Gauss-Seidel, 1000 sweeps. The residual is that of `friction_problems.residual`. That of
pyramids is the error of the pyramid.
"""

import argparse
import csv
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from friction_problems import FAMILIES, problems, residual
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, triu
from stamp import write_stamp

from impactfem.contact.friction_newton import ConeProblem
from impactfem.contact.friction_solver import _swept, solve_cones
from impactfem.errors import ConvergenceError

Floats = NDArray[np.float64]
_SIDES = 8
_PAIRS_OF_LEMKE = 18


def ours(problem: ConeProblem) -> Floats | None:
    """That of the package, from rest."""
    try:
        return solve_cones(problem, np.zeros_like(problem.offset), 1e-16, 4000)[0]
    except ConvergenceError:
        return None


def sweeps(problem: ConeProblem) -> Floats | None:
    """Projected Gauss-Seidel."""
    return _swept(problem, np.zeros_like(problem.offset), 1000, 0.0)


def clarabel(problem: ConeProblem) -> Floats | None:
    """Convex problems with the slip of the one before, until the residual no longer falls."""
    import clarabel as solver  # noqa: PLC0415  (not everybody has it)

    pairs, dim = problem.offset.shape
    size = float(np.abs(problem.matrix).max())
    upper = triu(csc_matrix(problem.matrix / size), format="csc")
    cones = -np.eye(pairs * dim)
    cones[np.arange(pairs) * dim, np.arange(pairs) * dim] = -problem.friction
    settings = solver.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-13
    scale = float(np.abs(problem.offset).max())
    extra, best, least, worse = np.zeros(pairs), None, math.inf, 0
    kinds = [solver.SecondOrderConeT(dim) for _ in range(pairs)]
    for _ in range(60):
        offset = problem.offset / scale
        offset[:, 0] += extra
        found = solver.DefaultSolver(
            upper, offset.ravel(), csc_matrix(cones), np.zeros(pairs * dim), kinds, settings
        ).solve()
        force = np.array(found.x).reshape(pairs, dim) * scale / size
        if not np.isfinite(force).all():
            break
        error = residual(problem, force)
        if error < least:
            best, least, worse = force, error, 0
        worse += error > 0.9 * least
        if worse > 10:
            break
        slip = problem.answers(force)[:, 1:] / scale
        extra = problem.friction * np.linalg.norm(slip, axis=1)
    return best


def lemke(problem: ConeProblem) -> Floats | None:
    """Stewart's and Trinkle's complementarity problem of pyramids."""
    pairs, dim = problem.offset.shape
    if pairs > _PAIRS_OF_LEMKE:
        return None
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    spread = np.zeros((pairs * dim, pairs * (1 + _SIDES)))
    for j in range(pairs):
        spread[j * dim, j] = 1.0
        own = slice(pairs + j * _SIDES, pairs + (j + 1) * _SIDES)
        spread[j * dim + 1, own], spread[j * dim + 2, own] = np.cos(angles), np.sin(angles)
    count = pairs * (1 + _SIDES)
    matrix = np.zeros((count + pairs, count + pairs))
    size = float(np.abs(problem.matrix).max())
    matrix[:count, :count] = spread.T @ problem.matrix @ spread / size
    for j in range(pairs):
        own = slice(pairs + j * _SIDES, pairs + (j + 1) * _SIDES)
        matrix[own, count + j] = 1.0
        matrix[count + j, own] = -1.0
        matrix[count + j, j] = problem.friction[j]
    scale = float(np.abs(problem.offset).max())
    offset = np.concatenate([spread.T @ problem.offset.ravel() / scale, np.zeros(pairs)])
    found = _pivoted(matrix, offset)
    if found is None:
        return None
    return (spread @ found[:count]).reshape(pairs, dim) * scale / size


def _pivoted(matrix: Floats, offset: Floats) -> Floats | None:
    """Lemke's method for 0 <= z _|_ M z + q >= 0 with a covering vector that breaks ties."""
    n = len(offset)
    if (offset >= 0).all():
        return np.zeros(n)
    cover = 1.0 + 1e-6 * np.random.default_rng(0).random(n)
    table = np.hstack([np.eye(n), -matrix, -cover[:, None], offset[:, None]])
    basis = np.arange(n)
    row, entering = int(np.argmin(offset / cover)), 2 * n
    for _ in range(50 * n):
        table[row] /= table[row, entering]
        others = np.arange(n) != row
        table[others] -= table[others, entering][:, None] * table[row]
        leaving, basis[row] = int(basis[row]), entering
        if leaving == 2 * n:
            found = np.zeros(2 * n + 1)
            found[basis] = table[:, -1]
            return found[n : 2 * n]
        entering = leaving + n if leaving < n else leaving - n
        column = table[:, entering]
        able = np.flatnonzero(column > 1e-11)
        if not len(able):
            return None
        ratios = table[able, -1] / column[able]
        near = able[ratios <= ratios.min() + 1e-14]
        row = int(near[np.argmax(basis[near] == 2 * n)])
    return None


SOLVERS: dict[str, Callable[[ConeProblem], Floats | None]] = {
    "impactfem": ours, "clarabel": clarabel, "lemke": lemke, "gauss_seidel": sweeps
}  # fmt: skip


def main() -> None:
    """Solve all problems by all solvers and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=Path(__file__).parent / "results")
    results = parser.parse_args().results
    for solver in SOLVERS.values():
        solver(FAMILIES["rod"](np.random.default_rng(0)))  # compiles
    rows: list[dict[str, object]] = []
    for family, number, problem in problems():
        for name, solver in SOLVERS.items():
            if name == "lemke" and len(problem.offset) > _PAIRS_OF_LEMKE:
                continue
            begin = time.perf_counter()
            force = solver(problem)
            spent = time.perf_counter() - begin
            error = math.inf if force is None else residual(problem, force)
            rows.append(
                {
                    "family": family, "number": number, "pairs": len(problem.offset),
                    "solver": name, "residual": error if math.isfinite(error) else None,
                    "seconds": spent,
                }
            )  # fmt: skip
    heads = ["family", "pairs", *SOLVERS]
    lines = ["| " + " | ".join(heads) + " |", "| --- " * len(heads) + "|"]
    for family in FAMILIES:
        own = [row for row in rows if row["family"] == family]
        pairs = [int(str(row["pairs"])) for row in own]
        cells = []
        for name in SOLVERS:
            each = [row for row in own if row["solver"] == name]
            if not each:
                cells.append("")
                continue
            found = [math.inf if r["residual"] is None else float(str(r["residual"])) for r in each]
            good = sum(error <= 1e-10 for error in found)
            spent = 1e3 * float(np.median([float(str(row["seconds"])) for row in each]))
            middle = float(np.median(found))
            text = f"{middle:.0e}" if math.isfinite(middle) else "none"
            cells.append(f"{good} of {len(each)}, {text}, {spent:.3g} ms")
        lines.append(f"| {family} | {min(pairs)} to {max(pairs)} | " + " | ".join(cells) + " |")
    text = "\n".join(lines) + "\n"
    print(text)
    results.mkdir(parents=True, exist_ok=True)
    (results / "friction_solvers.md").write_text(text, encoding="utf-8")
    with (results / "friction_solvers.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    write_stamp("friction_solvers", folder=results)


if __name__ == "__main__":
    main()
