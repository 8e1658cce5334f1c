"""A file that the command line has to refuse."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def bad(tmp_path: Path) -> Path:
    file = tmp_path / "bad.toml"
    file.write_text("[loop]\nrate_hz = 50\n[controller]\nlaw = 'tdap'\n")
    return file
