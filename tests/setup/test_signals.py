"""A signal that comes while Python makes or finalizes an object."""

import signal
import subprocess
import sys

import pytest

HALF_MADE = """
class Bar:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.closed = False
    def __del__(self):
        self.closed or print("closed")
try:
    Bar()
except signals.InterruptedRunError as error:
    print("interrupted by", error.number)
"""
FINALIZER = """
class Bar:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
try:
    Bar()
    time.sleep(60)
except signals.InterruptedRunError as error:
    print("interrupted by", error.number)
"""


@pytest.mark.parametrize("program", [HALF_MADE, FINALIZER])
def test_no_signal_is_lost_and_no_half_made_object_speaks(program):
    start = "import signal, time\nfrom impactfem import signals\nsignals.listen()\n"
    done = subprocess.run(
        [sys.executable, "-c", start + program], capture_output=True, text=True, timeout=30,
        check=False,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == (f"interrupted by {int(signal.SIGINT)}\n", "")


def test_other_faults_of_finalizers_are_told():
    program = (
        "from impactfem import signals\nsignals.listen()\n"
        "class Bar:\n    def __del__(self):\n        raise ValueError('lost')\nBar()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert "ValueError: lost" in done.stderr
