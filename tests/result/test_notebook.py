"""What objects show of themselves in a notebook, and that they survive copies and pickles."""

import copy
import gc
import multiprocessing
import pickle
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import impactfem
from impactfem.cards import card, curve, table
from impactfem.result import FieldSpool, Shape, StoredSnapshots
from impactfem.shipped import shipped_scenes
from impactfem.studies.hard.board import Board, Cell, Claim

VOID = {"br", "img", "input", "line", "polyline"}


class Page(HTMLParser):
    """Checks that tags close in their order, and collects the text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words, self.points = [], [], None
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        assert tag != "script"
        if tag == "polyline":
            self.points = [tuple(map(float, p.split(","))) for p in dict(attrs)["points"].split()]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)

    @property
    def text(self):
        return " ".join(self.words)


def bar_scene(title="Bar", **solve):
    bar = impactfem.Bar(length=1.0, density=1.0, youngs_modulus=1.0, gap=0.5, velocity=-0.5)
    return impactfem.Scene(
        title=title, duration=5.0, bodies=[bar], obstacles=[impactfem.Wall()],
        solve=impactfem.Solve(**solve),
    )  # fmt: skip


@pytest.fixture(scope="module")
def result():
    return impactfem.solve(bar_scene("<script>alert(1)</script> & Söhne", elements=20))


def test_the_card_of_a_result_holds_its_figures_and_no_foreign_markup(result):
    page = Page(result._repr_html_())
    assert "<script>alert(1)</script> & Söhne" in page.text
    for word in ("completed", result.summary["method"], "1 to 3 s", "max 0.5 N", "characteristics"):
        assert word in page.text
    # Contact from 1 s to 3 s of 5 s: the curve is high there, and low elsewhere.
    heights = {}
    for x, y in page.points:
        heights.setdefault(y, []).append(x)
    high, low = min(heights), max(heights)
    assert set(heights) == {high, low}
    assert (min(heights[high]), max(heights[high])) == pytest.approx((320 / 5, 3 * 320 / 5), abs=1)


def test_a_run_that_failed_is_marked(result):
    verdict = {"level": "do_not_trust", "findings": []}
    summary = dict(result.summary) | {"verdict": verdict}
    page = Page(impactfem.Result(result.scene, result.history, summary)._repr_html_())
    assert "Do not trust this run" in page.text


def test_a_short_peak_among_many_rows_is_seen():
    values = np.zeros(1_000_001)
    values[654_321] = 3.0
    page = Page(f"<div>{curve(np.arange(len(values)), values, 'force')}</div>")
    top = min(y for _, y in page.points)
    (places,) = [sorted(x for x, y in page.points if y == top)]
    assert places[0] <= 320 * 0.654321 <= places[-1]
    assert places[-1] - places[0] <= 2.0
    assert len(page.points) < 1000


@pytest.mark.parametrize("values", [[0, 0, 0], [np.nan, np.nan, np.nan], [1.0]])
def test_where_there_is_nothing_to_see_there_is_no_curve(values):
    assert curve(np.arange(len(values)), values, "force") == ""


def test_gaps_in_a_curve_do_no_harm():
    values = np.array([0.0, 1.0, np.nan, np.inf, 2.0])
    assert Page(f"<p>{curve(np.arange(5.0), values, 'force')}</p>").points


def test_cards_and_tables_escape_what_they_are_given():
    bad = "<b onload='x'>&"
    page = Page(card(bad, [(bad, bad)], badge=bad, parts=[table([bad], [[bad]])]))
    assert page.words.count(bad) == 6


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_scenes_say_what_they_hold(name):
    scene = impactfem.Scene.from_toml(shipped_scenes()[name])
    text = Page(scene._repr_html_()).text
    for entry in (*scene.bodies, *scene.obstacles):
        assert entry.name in text
        assert entry.kind in text
    assert scene.title in text
    assert f"duration = {scene.duration:g} s" in text


def test_a_scene_says_what_is_sought():
    demo = Path(__file__).resolve().parents[2] / "demos" / "soft_landing" / "scene.toml"
    text = Page(impactfem.Scene.from_toml(demo)._repr_html_()).text
    for said in ("parameter off", "start = 2.6e-06", "measure rest", "objective", "misfit"):
        assert said in text
    assert "None" not in text


def test_a_scene_tells_what_differs_from_the_defaults():
    text = Page(bar_scene(elements=33)._repr_html_()).text
    assert "elements = 33" in text
    assert "velocity = -0.5 m/s" in text
    for usual in ("area", "far_end", "displacement", "window", "gravity", "fields"):
        assert usual not in text


@pytest.mark.parametrize("name", ["bar_impact", "two_bars", "bouncing_ball", "dropped_beam"])
def test_plans_put_choices_beside_reasons(name):
    plan = impactfem.plan(impactfem.Scene.from_toml(shipped_scenes()[name]))
    text = Page(plan._repr_html_()).text
    for reason in plan.reasons.values():
        assert reason in text
    assert plan.method in text
    assert plan.method in repr(plan)
    assert len(repr(plan)) < 400
    assert pickle.loads(pickle.dumps(plan)) == plan  # noqa: S301


def test_trajectories_studies_and_boards_show_themselves():
    system = impactfem.systems.LinearSystem(mass=1.0, load=[-9.81], normals=[[1.0]], offsets=[0.0])
    motion = impactfem.integrate(system, 1.0, 0.0, 1.0)
    assert "1001 rows" in Page(motion._repr_html_()).text
    assert "array" not in repr(motion)
    study = impactfem.studies.work_precision(bar_scene(), ["conserving"], [10], repeats=1)
    assert "conserving" in Page(study._repr_html_()).text
    assert "conserving" in repr(study)
    claim = Claim("drift", 1e-9, "<energy>")
    cells = (
        Cell("case 1", "dg", "pass", {"drift": 0.0}),
        Cell("case 2", "dg", "FAIL", {"drift": 1.0}, (claim,)),
    )
    text = Page(Board(cells, {"case 1": (claim,), "case 2": (claim,)})._repr_html_()).text
    assert "1 failed" in text
    assert "drift = 1 > 1e-09 (<energy>)" in text


def test_figures_show_themselves_without_pyplot(result):
    assert result.figure("energy")._repr_png_().startswith(b"\x89PNG")


def same(one, other):
    assert other.scene == one.scene
    assert other.summary == one.summary
    assert other.history.identical(one.history)
    assert np.array_equal(other.fields.displacement, one.fields.displacement)


def test_results_of_bars_are_copied_and_pickled(result):
    same(result, copy.deepcopy(result))
    same(result, pickle.loads(pickle.dumps(result)))  # noqa: S301


def test_results_come_back_from_other_processes(result):
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        same(result, pool.apply(copy.copy, (result,)))


@pytest.mark.parametrize("name", sorted(shipped_scenes()))
def test_scenes_are_copied_and_pickled(name):
    scene = impactfem.Scene.from_toml(shipped_scenes()[name])
    assert copy.deepcopy(scene) == scene
    again = pickle.loads(pickle.dumps(scene))  # noqa: S301
    assert again == scene
    assert again.mesh_path == scene.mesh_path


def spooled(folder):
    folder.mkdir()
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    with FieldSpool(
        folder / "fields.vtkhdf", [Shape("body", square, [[0, 1, 2, 3]], 9)], {"displacement": 3}
    ) as s:
        s.append(0.0, {"displacement": np.zeros((4, 2))})
    return folder / "fields.vtkhdf"


def test_fields_in_a_file_travel_by_its_path(tmp_path, monkeypatch):
    path = spooled(tmp_path / "kept")
    monkeypatch.chdir(path.parent)
    fields = StoredSnapshots("fields.vtkhdf")
    data = pickle.dumps(fields)
    monkeypatch.chdir(tmp_path)
    assert len(pickle.loads(data)) == 1  # noqa: S301


def test_fields_that_pass_stay_as_long_as_a_copy_and_are_not_pickled(tmp_path):
    path = spooled(tmp_path / "passing")
    fields = StoredSnapshots(path, passing=path.parent)
    with pytest.raises(pickle.PicklingError, match="save the result"):
        pickle.dumps(fields)
    other = copy.deepcopy({"fields": fields})["fields"]
    del fields
    gc.collect()
    assert other.read(0)["displacement"].shape == (4, 3)
    del other
    gc.collect()
    assert not path.exists()


def test_comparisons_and_fields_show_themselves(result):
    other = impactfem.solve(bar_scene(elements=40))
    text = Page(impactfem.compare(result, other)._repr_html_()).text
    assert "Two histories side by side" in text
    assert "interpolated" in text
    assert "contact_force" in text
    text = Page(result.fields._repr_html_()).text
    assert f"{len(result.fields)}, 0 to 5 s" in text
    assert str(len(result.fields.positions)) in text
    assert "velocity" in text
