"""What README and CONTRIBUTING show is there, and works as it stands there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from hapticd.cli.app import COMMANDS
from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, Daemon

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text()


def shown() -> list[list[str]]:
    """The hapticd command lines in code blocks, without their comments."""
    lines = re.findall(r"^\.venv/bin/hapticd (.*)$", README, flags=re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


def snippets() -> list[str]:
    """The Python code that it shows, in order: a subscriber, an offline run, a law."""
    return re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_it_is_read_in_five_minutes() -> None:
    assert len(README.splitlines()) <= 120
    assert len(snippets()) == 3


def test_every_command_and_configuration_that_it_names_is_there() -> None:
    assert len(shown()) >= 6
    for command in shown():
        assert command[0] in {*COMMANDS, "study", "bench"}
        for word in command:
            assert not word.startswith("config/") or (ROOT / word).is_file()


@pytest.mark.parametrize("page", [README, CONTRIBUTING], ids=["README", "CONTRIBUTING"])
def test_every_page_that_it_links_is_there(page: str) -> None:
    targets = re.findall(r"\]\(([^):#]*)[^):]*\)", page)
    assert targets
    assert not [target for target in targets if not (ROOT / target).exists()]


def test_a_newcomer_reads_of_every_room() -> None:
    assert len(CONTRIBUTING.splitlines()) <= 120
    for room in (ROOT / "hapticd").iterdir():
        if room.is_dir() and (room / "__init__.py").exists():
            assert f"`{room.name}/`" in CONTRIBUTING, room
        elif room.suffix == ".py" and not room.stem.startswith("_"):
            assert f"`{room.name}`" in CONTRIBUTING, room


def test_the_simulation_that_it_shows_runs(tmp_path: Path) -> None:
    command = next(command for command in shown() if command[0] == "simulate")
    command = [str(ROOT / word) if word.startswith("config/") else word for word in command]
    subprocess.run([HAPTICD, *command], cwd=tmp_path, check=True, timeout=60)
    assert (tmp_path / "run.csv").read_text().startswith("t_s,x_m,")


def test_the_subscriber_that_it_shows_arms_and_prints_ticks() -> None:
    with Daemon((ROOT / "config" / "wall-12-energy-cycle.toml").read_text()).wait_ready() as daemon:
        environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run"), "PYTHONUNBUFFERED": "1"}
        subprocess.run([HAPTICD, "disarm"], env=environment, check=True, timeout=60)
        subscriber = subprocess.Popen(
            [sys.executable, "-c", snippets()[0]],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
            stderr=subprocess.DEVNULL,
        )
        try:
            assert subscriber.stdout is not None
            lines = iter(subscriber.stdout.readline, "")
            assert any(f"code={EventCode.ARMED}" in line for line in lines)
            assert any("Position(" in line for line in lines)
        finally:
            subscriber.kill()
            subscriber.communicate()


def test_the_offline_run_that_it_shows_settles() -> None:
    done = subprocess.run(
        [sys.executable, "-c", snippets()[1]], cwd=ROOT, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stderr
    outcome, depth = done.stdout.splitlines()[0].rsplit(maxsplit=1)
    assert outcome == "settled"
    assert -2e-3 < float(depth) < -2e-4


def test_the_law_that_it_shows_damps_a_wall(tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "damper.py").write_text(snippets()[2])
    config = tmp_path / "lab.toml"
    table = 'law = "lab.damper"\nparams = { damping_n_s_per_m = 7.0 }'
    config.write_text((ROOT / "config" / "wall-12-none.toml").read_text().replace('law = "none"', table))
    subprocess.run(
        [HAPTICD, "simulate", "--config", config, "--duration", "0.5", "--output", "run.csv"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        check=True,
        timeout=60,
    )
    header, *rows = (tmp_path / "run.csv").read_text().splitlines()
    damping = header.split(",").index("damping_n_s_per_m")
    assert {row.split(",")[damping] for row in rows} <= {"7", "7.0", "0", "0.0"}
    assert any(float(row.split(",")[damping]) == 7.0 for row in rows)
