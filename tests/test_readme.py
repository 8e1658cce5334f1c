"""What the README shows works as it stands there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from hapticd.cli.app import COMMANDS
from tests.daemon.running import HAPTICD, Daemon

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def shown() -> list[list[str]]:
    """The hapticd command lines in code blocks, without their comments."""
    lines = re.findall(r"^\.venv/bin/hapticd (.*)$", README, flags=re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


def test_every_command_and_file_that_it_names_is_there() -> None:
    assert len(shown()) >= 6
    for command in shown():
        assert command[0] in {*COMMANDS, "study", "bench"}
        for word in command:
            assert not word.startswith("config/") or (ROOT / word).is_file()
    for target in re.findall(r"\]\((docs/[^)]*)\)", README):
        assert (ROOT / target).exists(), target


def test_the_simulation_that_it_shows_runs(tmp_path: Path) -> None:
    command = next(command for command in shown() if command[0] == "simulate")
    command = [str(ROOT / word) if word.startswith("config/") else word for word in command]
    subprocess.run([HAPTICD, *command], cwd=tmp_path, check=True, timeout=60)
    assert (tmp_path / "run.csv").read_text().startswith("t_s,x_m,")


def test_the_subscriber_that_it_shows_prints_ticks() -> None:
    code = re.search(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert code is not None
    with Daemon((ROOT / "config" / "wall-12-energy-cycle.toml").read_text()).wait_ready() as daemon:
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run"), "PYTHONUNBUFFERED": "1"}
        subscriber = subprocess.Popen(
            [sys.executable, "-c", code[1]],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            stderr=subprocess.DEVNULL,
        )
        try:
            assert subscriber.stdout is not None
            assert any("Position(" in subscriber.stdout.readline() for _ in range(200))
        finally:
            subscriber.kill()
            subscriber.communicate()
