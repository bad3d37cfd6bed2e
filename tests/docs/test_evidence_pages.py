"""Pages of evidence: figures come from stored results, which say when and where they are from."""

import json
import math
import re
from pathlib import Path

import claims
import fill_figures
import intervals
import pytest
import reference_tables
import stored
from scipy.integrate import solve_ivp

TOP = Path(__file__).resolve().parents[2]

RESULTS = sorted(path for path in stored.RESULTS.iterdir() if path.suffix in {".md", ".csv"})
PAGES = fill_figures.pages()


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.name)
def test_every_stored_result_says_when_and_where_it_was_measured(path):
    stamp = stored.stamp(path.stem)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", stamp["date"])
    assert stamp["cpu"]
    assert stamp["cores"] >= 1
    assert stamp["impactfem"]


@pytest.mark.parametrize("name", sorted(stored.names()))
def test_a_table_is_shown_whole_and_with_one_stamp(name):
    part = re.sub(r"</?span[^>]*>", "", stored.part(name))
    rows = [line for line in stored.text(name).splitlines() if line.startswith("|")]
    assert [line for line in part.splitlines() if line.startswith("|")] == rows
    assert len(re.findall(r"Measured (on )?\d{4}|Measured on", part)) == 1


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_pages_show_the_stored_figures_in_the_repository(page):
    text = page.read_text(encoding="utf-8")
    assert text == fill_figures.filled(text), "run: python docs/scripts/fill_figures.py"


def test_the_page_of_evidence_shows_figures_and_a_wrong_one_is_replaced():
    page = TOP / "docs" / "evidence.md"
    assert page in PAGES
    text = page.read_text(encoding="utf-8")
    figure = stored.stamp("demos")["figures"]["hertz"]
    assert figure in text
    assert fill_figures.filled(text.replace(figure, "force 1.000")) == text
    with pytest.raises(KeyError, match="no_such"):
        fill_figures.filled(f"<!-- figures: no_such -->\n{fill_figures.END}")


def test_figures_are_shown_by_blocks_only():
    for page in (TOP / "docs").rglob("*.md"):
        if not {"_build", "generated"} & {*page.parts}:
            text = page.read_text(encoding="utf-8")
            assert not re.search(r"\{include\} .*(benchmarks|evidence)", text), page
            assert len(fill_figures.BLOCK.findall(text)) == text.count(fill_figures.END), page


def test_measuring_one_problem_keeps_the_rows_of_others(monkeypatch, tmp_path):
    def rows(problem, seeds):
        return [[problem.name, "c", f"{seeds} of {seeds}", *["1"] * 5]]

    def shown(*given):
        monkeypatch.setattr("sys.argv", ["intervals.py", "--out", str(tmp_path), *given])
        intervals.main()
        table = (tmp_path / "intervals.md").read_text(encoding="utf-8").splitlines()
        return [tuple(row.strip("| ").split(" | ")[:3:2]) for row in table[2:]]

    monkeypatch.setattr(intervals, "measured", rows)
    names = [problem().name for problem in intervals.PROBLEMS.values()]
    assert shown() == [(name, "100 of 100") for name in names]
    assert "note" not in (stamp := json.loads((tmp_path / "intervals.json").read_text()))
    assert shown("--seeds", "9", "block")[:2] == [(names[0], "100 of 100"), (names[1], "9 of 9")]
    note = json.loads((tmp_path / "intervals.json").read_text())["note"]
    assert note.startswith(f"{names[0]}; {names[2]}")
    assert note.endswith(f"on {stamp['date']}, impactfem {stamp['impactfem']}")


def test_the_tables_of_the_vibrating_table_hold_all_that_was_measured():
    parts = stored.vibrating_table()
    rows = stored.rows("vibrating_table")
    distances = [row for row in rows if row["quantity"].startswith("distance")]
    assert parts["table_distances"].count("T/") == len(distances) > 0
    for row in distances:
        assert f"| {float(row['measured']):.3f} |" in parts["table_distances"]


def test_claims_name_tests_that_exist_and_figures_from_files():
    found = claims.claims()
    assert len(found) >= 10
    for claim, test, figure, page in found:
        assert claim
        assert (TOP / test.strip("`")).is_file()
        assert re.search(r"\d", figure), claim
        target = re.search(r"\((.+)\)", page)[1]
        assert "generated" in target or (TOP / "docs" / target).is_file()


def test_the_theory_of_hertz_is_that_of_its_equation_of_motion():
    # m d'' = -4/3 E* sqrt(R) d^1.5 from d = 0 with the speed of the demo, integrated by SciPy.
    ball = claims._scene("elastic_sphere")["body"][0]
    radius, speed = ball["shape"]["radius"], -ball["velocity"][1]
    mass = ball["density"] * 4 / 3 * math.pi * radius**3
    stiff = 4 / 3 * ball["youngs_modulus"] / (1 - ball["poisson_ratio"] ** 2) * math.sqrt(radius)

    def leaves(_, y):
        return y[0]

    leaves.terminal, leaves.direction = True, -1
    motion = solve_ivp(
        lambda _, y: (y[1], -stiff / mass * max(y[0], 0) ** 1.5), (0, 1), (0, speed),
        events=leaves, rtol=1e-10, atol=1e-14, dense_output=True, max_step=1e-4,
    )  # fmt: skip
    contact = {"max_force": stiff * motion.y[0].max() ** 1.5, "intervals": [[0, motion.t[-1]]]}
    figure = claims.hertz({"elastic_sphere": {"contact": contact}})
    force, duration = (float(x) for x in re.findall(r"\d\.\d{3}", figure))
    assert force == pytest.approx(1, abs=2e-3)
    assert duration == pytest.approx(1, abs=2e-3)


def test_keys_of_the_scene_have_anchors_of_their_own():
    text = reference_tables.scene_reference()
    anchors = re.findall(r' id="([^"]+)"', text)
    assert len(anchors) == len(set(anchors)) > 100
    assert {"solve-method", "body-solid-density", "shape-disc-radius"} <= set(anchors)
