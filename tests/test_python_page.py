"""docs/python.md does what it says: each section is run, from the wheel and outside the checkout, as its reader would.

A section that connects to a daemon finds one, on the shipped configuration or on one of its own that other programs
drive.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.daemon.running import Daemon
from tests.page_blocks import Block, program, sections

ROOT = Path(__file__).parent.parent
SECTIONS = sections((ROOT / "docs" / "python.md").read_text())


def follow(blocks: list[Block], installed: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    """Do what a section says, in an empty folder."""
    source, given = program(blocks)
    environment = {**os.environ, "PYTHONPATH": str(installed), "COLUMNS": "120", "MPLBACKEND": "agg"}
    with contextlib.ExitStack() as stack:
        if any("hapticd.connect(" in block.text for block in blocks):
            driven = [block.text for block in blocks if "[[scene.couplings]]" in block.text]
            config = driven[0] if driven else (ROOT / "config" / "hapticd.toml").read_text()
            daemon = Daemon(config, pythonpath=installed)
            stack.enter_context(daemon).wait_ready()
            environment["HAPTICD_RUNTIME_DIR"] = str(daemon.directory / "run")
        return subprocess.run(
            [sys.executable, "-c", source],
            input=given, cwd=folder, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip


@pytest.mark.parametrize("title", SECTIONS)
def test_a_section_does_what_it_says(title: str, installed: Path, tmp_path: Path) -> None:
    done = follow(SECTIONS[title], installed, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


def test_it_is_run_from_the_wheel(installed: Path, tmp_path: Path) -> None:
    where = Block("python", "import hapticd, hapticd_drivers\nraise SystemExit(hapticd.__file__)\n", 1)
    assert str(installed) in follow([where], installed, tmp_path).stderr


@pytest.mark.parametrize(
    ("block", "said"),
    [
        (Block("python", "x = 1\nassert x == 2\n", 7), 'docs/python.md", line 8'),
        (Block("python", "print(1 + 1)  # 3\n", 7), "['3'] is not what is printed"),
        (Block("console", "$ hapticd check nothing.toml\n", 7), "docs/python.md:7: hapticd check nothing.toml: exit 2"),
    ],
)
def test_a_page_that_is_wrong_is_named_by_its_line(block: Block, said: str, installed: Path, tmp_path: Path) -> None:
    done = follow([block], installed, tmp_path)
    assert done.returncode != 0
    assert said in done.stderr


def test_blocks_are_read_by_section_with_their_lines() -> None:
    page = "# T\n## A\n```python\n# lab/a.py\nx\n```\ntext\n```sh\n## no heading\n```\n## B\n"
    assert sections(page) == {"A": [Block("python", "# lab/a.py\nx\n", 4), Block("sh", "## no heading\n", 9)], "B": []}
