"""The report of a run: well-formed, self-contained, escaped, and honest about runs that failed."""

import base64
import gzip
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from synthetic import solid_result

import impactfem
from impactfem import Result, Scene
from impactfem.findings import warning
from impactfem.report.figures import painters
from impactfem.report.page.embedding import PLOTLY, json_text, script_text
from impactfem.report.page.page import page
from impactfem.result.store import _OWN
from impactfem.runs.verdict import judge
from impactfem.shipped import shipped_scenes

EMPTY = {"meta", "link", "img", "br", "input", "path", "use", "rect"}
ATTACK = '</script><script>alert("x")</script><b>$title & "quotes"'


class Reader(HTMLParser):
    """Tags must close in order; collects addresses, texts outside scripts, and inline handlers."""

    def __init__(self):
        super().__init__()
        self.open, self.addresses, self.words, self.tags = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in EMPTY:
            self.open.append(tag)
        for name, value in attributes:
            assert not name.startswith("on"), (tag, name)
            if name in {"src", "href", "xlink:href", "action", "data", "srcset"}:
                self.addresses.append(value)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in EMPTY:
            self.open.pop()

    def handle_endtag(self, tag):
        if tag in EMPTY:
            return
        assert self.open[-1:] == [tag]
        self.open.pop()

    def handle_data(self, data):
        if not {"script", "style"} & set(self.open):
            self.words.append(data)


def read(text):
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader, " ".join(" ".join(reader.words).split())


def solved(name, *settings):
    scene = Scene.from_toml(shipped_scenes()[name])
    return impactfem.solve(scene.with_settings(list(settings)) if settings else scene)


@pytest.fixture(scope="module")
def bar():
    return solved("bar_impact", "solve.method='galerkin'", "solve.elements=10")


@pytest.fixture(scope="module")
def point():
    return solved("bouncing_ball")


@pytest.fixture(scope="module", params=["bar", "point", "row", "beam", "solid", "ball"])
def result(request, tmp_path_factory):
    if request.param in {"bar", "point"}:
        return request.getfixturevalue(request.param)
    if request.param == "row":
        return solved("two_bars")
    if request.param == "beam":
        return solved("dropped_beam", "duration=1e-4", "solve.estimate=false")
    dim = 2 if request.param == "solid" else 3
    return solid_result(tmp_path_factory.mktemp("solid") / "fields.vtkhdf", dim)


def test_pages_of_every_kind_are_well_formed_and_need_no_network(result):
    text = page(result, [])
    reader, words = read(text)
    assert words.count(result.scene.title) >= 1
    outside = [address for address in reader.addresses if not address.startswith(("data:", "#"))]
    names = {"scene.toml", "history.csv", "summary.json"}
    assert names <= set(outside)
    assert not [address for address in outside if "//" in address or address.startswith("/")]
    # No style fetches anything either; addresses of name spaces are names.
    without_scripts = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    assert "url(http" not in without_scripts
    assert "@import" not in without_scripts
    left = re.sub(r'xmlns(:\w+)?="[^"]*"', "", without_scripts)
    assert not re.findall(r"https?://", left)
    for anchor in ("verdict", "scene", "model", "error", "checks", "contact", "cost", "files"):
        assert f'id="{anchor}"' in text
    targets = {attributes.get("id") for _, attributes in reader.tags}
    links = [address[1:] for address in reader.addresses if address.startswith("#")]
    assert set(links) <= targets
    ids = [attributes["id"] for _, attributes in reader.tags if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert '<svg class="drawing"' in text


@pytest.mark.slow
def test_the_page_lies_in_the_folder_with_its_run(bar, tmp_path):
    folder = bar.save(tmp_path / "out")
    text = (folder / "report.html").read_text(encoding="utf-8")
    run = json.loads((folder / "summary.json").read_text())["run"]
    _, words = read(text)
    assert run["versions"]["NumPy"] == np.__version__
    assert f"NumPy {np.__version__}" in words
    assert "python: impactfem.solve(...)" in words
    # What the page calls the files of the folder is what lies there.
    listed = set(re.findall(r'<li><a href="([^"]+)"', text))
    assert listed == {path.name for path in folder.iterdir()} - {"report.html"}
    # Without a report none stays.
    quiet = bar.scene.with_settings(["output.report=false"])
    Result(quiet, bar.history, bar.summary, bar.fields, bar.exact).save(folder)
    assert not (folder / "report.html").exists()
    assert (folder / "energy.png").exists()


def test_what_strangers_write_stays_text(bar):
    scene = bar.scene.with_settings({"title": ATTACK, "body.bar.velocity": "-0.5 + 0*min(x, 1)"})
    found = [warning("setting", ATTACK, remedy=ATTACK).as_dict()]
    summary = {**bar.summary, "title": ATTACK}
    summary["verdict"] = {"level": "care", "findings": found}
    summary["run"] = summary["run"] | {"command": ATTACK}
    summary["plan"] = summary["plan"] | {"findings": found, "reasons": {ATTACK: ATTACK}}
    text = page(Result(scene, bar.history, summary, bar.fields, bar.exact), [])
    reader, words = read(text)
    assert words.count(ATTACK) >= 5
    assert "alert" not in "".join(re.findall(r"<script[^>]*>(.*?)</script>", text, re.DOTALL)[:1])
    assert "<b>" not in text
    assert sum(tag == "script" for tag, _ in reader.tags) == page(bar, []).count("</script>")


@pytest.mark.parametrize("words", [ATTACK, "<!-- <script>", "a\u2028b & c"])
def test_json_and_code_cannot_leave_their_element(words):
    text = json_text({"title": words})
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"title": words}
    assert "</script" not in script_text(f"var a = '{words}';")
    with pytest.raises(ValueError, match="JSON"):
        json_text({"value": float("nan")})


def test_plotly_is_the_version_that_its_script_makes_and_small():
    made = (Path(__file__).parents[2] / ".ci/plotly-bundle").read_text(encoding="utf-8")
    version = re.search(r"^version=(.+)$", made, re.MULTILINE)[1]
    code = gzip.decompress(PLOTLY.read_bytes()).decode("utf-8")
    assert f"plotly.js v{version} with" in code[:200]
    assert "MIT" in PLOTLY.with_name("plotly.LICENSE").read_text(encoding="utf-8")
    assert PLOTLY.stat().st_size < 600_000


def test_columns_without_a_name_have_no_empty_header(bar):
    """A screen reader would announce it."""
    text = page(bar, [])
    assert "<td></td><th" in text
    assert not re.search(r"<th[^>]*></th>", text)


def test_a_page_is_small_and_holds_its_numbers_packed(bar):
    text = page(bar)
    assert len(text.encode("utf-8")) < 2_500_000
    code = re.search(r'id="charts-data">([^<]*)</script>', text)[1]
    charts = json.loads(gzip.decompress(base64.b64decode(code)))
    assert "chart-contact_force" in {chart["element"] for chart in charts}


def judged(result, **figures):
    """A result with other figures, judged anew."""
    summary = {**result.summary, **figures}
    summary |= judge(result.scene, result.history, summary, [], [])
    return Result(result.scene, result.history, summary, result.fields, result.exact)


def test_a_run_that_did_not_converge_says_so_first(bar):
    active = bar.summary["active_set"] | {"converged": False, "message": "the sets alternate"}
    _, words = read(page(judged(bar, active_set=active), []))
    start = words[: words.index("The scene at t = 0")]
    assert "Do not trust this run It did not converge: the sets alternate; take" in start
    assert "Trust this run" not in start
    assert "The active set settled NO" in words


def test_a_run_whose_energy_grows_is_not_trusted(bar):
    energy = bar.summary["energy"] | {"grows": True, "max_relative_growth": 0.5}
    _, words = read(page(judged(bar, energy=energy), []))
    assert "Do not trust this run The energy grows by 50 %, though nothing feeds it;" in words
    assert "Energy does not grow NO" in words


def test_a_run_with_numbers_that_are_not_finite_is_not_trusted(bar):
    history = bar.history.copy(deep=True)
    history["contact_force"][-1] = np.nan
    contact = bar.summary["contact"] | {"max_force": None, "impulse": None}
    lost = Result(bar.scene, history, bar.summary, bar.fields, bar.exact)
    _, words = read(page(judged(lost, contact=contact), []))
    assert "Do not trust this run Its history holds numbers that are not finite;" in words
    assert "Largest force not finite" in words


def test_what_an_estimate_took_and_an_episode_are_told(bar):
    """Notes of an estimate are texts or tables; a beam's rebound has figures of its own."""
    note = {"message": "run on elements twice as large", "seconds": 0.25, "num_steps": 9}
    episode = {"restitution": 0.6125, "micro_impacts": 7, "vibration": 0.11}
    details = {"error_estimate": note, "episode": episode, "watch": "a node enters the floor"}
    _, words = read(page(judged(bar, details=details), []))
    assert "Run on elements twice as large, which took 0.25 s." in words
    assert "Apparent restitution 0.6125" in words
    assert "Trust this run with care A node enters the floor." in words


def test_results_from_before_runs_noted_their_origin_are_reported_too(bar):
    summary = {key: value for key, value in bar.summary.items() if key != "run"}
    _, words = read(page(Result(bar.scene, bar.history, summary, bar.fields, bar.exact), []))
    assert "did not note where it came from" in words


@pytest.mark.slow
def test_a_fault_in_a_part_costs_neither_page_nor_result(bar, monkeypatch, tmp_path):
    from impactfem.report.page import page as module

    def faulty(_):
        raise IndexError("beyond\nthe end")

    monkeypatch.setattr(module, "charts", faulty)
    with pytest.warns(RuntimeWarning, match=r"not drawn: the charts.*\(IndexError: beyond the end"):
        bar.save(tmp_path / "out")
    _, words = read((tmp_path / "out/report.html").read_text(encoding="utf-8"))
    assert "not drawn: the charts on the page (IndexError: beyond the end)" in words
    monkeypatch.undo()
    monkeypatch.setattr(module.facts, "cost", faulty)
    with pytest.warns(RuntimeWarning, match=r"not drawn: report\.html"):
        folder = bar.save(tmp_path / "out")
    assert {path.name for path in folder.iterdir()} > {"summary.json", "energy.png"}
    assert not (folder / "report.html").exists()


def test_a_rerun_removes_every_picture_that_a_result_may_have(result):
    assert {f"{name}.png" for name in painters(result)} <= set(_OWN)
