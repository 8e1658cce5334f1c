"""A study cut into blocks, run block by block with a progress bar, each block kept as soon as it is done."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import hapticd
from hapticd import registry
from hapticd.contracts.errors import HapticdError
from hapticd.study.grid.journal import Journal, Row

Work = Callable[[Any, int, int | None], list[Row]]
"""What a block is made by: settings, number of the block, threads to use -> one row a cell.

It must be a function of a module, so that a process elsewhere finds it, and its rows depend on nothing else.
"""


@dataclass(frozen=True, slots=True)
class Job:
    """A study cut into blocks.

    Attributes:
        work: makes the rows of a block.
        spec: the settings, of JSON's types.
        sizes: how many cells each block has.
        laws: the laws whose source decides about the results.
    """

    work: Work
    spec: dict[str, Any]
    sizes: tuple[int, ...]
    laws: tuple[str, ...]


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


def block_sizes(cells: int, most: int) -> tuple[int, ...]:
    """Cut cells into blocks of about equal size, for `block_cells` to share out."""
    blocks = -(-cells // most)
    return tuple(len(range(block, cells, blocks)) for block in range(blocks))


def block_cells(sizes: Sequence[int], block: int) -> range:
    """The cells of a block: every so many, so that all blocks see the same mixture and take the same time."""
    return range(block, sum(sizes), len(sizes))


def in_order(sizes: Sequence[int], blocks: Sequence[list[Row]]) -> list[Row]:
    """Rows of all cells, in the order of the cells."""
    rows: list[Row] = [[]] * sum(sizes)
    for block, found in enumerate(blocks):
        for cell, row in zip(block_cells(sizes, block), found, strict=True):
            rows[cell] = row
    return rows


@lru_cache(maxsize=8)
def code_digest(laws: tuple[str, ...]) -> str:
    """A hash of every source that may decide about the results: all of hapticd's, and the laws'."""
    package = Path(hapticd.__file__).parent
    found = [(str(file.relative_to(package)), file.read_bytes()) for file in sorted(package.rglob("*.py"))]
    found += [(law, Path(inspect.getfile(registry.law(law))).read_bytes()) for law in sorted(laws)]
    digest = hashlib.sha256(hapticd.__version__.encode())
    for name, source in found:
        digest.update(f"\0{name}\0{len(source)}\0".encode() + source)
    return digest.hexdigest()


def _blocks(job: Job, left: Sequence[int], cluster: str | None) -> Iterator[tuple[int, list[Row]]]:
    if cluster is None:
        for block in left:
            yield block, job.work(job.spec, block, None)
    elif left:
        from hapticd.study.grid.cluster import blocks  # an extra of its own

        yield from blocks(cluster, job, left)


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
