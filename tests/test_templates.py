"""The templates of docs/examples/mylab run green as they are, for a stranger who has only the wheel."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

MYLAB = Path(__file__).parent.parent / "docs" / "examples" / "mylab"
CONFIG = """
[device]
driver = "mylab.{driver}"
accept_no_watchdog = true
[device.options]
port = "/dev/nothing"
[controller]
law = "mylab.my_law"
[safety]
max_force_n = 2.0
"""


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """A folder of the stranger's own, with a copy of the templates."""
    shutil.copytree(MYLAB, tmp_path / "mylab", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def run(installed: Path, elsewhere: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python there, with the wheel and that folder."""
    environment = {**os.environ, "PYTHONPATH": f"{installed}{os.pathsep}{elsewhere}", "COLUMNS": "200"}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=elsewhere, env=environment, capture_output=True, text=True, check=False)


def test_their_tests_pass_and_none_is_skipped(installed: Path, elsewhere: Path) -> None:
    where = f"def test_where(): assert __import__('hapticd').__file__.startswith({str(installed)!r})"
    (elsewhere / "mylab" / "test_where.py").write_text(where)
    done = run(installed, elsewhere, "-m", "pytest", "-q", "-W", "error", "mylab")
    assert done.returncode == 0, done.stdout
    counts = done.stdout.splitlines()[-1]
    assert "passed" in counts
    assert "skipped" not in counts


@pytest.mark.parametrize("driver", ["my_driver", "my_driver.MyRig"])
def test_a_configuration_names_both_by_their_modules(installed: Path, elsewhere: Path, driver: str) -> None:
    (elsewhere / "lab.toml").write_text(CONFIG.format(driver=driver))
    done = run(installed, elsewhere, "-m", "hapticd", "check", "lab.toml")
    assert done.returncode == 0, done.stderr
    assert f"mylab.{driver}" in done.stdout


def test_each_has_its_types(installed: Path, elsewhere: Path) -> None:
    checked = [f"mylab/{name}.py" for name in ("my_law", "my_driver")]
    environment = {**os.environ, "MYPYPATH": f"{installed}{os.pathsep}{elsewhere}"}
    arguments = [
        "--strict",
        "--ignore-missing-imports",
        "--explicit-package-bases",
        "--follow-imports=silent",
        "--cache-dir",
        str(elsewhere / "cache"),
    ]
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *arguments, *checked],
        cwd=elsewhere, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
