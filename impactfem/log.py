"""Messages to the person at the terminal: once, on rank 0, and silent when asked.

Programs get them through the logger "impactfem": messages as INFO, stages as DEBUG.
"""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from impactfem.errors import plain
from impactfem.first_use import count_to

LOGGER = logging.getLogger("impactfem")
"""All that the package has to say while it works; it sets no handlers and no level."""


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
        if not (self.enabled and sys.stderr.isatty()):
            yield self
            return
        from tqdm import tqdm  # noqa: PLC0415  (loaded only where a bar is seen)

        bar = tqdm(
            total=total,
            file=sys.stderr,
            leave=False,
            bar_format="{desc:<40} {bar:20} {elapsed}",
        )
        self._bar = bar
        count_to(self.note)
        try:
            yield self
        finally:
            count_to(None)
            bar.close()
            self._bar = None

    def step(self, what: str) -> None:
        """Name the stage that starts now."""
        LOGGER.debug("%s", what)
        if self._bar is not None:
            self._bar.set_description_str(what)
            self._bar.update(1)

    def note(self, what: str) -> None:
        """Name what happens inside the present stage."""
        if self._bar is not None:
            self._bar.set_description_str(what)

    def message(self, text: str) -> None:
        """Log one line, warnings included; where enabled it goes to standard error."""
        LOGGER.info("%s", plain(text))
        if not self.enabled:
            return
        if self._bar is None:
            print(plain(text), file=sys.stderr)
        else:  # above the bar
            self._bar.write(plain(text), file=sys.stderr)
