"""Files around the package: they parse, and say what the package says."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PLAIN = [
    *sorted((ROOT / ".github").rglob("*.yml")),
    ROOT / ".readthedocs.yaml",
    ROOT / ".pre-commit-config.yaml",
]


def read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def parsed(text: str):
    return pytest.importorskip("yaml").safe_load(text)


@pytest.mark.parametrize("path", PLAIN, ids=lambda path: path.name)
def test_settings_in_yaml_parse(path):
    assert isinstance(parsed(path.read_text(encoding="utf-8")), dict)


def test_the_workflow_only_calls_the_script_of_the_repository():
    (job,) = parsed(read(".github/workflows/ci.yml"))["jobs"].values()
    commands = [step["run"] for step in job["steps"] if "run" in step]
    assert commands[-1] == ".ci/run"
    assert not any("pytest" in command or "make " in command for command in commands)


@pytest.mark.parametrize("kind", ["bug", "wrong_number"])
def test_reports_ask_for_what_is_needed_to_repeat_them(kind):
    form = parsed(read(f".github/ISSUE_TEMPLATE/{kind}.yml"))
    asked = " ".join(field["attributes"]["label"] for field in form["body"])
    assert "scene" in asked
    assert "summary.json" in asked
    assert "impactfem doctor" in asked


def test_read_the_docs_builds_what_is_there():
    settings = parsed(read(".readthedocs.yaml"))
    assert (ROOT / settings["sphinx"]["configuration"]).is_file()
    extras = settings["python"]["install"][0]["extra_requirements"]
    assert set(extras) <= set(SETTINGS["project"]["optional-dependencies"])


def test_the_recipe_names_all_dependencies_and_the_version():
    recipe = read("packaging/conda/recipe/meta.yaml")
    version = re.search(r'set version = "(.*)"', recipe)[1]
    assert version == re.search(r"^version: (\S+)$", read("CITATION.cff"), re.MULTILINE)[1]
    told = parsed(re.sub(r"\{%.*?%\}", "", recipe).replace("{{", "").replace("}}", ""))
    needed = {
        "matplotlib": "matplotlib-base",
        "gmsh": "python-gmsh",
        "dolfinx-solver-real": "fenics-dolfinx",
    }
    project = SETTINGS["project"]
    given = [
        *project["dependencies"],
        *project["optional-dependencies"]["fem"],
        *project["optional-dependencies"]["view"],
    ]
    names = [re.match(r"[\w-]+", text)[0] for text in given]
    run = {re.match(r"[\w-]+", text)[0] for text in told["requirements"]["run"]}
    assert {needed.get(name, name) for name in names} <= run
    files = {Path(name).name for name in told["about"]["license_file"]}
    assert files == {Path(name).name for name in project["license-files"]}


def test_every_licence_is_there():
    for name in SETTINGS["project"]["license-files"]:
        assert (ROOT / name).is_file(), name
    assert "GNU GENERAL PUBLIC LICENSE" in read("LICENSE.GPL")


def test_the_changelog_is_short_and_has_a_page_for_each_version():
    text = read("CHANGELOG.md")
    assert len(text.splitlines()) <= 120
    versions = re.findall(r"^## \[([0-9.]+)\]", text, re.MULTILINE)
    pages = {path.stem for path in (ROOT / "docs/changes").glob("*.md")}
    assert set(versions) == pages
    for version in versions:
        assert f"(docs/changes/{version}.md)" in text


def test_contributing_tells_the_layers_as_the_contract_has_them():
    rows = re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|", read("CONTRIBUTING.md"), re.MULTILINE)
    told = [re.findall(r"`(\w+)`", row) for row in rows]
    contracts = SETTINGS["tool"]["importlinter"]["contracts"]
    layers = next(c for c in contracts if c["type"] == "layers")["layers"]
    held = [[name.strip(" ()") for name in row.split("|")] for row in layers]
    assert told == [row for row in held if row != ["__main__"]]


def test_files_of_tests_have_names_of_their_own():
    """They are modules without packages: of two of one name the second is not imported."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


def test_tests_near_a_file_are_those_that_import_it():
    pytest.importorskip("grimp")
    near = runpy.run_path(str(ROOT / ".ci/test-near"))["near"]

    def names(*files: str) -> set[str]:
        return {str(path.relative_to(ROOT / "tests")) for path in near(list(files))}

    found = names("impactfem/report/prefixes.py")
    assert "report/test_prefixes.py" in found
    assert not any(name.startswith("exact/") for name in found)
    assert names("tests/setup/test_hygiene.py") == {"setup/test_hygiene.py"}
    assert "docs/test_check_links.py" in names("docs/index.md")
    assert "report/test_page.py" in names("impactfem/report/page/page.css")
    assert "setup/test_version.py" in names("Makefile")
