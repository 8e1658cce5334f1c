"""A study run block by block with a progress bar; each block is kept as soon as it is done."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from hapticd.errors import HapticdError
from hapticd_studies.grid.job import Job, code_digest
from hapticd_studies.grid.journal import Journal, Row


class InterruptedStudyError(HapticdError):
    """Stopped by the user; what was done is kept."""

    exit_code = 130


@contextmanager
def kept(job: Job, path: Path, fresh: bool = False) -> Iterator[Journal]:
    """The journal of a study: removed when all went well, else left for the next time.

    Args:
        job: the study.
        path: the journal's file, beside the output.
        fresh: forget what was done before.
    """
    spec = json.dumps(job.spec, sort_keys=True)
    journal = Journal(path, hashlib.sha256((code_digest(job.laws) + spec).encode()).hexdigest(), fresh)
    try:
        yield journal
        journal.remove()
    except KeyboardInterrupt:
        done = sum(job.sizes[block] for block in journal.done)
        raise InterruptedStudyError(
            f"interrupted: {done} of {sum(job.sizes)} cells are kept in {path}; the same command goes on from there"
        ) from None
    finally:
        journal.close()


def run(job: Job, journal: Journal, label: str, cluster: str | None = None) -> list[list[Row]]:
    """Do what is not done yet.

    Args:
        job: the study.
        journal: what is done; gets every block as it is finished.
        label: what the progress bar says.
        cluster: address of a dask scheduler whose workers do it; None: this machine, all cores.

    Returns:
        The rows of each block.

    Raises:
        HapticdError: the cluster cannot be used.
    """
    left = [block for block in range(len(job.sizes)) if block not in journal.done]
    with _progress(label, sum(job.sizes), sum(job.sizes[block] for block in journal.done)) as advance:
        for block, rows in _blocks(job, left, cluster):
            journal.keep(block, rows)
            advance(job.sizes[block])
    return [journal.done[block] for block in range(len(job.sizes))]


def _blocks(job: Job, left: Sequence[int], cluster: str | None) -> Iterator[tuple[int, list[Row]]]:
    if cluster is not None and left:
        from hapticd_studies.grid.cluster import blocks  # an extra of its own

        yield from blocks(cluster, job, left)
    elif job.interpreted and left:
        from hapticd_studies.grid.processes import blocks_in_processes

        yield from blocks_in_processes(job, left)
    else:
        for block in left:
            yield block, job.work(job.spec, block, None)


@contextmanager
def _progress(label: str, total: int, done: int) -> Iterator[Callable[[int], None]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("cells"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as shown:
        task = shown.add_task(label, total=total, completed=done)
        yield lambda cells: shown.advance(task, cells)
