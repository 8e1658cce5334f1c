"""`import hapticd` is the front door: it costs nothing until it is used, and a type checker sees what is behind it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import hapticd

HEAVY = {"numpy", "pydantic", "zmq", "msgpack", "typer", "matplotlib", "numba", "tomlkit", "asyncio"}
USER = """
import hapticd

config = hapticd.load("wall-12.toml").with_values({"scene.walls[0].stiffness_n_per_m": 15e3})
run: hapticd.Run = hapticd.simulate(config, duration_s=2)
deepest_m: float = float(run.x_m.min())
words: str = run.outcome.words
settled: bool = run.outcome is hapticd.Outcome.SETTLED
run.plot().savefig("run.png")
grid: hapticd.Grid = hapticd.sweep(config, "scene.walls[0].stiffness_n_per_m", [1e4, 2e4], laws=["none", "tdpa"])
first_s: float = float(grid.settled_s[0, 1])
"""


def python(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], cwd=cwd, capture_output=True, text=True, check=False)


def test_import_hapticd_brings_nothing_along(tmp_path: Path) -> None:
    before = "import sys; before = set(sys.modules); import hapticd; "
    done = python("-c", f"{before}print(*sorted(set(sys.modules) - before))", cwd=tmp_path)
    found = done.stdout.split()
    assert "hapticd" in found
    assert [name for name in found if name.startswith("hapticd.")] == ["hapticd.version"]
    assert not HEAVY & set(found)


@pytest.mark.parametrize("use", ["hapticd.load", "hapticd.simulate", "hapticd.sweep", "hapticd.simulate(TEXT, 0.1)"])
def test_what_is_offline_imports_neither_numpy_nor_sockets(tmp_path: Path, use: str) -> None:
    use = use.replace("TEXT", repr("[device.options]\nmass_kg = 0.3\n"))
    done = python("-c", f"import sys, hapticd; {use}; print(*sys.modules)", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert not {"numpy", "zmq", "numba", "matplotlib", "hapticd.supervisor"} & set(done.stdout.split())


def test_simulate_to_a_csv_imports_no_numpy(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text("[device.options]\nmass_kg = 0.3\n")
    script = (
        "import sys\nfrom hapticd.cli import main\n"
        'try: main(["simulate", "-c", "lab.toml", "-d", "0.1", "-o", "run.csv"])\n'
        'except SystemExit as left: print("left", left.code or 0, "numpy" in sys.modules)'
    )
    done = python("-c", script, cwd=tmp_path)
    assert "left 0 False" in done.stdout, done.stdout + done.stderr


def test_every_name_of_the_front_door_is_told_and_no_other_is_there() -> None:
    assert set(hapticd.__all__) <= set(dir(hapticd))
    assert hapticd.load("[loop]\nrate_hz = 2000.0\n").config.loop.rate_hz == 2000.0
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        getattr(hapticd, "simulat")  # noqa: B009 - a checker would refuse the attribute


def test_a_users_file_passes_the_strictest_checks_and_a_wrong_one_does_not(tmp_path: Path) -> None:
    (tmp_path / "user.py").write_text(USER)
    done = python("-m", "mypy", "--strict", "user.py", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    (tmp_path / "wrong.py").write_text("import hapticd\nhapticd.simulat(2)\nhapticd.simulate(2)\n")
    done = python("-m", "mypy", "--strict", "wrong.py", cwd=tmp_path)
    assert '"simulat"' in done.stdout
    assert 'incompatible type "int"' in done.stdout
