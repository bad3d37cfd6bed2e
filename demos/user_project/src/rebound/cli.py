"""The command `rebound`: run the study, save its table and figures."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import impactfem

from rebound.ball import Case, drop
from rebound.study import grid, methods_of_a_rod, run_study


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="rebound", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/rebound"), help="folder")
    parser.add_argument("--heights", type=float, nargs="+", default=[0.05, 0.2, 0.8], metavar="M")
    parser.add_argument("--dampings", type=float, nargs="+", default=[0.0, 5e-5], metavar="S")
    given = parser.parse_args(arguments)
    try:
        study(given.out, grid(given.heights, given.dampings))
    except impactfem.ImpactError as error:  # its message names key, value and remedy
        print(f"rebound: {error}", file=sys.stderr)
        return 2
    return 0


def study(folder: Path, cases: list[Case]) -> None:
    """Run cases; write table, figure, the result of the last case and a study of methods."""
    folder.mkdir(parents=True, exist_ok=True)
    table = run_study(cases, print)
    table.write_csv(folder / "rebound.csv")
    table.figure().savefig(folder / "rebound.png", dpi=130)
    result, _ = drop(cases[-1])
    result.save(folder / "last_case", pictures=False)
    result.plot_history("gap", "contact_force").savefig(folder / "last_case.png", dpi=130)
    methods_of_a_rod([20, 80, 320]).save(folder, "methods")
    print(f"\n{table.text()}\n\nsaved in {folder}")
