"""Pytest plugin for where mpi-pytest is missing: registers its mark, so that tests load."""
# ruff: noqa: INP001  (loaded by name, not as part of a package)

import pytest


def pytest_configure(config: pytest.Config) -> None:
    """Register the mark ``parallel``; the caller deselects the tests that bear it."""
    config.addinivalue_line("markers", "parallel(nprocs): test for several MPI ranks")
