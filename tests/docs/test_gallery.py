"""The gallery: scenes are run once for each state of the sources, pages show what came out."""

import json
from pathlib import Path

import gallery_pages
import gallery_runs
import pytest
import readmes

TOP = Path(__file__).resolve().parents[2]

SCENE = """
title = "{title}"
duration = {duration}
gravity = [-9.81]
[[body]]
name = "ball"
kind = "point"
mass = 1.0
position = [0.3]
[[obstacle]]
name = "floor"
kind = "half_space"
point = [0.0]
normal = [1.0]
[[contact]]
between = ["ball", "floor"]
restitution = 0.5
"""


@pytest.fixture
def top(tmp_path, monkeypatch):
    """A repository of two demos; the package is the installed one."""
    for name in ("drop", "fall"):
        (tmp_path / "demos" / name).mkdir(parents=True)
        text = SCENE.format(title=name, duration=0.5)
        (tmp_path / "demos" / name / "scene.toml").write_text(text, encoding="utf-8")
    for module in (gallery_runs, readmes, gallery_pages):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    return tmp_path


@pytest.mark.slow
def test_a_scene_is_run_again_only_if_it_or_the_package_changes(top):
    out = top / "out"
    runs, made = gallery_runs.execute_all(out)
    assert made == len(runs) == 2
    assert (out / "drop" / "summary.json").is_file()
    assert gallery_runs.execute_all(out)[1] == 0

    scene = top / "demos" / "drop" / "scene.toml"
    scene.write_text(SCENE.format(title="drop", duration=0.6), encoding="utf-8")
    digest = gallery_runs.sources()
    assert [gallery_runs.is_current(run, digest) for run in runs] == [False, True]

    (top / "impactfem").mkdir()
    (top / "impactfem" / "solving.py").write_text("pass", encoding="utf-8")
    digest = gallery_runs.sources()
    assert not any(gallery_runs.is_current(run, digest) for run in runs)


@pytest.mark.slow
def test_a_demo_that_fails_is_named_with_its_message_and_keeps_no_stamp(top):
    scene = top / "demos" / "drop" / "scene.toml"
    scene.write_text(SCENE.format(title="drop", duration=-1), encoding="utf-8")
    with pytest.raises(
        gallery_runs.GalleryError, match=r"drop/scene\.toml: exit status 2\n.*duration"
    ):
        gallery_runs.execute_all(top / "out")
    drop, fall = gallery_runs.find_runs(top / "out")
    assert drop.stamp == {}
    assert fall.stamp != {}


def test_a_gallery_without_scenes_is_no_success(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery_runs, "ROOT", tmp_path)
    with pytest.raises(gallery_runs.GalleryError, match="no demos"):
        gallery_runs.execute_all(tmp_path / "out")


def test_several_scenes_of_a_demo_have_names_of_their_own():
    runs = gallery_runs.find_runs()
    assert len({run.name for run in runs}) == len(runs)
    assert {run.scene for run in runs} == set(TOP.glob("demos/*/scene*.toml"))


@pytest.mark.parametrize("page", sorted(TOP.glob("demos/*/README.md")), ids=lambda p: p.parent.name)
def test_links_of_a_demo_lead_to_the_same_files_from_its_page(page):
    text = page.read_text(encoding="utf-8")
    before = [(page.parent / link[1]).resolve() for link in readmes.LINK.finditer(text)]
    moved = [link[1] for link in readmes.LINK.finditer(readmes.relink(text, page.parent))]
    after = [
        TOP / "demos" / target.removesuffix(".md") / "README.md"
        if "/" not in target else (readmes.PAGES / target).resolve() for target in moved
    ]  # fmt: skip
    assert after == before
    assert all(path.exists() for path in after)


def test_every_demo_has_a_line_that_says_something():
    demos = readmes.read_demos([])
    assert len(demos) == len(list(TOP.glob("demos/*/README.md")))
    for demo in demos:
        assert 20 < len(demo.line) < 250, demo.name
        assert not set("[]`$*\\") & set(demo.line), demo.name


@pytest.mark.slow
def test_the_page_of_a_demo_shows_figures_pictures_and_report_of_its_run(top, monkeypatch):
    monkeypatch.setattr(gallery_pages, "PAGES", top / "pages")
    monkeypatch.setattr(readmes, "PAGES", top / "pages")
    monkeypatch.setattr(gallery_pages, "EXTRA", top / "extra")
    for name in ("drop", "fall"):
        text = f"# The {name}\n\nA ball of one kilogram falls from a hand.\n\n## More\n\nText.\n"
        (top / "demos" / name / "README.md").write_text(text, encoding="utf-8")
    (top / "pages").mkdir()
    (top / "pages" / "gone.md").write_text("of a demo that is no more", encoding="utf-8")
    runs, _ = gallery_runs.execute_all(top / "out", only=["drop"])
    (runs[0].folder / "report.html").write_text("<p>report</p>", encoding="utf-8")
    gallery_pages.write(gallery_runs.find_runs(top / "out"))

    page = (top / "pages" / "drop.md").read_text(encoding="utf-8")
    facts = json.loads((runs[0].folder / "summary.json").read_text(encoding="utf-8"))
    assert f"`{facts['method']}`" in page
    assert f"{facts['contact']['impulse']:.4g}" in page
    assert "impactfem run demos/drop/scene.toml" in page
    assert page.index("falls from a hand") < page.index("impactfem run") < page.index("## More")
    for picture in runs[0].folder.glob("*.png"):
        assert f"(drop/{picture.name})" in page
        assert (top / "pages" / "drop" / picture.name).is_file()
    assert "../../gallery/drop/report.html" in page
    assert (top / "extra" / "drop" / "report.html").read_text(encoding="utf-8") == "<p>report</p>"
    index = (top / "pages" / "index.md").read_text(encoding="utf-8")
    assert "not run yet" in index
    assert facts["method"] in index
    assert not (top / "pages" / "gone.md").exists()
