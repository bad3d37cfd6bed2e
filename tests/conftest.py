"""Tests run as long as the time lasts, where one is given (`.ci/test`), and each once if asked.

Slow ones run to the first limit, all to the second.
"""

import gc
import os
import sys
import time
from pathlib import Path

import pytest

SLOW = Path(__file__).with_name("verification")


def pytest_addoption(parser):
    parser.addoption("--once", action="store_true", help="of each test only its first case")


@pytest.hookimpl(trylast=True)  # behind the choice by marks and words
def pytest_collection_modifyitems(config, items):
    if not config.getoption("--once"):
        return
    seen, kept, others = set(), [], []
    for item in items:
        test = item.nodeid.partition("[")[0]
        (others if test in seen else kept).append(item)
        seen.add(test)
    config.hook.pytest_deselected(items=others)
    items[:] = kept


gc.disable()  # while tests are collected, and nothing is to be given back
# Rewriting their assertions is half of it: kept, even where Python may write no bytecode.
WRITES_NONE, sys.dont_write_bytecode = sys.dont_write_bytecode, False


def pytest_collection_finish():
    """What lives to the end, of all tests and of libraries, is not searched for circles again."""
    sys.dont_write_bytecode = WRITES_NONE
    gc.collect()
    gc.freeze()
    gc.enable()


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
