"""The study: cases one after the other, a table and a figure."""

import csv
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import impactfem
from matplotlib.figure import Figure

from rebound.ball import Case, Rebound, drop

HEAD = (
    "height_m", "damping_s", "restitution", "rebound_m", "max_force_n", "contact_time_s",
)  # fmt: skip


@dataclass(frozen=True)
class Table:
    """What the cases gave, in their order."""

    rows: tuple[Rebound, ...]

    def text(self) -> str:
        """A table for a terminal."""
        lines = ["height [m]  damping [s]  restitution  rebound [m]  max force [N]  contact [ms]"]
        lines += [
            f"{r.case.height:10.3g}  {r.case.damping:11.2g}  {r.restitution:11.4f}  "
            f"{r.height:11.4f}  {r.max_force:13.2f}  {1e3 * r.contact_time:12.3f}"
            for r in self.rows
        ]
        return "\n".join(lines)

    def write_csv(self, path: Path) -> None:
        """Write one line a case."""
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(HEAD)
            for r in self.rows:
                writer.writerow(
                    (r.case.height, r.case.damping, r.restitution, r.height, r.max_force,
                     r.contact_time)
                )  # fmt: skip

    def figure(self) -> Figure:
        """Restitution against height, a line for each damping."""
        figure = Figure(figsize=(6.5, 4.0), layout="constrained")
        axes = figure.add_subplot()
        for damping in dict.fromkeys(row.case.damping for row in self.rows):
            line = [row for row in self.rows if row.case.damping == damping]
            axes.plot(
                [row.case.height for row in line], [row.restitution for row in line], "o-",
                label=f"damping {damping:g} s",
            )  # fmt: skip
        axes.set_xlabel("height of the fall [m]")
        axes.set_ylabel("speed after / speed before")
        axes.set_ylim(0.0, 1.05)
        axes.legend(frameon=False)
        axes.set_title("Rebound of a rubber ball")
        return figure


def grid(heights: Iterable[float], dampings: Iterable[float]) -> list[Case]:
    """All combinations."""
    return [Case(height, damping) for damping, height in product(dampings, heights)]


def run_study(cases: Iterable[Case], say: Callable[[str], None] | None = None) -> Table:
    """Run cases one after the other.

    Args:
        cases: What to run.
        say: Told of each case when it is done.
    """
    rows = []
    for case in cases:
        _, found = drop(case)
        rows.append(found)
        if say is not None:
            say(f"{case.height:g} m, damping {case.damping:g} s: {found.restitution:.4f}")
    return Table(tuple(rows))


def methods_of_a_rod(sizes: list[int]) -> impactfem.studies.Study:
    """Errors and cost of two methods for an elastic rod that falls end on, at several sizes."""
    rod = impactfem.Bar(
        name="rod", length=0.5, density=1200.0, youngs_modulus=1e7, gap=0.01, velocity=-1.0
    )
    scene = impactfem.Scene(
        title="Rubber rod on a floor",
        duration=0.05,
        gravity=9.81,
        bodies=[rod],
        obstacles=[impactfem.Wall(name="floor")],
    )
    return impactfem.studies.work_precision(scene, ["galerkin", "conserving"], sizes)
