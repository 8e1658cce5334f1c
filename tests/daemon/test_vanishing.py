"""A file that cannot even be looked at, a directory that goes: only without its own does a running daemon end."""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.daemon.running import Daemon, Subscriber, all_records, wait_until
from tests.daemon.test_commands import ask
from tests.daemon.test_deaths import PRESSED, pressing, ramped_out
from tests.remote.stage import CONFIG, remote_pid, runtime

ELSEWHERE = 'mkdir "$3.d" && cp "$3" "$3.d/lab.toml" && cd "$3.d" && exec "$0" run --config lab.toml'
"""For a shell before the command: run it in a directory of its own, by a relative path."""


def test_a_file_that_cannot_be_looked_at_changes_nothing() -> None:
    """Such as one on a share that is gone; here a link to a name that no file system takes, whoever runs this."""
    with Daemon(PRESSED).wait_ready() as daemon:
        daemon.config.unlink()
        daemon.config.symlink_to("long" * 100)
        refused = ask(daemon, "reload")
        assert refused.returncode == 2
        assert "lab.toml: cannot be read: File name too long" in refused.stderr
        assert ask(daemon, "disarm").returncode == 0


def test_a_working_directory_that_goes_takes_no_daemon_with_it() -> None:
    with Daemon(PRESSED, prefix=("sh", "-c", ELSEWHERE)).wait_ready() as daemon:
        directory = daemon.config.with_name("lab.toml.d")
        shutil.rmtree(directory)
        with Subscriber(daemon.endpoint, "hapticd/status") as subscriber:
            for _ in range(3):
                assert subscriber.until("hapticd/status")["config_file"] == str(directory / "lab.toml")


def remove_lock(directory: Path) -> None:
    (directory / "lock").unlink()


def replace_lock(directory: Path) -> None:
    remove_lock(directory)
    (directory / "lock").touch()


def put_a_file_in_its_place(directory: Path) -> None:
    shutil.rmtree(directory)
    directory.write_text("a file")


@pytest.mark.parametrize("take_away", [remove_lock, replace_lock, shutil.rmtree, put_a_file_in_its_place])
def test_a_daemon_whose_runtime_directory_is_taken_away_lets_go_and_ends(take_away: Callable[[Path], None]) -> None:
    """It went on, armed, and no one could disarm it. Where a file lay in the place of the directory, its end failed."""
    with Daemon(PRESSED).wait_ready() as daemon:
        pressing(daemon)
        memory = daemon.memory()
        began_ns = time.monotonic_ns()
        take_away(runtime(daemon))
        assert daemon.wait_exit() == 1
        assert "run/default: this daemon's lock there was removed or replaced" in daemon.output()
        assert "Traceback" not in daemon.output()
        assert ramped_out([record for record in all_records(memory) if record.deadline_ns > began_ns])
        memory.close()


def test_a_daemon_that_ends_leaves_what_a_second_one_has_in_the_place_of_its_own() -> None:
    """It removed the lock and the sockets of the second one, which no one could disarm then."""
    with Daemon(CONFIG).wait_ready() as first:
        directory = runtime(first)
        first.process.send_signal(signal.SIGSTOP)  # or it would end before the second one is there
        remove_lock(directory)
        here = ("env", f"HAPTICD_RUNTIME_DIR={directory.parent}")
        with Daemon(CONFIG, prefix=here).wait_ready() as second:
            wait_until((directory / "scene").exists, "all sockets of the second")
            before = {file.name: file.stat().st_ino for file in directory.iterdir()}
            first.process.send_signal(signal.SIGCONT)
            assert first.wait_exit() == 1
            assert {file.name: file.stat().st_ino for file in directory.iterdir()} == before
            assert sorted(before) == ["control", "lock", "scene", "state", "telemetry"]
            assert second.process.poll() is None


def test_a_remote_process_that_dies_where_the_directory_is_a_file_does_not_end_the_daemon_halfway() -> None:
    """It ended in a NotADirectoryError."""
    with Daemon(CONFIG).wait_ready() as daemon:
        remote = remote_pid(daemon)
        put_a_file_in_its_place(runtime(daemon))
        os.kill(remote, signal.SIGKILL)
        assert daemon.wait_exit() == 1
        assert "this daemon's lock there was removed or replaced" in daemon.output()
        assert "Traceback" not in daemon.output()
