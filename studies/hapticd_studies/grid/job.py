"""A study cut into blocks, each made by a function of its settings alone."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import hapticd
import hapticd_studies
from hapticd import plugins
from hapticd.version import __version__
from hapticd_studies.grid.journal import Row

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
        interpreted: the work is plain Python, so that a block keeps one processor busy and takes a process of its own.
    """

    work: Work
    spec: dict[str, Any]
    sizes: tuple[int, ...]
    laws: tuple[str, ...]
    interpreted: bool = False


def block_sizes(cells: int, most: int) -> tuple[int, ...]:
    """Cut cells into blocks of about equal size, for `block_cells` to share out."""
    blocks = -(-cells // most)
    return tuple(len(range(block, cells, blocks)) for block in range(blocks))


def block_cells(sizes: Sequence[int], block: int) -> range:
    """The cells of a block: evenly spaced, so that all blocks see the same mixture and take the same time."""
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
    """A hash of every source that may decide about the results: all of hapticd's, the studies' and the laws'."""
    found = [
        (f"{package.name}/{file.relative_to(package)}", file.read_bytes())
        for package in (Path(hapticd.__file__).parent, Path(hapticd_studies.__file__).parent)
        for file in sorted(package.rglob("*.py"))
    ]
    found += [(law, Path(inspect.getfile(plugins.law(law))).read_bytes()) for law in sorted(laws)]
    digest = hashlib.sha256(__version__.encode())
    for name, source in found:
        digest.update(f"\0{name}\0{len(source)}\0".encode() + source)
    return digest.hexdigest()
