"""Tests run as long as the time lasts, where one is given (`.ci/test`).

Slow ones run to the first limit, all to the second.
"""

import os
import time
from pathlib import Path

import pytest

SLOW = Path(__file__).with_name("verification")


def is_over(until):
    """Whether a time has passed; of several ranks the first one tells, or they would wait."""
    over = time.time() > float(until)
    if "RANK_LOGS" not in os.environ:  # which `.ci/test` gives to ranks
        return over
    from mpi4py import MPI

    return MPI.COMM_WORLD.bcast(over)


def pytest_runtest_setup(item):
    slow = item.get_closest_marker("slow") or SLOW in item.path.parents
    for limit, meant in (("TEST_DEADLINE", slow), ("TEST_END", True)):
        until = os.environ.get(limit)
        if until and meant and is_over(until):
            pytest.skip(f"the time is up ({limit})")
