"""A C program that reads as much memory as a tick: what the machine itself makes of that.

A host that takes pages from its virtual machines holds up whoever reads many of them, in C as in Python, but hardly
those who find all in the processor's caches.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

from hapticd.bench.compiling import compile_c
from hapticd.bench.tick.case import WARM_TICKS

PAGES = 250
"""What a tick of energy-cycle on one wall touches at least: `touched_pages` less an empty loop's."""

_REGIONS = 10
_SOURCE = Path(__file__).with_name("memory.c")


class MemoryReader:
    """Reads a byte of each of `PAGES` pages, in C.

    Raises:
        HapticdError: there is no C compiler.
    """

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory(prefix="hapticd-bench-") as place:
            library = ctypes.CDLL(str(compile_c(_SOURCE, Path(place) / "memory.so", "-shared", "-fPIC")))
        self._read_pages = library.read_pages
        self._read_pages.argtypes = [ctypes.c_void_p, ctypes.c_long]
        self._memory = mmap.mmap(-1, _REGIONS * PAGES * mmap.PAGESIZE)
        for page in range(_REGIONS * PAGES):
            self._memory[page * mmap.PAGESIZE] = page % 251  # else all are one and the same empty page
        self._start = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        self._region = 0
        self._at = self._start

    def move(self) -> None:
        """Go on to other pages: some are held up more than others."""
        self._region = (self._region + 1) % _REGIONS
        self._at = self._start + self._region * PAGES * mmap.PAGESIZE

    def __call__(self) -> None:
        """Read them."""
        self._read_pages(self._at, PAGES)


def touched_pages(run: Callable[[Callable[[int], int]], None]) -> int:
    """Pages of memory that one tick touches; 0 where the kernel does not tell.

    The counting's own are among them: what it gives for an empty loop.

    Args:
        run: runs a loop of at least `WARM_TICKS` + 2 ticks on the sleep that it is given.
    """
    try:
        clear = os.open("/proc/self/clear_refs", os.O_WRONLY)
    except OSError:
        return 0
    sums = os.open("/proc/self/smaps_rollup", os.O_RDONLY)
    ticks = touched = 0

    def sleep_until(deadline_ns: int) -> int:
        nonlocal ticks, touched
        ticks += 1
        if ticks == WARM_TICKS:
            os.write(clear, b"1")
        elif ticks == WARM_TICKS + 1:
            lines = os.pread(sums, 4096, 0).decode().splitlines()
            touched = next(int(line.split()[1]) * 1024 for line in lines if line.startswith("Referenced:"))
        return deadline_ns

    try:
        run(sleep_until)
    finally:
        os.close(clear)
        os.close(sums)
    return touched // mmap.PAGESIZE
