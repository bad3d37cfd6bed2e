"""The standing studies: our methods against two baselines on five problems (some minutes).

    python benchmarks/standing.py [--out FOLDER] [--images FOLDER] [--only NAME] [--repeats 5]

Writes NAME.csv and NAME.md for each study and comparison.md to benchmarks/results, study_NAME.png
to docs/images.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from baselines import BASELINES
from stamp import write_stamp

import impactfem
from impactfem.shipped import find_scene
from impactfem.studies.study import Study, markdown_table

OURS = ("galerkin", "conserving", "conserving@courant=0.5", "conserving@courant=2")
ERRORS = {"displacement_l2": "displacement L2", "force_l1": "force L1", "drift": "energy drift"}
PEERS = (*BASELINES, "monolithic")


@dataclass(frozen=True)
class Problem:
    """A standing study as data; sizes per kind of method, {} leaves a kind out."""

    scene: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    sizes: Sequence[int] = (10, 20, 40, 80, 160, 320, 640)
    baseline_sizes: Sequence[int] = (10, 20, 40, 80, 160, 320, 640)
    monolithic: Sequence[int] = (10, 20, 40, 80)
    fitted: Sequence[int] = (4, 8)
    exact: Sequence[int] = (2, 10)


PROBLEMS = {
    # A gap that is no fraction of the length: impact and release fall on no layer.
    "k1_off_grid": Problem("bar_impact", {"body.bar.gap": 0.5 + 2**0.5 / 100}),
    "prestretched_rod": Problem("prestretched_rod", monolithic=(10, 20, 40)),
    "doyen_bounces": Problem("doyen_bounces", monolithic=(10, 20)),
    "irregular_bounces": Problem("irregular_bounces", monolithic=(10, 20), fitted=(8,)),
    "doyen_750_bounces": Problem(
        "doyen_bounces", {"duration": 2000.0}, (10, 20, 40), (10, 20), (), (), (2,)
    ),
}


def run(problem: Problem, repeats: int) -> Study:
    """All methods and baselines on one problem."""
    scene = impactfem.Scene.from_toml(find_scene(problem.scene)).with_settings(
        dict(problem.settings)
    )
    study = impactfem.studies.work_precision(scene, OURS, problem.sizes, repeats, progress=print)
    for method, sizes, times in (
        ("exact", problem.exact, repeats),
        ("dg@degree=1,fitted=true", problem.fitted, 1),
        ("dg@degree=1,fitted=false", problem.fitted and (8, 16, 32), 1),
        ("monolithic", problem.monolithic, 1),
    ):
        if sizes:
            study = study.joined(
                impactfem.studies.work_precision(scene, [method], sizes, times, progress=print)
            )
    return study.joined(
        impactfem.studies.work_precision(
            scene, [], problem.baseline_sizes, min(repeats, 3), baselines=BASELINES, progress=print
        )
    )


def comparison(studies: Mapping[str, Study]) -> str:
    """For each peer and error: by how much the best of ours is faster at no larger error."""
    rows = []
    for name, study in studies.items():
        ours = [m for m in study.methods if m not in PEERS]
        for peer in (p for p in PEERS if p in study.methods):
            for error, label in ERRORS.items():
                found = study.compare(ours, peer, error)
                ratios = [c.speedup for c in found if c.speedup is not None]
                if not found:
                    text = "never within 50 %"
                elif len(ratios) < len(found):
                    text = f"{len(found) - len(ratios)} of {len(found)} errors NOT reached by ours"
                else:
                    text = f"{min(ratios):.1f} to {max(ratios):.0f} times faster"
                reached = min((getattr(c.theirs, error) for c in found), default=None)
                rows.append([
                    name, peer, label, "-" if reached is None else f"{reached:.1e}", text
                ])  # fmt: skip
    head = ["study", "held against", "error", "least error reached", "best of ours at equal error"]
    return markdown_table(head, rows)


def main() -> None:
    """Run the studies and write their results."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument(
        "--images", type=Path, default=Path(__file__).parent.parent / "docs" / "images"
    )
    parser.add_argument("--only", choices=PROBLEMS, action="append")
    parser.add_argument("--repeats", type=int, default=5)
    given = parser.parse_args()
    studies = {}
    for name in given.only or PROBLEMS:
        print(f"{name}:", flush=True)
        studies[name] = run(PROBLEMS[name], given.repeats)
        picture = studies[name].save(given.out, name)[-1]
        write_stamp(name, folder=given.out)
        given.images.mkdir(parents=True, exist_ok=True)
        picture.replace(given.images / f"study_{name}.png")
    text = f"{comparison(studies)}\n"
    print(text)
    if not given.only:
        (given.out / "comparison.md").write_text(text, encoding="utf-8")
        write_stamp("comparison", folder=given.out)


if __name__ == "__main__":
    main()
