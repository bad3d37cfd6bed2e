"""What `impactfem doctor` finds wrong."""

import sys

import pytest

from impactfem import doctor


def rows() -> tuple[dict[str, str], list[str]]:
    found, faults = doctor.examine()
    return dict(found), faults


@pytest.fixture(autouse=True)
def _no_drawing(monkeypatch):
    monkeypatch.setattr(doctor, "_rendering", lambda: "not tried")


def test_a_form_cache_that_cannot_be_written_is_a_fault(monkeypatch, tmp_path):
    pytest.importorskip("dolfinx")
    occupied = tmp_path / "file"
    occupied.write_text("no folder")
    monkeypatch.setattr("impactfem.fem.form_cache", lambda: occupied / "fenics")
    _, faults = rows()
    assert len(faults) == 1
    assert str(occupied) in faults[0]
    assert "set XDG_CACHE_HOME" in faults[0]


def test_caches_and_the_page_are_named(monkeypatch, tmp_path):
    pytest.importorskip("dolfinx")
    monkeypatch.setattr("impactfem.fem.form_cache", lambda: tmp_path)
    found, _ = rows()
    assert found["cache of forms"] == f"{tmp_path}, empty"
    assert found["cache of loops"]
    assert found["report.html"].startswith("can be written")


def test_a_package_without_the_parts_of_the_page_is_a_fault(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "_PAGE", tmp_path)
    monkeypatch.setattr(doctor, "_finite_elements", lambda _: [])
    found, faults = rows()
    assert found["report.html"] == "cannot be written"
    assert any(".css, .gz, .html, .js: reinstall" in fault for fault in faults)


def test_missing_headers_of_python_are_a_fault(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor.sysconfig, "get_path", lambda _: str(tmp_path))
    monkeypatch.setattr(doctor, "_finite_elements", lambda _: [])
    _, faults = rows()
    assert any("Python.h" in fault and "python3-dev" in fault for fault in faults)


def test_without_dolfinx_it_says_what_works_and_what_to_install(monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "dolfinx"]:
        monkeypatch.delitem(sys.modules, name)
    for name in [name for name in sys.modules if name.startswith("impactfem.fem")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "dolfinx", None)
    found, faults = rows()
    assert "points, rods and beams need none" in found["dolfinx"]
    assert any("pip install impactfem[fem]" in fault for fault in faults)
    assert found["cache of forms"] == "none"


def test_another_mpirun_on_the_path_is_told_from_the_own_one(monkeypatch, tmp_path):
    for folder in ("own", "other"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "mpirun").write_text("#!/bin/sh\n")
        (tmp_path / folder / "mpirun").chmod(0o755)
    own, other = tmp_path / "own", tmp_path / "other"
    monkeypatch.setattr(sys, "executable", str(own / "python"))
    monkeypatch.setenv("PATH", str(other))
    assert doctor._mpirun() == f"{own}/mpirun (not {other}/mpirun, the first on PATH)"
    monkeypatch.setenv("PATH", str(own))
    assert doctor._mpirun() == f"{own}/mpirun"
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    monkeypatch.setenv("PATH", str(other))
    assert doctor._mpirun() == f"{other}/mpirun"
