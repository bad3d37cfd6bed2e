"""A signal that comes while Python makes or finalizes an object."""

import signal
import subprocess
import sys
import time

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
        [sys.executable, "-c", start + program], capture_output=True, text=True, timeout=240,
        check=False,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == (f"interrupted by {int(signal.SIGINT)}\n", "")


def test_other_faults_of_finalizers_are_told():
    program = (
        "from impactfem import signals\nsignals.listen()\n"
        "class Bar:\n    def __del__(self):\n        raise ValueError('lost')\nBar()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=240, check=False
    )
    assert "ValueError: lost" in done.stderr


def ended(program, *signals, gap=0.05):
    """How a program that listens ends, and what it says, after signals some time [s] apart."""
    start = (
        "import signal, time\nfrom impactfem import signals\n"
        "signals.listen()\nprint('ready', flush=True)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", start + program], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "ready\n"
    for number in signals:
        time.sleep(gap)
        process.send_signal(number)
    out, err = process.communicate(timeout=240)
    return process.returncode, out + err


CLEANING = """
try:
    time.sleep(60)
except signals.InterruptedRunError:
    time.sleep(TIME)
    print("cleaned up")
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_is_sent_twice_at_once_is_one(number):
    assert ended(CLEANING.replace("TIME", "0.5"), number, number) == (0, "cleaned up\n")


def test_a_second_signal_kills():
    assert ended(CLEANING.replace("TIME", "60"), signal.SIGTERM, signal.SIGINT, gap=1.2) == (
        -signal.SIGINT,
        "",
    )


def test_a_signal_that_no_python_hears_will_kill():
    """Half a minute is too long for a test: how long is left, seen where Python does hear it."""
    program = (
        "signal.signal(signal.SIGTERM, lambda *_: print(signal.alarm(0)))\n"
        "signals.end_if_deaf()\ntime.sleep(1)\n"
    )
    assert ended(program, signal.SIGTERM, gap=0.3) == (0, f"{int(signal.SIGIO)}\n")


def test_what_compiled_code_makes_of_a_signal_is_one():
    program = (
        "try:\n"
        "    with signals.kept_apart():\n"
        "        try:\n            time.sleep(60)\n"
        "        except BaseException as error:\n            raise SystemError('NULL') from error\n"
        "except signals.InterruptedRunError as error:\n    print(error.number)\n"
    )
    assert ended(program, signal.SIGHUP) == (0, f"{int(signal.SIGHUP)}\n")


def test_a_run_under_nohup_outlives_its_terminal():
    program = "signal.signal(signal.SIGHUP, signal.SIG_IGN)\nsignals.listen()\ntime.sleep(0.5)\n"
    assert ended(program, signal.SIGHUP) == (0, "")
