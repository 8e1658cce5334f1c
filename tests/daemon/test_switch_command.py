"""`hapticd switch` on a running daemon: file and loop change together, or neither does."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from hapticd.tick.event import EventCode
from tests.daemon.running import HAPTICD, Daemon, Subscriber
from tests.daemon.test_deaths import PRESSED, pressing
from tests.daemon.test_switching import Asker


@pytest.fixture(scope="module")
def running() -> Iterator[Daemon]:
    with Daemon(PRESSED).wait_ready() as running:
        pressing(running)
        yield running


@pytest.fixture
def daemon(running: Daemon) -> Daemon:
    """As it was at first, whatever was switched before."""
    running.config.write_text(PRESSED)
    with Asker(running) as ask:
        assert ask("reload", wait=True)["ok"]
    return running


def switch(daemon: Daemon, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run")}
    command = [HAPTICD, "switch", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, cwd="/", check=False)


def test_the_daemon_is_asked_which_file_it_runs_and_takes_the_edit_over(daemon: Daemon) -> None:
    with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber:
        subscriber.until("hapticd/status")  # it is heard
        done = switch(daemon, "tdpa", "--set", "damping_cap_n_s_per_m=20")
        assert (done.returncode, done.stderr) == (0, "")
        assert "has taken it over" in done.stdout
        event = subscriber.until("hapticd/event", code=EventCode.SWITCHED)
    assert (event["law_before"], event["law"]) == ("ring-damping", "tdpa")
    assert daemon.config.read_text().startswith(PRESSED.rstrip())
    with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        assert subscriber.until("hapticd/status", law="tdpa")["config_file"] == str(daemon.config)


def test_what_is_in_force_already_is_not_said_to_be_taken_over(daemon: Daemon) -> None:
    assert switch(daemon, "none").returncode == 0
    done = switch(daemon, "none")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == f"{daemon.config}: nothing to change\ndaemon 'default' has read it again\n"


def test_what_only_the_daemon_can_refuse_is_taken_back(daemon: Daemon) -> None:
    """The file could be started with; that another edit in it needs a restart is known to the daemon alone."""
    good = daemon.config.read_text()
    daemon.config.write_text(before := good + "[loop]\nrate_hz = 2000.0\n")
    done = switch(daemon, "none")
    assert (done.returncode, done.stdout) == (2, "")
    assert "loop.rate_hz = 2000.0: needs a restart, 1000.0 is in force" in done.stderr
    assert "as it was" in done.stderr
    assert daemon.config.read_text() == before
    daemon.config.write_text(good)


def test_a_daemon_that_runs_another_file_goes_on(daemon: Daemon, tmp_path: Path) -> None:
    other = tmp_path / "other.toml"
    other.write_text("")
    with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        law = subscriber.until("hapticd/status")["law"]
    done = switch(daemon, "none", "--config", other)
    assert done.returncode == 0
    assert f"runs {daemon.config} and goes on" in done.stdout
    assert other.read_text() == '[controller]\nlaw = "none"\n'
    with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        assert subscriber.until("hapticd/status")["law"] == law


def test_the_same_file_by_another_name_is_the_same(daemon: Daemon, tmp_path: Path) -> None:
    link = tmp_path / "link.toml"
    link.symlink_to(daemon.config)
    done = switch(daemon, "none", "--config", link)
    assert (done.returncode, done.stderr) == (0, "")
    assert "has taken it over" in done.stdout
    assert link.is_symlink()
    with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
        assert subscriber.until("hapticd/status", law="none")


def test_reloads_that_come_faster_than_the_loop_takes_them_end_where_the_file_ends(daemon: Daemon) -> None:
    """One that is worked out against what is no longer in force would keep the wrong law and call it the right one."""
    texts = {law: f"{PRESSED}\n[controller]\nlaw = '{law}'\n" for law in ("none", "tdpa", "energy-cycle")}
    with Subscriber(daemon.endpoint, "hapticd/event", "hapticd/status") as subscriber, Asker(daemon) as ask:
        running = subscriber.until("hapticd/status")["law"]
        for law in [*texts] * 20:
            daemon.config.write_text(texts[law])
            assert ask("reload")["ok"]
        assert ask("reload", wait=True)["ok"]
        switches = 0
        for topic, fields in subscriber.maps():
            if topic == "hapticd/event" and fields["code"] == EventCode.SWITCHED:
                assert fields["law_before"] == running
                running = fields["law"]
                switches += 1
            if switches and topic == "hapticd/status" and fields["law"] == running == "energy-cycle":
                break
    assert ask_law(daemon) == "energy-cycle"


def ask_law(daemon: Daemon) -> str:
    with Asker(daemon) as ask:
        return str(ask("status")["status"]["law"])
