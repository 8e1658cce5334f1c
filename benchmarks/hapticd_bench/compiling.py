"""C programs that a benchmark compares with, compiled when they are needed."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from hapticd.errors import HapticdError


def compile_c(source: Path, target: Path, *arguments: str | Path) -> Path:
    """Compile a C source with -O2.

    Args:
        source: the file; an error names it.
        target: what to make of it.
        arguments: more options, sources and libraries for the compiler.

    Returns:
        The target.

    Raises:
        HapticdError: there is no compiler, or it refuses.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        raise HapticdError("no C compiler: install one (Debian: apt install gcc), or name it in $CC")
    built = subprocess.run(
        [compiler, "-O2", "-o", target, source, *arguments], capture_output=True, text=True, check=False
    )
    if built.returncode:
        raise HapticdError(f"{compiler} cannot compile {source}: {built.stderr.strip()}")
    return target
