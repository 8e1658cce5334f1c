"""The installed command, run as a shell runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from hapticd.paths import directory

HAPTICD = Path(sys.executable).with_name("hapticd")
GOOD = str(directory("config") / "hapticd.toml")


def hapticd(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [HAPTICD, *arguments], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
