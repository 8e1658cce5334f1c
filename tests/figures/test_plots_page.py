"""docs/plots.md does what it says: each Python block runs by itself, on shipped walls under the names that it uses."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.page_blocks import Block, sections

ROOT = Path(__file__).parents[2]
BLOCKS = [
    block
    for blocks in sections((ROOT / "docs" / "plots.md").read_text()).values()
    for block in blocks
    if block.language == "python"
]


@pytest.mark.parametrize("block", BLOCKS, ids=[f"line-{block.line}" for block in BLOCKS])
def test_a_block_runs_by_itself(block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for stiffness in (12, 18, 20):
        shutil.copy(ROOT / "config" / f"wall-{stiffness}-energy-cycle.toml", tmp_path / f"wall-{stiffness}.toml")
    monkeypatch.chdir(tmp_path)
    source = "\n" * (block.line - 1) + block.text  # a traceback then names the page's own line
    exec(compile(source, "docs/plots.md", "exec"), {"__name__": "__main__"})
    written = sorted(path for path in tmp_path.iterdir() if path.suffix != ".toml")
    assert written
    for path in written:
        start = path.read_bytes()[:5]
        assert {".png": start[1:4] == b"PNG", ".pdf": start == b"%PDF-", ".svg": True}[path.suffix]
        if path.suffix == ".svg":
            ElementTree.parse(path)


def test_it_has_blocks_to_run() -> None:
    assert len(BLOCKS) >= 2
