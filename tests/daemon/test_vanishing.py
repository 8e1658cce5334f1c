"""A file that cannot even be looked at, a directory that goes: nothing of that ends a running daemon."""

from __future__ import annotations

import shutil

from tests.daemon.running import Daemon, Subscriber
from tests.daemon.test_commands import ask
from tests.daemon.test_deaths import PRESSED

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
