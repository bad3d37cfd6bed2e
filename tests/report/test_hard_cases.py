"""The board of hard cases: it holds, and it can fail."""

import math

import pytest

import impactfem
from impactfem.errors import SceneError
from impactfem.methods import METHODS
from impactfem.studies.hard.board import Case, Claim
from impactfem.studies.hard.cases import CASES
from impactfem.studies.hard.rows import Row, Sizes, _read, base, limit
from impactfem.studies.hard.solids import facts_of, solved, total_variation

# Cells that fail, as the board shows: to be mended, and not to become more.
KNOWN = {
    # Slices through unfitted triangles measure the energy of a field with jumps: 2e-5 at a graze.
    ("grazing contact, v -> 0", "dg"),
    # Contact nodes with mass stop at once and the force rings: the founding scheme at any step but
    # that of the bar's characteristics, which a solid has not.
    ("disc on a floor", "galerkin"),
    ("square falls flat", "galerkin"),
    ("square falls on its corner", "galerkin"),
    ("v0 = 0.3 c, contact in the first step", "galerkin"),
    ("step 0.999 of the stable one", "galerkin"),
    ("elements 1:20 where it touches", "galerkin"),
    # Waves that only the small elements carry stay among them; long implicit steps do not see them.
    ("elements 1:20 where it touches", "explicit"),
    # Forces turn between layers: an error of first order in dt, 2e-5 at courant .5.
    ("disc inside a circle, updated normals", "conserving"),
    ("disc inside a circle, updated normals", "explicit"),
}


@pytest.fixture(scope="module")
def board():
    # Points have a module of their own.
    return impactfem.studies.hard_cases(quick=True, cases=[c for c in CASES if c.body != "point"])


@pytest.mark.slow
def test_methods_that_the_plan_may_choose_hold_every_claim(board):
    failures = {(c.case, c.method): c.faults or c.message
                for c in board.without_controls().failures}  # fmt: skip
    assert failures.keys() <= KNOWN, failures


@pytest.mark.slow
def test_board_covers_every_plannable_method_and_many_cases(board):
    plannable = {name for name, method in METHODS.items()
                 if method.plannable and "bar" in method.bodies}  # fmt: skip
    assert plannable <= {cell.method for cell in board.cells}
    assert len({cell.case for cell in board.cells}) >= 20


@pytest.mark.slow
def test_negative_control_fails_wherever_it_is_shown(board):
    """A board that cannot fail proves nothing."""
    shown = board.of("newmark")
    assert len(shown.cells) >= 3
    assert shown.failures == shown.cells
    for cell in shown.cells:
        assert cell.facts["growth"] > 0.1
        assert "growth" in cell.faults


@pytest.mark.slow
def test_every_method_of_solids_is_shown_in_many_cases(board):
    cells = [cell for cell in board.cells if cell.body == "solid"]
    for method in (name for name, entry in METHODS.items() if "solid" in entry.bodies):
        assert len({cell.case for cell in cells if cell.method == method}) >= 5
    keeping = [cell for cell in cells if cell.method in {"conserving", "explicit"}]
    assert min(cell.facts["drift"] for cell in keeping if "drift" in cell.facts) >= 0.0
    assert len([c for c in keeping if c.facts.get("drift", 1.0) <= 1e-9]) >= 20


@pytest.mark.slow
def test_right_refusals_pass_and_say_why(board):
    refused = [cell for cell in board.cells if cell.verdict == "refused"]
    assert {cell.case for cell in refused} >= {
        "initial penetration", "courant 2", "random mesh", "step beyond the stable one",
    }  # fmt: skip
    for cell in refused:
        assert cell.passed
        assert len(cell.message) > 20
        assert "/tmp" not in cell.message  # noqa: S108  (a text)


def run_one(facts, *claims, refusals=frozenset()):
    def run(_):
        if isinstance(facts, Exception):
            raise facts
        return facts

    case = Case("made up", run, lambda _: claims, ("exact",), refusals)
    return impactfem.studies.hard_cases(cases=[case]).cells[0]


def test_a_claim_holds_up_to_its_limit_and_never_for_what_is_not_finite():
    claim = Claim("growth", 1.0, "because")
    assert run_one({"growth": 1.0}, claim).verdict == "pass"
    for value in (1.1, math.inf, math.nan):
        cell = run_one({"growth": value}, claim)
        assert cell.verdict == "FAIL"
        assert "because" in cell.faults
    assert run_one({}, claim).verdict == "FAIL"
    assert run_one({"other": math.nan}).verdict == "FAIL"


def test_wrong_refusals_and_missing_ones_fail():
    assert run_one(SceneError("no")).verdict == "FAIL"
    assert run_one(SceneError("no"), refusals=frozenset({"exact"})).verdict == "refused"
    assert run_one({"growth": 0.0}, refusals=frozenset({"exact"})).verdict == "FAIL"


@pytest.mark.slow
def test_board_is_written_with_what_must_hold(board, tmp_path):
    markdown, table = board.save(tmp_path)
    text = markdown.read_text()
    assert "What must hold, and why" in text
    assert "| impact between nodes | " in text
    assert "| case (solid) | massless | " in text
    assert "FAIL" in text
    assert table.read_text().startswith("case,method,verdict,figure,value,message")


def test_cases_have_names_of_their_own():
    names = [case.name for case in CASES]
    assert len(names) == len(set(names))


def test_tables_name_groups_of_bounds_and_methods_that_there_are():
    tables = [_read(name) for name in ("bars", "solids", "pairs", "points")]
    asked = {
        group for table in tables for case in table["case"] for group in case.get("bounds", ())
    }
    bounds = _read("bounds")
    assert asked == bounds.keys()
    rows = [row for group in bounds.values() for row in group]
    assert {name for row in rows for name in (*row.get("of", ()), *row.get("but", ()))} <= set(
        METHODS
    )
    assert all({"figure", "limit", "why"} <= row.keys() for row in rows)


def test_limits_in_words_grow_with_what_a_method_cannot_tell_from_an_instant():
    coarse, fine = Sizes(dt=1e-2), Sizes(dt=1e-3)
    for method, delay in (("paoli_schatzman", 2.0), ("moreau_jean", 1.0)):
        assert limit("3*tau", coarse.time(method), {}) == pytest.approx(3e-2 * delay)
        assert limit("3*tau", fine.time(method), {}) == pytest.approx(3e-3 * delay)
    assert limit("v*tau", coarse.time("moreau_jean"), {"v": "sqrt(4)"}) == 0.02
    assert limit("3*tau", coarse.time("event_driven"), {}) == 1e-9
    assert limit(0.25, 1.0, {}) == 0.25


def test_unknown_methods_are_named():
    with pytest.raises(impactfem.SceneError, match="leapfrog"):
        impactfem.studies.hard_cases(["leapfrog"])


@pytest.mark.slow
def test_two_ranks_give_the_same_answers():
    ranks = [case for case in CASES if case.name == "1 and 2 ranks"]
    assert not impactfem.studies.hard_cases(cases=ranks).failures


def test_a_rough_force_and_a_push_from_nowhere_show():
    """The figures of solids can fail: a ringing force varies more, a false one moves nothing."""
    row = Row(base("solids"), set={"duration": 3.0, "body.body.mesh_size": 0.25})
    result = solved("massless", row.scene())
    assert facts_of(result)["impulse"] < 1e-12
    history = result.history
    ringing = history["contact_force"].copy()
    ringing[10::2] *= 1.5
    assert total_variation(ringing.values) > 2.0 * total_variation(history["contact_force"].values)
    history["contact_force"] = ringing
    assert facts_of(result)["impulse"] > 1e-3


@pytest.mark.slow
def test_cases_that_take_longer_hold_too():
    """All but the longest run, which the stored board shows, and ranks."""
    slow = [case for case in CASES if not case.quick
            and "20000" not in case.name and "ranks" not in case.name]  # fmt: skip
    assert {case.body for case in slow} == {"bar", "solid", "point"}
    found = impactfem.studies.hard_cases(cases=slow)
    failures = {(c.case, c.method): c.faults or c.message
                for c in found.without_controls().failures}  # fmt: skip
    assert failures.keys() <= KNOWN, failures
    controls = [cell for cell in found.cells if cell.method == "newmark"]
    assert controls
    assert not any(cell.passed for cell in controls)
