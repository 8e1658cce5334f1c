"""A daemon as a user starts it, with directories of its own, for a benchmark that looks at it from outside."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hapticd.errors import HapticdError

END_TIMEOUT_S = 10.0


class RunningDaemon:
    """A daemon that runs.

    Args:
        config: its configuration.
        directory: where its sockets, its log and its faults go.

    Attributes:
        process: its supervisor.
        endpoint: where it publishes.
    """

    def __init__(self, config: Path, directory: Path) -> None:
        self.endpoint = f"ipc://{directory}/default/telemetry"
        self._environment = os.environ | {
            "HAPTICD_RUNTIME_DIR": str(directory),
            "HAPTICD_STATE_DIR": str(directory),
            "PYTHONPATH": os.pathsep.join(filter(None, (str(directory), os.environ.get("PYTHONPATH")))),
        }
        self._log = directory / "log"
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "hapticd", "run", "--config", str(config)],
                env=self._environment,
                stdout=log,
                stderr=log,
            )

    def command(self, *arguments: str) -> None:
        """Run `hapticd ARGUMENTS` for it.

        Raises:
            HapticdError: it was refused.
        """
        done = subprocess.run(
            [sys.executable, "-P", "-m", "hapticd", *arguments],
            env=self._environment,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise self.failed(f"`hapticd {' '.join(arguments)}` was refused: {done.stderr.strip()}")

    @contextmanager
    def started(self, *arguments: str) -> Iterator[subprocess.Popen[str]]:
        """`hapticd ARGUMENTS` beside it, for as long as the block lasts."""
        with subprocess.Popen(
            [sys.executable, "-P", "-m", "hapticd", *arguments],
            env=self._environment | {"PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as process:
            try:
                yield process
            finally:
                process.kill()

    def control_pid(self) -> int:
        """The process that runs its loop.

        Raises:
            HapticdError: there is none.
        """
        supervisor = self.process.pid
        for child in Path(f"/proc/{supervisor}/task/{supervisor}/children").read_text().split():
            if b"hapticd.loop.process" in Path(f"/proc/{child}/cmdline").read_bytes():
                return int(child)
        raise HapticdError("the daemon has no control process")

    def failed(self, how: str) -> HapticdError:
        """An error that ends with what the daemon said."""
        return HapticdError(f"{how}; the daemon said:\n{self._log.read_text().rstrip()}")

    def end(self) -> None:
        """Ask it to end, and see that it does."""
        self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(END_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


@contextmanager
def running_daemon(config: Path, directory: Path) -> Iterator[RunningDaemon]:
    """A daemon for as long as the block lasts."""
    daemon = RunningDaemon(config, directory)
    try:
        yield daemon
    finally:
        daemon.end()
