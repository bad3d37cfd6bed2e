"""SIGINT and SIGTERM: an end in order, and short blocks that they must not cut in two."""

import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, NoReturn

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


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
    """Have SIGINT and SIGTERM raise `InterruptedRunError`, once; a finalizer cannot swallow it."""
    for number in _SIGNALS:
        signal.signal(number, _interrupt)
    sys.unraisablehook = _unraisable


def _interrupt(number: int, _: object) -> NoReturn:
    # A second signal must not disturb the cleaning up after the first.
    for each in _SIGNALS:
        signal.signal(each, signal.SIG_IGN)
    raise InterruptedRunError(number)


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
    elif signal.getsignal(_SIGNALS[0]) is not signal.SIG_IGN:
        sys.__unraisablehook__(raised)
    # else: an object that the signal left half made, of a run that says so and ends


@contextmanager
def held_back() -> Iterator[None]:
    """Let signals wait until a short block is done."""
    if threading.current_thread() is not threading.main_thread():
        yield  # Python handles signals in the main thread only
        return
    held: list[int] = []
    usual = {
        number: signal.signal(number, lambda number, _: held.append(number)) for number in _SIGNALS
    }
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
