"""The rules that the source keeps: who imports whom, no promises left open, nothing switched off without a reason."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = sorted(
    path
    for folder in (
        "hapticd",
        "drivers",
        "controllers",
        "studies",
        "benchmarks",
        "tests",
        "docs",
        "config",
        "systemd",
        ".ci",
    )
    for path in (ROOT / folder).rglob("*")
    if path.is_file() and path.suffix != ".png" and "__pycache__" not in path.parts and path != Path(__file__)
)
PYTHON = [path for path in SOURCES if path.suffix == ".py"]


def run(*command: str | Path, cwd: Path = ROOT, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


def found(pattern: str, paths: list[Path]) -> list[str]:
    """Lines that match, as `file:line: text`."""
    return [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in paths
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1)
        if re.search(pattern, line)
    ]


def test_rooms_import_only_from_below() -> None:
    done = run(Path(sys.executable).with_name("lint-imports"), "--no-cache")
    assert done.returncode == 0, done.stdout


def test_nothing_is_left_to_do_in_the_source() -> None:
    assert not found(r"\b(TODO|FIXME|XXX)\b", SOURCES)


def test_a_check_is_switched_off_only_by_name_and_with_a_reason() -> None:
    assert not found(r"#\s*noqa(?!: [A-Z]+\d+(, ?[A-Z]+\d+)* +-+ \w)", PYTHON)
    assert not found(r"#\s*type:\s*ignore(?!\[[a-z-]+(, ?[a-z-]+)*\]  # \w)", PYTHON)
    assert not found(r"#\s*(ruff: noqa|mypy:|fmt: off|pylint:|pragma:)", PYTHON)


def test_no_file_names_the_machine_it_was_written_on() -> None:
    assert not found(r"/(work|root)/|\bpyenv\b", SOURCES)


def test_an_expected_failure_is_no_test() -> None:
    assert not found(r"\bxfail\b", [path for path in PYTHON if path.name != "conftest.py"])


@pytest.mark.parametrize(("ci", "status"), [("true", 1), ("", 0)])
def test_a_skipped_test_is_a_failure_in_ci_only(tmp_path: Path, ci: str, status: int) -> None:
    shutil.copy(ROOT / "tests" / "conftest.py", tmp_path)
    (tmp_path / "test_a.py").write_text("import pytest\n\ndef test_it():\n    pytest.skip('no compiler')\n")
    (tmp_path / "test_b.py").write_text("import pytest\n\npytest.importorskip('no_such_module')\n")
    done = run(sys.executable, "-m", "pytest", "-rA", tmp_path, cwd=tmp_path, CI=ci, PYTHONPATH=str(ROOT))
    assert (done.returncode != 0) == bool(status), done.stdout
    assert done.stdout.count("skipped in CI") >= 2 * status


def test_the_wheel_holds_six_packages_and_nothing_called_drivers(installed: Path) -> None:
    packages = {path.name for path in installed.iterdir() if path.suffix != ".dist-info"}
    assert packages == {
        "hapticd",
        "hapticd_bench",
        "hapticd_controllers",
        "hapticd_drivers",
        "hapticd_studies",
        "hapticd_views",
    }


def test_the_wheel_holds_every_shipped_configuration(installed: Path) -> None:
    shipped = {path.name: path.read_bytes() for path in (ROOT / "config").glob("*.toml")}
    assert {path.name: path.read_bytes() for path in (installed / "hapticd/share/config").glob("*.toml")} == shipped


def test_an_installed_hapticd_finds_its_own_configuration_and_plugins(installed: Path, tmp_path: Path) -> None:
    """Run from the unpacked wheel, whose modules come before those of the checkout."""
    script = (
        "import hapticd, hapticd_drivers, hapticd.paths as paths\n"
        "from hapticd.cli import main\n"
        "print(hapticd.__file__, hapticd_drivers.__file__, paths.directory('config'), sep='\\n', flush=True)\n"
        "main(['check', str(paths.directory('config') / 'hapticd.toml')])\n"
    )
    done = run(sys.executable, "-c", script, cwd=tmp_path, PYTHONPATH=str(installed))
    assert done.returncode == 0, done.stderr
    *places, verdict = done.stdout.splitlines()
    assert all(place.startswith(str(installed)) for place in places)
    assert "hapticd.toml: ok" in verdict
