"""Code that lies in the working directory is none of the daemon's, whichever way it was started."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.daemon.running import HAPTICD, Daemon

SHADOWED = ("msgpack", "zmq", "typer", "pydantic", "hid", "serial", "usb", "rich", "cobs", "tomlkit")


@pytest.fixture
def trap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory in which every module of the daemon's is another, which leaves a trace and ends."""
    sprung = tmp_path / "sprung"
    for name in SHADOWED:
        (tmp_path / f"{name}.py").write_text(f"open({str(sprung)!r}, 'a').write({name!r})\nraise SystemExit(9)\n")
    monkeypatch.chdir(tmp_path)
    return sprung


def test_no_process_of_the_daemon_imports_from_the_working_directory(trap: Path) -> None:
    """S5: a `msgpack.py` there ran as root in the loop and in the helper that takes the force away."""
    with Daemon("") as daemon:
        daemon.wait_ready()
        assert not trap.exists(), trap.read_text()
        assert "no helper" not in daemon.output()


@pytest.mark.parametrize(
    "command",
    [
        [HAPTICD, "devices"],
        [HAPTICD, "doctor"],
        [sys.executable, "-m", "hapticd", "check"],
        [sys.executable, "-m", "hapticd", "devices"],
    ],
    ids=lambda command: " ".join(command[-2:]),
)
def test_no_command_imports_from_the_working_directory(trap: Path, command: list[str]) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert not trap.exists(), f"{trap.read_text()}: {done.stderr}"
    assert done.returncode != 9
