"""SIGINT, SIGTERM and SIGHUP: an end in order, and short blocks that they must not cut in two."""

import ctypes
import fcntl
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NoReturn

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_TWICE = 1.0  # s; terminals, launchers and `timeout` send one signal twice at once
_heard: list[tuple[int, float]] = []  # the signal that ends this run, and when it came


class InterruptedRunError(BaseException):
    """A signal asked the run to end; not an Exception, so that nothing swallows it.

    Attributes:
        number: The signal.
        kept: What the run leaves, in words.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number
        self.kept = "nothing was written"


def listen() -> None:
    """Have signals raise `InterruptedRunError`, once; a finalizer cannot swallow it.

    The next one, if it comes more than a second later, does what it would without us: it kills.
    """
    _heard.clear()
    for number in _SIGNALS:
        # Under `nohup` a terminal that closes is no reason to end.
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    sys.unraisablehook = _unraisable


def end_if_deaf() -> None:
    """Have this process killed half a minute after a signal for which it had no ear.

    Python's handlers wait until compiled code returns, which it never does where ranks wait for
    each other. But what is in C of them writes to a pipe at once, of which the system tells by
    SIGIO. That has number 29 and for a handler alarm(29): 29 s later SIGALRM ends the process,
    unless a handler in Python has taken it back by then.
    """
    end, begin = os.pipe()
    os.set_blocking(begin, False)
    fcntl.fcntl(end, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(end, fcntl.F_SETFL, os.O_ASYNC | os.O_NONBLOCK)
    c = ctypes.CDLL(None)
    c.signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
    c.signal.restype = ctypes.c_void_p
    c.signal(signal.SIGIO, ctypes.cast(c.alarm, ctypes.c_void_p))
    signal.set_wakeup_fd(begin, warn_on_full_buffer=False)


def _interrupt(number: int, _: object) -> NoReturn:
    signal.alarm(0)
    _heard[:] = [(number, time.monotonic())]
    for each in _SIGNALS:
        signal.signal(each, _again)
    raise InterruptedRunError(number)


def _again(number: int, _: object) -> None:
    """Leave the cleaning up after the first signal alone, but not for ever."""
    signal.alarm(0)
    if _heard and time.monotonic() - _heard[0][1] < _TWICE:
        return
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)


@contextmanager
def kept_apart() -> Iterator[None]:
    """Have a signal stay a signal, whatever compiled code makes of it on its way up.

    Raises:
        InterruptedRunError: In place of any other error after a signal.
    """
    try:
        yield
    except Exception as error:
        if _heard:
            raise InterruptedRunError(_heard[0][0]) from error
        raise


def _unraisable(raised: "sys.UnraisableHookArgs") -> None:
    """What Python cannot raise, being inside a finalizer or a callback of C."""
    error = raised.exc_value
    if isinstance(error, InterruptedRunError):
        # The signal came inside of it: ask again when the finalizer is done, of the main thread,
        # so that a call that waits there ends.
        for number in _SIGNALS:
            signal.signal(number, _interrupt)
        main = threading.main_thread().ident or 0
        again = threading.Timer(0.05, signal.pthread_kill, (main, error.number))
        again.daemon = True
        again.start()
    elif not _heard:
        sys.__unraisablehook__(raised)
    # else: an object that the signal left half made, of a run that says so and ends


@contextmanager
def held_back() -> Iterator[None]:
    """Let signals wait until a short block is done."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Python handles signals in the main thread only
        return
    held: list[int] = []

    def hold(number: int, _: object) -> None:
        signal.alarm(0)
        held.append(number)

    usual = {number: signal.getsignal(number) for number in _SIGNALS}
    _set({number: hold for number, one in usual.items() if one is not signal.SIG_IGN})
    try:
        yield
    finally:
        _set(usual)
    if held:
        signal.raise_signal(held[0])


@contextmanager
def given_back() -> Iterator[None]:
    """Have the handlers as before after a block in which a library took or reset them."""
    usual = {number: signal.getsignal(number) for number in _SIGNALS}
    yield
    if threading.current_thread() is threading.main_thread():
        _set(usual)


def _set(handlers: Mapping[signal.Signals, Any]) -> None:
    for number, handler in handlers.items():
        if handler is not None:  # None: not Python's to begin with
            signal.signal(number, handler)
