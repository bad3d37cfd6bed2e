"""What commands spare themselves as they load large libraries; programs lose nothing by it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any


@contextmanager
def without(name: str) -> Iterator[None]:
    """Let what is imported meanwhile find a library missing that it can do without.

    Args:
        name: A top-level module; nothing happens if it is loaded already.
    """
    modules: dict[str, Any] = sys.modules
    if name in modules:
        yield
        return
    modules[name] = None  # as the documentation of `import` has it: ModuleNotFoundError
    try:
        yield
    finally:
        del modules[name]


def spare_signatures() -> None:
    """Let Matplotlib load without the signatures of its setters, which only help() shows.

    Writing them takes a third of its loading.
    """
    with suppress(ImportError):
        from matplotlib.artist import Artist  # noqa: PLC0415

        writes = "_update_set_signature_and_docstring"
        if hasattr(Artist, writes):  # not in every version
            setattr(Artist, writes, classmethod(lambda _: None))
