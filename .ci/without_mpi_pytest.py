"""Pytest plugin that stands in where mpi-pytest is missing: it knows the mark, so that collection succeeds."""


def pytest_configure(config):
    """Register the mark ``parallel``; the tests that bear it are deselected by the caller."""
    config.addinivalue_line("markers", "parallel(nprocs): test for several MPI ranks")
