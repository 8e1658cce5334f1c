"""What a command of views needs beside the core, said in one line when it is not installed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hapticd.errors import HapticdError


@contextmanager
def record_and_figures() -> Iterator[None]:
    """Imports of recordings and figures, which the overview of all commands does without.

    Raises:
        HapticdError: an extra is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        raise HapticdError(f"plots need {error.name}: pip install 'hapticd[study,record]'") from None
