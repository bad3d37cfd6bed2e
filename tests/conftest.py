"""Slow tests run as long as the time lasts, where one is given (`TEST_MINUTES` of `.ci/test`)."""

import os
import time
from pathlib import Path

import pytest

SLOW = Path(__file__).with_name("verification")


def pytest_runtest_setup(item):
    until = os.environ.get("TEST_DEADLINE")
    slow = item.get_closest_marker("slow") or SLOW in item.path.parents
    if until and slow and time.time() > float(until):
        pytest.skip("the time is up (TEST_MINUTES)")
