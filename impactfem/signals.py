"""SIGINT and SIGTERM: an end in order, and short blocks that they must not cut in two."""

import signal
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
    """Have SIGINT and SIGTERM raise `InterruptedRunError`, once."""
    for number in _SIGNALS:
        signal.signal(number, _interrupt)


def _interrupt(number: int, _: object) -> NoReturn:
    # A second signal must not disturb the cleaning up after the first.
    for each in _SIGNALS:
        signal.signal(each, signal.SIG_IGN)
    raise InterruptedRunError(number)


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
