"""Run the board of hard cases."""

import math
import time
from collections.abc import Callable, Sequence

from impactfem.errors import ImpactError, SceneError
from impactfem.methods import METHODS
from impactfem.studies.hard.bar_special import CASES as BAR_CASES
from impactfem.studies.hard.board import Board, Case, Cell, Claim, Facts, Verdict
from impactfem.studies.hard.pairs import CASES as PAIR_CASES
from impactfem.studies.hard.point_special import CASES as POINT_CASES
from impactfem.studies.hard.solid_special import CASES as SOLID_CASES

CASES: tuple[Case, ...] = (*BAR_CASES, *SOLID_CASES, *PAIR_CASES, *POINT_CASES)
"""All hard cases."""

__all__ = ["CASES", "Board", "hard_cases"]


def hard_cases(
    methods: Sequence[str] | None = None,
    *,
    quick: bool = False,
    cases: Sequence[Case] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Board:
    """Run hard cases and say what holds.

    Args:
        methods: Names of methods; all if None.
        quick: Only the cases of the quick part.
        cases: The cases; `CASES` if None.
        progress: Told of each cell.

    Returns:
        The board.

    Raises:
        SceneError: A method is unknown.
    """
    for name in methods or ():
        if name not in METHODS:
            raise SceneError(f'method = "{name}" is unknown; choose from {", ".join(METHODS)}')
    cells: list[Cell] = []
    claims: dict[str, tuple[Claim, ...]] = {}
    for case in CASES if cases is None else cases:
        if quick and not case.quick:
            continue
        chosen = [m for m in case.methods if m in METHODS and (methods is None or m in methods)]
        claims[case.name] = tuple(c for m in chosen for c in case.claims(m))
        for method in chosen:
            cells.append(_cell(case, method))
            if progress:
                last = cells[-1]
                progress(f"{last.verdict:7}  {case.name}  {method}  {last.faults or last.figures}")
    return Board(tuple(cells), claims)


def _cell(case: Case, method: str) -> Cell:
    start = time.perf_counter()
    facts: Facts = {}
    failed: tuple[Claim, ...] = ()
    right, message = method in case.refusals, ""
    verdict: Verdict = "FAIL"
    try:
        facts = case.run(method)
    except ImpactError as error:
        verdict, message = "refused" if right else "FAIL", str(error)
    else:
        failed = tuple(claim for claim in case.claims(method) if not claim.holds(facts))
        # A number that is no number fails even where nothing is claimed of it.
        lost = [name for name, value in facts.items() if math.isnan(value)]
        if right:
            failed, message = (), "it should be refused"
        elif lost:
            message = f"not a number: {', '.join(lost)}"
        elif not failed:
            verdict = "pass"
    seconds = time.perf_counter() - start
    return Cell(case.name, method, verdict, facts, failed, message, seconds, case.body)
