"""A C program that reads as much memory as a tick: what the machine itself makes of that.

A host that takes pages from its virtual machines holds up a program that reads many of them, in C as in Python, hardly
those that find all in the processor's caches.
"""

from __future__ import annotations

import ctypes
import mmap
import tempfile
from pathlib import Path

from hapticd_bench.compiling import compile_c

PAGES = 250
"""Fewer than a tick touches: 300 to 400, as the kernel counts them in /proc/PID/smaps after /proc/PID/clear_refs."""

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
