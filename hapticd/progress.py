"""A progress bar on standard error, where somebody looks at it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial


@contextmanager
def progress_bar(total: float, what: str = "", width: int = 1) -> Iterator[Callable[..., None]]:
    """Show how much of something is done, and how much time has gone and is left.

    Args:
        total: all of it, in any unit.
        what: is being done.
        width: room for that, where it changes.

    Yields:
        what is to be told: `completed=` or `advance=` in that unit, and `description=` when something else is done.
    """
    if not sys.stderr.isatty():
        yield lambda **_: None
        return
    # Takes longer to import than most of what needs no bar.
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    times = (TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn())
    columns = (TextColumn(f"{{task.description:{width}}}"), BarColumn(), *times)
    with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
        yield partial(shown.update, shown.add_task(what, total=total))
