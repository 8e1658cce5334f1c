"""The memory of both sides of the binding under valgrind, which sees reads of what was never written as well."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

PROJECT = Path(__file__).parents[3]
OURS = ("libdhd.so", "libdrd.so", "_ctypes.", "libffi.so")
"""Whose calls are judged: the interpreter's own imports and exit have findings of their own."""


def errors(fake_sdk: Path, report: Path, *arguments: str) -> list[tuple[str, list[str]]]:
    """Kind and functions of each error in whose stack the fake or the binding stands."""
    if shutil.which("valgrind") is None:
        pytest.skip("no valgrind: sudo apt install valgrind")
    run = subprocess.run(
        [
            *("valgrind", "--tool=memcheck", "--xml=yes", f"--xml-file={report}", sys.executable),
            *("-m", "tests.drivers.forcedimension.exercise", str(fake_sdk), *arguments),
        ],
        cwd=PROJECT,
        env={**os.environ, "PYTHONMALLOC": "malloc"},  # so that buffers of ctypes have guarded edges
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert (run.returncode, run.stdout) == (0, "done\n"), run.stderr
    found = []
    for error in ElementTree.parse(report).iter("error"):
        kind = error.findtext("kind") or ""
        frames = list(error.iter("frame"))
        objects = [Path(frame.findtext("obj") or "").name for frame in frames]
        # The loader reads strings in strides, and what the interpreter leaves allocated at its end is no error.
        if any(name.startswith(OURS) for name in objects) and not (
            kind.startswith("Leak_") or objects[0].startswith("ld-")
        ):
            found.append((kind, [frame.findtext("fn") or "?" for frame in frames]))
    return found


def test_a_whole_life_is_clean_under_valgrind(fake_sdk: Path, tmp_path: Path) -> None:
    assert errors(fake_sdk, tmp_path / "report.xml") == []


@pytest.mark.nightly
def test_valgrind_would_see_a_buffer_that_is_one_number_short(fake_sdk: Path, tmp_path: Path) -> None:
    found = errors(fake_sdk, tmp_path / "report.xml", "short-status")
    assert {kind for kind, _ in found} == {"InvalidWrite"}
    assert all("dhdGetStatus" in functions for _, functions in found)
