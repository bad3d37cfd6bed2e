"""The version comes from the tags of the repository, and everything that names it agrees."""

import importlib.metadata
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import impactfem

ROOT = Path(__file__).parents[2]


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def git(*arguments: str, cwd: Path) -> str:
    who = ("-c", "user.name=n", "-c", "user.email=n@example.org", "-c", "commit.gpgsign=false")
    return run("git", *who, *arguments, cwd=cwd)


@pytest.fixture
def source(tmp_path):
    """A repository with the build settings of this one and a commit, but no tag."""
    pytest.importorskip("setuptools_scm")
    if shutil.which("git") is None:
        pytest.skip("no git")
    folder = tmp_path / "source"
    folder.mkdir()
    for name in ("pyproject.toml", ".git_archival.txt", ".gitattributes"):
        shutil.copy(ROOT / name, folder)
    git("init", "--quiet", cwd=folder)
    git("add", ".", cwd=folder)
    git("commit", "--quiet", "-m", "first", cwd=folder)
    return folder


def version(folder: Path) -> str:
    return run(sys.executable, "-m", "setuptools_scm", cwd=folder).splitlines()[-1]


def test_a_tag_is_the_version_and_commits_behind_it_are_counted(source):
    git("tag", "v1.2.3", cwd=source)
    assert version(source) == "1.2.3"
    git("commit", "--quiet", "--allow-empty", "-m", "second", cwd=source)
    commit = git("rev-parse", "--short=7", "HEAD", cwd=source)
    assert version(source).startswith(f"1.2.4.dev1+g{commit}")


def test_a_release_candidate_is_a_version(source):
    git("tag", "v2.0rc1", cwd=source)
    assert version(source) == "2.0rc1"


def test_without_a_tag_it_is_a_development_version(source):
    assert ".dev1+g" in version(source)


def test_an_archive_of_the_source_knows_its_version(source, tmp_path):
    git("tag", "v1.2.3", cwd=source)
    git("archive", "--output", str(tmp_path / "source.tar"), "HEAD", cwd=source)
    archive = tmp_path / "archive"
    shutil.unpack_archive(tmp_path / "source.tar", archive, filter="data")
    assert version(archive) == "1.2.3"


def test_an_archive_of_a_source_without_tags_has_a_development_version(source, tmp_path):
    git("archive", "--output", str(tmp_path / "source.tar"), "HEAD", cwd=source)
    shutil.unpack_archive(tmp_path / "source.tar", tmp_path / "archive", filter="data")
    assert version(tmp_path / "archive").endswith(".dev0")


def test_an_editable_install_is_seen_by_type_checkers(source, tmp_path):
    """They read the folders that .pth files name, and run no code of a finder."""
    (source / "impactfem").mkdir()
    (source / "impactfem/__init__.py").touch()
    for name in ("README.md", "LICENSE", "LICENSE.GPL"):
        (source / name).touch()
    build = "import sys; from setuptools.build_meta import build_editable as b; b(sys.argv[1])"
    run(sys.executable, "-c", build, str(tmp_path), cwd=source)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        (path,) = [name for name in file.namelist() if name.endswith(".pth")]
        assert Path(file.read(path).decode().strip()).resolve() == source.resolve()


def test_a_shallow_clone_without_tags_is_a_development_version(source, tmp_path):
    git("commit", "--quiet", "--allow-empty", "-m", "second", cwd=source)
    clone = ("clone", "--quiet", "--depth", "1", "--no-tags", source.as_uri(), "shallow")
    git(*clone, cwd=tmp_path)
    assert ".dev1+g" in version(tmp_path / "shallow")


def test_a_bare_copy_has_a_development_version(source):
    shutil.rmtree(source / ".git")
    (source / ".git_archival.txt").unlink()
    assert version(source).endswith(".dev0")


def test_the_package_says_what_was_installed():
    assert impactfem.__version__ == importlib.metadata.version("impactfem")


def test_a_package_that_is_not_installed_has_an_unknown_version(monkeypatch):
    def missing(name):
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    assert impactfem._installed_version() == "0+unknown"


def test_changelog_citation_and_the_version_without_tags_agree():
    def named(file: str, pattern: str) -> str:
        found = re.search(pattern, (ROOT / file).read_text("utf-8"), re.MULTILINE)
        assert found is not None, file
        return found[1]

    newest = named("CHANGELOG.md", r"^## \[([0-9.]+)\]")
    assert named("CITATION.cff", r"^version: (\S+)$") == newest
    assert named("pyproject.toml", r'^fallback_version = "(.*)"$') == f"{newest}.dev0"
