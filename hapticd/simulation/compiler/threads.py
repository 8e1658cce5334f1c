"""Machine code over many items on all cores, in threads of Python's own: machine code lets go of the interpreter.

A parallel loop of numba's would hear no Ctrl-C until its last item is done, and would stand on whichever OpenMP
library a computer has; without one it may not even be called from two threads.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

PIECES_PER_THREAD = 4
"""Items do not all take the same time: a thread that is done early takes another. Each costs 0.2 ms to begin."""


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0))


def in_threads(
    code: Callable[..., None],
    count: int,
    *arguments: Any,
    workers: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Run items 0 to `count`, piece by piece; an interrupt waits for the pieces that are being run and no others.

    Args:
        code: compiled with `OPTIONS`; called with the first item of a piece, the one to stop at and `arguments`. No
            item may depend on another.
        count: of the items.
        arguments: what each piece is given.
        workers: threads, no more than `cores`; None: as many as that.
        progress: told now and then how many items have been done since it was last told.

    Raises:
        Exception: what `code` has raised.
    """
    if not count:
        return
    threads = min(workers or cores(), cores(), count)
    size = -(-count // (threads * PIECES_PER_THREAD))
    with ThreadPoolExecutor(threads) as pool:
        firsts = range(0, count, size)
        pieces = [pool.submit(code, first, min(first + size, count), *arguments) for first in firsts]
        try:
            for first, piece in zip(firsts, pieces, strict=True):
                piece.result()
                if progress:
                    progress(min(size, count - first))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
