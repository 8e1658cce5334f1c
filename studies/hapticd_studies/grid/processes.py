"""Blocks of interpreted work, one a process, on every processor that this process may use."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool

from hapticd.errors import HapticdError
from hapticd_studies.grid.job import Job
from hapticd_studies.grid.journal import Row


def blocks_in_processes(job: Job, wanted: Sequence[int]) -> Iterator[tuple[int, list[Row]]]:
    """Do blocks side by side; they come as they are finished.

    An interrupt of the terminal reaches every process and ends it; one of this process alone waits for what runs.

    Args:
        job: the study.
        wanted: numbers of the blocks.

    Raises:
        HapticdError: a process died, as for want of memory.
    """
    workers = min(len(os.sched_getaffinity(0)), len(wanted))
    context = multiprocessing.get_context("spawn")  # threads of this process may hold locks that a fork would keep
    pool = ProcessPoolExecutor(workers, context, initializer=_end_by_interrupt)
    try:
        waiting: dict[Future[list[Row]], int] = {pool.submit(job.work, job.spec, block, 1): block for block in wanted}
        for future in as_completed(waiting):
            yield waiting.pop(future), future.result()
    except BrokenProcessPool as error:
        raise HapticdError(
            f"a process of the study died: {error}; finished cells are kept, the same command goes on from there"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _end_by_interrupt() -> None:
    """End without a traceback: who started this process says what there is to say."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
