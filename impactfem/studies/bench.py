"""The sub-command bench: a work-precision study of a scene, hard cases, or textbook schemes."""

import argparse
from collections.abc import Callable
from pathlib import Path

from impactfem.errors import SceneError
from impactfem.scene import Scene
from impactfem.shipped import find_scene
from impactfem.studies.hard.cases import hard_cases
from impactfem.studies.precision import work_precision
from impactfem.studies.schemes import scheme_study
from impactfem.studies.variant import Variant

DEFAULTS = {
    **dict.fromkeys(("bar", "bar_row"), ("galerkin,conserving,exact", "20,40,80")),
    "march": ("massless,conserving,explicit", "8,16"),
    "vibro": ("paoli_schatzman,moreau_jean,event_driven", "1000,4000,16000"),
}
"""Methods and sizes by `Scene.solver`."""


def bench(given: argparse.Namespace, say: Callable[[str], None]) -> bool:
    """Run what the arguments ask for and write it to ``--out`` if that is given.

    Returns:
        Whether everything that must hold does. Negative controls are shown but do not count.

    Raises:
        SceneError: An argument cannot be used.
        OutputError: The folder cannot be written.
    """
    names = None if given.methods is None else Variant.split(given.methods)
    if given.hard:
        return _board(names, given.out, say)
    if given.schemes:
        return _schemes(names, given.out, say)
    if given.scene is None:
        raise SceneError("bench: no scene is given; name one, or use --hard or --schemes")
    scene = Scene.from_toml(find_scene(given.scene))
    methods, sizes = DEFAULTS[scene.solver]
    names = names or Variant.split(methods)
    sizes = given.sizes or sizes
    study = work_precision(scene, names, _sizes(sizes), given.repeats, progress=say)
    say("\n" + study.markdown())
    if given.out is not None:
        say("\n" + "\n".join(str(path) for path in study.save(given.out)))
    return any(row.status != "failed" for row in study.rows)


def _board(names: list[str] | None, out: Path | None, say: Callable[[str], None]) -> bool:
    board = hard_cases(names, progress=say)
    if out is not None:
        say("\n".join(str(path) for path in board.save(out)))
    failures = board.without_controls().failures
    shown = len(board.failures) - len(failures)
    say(
        f"{len(board.cells)} cells, {len(failures)} fail"
        + (f"; {shown} of the negative control fail, as they must" if shown else "")
    )
    return not failures


def _schemes(names: list[str] | None, out: Path | None, say: Callable[[str], None]) -> bool:
    study = scheme_study(names)
    say(study.markdown())
    if out is not None:
        say("\n" + "\n".join(str(path) for path in study.save(out)))
    return True


def _sizes(text: str) -> list[int]:
    """Numbers of elements from "20,40"."""
    try:
        return [int(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise SceneError(f"--sizes {text}: give whole numbers, as 20,40,80") from None
