"""Messages to the person at the terminal: once, on rank 0, and silent when asked."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from tqdm import tqdm

from impactfem.errors import plain


@dataclass
class Progress:
    """Says what a run is doing; draws a bar on a terminal only.

    Args:
        enabled: False silences it (``--quiet``, or a rank other than 0).
    """

    enabled: bool = False
    _bar: Any = field(default=None, init=False, repr=False)

    @contextmanager
    def stages(self, total: int) -> Iterator["Progress"]:
        """Show a bar of ``total`` stages; ``step`` advances it."""
        # disable=None: tqdm itself is silent when stderr is not a terminal.
        bar = tqdm(
            total=total,
            disable=None if self.enabled else True,
            file=sys.stderr,
            leave=False,
            bar_format="{desc:<40} {bar:20} {elapsed}",
        )
        self._bar = bar
        try:
            yield self
        finally:
            bar.close()
            self._bar = None

    def step(self, what: str) -> None:
        """Name the stage that starts now."""
        if self._bar is not None:
            self._bar.set_description_str(what)
            self._bar.update(1)

    def note(self, what: str) -> None:
        """Name what happens inside the present stage."""
        if self._bar is not None:
            self._bar.set_description_str(what)

    def message(self, text: str) -> None:
        """Print one line, warnings included, to standard error."""
        if self.enabled:
            tqdm.write(plain(text), file=sys.stderr)
