"""Tests run as long as the time lasts, where one is given (`.ci/test`).

Slow ones run to the first limit, all to the second.
"""

import os
import time
from pathlib import Path

import pytest

SLOW = Path(__file__).with_name("verification")


def pytest_runtest_setup(item):
    slow = item.get_closest_marker("slow") or SLOW in item.path.parents
    for limit, meant in (("TEST_DEADLINE", slow), ("TEST_END", True)):
        until = os.environ.get(limit)
        if until and meant and time.time() > float(until):
            pytest.skip(f"the time is up ({limit})")
